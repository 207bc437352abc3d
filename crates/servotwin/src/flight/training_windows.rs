//! Cuts training windows out of flights, one table for each kind of window.
//!
//! A healthy flight gives consecutive windows. A flight with a fault gives the last window before the onset and some
//! after it, the first of which contain the onset. The tables have the columns of a campaign's data set
//! ([`crate::evaluation::DataSet`] reads them). Every environment counts as a separate command.

use super::campaign::{FlightCampaign, Observer};
use super::plan::{self, PlannedFlight, Purpose};
use super::windows::{self, WindowKind};
use crate::campaign::columns::{Shown, fault_columns, feature_columns, largest_columns, seen};
use crate::evaluation::bands;
use crate::experiment::CampaignError;
use crate::parallel::{self, Workers};
use crate::signal::random::NormalDeviates;
use crate::study::{Flights, Setting, Study};
use crate::table::{Column, Table, Values};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::baseline::{self, Baseline};
use servotwin_diagnosis::features::{self, Sensors};
use servotwin_diagnosis::residual::{BAND, Window};

/// Windows after the onset: the first two end when this share of them shows the fault, the others at random times.
const SHARES: [f64; 2] = [0.6, 1.0];
/// Number of these others: many, because some faults only show in some motions.
const OTHERS: usize = 12;
/// Every n-th flight with a fault also gives the window before it.
const BEFORE: usize = 4;
/// A window is not used if the fault is below this share of its intensity both at the window's middle and at its end.
const LEAST_SHARE: f64 = 0.5;

/// A window to cut out of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Cut {
    /// The index of its kind.
    pub kind: usize,
    /// The range of its samples.
    pub from: usize,
    pub to: usize,
    pub is_faulty: bool,
}

/// A window that was cut out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TrainingWindow {
    cut: Cut,
    flight: usize,
    /// The bits of the window's values, which may be infinite.
    bits: Vec<u64>,
}

impl TrainingWindow {
    pub fn new(cut: Cut, flight: &PlannedFlight, window: &Window) -> Self {
        let bits = window.to_values().into_iter().map(f64::to_bits).collect();
        TrainingWindow { cut, flight: flight.number, bits }
    }

    fn window(&self, sensors: usize) -> Window {
        let values: Vec<f64> = self.bits.iter().map(|&bits| f64::from_bits(bits)).collect();
        Window::from_values(sensors, sensors, &values).expect("the values of a window")
    }
}

/// The windows cut out of flights.
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
    pub fn left_out(&self) -> LeftOut {
        let mut on_the_move = self.on_the_move.clone();
        on_the_move.sort_unstable();
        LeftOut { failed: self.failed as u64, on_the_move }
    }

    pub(super) fn leave_out(&mut self, flight: &PlannedFlight) {
        let moving = MovingFlight { flight: flight.number, environment: flight.environment };
        self.on_the_move.push(moving);
    }

    pub(super) fn push(&mut self, lesson: TrainingWindow) {
        self.list.push(lesson);
    }

    /// Sorts by kind, flight and time, because flights end in arbitrary order.
    pub(super) fn sort(&mut self) {
        self.list.sort_by_key(|lesson| (lesson.cut.kind, lesson.flight, lesson.cut.to));
    }

    /// The half widths of bands learned from healthy windows of a kind; `None` for too few windows.
    pub(super) fn bands(&self, kind: usize, pools: &[usize]) -> Option<Vec<f64>> {
        let healthy = self.list.iter().filter(|l| l.cut.kind == kind && !l.cut.is_faulty);
        let largest = |lesson: &TrainingWindow| -> Vec<f64> {
            let window = lesson.window(pools.len());
            (0..pools.len()).map(|sensor| window.largest(sensor)).collect()
        };
        let largest: Vec<Vec<f64>> = healthy.map(largest).collect();
        bands::half_widths(&largest.iter().map(Vec::as_slice).collect::<Vec<_>>(), pools)
    }
}

struct Cutter<'k> {
    kinds: &'k [WindowKind],
    cuts: Vec<Cut>,
    windows: Vec<Window>,
    scales: Vec<f64>,
    corrected: Option<BaselineCorrected>,
}

