//! Evidence in a log against its map: samples too far apart for the diagnosis, columns with a likely wrong unit or
//! sign, intermittent inputs.
//!
//! It changes and drops no sample. It explains why nothing could be judged, or warns that a log was read with wrong
//! units (`mm` as `m`): one sentence for each likely reason.

use super::counts::WatchCounts;
use super::map::Map;
use super::sequencer::Stamped;
use servotwin::beside::{Spread, TwinComparison};
use servotwin::system::System;
use servotwin::units;
use servotwin_io::document::{NumberWithUnit, Quantities};
use servotwin_io::moment::{self, rounded};
use servotwin_model::spec::Unit;

/// The typical step is the median of this many steps between samples.
const STEPS: usize = 1000;
/// Samples farther apart than this many periods leave periods empty.
const SLOW: f64 = 1.5;
/// With steps below this share of a period, the time column is unlikely to be in seconds.
const FAST: f64 = 0.02;
/// Columns with fewer values are not judged.
const LEAST_VALUES: u64 = 20;
/// A twin signal below this share of its sensor's scale gives no evidence about the unit; a variation below it gives
/// none about the sign.
const LEAST_SHARE: f64 = 0.01;
/// Evidence gathered while a log is watched.
#[derive(Debug, Clone, PartialEq)]
pub struct Plausibility {
    last_s: f64,
    steps_s: Vec<f64>,
    /// The time unit of the log, s.
    unit_s: f64,
    /// The inputs, followed by the sensors.
    columns: Vec<Column>,
}

/// Evidence about one input or sensor.
#[derive(Debug, Clone, Default, PartialEq)]
struct Column {
    /// The accepted range.
    range: (f64, f64),
    /// Statistics of the values, the number outside the range, and the value farthest from zero.
    values: Spread,
    outside: u64,
    largest: f64,
    beside: TwinComparison,
}

impl Plausibility {
    /// Empty evidence, before the first sample.
    pub(super) fn new(map: &Map) -> Self {
        let column = |channel| Column { range: map.possible(channel), ..Column::default() };
        let columns = (0..map.width()).map(column).collect();
        let unit_s = map.time_column().map_or(1.0, |(_, unit_s)| unit_s);
        Plausibility { last_s: f64::NAN, steps_s: vec![], unit_s, columns }
    }

    /// Restricts the accepted ranges of the inputs.
    pub(super) fn narrow(&mut self, ranges: &[(f64, f64)]) {
        for (column, range) in self.columns.iter_mut().zip(ranges) {
            column.range = *range;
        }
    }

    /// Adds a sample in the log's order.
    pub(super) fn sample(&mut self, sample: &Stamped) {
        let step_s = sample.time_s - self.last_s;
        if step_s > 0.0 && self.steps_s.len() < STEPS {
            self.steps_s.push(step_s);
        }
        self.last_s = sample.time_s;
        for (column, value) in self.columns.iter_mut().zip(&sample.values) {
            if value.is_finite() {
                column.take(*value);
            }
        }
    }

    /// Adds the sensor values and the twin's values of a period.
    pub(super) fn twin(&mut self, measured: &[f64], twin: &[f64]) {
        let sensors = self.columns.len() - twin.len();
        let columns = self.columns[sensors..].iter_mut();
        for (column, (own, twin)) in columns.zip(measured.iter().zip(twin)) {
            column.beside.take(*own, *twin);
        }
    }

    /// The typical time between samples, s.
    pub fn step_s(&self) -> Option<f64> {
        let mut sorted = self.steps_s.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    }

    /// All evidence as sentences; empty for a log that fits its map.
    pub fn sentences(
        &self,
        system: &System,
        map: &Map,
        period_s: f64,
        counts: &WatchCounts,
    ) -> Vec<String> {
        let pace = self.pace(period_s);
        let network = system.network();
        let inputs = network.inputs.iter().map(|input| (input.unit, f64::INFINITY));
        let sensors = system.sensors.iter().map(|sensor| (sensor.unit, sensor.scale));
        let signals = inputs.chain(sensors).enumerate();
        let columns = self.columns.iter().zip(signals);
        let columns = columns.filter_map(|(column, (channel, (unit, scale)))| {
            column.sentence(map.id(channel), unit, scale)
        });
        let signs = self.signs(system, map);
        let mut all: Vec<String> = pace.into_iter().chain(columns).chain(signs).collect();
        if all.is_empty() {
            // Other problems can also make inputs missing, and holding values would not fix those.
            all.extend(comes_and_goes(map, counts));
        }
        all
    }

