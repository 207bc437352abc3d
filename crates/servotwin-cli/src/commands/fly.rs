//! `servotwin fly`: flies a plant with a fault and its twin, with the diagnosis and a flight control
//! computer that reacts.

use super::fly_cost::FlightCosts;
use super::fly_truth::{FlightVerdict, Truth};
use super::simulate::{fault, onset};
use super::{StudyOptions, learned, note};
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::figure::time_series::{Band, Mark, Panel, Series, TimeSeries};
use servotwin::files::create_folder;
use servotwin::flight::closed_loop::{self, ClosedLoop, FlightRecord};
use servotwin::flight::cost::Cost;
use servotwin::flight::tracking::{TrackedQuantities, command_unit, first_report_s};
use servotwin::job::{Folder, JobError, flights};
use servotwin::recording::with_suffix;
use servotwin::signal::{Signal, WrittenQuantity};
use servotwin::study::{FaultCase, Scenario, Study};
use servotwin::table::{self, Column, Table, Values};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::FaultAt;
use servotwin_model::spec::Unit;
use servotwin_report::words::{number, spoken};
use servotwin_watch::shipped;
use std::fmt::Write;
use std::sync::Arc;

/// Fly a plant in which a fault begins, with and without the diagnosis, and show the benefit.
///
/// No option is required: by default, the stroke sensor of the first actuator gets a bias, or the study's first fault
/// begins. The flight knows the truth, so the output states whether actuator, action and component were right. The
/// command writes into the folder `flight` of the output folder: `flight.svg`, which marks onset, detection and
/// reaction, and the records `flight-reacting.csv` and `flight-alone.csv`. The built-in aileron flies with a
/// diagnosis that comes with the program; for anything else the command trains one first if it is missing, which
/// takes about two minutes.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    study: StudyOptions,
    /// A fault with its intensity from 0 to 1, or 'none'. With @TIME, e.g. =0.3@12s, it begins then, and else after
    /// three tenths of the flight. Repeat the option for several faults [default: a bias of the stroke sensor, or the
    /// study's first fault, with intensity 0.7].
    #[arg(long, value_name = "ID=INTENSITY[@TIME]")]
    fault: Vec<String>,
    /// Duration of the flight.
    #[arg(long, value_name = "TIME", default_value = "20s")]
    duration: String,
    /// The command signal [default: the study's first one].
    #[arg(long, value_name = "SIGNAL")]
    command: Option<Signal>,
    /// The number of the specimen that flies. Each number has its own tolerances [default: a specimen that equals the
    /// twin].
    #[arg(long, value_name = "NUMBER")]
    specimen: Option<usize>,
}

/// The value of a time option, s.
fn seconds(option: &'static str, text: &str) -> Result<f64, Failure> {
    let value = WrittenQuantity::in_unit(text, Unit::Second)
        .map_err(|error| Failure::Number { option, error })?;
    match (0.0..=1e4).contains(&value) {
        true => Ok(value),
        false => {
            Err(Failure::OutOfRange { option, given: text.into(), range: "0 to 10,000 s".into() })
        }
    }
}

/// The default fault: if the study has it, one whose reaction shows the benefit of the diagnosis.
fn usual_fault(study: &Study) -> String {
    let shows = |fault: &&FaultCase| fault.id.ends_with("sensor_ram.bias_positive");
    let fault = study.faults.iter().find(shows).or(study.faults.first());
    fault.map_or_else(|| "none".into(), |fault| format!("{}=0.7", fault.id))
}

/// A fault with its onset, as the user named it.
struct Begins {
    name: String,
    onset_s: f64,
    fault: FaultAt,
}

/// When a fault begins whose onset is not named, as a part of the flight.
const USUAL_ONSET: f64 = 0.3;

/// The faults of a flight in the order of their onsets.
fn faults(options: &Options, study: &Study, duration_s: f64) -> Result<Vec<Begins>, Failure> {
    let named = match options.fault.as_slice() {
        [] => vec![usual_fault(study)],
        [none] if none == "none" => vec![],
        named => named.to_vec(),
    };
    let begins = |text: &String| -> Result<Begins, Failure> {
        let (name, onset_s) = onset(text, duration_s)?;
        let fault = fault(&study.system, name)?;
        let onset_s = onset_s.unwrap_or(USUAL_ONSET * duration_s);
        Ok(Begins { onset_s, fault, name: name.into() })
    };
    let mut faults = named.iter().map(begins).collect::<Result<Vec<_>, _>>()?;
    faults.sort_by(|a, b| a.onset_s.total_cmp(&b.onset_s));
    Ok(faults)
}

