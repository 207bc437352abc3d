//! Takes training windows out of flights, one data set for each kind of window. They are the windows that a diagnosis
//! would judge there, from the same [`Windows`].
//!
//! A healthy flight gives windows at even distances. A flight with a fault gives the last window before the onset and
//! some after it, the first of which contain the onset. Additional healthy flights, one in each of many environments,
//! give only the windows that leave their bands (hard negatives): trees and committee are only asked about such
//! windows, and there are a few hundred in all other healthy flights of a study, most of them in a few environments.
//!
//! Every environment counts as a separate command.

use super::data_set::{self, DataSet, LabeledRow};
use super::error::EvaluationError;
use super::windows::WindowDesign;
use crate::learn::bands;
use crate::parallel::{self, Workers};
use crate::records::columns::seen;
use crate::records::{DataFeature, data_features};
use crate::run::compute::{Kept, Round, Take};
use crate::run::part::{self, PartFiles};
use crate::run::{Observer, Run, RunError, Runner, plan};
use crate::study::suites::{HARD_NEGATIVES, LEARN};
use crate::study::{Purpose, Scenario, Stream, Study, Suite};
use crate::table::{Column, Table, TableError};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::Error;
use servotwin_diagnosis::features::{self, Sensors};
use servotwin_diagnosis::hierarchy::HEALTHY;
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::residual::{BAND, Window};
use servotwin_diagnosis::spread::Spread;
use servotwin_diagnosis::windows::{WindowKind, WindowSample, Windows};
use std::collections::BTreeMap;
use std::path::Path;
use std::slice::from_ref;

/// Windows after the onset: the first two are taken when this share of a window has passed, the others at random times.
const SHARES: [f64; 2] = [0.6, 1.0];
/// Number of these others: many, because some faults only show in some motions.
const OTHERS: usize = 12;
/// Every n-th flight with a fault also gives the window before it.
const BEFORE: usize = 4;
/// A window is not used if the fault is below this share of its intensity both at the window's middle and at its end.
const LEAST_SHARE: f64 = 0.5;

/// A window taken out of a flight.
#[derive(Clone, Debug)]
pub(crate) struct TrainingWindow {
    /// Whether it comes from the suite [`HARD_NEGATIVES`], rather than [`LEARN`].
    is_hard_negative: bool,
    /// The index of its kind.
    kind: usize,
    /// The number of samples of the flight when it was taken.
    at: usize,
    is_faulty: bool,
    flight: usize,
    window: Window,
}

/// The windows taken out of flights.
#[derive(Clone, Debug, Default)]
pub(crate) struct TrainingWindows {
    list: Vec<TrainingWindow>,
    left_out: LeftOut,
}

/// Training flights that were not used.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Number of flights that failed.
    pub failed: u64,
    /// The flights that began without a steady state.
    pub(crate) on_the_move: Vec<MovingFlight>,
}

/// The most flights without a steady state that are named in a message; the results file lists all.
const MAX_NAMED: usize = 10;

impl LeftOut {
    /// Names the flights of a scenario that began without a steady state; `None` if there are none.
    pub fn without_steady_state(&self, scenario: &str) -> Option<String> {
        let moving = &self.on_the_move;
        let name = |one: &MovingFlight| format!("{} (environment {})", one.flight, one.environment);
        let named: Vec<String> = moving.iter().take(MAX_NAMED).map(name).collect();
        let more = match moving.len().saturating_sub(MAX_NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        (!moving.is_empty()).then(|| {
            format!(
                "{scenario}: {} flights to learn from began without a steady state and teach nothing: {}{more}",
                moving.len(),
                named.join(", ")
            )
        })
    }
}

/// A flight whose plant or twin began without a steady state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct MovingFlight {
    /// The flight's number.
    pub(crate) flight: usize,
    /// The index of its environment.
    pub(crate) environment: usize,
}

impl TrainingWindows {
    /// Adds the windows of another flight.
    fn extend(&mut self, other: TrainingWindows) {
        self.list.extend(other.list);
        self.left_out.failed += other.left_out.failed;
        self.left_out.on_the_move.extend(other.left_out.on_the_move);
    }

