//! From residuals to a diagnosis.
#![no_std]
extern crate alloc;