/// The title of the figure: the faults and their onsets.
fn title(faults: &[Begins]) -> String {
    let words = |Begins { name, onset_s, .. }: &Begins| {
        let (name, intensity) = name.split_once('=').unwrap_or((name, "1"));
        format!("{}, intensity {intensity}, at {onset_s} s", spoken(name))
    };
    match faults {
        [] => "No fault".into(),
        faults => faults.iter().map(words).collect::<Vec<_>>().join("; "),
    }
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let study = options.study.read(global)?;
    stop::heed();
    let folder = options.study.folder();
    let scenario = if options.specimen.is_some() { Scenario::Realistic } else { Scenario::Noise };
    let duration_s = seconds("--duration", &options.duration)?;
    let mut inputs = study.system.default_inputs();
    let unit = study.system.network().inputs[study.command_input].unit;
    inputs[study.command_input] = match &options.command {
        Some(command) => command
            .build(unit, duration_s)
            .map_err(|error| Failure::Signal { option: "--command".into(), error })?,
        None => study.cases[0].inputs[study.command_input].clone(),
    };
    let begins = faults(options, &study, duration_s)?;
    let onset_s = begins.first().map_or(USUAL_ONSET * duration_s, |first| first.onset_s);
    let diagnoser = diagnoser(&options.study, &folder, &study, scenario, global)?;
    let kept = TrackedQuantities::of(&study);
    let fly = |reacts: bool| {
        let inputs = inputs.clone();
        let faults = begins.iter().map(|one| (one.onset_s, one.fault)).collect();
        let specimen = options.specimen;
        let scenario = ClosedLoop { study: &study, inputs, faults, duration_s, specimen, reacts };
        closed_loop::fly(&scenario, &diagnoser, &kept.slots).map_err(Failure::Runtime)
    };
    let truths: Vec<Truth> =
        begins.iter().map(|one| Truth::of(&study, one.fault, one.onset_s)).collect();
    let flown = Flown {
        truths: &truths,
        study: &study,
        diagnoser: &diagnoser,
        kept: &kept,
        with: fly(true)?,
        without: fly(false)?,
    };
    let path = folder.path().join("flight");
    create_folder(&path).map_err(JobError::from)?;
    table::write(path.join("flight-reacting.csv"), &flown.table(&flown.with))?;
    table::write(path.join("flight-alone.csv"), &flown.table(&flown.without))?;
    flown.figure(&title(&begins)).draw().save(path.join("flight.svg"))?;
    Ok(match global {
        Global { json: true, .. } => json(&flown.json(onset_s)),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{}{}\n", flown.text(onset_s), path.join("flight.svg").display()),
    })
}

/// The diagnoser of a scenario in a folder. If it is missing, the built-in aileron without tolerances has a shipped
/// one, and any other is learned first.
pub(crate) fn diagnoser(
    options: &StudyOptions,
    folder: &Folder,
    study: &Study,
    scenario: Scenario,
    global: Global,
) -> Result<Arc<Diagnoser>, Failure> {
    if folder.diagnoser(scenario).exists() {
        return Ok(Arc::new(flights::diagnoser(folder, scenario)?));
    }
    if study.flights.is_none() {
        return Err(JobError::NoFlights.into());
    }
    let may_be_shipped = scenario == Scenario::Noise && !study.is_full;
    if let Some(shipped) = may_be_shipped.then(|| shipped::diagnoser(study)).flatten() {
        let text =
            "the diagnosis comes with the program; servotwin study --suite flights learns one";
        note(global, text);
        return Ok(Arc::new(shipped));
    }
    let _hold = options.keep(study, global)?;
    Ok(Arc::new(learned((folder, study), scenario, options.threads, global)?))
}

struct Flown<'f> {
    truths: &'f [Truth],
    study: &'f Study,
    diagnoser: &'f Diagnoser,
    kept: &'f TrackedQuantities,
    with: FlightRecord,
    without: FlightRecord,
}

