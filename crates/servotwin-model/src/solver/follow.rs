//! Follows the motion of a system when the search for its steady state fails.
//!
//! The search takes long implicit steps. Near a steady state that repels nearby states (a chamber near vacuum, whose
//! stiffness grows with its pressure), such a step can point the wrong way, and the search stalls. The system
//! itself still settles. This module therefore follows its motion at the inputs of time zero, with error control and
//! steps that grow as the motion decays: pseudo-transient continuation with the true transient. A system that still
//! moves at the end has no steady state that can be found. The module measures whether it oscillates forever:
//!
//! ```text
//! in windows of 1, 2, 4, 8 … s, of the state that moves most over its scale:
//! it turns at least 8 times in each of the last two windows, and its swings differ by 2 % at most   (FO1)
//! ```
//!
//! Source: pseudo-transient continuation as in Kelley & Keyes 1998; (FO1) is the toolkit's own choice.

use alloc::vec;
use alloc::vec::Vec;

/// Permitted error of a step over scale.
pub(super) const TOLERANCE: f64 = 1e-5;
/// Attempted steps after which the system is given up.
const MAX_ATTEMPTS: u64 = 20_000;
/// Simulated time after which the system is given up, s.
const MAX_S: f64 = 1e5;
/// The first window, s.
const FIRST_WINDOW_S: f64 = 1.0;
/// (FO1): least turns in each of two windows.
const MIN_TURNS: u32 = 8;
/// (FO1): largest difference of two swings, over the larger.
const MAX_CHANGE: f64 = 0.02;
/// Swings over scale below this do not count.
const MIN_SWING: f64 = 1e-6;

/// The outcome of an observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// The system still moves.
    Moving,
    /// The system oscillates forever: (FO1) holds.
    LimitCycle,
    /// The system moved until the end, and (FO1) did not hold.
    GivenUp,
}

/// The range and the turns of a state in a window.
#[derive(Clone, Copy)]
struct Swing {
    low: f64,
    high: f64,
    turns: u32,
}

const NONE: Swing = Swing { low: f64::INFINITY, high: f64::NEG_INFINITY, turns: 0 };

impl Swing {
    fn size(&self) -> f64 {
        self.high - self.low
    }
}

/// The progress of following a system.
#[derive(Clone)]
pub(super) struct Following {
    /// States and held values at the end of the search. A run without a steady state begins there.
    pub(crate) search_end: (Vec<f64>, Vec<f64>),
    attempts: u64,
    window_end_s: f64,
    /// Indexed by state.
    window: Vec<Swing>,
    window_before: Vec<Swing>,
    /// Whether each state was rising at the last observation.
    rises: Vec<bool>,
}

impl Following {
    pub(crate) fn new(states: Vec<f64>, held: Vec<f64>) -> Self {
        let count = states.len();
        Self {
            search_end: (states, held),
            attempts: 0,
            window_end_s: FIRST_WINDOW_S,
            window: vec![NONE; count],
            window_before: vec![NONE; count],
            rises: vec![false; count],
        }
    }

    /// Observes the states and their rates, both over scale, at the beginning of an attempt.
    pub(crate) fn observe(
        &mut self,
        time_s: f64,
        states: impl Iterator<Item = (f64, f64)>,
    ) -> Progress {
        self.attempts += 1;
        if time_s >= self.window_end_s {
            if self.has_limit_cycle() {
                return Progress::LimitCycle;
            }
            self.window_end_s *= 2.0;
            self.window_before.copy_from_slice(&self.window);
            self.window.fill(NONE);
        }
        for (k, (state, rate)) in states.enumerate() {
            let swing = &mut self.window[k];
            swing.low = swing.low.min(state);
            swing.high = swing.high.max(state);
            swing.turns += u32::from(self.rises[k] != (rate > 0.0));
            self.rises[k] = rate > 0.0;
        }
        match self.attempts >= MAX_ATTEMPTS || time_s > MAX_S {
            true => Progress::GivenUp,
            false => Progress::Moving,
        }
    }

    /// Whether (FO1) holds.
    fn has_limit_cycle(&self) -> bool {
        let pairs = self.window_before.iter().zip(&self.window);
        let Some((before, now)) = pairs.max_by(|a, b| a.1.size().total_cmp(&b.1.size())) else {
            return false;
        };
        let larger = before.size().max(now.size());
        let turns = before.turns.min(now.turns);
        let change = (now.size() - before.size()).abs();
        turns >= MIN_TURNS && larger > MIN_SWING && change <= MAX_CHANGE * larger
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Follows one state and its rate, both functions of time, until the outcome is known.
    fn follow(state: impl Fn(f64) -> (f64, f64)) -> Progress {
        let mut following = Following::new(vec![0.0], vec![]);
        for step in 0.. {
            let time_s = step as f64 * 0.01;
            let progress = following.observe(time_s, core::iter::once(state(time_s)));
            if progress != Progress::Moving {
                return progress;
            }
        }
        unreachable!()
    }

    #[test]
    fn a_steady_swing_is_a_limit_cycle() {
        assert_eq!(follow(|t| (libm::sin(30.0 * t), libm::cos(30.0 * t))), Progress::LimitCycle);
    }

    #[test]
    fn a_swing_that_dies_out_is_none() {
        let decay = |t: f64| libm::exp(-0.05 * t);
        let state = |t| (decay(t) * libm::sin(30.0 * t), decay(t) * libm::cos(30.0 * t));
        assert_eq!(follow(state), Progress::GivenUp);
    }

    #[test]
    fn a_drift_is_none() {
        assert_eq!(follow(|t| (t, 1.0)), Progress::GivenUp);
    }
}
