//! Twins fitted to plants that differ from them in structure.
//!
//! Each environment has one plant. It flies the study's calibration flight, and the twin of the environment is fitted
//! to what the sensors show there: the tolerances and what every plant draws (`[flights].draws`) are unknown. What the
//! environment sets itself, such as a temperature, is no property of a plant and stays as the twin receives it.
//!
//! The twin cannot take over the structure of the plant, so a fit usually has a finding. `servotwin fit` would then
//! write nothing, because a finding may be a fault. Here the plant is known to be healthy, and the twin takes the fit.

use super::runner::Runner;
use super::{Overrides, RunError, calibration_flights, calibration_of, calibration_record};
use crate::fit::{Fit, FitError, Unknown};
use crate::parallel::Workers;
use crate::study::Calibration;
use serde::{Deserialize, Serialize};

/// What became of the calibration flights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CalibrationRecords {
    /// The number of flights.
    pub flown: usize,
    /// Flights whose record was rejected: their twins stay nominal.
    pub rejected: usize,
    /// Fits with a deviation that nothing unknown explains.
    pub with_findings: usize,
}

impl CalibrationRecords {
    /// Adds those of other flights.
    pub(crate) fn add(&mut self, other: CalibrationRecords) {
        self.flown += other.flown;
        self.rejected += other.rejected;
        self.with_findings += other.with_findings;
    }
}

/// Fits the twin of each environment to its plant. Returns the parameters of the twins.
pub(super) fn fit(
    flown: &Runner,
    workers: Workers,
) -> Result<(Vec<Overrides>, CalibrationRecords), RunError> {
    let study = flown.study();
    let calibration = calibration_of(study)?;
    let measured = measured(flown, calibration)?;
    let unknowns = unknowns(flown);
    let mut records = CalibrationRecords { flown: measured.len(), ..Default::default() };
    let mut twins = vec![];
    for measured in measured {
        let record = calibration_record(study, calibration, flown.sensors, measured);
        let problem = Fit {
            unknowns: unknowns.clone(),
            threads: workers.threads(),
            cancel: workers.cancel(),
            ..Fit::new(&study.system, vec![record])
        };
        twins.push(match problem.solve() {
            Ok(fitted) => {
                records.with_findings += usize::from(!fitted.is_update());
                fitted.overrides
            }
            Err(FitError::Cancelled) => return Err(RunError::Cancelled),
            Err(_) => {
                records.rejected += 1;
                vec![]
            }
        });
    }
    Ok((twins, records))
}

/// Tolerances and draws, without what an environment sets.
pub(super) fn unknowns(flown: &Runner) -> Vec<Unknown> {
    let environments = flown.environments.iter();
    let told: Vec<(usize, usize)> =
        environments.flat_map(|e| e.parameters.iter().map(|told| (told.0, told.1))).collect();
    let all = Unknown::of_study(flown.study()).into_iter().chain(Unknown::of_draws(flown.study()));
    all.filter(|unknown| !unknown.has_any(&told)).collect()
}

/// The sensor values of each plant in its calibration flight, ordered by sample.
fn measured(flown: &Runner, calibration: &Calibration) -> Result<Vec<Vec<f64>>, RunError> {
    let (_, ensemble) = flown.others.as_ref().expect("plants of another structure");
    calibration_flights(
        ensemble,
        calibration,
        &flown.specimens(),
        |place, variant| flown.alter_plant(flown.seed_of_environment(place), variant),
        |place| flown.sensors_of(flown.seed_of_environment(place), flown.calibration_noise(place)),
    )
}
