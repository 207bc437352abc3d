//! `servotwin fly`: flies a plant with a fault and its twin, with the diagnosis and a flight control
//! computer that reacts.

use super::fly_truth::{self, AnsweredFault};
use super::simulate::{fault, onset};
use super::{StudyOptions, diagnoser_at_hand, learned, quantity};
use crate::failure::Failure;
use crate::{Global, Run, stop};
use servotwin::files::create_folder;
use servotwin::job::{Folder, JobError};
use servotwin::live::closed_loop::{self, ClosedLoop, FlightRecord};
use servotwin::live::cost::{Cost, Fluid};
use servotwin::live::tracking::{Deviation, TrackedQuantities, command_unit, first_report_s};
use servotwin::recording::with_suffix;
use servotwin::signal::Signal;
use servotwin::study::{FaultCase, Scenario, Study};
use servotwin::table::{Column, Table, Values};
use servotwin::text::{spoken, three_digits};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::FaultAt;
use servotwin_model::spec::Unit;
use servotwin_view::document::{Document, Table as Rows, Value, Verdict};
use servotwin_view::row;
use servotwin_view::time_series::{Band, Mark, Panel, Series, TimeSeries};
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

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        let study = self.study.read(global)?;
        stop::heed();
        let folder = self.study.folder();
        let scenario = if self.specimen.is_some() { Scenario::Realistic } else { Scenario::Noise };
        let range = "0 to 10,000 s";
        let duration_s = quantity("--duration", &self.duration, Unit::Second, 0.0..=1e4, range)?;
        let mut inputs = study.system.default_inputs();
        let unit = study.system.network().inputs[study.command_input].unit;
        inputs[study.command_input] = match &self.command {
            Some(command) => command
                .build(unit, duration_s)
                .map_err(|error| Failure::signal("--command", &error))?,
            None => study.cases[0].inputs[study.command_input].clone(),
        };
        let begins = faults(self, &study, duration_s)?;
        let onset_s = begins.first().map_or(USUAL_ONSET * duration_s, |first| first.onset_s);
        let diagnoser = diagnoser(&self.study, &folder, &study, scenario, global)?;
        let kept = TrackedQuantities::of(&study);
        let fly = |reacts: bool| {
            let inputs = inputs.clone();
            let faults = begins.iter().map(|one| (one.onset_s, one.fault)).collect();
            let specimen = self.specimen;
            let scenario =
                ClosedLoop { study: &study, inputs, faults, duration_s, specimen, reacts };
            closed_loop::fly(&scenario, &diagnoser, &kept.slots)
        };
        let flown = Flown {
            begins: &begins,
            study: &study,
            diagnoser: &diagnoser,
            kept: &kept,
            with: fly(true)?,
            without: fly(false)?,
        };
        let path = folder.path().join("flight");
        create_folder(&path).map_err(JobError::from)?;
        flown.table(&flown.with).write(path.join("flight-reacting.csv"))?;
        flown.table(&flown.without).write(path.join("flight-alone.csv"))?;
        flown.figure(&title(&begins)).draw().save(path.join("flight.svg"))?;
        let mut document = flown.document(onset_s);
        document.files([path.join("flight.svg")]);
        Ok(document)
    }
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
    let may_be_shipped = scenario == Scenario::Noise && !study.is_full;
    if let Some(own) = diagnoser_at_hand((folder, study), scenario, may_be_shipped, global)? {
        return Ok(Arc::new(own));
    }
    if study.flights.is_none() {
        return Err(JobError::NoFlights.into());
    }
    let _hold = options.keep(study, global)?;
    Ok(Arc::new(learned((folder, study), scenario, options.threads, global)?))
}