    /// The flights that were not used.
    pub(crate) fn left_out(&self) -> &LeftOut {
        &self.left_out
    }

    /// The half widths of bands learned from healthy windows of each kind; `None` for too few windows.
    pub(crate) fn bands(&self, design: &WindowDesign, pools: &[usize]) -> Option<Vec<Vec<f64>>> {
        let of_kind = |kind: usize| {
            let healthy = self.list.iter().filter(|l| l.kind == kind && !l.is_faulty);
            let largest = |own: &TrainingWindow| -> Vec<f64> {
                (0..pools.len()).map(|sensor| own.window.largest(sensor)).collect()
            };
            let largest: Vec<Vec<f64>> = healthy.map(largest).collect();
            let largest: Vec<&[f64]> = largest.iter().map(Vec::as_slice).collect();
            bands::half_widths(&largest, pools, design.alarms())
        };
        (0..design.kinds().len()).map(of_kind).collect()
    }

    /// The table of a part.
    fn to_table(&self) -> Result<Table, TableError> {
        let list = &self.list;
        let mut columns = vec![
            Column::of("flight", "", list, |own| own.flight as u32),
            Column::of("kind", "", list, |own| own.kind as u32),
            Column::of("at_samples", "", list, |own| own.at as u32),
            Column::of("is_faulty", "", list, |own| own.is_faulty),
        ];
        let windows: Vec<&Window> = self.list.iter().map(|own| &own.window).collect();
        columns.extend(part::window_columns(&windows));
        let left_out = serde_json::to_string(&self.left_out).expect("numbers");
        Ok(Table::from_columns(columns)?.with_metadata(LEFT_OUT, left_out))
    }

    /// Adds the windows of a part.
    fn add(
        &mut self,
        table: &Table,
        sensors: usize,
        is_hard_negative: bool,
    ) -> Result<(), TableError> {
        let left_out =
            table.metadata.get(LEFT_OUT).and_then(|text| serde_json::from_str(text).ok());
        let LeftOut { failed, on_the_move } = left_out.unwrap_or_default();
        self.left_out.failed += failed;
        self.left_out.on_the_move.extend(on_the_move);
        if table.row_count() == 0 {
            return Ok(());
        }
        let [flights, kinds, at] = ["flight", "kind", "at_samples"].map(|name| table.u32(name));
        let (flights, kinds, at) = (flights?, kinds?, at?);
        let is_faulty = table.bool("is_faulty")?;
        let windows = part::windows_of(table, (sensors, sensors))?;
        self.list.extend(windows.into_iter().enumerate().map(|(row, window)| TrainingWindow {
            is_hard_negative,
            kind: kinds[row] as usize,
            at: at[row] as usize,
            is_faulty: is_faulty[row],
            flight: flights[row] as usize,
            window,
        }));
        Ok(())
    }
}

/// The key of the flights that were not used in the file of a part.
const LEFT_OUT: &str = "left_out";

/// Which windows of a flight are taken.
enum Pick<'p> {
    /// The newest at these times, the latest first.
    Newest(Vec<Planned>),
    /// Those that leave the bands of their kind, as half widths in parts of scale.
    Outside(&'p [Vec<f64>]),
}

/// A window to take.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Planned {
    /// The index of its kind.
    kind: usize,
    /// The number of samples after which its newest window is taken.
    at: usize,
    is_faulty: bool,
}

/// Takes windows out of a flight. The baseline adapts until the fault begins, as that of a diagnosis does until it
/// suspects a fault.
struct Collector<'p> {
    is_hard_negative: bool,
    windows: Windows,
    scales: Vec<f64>,
    stands_in: Vec<bool>,
    flight: Run,
    onset: usize,
    pick: Pick<'p>,
    taken: Vec<TrainingWindow>,
}

impl<'p> Collector<'p> {
    fn new(flown: &Runner, windows: Windows, flight: Run, pick: Pick<'p>) -> Self {
        let study = flown.study();
        let sensors = study.base_sensors();
        Collector {
            is_hard_negative: flown.suite().name == HARD_NEGATIVES,
            windows,
            scales: study.scales()[..sensors].to_vec(),
            stands_in: vec![false; sensors],
            flight,
            onset: (flight.onset_s / study.sample_period_s) as usize,
            pick,
            taken: vec![],
        }
    }
}

