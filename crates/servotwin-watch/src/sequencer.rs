//! Puts incoming samples onto a fixed period.
//!
//! The first sample sets the grid: period `k` is at `t_0 + k T`. A sample belongs to the nearest period. Nothing is
//! interpolated, so values keep their bits. The rules:
//!
//! - A period is passed on when a sample arrives that is `wait_s` newer, or when the stream pauses. Until then samples
//!   may arrive in any order (*reordered*); after that they are *late* and dropped.
//! - If two samples share a period, the nearer one counts and the other fills its missing values. A sample with nothing
//!   to fill is *doubled* if it has the same time and values, *coarse* with the same time and other values, else
//!   *surplus*.
//! - A period without a sample is a *gap*: all its values are missing (NaN).
//! - A time that jumps ahead (by more than `wait_s` plus twice the last step), or lies before the periods passed on,
//!   is not trusted at first. Samples that continue from it vote for it; all others vote against it. With no vote left,
//!   the samples were late or *outliers* and are dropped. With `witnesses` votes they are accepted. Up to
//!   `longest_gap_s` ahead, this is a gap. Beyond that, the clock was set: the waiting periods are passed on,
//!   [`Tick::Restart`] follows, and those samples begin a new grid.
//!
//! A sequencer never holds more than `longest_gap_s + wait_s` of periods.

use super::bits;
use super::counts::{Irregularity, WatchCounts};
use serde::{Deserialize, Serialize};
use servotwin_io::moment;
use std::collections::VecDeque;

/// Tolerances before samples are dropped.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SequencerRules {
    /// How long a period waits for delayed samples, s.
    pub wait_s: f64,
    /// The longest gap after which the stream continues without a restart, s.
    pub longest_gap_s: f64,
    /// How many consecutive samples confirm a jump of the clock.
    pub witnesses: usize,
}

impl Default for SequencerRules {
    fn default() -> Self {
        SequencerRules { wait_s: 0.05, longest_gap_s: 10.0, witnesses: 10 }
    }
}

impl SequencerRules {
    /// A larger step ahead than this is a jump; `step_s` is the last step.
    fn sudden_s(&self, step_s: f64) -> f64 {
        (self.wait_s + 2.0 * step_s).min(self.longest_gap_s)
    }
}

/// A sample as it arrived.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Stamped {
    /// Its line, row, datagram or message number.
    pub place: u64,
    /// Its time, s.
    #[serde(with = "bits::one")]
    pub time_s: f64,
    /// Its values; NaN means missing.
    #[serde(with = "bits::many")]
    pub values: Vec<f64>,
}

impl Stamped {
    /// Takes the values that are missing here from another sample; `false` if it has none of them.
    pub(crate) fn fill_from(&mut self, other: &Stamped) -> bool {
        let mut is_filled = false;
        for (value, from) in self.values.iter_mut().zip(&other.values) {
            if value.is_nan() && !from.is_nan() {
                (*value, is_filled) = (*from, true);
            }
        }
        is_filled
    }

    /// What another sample is that adds nothing to this one.
    pub(crate) fn kind_of_other(&self, other: &Stamped) -> Irregularity {
        let is_known = |(own, other): (&f64, &f64)| own == other || other.is_nan();
        match self.time_s == other.time_s {
            true if self.values.iter().zip(&other.values).all(is_known) => Irregularity::Doubled,
            true => Irregularity::CoarseTime,
            false => Irregularity::Surplus,
        }
    }
}

/// The output of the sequencer.
#[derive(Debug, PartialEq)]
pub enum Tick<'t> {
    /// One period.
    Sample {
        /// The time of the grid, s.
        time_s: f64,
        /// The place of the last sample in it; 0 without a sample.
        place: u64,
        /// The values; NaN means missing.
        values: &'t [f64],
    },
    /// The clock was set, or the stream was interrupted for long: later samples are unrelated to earlier ones.
    Restart,
}

