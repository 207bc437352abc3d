//! Calibration flights: specimens fly the calibration flight of a study, and twins are fitted to what their sensors
//! show there.
//!
//! A fit uses only the noisy, quantized sensor samples of a specimen and the command samples that a logger stores.

use super::twins::{RecordedRun, record_runs};
use super::{Overrides, RunError, SensorChain};
use crate::ensemble::{Ensemble, Variant};
use crate::fit::fleet::Specimen;
use crate::fit::{Fit, FitError, FitRecord, Unknown};
use crate::signal::random::NormalDeviates;
use crate::study::{Calibration, Scenario, Study};

/// The calibration flight of a study.
///
/// # Errors
/// The study has none.
pub(crate) fn calibration_of(study: &Study) -> Result<&Calibration, RunError> {
    study.calibration.as_ref().ok_or_else(|| RunError::no_section(Scenario::Fitted, study))
}

/// The sensor values of specimens in a calibration flight, each ordered by sample. `alter` changes the plant of a
/// specimen, `sensors` are its sensors.
///
/// # Errors
/// [`RunError::Calibration`] for a specimen that cannot be simulated; [`RunError::Cancelled`].
pub(crate) fn calibration_flights(
    ensemble: &Ensemble,
    calibration: &Calibration,
    specimens: &[Overrides],
    alter: impl Fn(usize, &mut Variant) + Sync,
    sensors: impl Fn(usize) -> SensorChain,
) -> Result<Vec<Vec<f64>>, RunError> {
    let (record, duration_s) = (ensemble.record.clone(), calibration.duration_s);
    let variant = |specimen: usize| {
        let mut variant = Variant {
            overrides: specimens[specimen].clone(),
            inputs: calibration.inputs.iter().collect(),
            ..Variant::default()
        };
        alter(specimen, &mut variant);
        variant
    };
    let error = |specimen, reason| RunError::Calibration { specimen, reason };
    let ensemble = Ensemble { record, duration_s, ..*ensemble };
    let runs = record_runs(&ensemble, specimens.len(), variant, error)?;
    let measured = |(specimen, mut run): (usize, RecordedRun)| {
        let mut sensors = sensors(specimen);
        run.samples.chunks_exact_mut(ensemble.record.len()).for_each(|s| sensors.measure(s));
        run.samples
    };
    Ok(runs.into_iter().enumerate().map(measured).collect())
}

/// The record of a calibration flight from the values of the first `sensors` measured sensors, ordered by sample.
pub(crate) fn calibration_record(
    study: &Study,
    calibration: &Calibration,
    sensors: usize,
    measured: Vec<f64>,
) -> FitRecord {
    let sensors = study.measured[..sensors].to_vec();
    let (inputs, period_s) = (&calibration.inputs, study.sample_period_s);
    let logged = FitRecord::logged("calibration flight", inputs, sensors, period_s, measured);
    // The twin of a test reads its fast command as it is sent. A log would lose it between its samples.
    match study.is_on_ground() {
        true => FitRecord { inputs: inputs.clone(), ..logged },
        false => logged,
    }
}

/// Fits the twins of specimens in the calibration flight of a study, each with the noise of its own flight. The
/// ensemble is one of the study's system and records its sensors first. Also returns the standard error of each
/// unknown, in standard deviations of its tolerance, which all specimens have in common.
///
/// # Errors
/// The study has no calibration flight, or a specimen cannot be simulated or fitted; [`RunError::Cancelled`].
pub(crate) fn fit_twins(
    study: &Study,
    ensemble: &Ensemble,
    (unknowns, specimens): (Vec<Unknown>, &[Overrides]),
    noise: impl Fn(usize) -> Option<NormalDeviates>,
) -> Result<(Vec<Specimen>, Vec<f64>), RunError> {
    let (calibration, sensors) = (calibration_of(study)?, study.base_sensors());
    let record = ensemble.record[..sensors].to_vec();
    let ensemble = Ensemble { record, ..*ensemble };
    let chain = |specimen| SensorChain::new(study, sensors, noise(specimen));
    let measured = calibration_flights(&ensemble, calibration, specimens, |_, _| (), chain)?;
    let first = measured.first().cloned().unwrap_or_default();
    let problem = Fit {
        unknowns,
        solver: ensemble.settings,
        threads: ensemble.threads,
        cancel: ensemble.cancel,
        ..Fit::new(&study.system, vec![calibration_record(study, calibration, sensors, first)])
    };
    problem.fleet(&measured).map_err(|error| match error {
        FitError::Cancelled => RunError::Cancelled,
        error => RunError::Calibration { specimen: 0, reason: error.to_string() },
    })
}