impl Observer for Collector<'_> {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        let has_new = self.windows.add(&WindowSample {
            measured,
            twin,
            scales: &self.scales,
            stands_in: &self.stands_in,
            is_trusted: index < self.onset,
        });
        let Collector { windows, pick, taken, flight, is_hard_negative, .. } = self;
        let mut take = |kind: usize, is_faulty: bool| {
            let window = windows.of(kind).window().clone();
            let (at, flight, is_hard_negative) = (index + 1, flight.number, *is_hard_negative);
            taken.push(TrainingWindow { is_hard_negative, kind, at, is_faulty, flight, window });
        };
        match pick {
            Pick::Newest(planned) => {
                while let Some(next) = planned.pop_if(|planned| planned.at == index + 1) {
                    if windows.of(next.kind).is_full() {
                        take(next.kind, next.is_faulty);
                    }
                }
            }
            Pick::Outside(bands) if has_new => {
                for (kind, bands) in bands.iter().enumerate() {
                    let is_new = windows.of(kind).has_ended() && windows.of(kind).is_full();
                    let window = windows.of(kind).window();
                    let mut bands = bands.iter().enumerate();
                    if is_new && bands.any(|(sensor, band)| window.largest(sensor) > *band) {
                        take(kind, false);
                    }
                }
            }
            Pick::Outside(_) => (),
        }
    }
}

/// A suite of flights to learn from, in a scenario.
pub(crate) struct TrainingFlights<'f> {
    design: &'f WindowDesign<'f>,
    suite: &'f Suite,
    workers: Workers<'f>,
    /// The bands that windows of [`HARD_NEGATIVES`] leave, as half widths in parts of scale, for each kind.
    bands: Vec<Vec<f64>>,
    /// The files of the parts.
    pub(crate) files: PartFiles,
}

impl<'f> TrainingFlights<'f> {
    /// A suite with its parts in an output folder, and the threads that fly it.
    pub(crate) fn new(
        folder: &Path,
        design: &'f WindowDesign,
        suite: &'f Suite,
        bands: Vec<Vec<f64>>,
        workers: Workers<'f>,
    ) -> Self {
        let (study, scenario) = (design.study, design.scenario);
        let mut mark = part::model_mark(study);
        mark.add(&study.text).add(scenario.name());
        mark.add(&suite.name).add(&suite.environments).add(&bands);
        design.spreads.iter().for_each(|spread| {
            mark.add(&spread.map(|Spread { spool, growth }| (u64::from(spool), growth)));
        });
        let parts = part::parts(study, suite, plan::all(study, suite));
        let files = PartFiles::new(folder, stem(suite, scenario), mark, parts);
        TrainingFlights { design, suite, workers, bands, files }
    }

    /// Adds the windows of all parts, by flight.
    ///
    /// # Errors
    /// [`RunError::Unfinished`] if a part is missing.
    pub(crate) fn add_to(&self, taken: &mut TrainingWindows) -> Result<(), RunError> {
        let (sensors, is_hard_negative) =
            (self.design.study.base_sensors(), self.suite.name == HARD_NEGATIVES);
        for part in 0..self.files.parts.len() {
            if let Some(table) = self.files.read(part)? {
                taken.add(&table, sensors, is_hard_negative)?;
            }
        }
        taken.list.sort_by_key(|own| (own.kind, own.is_hard_negative, own.flight, own.at));
        taken.left_out.on_the_move.sort_unstable();
        Ok(())
    }
}

