//! `servotwin sensors`: what each sensor buys.

use super::progress::Stages;
use super::workers;
use crate::failure::Failure;
use crate::paths::Paths;
use crate::{Global, Run, stop};
use servotwin::job::Crew;
use servotwin::job::{Among, Folder};
use servotwin::learn::metrics::Rate;
use servotwin::measure::{RIGHT_ACTION_OF_ALL, SHUTDOWN_MISSED_OF_ALL, VISIBLE, WRONG_SHUTDOWN};
use servotwin::study::Scenario;
use servotwin_report::words::percent;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::sensors::candidates::SensorMask;
use servotwin_safety::sensors::{SensorSet, SensorTrade};
use servotwin_view::document::{Document, Table, Value, Verdict, line};
use servotwin_view::row;
use std::path::PathBuf;

/// Judge every set of sensors that leaves control possible.
///
/// Control needs a sensor that a component of the system reads. All sets with these are judged on the commands that
/// nothing was trained on: which faults they detect, for which the right action comes, and which shutdowns are wrong or
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
    #[arg(long, value_name = "SCENARIO", value_parser = super::scenario())]
    scenario: Option<Scenario>,
    /// Number of threads [default: all processors; results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        Paths::default().read("--costs", &self.costs)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        stop::heed();
        let folder = Folder::new(&self.folder);
        let results = StudyResultsFolder::open(folder.clone(), self.scenario)?;
        let stages = Stages::new(global);
        let progress = |what: &str, share| stages.show(what, share);
        let crew = Crew { workers: workers(self.threads), progress: &progress };
        let trade = SensorTrade::new(&results, &self.keep, self.costs.as_deref(), &crew);
        stages.end();
        let trade = trade?;
        let _hold = folder.hold(Among::Nobody)?;
        let written = trade.write(&results)?;
        let mut document = described(&trade);
        trade.notes.iter().for_each(|text| _ = document.note(text.as_str()));
        document.files(written);
        Ok(document)
    }
}

fn described(trade: &SensorTrade) -> Document {
    let able = trade.sets.iter().filter(|set| set.keeps_control).count();
    let needed = trade.candidates.list.iter().filter_map(|sensor| {
        sensor.read_by.as_ref().map(|reader| format!("{} ({reader})", sensor.id))
    });
    let values = [
        ("scenario", trade.scenario.to_string().into()),
        ("sets", trade.sets.len().into()),
        ("sets_with_control", able.into()),
        ("needed", Value::list(needed)),
    ];
    let verdict = line(
        "Scenario {scenario}: {sets} sets judged, {sets_with_control} of them leave control possible, which needs \
         {needed}.",
        values,
    );
    let mut document = Document::new("sensors", Verdict::neutral(verdict));
    let mut best = Table::new(COLUMNS)
        .captioned("Fewest wrong and missed shutdowns for each number of sensors");
    trade.best_of_sizes().into_iter().for_each(|set| best.push(row_of(trade, set)));
    document.table("best_of_sizes", best);
    if let Some(base) = trade.of(trade.candidates.base()) {
        document.table("changes", changes(trade, base));
    }
    document
}

/// The columns of a set. Programs read its sensors, people what it lacks.
const COLUMNS: [(&str, &str); 8] = [
    ("sensors", ""),
    ("count", "sensors"),
    ("cost", "cost"),
    (VISIBLE.name, "detected"),
    (RIGHT_ACTION_OF_ALL.name, "right action"),
    (WRONG_SHUTDOWN.name, "wrong"),
    (SHUTDOWN_MISSED_OF_ALL.name, "missed"),
    ("", "left out"),
];

/// The rates of a set in the order of the columns.
fn rates(set: &SensorSet) -> [Rate; 4] {
    let measures = [&VISIBLE, &RIGHT_ACTION_OF_ALL, &WRONG_SHUTDOWN, &SHUTDOWN_MISSED_OF_ALL];
    measures.map(|measure| set.rates.of(measure))
}

fn row_of(trade: &SensorTrade, set: &SensorSet) -> Vec<Value> {
    let left: SensorMask = trade.candidates.all() & !set.set;
    let mut row = row![
        Value::of("", &trade.candidates.names(set.set)),
        set.set.count_ones(),
        Value::of(set.cost.to_string(), &set.cost),
    ];
    row.extend(rates(set).map(|rate| {
        let text = percent(rate.share);
        Value::of(text, &rate)
    }));
    row.push(trade.candidates.names(left).into());
    row
}

/// What each sensor changes against the system's own sensors.
fn changes(trade: &SensorTrade, base: &SensorSet) -> Table {
    let mut columns = COLUMNS;
    columns[0] = ("how", " ");
    columns[1] = ("name", "sensor");
    columns[7] = ("control", " ");
    let mut table = Table::new(columns).captioned("Change by one sensor, in points");
    let mut add = |how: &str, name: &str, other: &SensorSet, control: &str| {
        let cost = other.cost - base.cost;
        let mut row = row![how, name, Value::of(format!("{cost:+}"), &cost)];
        let pairs = rates(base).into_iter().zip(rates(other));
        row.extend(pairs.map(|(before, after)| {
            let change = before.share.zip(after.share).map(|(before, after)| after - before);
            Value::from(change.map(|own| Value::number(own, format!("{:+.1}", 100.0 * own))))
        }));
        row.push(control.into());
        table.push(row);
    };
    for (place, sensor) in trade.candidates.list.iter().enumerate() {
        let how = if sensor.is_extra { "with" } else { "without" };
        let Some(other) = trade.of(trade.candidates.base() ^ (1 << place)) else { continue };
        let control = match (other.keeps_control, &sensor.read_by) {
            (true, _) => "",
            (false, Some(_)) => "control needs it",
            (false, None) => "kept",
        };
        add(how, &sensor.id, other, control);
    }
    table
}
