//! All integration tests of the crate in one binary, to link once.

mod boosted_trees;
mod calibration;
mod classifiers_contract;
mod data;
mod diagnoser;
mod evaluation;
mod missing;
mod reference;
mod tables;
#[allow(dead_code)]
#[path = "../toy/mod.rs"]
mod toy;
mod tree;
mod val_sklearn;