impl Kept for TrainingFlights<'_> {
    type Row = TrainingWindows;

    fn place(&self) -> (&Study, &Suite, Scenario) {
        (self.design.study, self.suite, self.design.scenario)
    }

    fn files(&self) -> &[PartFiles] {
        from_ref(&self.files)
    }

    fn fly(&self, round: &Round, take: Take<TrainingWindows>) -> Result<(), RunError> {
        let (study, suite, scenario) = self.place();
        let runs = round.numbers().map(|number| plan::run(study, suite, number)).collect();
        let mut flown = Runner::new(study, suite, (scenario, None), runs, self.workers)?;
        flown.stop = Some(&round.stop);
        let (empty, kinds) = (self.design.empty(), self.design.kinds());
        let pick = |run: &Run| match suite.name.as_str() {
            HARD_NEGATIVES => Pick::Outside(&self.bands),
            _ => {
                let random = suite.seed_of(run.number).choices(Stream::Windows);
                Pick::Newest(planned(&kinds, run, flown.period_s(), random))
            }
        };
        flown.fly(
            |flight| Collector::new(&flown, empty.clone(), *flight, pick(flight)),
            |flight, collector, outcome| {
                let mut own = TrainingWindows::default();
                match outcome {
                    Ok(work) if flown.is_on_the_move(flight, work) => {
                        let (flight, environment) = (flight.number, flight.environment);
                        own.left_out.on_the_move.push(MovingFlight { flight, environment });
                    }
                    Ok(_) => own.list = collector.taken,
                    Err(_) => own.left_out.failed += 1,
                }
                take(0, flight.number, own);
            },
        );
        Ok(())
    }

    fn table(&self, rows: BTreeMap<usize, TrainingWindows>) -> Result<Table, TableError> {
        let mut part = TrainingWindows::default();
        rows.into_values().for_each(|own| part.extend(own));
        part.to_table()
    }
}

/// How the names of the files of a suite's parts begin.
pub(crate) fn stem(suite: &Suite, scenario: Scenario) -> String {
    format!("windows-{}-{}", suite.name, scenario.name())
}

/// What windows of one kind teach: their data set, and the number of the flight of each of its variants.
pub(crate) struct WindowData {
    pub(crate) data: DataSet,
    pub(crate) flight_of: Vec<usize>,
}

/// The data sets of all kinds of windows.
///
/// # Errors
/// There is no fault to learn from, or the run was cancelled.
pub(crate) fn data_sets(
    design: &WindowDesign,
    taken: &TrainingWindows,
    workers: Workers,
) -> Result<Vec<WindowData>, EvaluationError> {
    let of_kind = |kind: usize| {
        let own: Vec<&TrainingWindow> = taken.list.iter().filter(|own| own.kind == kind).collect();
        data_set(design, &own, workers)
    };
    (0..design.kinds().len()).map(of_kind).collect()
}

fn data_set(
    design: &WindowDesign,
    taken: &[&TrainingWindow],
    workers: Workers,
) -> Result<WindowData, EvaluationError> {
    let study = design.study;
    let sensors = Sensors(study.sensors_in(design.scenario).0[..study.base_sensors()].to_vec());
    let suites = [LEARN, HARD_NEGATIVES].map(|name| study.suite(name));
    let suite_of = |own: &TrainingWindow| {
        suites[usize::from(own.is_hard_negative)].expect("the suite of the window")
    };
    let runs: Vec<Run> = taken.iter().map(|w| plan::run(study, suite_of(w), w.flight)).collect();
    let case = |(own, run): (&&TrainingWindow, &Run)| {
        format!("{}/{:03}", suite_of(own).name, run.environment)
    };
    let cases: Vec<String> = taken.iter().zip(&runs).map(case).collect();
    let rows = taken.iter().zip(&runs).zip(&cases).enumerate();
    let rows = rows.map(|(place, ((own, run), case))| labeled(study, place, (own, run, case)));
    let rows: Vec<LabeledRow> = rows.collect();
    let (features, views) = features_of(study, &sensors, taken, workers)?;
    let names = data_set::names(&rows, &features, &study.actuators, &study.actions())?;
    let sensors = sensors.0.into_iter().map(|sensor| sensor.name).collect();
    let data = DataSet::of(&rows, (features, views), sensors, names)?;
    Ok(WindowData { data, flight_of: taken.iter().map(|own| own.flight).collect() })
}

