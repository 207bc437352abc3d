//! From residuals to a diagnosis: the code that runs beside an actuator.
//!
//! `no_std` with `alloc`. From the bottom up: [`residual`] keeps the statistics of a window, [`windows`] slides windows of
//! all kinds over the samples and divides residuals by their [`spread`], and [`features`] computes a row of numbers from
//! one. [`classifiers`] runs trained models behind one trait. [`hierarchy`] runs the trees from the actuator down to the
//! detail, and [`panel`] joins bands, trees and
//! committee. [`diagnoser`] does all of this sample by sample. The crate `servotwin-learning` trains the models.
//!
//! Everything is deterministic: ties go to the lowest index, and the same samples give the same answers bit for bit.
#![no_std]
extern crate alloc;

pub mod baseline;
pub mod calibration;
pub mod classifiers;
pub mod diagnoser;
pub mod error;
pub mod features;
pub mod hierarchy;
pub mod number;
pub mod numeric;
pub mod panel;
pub mod random;
pub mod residual;
pub mod sliding;
pub mod spread;
pub mod tree;
pub mod windows;

pub use error::Error;
