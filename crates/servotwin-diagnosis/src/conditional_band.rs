//! A band that depends on the operating point. It limits a healthy residual depending on the command and its rate, the
//! load, the pressures and the direction of the spool.
//!
//! (CB1)  |r_i| ≤ q s_i(u),  s_i(u) = s_i0 Π_j m_ij(u_j)
//!
//! Each covariate u_j multiplies the size s of a sensor's scaled residual by a factor for each of its bins.
//! `servotwin::flight::band` learns the numbers and documents what they promise.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require, require_sound};

/// A spool that moves less than this part of its scale per sample counts as standing still.
const STILL: f64 = 1e-3;

/// How a covariate is computed. Inputs and sensors have the diagnoser's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CovariateSource {
    /// Magnitude of an input.
    Size {
        /// Index of the input.
        input: u32,
    },
    /// Magnitude of an input's rate of change, per second.
    Rate {
        /// Index of the input.
        input: u32,
    },
    /// Direction in which the twin's value of a sensor moves: −1, 0 or 1.
    Way {
        /// Index of the sensor.
        sensor: u32,
    },
    /// Value of an input.
    Input {
        /// Index of the input.
        input: u32,
    },
}

impl CovariateSource {
    /// The covariate's value in a sample. `last` holds the raw value of the previous sample and is replaced.
    pub fn value(self, last: &mut Option<f64>, sample: &CovariateSample) -> f64 {
        let now = match self {
            CovariateSource::Size { input }
            | CovariateSource::Rate { input }
            | CovariateSource::Input { input } => sample.inputs[input as usize],
            CovariateSource::Way { sensor } => {
                let place = sensor as usize;
                sample.twin[place] / sample.scales[place]
            }
        };
        let moved = now - last.replace(now).unwrap_or(now);
        match self {
            CovariateSource::Size { .. } => now.abs(),
            CovariateSource::Rate { .. } => moved.abs() / sample.period_s,
            CovariateSource::Way { .. } if moved.abs() < STILL => 0.0,
            CovariateSource::Way { .. } => moved.signum(),
            CovariateSource::Input { .. } => now,
        }
    }
}

/// The values that covariates are computed from.
#[derive(Debug, Clone, Copy)]
pub struct CovariateSample<'s> {
    /// The inputs, SI.
    pub inputs: &'s [f64],
    /// The twin's values of the sensors, SI.
    pub twin: &'s [f64],
    /// The sensors' scales, SI.
    pub scales: &'s [f64],
    /// Sampling period, s.
    pub period_s: f64,
}

/// A quantity that a band depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Covariate {
    /// Name of the quantity.
    pub name: String,
    /// How it is computed.
    pub source: CovariateSource,
    /// Boundaries between its bins, ascending.
    pub edges: Vec<f64>,
    /// The range of the training data.
    pub range: (f64, f64),
}

impl Covariate {
    fn bin(&self, value: f64) -> usize {
        self.edges.iter().take_while(|edge| value >= **edge).count()
    }

    /// Distance of a value from the range of the training data, in parts of that range; 0 inside.
    pub fn outside(&self, value: f64) -> f64 {
        let (low, high) = self.range;
        (low - value).max(value - high).max(0.0) / (high - low).max(f64::MIN_POSITIVE)
    }
}

/// A band as a product of factors, one for each covariate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConditionalBand {
    /// The covariates; empty for a constant band.
    pub covariates: Vec<Covariate>,
    /// s_i0, by sensor.
    pub base: Vec<f64>,
    /// m: one factor for each sensor, covariate and bin.
    pub factors: Vec<Vec<Vec<f64>>>,
    /// q, the calibrated scale of the band.
    pub scale: f64,
    /// Share of healthy flights that may leave the band.
    pub share: f64,
    /// Number of flights from which q was calibrated.
    pub calibrated_on: usize,
}

impl ConditionalBand {
    /// The size s of a sensor's healthy residual at a point.
    pub fn size(&self, sensor: usize, point: &[f64]) -> f64 {
        let factors = self.covariates.iter().zip(point).zip(&self.factors[sensor]);
        factors.fold(self.base[sensor], |s, ((covariate, &value), factors)| {
            s * factors[covariate.bin(value)]
        })
    }

    /// Half width of the band of a sensor at a point, in parts of the sensor's scale.
    pub fn half_width(&self, sensor: usize, point: &[f64]) -> f64 {
        self.scale * self.size(sensor, point)
    }

    /// The bin of each covariate at a point.
    pub fn bins(&self, point: &[f64]) -> Vec<usize> {
        self.covariates.iter().zip(point).map(|(covariate, &value)| covariate.bin(value)).collect()
    }

    /// Largest distance of a point from the ranges of the training data, in parts of the ranges; 0 inside.
    pub fn outside(&self, point: &[f64]) -> f64 {
        let off = self.covariates.iter().zip(point).map(|(covariate, &u)| covariate.outside(u));
        off.fold(0.0, f64::max)
    }

    /// The covariate that lies farthest outside at a point; `None` inside.
    pub fn farthest(&self, point: &[f64]) -> Option<&Covariate> {
        let off = self.covariates.iter().zip(point).map(|(c, &u)| (c.outside(u), c));
        let farthest = off.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (farthest.0 > 0.0).then_some(farthest.1)
    }

