//! A sensor's values beside its twin's: how both spread, and whether one moves against the other.

/// What is left of the squared difference where a sign is wrong. A fault turns a sensor around less cleanly.
const TURNED: f64 = 0.05;

/// What is kept of values that came one by one.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Spread {
    /// How many values were taken.
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

/// A sensor's values beside its twin's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Beside {
    /// The spread of the twin's values.
    pub twin: Spread,
    /// Of their sum, in which nothing moves where the sign is wrong.
    sum: Spread,
    difference: Spread,
}

impl Beside {
    /// What both show; NaN is missing.
    pub fn take(&mut self, own: f64, twin: f64) {
        if twin.is_finite() {
            self.twin.take(twin);
        }
        if own.is_finite() && twin.is_finite() {
            self.sum.take(own + twin);
            self.difference.take(own - twin);
        }
    }

    /// How often both were there.
    pub fn both(&self) -> u64 {
        self.sum.count
    }

    /// Whether a wrong sign explains the difference: without it there is next to none.
    pub fn is_turned(&self) -> bool {
        self.sum.variance() < TURNED * self.difference.variance()
    }
}
