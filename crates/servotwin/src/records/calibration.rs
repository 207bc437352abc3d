//! The specimen pool of the scenario *fitted*, each specimen with the twin that was fitted to its calibration flight.
//!
//! `calibration-fitted.parquet` stores the results with the true values, in standard deviations of the tolerances. It
//! is computed once: every part of records that finds the file uses exactly its values.

use super::columns::DIMENSIONLESS;
use super::{Plants, Records, Scenario};
use crate::fit::fleet::Specimen;
use crate::fit::{Fit, Unknown};
use crate::run::part;
use crate::run::{Overrides, RunError, SpecimenDraw, calibration_of, fit_twins};
use crate::study::{Purpose, Stream};
use crate::table::{Column, Table, Values};
use servotwin_model::solver::SolverSettings;
use std::path::{Path, PathBuf};

/// The path of the file with the specimens of a pool: true values, fitted values and standard errors.
pub fn calibration_file(folder: &Path, purpose: Purpose) -> PathBuf {
    folder.join(calibration_name(purpose))
}

fn calibration_name(purpose: Purpose) -> String {
    format!("calibration-{}{}.parquet", Scenario::Fitted.name(), purpose.suffix())
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
pub fn calibrations(folder: &Path, purpose: Purpose) -> Result<Vec<Comparison>, RunError> {
    let file = calibration_file(folder, purpose);
    if !file.exists() {
        return Ok(vec![]);
    }
    let table = Table::read(&file)?;
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

impl Records<'_> {
    /// The name of the file that all parts read, so that not each part must fit the specimens; `None` if nothing is
    /// fitted.
    pub(crate) fn calibration(&self) -> Option<String> {
        (self.plants() == Plants::Pool).then(|| calibration_name(self.suite.purpose))
    }

    /// Fits the specimens unless their file exists.
    ///
    /// # Errors
    /// A specimen cannot be fitted, or the file cannot be written; [`RunError::Cancelled`].
    pub fn calibrate(&self) -> Result<(), RunError> {
        self.fitted_twins().map(|_| ())
    }

    /// The parameters of every specimen's twin, fitted to its calibration flight.
    pub(super) fn fitted_twins(&self) -> Result<Vec<Overrides>, RunError> {
        let specimens = calibration_of(self.study)?.specimens(self.suite.purpose);
        if let Some(known) = self.known(specimens) {
            return Ok(known);
        }
        let truth: Vec<Overrides> =
            (0..specimens).map(|specimen| self.pooled(specimen).parameters(1.0)).collect();
        let noise = |specimen| self.pooled(specimen).noise(Stream::Calibration);
        let unknowns = Unknown::of_study(self.study);
        let (found, errors) = fit_twins(self.study, &self.ensemble(), (unknowns, &truth), noise)?;
        self.write_calibration(&truth, &found, &errors)?;
        Ok(found.into_iter().map(|specimen| specimen.overrides).collect())
    }

    /// A specimen of the pool.
    pub(super) fn pooled(&self, number: usize) -> SpecimenDraw<'_> {
        let seed = self.suite.seed_of_fitted(number);
        SpecimenDraw { study: self.study, scenario: Scenario::Fitted, seed }
    }

    /// The parameters stored in the file for `specimens` specimens; `None` without a matching file.
    fn known(&self, specimens: usize) -> Option<Vec<Overrides>> {
        let table = Table::read(calibration_file(&self.folder, self.suite.purpose)).ok()?;
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
        let mut mark = part::model_mark(study);
        mark.add("calibration 1").add(self.suite.purpose.suffix()).add(&SolverSettings::of_runs());
        mark.add(&study.sample_period_s).add(&study.seed);
        mark.add(&study.realism).add(&study.calibration);
        mark.to_string()
    }

    fn write_calibration(
        &self,
        truth: &[Overrides],
        found: &[Specimen],
        errors: &[f64],
    ) -> Result<(), RunError> {
        let unknowns = Unknown::of_study(self.study);
        let size = unknowns.len();
        let rows = || (0..found.len()).flat_map(|n| (0..size).map(move |k| (n, k)));
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
            sigmas("fitted_sigma", float(&|n, k| found[n].z[k]), "Fitted value"),
            sigmas("error_sigma", float(&|_, k| errors[k]), "Standard error of the fit"),
        ])?
        .with_metadata("fingerprint", self.calibration_mark());
        Ok(table.write(calibration_file(&self.folder, self.suite.purpose))?)
    }
}
