//! Twins fitted to their actuators.

use crate::Material;
use crate::words::{distinct, rate, three_digits};
use servotwin::learn::metrics::Rate;
use servotwin::records::Comparison;
use servotwin_view::document::{Document, Table};

/// The number of standard deviations on either side that enclose 95 % of a normal distribution.
const NORMAL_95: f64 = 1.96;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    if !material.calibrations.is_empty() {
        page.heading("Fitted parameters");
        page.text(
                "In the scenario fitted every specimen has a calibration run, and its twin is fitted to what \
                 the sensors showed. How far that is from the true parameters of the specimen, in standard \
                 deviations of their tolerances, and how often these lie within the 95 % interval of the fit:",
            );
        page.table("", parameters(material.calibrations).captioned("True against fitted parameters, of all specimens of the study's pools. An error of 1 is \
                 what is known without a calibration run."));
    }
}

/// A table with one row for each kind of parameter, over all actuators.
fn parameters(all: &[Comparison]) -> Table {
    let kind = |one: &Comparison| match one.parameter.split_once('.') {
        Some((_, rest)) if rest.contains('.') => rest.to_owned(),
        _ => one.parameter.clone(),
    };
    let mut grid = Table::headed([
        "parameter",
        "fits",
        "error (rms)",
        "standard error",
        "true value in its 95 % interval",
    ]);
    let row = |name: &str, own: &[&Comparison]| {
        let count = own.len() as f64;
        let off = |one: &&&Comparison| one.fitted_sigma - one.true_sigma;
        let rms = (own.iter().map(|one| off(&one).powi(2)).sum::<f64>() / count).sqrt();
        let error = (own.iter().map(|one| one.error_sigma.powi(2)).sum::<f64>() / count).sqrt();
        let inside = own.iter().filter(|one| off(one).abs() <= NORMAL_95 * one.error_sigma).count();
        let share = rate(Some(Rate::new(inside as u64, own.len() as u64)));
        vec![name.to_owned(), own.len().to_string(), three_digits(rms), three_digits(error), share]
    };
    for name in distinct(all.iter().map(kind)) {
        let own: Vec<&Comparison> = all.iter().filter(|one| kind(one) == name).collect();
        grid.push(row(&name, &own));
    }
    grid.push_strong(row("all", &all.iter().collect::<Vec<_>>()));
    grid
}
