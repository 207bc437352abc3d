//! Sliding-window statistics for several window lengths at once, in fixed memory.
//!
//! A *span* consists of the last n *panes* of m samples each. Every sample enters a single pane, the base pane, which
//! is as long as the shortest panes. A full base pane is merged into the open pane of every span. When that pane is
//! full too, the span's window is merged anew from its panes. So the cost of a sample does not depend on the spans'
//! lengths, and nothing is ever subtracted. Even after days, the windows match an exact recomputation to rounding.
//!
//! Spans take turns: the first takes a base pane at its last sample, the second one sample later, and so on. Unless
//! there are more spans than samples in a base pane, no sample completes two windows. The slowest sample then costs the
//! work of one window.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require, require_sound, same_length};
use crate::residual::{DividedSample, Window};

/// Upper limit of stored counts.
const LARGEST_COUNT: u64 = 1 << 53;

/// Upper limit of stored statistics: a residual is at most a million times its scale, and its squares are summed.
const LARGEST_STATISTIC: f64 = 1e30;

/// Length of a window, and how often a new one is complete.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindowSpan {
    /// Samples of a pane; each complete pane brings a new window.
    pub pane_samples: u32,
    /// Panes of a window.
    pub panes: u32,
}

impl WindowSpan {
    /// Samples of a full window.
    pub fn samples(&self) -> u64 {
        u64::from(self.panes) * u64::from(self.pane_samples)
    }
}

/// The window of one span: a ring of full panes and the pane being filled.
#[derive(Debug, Clone)]
pub struct SpanWindow {
    span: WindowSpan,
    /// The full panes.
    panes: Vec<Window>,
    /// Index of the next full pane.
    next: usize,
    /// Number of panes completed since the start.
    ended: u64,
    has_ended: bool,
    open: Window,
    /// The window over the full panes.
    window: Window,
}

/// The windows of several spans over one stream of samples.
#[derive(Debug, Clone)]
pub struct Sliding {
    base_samples: u32,
    base: Window,
    /// The newest full base pane.
    full: Window,
    /// The span that takes it next; the number of spans if all have.
    turn: usize,
    spans: Vec<SpanWindow>,
}

/// A stored [`Sliding`]; numbers only, so that any format preserves its bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored {
    /// The statistics of the base pane.
    pub(crate) base: Vec<f64>,
    /// Statistics of the newest full base pane, if a span has not taken it yet.
    pub(crate) full: Vec<f64>,
    /// Index of the span that takes it next.
    pub(crate) turn: usize,
    /// State of each span.
    pub(crate) spans: Vec<StoredSpan>,
}

/// A stored span.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredSpan {
    /// Number of completed panes.
    pub(crate) ended: u64,
    /// The statistics of the open pane.
    pub(crate) open: Vec<f64>,
    /// Statistics of the full panes.
    pub(crate) panes: Vec<Vec<f64>>,
}

impl SpanWindow {
    fn new(span: WindowSpan, empty: &Window) -> Self {
        SpanWindow {
            span,
            panes: vec![empty.clone(); span.panes as usize],
            next: 0,
            ended: 0,
            has_ended: false,
            open: empty.clone(),
            window: empty.clone(),
        }
    }

    /// The window at the end of its newest full pane. Until it is full, it covers the samples so far.
    pub fn window(&self) -> &Window {
        &self.window
    }

    /// Whether the newest sample completed the window: then it is new.
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Whether the window has all its panes.
    pub fn is_full(&self) -> bool {
        self.ended >= self.panes.len() as u64
    }

    /// The share of the window that its newest pane makes up: 1 for the first.
    pub(crate) fn share_of_newest(&self) -> f64 {
        f64::from(self.span.pane_samples) / (self.window.count() as f64).max(1.0)
    }

    /// Adds a base pane.
    fn take(&mut self, base: &Window) {
        self.open.absorb(base);
        self.has_ended = self.open.count() >= u64::from(self.span.pane_samples);
        if !self.has_ended {
            return;
        }
        self.ended += 1;
        core::mem::swap(&mut self.panes[self.next], &mut self.open);
        self.next = (self.next + 1) % self.panes.len();
        self.merge();
        self.open.clear();
    }