/// Baseline-corrected residuals. The baseline adapts until the fault begins, as a diagnosis does until it suspects a
/// fault.
#[derive(Clone)]
pub(super) struct BaselineCorrected {
    pub baseline: Baseline,
    onset: usize,
    stands_in: Vec<bool>,
    /// The measured values minus the baseline.
    pub measured: Vec<f64>,
}

impl BaselineCorrected {
    pub fn new(settings: baseline::BaselineSettings, sensors: usize, onset: usize) -> Self {
        let baseline = Baseline::new(settings, sensors).expect("usual settings");
        Self { baseline, onset, stands_in: vec![false; sensors], measured: vec![0.0; sensors] }
    }

    pub fn take(&mut self, index: usize, measured: &[f64], twin: &[f64], scales: &[f64]) {
        if index < self.onset {
            self.baseline.learn(measured, twin, scales);
        }
        self.baseline.subtract(measured, &self.stands_in, &mut self.measured);
    }
}

impl Observer for Cutter<'_> {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        if let Some(corrected) = &mut self.corrected {
            corrected.take(index, measured, twin, &self.scales);
        }
        for (cut, window) in self.cuts.iter().zip(&mut self.windows) {
            if (cut.from..cut.to).contains(&index) {
                let corrected =
                    self.corrected.as_ref().filter(|_| self.kinds[cut.kind].is_baseline_corrected);
                let measured = corrected.map_or(measured, |corrected| &corrected.measured);
                window.add(measured, twin, &self.scales);
            }
        }
    }
}

/// Flies the training flights and cuts windows out of them. Failed flights are left out.
pub fn cut(study: &Study, flights: &Flights, flown: &FlightCampaign) -> TrainingWindows {
    let scales = study.scales()[..study.base_sensors()].to_vec();
    let period_s = study.sample_period_s;
    let kinds = windows::kinds(flights, flown.setting);
    let baseline = windows::baseline(flights, flown.setting, period_s);
    let settled = baseline.map_or(0, |baseline| baseline.settle_samples as usize);
    let mut lessons = TrainingWindows::default();
    flown.fly(
        &flown.which,
        |flight| {
            let cuts = cuts(&kinds, settled, flight, period_s);
            let windows = cuts.iter().map(|_| Window::new(scales.len())).collect();
            let onset = (flight.onset_s / period_s) as usize;
            let corrected =
                baseline.map(|settings| BaselineCorrected::new(settings, scales.len(), onset));
            Cutter { kinds: &kinds, cuts, windows, scales: scales.clone(), corrected }
        },
        |flight, cutter, outcome| match outcome {
            Ok(work) if flown.is_on_the_move(flight, &work) => lessons.leave_out(flight),
            Ok(_) => {
                let windows = cutter.cuts.iter().zip(&cutter.windows);
                lessons
                    .list
                    .extend(windows.map(|(&cut, window)| TrainingWindow::new(cut, flight, window)));
            }
            Err(_) => lessons.failed += 1,
        },
    );
    lessons
}

/// A table for each kind of window.
///
/// # Errors
/// The run was cancelled.
pub fn tables(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    mut lessons: TrainingWindows,
    workers: Workers,
) -> Result<Vec<Table>, CampaignError> {
    lessons.sort();
    let sensors = Sensors(study.sensors_in(setting).0[..study.base_sensors()].to_vec());
    let plan = &plan::flights(study, flights, Purpose::Learn);
    let mut tables = vec![];
    for kind in 0..windows::kinds(flights, setting).len() {
        let of: Vec<&TrainingWindow> = lessons.list.iter().filter(|l| l.cut.kind == kind).collect();
        tables.push(Maker { study, sensors: &sensors, plan }.table(&of, workers)?);
    }
    Ok(tables)
}

