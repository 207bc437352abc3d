//! Twins fitted to plants that differ from them in structure.
//!
//! Each environment has one plant. It flies the study's calibration flight, and the twin of the environment is fitted
//! to what the sensors show there: the tolerances and what every plant draws (`[flights].draws`) are unknown. What the
//! environment sets itself, such as a temperature, is no property of a plant and stays as the twin receives it.
//!
//! The twin cannot take over the structure of the plant, so a fit usually has a finding. `servotwin fit` would then
//! write nothing, because a finding may be a fault. Here the plant is known to be healthy, and the twin takes the fit.

use super::campaign::{Actuator, FlightCampaign, Latencies};
use crate::campaign::{CampaignError, Overrides};
use crate::ensemble::{Ensemble, Rows, Variant};
use crate::fit::unknown::Moved;
use crate::fit::{Fit, FitError, Record, Unknown};
use crate::parallel::Workers;
use crate::study::{Calibration, Setting};
use serde::{Deserialize, Serialize};
use servotwin_model::solver::{Failure, Settings};
use std::collections::BTreeSet;

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

/// Fits the twin of each environment to its plant.
pub(super) fn fit(
    flown: &FlightCampaign,
    workers: Workers,
) -> Result<(Vec<Actuator>, CalibrationRecords), CampaignError> {
    let study = flown.study;
    let Some(calibration) = &study.calibration else {
        return Err(CampaignError::no_section(Setting::Fitted, study));
    };
    let specimens = flown.specimens()?;
    let measured = measured(flown, calibration, &specimens)?;
    let unknowns = unknowns(flown);
    let sensors = &study.measured[..flown.sensors];
    let mut records = CalibrationRecords { flown: specimens.len(), ..Default::default() };
    let mut actuators = vec![];
    for (parameters, measured) in specimens.into_iter().zip(measured) {
        let (inputs, period_s) = (&calibration.inputs, study.sample_period_s);
        let record =
            Record::logged("calibration flight", inputs, sensors.to_vec(), period_s, measured);
        let problem = Fit {
            unknowns: unknowns.clone(),
            threads: workers.threads(),
            cancel: workers.cancel(),
            ..Fit::new(&study.system, vec![record])
        };
        let twin = match problem.solve() {
            Ok(fitted) => {
                records.with_findings += usize::from(!fitted.is_update());
                fitted.overrides
            }
            Err(FitError::Cancelled) => return Err(CampaignError::Cancelled),
            Err(_) => {
                records.rejected += 1;
                vec![]
            }
        };
        actuators.push(Actuator { parameters, twin });
    }
    Ok((actuators, records))
}

/// Tolerances and draws, without what an environment sets.
fn unknowns(flown: &FlightCampaign) -> Vec<Unknown> {
    let environments = flown.environments.iter();
    let told: BTreeSet<(usize, usize)> =
        environments.flat_map(|e| e.parameters.iter().map(|told| (told.0, told.1))).collect();
    let is_told = |unknown: &Unknown| match &unknown.moved {
        Moved::Parameters { members, .. } => members.iter().any(|m| told.contains(&(m.0, m.1))),
        Moved::Fault(..) => false,
    };
    let all = Unknown::of_study(flown.study).into_iter().chain(Unknown::of_draws(flown.study));
    all.filter(|unknown| !is_told(unknown)).collect()
}

/// The sensor values of each plant in its calibration flight, ordered by sample.
fn measured(
    flown: &FlightCampaign,
    calibration: &Calibration,
    specimens: &[Overrides],
) -> Result<Vec<Vec<f64>>, CampaignError> {
    let (plants, ensemble) = flown.others.as_ref().expect("plants of another structure");
    let ensemble = Ensemble {
        duration_s: calibration.duration_s,
        settings: Settings::campaign(),
        record: ensemble.record.clone(),
        ..*ensemble
    };
    let mut all = vec![Vec::new(); specimens.len()];
    let mut failed: Option<(usize, Failure)> = None;
    ensemble.run(
        specimens.len(),
        |place| {
            let mut variant = Variant {
                overrides: specimens[place].clone(),
                inputs: calibration.inputs.iter().collect(),
                ..Variant::default()
            };
            plants.alter(flown.study, flown.number_of(place), &mut variant);
            variant
        },
        |_| Rows::default(),
        |place, rows, outcome| match outcome {
            Ok(_) => all[place] = rows.0,
            Err(failure) => failed = Some((place, failure)),
        },
    );
    if let Some((specimen, failure)) = failed {
        let reason = format!("{} at {:.4} s", failure.cause, failure.time_s);
        return Err(CampaignError::Calibration { specimen, reason });
    }
    for (place, samples) in all.iter_mut().enumerate() {
        let mut latencies = Latencies::new(plants.latencies(flown.number_of(place), flown.sensors));
        samples.chunks_exact_mut(flown.sensors).for_each(|sample| latencies.apply(sample));
        if let Some(mut noise) = flown.calibration_noise(place) {
            flown.imperfections.apply_to_all(samples, &mut noise);
        }
    }
    Ok(all)
}