impl Flown<'_> {
    /// The unit of the command and of the quantity that follows it.
    fn unit(&self) -> Unit {
        command_unit(self.study)
    }

    /// The quantity that follows the command minus the command, SI.
    fn tracking_error(&self, record: &FlightRecord) -> Option<Vec<f64>> {
        self.kept.tracking_error(self.study, record)
    }

    /// The force fight, N.
    fn force_fight(&self, record: &FlightRecord) -> Option<Vec<f64>> {
        self.kept.force_fight(self.study, record)
    }

    fn table(&self, record: &FlightRecord) -> Table {
        let mut columns = vec![Column::new("time_s", "s", Values::Float(record.time_s.clone()))];
        let mut push = |name: &str, unit: Unit, values: &Vec<f64>| {
            let values = Values::Float(values.clone());
            columns.push(Column::new(with_suffix(name, unit), unit.symbol(), values));
        };
        for (input, values) in self.study.system.network().inputs.iter().zip(&record.inputs) {
            push(&input.id, input.unit, values);
        }
        let sensors = self.study.measured.iter().map(|&sensor| &self.study.system.sensors[sensor]);
        for (place, sensor) in sensors.enumerate().take(record.measured.len()) {
            push(&sensor.id, sensor.unit, &record.measured[place]);
            push(&format!("{}.twin", sensor.id), sensor.unit, &record.twin[place]);
        }
        let kept = self.kept.names.iter().zip(&self.kept.units).zip(&record.plant);
        for ((name, unit), values) in kept {
            push(&format!("plant.{name}"), *unit, values);
        }
        Table::from_columns(columns).expect("columns of one length, named apart")
    }

    fn figure(&self, title: &str) -> TimeSeries<'_> {
        let unit = self.unit();
        let shown = |values: &[f64]| {
            values.iter().map(|v| unit.difference_to_shown(*v)).collect::<Vec<f64>>()
        };
        let label = format!(
            "{} / {}",
            if unit == Unit::Radian { "angle" } else { "position" },
            unit.shown()
        );
        let time = self.with.time_s.as_slice();
        let mut panels = vec![];
        let mut panel = |title: &str, y_label: &str, series: Vec<(String, Vec<f64>)>| {
            let lines = series.into_iter().map(|(name, y)| Series::new(name, time, y));
            panels.push(Panel {
                title: title.into(),
                y_label: y_label.into(),
                series: lines.collect(),
                band: None,
            });
        };
        let both = |of: &dyn Fn(&FlightRecord) -> Option<Vec<f64>>| {
            let named = [("without diagnosis", &self.without), ("with it", &self.with)];
            let series =
                named.into_iter().filter_map(|(n, record)| Some((n.to_owned(), of(record)?)));
            series.collect::<Vec<_>>()
        };
        let following = |record: &FlightRecord| Some(shown(&record.plant[self.kept.following?]));
        let mut motion = both(&following);
        motion.push(("command".into(), shown(&self.with.inputs[self.study.command_input])));
        panel("Motion", &label, motion);
        let error = |record: &FlightRecord| self.tracking_error(record).map(|e| shown(&e));
        let error = both(&error);
        if !error.is_empty() {
            panel("Tracking error", &label, error);
        }
        let fight = |record: &FlightRecord| {
            Some(self.force_fight(record)?.iter().map(|f| f / 1e3).collect())
        };
        let fight = both(&fight);
        if !fight.is_empty() {
            let title = match self.study.units.len() {
                2 => "Force fight: half the difference of the rods' forces",
                _ => "Force fight: a rod's force beyond the mean of all, where it is farthest",
            };
            panel(title, "force / kN", fight);
        }
        let residual = |record: &FlightRecord| Some(self.largest_residual(record));
        let widest = self.diagnoser.sensors.iter().max_by_key(|sensor| sensor.spread.is_some());
        let divisor = widest.map_or("scale", |sensor| sensor.residual_divisor());
        panel("Largest residual", &format!("% of {divisor}"), both(&residual));
        if let Some(last) = panels.last_mut() {
            let half = self.diagnoser.lengths[0].panel.bands.iter();
            let half = 100.0 * half.map(|band| band.half_width).fold(0.0, f64::max);
            last.band = Some(Band::constant("widest band", 0.0, half));
        }
        let did = self.with.actions.first();
        let did = did.map(|action| format!(", reaction at {:.2} s", action.time_s));
        let title = format!("{title}{}", did.unwrap_or_default());
        TimeSeries { panels, marks: self.marks(), ..TimeSeries::new(title, "time / s") }
    }

    /// The marks in the figure: every onset, the first detection after the first onset, and every reaction.
    fn marks(&self) -> Vec<Mark> {
        let mark = |at: f64, what: &str| Mark { at, name: format!("{what} {at:.2} s") };
        let mut marks: Vec<Mark> =
            self.truths.iter().map(|truth| mark(truth.onset_s, "onset")).collect();
        let since_s = self.truths.first().map_or(0.0, |truth| truth.onset_s);
        marks.extend(first_report_s(&self.with, since_s).map(|at| mark(at, "detection")));
        marks.extend(self.with.actions.iter().map(|action| mark(action.time_s, "reaction")));
        marks
    }

    /// The largest absolute residual of all sensors, in percent of scale and spread.
    fn largest_residual(&self, record: &FlightRecord) -> Vec<f64> {
        let of = |k: usize| {
            let sizes = record.residuals.iter().map(|residual| residual[k].abs());
            sizes.fold(0.0, f64::max)
        };
        (0..record.time_s.len()).map(|k| 100.0 * of(k)).collect()
    }

    fn numbers(&self, record: &FlightRecord, onset_s: f64) -> [Option<f64>; 3] {
        let since = record.time_s.iter().position(|time| *time >= onset_s).unwrap_or(0);
        let rms = |v: Vec<f64>| {
            let tail = &v[since..];
            (tail.iter().map(|x| x * x).sum::<f64>() / tail.len().max(1) as f64).sqrt()
        };
        let largest = |v: Vec<f64>| v[since..].iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let shown = |error: f64| self.unit().difference_to_shown(error);
        [
            self.tracking_error(record).map(|e| shown(rms(e))),
            self.tracking_error(record).map(|e| shown(largest(e))),
            self.force_fight(record).map(rms),
        ]
    }

    /// The verdict, what the diagnosis is good for, and its evidence.
    fn text(&self, onset_s: f64) -> String {
        let verdict = FlightVerdict::of(self.truths, &self.with, self.diagnoser);
        let mut out = verdict.text();
        if self.with.actions.is_empty() {
            let _ = writeln!(out, "nothing had to be done");
        }
        let unit = self.unit().shown();
        let names = [
            format!("rms tracking error / {unit}"),
            format!("largest tracking error / {unit}"),
            "rms force fight / N".into(),
        ];
        let (with, without) =
            (self.numbers(&self.with, onset_s), self.numbers(&self.without, onset_s));
        for (name, (with, without)) in names.iter().zip(with.into_iter().zip(without)) {
            if let (Some(with), Some(without)) = (with, without) {
                let _ = writeln!(
                    out,
                    "{name}: {} without the diagnosis, {} with it",
                    number(without),
                    number(with)
                );
            }
        }
        let fight = |record| self.numbers(record, onset_s)[2];
        out += &verdict.on_force_fight(fight(&self.with), fight(&self.without));
        out + &self.costs(onset_s).text() + "\n" + &self.events(onset_s)
    }

    /// What the diagnosis said and did, in the order of time.
    fn events(&self, onset_s: f64) -> String {
        let mut out = String::new();
        for change in &self.with.changes {
            let said = spoken(&self.diagnoser.describe(change.finding));
            let alarm = format!("{:?}", change.alarm).to_lowercase();
            let _ = writeln!(out, "{:8.2} s  {alarm:10} {said}", change.time_s);
        }
        for action in &self.with.actions {
            let names = self.diagnoser.names();
            let (unit, command) = (
                &names.actuators[action.raised.actuator as usize],
                &names.actions[action.raised.action as usize],
            );
            let after = action.time_s - onset_s;
            let of = if unit.is_empty() { String::new() } else { format!(" of {}", spoken(unit)) };
            let _ = writeln!(
                out,
                "{:8.2} s  carried out: {}{of}, {after:.2} s after the onset",
                action.time_s,
                spoken(command),
            );
        }
        out
    }

    fn costs(&self, onset_s: f64) -> FlightCosts {
        let of = |record| Cost::of(self.study, record, onset_s);
        FlightCosts { with: of(&self.with), without: of(&self.without) }
    }

    fn json(&self, onset_s: f64) -> serde_json::Value {
        let changes: Vec<_> = self
            .with
            .changes
            .iter()
            .map(|change| {
                json!({
                    "time_s": change.time_s,
                    "alarm": change.alarm,
                    "finding": self.diagnoser.describe(change.finding),
                    "confidence": change.confidence,
                })
            })
            .collect();
        let names = self.diagnoser.names();
        let actions: Vec<_> = self
            .with
            .actions
            .iter()
            .map(|action| {
                let unit = &names.actuators[action.raised.actuator as usize];
                json!({
                    "time_s": action.time_s,
                    "unit": (!unit.is_empty()).then_some(unit),
                    "command": names.actions[action.raised.action as usize],
                })
            })
            .collect();
        let numbers = |record| {
            let [rms, largest, fight_n] = self.numbers(record, onset_s);
            json!({
                "tracking_unit": self.unit().shown(),
                "rms_tracking_error": rms,
                "largest_tracking_error": largest,
                "rms_force_fight_n": fight_n,
            })
        };
        json!({
            "changes": changes,
            "actions": actions,
            "truth": FlightVerdict::of(self.truths, &self.with, self.diagnoser).json(),
            "cost": self.costs(onset_s).json(),
            "with_diagnosis": numbers(&self.with),
            "without": numbers(&self.without),
        })
    }
}
