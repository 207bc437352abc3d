//! Residuals and their statistics over a window, one sample at a time.
//!
//! ```text
//! r_i  = s_i − s_i^VT                                            paper, eq. (3)
//! r'_i = r_i / x_scale,i         detectable if any |r'_i| > ε     paper, eq. (4)
//! ```
//!
//! [`Window`] keeps the number of samples, the joint mean and joint covariance of all scaled residuals and twin
//! signals, the largest |r'| and the first excursion. It uses fixed memory. Every feature is a function of these, so
//! records and the flight code share the same few lines. The update is Welford's, extended to the matrix of
//! co-moments. It loses no digits when a mean is large against its deviation. Consecutive windows merge into one
//! (`Window::absorb`).

mod merge;
mod statistics;
mod undivided;

pub use statistics::Statistics;
pub use undivided::DividedSample;

use alloc::vec;
use alloc::vec::Vec;
use undivided::Undivided;

/// Half width of the band for a scaled residual: the paper's ε of equation (4), also the limit of the mean in equation
/// (7).
pub const BAND: f64 = 0.03;
/// The largest of several thousand noise samples, in standard deviations.
pub const LARGEST_OF_NOISE: f64 = 4.0;
/// Standard deviation of a scaled residual allowed by equation (7).
pub(crate) const DEVIATION_BAND: f64 = 0.01;

/// The statistics of a window of samples.
///
/// Channels `0 .. n` are the residuals and `n .. 2n` the twin's signals.
#[derive(Clone, Debug)]
pub struct Window {
    sensors: usize,
    /// Number of watched sensors, which come first; only their excursions count.
    watched: usize,
    count: u64,
    mean: Vec<f64>,
    /// Lower triangle of the co-moments, row by row. Every row is padded to whole groups of [`GROUP`] columns, which
    /// the compiler vectorizes.
    moments: Vec<f64>,
    largest: Vec<f64>,
    first_excursion: Option<u64>,
    /// One for each sensor, or none.
    undivided: Vec<Undivided>,
    /// Scratch: the current sample's deviations from the previous mean, zero-padded like a row of the co-moments.
    deviation: Vec<f64>,
}

/// Compares the statistics and ignores the scratch.
impl PartialEq for Window {
    fn eq(&self, other: &Self) -> bool {
        let shape = |w: &Self| (w.sensors, w.watched, w.count, w.first_excursion);
        shape(self) == shape(other)
            && self.mean == other.mean
            && self.moments == other.moments
            && self.largest == other.largest
            && self.undivided == other.undivided
    }
}

/// Number of co-moment columns updated at once.
const GROUP: usize = 4;

/// Start of a row of co-moments: `GROUP` consecutive rows have the same length.
const fn row_start(row: usize) -> usize {
    let bunch = row / GROUP;
    let before = GROUP * GROUP * bunch * (bunch + 1) / 2;
    before + (row % GROUP) * GROUP * (bunch + 1)
}

/// Index of the co-moment of two channels.
fn place(a: usize, b: usize) -> usize {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    row_start(high) + low
}

impl Window {
    /// An empty window over `sensors` sensors.
    pub fn new(sensors: usize) -> Self {
        Self::watching(sensors, sensors)
    }

    /// An empty window in which only the first `watched` sensors decide whether something deviates.
    pub fn watching(sensors: usize, watched: usize) -> Self {
        let channels = 2 * sensors;
        Self {
            sensors,
            watched,
            count: 0,
            mean: vec![0.0; channels],
            moments: vec![0.0; row_start(channels)],
            largest: vec![0.0; sensors],
            first_excursion: None,
            undivided: Vec::new(),
            deviation: vec![0.0; channels.next_multiple_of(GROUP)],
        }
    }

    /// Adds one sample of all sensors: measured and twin values in physical units, and their scales. Each slice has one
    /// entry per sensor.
    pub fn add(&mut self, measured: &[f64], twin: &[f64], scales: &[f64]) {
        let n = self.sensors;
        assert!(measured.len() == n && twin.len() == n && scales.len() == n);
        let (residuals, signals) = self.deviation.split_at_mut(n);
        let (residual_means, signal_means) = self.mean.split_at(n);
        for i in 0..n {
            let residual = (measured[i] - twin[i]) / scales[i];
            residuals[i] = residual - residual_means[i];
            signals[i] = twin[i] / scales[i] - signal_means[i];
            let size = residual.abs();
            // Not `f64::max`: its NaN handling costs more than everything else.
            self.largest[i] = if size > self.largest[i] { size } else { self.largest[i] };
        }
        if self.first_excursion.is_none() && self.largest_of_all() > BAND {
            self.first_excursion = Some(self.count);
        }
        self.update();
    }

