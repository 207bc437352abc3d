//! `servotwin sensors`: what each sensor buys.

use super::progress::Stages;
use super::workers;
use super::{note, scenario_of};
use crate::failure::Failure;
use crate::paths::Paths;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::evaluation::metrics::Rate;
use servotwin::job::flights::Crew;
use servotwin::job::{Among, Folder};
use servotwin_report::words::percent;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::sensors::candidates::SensorMask;
use servotwin_safety::sensors::{SensorSet, SensorTrade};
use std::path::PathBuf;

/// Judge every set of sensors that leaves control possible.
///
/// Control needs a sensor that a component of the system reads. All sets with these are judged on the commands that
/// nothing was trained on: which faults they detect, to how many faults they isolate, and which shutdowns are wrong or
/// missed. Trees are trained again for each set. The command writes safety/sensors.csv and the Pareto front as
/// safety/pareto.svg.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a study with data sets ('servotwin study').
    #[arg(value_name = "FOLDER", default_value = "out")]
    folder: PathBuf,
    /// A table of costs: sensor, cost, source. Without one, each sensor costs 1.
    #[arg(long, value_name = "FILE")]
    costs: Option<PathBuf>,
    /// Keep a sensor in every set; may be repeated.
    #[arg(long, value_name = "SENSOR")]
    keep: Vec<String>,
    /// The scenario whose runs are used: ideal, noise, fitted or realistic [default: the most realistic one].
    #[arg(long, value_name = "SCENARIO")]
    scenario: Option<String>,
    /// Number of threads [default: all processors; results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

impl Options {
    /// The files that the command reads.
    pub(crate) fn paths(&self) -> Paths {
        Paths::default().read("--costs", &self.costs)
    }
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    stop::heed();
    let folder = Folder::new(&options.folder);
    let wanted = options.scenario.as_deref().map(scenario_of).transpose()?;
    let results = StudyResultsFolder::open(folder.clone(), wanted)?;
    let stages = Stages::new(global);
    let progress = |what: &str, share| stages.show(what, share);
    let crew = Crew { workers: workers(options.threads), progress: &progress };
    let trade = SensorTrade::new(&results, &options.keep, options.costs.as_deref(), &crew);
    stages.end();
    let trade = trade?;
    let _hold = folder.hold(Among::Nobody)?;
    let written = trade.write(&results)?;
    for text in &trade.notes {
        note(global, text);
    }
    let files: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    Ok(match global {
        Global { json: true, .. } => json(&json!({
            "scenario": trade.scenario,
            "sets": trade.sets.len(),
            "best_of_sizes": trade.best_of_sizes().iter().map(|set| values(&trade, set)).collect::<Vec<_>>(),
            "files": files,
        })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{}{}\n", text_of(&trade), files.join("\n")),
    })
}

fn values(trade: &SensorTrade, set: &SensorSet) -> serde_json::Value {
    json!({
        "sensors": trade.candidates.names(set.set),
        "cost": set.cost,
        "detected": set.rates.detected,
        "isolated": set.rates.isolated,
        "wrong_shutdown": set.rates.wrong_shutdown,
        "missed_shutdown": set.rates.missed_shutdown,
    })
}

fn text_of(trade: &SensorTrade) -> String {
    let candidates = &trade.candidates;
    let able = trade.sets.iter().filter(|set| set.keeps_control).count();
    let needed = candidates.list.iter().filter_map(|sensor| {
        sensor.read_by.as_ref().map(|reader| format!("{} ({reader})", sensor.id))
    });
    let mut text = format!(
        "scenario {}: {} sets judged, {able} of them leave control possible\ncontrol needs {}\n",
        trade.scenario,
        trade.sets.len(),
        needed.collect::<Vec<_>>().join(", ")
    );
    text += "\nfewest wrong and missed shutdowns for each number of sensors\n";
    text += "  sensors    cost  detected  isolated   wrong  missed  left out\n";
    for set in trade.best_of_sizes() {
        text += &row_of(trade, set);
    }
    text + &changes_of(trade)
}

/// What each sensor changes.
fn changes_of(trade: &SensorTrade) -> String {
    let candidates = &trade.candidates;
    let Some(base) = trade.of(candidates.base()) else { return String::new() };
    let mut text = "\nchange by one sensor, in points\n".to_owned();
    text += "                            cost  detected  isolated   wrong  missed\n";
    let mut row = |how: &str, name: &str, other: &SensorSet, control: &str| {
        let cost = other.cost - base.cost;
        text += &format!("  {how:<8} {name:<13} {cost:>+7}{}{control}\n", changes(base, other));
    };
    for (place, sensor) in candidates.list.iter().enumerate() {
        let how = if sensor.is_extra { "with" } else { "without" };
        let Some(other) = trade.of(candidates.base() ^ (1 << place)) else { continue };
        let control = match (other.keeps_control, &sensor.read_by) {
            (true, _) => "",
            (false, Some(_)) => "  control needs it",
            (false, None) => "  kept",
        };
        row(how, &sensor.id, other, control);
    }
    text
}

/// The rates of a set in the order of the columns.
fn rates(set: &SensorSet) -> [Rate; 4] {
    let own = &set.rates;
    [own.detected, own.isolated[0], own.wrong_shutdown, own.missed_shutdown]
}

fn row_of(trade: &SensorTrade, set: &SensorSet) -> String {
    let left: SensorMask = trade.candidates.all() & !set.set;
    let [detected, isolated, wrong, missed] = rates(set).map(|rate| percent(rate.share));
    format!(
        "  {:>7} {:>7} {detected:>9} {isolated:>9} {wrong:>7} {missed:>7}  {}\n",
        set.set.count_ones(),
        set.cost,
        trade.candidates.names(left)
    )
}

/// How the rates of a set differ from those of the system's own sensors.
fn changes(base: &SensorSet, other: &SensorSet) -> String {
    let pairs = rates(base).into_iter().zip(rates(other));
    let change = |(before, after): (Rate, Rate)| {
        let points = before.share.zip(after.share);
        points.map_or("–".into(), |(before, after)| format!("{:+.1}", 100.0 * (after - before)))
    };
    let texts: Vec<String> = pairs.map(change).collect();
    let widths = [9, 9, 7, 7];
    texts.iter().zip(widths).map(|(text, width)| format!(" {text:>width$}")).collect()
}