    /// Reports sensors that move against the twin. If most do, the command has the wrong sign.
    fn signs(&self, system: &System, map: &Map) -> Option<String> {
        let sensors = self.columns[map.inputs()..].iter().zip(&system.sensors);
        let signs: Vec<(bool, &str)> = sensors
            .filter_map(|(column, sensor)| Some((column.is_turned(sensor.scale)?, &*sensor.id)))
            .collect();
        let turned: Vec<&str> = signs.iter().filter(|(is, _)| *is).map(|(_, id)| *id).collect();
        let (ids, verb) = (turned.join(", "), if turned.len() == 1 { "moves" } else { "move" });
        match turned.len() {
            0 => None,
            most if most > 1 && 2 * most > signs.len() => Some(format!(
                "{ids} {verb} against the twin: the sign of the command seems to be wrong"
            )),
            _ => Some(format!(
                "{ids} {verb} against the twin: the sign seems to be wrong, factor = -1 in the map turns it"
            )),
        }
    }

    fn pace(&self, period_s: f64) -> Option<String> {
        let step_s = self.step_s()?;
        let apart = format!(
            "its samples are usually {} s apart, those of the diagnosis {period_s} s",
            rounded(step_s)
        );
        let likely = moment::likely_unit(step_s / self.unit_s, period_s, units::of_times());
        let likely = likely.filter(|_| !moment::is_period(step_s));
        match likely {
            Some((unit, other_s)) => Some(format!(
                "its times seem to be in {unit}, in which its samples are {other_s} s apart: {apart}"
            )),
            _ if step_s < FAST * period_s => {
                Some(format!("its times seem to be in a larger unit than the map states: {apart}"))
            }
            _ if step_s > SLOW * period_s => Some(format!(
                "{apart}: log at {} Hz, or learn a diagnoser at {} Hz (sample_hz of the study)",
                rounded(1.0 / period_s),
                rounded(1.0 / step_s)
            )),
            _ => None,
        }
    }
}

impl Column {
    fn take(&mut self, value: f64) {
        self.values.take(value);
        let (low, high) = self.range;
        self.outside += u64::from(value < low || value > high);
        if value.abs() > self.largest.abs() {
            self.largest = value;
        }
    }

    fn sentence(&self, id: &str, unit: Unit, scale: f64) -> Option<String> {
        let Column { range: (low, high), outside, largest, .. } = *self;
        let values = self.values.count;
        if values < LEAST_VALUES {
            return None;
        }
        let looks_like = self.looks_like(unit, scale);
        let seems = |unit| format!("seems to be in {unit}");
        if 2 * outside > values {
            let range = Quantities(rounded(low), rounded(high), unit.symbol());
            let largest = NumberWithUnit(rounded(largest), unit.symbol());
            let seems =
                looks_like.map_or(String::new(), |(_, unit)| format!(" and {}", seems(unit)));
            return Some(format!(
                "{id} is outside of what is believed ({range}) in {outside} of {values} values, up to {largest}{seems}"
            ));
        }
        let (factor, unit_of_log) = looks_like?;
        let twin = format!("{factor:.1e} times what the twin shows in {}", unit.symbol());
        Some(format!("{id} {}: it is {twin}", seems(unit_of_log)))
    }

    /// Whether its sign is wrong; `None` where the twin hardly moves.
    fn is_turned(&self, scale: f64) -> Option<bool> {
        let moves = self.beside.twin.variance().sqrt() > LEAST_SHARE * scale;
        (moves && self.beside.both() >= LEAST_VALUES).then(|| self.beside.is_turned())
    }

    /// The unit that fits its values: judged by the twin, or by the range where the twin is missing or too small.
    fn looks_like(&self, unit: Unit, scale: f64) -> Option<(f64, &'static str)> {
        let rms = |spread: &Spread| spread.mean_square().sqrt();
        let (own, twin) = (rms(&self.values), rms(&self.beside.twin));
        if self.beside.twin.count >= LEAST_VALUES && twin > LEAST_SHARE * scale {
            return units::other(unit, own / twin);
        }
        let is_outside = 2 * self.outside > self.values.count;
        is_outside.then(|| units::within(unit, self.largest, self.range)).flatten()
    }
}

/// Reports inputs without a value in some periods. After each such period nothing is judged for a while.
fn comes_and_goes(map: &Map, counts: &WatchCounts) -> Option<String> {
    let of = |channel: &usize| (1..counts.samples).contains(&counts.missing[*channel]);
    let lost: Vec<usize> = (0..map.inputs()).filter(of).collect();
    let most = lost.iter().map(|&channel| counts.missing[channel]).max()?;
    let names: Vec<&str> = lost.iter().map(|&channel| map.id(channel)).collect();
    Some(format!(
        "{} has no value in {most} of {} periods, and behind each nothing is judged for a second: hold_s in the map lets \
         the last value stand",
        names.join(", "),
        counts.samples
    ))
}
