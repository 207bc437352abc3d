//! The progress of one variant through time: its current time and the length of its next step.

use super::follow::{self, Following};
use super::{Control, SAME_TIME_S, SolverFailure, SolverSettings, Statistics};
use crate::signal::{Cubic, Piecewise};
use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

/// The first step, s.
const FIRST_STEP_S: f64 = 1e-4;
/// Change over scale that the step-size control of the steady-state search aims at.
const WANTED_SETTLING_CHANGE: f64 = 0.1;
/// The longest step of the steady-state search, s.
const MAX_SETTLING_STEP_S: f64 = 1e4;

/// Averaging time of `attempt_rate_per_s`, s.
const MEMORY_S: f64 = 1.0;
/// The largest factor on the tolerance at a high attempt rate. A valve that oscillates forever then takes a fifth of
/// the steps.
const MAX_RELAXATION: f64 = 1024.0;

/// The current activity of a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// Idle; the numbers in the lane are stale.
    Idle,
    /// Steady-state search, with the inputs of time zero.
    Settling,
    /// The search has failed: the system itself is simulated, with the inputs of time zero.
    Following,
    /// In steady state. The run starts with the next evaluation, which has the inputs' slopes.
    Settled,
    /// Simulation.
    Running,
}

/// An external input that changes with time, and its current piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moving {
    /// Index of the input.
    pub(crate) external: usize,
    /// Start of the piece, s.
    pub(crate) from_s: f64,
    /// End of the piece, s; infinite for the last piece.
    pub(crate) until_s: f64,
    /// The piece, in the time since `from_s`.
    pub(crate) piece: Cubic,
}

impl Moving {
    /// The first piece of an input; `None` if it is constant.
    pub(crate) fn first(external: usize, input: &Piecewise) -> Option<Self> {
        let pieces = input.pieces();
        let moves = pieces.len() > 1 || pieces[0][1..] != [0.0; 3];
        moves.then(|| Self::nth(external, input, 0))
    }

    /// The piece with index `k` of an input.
    pub(crate) fn nth(external: usize, input: &Piecewise, k: usize) -> Self {
        let breaks = input.breaks_s();
        let until_s = breaks.get(k + 1).copied().unwrap_or(f64::INFINITY);
        Self { external, from_s: breaks[k], until_s, piece: input.pieces()[k] }
    }

    /// The piece as a cubic in the time since `time_s`. Before the piece begins, its first value
    /// holds.
    #[inline(always)]
    fn from(&self, time_s: f64) -> Cubic {
        let [a, b, c, d] = self.piece;
        let t = time_s - self.from_s;
        if t < -SAME_TIME_S {
            return [a, 0.0, 0.0, 0.0];
        }
        [a + t * (b + t * (c + t * d)), b + t * (2.0 * c + t * 3.0 * d), c + 3.0 * t * d, d]
    }
}

/// The state of one lane.
#[derive(Clone)]
pub(super) struct LaneState {
    pub(crate) phase: Phase,
    pub(crate) time_s: f64,
    /// The step length that the error control requests, s.
    pub(crate) wanted_s: f64,
    /// Length and end of the current step, s.
    pub(crate) step_s: f64,
    pub(crate) end_s: f64,
    /// The external inputs that change with time.
    pub(crate) moving: Vec<Moving>,
    /// The next time at which one of their pieces begins or ends, s, as of the last update.
    pub(crate) next_break_s: f64,
    pub(crate) sample_period_s: f64,
    pub(crate) next_sample: u64,
    /// A time that no step may cross, s: the end of the run or a change of parameters.
    pub(crate) halt_s: f64,
    /// For each clock, the index of its next tick.
    pub(crate) next_tick: Vec<u64>,
    pub(crate) rejections: u32,
    /// Attempts within about [`MEMORY_S`] of simulated time.
    pub(crate) attempt_rate_per_s: f64,
    pub(crate) statistics: Statistics,
    /// Why the variant could not be finished.
    pub(crate) failure: Option<SolverFailure>,
    /// Progress in [`Phase::Following`].
    pub(crate) following: Option<Box<Following>>,
}