/// What is known of a window. Its environment is its operating case and its command.
fn labeled<'t>(
    study: &'t Study,
    variant: usize,
    (own, run, case): (&TrainingWindow, &Run, &'t str),
) -> LabeledRow<'t> {
    let fault = run.fault.filter(|_| own.is_faulty).map(|fault| &study.faults[fault]);
    let class = fault.map(|fault| &study.classes[fault.class]);
    let or_healthy = |text: Option<&'t String>| text.map_or(HEALTHY, String::as_str);
    LabeledRow {
        purpose: Purpose::Train,
        variant,
        case,
        flown: case,
        fault: or_healthy(fault.map(|fault| &fault.id)),
        kind: or_healthy(fault.map(|fault| &fault.kind)),
        actuator: or_healthy(fault.map(|fault| &study.actuators[fault.actuator])),
        action: or_healthy(class.map(|class| &class.action)),
        detail: or_healthy(class.map(|class| &class.detail)),
        grade: fault.map_or(0.0, |fault| fault.at.intensity),
        own_intensity: fault.map_or(0.0, |_| run.intensity),
        began_on_the_move: false,
        is_detectable: own.window.largest_of_all() > BAND,
        largest: (0..study.base_sensors()).map(|sensor| own.window.largest(sensor)).collect(),
    }
}

/// The features that sliding windows teach, and their column-major values in every view.
fn features_of(
    study: &Study,
    sensors: &Sensors,
    taken: &[&TrainingWindow],
    workers: Workers,
) -> Result<(Vec<DataFeature>, Vec<Vec<f64>>), EvaluationError> {
    let mut features = data_features(study);
    features.retain(|known| !known.extra && known.feature.teaches.of_windows());
    let known = features::ALL.iter().flat_map(|family| family.features(sensors));
    let known: Vec<String> = known.map(|feature| feature.name).collect();
    let orders = sensors.rotations(study.actuators.len()).unwrap_or_default();
    let rows = parallel::map(taken, workers, |own| seen(sensors, &orders, &own.window))?;
    let mut views = vec![];
    for view in 0..=orders.len() {
        let mut values = Vec::with_capacity(features.len() * rows.len());
        for DataFeature { feature, .. } in &features {
            let place = known.iter().position(|name| *name == feature.name);
            let place = place.expect("a feature of these sensors");
            values.extend(rows.iter().map(|row| row[view][place]));
            let column = &values[values.len() - rows.len()..];
            if let Some(row) = column.iter().position(|value| !value.is_finite()) {
                return Err(Error::NotFinite { column: feature.name.clone(), row }.into());
            }
        }
        views.push(values);
    }
    Ok((features, views))
}

/// The windows to take out of a flight, the latest first.
fn planned(kinds: &[WindowKind], flight: &Run, period_s: f64, mut random: Random) -> Vec<Planned> {
    let mut all = vec![];
    for (kind, WindowKind { span, .. }) in kinds.iter().enumerate() {
        let window_s = span.samples() as f64 * period_s;
        let mut plan = |at_s: f64, is_faulty: bool| {
            if (window_s - 0.5 * period_s..=flight.duration_s).contains(&at_s) {
                let at = (at_s / period_s).round() as usize;
                all.push(Planned { kind, at, is_faulty });
            }
        };
        if flight.fault.is_none() {
            // Windows are spaced apart to be as diverse as possible.
            let apart_s = if span.panes == 1 { window_s } else { (2.0 * window_s).max(2.0) };
            let count = (flight.duration_s / apart_s) as usize;
            (1..=count).for_each(|k| plan(flight.duration_s * k as f64 / count as f64, false));
            continue;
        }
        if flight.number.is_multiple_of(BEFORE) {
            plan(flight.onset_s, false);
        }
        // At different panes, so that no window is taken twice.
        let pane_s = f64::from(span.pane_samples) * period_s;
        let panes = ((flight.duration_s - flight.onset_s - window_s) / pane_s) as usize;
        let mut order: Vec<usize> = (1..=panes).collect();
        random.shuffle(&mut order);
        let others = order.into_iter().take(OTHERS).map(|pane| window_s + pane as f64 * pane_s);
        for after_s in SHARES.iter().map(|share| share * window_s).chain(others) {
            let at_s = flight.onset_s + after_s;
            let shares = [at_s - 0.5 * window_s, at_s - period_s].map(|t| flight.share(t));
            if shares.into_iter().fold(0.0, f64::max) >= LEAST_SHARE {
                plan(at_s, true);
            }
        }
    }
    all.sort_by_key(|planned| std::cmp::Reverse(planned.at));
    all
}
