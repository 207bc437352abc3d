//! Takes training windows out of flights, one table for each kind of window. They are the windows that a diagnosis
//! would judge there, from the same [`Windows`].
//!
//! A healthy flight gives windows at even distances. A flight with a fault gives the last window before the onset and
//! some after it, the first of which contain the onset. Additional healthy flights, one in each of many environments,
//! give only the windows that leave their bands (hard negatives): trees and committee are only asked about such
//! windows, and there are a few hundred in all other healthy flights of a study, most of them in a few environments.
//!
//! The tables have the columns of a campaign's data set ([`crate::evaluation::DataSet`] reads them). Every environment
//! counts as a separate command.

use super::windows::WindowDesign;
use crate::campaign::columns::{Shown, fault_columns, feature_columns, largest_columns, seen};
use crate::evaluation::bands;
use crate::parallel::{self, Workers};
use crate::run::runner::in_batches;
use crate::run::{CampaignError, Observer, Run, Runner, plan};

use crate::study::suites::{HARD_NEGATIVES, LEARN};
use crate::study::{Stream, Study, Suite};
use crate::table::{Column, Table, Values};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::features::{self, Sensors};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::residual::{BAND, Window};
use servotwin_diagnosis::windows::{WindowKind, WindowSample, Windows};

/// Windows after the onset: the first two are taken when this share of a window has passed, the others at random times.
const SHARES: [f64; 2] = [0.6, 1.0];
/// Number of these others: many, because some faults only show in some motions.
const OTHERS: usize = 12;
/// Every n-th flight with a fault also gives the window before it.
const BEFORE: usize = 4;
/// A window is not used if the fault is below this share of its intensity both at the window's middle and at its end.
const LEAST_SHARE: f64 = 0.5;

/// A window taken out of a flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct TrainingWindow {
    /// Whether it comes from the suite [`HARD_NEGATIVES`], rather than [`LEARN`].
    is_hard_negative: bool,
    /// The index of its kind.
    kind: usize,
    /// The number of samples of the flight when it was taken.
    at: usize,
    is_faulty: bool,
    flight: usize,
    /// The bits of the window's values, which may be infinite.
    bits: Vec<u64>,
}

impl TrainingWindow {
    fn window(&self, sensors: usize) -> Window {
        let values: Vec<f64> = self.bits.iter().map(|&bits| f64::from_bits(bits)).collect();
        Window::from_values(sensors, sensors, &values).expect("the values of a window")
    }
}

/// The windows taken out of flights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrainingWindows {
    list: Vec<TrainingWindow>,
    /// Number of flights that failed; they are not used.
    pub failed: usize,
    /// Flights that began without a steady state; they are not used either.
    pub on_the_move: Vec<MovingFlight>,
}

/// Training flights that were not used.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Number of flights that failed.
    pub failed: u64,
    /// The flights that began without a steady state.
    pub on_the_move: Vec<MovingFlight>,
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
pub struct MovingFlight {
    /// The flight's number.
    pub flight: usize,
    /// The index of its environment.
    pub environment: usize,
}

impl TrainingWindows {
    /// Adds the windows of other flights.
    pub fn add(&mut self, other: TrainingWindows) {
        self.list.extend(other.list);
        self.failed += other.failed;
        self.on_the_move.extend(other.on_the_move);
    }

    /// The flights that were not used.
    pub(crate) fn left_out(&self) -> LeftOut {
        let mut on_the_move = self.on_the_move.clone();
        on_the_move.sort_unstable();
        LeftOut { failed: self.failed as u64, on_the_move }
    }

    /// Takes the windows of a campaign's flights, those that `pick` wants. Failed flights are left out.
    fn take<'p>(
        &mut self,
        flown: &Runner,
        design: &WindowDesign,
        pick: impl Fn(&Run) -> Pick<'p> + Sync,
    ) {
        let empty = design.empty();
        flown.fly(
            |flight| Collector::new(flown, empty.clone(), *flight, pick(flight)),
            |flight, collector, outcome| match outcome {
                Ok(work) if flown.is_on_the_move(flight, work) => {
                    self.on_the_move.push(MovingFlight {
                        flight: flight.number,
                        environment: flight.environment,
                    });
                }
                Ok(_) => self.list.extend(collector.taken),
                Err(_) => self.failed += 1,
            },
        );
    }

    /// Sorts by kind, flight and time, because flights end in arbitrary order.
    fn sort(&mut self) {
        self.list.sort_by_key(|own| (own.kind, own.is_hard_negative, own.flight, own.at));
    }

    /// The half widths of bands learned from healthy windows of a kind; `None` for too few windows.
    fn bands(&self, kind: usize, pools: &[usize], alarms: f64) -> Option<Vec<f64>> {
        let healthy = self.list.iter().filter(|l| l.kind == kind && !l.is_faulty);
        let largest = |own: &TrainingWindow| -> Vec<f64> {
            let window = own.window(pools.len());
            (0..pools.len()).map(|sensor| window.largest(sensor)).collect()
        };
        let largest: Vec<Vec<f64>> = healthy.map(largest).collect();
        let largest: Vec<&[f64]> = largest.iter().map(Vec::as_slice).collect();
        bands::half_widths(&largest, pools, alarms)
    }
}

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
            let bits =
                windows.of(kind).window().to_values().into_iter().map(f64::to_bits).collect();
            let (at, flight, is_hard_negative) = (index + 1, flight.number, *is_hard_negative);
            taken.push(TrainingWindow { is_hard_negative, kind, at, is_faulty, flight, bits });
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