impl LaneState {
    pub(crate) fn new(
        settle: bool,
        moving: Vec<Moving>,
        sample_period_s: f64,
        clocks: usize,
    ) -> Self {
        Self {
            phase: if settle { Phase::Settling } else { Phase::Running },
            time_s: 0.0,
            wanted_s: FIRST_STEP_S,
            step_s: FIRST_STEP_S,
            end_s: 0.0,
            moving,
            next_break_s: f64::NEG_INFINITY,
            sample_period_s,
            next_sample: 0,
            halt_s: f64::INFINITY,
            next_tick: vec![0; clocks],
            rejections: 0,
            attempt_rate_per_s: 0.0,
            statistics: Statistics::default(),
            failure: None,
            following: None,
        }
    }

    /// A lane without a variant.
    pub(crate) fn idle(clocks: usize) -> Self {
        Self { phase: Phase::Idle, ..Self::new(false, Vec::new(), 1.0, clocks) }
    }

    /// Starts the run from the steady state.
    pub(crate) fn begin_running(&mut self) {
        self.phase = Phase::Running;
        self.time_s = 0.0;
        self.wanted_s = FIRST_STEP_S;
        self.rejections = 0;
        self.attempt_rate_per_s = 0.0;
    }

    /// Starts the simulation of the system after a failed steady-state search.
    pub(crate) fn begin_following(&mut self, following: Following) {
        self.phase = Phase::Following;
        self.following = Some(Box::new(following));
        self.next_tick.fill(0);
        self.time_s = 0.0;
        self.wanted_s = FIRST_STEP_S;
        self.step_s = FIRST_STEP_S;
        self.end_s = FIRST_STEP_S;
        self.rejections = 0;
    }

    /// Ends that simulation, in steady state or not.
    pub(crate) fn end_following(&mut self) -> Option<Box<Following>> {
        self.phase = Phase::Settled;
        self.next_tick.fill(0);
        self.following.take()
    }

    /// Whether the lane is searching for the steady state.
    pub(crate) fn seeks_rest(&self) -> bool {
        matches!(self.phase, Phase::Settling | Phase::Following)
    }

    pub(crate) fn sample_time_s(&self) -> f64 {
        self.next_sample as f64 * self.sample_period_s
    }

    /// Whether the lane has reached its next sample.
    pub(crate) fn is_at_sample(&self) -> bool {
        self.phase == Phase::Running && self.sample_time_s() <= self.time_s + SAME_TIME_S
    }

    /// The cubic of an input from the beginning of the step; the constant `held` if the input is constant.
    #[inline(always)]
    pub(crate) fn cubic(&self, external: usize, held: f64) -> Cubic {
        let Some(moving) = self.moving.iter().find(|moving| moving.external == external) else {
            return [held, 0.0, 0.0, 0.0];
        };
        if self.phase != Phase::Running {
            return [moving.piece[0], 0.0, 0.0, 0.0];
        }
        moving.from(self.time_s)
    }

    /// Whether a clock is due. During the steady-state search it ticks at every step.
    pub(crate) fn is_due(&self, clock: usize, period_s: f64) -> bool {
        match self.phase {
            Phase::Idle | Phase::Settled => false,
            Phase::Settling => true,
            Phase::Running | Phase::Following => {
                self.next_tick[clock] as f64 * period_s <= self.time_s + SAME_TIME_S
            }
        }
    }

    /// The next time that a step must not cross, s.
    #[inline(always)]
    fn next_event_s(&self, settings: &SolverSettings, periods_s: &[f64]) -> f64 {
        let is_running = self.phase == Phase::Running;
        let mut event = if is_running { self.halt_s } else { f64::INFINITY };
        let mut consider = |time: f64| {
            if time > self.time_s + SAME_TIME_S && time < event {
                event = time;
            }
        };
        if is_running && settings.land_on_samples {
            consider(self.sample_time_s());
            consider((self.next_sample + 1) as f64 * self.sample_period_s);
        }
        for (tick, period) in self.next_tick.iter().zip(periods_s) {
            consider(*tick as f64 * period);
        }
        if is_running {
            consider(self.next_break_s);
        }
        event
    }

