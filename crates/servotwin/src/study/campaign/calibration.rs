//! The calibration flights of the pool of the fitted setting: what sensors showed, and the twin of each
//! specimen, fitted to that.
//!
//! Nothing of a specimen is used but the noisy, quantised samples of its sensors; of the command the samples
//! that a logger keeps. What came out is kept beside the true values, in standard deviations of the
//! tolerances: `calibration-fitted.parquet`. It is computed once: every part of a campaign that finds
//! the file takes it over, to the bit.

use super::prepared::Mark;
use super::{Campaign, CampaignError, Plants, Setting, ensemble};
use crate::ensemble::{Ensemble, Rows, Variant};
use crate::fit::fleet::{Fleet, Specimen};
use crate::fit::{FitError, Problem, Record, Unknown};
use crate::study::{Calibration, Imperfections, Lot, Realism, Role};
use crate::table::{self, Column, Table, Values};
use servotwin_model::solver::Failure;
use std::path::{Path, PathBuf};

/// Parameters that differ from the system's: (component, parameter, value).
type Overrides = Vec<(usize, usize, f64)>;

/// The file with the specimens of a pool: true values, what was fitted, and its standard error.
pub fn calibration_file(folder: &Path, role: Role) -> PathBuf {
    folder.join(calibration_name(role))
}

fn calibration_name(role: Role) -> String {
    format!("calibration-{}{}.parquet", Setting::Fitted.name(), role.suffix())
}

