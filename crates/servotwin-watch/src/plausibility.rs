//! Evidence in a log against its map: samples too far apart for the diagnosis, columns with a likely wrong unit or
//! sign, exchanged columns, gauge pressures, times with too few digits, intermittent inputs.
//!
//! It changes and drops no sample. It explains why nothing could be judged, or warns that a log was read with wrong
//! units (`mm` as `m`): one sentence for each likely reason. What explains a log almost completely is a
//! *contradiction*: findings on such a log are not those of its actuator.

use super::counts::{Irregularity, WatchCounts};
use super::map::{LARGEST_RATE_HZ, Map};
use super::sequencer::Stamped;
use super::watchdog::WatchEvent;
use servotwin::beside::{self, Comparisons, InputMistake, PANES, Panes, SensorColumn, Spread};
use servotwin::fit;
use servotwin::study::Study;
use servotwin::system::System;
use servotwin::units::{self, NamedUnit};
use servotwin_io::moment;
use servotwin_io::text::rounded;
use servotwin_io::toml_text::{NumberWithUnit, Quantities};
use servotwin_model::spec::Unit;

/// The typical step is the median of this many steps between samples.
const STEPS: usize = 1000;
/// Samples farther apart than this many periods leave periods empty.
const SLOW: f64 = 1.5;
/// Columns with fewer values are not judged.
const LEAST_VALUES: u64 = 20;
/// More rows than this share, and at least as many as the witnesses of a clock, with the time of another row are no
/// accident.
pub(crate) const MOST_COARSE: f64 = 0.01;

/// Evidence gathered while a log is watched.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plausibility {
    last_s: f64,
    /// The place and the time of the first row, and of the first row with the newest time.
    ends: [(u64, f64); 2],
    steps_s: Vec<f64>,
    /// The time unit of the log, s.
    unit_s: f64,
    /// The inputs, followed by the sensors.
    columns: Vec<Column>,
    /// The sensors beside the twin.
    pub beside: Comparisons,
    /// What a [`Lookout`] found.
    found: Vec<LateMistake>,
    /// The number of periods with an invalid environment.
    invalid: u64,
    /// For each input, how far it was outside the accepted range at most in them, SI; 0 for never.
    excesses: Vec<f64>,
    /// The reasons of the other such periods.
    reasons: Vec<String>,
}

/// Something implausible that began within a log or a stream.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LateMistake {
    /// Since when, and what, as a sentence.
    pub words: String,
    /// Whether it contradicts the map beyond doubt. A fault may explain the others.
    pub is_certain: bool,
    /// Since when, s; `None` for the beginning.
    pub from_s: Option<f64>,
}

impl LateMistake {
    /// The event that reports it.
    pub(super) fn event(self) -> WatchEvent {
        let LateMistake { words: reason, is_certain, from_s } = self;
        match is_certain {
            true => WatchEvent::Contradicted { reason, from_s },
            false => WatchEvent::Implausible { reason },
        }
    }
}

/// Compares the sensors with their twins in one pane after the other, because columns may change within a log.
pub(super) struct Lookout<'s> {
    columns: Vec<SensorColumn<'s>>,
    panes: Panes<(u64, f64)>,
    /// How many panes had motion.
    moving: u32,
    /// What places count.
    counted: &'static str,
    /// The name of the command, and its unit in the log.
    command: (&'s str, &'static NamedUnit),
    still: StillSamples<'s>,
}

/// The samples since the twin stands still, for a comparison with the command undone.
struct StillSamples<'s> {
    study: &'s Study,
    /// Whether the command has a column.
    has_column: bool,
    period_s: f64,
    /// Place and time of the first pane with motion, s, and the number of such panes.
    begin: (u64, f64),
    moving: u32,
    /// The inputs and the sensor values of the last panes, one sample after the other.
    inputs: Vec<f64>,
    measured: Vec<f64>,
}

/// How many panes are kept while the twin stands still.
const STILL_PANES: usize = 10;

impl StillSamples<'_> {
    /// Ends a pane beside a resting twin, and reports whether the column of the command is a mistake.
    fn end_pane(
        &mut self,
        is_moving: bool,
        begin: (u64, f64),
        samples: usize,
    ) -> Option<InputMistake> {
        let system = &self.study.system;
        let widths = [system.network().inputs.len(), system.sensors.len()];
        for (all, width) in [&mut self.inputs, &mut self.measured].into_iter().zip(widths) {
            all.drain(..all.len().saturating_sub(STILL_PANES * samples * width));
        }
        if !is_moving {
            return None;
        }
        if self.moving == 0 {
            self.begin = begin;
        }
        self.moving += 1;
        let is_due = self.has_column && self.moving.is_multiple_of(PANES);
        let found = || fit::still_command(self.study, self.period_s, &self.inputs, &self.measured);
        is_due.then(found)?.ok()?
    }

    fn clear(&mut self) {
        self.moving = 0;
        self.inputs.clear();
        self.measured.clear();
    }
}