/// The windows to cut from a flight; baseline-corrected ones begin after `settled` samples.
fn cuts(kinds: &[WindowKind], settled: usize, flight: &PlannedFlight, period_s: f64) -> Vec<Cut> {
    let sample = |time_s: f64| (time_s / period_s).round() as usize;
    let mut random = NormalDeviates::new(0x5eed << 32 | flight.number as u64);
    let mut cuts = vec![];
    for (kind, &WindowKind { window_s: length_s, is_baseline_corrected }) in
        kinds.iter().enumerate()
    {
        let samples = sample(length_s);
        let first = if is_baseline_corrected { settled } else { 0 };
        let mut cut = |end_s: f64, is_faulty: bool| {
            let to = sample(end_s);
            if to >= first + samples && end_s <= flight.duration_s {
                cuts.push(Cut { kind, from: to - samples, to, is_faulty });
            }
        };
        if flight.fault.is_none() {
            // Windows are spaced apart to be as diverse as possible.
            let count = (flight.duration_s / (2.0 * length_s).max(2.0)) as usize;
            (1..=count).for_each(|k| cut(flight.duration_s * k as f64 / count as f64, false));
            continue;
        }
        if flight.number.is_multiple_of(BEFORE) {
            cut(flight.onset_s, false);
        }
        let left_s = flight.duration_s - flight.onset_s - length_s;
        let others: Vec<f64> = (0..OTHERS).map(|_| length_s + left_s * random.unit()).collect();
        for after_s in SHARES.iter().map(|share| share * length_s).chain(others) {
            let end_s = flight.onset_s + after_s;
            let shares = [end_s - 0.5 * length_s, end_s - period_s].map(|t| flight.share(t));
            if shares.into_iter().fold(0.0, f64::max) >= LEAST_SHARE {
                cut(end_s, true);
            }
        }
    }
    cuts
}

struct Maker<'m> {
    study: &'m Study,
    sensors: &'m Sensors,
    plan: &'m [PlannedFlight],
}

impl Maker<'_> {
    fn table(&self, lessons: &[&TrainingWindow], workers: Workers) -> Result<Table, CampaignError> {
        let windows: Vec<Window> =
            lessons.iter().map(|lesson| lesson.window(self.sensors.0.len())).collect();
        let orders = self.sensors.rotations(self.study.units.len()).unwrap_or_default();
        let view = |window: &Window| seen(self.sensors, &orders, window);
        let rows = parallel::map(&windows, workers, view).map_err(|_| CampaignError::Cancelled)?;
        let mut columns = self.labels(lessons, &windows);
        let windows: Vec<&Window> = windows.iter().collect();
        columns.extend(largest_columns(&self.sensors.0, &windows));
        let features: Vec<_> =
            features::ALL.iter().flat_map(|family| family.features(self.sensors)).collect();
        columns.extend(feature_columns(features.iter(), &rows));
        Ok(Table::from_columns(columns).expect("columns of one length, named apart"))
    }

    fn labels(&self, lessons: &[&TrainingWindow], windows: &[Window]) -> Vec<Column> {
        let flight = |lesson: &TrainingWindow| self.plan[lesson.flight];
        let shown = |lesson: &&TrainingWindow| match flight(lesson) {
            PlannedFlight { fault, intensity, .. } if lesson.cut.is_faulty => {
                Shown { fault, intensity }
            }
            _ => Shown { fault: None, intensity: 0.0 },
        };
        let case = |lesson: &&TrainingWindow| format!("{:03}", flight(lesson).environment);
        let cases: Vec<String> = lessons.iter().map(case).collect();
        let number = |name: &str, unit: &str, of: &dyn Fn(&TrainingWindow) -> f64| {
            let numbers = lessons.iter().map(|lesson| of(lesson)).collect();
            Column::new(name, unit, Values::Float(numbers))
        };
        let period_s = self.study.sample_period_s;
        let detectable = windows.iter().map(|w| w.largest_of_all() > BAND).collect();
        let number_of = lessons.iter().map(|l| l.flight as u32).collect();
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(number_of)),
            Column::new("case", "", Values::Text(cases.clone())),
            Column::new("flown", "", Values::Text(cases)),
        ];
        columns.extend(fault_columns(self.study, &lessons.iter().map(shown).collect::<Vec<_>>()));
        columns.extend([
            number("end_s", "s", &|l| l.cut.to as f64 * period_s),
            number("age_s", "s", &|l| match l.cut.is_faulty {
                true => l.cut.to as f64 * period_s - flight(l).onset_s,
                false => 0.0,
            }),
            Column::new("detectable", "", Values::Flag(detectable)),
            Column::new("failure", "", Values::Text(vec![String::new(); lessons.len()])),
        ]);
        columns
    }
}
