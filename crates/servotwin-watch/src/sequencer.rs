//! Samples as they come, onto a fixed period.
//!
//! The first sample sets the grid: period `k` is at `t_0 + k T`. A sample belongs to the period that
//! it is nearest to; nothing is interpolated, so that values keep their bits. The rules:
//!
//! - A period is given on when a sample has come that is `wait_s` newer, or when the stream pauses. Until then
//!   samples may come in any order (*reordered*); behind that they are *late* and dropped.
//! - Two samples of one period: the nearer one counts, the other fills what it has not. One that has
//!   nothing to fill is *doubled* if it has the same time, else *surplus*.
//! - A period without a sample is a *gap*: all its values are missing (NaN).
//! - A time that is suddenly ahead (by more than `wait_s` and two of the last step), or behind what was given
//!   on, is not believed at first. The samples that go on from it vote for it, any other votes against
//!   it. With no vote left they were late or *outliers*, and are dropped. With `witnesses` votes they are
//!   believed: up to `longest_gap_s` ahead there was a gap; otherwise the clock was set: what was waiting
//!   is given on, [`Tick::Restart`] follows, and those samples begin a new grid.
//!
//! A sequencer holds at most `longest_gap_s + wait_s` of periods, whatever comes.

use super::counts::{Counts, Kind};
use super::{LARGEST_COUNT, bits};
use serde::{Deserialize, Serialize};
use servotwin_io::moment;
use std::collections::VecDeque;

/// What is allowed before samples are dropped.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rules {
    /// How long a period waits for samples that are under way, s.
    pub wait_s: f64,
    /// The longest gap behind which the stream simply goes on, s.
    pub longest_gap_s: f64,
    /// How many samples in a row make another clock believed.
    pub witnesses: usize,
}

impl Default for Rules {
    fn default() -> Self {
        Rules { wait_s: 0.05, longest_gap_s: 10.0, witnesses: 10 }
    }
}

impl Rules {
    /// A time is suddenly ahead if it is by more than this; the last one was by `step_s`.
    fn sudden_s(&self, step_s: f64) -> f64 {
        (self.wait_s + 2.0 * step_s).min(self.longest_gap_s)
    }
}

/// A sample as it came.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Stamped {
    /// Its line, row, datagram or message.
    pub place: u64,
    /// Its time, s.
    #[serde(with = "bits::one")]
    pub time_s: f64,
    /// Its values; NaN is missing.
    #[serde(with = "bits::many")]
    pub values: Vec<f64>,
}

/// What comes out.
#[derive(Debug, PartialEq)]
pub enum Tick<'t> {
    /// One period.
    Sample {
        /// The time of the grid, s.
        time_s: f64,
        /// The last sample in it; 0 where there is none.
        place: u64,
        /// The values; NaN is missing.
        values: &'t [f64],
    },
    /// The clock was set, or the stream was away for long: what follows has nothing to do with
    /// what was.
    Restart,
}

/// Puts samples onto a fixed period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sequencer {
    rules: Rules,
    #[serde(with = "bits::one")]
    period_s: f64,
    width: usize,
    grid: Option<Grid>,
    /// Samples with a time that is not believed so far, each going on from the one before.
    suspects: Vec<Stamped>,
    /// Those less the other samples that came since.
    votes: usize,
    /// Given on before anything else.
    restart: bool,
    /// Whether everything that waits may go.
    flushing: bool,
    /// What was given on last.
    #[serde(skip)]
    given: Stamped,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Grid {
    #[serde(with = "bits::one")]
    start_s: f64,
    /// The first period that was not given on.
    next: u64,
    /// The newest time that came, and how far it was ahead of the one before, s.
    #[serde(with = "bits::one")]
    newest_s: f64,
    #[serde(with = "bits::one")]
    step_s: f64,
    /// The periods from `next` on; one without a sample has no values.
    waiting: VecDeque<Stamped>,
}

impl Grid {
    /// Whether its numbers belong together: the newest sample lies in the periods that wait, or in the last one given on.
    fn is_sound(&self, rules: Rules, period_s: f64) -> bool {
        let most = (rules.longest_gap_s + rules.wait_s) / period_s + 2.0;
        let newest = (self.newest_s - self.start_s) / period_s - self.next as f64;
        let waiting = self.waiting.len() as f64;
        self.start_s.is_finite()
            && self.newest_s.is_finite()
            && self.step_s > 0.0
            && self.next <= LARGEST_COUNT
            && waiting <= most
            && (newest - (waiting - 1.0)).abs() <= 2.0
    }
}

/// Where a time belongs.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Turn {
    /// To this period, counted from the next one.
    At(usize),
    /// Perhaps to this period; but it comes suddenly.
    Ahead(usize),
    /// To one that was given on.
    Late,
    /// To none near by.
    Elsewhere,
}