/// Puts samples onto a fixed period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sequencer {
    rules: SequencerRules,
    #[serde(with = "bits::one")]
    period_s: f64,
    width: usize,
    grid: Option<Grid>,
    /// Samples with an untrusted time, each continuing from the one before.
    suspects: Vec<Stamped>,
    /// The number of suspects minus the number of other samples since.
    votes: usize,
    /// Whether a restart is pending; it is passed on before anything else.
    restart: bool,
    /// Whether all waiting periods may be passed on.
    flushing: bool,
    /// The period passed on last.
    #[serde(skip)]
    given: Stamped,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Grid {
    #[serde(with = "bits::one")]
    start_s: f64,
    /// The first period not yet passed on.
    next: u64,
    /// The newest time, and its step from the one before, s.
    #[serde(with = "bits::one")]
    newest_s: f64,
    #[serde(with = "bits::one")]
    step_s: f64,
    /// The periods from `next` on; one without a sample has no values.
    waiting: VecDeque<Stamped>,
}

/// How a time relates to the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Turn {
    /// In this period, counted from the next one.
    At(usize),
    /// In this period, but after a jump.
    Ahead(usize),
    /// In a period already passed on.
    Late,
    /// Too far from the grid.
    Elsewhere,
}

impl Sequencer {
    /// Creates a sequencer for samples of `width` values.
    pub fn new(period_s: f64, width: usize, rules: SequencerRules) -> Self {
        Sequencer {
            rules,
            period_s,
            width,
            grid: None,
            suspects: vec![],
            votes: 0,
            restart: false,
            flushing: false,
            given: Stamped::default(),
        }
    }

    /// Takes a sample with a finite time. Drain [`next`](Self::next) before calling it.
    pub fn push(&mut self, sample: Stamped, counts: &mut WatchCounts) {
        debug_assert!(sample.time_s.is_finite() && sample.values.len() == self.width);
        self.flushing = false;
        match self.turn(sample.time_s) {
            Turn::At(index) => {
                self.vote_against(counts);
                self.place(index, sample, counts);
            }
            _ => self.suspect(sample, counts),
        }
    }

    /// Releases all waiting periods: the stream ended or pauses.
    pub(crate) fn flush(&mut self) {
        self.flushing = true;
    }

    /// Ends the stream: suspects can gain no more votes.
    pub fn end(&mut self, counts: &mut WatchCounts) {
        self.drop_suspects(counts);
        self.flush();
    }

