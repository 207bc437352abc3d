//! `servotwin band`: the conditional confidence band of the twin, with its target and its measured performance.

use super::evaluate::workers;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Side, TextTable, json, number};
use crate::{Global, stop};
use serde_json::json;
use servotwin::evaluation::metrics::{Rate, clopper_pearson_upper};
use servotwin::evaluation::model_file;
use servotwin::flight::band::{self, BandMerit, Coverage};
use servotwin::job::{Among, Folder, JobError};
use servotwin::study::{Scenario, Study};
use std::path::PathBuf;

/// Learn the twin's confidence band as a field over command, rate, load and boundary values.
///
/// Flies healthy flights in the study's environments for training, at most 1000. Half of the environments show how the
/// residuals depend on these values; in each of the others one flight calibrates the band. By conformal prediction, at
/// most the share --share of the healthy flights of new specimens leaves the band, on the mean over calibrations; the
/// command prints the interval for this one. The evaluation flights judge this band and one that is the same everywhere.
#[derive(clap::Args)]
pub struct Options {
    /// A study file or the name of a built-in study [default: paper].
    #[arg(value_name = "STUDY")]
    study: Option<PathBuf>,
    /// Share of the healthy flights that may leave the band.
    #[arg(long, value_name = "SHARE", default_value_t = 0.05)]
    share: f64,
    /// Judge in this many additional environments, with one healthy flight each.
    #[arg(long, value_name = "ENVIRONMENTS", default_value_t = 200, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    judge: u32,
    /// Scenario of the specimens: each equals its twin (noise), has a twin fitted to its calibration flight (fitted,
    /// one specimen for each environment), or differs from the nominal twin by its tolerances (realistic).
    #[arg(long, value_parser = ["noise", "fitted", "realistic"], default_value = "realistic")]
    scenario: String,
    /// Write the band and its measured performance to band-SCENARIO.json in this folder, for `servotwin watch --band`
    /// and the report.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Use the full sizes of the study's flights.
    #[arg(long)]
    full: bool,
    /// Draw the field to a .svg or .png file.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

impl Options {
    /// The files that the command reads and writes.
    pub fn paths(&self) -> Paths {
        let read = Paths::default().read_study(self.study.as_ref());
        read.write("--plot", Format::Figure, &self.plot)
    }
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    if !(options.share > 0.0 && options.share < 1.0) {
        let (option, given) = ("--share", options.share.to_string());
        return Err(Failure::OutOfRange { option, given, range: "between 0 and 1".into() });
    }
    let study = match &options.study {
        Some(path) => Study::read(path)?,
        None => Study::default(),
    };
    let Some(flights) = &study.flights else { return Err(JobError::NoFlights.into()) };
    let named = |scenario: &Scenario| scenario.name() == options.scenario;
    let scenario =
        Scenario::ALL.into_iter().find(named).expect("one of the names that are allowed");
    if !scenario.is_possible(&study) {
        return Err(Failure::Options(
            "the study has no [realistic], or no [fitted] for that scenario",
        ));
    }
    stop::heed();
    let folder = options.out.as_ref().map(Folder::new);
    let _hold = folder.as_ref().map(|folder| folder.hold(Among::Nobody)).transpose()?;
    let merit = band::measure(
        (&study, options.full),
        scenario,
        options.share,
        options.judge as usize,
        workers(options.threads),
    );
    stop::check()?;
    let merit = merit?;
    if let Some(path) = &options.plot {
        merit.picture(study.system.network()).draw().save(path)?;
    }
    if let Some(folder) = &folder {
        model_file::write_model(folder.band(scenario), &merit).map_err(JobError::from)?;
    }
    Ok(match global {
        Global { json: true, .. } => json(&as_json(&merit)),
        Global { quiet: true, .. } => String::new(),
        _ => people(&merit, &study, flights.duration_s),
    })
}

fn as_json(merit: &BandMerit) -> serde_json::Value {
    let of = |place: usize| {
        let measured = Measured::of(merit, place);
        json!({
            "healthy_left": merit.left[place],
            "faults_left": merit.detected[place],
            "independent_left": measured.left,
            "measured": measured.share(),
            "interval_95": [measured.low, measured.high],
            "is_target_met": measured.share().map(|share| share <= merit.field.share),
        })
    };
    let Coverage { beta, mean, low, high, low_one_sided } = coverage(merit);
    let covariates = merit.field.covariates.iter();
    let covariates = covariates
        .map(|c| json!({ "name": c.name, "edges": c.edges, "range": [c.range.0, c.range.1] }));
    json!({
        "share": merit.field.share,
        "share_of_this_calibration": { "mean": 1.0 - mean, "below_with_95": 1.0 - low_one_sided },
        "coverage": { "beta": beta, "mean": mean, "interval_95": [low, high] },
        "calibration_flights": merit.field.calibrated_on,
        "healthy": merit.healthy,
        "healthy_outside": merit.outside,
        "independent": merit.independent,
        "faults": merit.faults,
        "field": of(0),
        "fixed": of(1),
        "scale": merit.field.scale,
        "base": merit.field.base,
        "covariates": covariates.collect::<Vec<_>>(),
        "factors": merit.field.factors,
    })
}

fn coverage(merit: &BandMerit) -> Coverage {
    band::coverage(merit.field.share, merit.field.calibrated_on)
}

/// The share of independent healthy flights that leave a band, with its interval of 95 % after Clopper and Pearson.
struct Measured {
    left: usize,
    flights: usize,
    low: f64,
    high: f64,
}

impl Measured {
    fn of(merit: &BandMerit, place: usize) -> Self {
        let own = merit.independent;
        Measured::counted(own.left[place], own.flights)
    }