impl Sequencer {
    /// A sequencer for samples of `width` values.
    pub fn new(period_s: f64, width: usize, rules: Rules) -> Self {
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

    /// What is wrong with it as the sequencer of this map and period, if anything is: whatever comes later must neither
    /// overflow nor need more memory than [`Rules`] allow.
    pub(super) fn wrong(&self, period_s: f64, width: usize, rules: Rules) -> Option<&'static str> {
        let is_sample = |sample: &Stamped| {
            sample.place <= LARGEST_COUNT
                && sample.time_s.is_finite()
                && sample.values.len() == width
        };
        let is_waiting = |sample: &Stamped| sample.values.is_empty() || is_sample(sample);
        let mut waiting = self.grid.iter().flat_map(|grid| &grid.waiting);
        let checks = [
            (self.period_s.to_bits() == period_s.to_bits(), "the period"),
            (self.rules == rules, "the rules of samples"),
            (self.width == width, "the number of inputs and sensors"),
            (waiting.all(is_waiting), "a sample that waits"),
            (self.suspects.iter().all(is_sample), "a sample that is not believed"),
            (self.votes <= self.suspects.len(), "the votes"),
            (self.grid.as_ref().is_none_or(|grid| grid.is_sound(rules, self.period_s)), "the grid"),
        ];
        checks.into_iter().find(|(holds, _)| !holds).map(|(_, what)| what)
    }

    /// Takes a sample with a finite time. Everything that [`next`](Self::next) has to give should be taken
    /// before.
    pub fn push(&mut self, sample: Stamped, counts: &mut Counts) {
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

    /// Lets everything that waits go: the stream ended or pauses.
    pub fn flush(&mut self) {
        self.flushing = true;
    }

    /// The stream has ended: no witness will come.
    pub fn end(&mut self, counts: &mut Counts) {
        self.drop_suspects(counts);
        self.flush();
    }

    /// What may be given on.
    pub fn next(&mut self, counts: &mut Counts) -> Option<Tick<'_>> {
        let wait = (self.rules.wait_s / self.period_s).ceil() as usize;
        if let Some(grid) = &mut self.grid
            && grid.waiting.len() > if self.flushing || self.restart { 0 } else { wait }
            && let Some(given) = grid.waiting.pop_front()
        {
            let time_s = grid.start_s + grid.next as f64 * self.period_s;
            grid.next += 1;
            self.given = given;
            if self.given.values.is_empty() {
                counts.note(Kind::Gap, grid.next);
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

    /// Where a time belongs; the first of all begins a grid.
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
    fn place(&mut self, index: usize, sample: Stamped, counts: &mut Counts) {
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
                counts.note(Kind::Reordered, sample.place);
            }
            *slot = sample;
            return;
        }
        let centre_s = grid.start_s + (grid.next + index as u64) as f64 * self.period_s;
        let distance = |sample: &Stamped| (sample.time_s - centre_s).abs();
        let (place, same) = (sample.place, sample.time_s == slot.time_s);
        let mut other = sample;
        if distance(&other) < distance(slot) {
            std::mem::swap(slot, &mut other);
        }
        let mut filled = false;
        for (value, from) in slot.values.iter_mut().zip(&other.values) {
            if value.is_nan() && !from.is_nan() {
                (*value, filled) = (*from, true);
            }
        }
        match (filled, same) {
            (true, _) => {}
            (false, true) => counts.note(Kind::Doubled, place),
            (false, false) => counts.note(Kind::Surplus, place),
        }
    }

    /// Keeps a sample with a time that is not believed.
    fn suspect(&mut self, sample: Stamped, counts: &mut Counts) {
        let step_s = self.grid.as_ref().map_or(f64::INFINITY, |grid| grid.step_s);
        if let Some(last) = self.suspects.last() {
            let ahead_s = sample.time_s - last.time_s;
            if ahead_s == 0.0 {
                counts.note(Kind::Doubled, sample.place);
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
        // What goes on from the first may have come near it meanwhile.
        if let Turn::At(_) | Turn::Ahead(_) = self.turn(first_s) {
            self.believe(counts);
            return;
        }
        let newest_s = self.grid.as_ref().map_or(f64::NAN, |grid| grid.newest_s);
        let back = first_s < newest_s;
        let kind = if back { Kind::ClockBack } else { Kind::ClockForward };
        counts.note_with(kind, place, &leap(newest_s, first_s));
        self.restart = true;
    }

    /// Puts the samples that were not believed into their periods.
    fn believe(&mut self, counts: &mut Counts) {
        self.votes = 0;
        for sample in std::mem::take(&mut self.suspects) {
            // They follow each other: from the first on each has its turn.
            if let Turn::At(index) | Turn::Ahead(index) = self.turn(sample.time_s) {
                self.place(index, sample, counts);
            }
        }
    }

    fn vote_against(&mut self, counts: &mut Counts) {
        self.votes = self.votes.saturating_sub(1);
        if self.votes == 0 {
            self.drop_suspects(counts);
        }
    }

    fn drop_suspects(&mut self, counts: &mut Counts) {
        for sample in std::mem::take(&mut self.suspects) {
            self.drop(&sample, counts);
        }
        self.votes = 0;
    }

    fn drop(&mut self, sample: &Stamped, counts: &mut Counts) {
        let late = self.turn(sample.time_s) == Turn::Late;
        let kind = if late { Kind::Late } else { Kind::Outlier };
        counts.note_with(kind, sample.place, &moment::shown(sample.time_s));
    }
}

/// From which time to which a clock was set, as people read them.
fn leap(from_s: f64, to_s: f64) -> String {
    format!("from {} to {}", moment::shown(from_s), moment::shown(to_s))
}