    /// Checks the numbers, and that they fit the numbers of watched sensors, sensors and inputs.
    ///
    /// # Errors
    /// [`Error::CorruptModel`], [`Error::SettingOutOfRange`].
    pub fn check(&self, watched: usize, sensors: usize, inputs: usize) -> Result<(), Error> {
        let is_positive = |value: &f64| *value > 0.0 && value.is_finite();
        require(is_positive(&self.scale), "scale", self.scale, "above 0")?;
        let is_whole = self.base.len() == watched && self.factors.len() == watched;
        require_sound(is_whole, "the field has other sensors than the bands")?;
        require_sound(self.base.iter().all(is_positive), "a size of the field is not above zero")?;
        for covariate in &self.covariates {
            let known = match covariate.source {
                CovariateSource::Size { input }
                | CovariateSource::Rate { input }
                | CovariateSource::Input { input } => (input as usize) < inputs,
                CovariateSource::Way { sensor } => (sensor as usize) < sensors,
            };
            require_sound(known, "the field depends on an input or sensor that is not there")?;
            let (low, high) = covariate.range;
            let is_sound = low <= high && covariate.edges.is_sorted();
            require_sound(is_sound, "a range or the edges of the field are not in order")?;
        }
        for factors in &self.factors {
            let fits = factors.len() == self.covariates.len()
                && factors.iter().zip(&self.covariates).all(|(f, c)| f.len() == c.edges.len() + 1);
            require_sound(fits, "the field has other factors than bins")?;
            require_sound(factors.iter().flatten().all(is_positive), "a factor is not above zero")?;
        }
        Ok(())
    }
}

/// The band at the newest sample: the point and the half widths there.
#[derive(Debug, Clone)]
pub(crate) struct Here {
    pub point: Vec<f64>,
    pub half_widths: Vec<f64>,
}

impl Here {
    pub fn new(band: &ConditionalBand) -> Self {
        let point = vec![0.0; band.covariates.len()];
        Here { half_widths: vec![0.0; band.base.len()], point }
    }

    /// Updates the point and the half widths from a sample. Does not allocate.
    pub fn go(
        &mut self,
        band: &ConditionalBand,
        last: &mut [Option<f64>],
        sample: &CovariateSample,
    ) {
        for ((value, covariate), last) in self.point.iter_mut().zip(&band.covariates).zip(last) {
            *value = covariate.source.value(last, sample);
        }
        for (sensor, half_width) in self.half_widths.iter_mut().enumerate() {
            *half_width = band.half_width(sensor, &self.point);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample<'s>(inputs: &'s [f64], twin: &'s [f64]) -> CovariateSample<'s> {
        CovariateSample { inputs, twin, scales: &[2.0], period_s: 0.01 }
    }

    #[test]
    fn covariates_are_what_their_names_say() {
        let values = |source: CovariateSource| {
            let mut last = None;
            let samples = [([-3.0], [1.0]), ([-3.5], [1.1]), ([-3.0], [1.1]), ([1.0], [0.9])];
            samples.map(|(inputs, twin)| source.value(&mut last, &sample(&inputs, &twin)))
        };
        assert_eq!(values(CovariateSource::Size { input: 0 }), [3.0, 3.5, 3.0, 1.0]);
        assert_eq!(values(CovariateSource::Rate { input: 0 }), [0.0, 50.0, 50.0, 400.0]);
        assert_eq!(values(CovariateSource::Way { sensor: 0 }), [0.0, 1.0, 0.0, -1.0]);
        assert_eq!(values(CovariateSource::Input { input: 0 }), [-3.0, -3.5, -3.0, 1.0]);
    }

    #[test]
    fn a_field_is_wide_where_its_factors_are_and_knows_where_it_ends() {
        let covariate = |name: &str, source| Covariate {
            name: name.into(),
            source,
            edges: vec![1.0, 2.0],
            range: (0.0, 4.0),
        };
        let mut band = ConditionalBand {
            covariates: vec![
                covariate("a", CovariateSource::Size { input: 0 }),
                covariate("b", CovariateSource::Input { input: 1 }),
            ],
            base: vec![0.01],
            factors: vec![vec![vec![1.0, 2.0, 3.0], vec![1.0, 1.0, 0.5]]],
            scale: 2.0,
            share: 0.05,
            calibrated_on: 19,
        };
        assert_eq!(band.check(1, 1, 2), Ok(()));
        assert_eq!(band.half_width(0, &[0.5, 0.5]), 0.02);
        assert_eq!(band.half_width(0, &[1.0, 3.0]), 0.02);
        assert_eq!(band.half_width(0, &[9.0, 0.5]), 0.06);
        assert_eq!(band.outside(&[4.0, 0.0]), 0.0);
        assert_eq!(band.farthest(&[4.0, 0.0]), None);
        assert_eq!(band.outside(&[5.0, -2.0]), 0.5);
        assert_eq!(band.farthest(&[5.0, -2.0]).unwrap().name, "b");
        assert!(band.check(1, 1, 1).is_err() && band.check(2, 2, 2).is_err());
        band.factors[0][1].pop();
        assert!(band.check(1, 1, 2).is_err());
    }
}
