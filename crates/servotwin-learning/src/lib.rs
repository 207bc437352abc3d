//! Training of the models that `servotwin-diagnosis` runs.
//!
//! `no_std` with `alloc`. From the bottom up: `samples` holds validated training samples, and [`tree`] grows the
//! decision trees of CART, random forest and AdaBoost. [`classifiers`] trains all classifiers behind one trait, and
//! [`calibration`] fits their probabilities. [`splits`] and [`metrics`] evaluate them. [`hierarchy`] trains the trees
//! from the actuator down to the detail, [`novelty`] learns the ranges of the training data and [`explained`] the rows
//! that explain an action, and [`augmentation`] makes variations of windows.
//!
//! Everything is deterministic: seeds are explicit settings, ties go to the lowest index, and the same samples and
//! settings give the same model bit for bit.
#![no_std]
extern crate alloc;

pub mod augmentation;
pub mod calibration;
pub mod classifiers;
pub mod explained;
pub mod hierarchy;
pub mod metrics;
pub mod novelty;
mod numeric;
pub(crate) mod samples;
pub mod splits;
pub mod tree;

pub use samples::Samples;
pub use servotwin_diagnosis::Error;