struct Flown<'f> {
    begins: &'f [Begins],
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
            let title = match self.study.actuators.len() {
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
            last.band = Some(Band { name: "widest band".into(), low: 0.0, high: half });
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
            self.begins.iter().map(|fault| mark(fault.onset_s, "onset")).collect();
        let since_s = self.begins.first().map_or(0.0, |fault| fault.onset_s);
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

    /// The root mean square and the largest tracking error, SI, and the root mean square of the force fight, N.
    fn numbers(&self, record: &FlightRecord, onset_s: f64) -> [Option<f64>; 3] {
        let since = record.time_s.iter().position(|time| *time >= onset_s).unwrap_or(0);
        let deviation = |values: Vec<f64>| Deviation::since(since, &values);
        let error = self.tracking_error(record).map(deviation);
        let fight = self.force_fight(record).map(deviation);
        [error.map(|own| own.rms), error.map(|own| own.largest), fight.map(|own| own.rms)]
    }

    /// The verdict, what the diagnosis is good for, and its evidence.
    fn document(&self, onset_s: f64) -> Document {
        let answered = |fault: &Begins| {
            let at = (fault.fault, fault.onset_s);
            AnsweredFault::new(self.study, at, &self.with, self.diagnoser)
        };
        let faults: Vec<AnsweredFault> = self.begins.iter().map(answered).collect();
        let first_s = self.begins.first().map_or(f64::INFINITY, |fault| fault.onset_s);
        let false_alarms = self.with.actions.iter().filter(|own| own.time_s < first_s).count();
        let mut sentences: Vec<String> = faults.iter().map(AnsweredFault::sentence).collect();
        match (faults.is_empty(), false_alarms) {
            (true, 0) => sentences.push("truth: no fault; right: no action was raised".into()),
            (_, 0) => {}
            (_, 1) => {
                sentences.push("false alarm: an action was raised before any fault began".into());
            }
            (_, n) => sentences
                .push(format!("{n} false alarms: actions were raised before any fault began")),
        }
        let of = |record| Cost::of(self.study, record, onset_s);
        let (with, without) = (of(&self.with), of(&self.without));
        let mut document = Document::new("fly", Verdict::neutral(sentences.join("\n")));
        faults.iter().for_each(|fault| _ = document.text(fault.truth()));
        if self.with.actions.is_empty() {
            document.text("nothing had to be done");
        }
        document.table("benefit", self.benefit(onset_s, &with, &without));
        let fight = |record| self.numbers(record, onset_s)[2];
        let why = self.drag().filter(|_| fight(&self.with) > fight(&self.without));
        why.into_iter().for_each(|line| _ = document.text(line));
        if !with.fluids.is_empty() {
            document.text(weighed(&with, &without));
        }
        document.table("changes", self.changes()).detail();
        document.table("actions", self.actions(onset_s));
        document.table("faults", fly_truth::table(&faults));
        document.fact("false_alarms", "", false_alarms);
        document
    }

    /// Explains why a shutdown may raise the force fight; `None` for one actuator, or without a shutdown.
    fn drag(&self) -> Option<String> {
        let names = &self.diagnoser.names().actuators;
        let off = self.with.actions.iter().find(|action| action.reaction.switches_off)?;
        (names.len() > 1).then(|| {
            format!(
                "The force fight rises because {} is passive after its shutdown: its bypass lets it move, and the other \
                 actuator drags it along. The forces in the rods are then the drag, not two controllers that disagree.",
                spoken(&names[off.raised.actuator as usize])
            )
        })
    }

    /// What the flight was and cost without the diagnosis, and with it.
    fn benefit(&self, onset_s: f64, with: &Cost, without: &Cost) -> Rows {
        let mut table = Rows::of(
            "quantity:since the onset | unit: | without:without the diagnosis | with:with it",
        );
        let unit = self.unit();
        let shown = |si: f64, unit: Unit| {
            let text = format!("{} {}", three_digits(unit.difference_to_shown(si)), unit.shown());
            Value::number(si, text)
        };
        let mut add = |name: String, unit: Unit, values: [Value; 2]| {
            let [without, with] = values;
            table.push(row![name, unit.symbol(), without, with]);
        };
        let names = ["rms tracking error", "largest tracking error", "rms force fight"];
        let units = [unit, unit, Unit::Newton];
        let both = [&self.without, &self.with].map(|record| self.numbers(record, onset_s));
        for (place, (name, unit)) in names.into_iter().zip(units).enumerate() {
            if let [Some(without), Some(with)] = both.map(|numbers| numbers[place]) {
                add(name.into(), unit, [without, with].map(|value| shown(value, unit)));
            }
        }
        let costs = [without, with];
        for (with, without) in leaking(with, without) {
            let name = spoken(&with.reservoir);
            let lost = |fluid: &Fluid| {
                Value::number(fluid.lost_m3, format!("{} L", three_digits(1e3 * fluid.lost_m3)))
            };
            let empty = |fluid: &Fluid| Value::of(emptied(fluid), &fluid.empty_s);
            add(format!("fluid lost from {name}"), Unit::CubicMetre, [lost(without), lost(with)]);
            add(format!("{name} is empty"), Unit::Second, [empty(without), empty(with)]);
        }
        if !with.fluids.is_empty() {
            let seconds = |cost: &Cost| shown(cost.in_fault_s, Unit::Second);
            add("time in fault".into(), Unit::Second, costs.map(seconds));
            let authority = |cost: &Cost| {
                Value::number(cost.authority, format!("{} %", three_digits(100.0 * cost.authority)))
            };
            add("authority at the end".into(), Unit::None, costs.map(authority));
        }
        table
    }

    /// What the diagnosis said, in the order of time.
    fn changes(&self) -> Rows {
        let mut table = Rows::of("time | alarm | finding | confidence:");
        for change in &self.with.changes {
            let finding = self.diagnoser.describe(change.finding);
            let alarm = Value::of(format!("{:?}", change.alarm).to_lowercase(), &change.alarm);
            let confidence = Value::of("", &change.confidence);
            let time = Value::seconds(change.time_s, 4);
            table.push(row![time, alarm, Value::name(&finding), confidence]);
        }
        table
    }

    /// What the flight control computer did.
    fn actions(&self, onset_s: f64) -> Rows {
        let mut table =
            Rows::of("time | action:carried out | actuator:_ | after_onset:after the onset");
        let names = self.diagnoser.names();
        for action in &self.with.actions {
            let actuator = names.actuators[action.raised.actuator as usize].as_str();
            let actuator = Some(actuator).filter(|actuator| !actuator.is_empty());
            table.push(row![
                Value::seconds(action.time_s, 4),
                Value::name(&names.actions[action.raised.action as usize]),
                actuator.map(Value::name),
                Value::seconds(action.time_s - onset_s, 3),
            ]);
        }
        table
    }
}

