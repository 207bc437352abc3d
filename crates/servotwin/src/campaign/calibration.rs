//! Calibration flights of the specimen pool in the scenario *fitted*: simulates the sensors, and fits the twin of each
//! specimen.
//!
//! The fit uses only the noisy, quantized sensor samples of a specimen and the command samples that a logger stores.
//! `calibration-fitted.parquet` stores the results with the true values, in standard deviations of the tolerances. It
//! is computed once: every part of a campaign that finds the file uses exactly its values.

use super::columns::DIMENSIONLESS;
use super::{Campaign, CampaignError, Plants, Setting, described, ensemble};
use crate::ensemble::{Ensemble, Rows, Variant};
use crate::fit::fleet::{Fleet, Specimen};
use crate::fit::{Fit, FitError, Record, Unknown};
use crate::signal::random::Random;
use crate::study::{Calibration, Lot, Role, Study};
use crate::system::imperfection::Imperfections;
use crate::table::{self, Column, Table, Values};
use servotwin_model::hash::TextHash;
use servotwin_model::solver::{Failure, Settings};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Parameters that differ from the system's: (component, parameter, value).
pub(crate) type Overrides = Vec<(usize, usize, f64)>;

/// The path of the file with the specimens of a pool: true values, fitted values and standard errors.
pub fn calibration_file(folder: &Path, role: Role) -> PathBuf {
    folder.join(calibration_name(role))
}

fn calibration_name(role: Role) -> String {
    format!("calibration-{}{}.parquet", Setting::Fitted.name(), role.suffix())
}

/// A true parameter with its fitted value, in standard deviations of its tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The parameter's full name.
    pub parameter: String,
    /// The true value, in standard deviations.
    pub true_sigma: f64,
    /// The fitted value, in standard deviations.
    pub fitted_sigma: f64,
    /// The standard error of the fit.
    pub error_sigma: f64,
}

/// Reads the specimens of a pool; empty if it has not been calibrated.
///
/// # Errors
/// The file cannot be read.
pub fn calibrations(folder: &Path, role: Role) -> Result<Vec<Comparison>, CampaignError> {
    let file = calibration_file(folder, role);
    if !file.exists() {
        return Ok(vec![]);
    }
    let table = table::read(&file)?;
    let (truth, fitted) = (table.f64("true_sigma")?, table.f64("fitted_sigma")?);
    let errors = table.f64("error_sigma")?;
    let names = table.text("parameter")?;
    let row = |(row, name): (usize, &String)| Comparison {
        parameter: name.clone(),
        true_sigma: truth[row],
        fitted_sigma: fitted[row],
        error_sigma: errors[row],
    };
    Ok(names.iter().enumerate().map(row).collect())
}

/// Fits twins to specimens in the calibration flight of a study.
pub struct Calibrating<'s> {
    /// The study with the calibration flight.
    pub study: &'s Study,
    /// Solver settings of the runs.
    pub solver: Settings,
    /// Number of threads.
    pub threads: usize,
    /// Set by another thread to stop.
    pub cancel: Option<&'s AtomicBool>,
}