impl<'s> Lookout<'s> {
    pub(super) fn new(study: &'s Study, map: &Map, period_s: f64, counted: &'static str) -> Self {
        let (system, command) = (&study.system, study.command_input);
        Lookout {
            columns: columns(system, map),
            panes: Panes::new(system.sensors.len(), period_s),
            moving: 0,
            counted,
            command: (&system.network().inputs[command].id, map.unit(command)),
            still: StillSamples {
                study,
                has_column: map.constant(command).is_none(),
                period_s,
                begin: (0, f64::NAN),
                moving: 0,
                inputs: vec![],
                measured: vec![],
            },
        }
    }

    pub(super) fn system(&self) -> &'s System {
        &self.still.study.system
    }

    /// Begins a pane anew.
    pub(super) fn restart(&mut self) {
        self.panes.restart();
        self.still.clear();
    }

    /// Takes the place and the time of a period, s, its inputs and sensor values, as the log has them, and those of the
    /// twin. `whole` has taken all periods.
    pub(super) fn take(
        &mut self,
        begin: (u64, f64),
        [inputs, measured]: [&[f64]; 2],
        twin: &[f64],
        whole: &Comparisons,
    ) -> Option<LateMistake> {
        self.still.inputs.extend_from_slice(inputs);
        self.still.measured.extend_from_slice(measured);
        let (begin, pane) = self.panes.take(begin, measured, twin)?;
        if pane.twin_moves(&self.columns) {
            self.still.clear();
        }
        let is_still = pane.is_still(&self.columns);
        let unrelated = self.still.end_pane(is_still, begin, self.panes.samples());
        self.moving += u32::from(pane.has_motion(&self.columns));
        // A stream has no other trial.
        let found = if self.moving == PANES { whole.mistakes(&self.columns) } else { vec![] };
        if !found.is_empty() {
            return Some(LateMistake { words: found.join("; "), is_certain: true, from_s: None });
        }
        let counted = self.counted;
        let since = |(place, time_s): (u64, f64), what: &str, is_certain: bool| {
            let words = format!("from {} ({counted} {place}) on, {what}", moment::shown(time_s));
            Some(LateMistake { words, is_certain, from_s: Some(time_s) })
        };
        if let Some((begin, found)) = self.panes.mistakes(&pane, &self.columns) {
            return since(begin, &found, true);
        }
        if let Some(mistake) = unrelated {
            return since(self.still.begin, &mistake.in_words(self.command, &self.columns), true);
        }
        let what = "the actuator moves while the twin stands still: unless a fault moves it, its command is in another \
                    column";
        if is_still { since(self.still.begin, what, false) } else { None }
    }
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
}

impl Plausibility {
    /// Empty evidence, before the first sample.
    pub(super) fn new(map: &Map) -> Self {
        let column = |channel| Column { range: map.possible(channel), ..Column::default() };
        let columns = (0..map.width()).map(column).collect();
        let unit_s = map.time_column().map_or(1.0, |(_, unit_s)| unit_s);
        let beside = Comparisons::new(map.width() - map.inputs());
        let ends = [(0, f64::NAN); 2];
        Plausibility {
            last_s: f64::NAN,
            ends,
            steps_s: vec![],
            unit_s,
            columns,
            beside,
            found: vec![],
            invalid: 0,
            excesses: vec![0.0; map.inputs()],
            reasons: vec![],
        }
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
        if self.ends[0].1.is_nan() {
            self.ends = [(sample.place, sample.time_s); 2];
        } else if sample.time_s > self.ends[1].1 {
            self.ends[1] = (sample.place, sample.time_s);
        }
        self.last_s = sample.time_s;
        for (column, value) in self.columns.iter_mut().zip(&sample.values) {
            if value.is_finite() {
                column.take(*value);
            }
        }
    }

    /// Adds a period with an invalid environment: its inputs, and the reason of the finding.
    pub(super) fn invalid(&mut self, inputs: &[f64], reason: Option<&String>) {
        self.invalid += 1;
        let mut is_explained = inputs.iter().any(|value| value.is_nan());
        for ((&value, column), largest) in inputs.iter().zip(&self.columns).zip(&mut self.excesses)
        {
            let excess = column.excess(value);
            *largest = largest.max(excess);
            is_explained |= excess > 0.0;
        }
        let is_new = |reason: &&String| !is_explained && !self.reasons.contains(reason);
        self.reasons.extend(reason.filter(is_new).cloned());
    }

