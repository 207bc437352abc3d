//! From residuals to a diagnosis: learning and running classifiers of faults.
//!
//! `no_std` with `alloc`. What is here, from the bottom up:
//! [`data`] holds validated training samples, [`tree`] the decision tree that CART, random forest
//! and AdaBoost share, [`classifiers`] the classifiers behind one trait, [`calibration`] what their
//! probabilities are worth, [`evaluation`] the splits and scores they are judged with, [`hierarchy`]
//! the trees that follow each other from the actuator to the detail, [`diagnoser`] all of it beside a
//! running actuator, sample by sample.
//!
//! Everything is deterministic: seeds are explicit settings, ties go to the lowest index, and the
//! same samples and settings give the same model bit for bit.
#![no_std]
extern crate alloc;

pub mod baseline;
pub mod calibration;
pub mod classifiers;
pub mod conditional_band;
pub mod diagnoser;
pub mod error;
pub mod features;
pub mod hierarchy;
pub mod numeric;
pub mod panel;
pub mod random;
pub mod residual;
pub mod sliding;
pub mod tree;

pub use error::Error;