    fn update(&mut self) {
        self.count += 1;
        let count = self.count as f64;
        let weight = (count - 1.0) / count;
        let mut rows = self.moments.as_mut_slice();
        for (i, &d) in self.deviation[..self.mean.len()].iter().enumerate() {
            let scaled = d * weight;
            let (row, later) = rows.split_at_mut((i / GROUP + 1) * GROUP);
            for (moment, other) in row.iter_mut().zip(&self.deviation) {
                *moment += scaled * other;
            }
            rows = later;
        }
        for (mean, d) in self.mean.iter_mut().zip(&self.deviation) {
            *mean += d / count;
        }
    }

    /// Number of sensors.
    pub fn sensors(&self) -> usize {
        self.sensors
    }

    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of a residual: equation (5).
    pub fn mean(&self, sensor: usize) -> f64 {
        self.mean[sensor]
    }

    /// Mean of a twin signal over its scale.
    pub(crate) fn twin_mean(&self, sensor: usize) -> f64 {
        self.mean[self.sensors + sensor]
    }

    /// Covariance of two channels: residuals first, then twin signals.
    pub fn covariance_of(&self, a: usize, b: usize) -> f64 {
        if self.count == 0 { 0.0 } else { self.moments[place(a, b)] / self.count as f64 }
    }

