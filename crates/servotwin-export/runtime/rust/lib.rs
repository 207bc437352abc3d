//! A trained diagnosis for a flight control computer, exported by servotwin: one call of [`Session::push`] for each sample.
//!
//! All state is in one [`Session`], so there may be several. Nothing is allocated, no function calls itself, and every call
//! ends after a bounded number of steps. The order of all sums and products is that of training, so the bits are the same.
//!
//! - [`session`]: plausibility of inputs, lost sensors, decision
//! - [`alarm`]: what may be raised, and what is raised
//! - [`windows`]: statistics of the sliding windows, and the baseline of the specimen
//! - [`features`]: the features of a window, printed from the formulas of training
//! - [`models`]: trees, boosted trees, and the hierarchy from actuator to detail
//! - [`judge`]: the judgement of a window
//! - [`decision`]: the sequential test that gathers evidence
//! - [`boundary`]: doubt about a supply or return pressure that reads wrong
//! - [`trained`], [`tables`], [`sizes`]: the types of everything that was trained, and its values
#![no_std]
#![forbid(unsafe_code)]

pub mod alarm;
pub mod boundary;
pub mod decision;
pub mod features;
pub mod judge;
pub mod models;
pub mod random;
pub mod session;
pub mod sizes;
pub mod tables;
pub mod trained;
pub mod windows;

pub use session::{Alarm, Finding, Outcome, Raised, Session, Why};

/// Whether a product and a sum round twice and correctly, as they must. A target with wider arithmetic, or with wrong
/// doubles in software, does otherwise; there the diagnosis must not be used.
pub fn rounds_twice() -> bool {
    use core::hint::black_box;
    // (1 + e)(1 - e) - 1 is -e^2 if fused, and 0 if the product is rounded first.
    let e = 1.0 / f64::from(1 << 30);
    let difference = black_box(1.0 + e) * black_box(1.0 - e) - black_box(1.0);
    // Some doubles in software (libgcc 12.2 for Arm) lose digits when exponents differ by 33.
    let rest = black_box(1.0) - black_box(f64::from_bits(0x3DE9_D1DF_27E0_DC03));
    difference == 0.0 && rest.to_bits() == 0x3FEF_FFFF_FFE6_2E21
}
