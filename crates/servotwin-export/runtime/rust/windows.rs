//! Statistics of sliding windows in fixed memory: sample count, joint mean and joint co-moments of all scaled residuals and
//! twin signals, and the largest magnitude of each residual. A sample enters the base pane alone; full panes are merged.

use crate::sizes::{MOST_PANES, SENSORS};
use crate::tables;
use crate::trained::{Span, StreamPlan};

/// The residuals, then the twin's signals.
pub const CHANNELS: usize = 2 * SENSORS;

const MOMENTS: usize = CHANNELS * (CHANNELS + 1) / 2;

/// Residuals that the baseline learns are clipped to this part of their scale.
const LARGEST_LEARNED: f64 = 0.25;

/// One value for each sensor.
pub type Values = [f64; SENSORS];

/// The statistics of some samples.
#[derive(Clone)]
pub struct Window {
    pub samples: u32,
    /// Parts of scale.
    pub mean: [f64; CHANNELS],
    /// Lower triangle, row by row.
    pub moments: [f64; MOMENTS],
    /// Largest magnitude of each residual, parts of scale.
    pub largest: Values,
}

fn place_of(a: usize, b: usize) -> usize {
    let (low, high) = (a.min(b), a.max(b));
    high * (high + 1) / 2 + low
}

/// The channel that comes to a place when the sensors have another order.
fn channel_of(order: &[u8; SENSORS], channel: usize) -> usize {
    match channel.checked_sub(SENSORS) {
        None => usize::from(order[channel]),
        Some(sensor) => SENSORS + usize::from(order[sensor]),
    }
}

impl Window {
    /// No samples.
    pub const EMPTY: Window = Window {
        samples: 0,
        mean: [0.0; CHANNELS],
        moments: [0.0; MOMENTS],
        largest: [0.0; SENSORS],
    };

    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.moments[place_of(a, b)] / f64::from(self.samples)
    }

    /// Adds to each co-moment a weight times the product of two deviations, and what another window has.
    fn add_moments(&mut self, by: &[f64; CHANNELS], weight: f64, other: Option<&Window>) {
        let mut place = 0;
        for i in 0..CHANNELS {
            let scaled = by[i] * weight;
            for factor in &by[..=i] {
                let product = scaled * factor;
                self.moments[place] += other.map_or(product, |o| o.moments[place] + product);
                place += 1;
            }
        }
    }

    /// Adds one sample, SI: Welford's update, extended to the matrix of co-moments.
    fn add_sample(&mut self, measured: &Values, twin: &Values) {
        let mut deviation = [0.0; CHANNELS];
        for (i, sensor) in tables::SENSORS.iter().enumerate() {
            let residual = (measured[i] - twin[i]) / sensor.scale;
            deviation[i] = residual - self.mean[i];
            deviation[SENSORS + i] = twin[i] / sensor.scale - self.mean[SENSORS + i];
            if residual.abs() > self.largest[i] {
                self.largest[i] = residual.abs();
            }
        }
        self.samples += 1;
        let count = f64::from(self.samples);
        self.add_moments(&deviation, (count - 1.0) / count, None);
        for (mean, by) in self.mean.iter_mut().zip(deviation) {
            *mean += by / count;
        }
    }

    /// Adds the samples of a window that follows, if it has any (Chan, Golub and LeVeque, 1979).
    fn absorb(&mut self, later: &Window) {
        if later.samples == 0 {
            return;
        }
        let samples = self.samples + later.samples;
        let share = f64::from(later.samples) / f64::from(samples);
        let weight = f64::from(self.samples) * share;
        let difference: [f64; CHANNELS] = core::array::from_fn(|i| later.mean[i] - self.mean[i]);
        for (mean, by) in self.mean.iter_mut().zip(difference) {
            *mean += by * share;
        }
        self.add_moments(&difference, weight, Some(later));
        for (largest, other) in self.largest.iter_mut().zip(later.largest) {
            *largest = largest.max(other);
        }
        self.samples = samples;
    }

    /// The window with its sensors in another order.
    pub fn reordered(&self, order: &[u8; SENSORS]) -> Window {
        let channels: [usize; CHANNELS] = core::array::from_fn(|i| channel_of(order, i));
        let mut into = Window { samples: self.samples, ..Window::EMPTY };
        let mut place = 0;
        for (i, &from) in channels.iter().enumerate() {
            into.mean[i] = self.mean[from];
            for &other in &channels[..=i] {
                into.moments[place] = self.moments[place_of(from, other)];
                place += 1;
            }
        }
        into.largest = core::array::from_fn(|i| self.largest[usize::from(order[i])]);
        into
    }
}

