//! Moments of residuals before their division by a spread ([`crate::spread`]).
//!
//! A wrong boundary value δ moves a residual by δ, and a divided one by δ/d. A comparison of residuals with physics
//! ([`crate::diagnoser::Boundary`]) therefore needs three moments of each sensor: the mean of 1/d, the variance of the
//! undivided residual r, and the covariance of r with the twin's signal y.

use super::Window;

/// A sample whose residuals were divided by their spread. Each list has one entry per sensor; values are in the sensors'
/// units.
#[derive(Debug, Clone, Copy)]
pub struct DividedSample<'s> {
    /// The values that a window judges: their differences from the twin are the divided residuals.
    pub judged: &'s [f64],
    /// The values as measured.
    pub measured: &'s [f64],
    /// The values that the twin expects.
    pub twin: &'s [f64],
    /// The scale of each sensor.
    pub scales: &'s [f64],
    /// d: the spread of each residual.
    pub spreads: &'s [f64],
}

/// Of one sensor, over the samples of a window.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Undivided {
    /// Mean of 1/d.
    inverse: f64,
    /// Mean of r, in parts of scale.
    mean: f64,
    /// Co-moments of r with itself, and with y.
    own: f64,
    cross: f64,
}

/// Numbers of an [`Undivided`].
pub(super) const NUMBERS: usize = 4;

impl Undivided {
    /// Takes a number towards which the means move by `share`, while the co-moments grow by `weight`. `twin` is how far
    /// y is from its mean before.
    fn take(&mut self, (inverse, residual, twin): (f64, f64, f64), share: f64, weight: f64) {
        let distance = residual - self.mean;
        let weighed = distance * weight;
        self.own += weighed * distance;
        self.cross += weighed * twin;
        self.inverse += (inverse - self.inverse) * share;
        self.mean += distance * share;
    }

    pub(crate) fn numbers(&self) -> [f64; NUMBERS] {
        [self.inverse, self.mean, self.own, self.cross]
    }

    pub(crate) fn from_numbers([inverse, mean, own, cross]: [f64; NUMBERS]) -> Self {
        Undivided { inverse, mean, own, cross }
    }
}

impl Window {
    /// The same window, still empty, that also keeps the residuals before their division ([`Window::add_divided`]).
    pub(crate) fn keeping_undivided(mut self) -> Self {
        self.undivided = alloc::vec![Undivided::default(); self.sensors];
        self
    }

    /// As [`Window::add`], of judged values. Does not allocate.
    ///
    /// # Panics
    /// As [`Window::add`].
    pub(crate) fn add_divided(&mut self, sample: &DividedSample) {
        let DividedSample { judged, measured, twin, scales, spreads } = *sample;
        self.add(judged, twin, scales);
        let share = 1.0 / self.count as f64;
        let weight = (self.count - 1) as f64 / self.count as f64;
        for (i, undivided) in self.undivided.iter_mut().enumerate() {
            let residual = (measured[i] - twin[i]) / scales[i];
            let numbers = (1.0 / spreads[i], residual, self.deviation[self.sensors + i]);
            undivided.take(numbers, share, weight);
        }
    }

    /// Merges what follows; the twin's deviations are in the scratch, as [`Window::absorb`] leaves them.
    pub(super) fn absorb_undivided(&mut self, later: &Window, share: f64, weight: f64) {
        let twins = &self.deviation[self.sensors..];
        for ((own, later), twin) in self.undivided.iter_mut().zip(&later.undivided).zip(twins) {
            own.take((later.inverse, later.mean, *twin), share, weight);
            own.own += later.own;
            own.cross += later.cross;
        }
    }

    /// The mean of 1/d of a sensor.
    ///
    /// # Panics
    /// Here and below, if the window does not keep undivided residuals.
    pub(crate) fn inverse_spread(&self, sensor: usize) -> f64 {
        self.undivided[sensor].inverse
    }

    /// The variance of a residual before its division.
    pub(crate) fn undivided_variance(&self, sensor: usize) -> f64 {
        self.undivided[sensor].own / self.count.max(1) as f64
    }

    /// The covariance of a residual before its division with the twin's signal of the same sensor.
    pub(crate) fn undivided_cross_covariance(&self, sensor: usize) -> f64 {
        self.undivided[sensor].cross / self.count.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use alloc::vec::Vec;

    const SCALES: [f64; 2] = [2.0, 40.0];

    /// Measured, twin, spread of two sensors.
    fn samples(count: usize) -> Vec<[[f64; 2]; 3]> {
        let mut random = Random::stream(5, 1);
        let mut pair = |from: f64| [from + random.unit(), from + random.unit()];
        (0..count).map(|_| [pair(3.0), pair(4.0), pair(1.0)]).collect()
    }

    fn window(samples: &[[[f64; 2]; 3]]) -> Window {
        let mut window = Window::new(2).keeping_undivided();
        for [measured, twin, spreads] in samples {
            // As of a baseline: what is subtracted from all samples alike changes nothing of the undivided residual.
            let judged = [0, 1].map(|i| twin[i] + (measured[i] - twin[i]) / spreads[i] - 0.3);
            let scales = &SCALES;
            window.add_divided(&DividedSample { judged: &judged, measured, twin, scales, spreads });
        }
        window
    }

    #[test]
    fn moments_before_the_division_are_those_of_a_window_without_spreads() {
        let samples = samples(90);
        let mut plain = Window::new(2);
        samples.iter().for_each(|[measured, twin, _]| plain.add(measured, twin, &SCALES));
        let mut merged = window(&samples[..30]);
        merged.absorb(&window(&samples[30..]));
        for own in [window(&samples), merged] {
            for i in 0..2 {
                let inverse = samples.iter().map(|s| 1.0 / s[2][i]).sum::<f64>() / 90.0;
                let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
                close(own.inverse_spread(i), inverse);
                close(own.undivided_variance(i), plain.covariance(i, i));
                close(own.undivided_cross_covariance(i), plain.cross_covariance(i, i));
                assert!(own.covariance(i, i) < 0.9 * plain.covariance(i, i));
            }
        }
    }

    #[test]
    fn a_stored_window_keeps_them() {
        let own = window(&samples(9));
        let mut other = Window::new(2).keeping_undivided();
        assert!(other.set_state(&own.state()));
        assert_eq!(other, own);
        assert!(!Window::new(2).set_state(&own.state()));
        other.clear();
        assert_eq!(other, Window::new(2).keeping_undivided());
    }
}
