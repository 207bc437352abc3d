//! `servotwin band`: the confidence band of the twin as a field, with what it promises and what it is worth.

use super::evaluate::workers;
use crate::failure::Failure;
use crate::render::{Grid, Side, json, number};
use crate::{Global, stop};
use serde_json::json;
use servotwin::evaluation::score::Rate;
use servotwin::figure::value_map::ValueMap;
use servotwin::flight::band::{self, BandMerit};
use servotwin::study::{Setting, Study};
use std::path::PathBuf;

/// Learn the confidence band of the twin as a field over command, rate, load and boundary values.
///
/// Flies the healthy flights of the study's [flights]: half of the environments say how residuals depend on what is
/// asked, the others calibrate the band, so that at most --share of healthy flights of new specimens leave it (conformal
/// prediction). Both this field and a band that is the same everywhere are judged in the judged flights.
#[derive(clap::Args)]
pub struct Options {
    /// The study, a file or a built-in name; without it, the paper's.
    #[arg(value_name = "STUDY")]
    study: Option<PathBuf>,
    /// The share of healthy flights that may leave the band.
    #[arg(long, value_name = "SHARE", default_value_t = 0.05)]
    share: f64,
    /// Specimens that are their twins (noise), or that have their tolerances (realistic).
    #[arg(long, value_parser = ["noise", "realistic"], default_value = "realistic")]
    setting: String,
    /// The full sizes of the study's flights.
    #[arg(long)]
    full: bool,
    /// Draw the field to a .svg or .png file.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long)]
    threads: Option<usize>,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    if !(options.share > 0.0 && options.share < 1.0) {
        let (option, given) = ("--share", options.share.to_string());
        return Err(Failure::OutOfRange { option, given, range: "between 0 and 1" });
    }
    let study = match &options.study {
        Some(path) => Study::read(path)?,
        None => Study::default(),
    };
    let flights = if options.full { study.full_flights()? } else { study.flights()? };
    let Some(flights) = flights else {
        return Err(Failure::Options("the study has no [flights], or no full sizes of them"));
    };
    let setting = match options.setting.as_str() {
        "noise" => Setting::Noise,
        _ => Setting::Realistic,
    };
    stop::listen();
    let merit = band::measure(&study, &flights, setting, options.share, workers(options.threads));
    stop::check()?;
    let merit = merit?;
    if let Some(path) = &options.plot {
        picture(&merit, &study).draw().save(path)?;
    }
    Ok(match global {
        Global { json: true, .. } => json(&as_json(&merit)),
        Global { quiet: true, .. } => String::new(),
        _ => people(&merit, &study, flights.duration_s),
    })
}

fn as_json(merit: &BandMerit) -> serde_json::Value {
    let of = |place: usize| {
        json!({
            "healthy_left": merit.left[place],
            "faults_left": merit.detected[place],
        })
    };
    let covariates = merit.field.covariates.iter();
    let covariates = covariates
        .map(|c| json!({ "name": c.name, "edges": c.edges, "range": [c.range.0, c.range.1] }));
    json!({
        "share": merit.field.share,
        "calibration_flights": merit.field.calibrated_on,
        "healthy": merit.healthy,
        "healthy_outside": merit.outside,
        "faults": merit.faults,
        "field": of(0),
        "fixed": of(1),
        "scale": merit.field.scale,
        "base": merit.field.base,
        "covariates": covariates.collect::<Vec<_>>(),
        "factors": merit.field.factors,
    })
}

fn people(merit: &BandMerit, study: &Study, duration_s: f64) -> String {
    let percent = |count: usize, of: usize| {
        let rate = Rate::new(count as u64, of as u64);
        let share = 100.0 * count as f64 / of.max(1) as f64;
        format!("{share:.2} % ({:.1} … {:.1})", 100.0 * rate.low, 100.0 * rate.high)
    };
    let mut text = format!(
        "At most {} % of healthy flights of {duration_s} s leave the band: calibrated with {} flights, each of its own \
         environment and specimen.\n\n",
        100.0 * merit.field.share,
        merit.field.calibrated_on
    );
    let mut grid = Grid::new(&[
        ("", Side::Left),
        ("field", Side::Right),
        ("the same everywhere", Side::Right),
    ]);
    let left = [0, 1].map(|place| percent(merit.left[place], merit.healthy));
    let [field, fixed] = left;
    grid.push(vec![format!("of {} healthy flights leave it", merit.healthy), field, fixed]);
    let [field, fixed] = [0, 1].map(|place| percent(merit.detected[place], merit.faults));
    grid.push(vec![format!("of {} flights with a fault leave it", merit.faults), field, fixed]);
    text += &grid.text();
    text += &format!(
        "\n{} of the healthy flights are flown outside of what was learned from: there nothing is promised.\n\n",
        merit.outside
    );
    let mut grid = Grid::new(&[
        ("sensor", Side::Left),
        ("half width, % of scale", Side::Right),
        ("the same everywhere", Side::Right),
    ]);
    for (sensor, known) in study.sensors.0[..study.base_sensors()].iter().enumerate() {
        let [least, most] = ends(merit, sensor);
        grid.push(vec![
            known.name.clone(),
            format!("{} … {}", number(100.0 * least, 3), number(100.0 * most, 3)),
            number(100.0 * merit.fixed.half_width(sensor, &[]), 3),
        ]);
    }
    text + &grid.text()
}

/// The least and the largest half width of a sensor.
fn ends(merit: &BandMerit, sensor: usize) -> [f64; 2] {
    let middle = merit.field.scale * merit.field.base[sensor];
    let factors = &merit.field.factors[sensor];
    let end = |pick: fn(f64, f64) -> f64| {
        let of = |bins: &Vec<f64>| bins.iter().copied().reduce(pick).unwrap_or(1.0);
        factors.iter().fold(middle, |width, bins| width * of(bins))
    };
    [end(f64::min), end(f64::max)]
}

/// By how much each bin of each covariate widens the band of each sensor.
fn picture(merit: &BandMerit, study: &Study) -> ValueMap {
    let sensors = &study.sensors.0[..study.base_sensors()];
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for (place, covariate) in merit.field.covariates.iter().enumerate() {
        for bin in 0..=covariate.edges.len() {
            let low = bin.checked_sub(1).map_or(covariate.range.0, |k| covariate.edges[k]);
            let high = covariate.edges.get(bin).copied().unwrap_or(covariate.range.1);
            rows.push(format!("{}: {} … {}", covariate.name, number(low, 3), number(high, 3)));
            let factor = |sensor: usize| Some(merit.field.factors[sensor][place][bin]);
            values.push((0..sensors.len()).map(factor).collect::<Vec<_>>());
        }
    }
    let all = values.iter().flatten().flatten().copied();
    let range = (0.0, all.fold(1.0, f64::max));
    ValueMap {
        title: "By how much the band is wider than on the mean".into(),
        rows,
        columns: sensors.iter().map(|sensor| sensor.name.clone()).collect(),
        values,
        range,
        digits: 2,
        empty: "darker: wider".into(),
    }
}