    /// Adds what began within the log; `false` if that is known.
    pub(super) fn find(&mut self, late: LateMistake) -> bool {
        let is_known = |other: &LateMistake| other.is_certain == late.is_certain;
        let is_new = !self.found.iter().any(is_known);
        self.found.extend(is_new.then_some(late));
        is_new
    }

    /// Whether something began that contradicts the map beyond doubt.
    pub(super) fn is_contradicted(&self) -> bool {
        self.found.iter().any(|late| late.is_certain)
    }

    /// The typical time between samples, s.
    pub(crate) fn step_s(&self) -> Option<f64> {
        let mut sorted = self.steps_s.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    }

    /// All evidence as sentences, contradictions first; empty for a log that fits its map.
    pub(super) fn sentences(
        &self,
        system: &System,
        map: &Map,
        period_s: f64,
        counts: &WatchCounts,
    ) -> Vec<String> {
        let network = system.network();
        let inputs = network.inputs.iter().map(|input| input.unit);
        let units = inputs.chain(system.sensors.iter().map(|sensor| sensor.unit)).enumerate();
        let sensors = columns(system, map);
        let columns = self.columns.iter().zip(units);
        let claimed = self.beside.other_units(&sensors);
        let is_claimed = |sensor: usize| claimed.iter().any(|other| other.sensor == sensor);
        let columns = columns.filter_map(|(column, (channel, unit))| {
            let sensor = channel.checked_sub(map.inputs()).filter(|&sensor| !is_claimed(sensor));
            let beside = sensor.and_then(|s| self.beside.unit_beside(s, &sensors[s]));
            let looks_like = beside.as_ref().map(|other| other.misread.actual[0]);
            column
                .outside_in_words(map, channel, unit, looks_like)
                .or_else(|| beside::other_units_in_words(&sensors, beside.as_slice()))
        });
        let mut all = self.contradictions(system, map, counts);
        let at_rest = self.beside.atmosphere_at_rest(&sensors);
        all.extend(at_rest.filter(|_| all.is_empty()));
        all.extend(self.late(false));
        all.extend(self.pace(period_s).into_iter().chain(columns));
        if counts.judged == 0 {
            all.extend(self.environment_in_words(system, map, counts));
        }
        if all.is_empty() {
            // Other problems can also make inputs missing, and holding values would not fix those.
            all.extend(comes_and_goes(map, counts));
        }
        all
    }

    /// What contradicts the map beyond doubt, as sentences.
    pub(super) fn contradictions(
        &self,
        system: &System,
        map: &Map,
        counts: &WatchCounts,
    ) -> Vec<String> {
        let mut found: Vec<String> = self.late(true).collect();
        if found.is_empty() {
            found = self.beside.mistakes(&columns(system, map));
        }
        coarse_in_words(counts, self.ends, map).into_iter().chain(found).collect()
    }

    fn late(&self, is_certain: bool) -> impl Iterator<Item = String> {
        let found = self.found.iter().filter(move |late| late.is_certain == is_certain);
        found.map(|late| late.words.clone())
    }

    /// Says that the times are in another unit, as soon as enough steps show it.
    pub(super) fn other_time_unit(&self, period_s: f64) -> Option<String> {
        let has_evidence = self.steps_s.len() as u64 >= LEAST_VALUES;
        let unit = self.likely_unit(self.step_s()?, period_s);
        unit.filter(|_| has_evidence).and_then(|_| self.pace(period_s))
    }

    /// The unit of time that makes an unlikely step, s, a likely one, and that step, s.
    fn likely_unit(&self, step_s: f64, period_s: f64) -> Option<(&'static str, f64)> {
        let likely = moment::likely_unit(step_s / self.unit_s, period_s, units::of_times());
        likely.filter(|_| !moment::is_period(step_s))
    }

    /// Says why the environment was invalid: which inputs were outside of which ranges, and by how much, and other
    /// reasons. Inputs that are outside in most rows have a sentence of their own.
    fn environment_in_words(
        &self,
        system: &System,
        map: &Map,
        counts: &WatchCounts,
    ) -> Option<String> {
        let Plausibility { invalid, excesses, reasons, .. } = self;
        let inputs = system.network().inputs.iter().zip(&self.columns).zip(excesses).enumerate();
        let outside = inputs.filter(|(channel, ((input, column), excess))| {
            **excess > 0.0 && column.outside_in_words(map, *channel, input.unit, None).is_none()
        });
        let outside = outside.map(|(_, ((input, column), excess))| {
            let (low, high) = column.range;
            let unit = input.unit.symbol();
            format!(
                "{} lies outside of {} by up to {}",
                input.id,
                Quantities(rounded(low, 3), rounded(high, 3), unit),
                NumberWithUnit(rounded(*excess, 3), unit)
            )
        });
        let all: Vec<String> = outside.chain(reasons.iter().cloned()).collect();
        (!all.is_empty()).then(|| {
            format!(
                "the environment was invalid in {invalid} of {} periods: {}",
                counts.samples,
                all.join(", ")
            )
        })
    }

