//! Experiments: simulated plants beside their twins. A campaign and flights are plans over it: which variants fly,
//! beside which twins, and who observes them.
//!
//! ```text
//! SpecimenDraw ── parameters ──► plant ───► recorded values ──► SensorChain ──► measured ─┐
//!      │                                                                                  ├─► Observer
//!      └── calibration flight ──► twin ───► recorded values ──────────────────► expected ─┘
//! ```
//!
//! A twin is simulated once and kept whole ([`twins`]); plants fly in lanes, and nothing of them is kept but what their
//! observers keep ([`watch`]).

mod calibration;
mod error;
mod sensors;
mod specimen;
mod twins;
mod watch;

pub(crate) use calibration::{
    Calibrated, calibration_flights, calibration_of, calibration_record, fit_twins,
};
pub use error::CampaignError;
pub(crate) use sensors::SensorChain;
pub(crate) use specimen::{Overrides, SpecimenDraw};
pub(crate) use twins::{RecordedRun, Twins, describe, simulate_twins};
pub use watch::Observer;
pub(crate) use watch::Watch;

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
