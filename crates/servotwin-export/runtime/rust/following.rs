//! A system that finds no rest is followed until its motion is known: a limit cycle, or the end of the search.

use crate::twin_sizes::{HELD, STATES};
use crate::twin_tables::SCALES;

/// The largest number of attempts and the longest time, s.
const MAX_ATTEMPTS: u32 = 20_000;
const MAX_TIME_S: f64 = 1e5;
/// The first window, s; the others end at twice the time.
const FIRST_WINDOW_S: f64 = 1.0;
/// A limit cycle has this many turns, at most this change and at least this swing.
const MIN_TURNS: u32 = 8;
const MAX_CHANGE: f64 = 0.02;
const MIN_SWING: f64 = 1e-6;

/// The range and the turns of a state in a window, over its scale.
#[derive(Clone, Copy)]
struct Swing {
    low: f64,
    high: f64,
    turns: u32,
}

impl Swing {
    const NONE: Swing = Swing { low: f64::INFINITY, high: f64::NEG_INFINITY, turns: 0 };

    fn size(&self) -> f64 {
        self.high - self.low
    }
}

/// The progress of following a system.
#[derive(Clone)]
pub struct Following {
    attempts: u32,
    window_end_s: f64,
    window: [Swing; STATES],
    window_before: [Swing; STATES],
    rises: [bool; STATES],
    /// States, inputs and held values at the end of the search.
    pub states: [f64; STATES],
    pub held: [f64; HELD],
}

impl Following {
    pub const NONE: Following = Following {
        attempts: 0,
        window_end_s: FIRST_WINDOW_S,
        window: [Swing::NONE; STATES],
        window_before: [Swing::NONE; STATES],
        rises: [false; STATES],
        states: [0.0; STATES],
        held: [0.0; HELD],
    };

    /// Observes the states; returns whether the system has been followed long enough.
    pub fn observe(&mut self, time_s: f64, states: &[f64; STATES], derivatives: &[f64]) -> bool {
        let is_end_of_window = time_s >= self.window_end_s;
        let is_cycle = is_end_of_window && self.has_limit_cycle();
        self.attempts += 1;
        if !is_cycle {
            if is_end_of_window {
                self.begin_window();
            }
            self.observe_states(states, derivatives);
        }
        is_cycle || self.attempts >= MAX_ATTEMPTS || time_s > MAX_TIME_S
    }

    fn begin_window(&mut self) {
        self.window_end_s *= 2.0;
        self.window_before = self.window;
        self.window = [Swing::NONE; STATES];
    }

    fn observe_states(&mut self, states: &[f64; STATES], derivatives: &[f64]) {
        for (state, swing) in self.window.iter_mut().enumerate() {
            let value = states[state] * SCALES[state];
            let rises = derivatives[state] * SCALES[state] > 0.0;
            swing.low = if value < swing.low { value } else { swing.low };
            swing.high = if value > swing.high { value } else { swing.high };
            swing.turns += u32::from(self.rises[state] != rises);
            self.rises[state] = rises;
        }
    }

    /// Whether the state that swings most turns at least eight times in each of two windows, with nearly the same swing.
    fn has_limit_cycle(&self) -> bool {
        let (mut largest, mut size) = (0, self.window[0].size());
        for (state, swing) in self.window.iter().enumerate().skip(1) {
            if swing.size() >= size {
                (largest, size) = (state, swing.size());
            }
        }
        let before = &self.window_before[largest];
        let size_before = before.size();
        let larger = if size_before > size { size_before } else { size };
        let turns = self.window[largest].turns;
        turns >= MIN_TURNS
            && before.turns >= MIN_TURNS
            && larger > MIN_SWING
            && (size - size_before).abs() <= MAX_CHANGE * larger
    }
}