/// Reservoirs that lose fluid in either flight.
fn leaking<'c>(with: &'c Cost, without: &'c Cost) -> impl Iterator<Item = (&'c Fluid, &'c Fluid)> {
    let both = with.fluids.iter().zip(&without.fluids);
    both.filter(|(with, without)| with.empty_s.or(without.empty_s).is_some())
}

/// Weighs the authority given up against the fluid kept.
fn weighed(with: &Cost, without: &Cost) -> String {
    let price = match without.authority - with.authority {
        share if share > 0.0 => format!("costs {} % of the authority", three_digits(100.0 * share)),
        _ => "costs no authority".into(),
    };
    let Some((with, without)) = leaking(with, without).next() else {
        return format!(
            "Weighed: no reservoir would be empty within a day. The diagnosis {price}."
        );
    };
    let gain = match with.empty_s {
        None => "stops the loss".into(),
        Some(_) => format!("does not stop the loss: {}", emptied(with)),
    };
    let name = spoken(&without.reservoir);
    format!(
        "Weighed: without the diagnosis, {name} is empty {}, and everything that it feeds stops. The diagnosis {price} \
         and {gain}.",
        emptied(without)
    )
}

/// When a reservoir is empty, counted from the onset.
fn emptied(fluid: &Fluid) -> String {
    match fluid.empty_s {
        None => "not within a day".into(),
        Some(time_s) if time_s < 120.0 => format!("{time_s:.0} s after the onset"),
        Some(time_s) if time_s < 7200.0 => format!("{:.0} min after the onset", time_s / 60.0),
        Some(time_s) => format!("{:.1} h after the onset", time_s / 3600.0),
    }
}