    fn pace(&self, period_s: f64) -> Option<String> {
        let step_s = self.step_s()?;
        let apart = format!(
            "its samples are usually {} s apart, those of the diagnosis {period_s} s",
            rounded(step_s, 3)
        );
        match self.likely_unit(step_s, period_s) {
            Some((unit, other_s)) => Some(format!(
                "its times seem to be in {unit}, in which its samples are {other_s} s apart: {apart}"
            )),
            _ if step_s > SLOW * period_s => Some(format!(
                "{apart}: log at {} Hz, or learn a diagnoser at {} Hz (sample_hz of the study)",
                rounded(1.0 / period_s, 3),
                rounded(1.0 / step_s, 3)
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

    /// How far a value is outside of the accepted range; 0 inside and for a missing value.
    fn excess(&self, value: f64) -> f64 {
        let (low, high) = self.range;
        (low - value).max(value - high).max(0.0)
    }

    /// Says that most values are outside of the accepted range, with a unit in which they would be inside.
    fn outside_in_words(
        &self,
        map: &Map,
        channel: usize,
        unit: Unit,
        looks_like: Option<&'static NamedUnit>,
    ) -> Option<String> {
        let Column { range: (low, high), outside, largest, .. } = *self;
        let (id, values) = (map.id(channel), self.values.count);
        if values < LEAST_VALUES || 2 * outside <= values {
            return None;
        }
        // The range decides where the twin is missing or too small.
        let within = || units::within(map.unit(channel), largest, self.range);
        let seems = looks_like.or_else(within);
        let seems =
            seems.map_or(String::new(), |unit| format!(" and seems to be in {}", unit.spoken));
        let range = Quantities(rounded(low, 3), rounded(high, 3), unit.symbol());
        let largest = NumberWithUnit(rounded(largest, 3), unit.symbol());
        Some(format!(
            "{id} is outside of what is believed ({range}) in {outside} of {values} values, up to {largest}{seems}"
        ))
    }
}

/// The sensors of a system as a map reads them.
pub(super) fn columns<'s>(system: &'s System, map: &Map) -> Vec<SensorColumn<'s>> {
    let column = |sensor| SensorColumn::new(system, sensor, map.unit(map.inputs() + sensor));
    (0..system.sensors.len()).map(column).collect()
}

/// Says that times have too few digits, and what to do; `None` for a few rows with the time of another. `ends` are the
/// places and times of the first row and of the first row with the last time.
pub(crate) fn coarse_in_words(
    counts: &WatchCounts,
    [(first, first_s), (last, last_s)]: [(u64, f64); 2],
    map: &Map,
) -> Option<String> {
    let rate_hz = last.abs_diff(first) as f64 / (last_s - first_s);
    // The ends of such times are inexact, too: 99.6 rows in a second are a hundred.
    let digits = rounded(rate_hz, 2);
    let rate_hz = if (digits / rate_hz - 1.0).abs() < 0.01 { digits } else { rate_hz };
    let tally = counts.of(Irregularity::CoarseTime);
    let accident = (MOST_COARSE * counts.frames as f64).max(map.rules.witnesses as f64);
    let (column, _) = map.time_column().filter(|_| tally.count as f64 > accident)?;
    let rate = match rate_hz <= LARGEST_RATE_HZ {
        true => format!("rate_hz = {}", rounded(rate_hz, 3)),
        false => {
            "or another unit than that of the map; rate_hz with the rate of the log".to_owned()
        }
    };
    Some(format!(
        "{} {}s have the time of another and other values, first {}: the times in '{}' have too few digits; \
         {rate} instead of column below [time] of a map file counts rows",
        tally.count,
        counts.counted,
        counts.place(tally),
        servotwin_io::sanitize::text(column)
    ))
}

/// Reports inputs without a value in some periods. Nothing is judged in them, and for a while behind a longer gap.
fn comes_and_goes(map: &Map, counts: &WatchCounts) -> Option<String> {
    let of = |channel: &usize| (1..counts.samples).contains(&counts.missing[*channel]);
    let lost: Vec<usize> = (0..map.inputs()).filter(of).collect();
    let most = lost.iter().map(|&channel| counts.missing[channel]).max()?;
    let names: Vec<&str> = lost.iter().map(|&channel| map.id(channel)).collect();
    Some(format!(
        "{} has no value in {most} of {} periods; behind a longer gap nothing is judged for a second: hold_s in the map \
         lets the last value stand",
        names.join(", "),
        counts.samples
    ))
}
