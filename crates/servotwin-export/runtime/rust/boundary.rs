//! Doubt about a boundary sensor: a wrong supply or return pressure looks like a leak or a closed valve. A shutdown waits
//! while a wrong reading explains all that the actuator shows, unless the residual follows the pressure drop of the line
//! otherwise than in health, which only a fault does.

use crate::sizes::SENSORS;
use crate::tables::{self, TUNING};
use crate::trained::{Boundary, Length};
use crate::windows::Window;
use libm::{exp, log};

const LEAST_BAND: f64 = 1e-12;
const LEAST_LEFT: f64 = 1e-12;

/// Sums over windows of a residual r and the twin's signal y.
#[derive(Clone, Copy)]
struct Sums {
    samples: f64,
    /// Number of windows that share no sample.
    windows: f64,
    /// Sums of r r, r y and y y.
    moments: [f64; 3],
}

impl Sums {
    const ZERO: Sums = Sums { samples: 0.0, windows: 0.0, moments: [0.0; 3] };

    /// Those of a window, in independent samples.
    fn of(window: &Window, sensor: usize, share: f64) -> Self {
        let twin = SENSORS + sensor;
        let samples = share * f64::from(window.samples);
        let pairs = [(sensor, sensor), (sensor, twin), (twin, twin)];
        let moments = pairs.map(|(a, b)| samples * window.covariance(a, b));
        Sums { samples, windows: share, moments }
    }

    /// Keeps a share of what was, and adds more.
    fn fade_and_add(&mut self, kept: f64, more: &Sums) {
        self.samples = self.samples * kept + more.samples;
        self.windows = self.windows * kept + more.windows;
        for (moment, new) in self.moments.iter_mut().zip(more.moments) {
            *moment = *moment * kept + new;
        }
    }

    /// The slope of r over y; `None` without motion.
    fn slope(&self, noise: f64) -> Option<Slope> {
        let [of_residual, of_both, of_twin] = self.moments;
        if !(self.samples > 1.0 && of_residual > 0.0 && of_twin > 0.0) {
            return None;
        }
        let explained = of_both * of_both / of_twin;
        let left = (of_residual - explained).max(LEAST_LEFT * of_residual);
        let white = (self.samples * noise * noise / left).min(1.0);
        let independent = (white * self.samples + (1.0 - white) * self.windows).max(1.0);
        let information = independent * of_twin / left;
        Some(Slope { slope: of_both / of_twin, information, independent })
    }
}

struct Slope {
    slope: f64,
    information: f64,
    /// Number of independent samples.
    independent: f64,
}

/// What one window length knows about one boundary.
#[derive(Clone, Copy)]
pub struct Doubt {
    /// Consecutive windows in which the sensor next to the boundary deviated.
    deviating: usize,
    /// Windows for which a wrong reading counts as an explanation.
    pub explained: usize,
    /// Windows of the deviation.
    since: Sums,
    /// Windows before it, none of which holds its onset.
    healthy: Sums,
    /// Healthy windows that may hold an onset.
    waiting: Sums,
    filling: Sums,
    filled: usize,
}

fn band_of(length: &Length, sensor: usize) -> f64 {
    length.bands[sensor].max(LEAST_BAND)
}

/// Whether one wrong reading moves the sensor out of its band, and leaves all other mean residuals within theirs.
fn explains(boundary: &Boundary, length: &Length, window: &Window) -> bool {
    let sensors = boundary.sensors.iter().map(|sensor| usize::from(*sensor));
    let effects = || sensors.clone().zip(boundary.changes);
    let (mut along, mut square) = (0.0, 0.0);
    for (sensor, change) in effects() {
        let band = band_of(length, sensor);
        let weighed = change / band;
        along += weighed * window.mean[sensor] / band;
        square += weighed * weighed;
    }
    let wrong_by = along / square;
    let moved = (wrong_by * boundary.own_change).abs();
    moved > band_of(length, boundary.sensor)
        && moved <= TUNING.largest_boundary_error
        && effects().all(|(sensor, change)| {
            (window.mean[sensor] - wrong_by * change).abs() <= band_of(length, sensor)
        })
}

impl Doubt {
    pub const NONE: Doubt = Doubt {
        deviating: 0,
        explained: 0,
        since: Sums::ZERO,
        healthy: Sums::ZERO,
        waiting: Sums::ZERO,
        filling: Sums::ZERO,
        filled: 0,
    };

    /// Takes a new window of a length.
    pub fn take(&mut self, boundary: &Boundary, length: &Length, window: &Window) {
        let panes = length.span.panes;
        let fresh = Sums::of(window, boundary.sensor, length.share);
        self.explained = match explains(boundary, length, window) {
            true if self.deviating >= panes => panes,
            true => 1,
            false => self.explained.saturating_sub(1),
        };
        if window.mean[boundary.sensor].abs() > length.bands[boundary.sensor] {
            self.take_deviating(&fresh, panes);
        } else {
            self.take_healthy(&fresh, panes);
        }
    }

    fn take_deviating(&mut self, fresh: &Sums, panes: usize) {
        (self.waiting, self.filling, self.filled) = (Sums::ZERO, Sums::ZERO, 0);
        self.deviating = self.deviating.saturating_add(1);
        if self.deviating > panes {
            let time_s = -fresh.samples * TUNING.period_s;
            self.since.fade_and_add(exp(time_s / TUNING.boundary_memory_s), fresh);
        }
    }

    /// Takes a window without a deviation, once a whole group of further ones has followed.
    fn take_healthy(&mut self, fresh: &Sums, panes: usize) {
        (self.deviating, self.since) = (0, Sums::ZERO);
        self.filling.fade_and_add(1.0, fresh);
        self.filled += 1;
        if self.filled >= panes {
            let kept = exp(-self.waiting.samples * TUNING.healthy_forgotten);
            self.healthy.fade_and_add(kept, &self.waiting);
            self.waiting = self.filling;
            (self.filling, self.filled) = (Sums::ZERO, 0);
        }
    }

    /// Evidence that the deviation is a fault and no wrong reading, nats.
    pub fn evidence(&self, boundary: &Boundary) -> f64 {
        let noise = tables::SENSORS[boundary.sensor].noise;
        let Some(now) = self.since.slope(noise) else { return 0.0 };
        let (mut own, mut variance) = (0.0, 1.0 / TUNING.information_of_lines);
        if let Some(healthy) = self.healthy.slope(noise) {
            variance = 1.0 / (TUNING.information_of_lines + healthy.information);
            own = variance * healthy.information * healthy.slope;
        }
        let change = now.slope - own;
        let likelihood = change * change / (1.0 / now.information + variance);
        0.5 * (likelihood - log(now.independent))
    }

    /// Whether a wrong reading explains the present windows, and is still possible.
    pub fn is_present(&self, boundary: &Boundary) -> bool {
        self.explained > 0 && self.evidence(boundary) < TUNING.fault_needed_nats
    }
}