impl Calibrating<'_> {
    /// Fits the twins of specimens, each with the noise of its own flight.
    ///
    /// # Errors
    /// The study has no calibration flight, or a specimen cannot be simulated or fitted; [`CampaignError::Cancelled`].
    pub fn fit(
        &self,
        specimens: &[Overrides],
        noise: impl Fn(usize) -> Random,
    ) -> Result<Calibrated, CampaignError> {
        let Some(calibration) = &self.study.calibration else {
            return Err(CampaignError::no_section(Setting::Fitted, self.study));
        };
        let measured = self.measured(calibration, specimens, noise)?;
        let sensors = self.study.measured[..self.study.base_sensors()].to_vec();
        let (inputs, period_s) = (&calibration.inputs, self.study.sample_period_s);
        let first = measured.first().cloned().unwrap_or_default();
        let record = Record::logged("calibration flight", inputs, sensors, period_s, first);
        let problem = Fit {
            unknowns: Unknown::of_study(self.study),
            solver: self.solver,
            threads: self.threads,
            cancel: self.cancel,
            ..Fit::new(&self.study.system, vec![record])
        };
        match fitted(&problem, &measured) {
            Err((_, FitError::Cancelled)) => Err(CampaignError::Cancelled),
            Err((specimen, error)) => {
                Err(CampaignError::Calibration { specimen, reason: error.to_string() })
            }
            Ok((specimens, errors)) => {
                Ok(Calibrated { unknowns: problem.unknowns, specimens, errors })
            }
        }
    }

    /// The sensor values of each specimen in its calibration flight.
    fn measured(
        &self,
        calibration: &Calibration,
        specimens: &[Overrides],
        noise: impl Fn(usize) -> Random,
    ) -> Result<Vec<Vec<f64>>, CampaignError> {
        let study = self.study;
        let sensors = &study.measured[..study.base_sensors()];
        let imperfections = Imperfections::of(&study.system, sensors);
        let mut ensemble = Ensemble {
            duration_s: calibration.duration_s,
            settings: self.solver,
            threads: self.threads,
            cancel: self.cancel,
            ..ensemble(study)
        };
        ensemble.record.truncate(sensors.len());
        let mut all = vec![Vec::new(); specimens.len()];
        let mut failed: Option<(usize, Failure)> = None;
        ensemble.run(
            specimens.len(),
            |specimen| Variant {
                overrides: specimens[specimen].clone(),
                inputs: calibration.inputs.iter().collect(),
                ..Variant::default()
            },
            |_| Rows::default(),
            |specimen, rows, outcome| match outcome {
                Ok(_) => all[specimen] = rows.0,
                Err(failure) => failed = Some((specimen, failure)),
            },
        );
        if self.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Err(CampaignError::Cancelled);
        }
        if let Some((specimen, failure)) = failed {
            let reason = described(study, &failure);
            return Err(CampaignError::Calibration { specimen, reason });
        }
        for (specimen, samples) in all.iter_mut().enumerate() {
            imperfections.apply_to_all(samples, &mut noise(specimen));
        }
        Ok(all)
    }
}