    /// Merges the full panes into the window, oldest first; empty panes add nothing.
    fn merge(&mut self) {
        self.window.clear();
        let (newer, older) = self.panes.split_at(self.next);
        older.iter().chain(newer).for_each(|pane| self.window.absorb(pane));
    }

    fn clear(&mut self) {
        self.panes.iter_mut().for_each(Window::clear);
        self.open.clear();
        self.window.clear();
        (self.next, self.ended, self.has_ended) = (0, 0, false);
    }

    fn store(&self) -> StoredSpan {
        StoredSpan {
            ended: self.ended,
            open: self.open.state(),
            panes: self.panes.iter().map(Window::state).collect(),
        }
    }

    fn restore(&mut self, stored: &StoredSpan) -> Result<(), Error> {
        same_length("panes", self.panes.len(), stored.panes.len())?;
        possible(stored.ended <= LARGEST_COUNT)?;
        let of_pane = u64::from(self.span.pane_samples);
        for (pane, values) in self.panes.iter_mut().zip(&stored.panes) {
            restore(pane, values, of_pane)?;
        }
        restore(&mut self.open, &stored.open, of_pane)?;
        (self.ended, self.has_ended) = (stored.ended, false);
        self.next = (stored.ended % self.panes.len() as u64) as usize;
        self.merge();
        Ok(())
    }
}

/// Rejects a stored number that cannot occur.
fn possible(holds: bool) -> Result<(), Error> {
    require_sound(holds, "a number of a stored window is none that there can be")
}

/// Restores stored statistics of at most `most_samples` samples.
fn restore(window: &mut Window, values: &[f64], most_samples: u64) -> Result<(), Error> {
    let is_count = |number: f64| libm::trunc(number) == number && number <= most_samples as f64;
    possible(values.iter().all(|number| number.abs() <= LARGEST_STATISTIC))?;
    if let [count, first, ..] = values {
        let is_none = *first == -1.0;
        possible(*count >= 0.0 && is_count(*count))?;
        possible(is_none || (*first >= 0.0 && is_count(*first)))?;
    }
    require_sound(window.set_state(values), "a stored window has another size")
}

impl Sliding {
    /// Creates windows like the empty one over `spans`, whose panes are multiples of the shortest.
    ///
    /// # Errors
    /// [`Error::SettingOutOfRange`] for no span, an empty pane or window, or a pane that is no multiple of the
    /// shortest.
    pub fn new(empty: Window, spans: &[WindowSpan]) -> Result<Self, Error> {
        let lengths = || spans.iter().map(|span| span.pane_samples);
        let base_samples = lengths().min().unwrap_or(0);
        require(base_samples > 0, "pane_samples", 0.0, "at least 1, and at least one span")?;
        for span in spans {
            let whole = span.pane_samples % base_samples == 0;
            let length = f64::from(span.pane_samples);
            require(whole, "pane_samples", length, "a multiple of the shortest pane")?;
            require(span.panes != 0, "panes", 0.0, "at least 1")?;
        }
        let (full, turn) = (empty.clone(), spans.len());
        let spans = spans.iter().map(|&span| SpanWindow::new(span, &empty)).collect();
        Ok(Sliding { base_samples, base: empty, full, turn, spans })
    }

    /// Adds one sample as `Window::add_divided` does. Returns whether it completed a window of any span. Does not
    /// allocate.
    ///
    /// # Panics
    /// As [`Window::add`].
    pub fn add(&mut self, sample: &DividedSample) -> bool {
        self.spans.iter_mut().for_each(|span| span.has_ended = false);
        self.base.add_divided(sample);
        if self.base.count() >= u64::from(self.base_samples) {
            // With more spans than samples in a pane, the remaining spans cannot wait any longer.
            (self.turn..self.spans.len()).for_each(|_| self.take_turn());
            core::mem::swap(&mut self.base, &mut self.full);
            self.base.clear();
            self.turn = 0;
        }
        if self.turn < self.spans.len() {
            self.take_turn();
        }
        self.spans.iter().any(SpanWindow::has_ended)
    }

    fn take_turn(&mut self) {
        self.spans[self.turn].take(&self.full);
        self.turn += 1;
    }

    /// The window of a span.
    ///
    /// # Panics
    /// If there is no such span.
    pub fn span(&self, span: usize) -> &SpanWindow {
        &self.spans[span]
    }

