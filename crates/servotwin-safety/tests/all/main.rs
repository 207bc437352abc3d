//! The one integration test binary of this crate.

mod brute_force;
mod decision_diagram;
mod drawing;
mod function_rate;
mod lanes;
mod severity;
mod sheet;