impl Campaign<'_> {
    /// The name of the file that all parts read, so that not each part must fit the specimens; `None` if nothing is
    /// fitted.
    pub fn calibration(&self) -> Option<String> {
        (self.plants() == Plants::Pool).then(|| calibration_name(self.role))
    }

    /// Fits the specimens unless their file exists; `false` if cancelled.
    ///
    /// # Errors
    /// A specimen cannot be fitted, or the file cannot be written.
    pub fn calibrate(&self) -> Result<bool, CampaignError> {
        self.calibrated().map(|found| found.is_some())
    }

    /// The parameters of every specimen's twin, fitted to its calibration flight; `None` if cancelled.
    pub(super) fn calibrated(&self) -> Result<Option<Vec<Overrides>>, CampaignError> {
        let (Some(realism), Some(calibration)) = (&self.study.realism, &self.study.calibration)
        else {
            return Err(CampaignError::no_section(Setting::Fitted, self.study));
        };
        if let Some(known) = self.known(calibration.specimens(self.role)) {
            return Ok(Some(known));
        }
        let lot = Lot::pool(self.role);
        let truth: Vec<Overrides> = (0..calibration.specimens(self.role))
            .map(|specimen| realism.specimen(self.study, lot, specimen))
            .collect();
        let Campaign { study, solver, threads, cancel, .. } = *self;
        let calibrating = Calibrating { study, solver, threads, cancel };
        let found = match calibrating.fit(&truth, |specimen| realism.noise(lot, specimen)) {
            Err(CampaignError::Cancelled) => return Ok(None),
            found => found?,
        };
        self.write_calibration(&truth, &found)?;
        Ok(Some(found.specimens.into_iter().map(|specimen| specimen.overrides).collect()))
    }

    /// The parameters stored in this campaign's file for `specimens` specimens; `None` without a matching file.
    fn known(&self, specimens: usize) -> Option<Vec<Overrides>> {
        let table = table::read(calibration_file(&self.folder, self.role)).ok()?;
        if table.metadata.get("fingerprint") != Some(&self.calibration_mark()) {
            return None;
        }
        let unknowns = Unknown::of_study(self.study);
        let z = table.f64("fitted_sigma").ok()?;
        let problem = Fit { unknowns, ..Fit::new(&self.study.system, vec![]) };
        let size = problem.unknowns.len().max(1);
        let of = |z: &[f64]| problem.variant(z, &[]).overrides;
        (z.len() == specimens * size).then(|| z.chunks(size).map(of).collect())
    }

    /// Fingerprint of everything that determines a pool.
    fn calibration_mark(&self) -> String {
        let study = self.study;
        let mut mark = TextHash::default();
        mark.add(format_args!(
            "calibration 1 {:?} {:?} {} ",
            self.role, self.solver, study.sample_period_s
        ));
        mark.add(format_args!("{}", self.model_text()));
        mark.add(format_args!("{:?} {:?}", study.realism, study.calibration));
        mark.to_string()
    }

    fn write_calibration(
        &self,
        truth: &[Overrides],
        found: &Calibrated,
    ) -> Result<(), CampaignError> {
        let unknowns = &found.unknowns;
        let size = unknowns.len();
        let rows = || (0..found.specimens.len()).flat_map(|n| (0..size).map(move |k| (n, k)));
        let float = |of: &dyn Fn(usize, usize) -> f64| {
            Values::Float(rows().map(|(n, k)| of(n, k)).collect())
        };
        let specimens = rows().map(|(n, _)| n as u32).collect();
        let names = rows().map(|(_, k)| unknowns[k].name.clone()).collect();
        let sigmas = |name: &str, values: Values, what: &str| {
            Column::new(name, DIMENSIONLESS, values)
                .described(format!("{what}, in standard deviations."))
        };
        let table = Table::from_columns(vec![
            Column::new("specimen", DIMENSIONLESS, Values::Unsigned(specimens))
                .described("Number of the specimen in the pool."),
            Column::new("parameter", "", Values::Text(names))
                .described("Parameter, or first of the parameters that vary together."),
            sigmas("true_sigma", float(&|n, k| unknowns[k].sigmas(&truth[n])), "True value"),
            sigmas("fitted_sigma", float(&|n, k| found.specimens[n].z[k]), "Fitted value"),
            sigmas("error_sigma", float(&|_, k| found.errors[k]), "Standard error of the fit"),
        ])?
        .with_metadata("fingerprint", self.calibration_mark());
        Ok(table::write(calibration_file(&self.folder, self.role), &table)?)
    }
}

/// Specimens with their twins, and their common standard errors.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The fitted unknowns.
    pub unknowns: Vec<Unknown>,
    /// The fitted specimens.
    pub specimens: Vec<Specimen>,
    /// The standard error of each unknown, in standard deviations of its tolerance.
    pub errors: Vec<f64>,
}

/// Fits all specimens; fails at the first that cannot be fitted.
fn fitted(
    problem: &Fit,
    measured: &[Vec<f64>],
) -> Result<(Vec<Specimen>, Vec<f64>), (usize, FitError)> {
    let of_all = |error| (0, error);
    let fleet = Fleet::new(problem).map_err(of_all)?;
    let covariance = fleet.covariance().ok_or((0, FitError::Undetermined))?;
    let errors = (0..problem.unknowns.len()).map(|k| covariance.at(k, k).sqrt()).collect();
    let found = fleet.fit(measured).map_err(of_all)?;
    let numbered = found.into_iter().enumerate();
    let specimens = numbered.map(|(n, specimen)| specimen.map_err(|error| (n, error)));
    Ok((specimens.collect::<Result<_, _>>()?, errors))
}
