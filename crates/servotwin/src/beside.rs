//! Compares a sensor with its twin: the spread of both, and whether the sensor's sign is flipped.

/// Maximum ratio of variances (sum to difference) for a flipped sign. A fault that flips a sensor leaves a larger
/// ratio.
const TURNED: f64 = 0.05;

/// Running sums of values.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Spread {
    /// Number of values.
    pub count: u64,
    sum: f64,
    square: f64,
}

impl Spread {
    /// Takes one finite value.
    pub fn take(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.square += value * value;
    }

    /// The mean of the squares; 0 without a value.
    pub fn mean_square(&self) -> f64 {
        self.square / self.count.max(1) as f64
    }

    /// The variance; 0 without a value.
    pub fn variance(&self) -> f64 {
        (self.mean_square() - (self.sum / self.count.max(1) as f64).powi(2)).max(0.0)
    }
}

/// Running comparison of a sensor's values with its twin's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TwinComparison {
    /// Spread of the twin's values.
    pub twin: Spread,
    /// Spread of sensor plus twin, which is constant if the sign is flipped.
    sum: Spread,
    difference: Spread,
}

impl TwinComparison {
    /// Takes one pair of values; NaN is missing.
    pub fn take(&mut self, own: f64, twin: f64) {
        if twin.is_finite() {
            self.twin.take(twin);
        }
        if own.is_finite() && twin.is_finite() {
            self.sum.take(own + twin);
            self.difference.take(own - twin);
        }
    }

    /// Number of samples with both values.
    pub fn both(&self) -> u64 {
        self.sum.count
    }

    /// Whether a flipped sign explains the difference: sensor plus twin hardly vary.
    pub fn is_turned(&self) -> bool {
        self.sum.variance() < TURNED * self.difference.variance()
    }
}