    /// Forgets all samples. Does not allocate.
    pub(crate) fn clear(&mut self) {
        self.base.clear();
        self.turn = self.spans.len();
        self.spans.iter_mut().for_each(SpanWindow::clear);
    }

    /// Returns the complete state for storing.
    pub(crate) fn store(&self) -> Stored {
        let is_taken = self.turn >= self.spans.len();
        Stored {
            base: self.base.state(),
            full: if is_taken { Vec::new() } else { self.full.state() },
            turn: if is_taken { 0 } else { self.turn },
            spans: self.spans.iter().map(SpanWindow::store).collect(),
        }
    }

    /// Restores the state of the same spans and sensors; later results match to the bit.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] and [`Error::CorruptModel`] for a state of other spans or sensors.
    pub(crate) fn restore(&mut self, stored: &Stored) -> Result<(), Error> {
        same_length("spans", self.spans.len(), stored.spans.len())?;
        let of_base = u64::from(self.base_samples);
        restore(&mut self.base, &stored.base, of_base)?;
        self.turn = self.spans.len();
        if !stored.full.is_empty() {
            restore(&mut self.full, &stored.full, of_base)?;
            possible(stored.turn <= self.spans.len())?;
            self.turn = stored.turn;
        }
        for (span, stored) in self.spans.iter_mut().zip(&stored.spans) {
            span.restore(stored)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const SPANS: [WindowSpan; 4] = [
        WindowSpan { pane_samples: 10, panes: 5 },
        WindowSpan { pane_samples: 50, panes: 4 },
        WindowSpan { pane_samples: 200, panes: 5 },
        WindowSpan { pane_samples: 1000, panes: 1 },
    ];

    fn plain<'s>(measured: &'s [f64; 1], twin: &'s [f64; 1]) -> DividedSample<'s> {
        DividedSample { judged: measured, measured, twin, scales: &[2.0], spreads: &[1.0] }
    }

    /// A slow oscillation, a fast one, noise and a rare spike, far from zero.
    fn sample(random: &mut Random, k: u64) -> ([f64; 1], [f64; 1]) {
        let t = k as f64 * 0.01;
        let spike = if k.is_multiple_of(9973) { 0.5 } else { 0.0 };
        let twin = 3.0 + (t * 1e-3).fract() + 0.3 * (t * 0.7).fract();
        ([twin + 0.01 * random.unit() + spike + 1e-3 * (t * 0.31).fract()], [twin])
    }

    /// The window of exactly these samples, recomputed.
    fn exact(samples: &[([f64; 1], [f64; 1])]) -> Window {
        let mut window = Window::new(1);
        samples.iter().for_each(|(measured, twin)| window.add(measured, twin, &[2.0]));
        window
    }

    fn assert_same(window: &Window, exact: &Window, tolerance: f64, place: u64) {
        assert_eq!(window.count(), exact.count(), "at {place}");
        assert_eq!(window.first_excursion(), exact.first_excursion(), "at {place}");
        for (a, b) in window.to_values().iter().zip(exact.to_values()) {
            assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{a} {b} at {place}");
        }
    }

    /// 24 h at 100 Hz: every length is compared after many panes. The last span takes its turn three samples after the
    /// first.
    #[test]
    fn a_day_of_samples_gives_the_windows_of_exact_recomputation() {
        const DAY: u64 = 24 * 3600 * 100;
        const TURNS: u64 = 3;
        let mut sliding = Sliding::new(Window::new(1), &SPANS).unwrap();
        let mut random = Random::new(7);
        let mut recent = alloc::collections::VecDeque::new();
        let mut checks = 0;
        for k in 0..DAY + TURNS {
            let (measured, twin) = sample(&mut random, k);
            sliding.add(&plain(&measured, &twin));
            recent.push_back((measured, twin));
            if recent.len() > 1003 {
                recent.pop_front();
            }
            let ended = (k + 1).saturating_sub(TURNS);
            if ended > 0 && (ended % 654_000 == 0 || ended == DAY) {
                for (span, known) in SPANS.iter().enumerate() {
                    let to = recent.len() - TURNS as usize;
                    let length = known.samples() as usize;
                    let last: Vec<_> = recent.range(to - length..to).copied().collect();
                    assert!(sliding.span(span).is_full());
                    assert_same(sliding.span(span).window(), &exact(&last), 1e-14, k);
                    checks += 1;
                }
            }
        }
        assert!(checks >= 52, "{checks}");
    }

    #[test]
    fn no_sample_brings_two_windows_and_every_window_comes() {
        let mut sliding = Sliding::new(Window::new(1), &SPANS).unwrap();
        let mut random = Random::new(3);
        let mut came = [0; 4];
        for k in 0..2003 {
            let (measured, twin) = sample(&mut random, k);
            let any = sliding.add(&plain(&measured, &twin));
            let ended: Vec<usize> = (0..4).filter(|&span| sliding.span(span).has_ended()).collect();
            assert_eq!(any, !ended.is_empty());
            assert!(ended.len() <= 1, "{ended:?} at {k}");
            ended.iter().for_each(|&span| came[span] += 1);
        }
        assert_eq!(came, SPANS.map(|span| 2000 / span.pane_samples));
    }

    #[test]
    fn where_panes_are_shorter_than_there_are_spans_none_is_lost() {
        let spans = [1, 1, 2].map(|pane_samples| WindowSpan { pane_samples, panes: 2 });
        let mut sliding = Sliding::new(Window::new(1), &spans).unwrap();
        let mut random = Random::new(4);
        let samples: Vec<_> = (0..41).map(|k| sample(&mut random, k)).collect();
        for (measured, twin) in &samples {
            sliding.add(&plain(measured, twin));
        }
        for (span, part) in [(0, 39..41), (1, 38..40), (2, 36..40)] {
            assert_same(sliding.span(span).window(), &exact(&samples[part]), 1e-14, span as u64);
        }
    }

    #[test]
    fn a_window_that_is_not_full_is_over_what_there_is() {
        let mut sliding = Sliding::new(Window::new(1), &SPANS[..2]).unwrap();
        let mut random = Random::new(1);
        let samples: Vec<_> = (0..30).map(|k| sample(&mut random, k)).collect();
        for (k, (measured, twin)) in samples.iter().enumerate() {
            let ended = sliding.add(&plain(measured, twin));
            assert_eq!(ended, (k + 1) % 10 == 0);
            assert!(!sliding.span(1).has_ended());
        }
        assert!(!sliding.span(0).is_full());
        assert_same(sliding.span(0).window(), &exact(&samples), 1e-14, 0);
        assert!((sliding.span(0).share_of_newest() - 1.0 / 3.0).abs() < 1e-15);
        assert_eq!(sliding.span(1).window().count(), 0);
    }

    #[test]
    fn what_was_stored_goes_on_to_the_bit() {
        let mut random = Random::new(5);
        let mut one = Sliding::new(Window::new(1), &SPANS).unwrap();
        let run = |sliding: &mut Sliding, random: &mut Random, from: u64| {
            for k in from..from + 777 {
                let (measured, twin) = sample(random, k);
                sliding.add(&plain(&measured, &twin));
            }
        };
        // 777 is no multiple of a pane: the ten rounds stop within every turn.
        for round in 0..10 {
            run(&mut one, &mut random, 777 * round);
            let text = serde_json::to_string(&one.store()).unwrap();
            let mut other = Sliding::new(Window::new(1), &SPANS).unwrap();
            other.restore(&serde_json::from_str(&text).unwrap()).unwrap();
            let mut ahead = one.clone();
            run(&mut ahead, &mut random.clone(), 777 * (round + 1));
            run(&mut other, &mut random.clone(), 777 * (round + 1));
            assert_eq!(ahead.store(), other.store());
        }
        let mut foreign = Sliding::new(Window::watching(2, 1), &SPANS).unwrap();
        assert!(foreign.restore(&one.store()).is_err());
    }

    #[test]
    fn panes_that_do_not_fit_are_refused() {
        let odd = [SPANS[0], WindowSpan { pane_samples: 15, panes: 2 }];
        assert!(Sliding::new(Window::new(1), &odd).is_err());
        assert!(Sliding::new(Window::new(1), &[]).is_err());
        assert!(
            Sliding::new(Window::new(1), &[WindowSpan { pane_samples: 10, panes: 0 }]).is_err()
        );
    }
}
