//! Runs: simulated plants beside their twins.
//!
//! ```text
//! suite ──► Run ──► plant ───► recorded values ──► SensorChain ──► measured ─┐
//!   │        │                                                               ├─► Observer
//!   └─ environment ► twin ───► recorded values ──────────────────► expected ─┘
//! ```
//!
//! - [`plan`]: the runs of a suite
//! - `runner`: flies them in lanes, beside the twins of their environments
//! - `part`, `compute`: divides a suite into parts, and computes their files
//! - [`fitted_twins`], [`other_plant`]: twins and plants that are not nominal
//!
//! A twin is simulated once and kept whole (`twins`); plants fly in lanes, and nothing of them is kept but what their
//! observers keep (`beside_twin`).

mod beside_twin;
mod calibration;
pub(crate) mod compute;
mod error;
pub mod fitted_twins;
pub mod other_plant;
pub mod part;
pub mod plan;
pub(crate) mod runner;
mod sensors;
mod specimen;
mod twins;

pub use beside_twin::Observer;
pub(crate) use beside_twin::Watch;
pub(crate) use calibration::{calibration_flights, calibration_of, calibration_record, fit_twins};
pub use error::RunError;
pub(crate) use plan::Profile;
pub use plan::{Run, RunName};
pub use runner::Runner;
pub(crate) use sensors::SensorChain;
pub(crate) use specimen::{Overrides, SpecimenDraw, fitted_specimen};
pub(crate) use twins::{RecordedRun, Twins, describe, simulate_twins};

use crate::ensemble::Ensemble;
use crate::study::Study;

/// An ensemble of the study's system that records the measured signals.
pub fn ensemble(study: &Study) -> Ensemble<'_> {
    Ensemble {
        record: study.system.sensor_slots(&study.measured),
        duration_s: study.duration_s,
        sample_period_s: study.sample_period_s,
        ..Ensemble::of(&study.system)
    }
}

#[cfg(test)]
mod tests;