/// Takes training windows out of runs of [`LEARN`].
pub fn of_runs(design: &WindowDesign, flown: &Runner) -> TrainingWindows {
    let kinds = design.kinds();
    let mut taken = TrainingWindows::default();
    taken.take(flown, design, |run| {
        let random = flown.suite().seed_of(run.number).choices(Stream::Windows);
        Pick::Newest(planned(&kinds, run, flown.period_s(), random))
    });
    taken
}

/// Takes training windows out of all runs of [`LEARN`].
///
/// # Errors
/// A twin cannot be simulated, or the run was cancelled.
pub fn learn(
    design: &WindowDesign,
    is_full: bool,
    workers: Workers,
) -> Result<TrainingWindows, CampaignError> {
    let mut taken = TrainingWindows::default();
    if let Some(suite) = design.study.suite(LEARN, is_full) {
        in_batches(
            design.study,
            suite,
            design.scenario,
            0..suite.environments,
            workers,
            |flown, _| {
                taken.add(of_runs(design, flown));
                Ok::<_, CampaignError>(())
            },
        )?;
    }
    Ok(taken)
}

/// Flies [`HARD_NEGATIVES`] and adds the windows that leave the bands of those that are there already.
///
/// # Errors
/// A twin cannot be simulated, or the run was cancelled.
pub(crate) fn add_hard_negatives(
    design: &WindowDesign,
    is_full: bool,
    taken: &mut TrainingWindows,
    pools: &[usize],
    workers: Workers,
) -> Result<(), CampaignError> {
    taken.sort();
    let of_kind = |kind| taken.bands(kind, pools, design.alarms());
    let bands = (0..design.kinds().len()).map(of_kind).collect::<Option<Vec<Vec<f64>>>>();
    let suite = design.study.suite(HARD_NEGATIVES, is_full);
    let (Some(bands), Some(suite)) = (bands, suite) else { return Ok(()) };
    in_batches(design.study, suite, design.scenario, 0..suite.environments, workers, |flown, _| {
        taken.take(flown, design, |_| Pick::Outside(&bands));
        Ok(())
    })
}

/// A table for each kind of window.
///
/// # Errors
/// The run was cancelled.
pub fn tables(
    design: &WindowDesign,
    is_full: bool,
    mut taken: TrainingWindows,
    workers: Workers,
) -> Result<Vec<Table>, CampaignError> {
    taken.sort();
    let study = design.study;
    let sensors = Sensors(study.sensors_in(design.scenario).0[..study.base_sensors()].to_vec());
    let suites = [LEARN, HARD_NEGATIVES].map(|name| study.suite(name, is_full));
    let mut tables = vec![];
    for kind in 0..design.kinds().len() {
        let of: Vec<&TrainingWindow> = taken.list.iter().filter(|l| l.kind == kind).collect();
        tables.push(Maker { study, sensors: &sensors, suites }.table(&of, workers)?);
    }
    Ok(tables)
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

struct Maker<'m> {
    study: &'m Study,
    sensors: &'m Sensors,
    /// [`LEARN`] and [`HARD_NEGATIVES`].
    suites: [Option<&'m Suite>; 2],
}

impl Maker<'_> {
    fn table(&self, taken: &[&TrainingWindow], workers: Workers) -> Result<Table, CampaignError> {
        let windows: Vec<Window> =
            taken.iter().map(|own| own.window(self.sensors.0.len())).collect();
        let orders = self.sensors.rotations(self.study.units.len()).unwrap_or_default();
        let view = |window: &Window| seen(self.sensors, &orders, window);
        let rows = parallel::map(&windows, workers, view).map_err(|_| CampaignError::Cancelled)?;
        let mut columns = self.labels(taken, &windows);
        let windows: Vec<&Window> = windows.iter().collect();
        columns.extend(largest_columns(&self.sensors.0, &windows));
        let features: Vec<_> =
            features::ALL.iter().flat_map(|family| family.features(self.sensors)).collect();
        columns.extend(feature_columns(features.iter(), &rows));
        Ok(Table::from_columns(columns).expect("columns of one length, named apart"))
    }

    fn labels(&self, taken: &[&TrainingWindow], windows: &[Window]) -> Vec<Column> {
        let suite = |own: &TrainingWindow| {
            self.suites[usize::from(own.is_hard_negative)].expect("the suite of the window")
        };
        let flight = |own: &TrainingWindow| plan::run(self.study, suite(own), own.flight);
        let shown = |own: &&TrainingWindow| match flight(own) {
            Run { fault, intensity, .. } if own.is_faulty => Shown { fault, intensity },
            _ => Shown { fault: None, intensity: 0.0 },
        };
        let case =
            |own: &&TrainingWindow| format!("{}/{:03}", suite(own).name, flight(own).environment);
        let cases: Vec<String> = taken.iter().map(case).collect();
        let number = |name: &str, unit: &str, of: &dyn Fn(&TrainingWindow) -> f64| {
            let numbers = taken.iter().map(|own| of(own)).collect();
            Column::new(name, unit, Values::Float(numbers))
        };
        let period_s = self.study.sample_period_s;
        let detectable = windows.iter().map(|w| w.largest_of_all() > BAND).collect();
        let number_of = taken.iter().map(|l| l.flight as u32).collect();
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(number_of)),
            Column::new("case", "", Values::Text(cases.clone())),
            Column::new("flown", "", Values::Text(cases)),
        ];
        columns.extend(fault_columns(self.study, &taken.iter().map(shown).collect::<Vec<_>>()));
        columns.extend([
            number("end_s", "s", &|l| l.at as f64 * period_s),
            number("age_s", "s", &|l| match l.is_faulty {
                true => l.at as f64 * period_s - flight(l).onset_s,
                false => 0.0,
            }),
            Column::new("detectable", "", Values::Flag(detectable)),
            Column::new("failure", "", Values::Text(vec![String::new(); taken.len()])),
        ]);
        columns
    }
}