    fn counted(left: usize, flights: usize) -> Self {
        let upper = |count: usize| clopper_pearson_upper(count as u64, flights as u64, 0.975);
        Measured { left, flights, low: 1.0 - upper(flights - left), high: upper(left) }
    }

    fn share(&self) -> Option<f64> {
        (self.flights > 0).then(|| self.left as f64 / self.flights as f64)
    }

    fn text(&self) -> String {
        let Some(share) = self.share() else { return "not measured: no held-out flight".into() };
        let [share, low, high] = [share, self.low, self.high].map(percent);
        format!("{share} % ({low} … {high} %), {} of {}", self.left, self.flights)
    }
}

fn percent(share: f64) -> String {
    number(100.0 * share, 3)
}

/// A line with the target and the rate measured on held-out flights.
fn against_target(name: &str, merit: &BandMerit, place: usize) -> String {
    let target = merit.field.share;
    let rate = Measured::of(merit, place);
    let verdict = match rate.share() {
        None => "",
        Some(share) if share <= target => ": met",
        Some(_) if rate.low <= target => ": missed, by no more than chance explains",
        Some(_) => ": missed",
    };
    format!("{name}: target {} %, measured {}{verdict}\n", percent(target), rate.text())
}

fn people(merit: &BandMerit, study: &Study, duration_s: f64) -> String {
    let rate = |count: usize, of: usize| {
        let rate = Rate::new(count as u64, of as u64);
        let share = 100.0 * count as f64 / of.max(1) as f64;
        format!("{share:.2} % ({:.1} … {:.1})", 100.0 * rate.low, 100.0 * rate.high)
    };
    let Coverage { beta, mean, low, high, .. } = coverage(merit);
    let own = merit.independent;
    let mut text = format!(
        "Target: on the mean over calibrations at most {} % of healthy flights of {duration_s} s leave the band.\n\
         This one is calibrated with {} flights, each of its own environment and specimen. Its coverage is {} % on the \
         mean, and {} … {} % in 95 % of such calibrations: Beta({}, {}).\n\
         Measured in {} other healthy flights, each of its own environment and specimen (95 % by Clopper and Pearson):\n",
        percent(merit.field.share),
        merit.field.calibrated_on,
        percent(mean),
        percent(low),
        percent(high),
        beta[0],
        beta[1],
        own.flights,
    );
    text += &against_target("  field", merit, 0);
    text += &against_target("  the same everywhere", merit, 1);
    text += "\n";
    let mut grid = TextTable::new(&[
        ("", Side::Left),
        ("field", Side::Right),
        ("the same everywhere", Side::Right),
    ]);
    let left = [0, 1].map(|place| rate(merit.left[place], merit.healthy));
    let [field, fixed] = left;
    grid.push(vec![format!("of {} healthy flights leave it", merit.healthy), field, fixed]);
    let [field, fixed] = [0, 1].map(|place| rate(merit.detected[place], merit.faults));
    grid.push(vec![format!("of {} flights with a fault leave it", merit.faults), field, fixed]);
    text += &grid.text();
    text += &format!(
        "\nOutside of what learning and calibration flights have covered: {}.\n\n",
        Measured::counted(own.outside, own.flights).text()
    );
    let mut grid = TextTable::new(&[
        ("sensor", Side::Left),
        ("half width, % of scale", Side::Right),
        ("the same everywhere", Side::Right),
    ]);
    for (sensor, known) in study.sensors.0[..study.base_sensors()].iter().enumerate() {
        let [least, most] = merit.ends(sensor);
        grid.push(vec![
            known.name.clone(),
            format!("{} … {}", number(100.0 * least, 3), number(100.0 * most, 3)),
            number(100.0 * merit.fixed.half_width(sensor, &[]), 3),
        ]);
    }
    text + &grid.text()
}
