//! From residuals to a diagnosis.
#![no_std]
extern crate alloc;

pub mod features;
pub mod residual;