impl Campaign<'_> {
    /// The file that all parts read, or else each would have to fit the specimens itself; `None` where
    /// nothing is fitted.
    pub fn calibration(&self) -> Option<String> {
        (self.plants() == Plants::Pool).then(|| calibration_name(self.role))
    }

    /// Fits the specimens, if the file with them is not there; `false` if cancelled.
    ///
    /// # Errors
    /// A specimen cannot be fitted, or the file not be written.
    pub fn calibrate(&self) -> Result<bool, CampaignError> {
        self.calibrated().map(|found| found.is_some())
    }

    /// The parameters of every specimen's twin, fitted to its calibration flight; `None` if cancelled.
    pub(super) fn calibrated(&self) -> Result<Option<Vec<Overrides>>, CampaignError> {
        let (Some(realism), Some(calibration)) = (&self.study.realism, &self.study.calibration)
        else {
            return Err(CampaignError::NoSection { setting: Setting::Fitted });
        };
        if let Some(known) = self.known(calibration.specimens(self.role)) {
            return Ok(Some(known));
        }
        let truth: Vec<Overrides> = (0..calibration.specimens(self.role))
            .map(|specimen| realism.specimen(self.study, Lot::pool(self.role), specimen))
            .collect();
        let measured = self.measured(realism, calibration, &truth)?;
        if self.is_cancelled() {
            return Ok(None);
        }
        let sensors = self.study.measured[..self.study.base_sensors()].to_vec();
        let (inputs, period_s) = (&calibration.inputs, self.study.sample_period_s);
        let first = measured.first().cloned().unwrap_or_default();
        let record = Record::logged("calibration flight", inputs, sensors, period_s, first);
        let problem = Problem {
            unknowns: Unknown::of_study(self.study),
            solver: self.solver,
            threads: self.threads,
            cancel: self.cancel,
            ..Problem::new(&self.study.system, vec![record])
        };
        let found = match fitted(&problem, &measured) {
            Err((_, FitError::Cancelled)) => return Ok(None),
            Err((specimen, error)) => {
                return Err(CampaignError::Calibration { specimen, reason: error.to_string() });
            }
            Ok(found) => found,
        };
        self.write_calibration(&problem.unknowns, &truth, &found)?;
        Ok(Some(found.specimens.into_iter().map(|specimen| specimen.overrides).collect()))
    }

    /// What a file of this campaign says of so many specimens; `None` if there is none.
    fn known(&self, specimens: usize) -> Option<Vec<Overrides>> {
        let table = table::read(calibration_file(&self.folder, self.role)).ok()?;
        if table.metadata.get("fingerprint") != Some(&self.calibration_mark()) {
            return None;
        }
        let unknowns = Unknown::of_study(self.study);
        let z = table.f64("fitted_sigma").ok()?;
        let problem = Problem { unknowns, ..Problem::new(&self.study.system, vec![]) };
        let size = problem.unknowns.len().max(1);
        let of = |z: &[f64]| problem.variant(z, &[]).overrides;
        (z.len() == specimens * size).then(|| z.chunks(size).map(of).collect())
    }

    /// What a pool must have been made from to be taken over.
    fn calibration_mark(&self) -> String {
        let study = self.study;
        let mut mark = Mark::default();
        mark.add(format_args!(
            "calibration 1 {:?} {:?} {} ",
            self.role, self.solver, study.sample_period_s
        ));
        mark.add(format_args!("{}", self.model_text()));
        mark.add(format_args!("{:?} {:?}", study.realism, study.calibration));
        mark.text()
    }

    /// What the sensors of each specimen show in its calibration flight.
    fn measured(
        &self,
        realism: &Realism,
        calibration: &Calibration,
        specimens: &[Overrides],
    ) -> Result<Vec<Vec<f64>>, CampaignError> {
        let study = self.study;
        let sensors = &study.measured[..study.base_sensors()];
        let imperfections = Imperfections::of(&study.system, sensors);
        let mut ensemble =
            Ensemble { duration_s: calibration.duration_s, ..self.ensemble_of(ensemble(study)) };
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
        if let Some((specimen, failure)) = failed {
            let reason = self.describe(&failure);
            return Err(CampaignError::Calibration { specimen, reason });
        }
        for (specimen, samples) in all.iter_mut().enumerate() {
            let mut noise = realism.noise(Lot::pool(self.role), specimen);
            imperfections.apply_to_all(samples, &mut noise);
        }
        Ok(all)
    }

    fn write_calibration(
        &self,
        unknowns: &[Unknown],
        truth: &[Overrides],
        found: &Found,
    ) -> Result<(), CampaignError> {
        let size = unknowns.len();
        let rows = || (0..found.specimens.len()).flat_map(|n| (0..size).map(move |k| (n, k)));
        let float = |of: &dyn Fn(usize, usize) -> f64| {
            Values::Float(rows().map(|(n, k)| of(n, k)).collect())
        };
        let specimens = rows().map(|(n, _)| n as u32).collect();
        let names = rows().map(|(_, k)| unknowns[k].name.clone()).collect();
        let table = Table::from_columns(vec![
            Column::new("specimen", "", Values::Unsigned(specimens)),
            Column::new("parameter", "", Values::Text(names)),
            Column::new("true_sigma", "", float(&|n, k| unknowns[k].sigmas(&truth[n]))),
            Column::new("fitted_sigma", "", float(&|n, k| found.specimens[n].z[k])),
            Column::new("error_sigma", "", float(&|_, k| found.errors[k])),
        ])?
        .with_metadata("fingerprint", self.calibration_mark());
        Ok(table::write(calibration_file(&self.folder, self.role), &table)?)
    }
}

/// The specimens of a pool, and the standard errors that all have in common.
struct Found {
    specimens: Vec<Specimen>,
    errors: Vec<f64>,
}

/// Fits all specimens; the first that cannot be fitted is an error.
fn fitted(problem: &Problem, measured: &[Vec<f64>]) -> Result<Found, (usize, FitError)> {
    let of_all = |error| (0, error);
    let fleet = Fleet::new(problem).map_err(of_all)?;
    let covariance = fleet.covariance().ok_or((0, FitError::Undetermined))?;
    let errors = (0..problem.unknowns.len()).map(|k| covariance.at(k, k).sqrt()).collect();
    let found = fleet.fit(measured).map_err(of_all)?;
    let numbered = found.into_iter().enumerate();
    let specimens = numbered.map(|(n, specimen)| specimen.map_err(|error| (n, error)));
    Ok(Found { specimens: specimens.collect::<Result<_, _>>()?, errors })
}