    /// Covariance of two residuals; for the same one twice, the variance of equation (6).
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance_of(a, b)
    }

    /// Covariance of a residual with a twin signal.
    pub fn cross_covariance(&self, residual: usize, twin: usize) -> f64 {
        self.covariance_of(residual, self.sensors + twin)
    }

    /// Covariance of two twin signals.
    pub(crate) fn twin_covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance_of(self.sensors + a, self.sensors + b)
    }

    /// The largest |r'| of any watched residual.
    pub fn largest_of_all(&self) -> f64 {
        self.largest[..self.watched].iter().fold(0.0, |largest, &size| size.max(largest))
    }

    /// The largest |r'| of a residual.
    pub fn largest(&self, sensor: usize) -> f64 {
        self.largest[sensor]
    }

    /// The number of the first sample outside the band of equation (4).
    pub fn first_excursion(&self) -> Option<u64> {
        self.first_excursion
    }

    /// The paper's indicator (7): whether mean and standard deviation are inside their bands.
    pub(crate) fn no_deviation(&self, sensor: usize) -> bool {
        self.indicator(sensor) == 1.0
    }

    /// Whether any watched residual violates equation (7).
    pub fn deviates(&self) -> bool {
        (0..self.watched).any(|s| !self.no_deviation(s))
    }

    /// The window with the sensors in another order: sensor `i` of the result is sensor `order[i]` of this one.
    /// Exchanging the actuators gives the symmetric copy of a variant. It serves features and has no undivided moments.
    pub fn reordered(&self, order: &[usize]) -> Self {
        let mut result = Self::watching(self.sensors, self.watched);
        self.reorder_into(order, &mut result);
        result
    }

    /// As [`Window::reordered`], into a window with the same number of sensors. Does not allocate.
    ///
    /// # Panics
    /// If `result` has another number of sensors.
    pub(crate) fn reorder_into(&self, order: &[usize], result: &mut Self) {
        let n = self.sensors;
        assert!(result.sensors == n && order.len() == n);
        let channel = |i: usize| if i < n { order[i] } else { n + order[i - n] };
        result.watched = self.watched;
        result.count = self.count;
        result.first_excursion = self.first_excursion;
        for i in 0..2 * n {
            result.mean[i] = self.mean[channel(i)];
            for j in 0..=i {
                result.moments[place(i, j)] = self.moments[place(channel(i), channel(j))];
            }
        }
        for (largest, &sensor) in result.largest.iter_mut().zip(order) {
            *largest = self.largest[sensor];
        }
    }

    /// The statistics as a flat list for storing: number of samples, first excursion (−1 for none), largest magnitudes,
    /// means, co-moments. This is all that features read.
    pub fn to_values(&self) -> Vec<f64> {
        let first = self.first_excursion.map_or(-1.0, |sample| sample as f64);
        let head = [self.count as f64, first];
        [&head[..], &self.largest, &self.mean, &self.moments].concat()
    }

    /// As [`Window::to_values`], followed by the undivided moments.
    pub(crate) fn state(&self) -> Vec<f64> {
        let mut state = self.to_values();
        state.extend(self.undivided.iter().flat_map(Undivided::numbers));
        state
    }

    /// The window of a stored list; `None` if its length does not fit the number of sensors.
    pub fn from_values(sensors: usize, watched: usize, values: &[f64]) -> Option<Self> {
        let mut window = Self::watching(sensors, watched);
        window.set_state(values).then_some(window)
    }

    /// Restores a stored state. Returns `false` and changes nothing if the length does not fit. Does not allocate.
    pub(crate) fn set_state(&mut self, values: &[f64]) -> bool {
        let [count, first, rest @ ..] = values else { return false };
        let lengths = [&self.largest, &self.mean, &self.moments].map(Vec::len);
        let undivided = undivided::NUMBERS * self.undivided.len();
        if rest.len() != lengths.iter().sum::<usize>() + undivided {
            return false;
        }
        let (largest, rest) = rest.split_at(self.largest.len());
        let (mean, rest) = rest.split_at(self.mean.len());
        let (moments, undivided) = rest.split_at(self.moments.len());
        self.count = *count as u64;
        self.first_excursion = (*first >= 0.0).then_some(*first as u64);
        self.largest.copy_from_slice(largest);
        self.mean.copy_from_slice(mean);
        self.moments.copy_from_slice(moments);
        for (own, numbers) in self.undivided.iter_mut().zip(undivided.as_chunks().0) {
            *own = Undivided::from_numbers(*numbers);
        }
        true
    }

    /// The mean of a channel, for augmentation.
    pub fn mean_mut(&mut self, channel: usize) -> &mut f64 {
        &mut self.mean[channel]
    }

    /// The co-moment of two channels (covariance times number of samples), for augmentation.
    pub fn co_moment_mut(&mut self, a: usize, b: usize) -> &mut f64 {
        &mut self.moments[place(a, b)]
    }

    /// The largest |r'| of a residual, for augmentation.
    pub fn largest_mut(&mut self, sensor: usize) -> &mut f64 {
        &mut self.largest[sensor]
    }

    /// Clears all samples. Does not allocate.
    pub(crate) fn clear(&mut self) {
        self.count = 0;
        self.first_excursion = None;
        for list in [&mut self.mean, &mut self.moments, &mut self.largest] {
            list.fill(0.0);
        }
        self.undivided.fill(Undivided::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two-pass formulas on the same samples.
    fn two_pass(samples: &[[f64; 2]]) -> ([f64; 2], f64) {
        let n = samples.len() as f64;
        let mean = [0, 1].map(|i| samples.iter().map(|s| s[i]).sum::<f64>() / n);
        let product = |s: &[f64; 2]| (s[0] - mean[0]) * (s[1] - mean[1]);
        (mean, samples.iter().map(product).sum::<f64>() / n)
    }

    #[test]
    fn moments_equal_the_two_pass_formulas_even_far_from_zero() {
        let samples: Vec<[f64; 2]> =
            (0..1000).map(|k| [1e6 + (k % 7) as f64, 1e6 - (k % 5) as f64]).collect();
        let mut window = Window::new(2);
        for s in &samples {
            window.add(s, &[0.0, 0.0], &[1.0, 1.0]);
        }
        let (mean, covariance) = two_pass(&samples);
        assert!((window.mean(0) / mean[0] - 1.0).abs() < 1e-15);
        assert!((window.covariance(0, 1) - covariance).abs() < 1e-8);
        assert!((window.covariance(0, 0) - 4.0).abs() < 0.01, "{}", window.covariance(0, 0));
    }

    #[test]
    fn the_indicator_and_the_first_excursion_follow_the_paper() {
        let mut window = Window::new(1);
        for k in 0..100 {
            let spike = if k == 40 { 0.031 } else { 0.0 };
            window.add(&[2.0 * spike], &[0.0], &[2.0]);
        }
        assert_eq!(window.first_excursion(), Some(40));
        assert!(window.no_deviation(0), "one spike moves neither mean nor variance enough");
        assert!((window.largest(0) - 0.031).abs() < 1e-15);
        window.clear();
        window.add(&[0.04], &[0.0], &[1.0]);
        assert!(!window.no_deviation(0));
        assert!(window.deviates());
    }

    #[test]
    fn reordering_twice_by_an_exchange_changes_nothing() {
        let mut window = Window::new(3);
        for k in 0..50 {
            let k = k as f64;
            window.add(&[k, -2.0 * k, k * k], &[1.0, k, 3.0], &[1.0, 2.0, 3.0]);
        }
        let stored = Window::from_values(3, 3, &window.to_values()).unwrap();
        assert_eq!(stored.reordered(&[0, 1, 2]), window.reordered(&[0, 1, 2]));
        assert_eq!(Window::from_values(2, 2, &window.to_values()), None);
        let exchanged = window.reordered(&[1, 0, 2]);
        assert_eq!(exchanged.mean(0), window.mean(1));
        assert_eq!(exchanged.cross_covariance(0, 2), window.cross_covariance(1, 2));
        assert_eq!(exchanged.reordered(&[1, 0, 2]), window.reordered(&[0, 1, 2]));
    }
}
