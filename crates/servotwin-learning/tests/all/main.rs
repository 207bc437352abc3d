//! All integration tests of the crate in one binary, to link once.

mod boosted_trees;
mod calibration;
mod classifiers_contract;
mod missing;
mod samples;
mod splits;
mod tables;
mod tree;
mod val_sklearn;
