//! Twins fitted to their actuators, and the twin's conditional confidence band.

use crate::Material;
use crate::page::{Alignment, HtmlTable, Page};
use crate::words::{chosen, number, rate};
use servotwin::campaign::Comparison;
use servotwin::evaluation::metrics::Rate;
use servotwin::flight::band::BandMerit;
use servotwin::study::Study;

/// The number of standard deviations on either side that enclose 95 % of a normal distribution.
const NORMAL_95: f64 = 1.96;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    if !material.calibrations.is_empty() {
        page.heading("Fitted parameters");
        page.text(
                "In the scenario fitted every specimen has a calibration run, and its twin is fitted to what \
                 the sensors showed. How far that is from the true parameters of the specimen, in standard \
                 deviations of their tolerances, and how often these lie within the 95 % interval of the fit:",
            );
        page.table(
                &parameters(material.calibrations),
                "True against fitted parameters, of all specimens of the study's pools. An error of 1 is \
                 what is known without a calibration run.",
            );
    }
    for merit in material.bands {
        page.heading(&format!("The band as a field, scenario {}", merit.scenario));
        band(merit, material.study, page);
    }
}

/// A table with one row for each kind of parameter, over all actuators.
fn parameters(all: &[Comparison]) -> HtmlTable {
    let kind = |one: &Comparison| match one.parameter.split_once('.') {
        Some((_, rest)) if rest.contains('.') => rest.to_owned(),
        _ => one.parameter.clone(),
    };
    let mut kinds: Vec<String> = Vec::new();
    for one in all {
        if !kinds.contains(&kind(one)) {
            kinds.push(kind(one));
        }
    }
    let mut grid = HtmlTable::new([
        ("parameter", Alignment::Left),
        ("fits", Alignment::Right),
        ("error (rms)", Alignment::Right),
        ("standard error", Alignment::Right),
        ("true value in its 95 % interval", Alignment::Right),
    ]);
    let row = |name: &str, own: &[&Comparison]| {
        let count = own.len() as f64;
        let off = |one: &&&Comparison| one.fitted_sigma - one.true_sigma;
        let rms = (own.iter().map(|one| off(&one).powi(2)).sum::<f64>() / count).sqrt();
        let error = (own.iter().map(|one| one.error_sigma.powi(2)).sum::<f64>() / count).sqrt();
        let inside = own.iter().filter(|one| off(one).abs() <= NORMAL_95 * one.error_sigma).count();
        let share = rate(Some(Rate::new(inside as u64, own.len() as u64)));
        vec![name.to_owned(), own.len().to_string(), number(rms), number(error), share]
    };
    for name in &kinds {
        let own: Vec<&Comparison> = all.iter().filter(|one| kind(one) == *name).collect();
        grid.push(row(name, &own));
    }
    grid.push_strong(row("all", &all.iter().collect::<Vec<_>>()));
    grid
}

fn band(merit: &BandMerit, study: &Study, page: &mut Page) {
    let field = &merit.field;
    page.text(&format!(
        "How large a healthy residual may be depends on what is asked: command and rate, load, boundary values, which \
         way the spool goes. The field says so for each sensor. It was learned in half of the environments of the \
         study's flights, and calibrated with one flight of each of the other {} (conformal prediction): at most {} % of \
         healthy flights of {} s leave it, as a mean over calibrations. The fixed band has the same promise and is the same \
         everywhere, so that false alarms are equal and detection can be compared.",
        field.calibrated_on,
        chosen(100.0 * field.share),
        chosen(merit.duration_s)
    ));
    let figure = merit.picture(study.system.network()).draw();
    let name = format!("field-{}", merit.scenario);
    page.figure(
        &name,
        figure,
        "Factors of the field: 1 is the mean of all healthy samples of the sensor.",
    );
    let mut grid = HtmlTable::new([
        ("flights, none of them learned from", Alignment::Left),
        ("leave the field", Alignment::Right),
        ("leave the fixed band", Alignment::Right),
    ]);
    let of = |count: usize, of: usize| rate(Some(Rate::new(count as u64, of as u64)));
    let [field_left, fixed_left] = merit.left.map(|count| of(count, merit.healthy));
    grid.push(vec![format!("{} healthy", merit.healthy), field_left, fixed_left]);
    let [field_left, fixed_left] = merit.detected.map(|count| of(count, merit.faults));
    grid.push(vec![format!("{} with a fault", merit.faults), field_left, fixed_left]);
    page.table(&grid, "What the two bands are worth in the judged flights.");
    page.note(&format!(
        "{} of the healthy flights were flown at points outside of what learning and calibration flights have \
         covered: nothing like them is known.",
        merit.outside
    ));
    let mut grid = HtmlTable::new([
        ("sensor", Alignment::Left),
        ("field", Alignment::Right),
        ("fixed band", Alignment::Right),
    ]);
    for (sensor, name) in merit.sensors.iter().enumerate() {
        let [least, most] = merit.ends(sensor).map(|end| number(100.0 * end));
        let fixed = number(100.0 * merit.fixed.half_width(sensor, &[]));
        grid.push(vec![name.clone(), format!("{least} … {most}"), fixed]);
    }
    page.table(
        &grid,
        "Half widths in percent of the sensor's scale, the least and the largest of the field.",
    );
}