    /// The next period or restart that may be passed on.
    pub fn next(&mut self, counts: &mut WatchCounts) -> Option<Tick<'_>> {
        let wait = (self.rules.wait_s / self.period_s).ceil() as usize;
        if let Some(grid) = &mut self.grid
            && grid.waiting.len() > if self.flushing || self.restart { 0 } else { wait }
            && let Some(given) = grid.waiting.pop_front()
        {
            let time_s = grid.start_s + grid.next as f64 * self.period_s;
            grid.next += 1;
            self.given = given;
            if self.given.values.is_empty() {
                counts.note(Irregularity::Gap, grid.next);
                self.given.values.resize(self.width, f64::NAN);
            }
            counts.samples += 1;
            let (place, values) = (self.given.place, &self.given.values[..]);
            return Some(Tick::Sample { time_s, place, values });
        }
        if self.restart {
            self.restart = false;
            self.grid = None;
            self.believe(counts);
            return Some(Tick::Restart);
        }
        None
    }

    /// Relates a time to the grid; the first time begins a grid.
    fn turn(&mut self, time_s: f64) -> Turn {
        let grid = self.grid.get_or_insert_with(|| Grid {
            start_s: time_s,
            next: 0,
            newest_s: time_s,
            step_s: f64::INFINITY,
            waiting: VecDeque::new(),
        });
        let ahead_s = time_s - grid.newest_s;
        let index = ((time_s - grid.start_s) / self.period_s).round() - grid.next as f64;
        match index {
            _ if ahead_s.abs() > self.rules.longest_gap_s => Turn::Elsewhere,
            index if index < 0.0 => Turn::Late,
            index if ahead_s > self.rules.sudden_s(grid.step_s) => Turn::Ahead(index as usize),
            index => Turn::At(index as usize),
        }
    }

    /// Puts a sample into its period.
    fn place(&mut self, index: usize, sample: Stamped, counts: &mut WatchCounts) {
        let Some(grid) = &mut self.grid else { return };
        if grid.waiting.len() <= index {
            grid.waiting.resize(index + 1, Stamped::default());
        }
        let reordered = sample.time_s < grid.newest_s;
        if sample.time_s > grid.newest_s {
            grid.step_s = sample.time_s - grid.newest_s;
            grid.newest_s = sample.time_s;
        }
        let slot = &mut grid.waiting[index];
        if slot.values.is_empty() {
            if reordered {
                counts.note(Irregularity::Reordered, sample.place);
            }
            *slot = sample;
            return;
        }
        let centre_s = grid.start_s + (grid.next + index as u64) as f64 * self.period_s;
        let distance = |sample: &Stamped| (sample.time_s - centre_s).abs();
        let kind = slot.kind_of_other(&sample);
        let place = sample.place;
        let mut other = sample;
        if distance(&other) < distance(slot) {
            std::mem::swap(slot, &mut other);
        }
        if !slot.fill_from(&other) {
            counts.note(kind, place);
        }
    }

    /// Keeps a sample with an untrusted time.
    fn suspect(&mut self, sample: Stamped, counts: &mut WatchCounts) {
        let step_s = self.grid.as_ref().map_or(f64::INFINITY, |grid| grid.step_s);
        if let Some(last) = self.suspects.last() {
            let ahead_s = sample.time_s - last.time_s;
            if ahead_s == 0.0 {
                counts.note(last.kind_of_other(&sample), sample.place);
                return;
            }
            if !(0.0..=self.rules.sudden_s(step_s)).contains(&ahead_s) {
                self.vote_against(counts);
                if self.votes > 0 {
                    self.drop(&sample, counts);
                    return;
                }
            }
        }
        self.suspects.push(sample);
        self.votes += 1;
        if self.votes < self.rules.witnesses {
            return;
        }
        let (first_s, place) = (self.suspects[0].time_s, self.suspects[0].place);
        // The grid may have caught up with the suspects meanwhile.
        if let Turn::At(_) | Turn::Ahead(_) = self.turn(first_s) {
            self.believe(counts);
            return;
        }
        let newest_s = self.grid.as_ref().map_or(f64::NAN, |grid| grid.newest_s);
        let back = first_s < newest_s;
        let kind = if back { Irregularity::ClockBack } else { Irregularity::ClockForward };
        let [from, to] = [newest_s, first_s].map(moment::shown);
        counts.note_with(kind, place, &format_args!("from {from} to {to}"));
        self.restart = true;
    }

    /// Puts the suspects into their periods.
    fn believe(&mut self, counts: &mut WatchCounts) {
        self.votes = 0;
        for sample in std::mem::take(&mut self.suspects) {
            // The suspects follow each other: each is placed in turn.
            if let Turn::At(index) | Turn::Ahead(index) = self.turn(sample.time_s) {
                self.place(index, sample, counts);
            }
        }
    }

    fn vote_against(&mut self, counts: &mut WatchCounts) {
        self.votes = self.votes.saturating_sub(1);
        if self.votes == 0 {
            self.drop_suspects(counts);
        }
    }

    fn drop_suspects(&mut self, counts: &mut WatchCounts) {
        for sample in std::mem::take(&mut self.suspects) {
            self.drop(&sample, counts);
        }
        self.votes = 0;
    }

    fn drop(&mut self, sample: &Stamped, counts: &mut WatchCounts) {
        let late = self.turn(sample.time_s) == Turn::Late;
        let kind = if late { Irregularity::Late } else { Irregularity::Outlier };
        counts.note_with(kind, sample.place, &moment::shown(sample.time_s));
    }
}