/// The window of one length.
#[derive(Clone)]
pub struct Ring {
    panes: [Window; MOST_PANES],
    open: Window,
    /// Over the full panes.
    pub window: Window,
    /// The pane that is filled next.
    next: usize,
    /// Full panes so far, at most as many as there are.
    ended: usize,
    /// Whether the newest sample completed a window.
    pub has_ended: bool,
}

impl Ring {
    pub const EMPTY: Ring = Ring {
        panes: [Window::EMPTY; MOST_PANES],
        open: Window::EMPTY,
        window: Window::EMPTY,
        next: 0,
        ended: 0,
        has_ended: false,
    };

    pub fn is_full(&self, span: &Span) -> bool {
        self.ended >= span.panes
    }

    /// Takes a full base pane.
    fn take(&mut self, span: &Span, base: &Window) {
        self.open.absorb(base);
        self.has_ended = self.open.samples >= span.pane_samples;
        if !self.has_ended {
            return;
        }
        self.panes[self.next] = self.open.clone();
        self.open = Window::EMPTY;
        self.next = (self.next + 1) % span.panes;
        self.ended = (self.ended + 1).min(span.panes);
        self.window = Window::EMPTY;
        for i in 0..span.panes {
            self.window.absorb(&self.panes[(self.next + i) % span.panes]);
        }
    }
}

/// Lengths that share samples. They take a full base pane one sample after the other.
#[derive(Clone)]
pub struct Stream {
    base: Window,
    full: Window,
    /// How many lengths have yet to take the full base pane.
    waiting: usize,
}

impl Stream {
    pub const EMPTY: Stream = Stream { base: Window::EMPTY, full: Window::EMPTY, waiting: 0 };

    /// Lets the next length take the full base pane, if one waits.
    fn take_turn(&mut self, rings: &mut [Ring], plan: &StreamPlan) {
        if self.waiting > 0 {
            let place = usize::from(plan.places[plan.places.len() - self.waiting]);
            rings[place].take(&tables::LENGTHS[place].span, &self.full);
            self.waiting -= 1;
        }
    }

    /// Adds a sample in SI units; returns whether it completed a window.
    pub fn add(
        &mut self,
        rings: &mut [Ring],
        plan: &StreamPlan,
        measured: &Values,
        twin: &Values,
    ) -> bool {
        let places = || plan.places.iter().map(|place| usize::from(*place));
        places().for_each(|place| rings[place].has_ended = false);
        self.base.add_sample(measured, twin);
        if self.base.samples >= plan.base_samples {
            // With more lengths than samples in a pane, the remaining lengths cannot wait any longer.
            while self.waiting > 0 {
                self.take_turn(rings, plan);
            }
            self.full = core::mem::replace(&mut self.base, Window::EMPTY);
            self.waiting = plan.places.len();
        }
        self.take_turn(rings, plan);
        places().any(|place| rings[place].has_ended)
    }
}

/// The mean residuals of this specimen.
#[derive(Clone)]
pub struct Baseline {
    /// At most one more than the settling time.
    samples: u32,
    /// SI.
    pub means: Values,
}

impl Baseline {
    pub const EMPTY: Baseline = Baseline { samples: 0, means: [0.0; SENSORS] };

    pub fn is_settled(&self) -> bool {
        self.samples >= tables::BASELINE_SETTLE_SAMPLES
    }

    /// Learns from a sample, SI.
    pub fn learn(&mut self, measured: &Values, twin: &Values) {
        if self.samples <= tables::BASELINE_SETTLE_SAMPLES {
            self.samples += 1;
        }
        let is_settling = self.samples <= tables::BASELINE_SETTLE_SAMPLES;
        let memory = if is_settling { self.samples } else { tables::BASELINE_MEMORY_SAMPLES };
        for (i, sensor) in tables::SENSORS.iter().enumerate() {
            let most = LARGEST_LEARNED * sensor.scale;
            let residual = (measured[i] - twin[i]).max(-most).min(most);
            self.means[i] += (residual - self.means[i]) / f64::from(memory);
        }
    }
}