    /// Chooses the step that the error control requests, but ends it on the next event
    /// and avoids a tiny step before the event.
    #[inline(always)]
    pub(crate) fn choose_step(&mut self, settings: &SolverSettings, periods_s: &[f64]) {
        match self.phase {
            Phase::Idle | Phase::Settled => {
                self.step_s = FIRST_STEP_S;
                return;
            }
            Phase::Settling => {
                // Sampled controllers act once per step here, so the step is at most one period.
                let longest = periods_s.iter().copied().fold(f64::INFINITY, f64::min);
                self.step_s = if self.wanted_s < longest { self.wanted_s } else { longest };
                self.end_s = self.time_s + self.step_s;
                return;
            }
            Phase::Running | Phase::Following => {}
        }
        let fixed_s = self.fixed_step_s(settings);
        let wanted = fixed_s.unwrap_or(self.wanted_s);
        let event = self.next_event_s(settings, periods_s);
        let left = event - self.time_s;
        if wanted >= left * 0.999 {
            self.step_s = left;
            self.end_s = event;
        } else if wanted * 2.0 > left && fixed_s.is_none() {
            self.step_s = left * 0.5;
            self.end_s = self.time_s + self.step_s;
        } else {
            self.step_s = wanted;
            self.end_s = self.time_s + wanted;
        }
    }

    /// The fixed step, s; `None` under error control. The steady-state search always has error control.
    #[inline(always)]
    pub(crate) fn fixed_step_s(&self, settings: &SolverSettings) -> Option<f64> {
        match settings.control {
            Control::Fixed { step_s } if !self.seeks_rest() => Some(step_s),
            _ => None,
        }
    }

    #[inline(always)]
    pub(crate) fn accept(&mut self) {
        self.statistics.steps += 1;
        self.attempt_rate_per_s *= (1.0 - self.step_s / MEMORY_S).max(0.0);
        self.time_s = self.end_s;
        self.rejections = 0;
        if self.seeks_rest() {
            self.statistics.settling += 1;
        }
    }

    /// The permitted error and the longest step, s; `None` for fixed
    /// steps.
    #[inline(always)]
    pub(crate) fn allowed(&self, settings: &SolverSettings) -> Option<(f64, f64)> {
        match (self.phase, settings.control) {
            (Phase::Settling, _) => Some((WANTED_SETTLING_CHANGE, MAX_SETTLING_STEP_S)),
            (Phase::Following, _) => Some((follow::TOLERANCE, MAX_SETTLING_STEP_S)),
            (_, Control::Adaptive { tolerance, max_step_s, attempt_rate_limit_per_s }) => {
                Some((tolerance * self.relaxation(attempt_rate_limit_per_s), max_step_s))
            }
            (_, Control::Fixed { .. }) => None,
        }
    }

    /// Factor on the tolerance at a high attempt rate: at order four it brings the rate back to its limit.
    #[inline(always)]
    fn relaxation(&self, attempt_rate_limit_per_s: f64) -> f64 {
        let busy = self.attempt_rate_per_s / (attempt_rate_limit_per_s * MEMORY_S);
        let squared = busy * busy;
        (squared * squared).clamp(1.0, MAX_RELAXATION)
    }

    /// Chooses the next step from this step's growth factor. `was_rejected` states whether an earlier attempt failed.
    #[inline(always)]
    pub(crate) fn adapt(&mut self, settings: &SolverSettings, factor: f64, was_rejected: bool) {
        let Some((_, longest)) = self.allowed(settings) else {
            return;
        };
        let most = if self.rejections > 0 || was_rejected { 1.0 } else { 6.0 };
        let next = self.step_s * factor.clamp(0.1, most);
        // A step that an event cut short allows no conclusion about longer ones.
        let next = if self.rejections == 0 && next < self.wanted_s && factor >= 1.0 {
            self.wanted_s
        } else {
            next
        };
        self.wanted_s = if next < longest { next } else { longest };
    }
}
