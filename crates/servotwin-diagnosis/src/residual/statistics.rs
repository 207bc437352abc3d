//! What features read of a window.

use super::{BAND, DEVIATION_BAND, Window};
use crate::number::Number;

/// The statistics of a window, for any kind of number.
pub trait Statistics {
    /// Their kind of number.
    type Number: Number;

    /// Number of samples, at least 1.
    fn samples(&self) -> Self::Number;

    /// Mean of a scaled residual.
    fn mean(&self, sensor: usize) -> Self::Number;

    /// Mean of a twin signal over its scale.
    fn twin_mean(&self, sensor: usize) -> Self::Number;

    /// Covariance of two channels: residuals first, then twin signals.
    fn covariance_of(&self, a: usize, b: usize) -> Self::Number;

    /// The largest |r'| of a residual.
    fn largest(&self, sensor: usize) -> Self::Number;

    /// 1 if a stand-in value that looks healthy replaces a sensor's value, else 0.
    fn stands_in(&self, _sensor: usize) -> Self::Number {
        Self::Number::constant(0.0)
    }

    /// Number of sensors.
    fn sensors(&self) -> usize;

    /// Covariance of two residuals; for the same one twice, its variance.
    fn covariance(&self, a: usize, b: usize) -> Self::Number {
        self.covariance_of(a, b)
    }

    /// Covariance of a residual with a twin signal.
    fn cross_covariance(&self, residual: usize, twin: usize) -> Self::Number {
        self.covariance_of(residual, self.sensors() + twin)
    }

    /// Covariance of two twin signals.
    fn twin_covariance(&self, a: usize, b: usize) -> Self::Number {
        self.covariance_of(self.sensors() + a, self.sensors() + b)
    }

    /// The paper's indicator (7): 1 if mean and standard deviation are inside their bands, else 0.
    fn indicator(&self, sensor: usize) -> Self::Number {
        let number = Self::Number::constant;
        let of_variance = self.covariance(sensor, sensor).if_less(
            number(DEVIATION_BAND * DEVIATION_BAND),
            number(1.0),
            number(0.0),
        );
        self.mean(sensor).abs().if_less(number(BAND), of_variance, number(0.0))
    }
}

impl Statistics for Window {
    type Number = f64;

    fn samples(&self) -> f64 {
        (self.count() as f64).max(1.0)
    }

    fn mean(&self, sensor: usize) -> f64 {
        Window::mean(self, sensor)
    }

    fn twin_mean(&self, sensor: usize) -> f64 {
        Window::twin_mean(self, sensor)
    }

    fn covariance_of(&self, a: usize, b: usize) -> f64 {
        Window::covariance_of(self, a, b)
    }

    fn largest(&self, sensor: usize) -> f64 {
        Window::largest(self, sensor)
    }

    fn sensors(&self) -> usize {
        Window::sensors(self)
    }
}
