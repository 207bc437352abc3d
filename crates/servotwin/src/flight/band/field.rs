//! The field itself: factors of what it depends on, the conformal scale, and where its promise ends. The equations are
//! in [`super`].

use super::BandError;

/// Rounds in which factors are fitted one after the other.
const ROUNDS: usize = 8;
/// A factor of a bin is 1 unless so many flights say otherwise: samples of one flight are of one specimen.
const DOUBT: f64 = 8.0;

/// Something that a band depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariate {
    /// What it is.
    pub name: String,
    /// Where its bins meet, ascending.
    pub edges: Vec<f64>,
    /// The range that was learned from.
    pub range: (f64, f64),
}

/// What the sensors of one flight showed beside its twin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The covariates, sample after sample.
    pub points: Vec<f64>,
    /// The scaled residuals, sample after sample.
    pub residuals: Vec<f64>,
}

impl Trace {
    /// The same with some of its covariates.
    pub(super) fn with_covariates(&self, kept: &[usize], width: usize) -> Trace {
        let own = self.points.chunks_exact(width.max(1));
        let points = own.flat_map(|point| kept.iter().map(|&place| point[place])).collect();
        Trace { points, residuals: self.residuals.clone() }
    }
}

/// A band.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// What it depends on; empty for a band that is the same everywhere.
    pub covariates: Vec<Covariate>,
    /// s_i0.
    pub base: Vec<f64>,
    /// m: for each sensor and covariate one factor for each bin.
    pub factors: Vec<Vec<Vec<f64>>>,
    /// q.
    pub scale: f64,
    /// The share of healthy flights that may leave it.
    pub share: f64,
    /// n.
    pub calibrated_on: usize,
}

impl Field {
    /// A band for some sensors: s from the first traces, q from the others. Without covariates it is the same everywhere.
    ///
    /// # Errors
    /// Too few calibration traces for the share.
    pub fn learn(
        covariates: Vec<Covariate>,
        sensors: usize,
        learning: &[Trace],
        calibration: &[Trace],
        share: f64,
    ) -> Result<Self, BandError> {
        let flights = calibration.len();
        let place = ((flights as f64 + 1.0) * (1.0 - share) - 1e-9).ceil() as usize;
        if place > flights || place == 0 {
            let needed = (1.0 / share - 1e-9).ceil() as usize - 1;
            return Err(BandError::TooFew { flights, needed });
        }
        let factors =
            vec![covariates.iter().map(|c| vec![1.0; c.edges.len() + 1]).collect(); sensors];
        let mut field = Field {
            covariates,
            base: vec![1.0; sensors],
            factors,
            scale: 1.0,
            share,
            calibrated_on: flights,
        };
        for sensor in 0..sensors {
            field.fit(sensor, learning);
        }
        let mut scores: Vec<f64> = calibration.iter().map(|trace| field.score(trace)).collect();
        scores.sort_by(f64::total_cmp);
        field.scale = scores[place - 1];
        Ok(field)
    }

    /// s of a sensor.
    fn fit(&mut self, sensor: usize, learning: &[Trace]) {
        let (width, sensors) = (self.covariates.len(), self.base.len());
        // For each flight the bins of its samples and the squares of their residuals.
        let squares = |trace: &Trace| -> Vec<(Vec<usize>, f64)> {
            let of = |(k, residuals): (usize, &[f64])| {
                let point = trace.points.get(k * width..(k + 1) * width).unwrap_or_default();
                (self.bins(point), residuals[sensor] * residuals[sensor])
            };
            trace.residuals.chunks_exact(sensors).enumerate().map(of).collect()
        };
        let flights: Vec<Vec<(Vec<usize>, f64)>> = learning.iter().map(squares).collect();
        let count = flights.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let mean = flights.iter().flatten().map(|(_, square)| square).sum::<f64>() / count;
        self.base[sensor] = mean.max(f64::MIN_POSITIVE).sqrt();
        for _ in 0..ROUNDS {
            for covariate in 0..width {
                let bins = self.factors[sensor][covariate].len();
                let (mut found, mut expected) = (vec![DOUBT; bins], vec![DOUBT; bins]);
                for flight in &flights {
                    let (mut own, mut samples) = (vec![0.0; bins], vec![0.0; bins]);
                    for (place, square) in flight {
                        let s = self.at_bins(sensor, place);
                        own[place[covariate]] += square / (s * s);
                        samples[place[covariate]] += 1.0;
                    }
                    for bin in (0..bins).filter(|&bin| samples[bin] > 0.0) {
                        found[bin] += own[bin] / samples[bin];
                        expected[bin] += 1.0;
                    }
                }
                for (bin, factor) in self.factors[sensor][covariate].iter_mut().enumerate() {
                    *factor *= (found[bin] / expected[bin]).sqrt();
                }
            }
        }
    }

    fn bins(&self, point: &[f64]) -> Vec<usize> {
        let bin = |(covariate, value): (&Covariate, &f64)| {
            covariate.edges.iter().take_while(|edge| value >= edge).count()
        };
        self.covariates.iter().zip(point).map(bin).collect()
    }

    fn at_bins(&self, sensor: usize, bins: &[usize]) -> f64 {
        let factors = self.factors[sensor].iter().zip(bins);
        factors.fold(self.base[sensor], |s, (factors, &bin)| s * factors[bin])
    }

    /// How large the scaled residual of a sensor may be at a point.
    pub fn half_width(&self, sensor: usize, point: &[f64]) -> f64 {
        self.scale * self.at_bins(sensor, &self.bins(point))
    }

    /// max |r|/s over a trace.
    pub fn score(&self, trace: &Trace) -> f64 {
        let (width, sensors) = (self.covariates.len(), self.base.len());
        let mut most: f64 = 0.0;
        for (k, residuals) in trace.residuals.chunks_exact(sensors).enumerate() {
            let bins = self.bins(trace.points.get(k * width..(k + 1) * width).unwrap_or_default());
            for (sensor, residual) in residuals.iter().enumerate() {
                most = most.max(residual.abs() / self.at_bins(sensor, &bins));
            }
        }
        most
    }

    /// Whether a trace leaves the band.
    pub fn is_left_by(&self, trace: &Trace) -> bool {
        self.score(trace) > self.scale
    }

    /// How far a point lies outside of what was learned from, in parts of the ranges; 0 inside.
    pub fn outside(&self, point: &[f64]) -> f64 {
        let off = |(covariate, value): (&Covariate, &f64)| {
            let (low, high) = covariate.range;
            (low - value).max(value - high).max(0.0) / (high - low).max(f64::MIN_POSITIVE)
        };
        self.covariates.iter().zip(point).map(off).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::random::Random;

    /// Flights whose residual grows with the size of what is asked, and with their specimen.
    fn flights(count: usize, seed: u64) -> Vec<Trace> {
        let mut random = Random::new(seed);
        let mut flight = |_| {
            let specimen = 1.0 + 0.2 * random.normal().abs();
            let points: Vec<f64> = (0..300).map(|_| random.unit()).collect();
            let residuals =
                points.iter().map(|u| specimen * (0.1 + u) * 0.01 * random.normal()).collect();
            Trace { points, residuals }
        };
        (0..count).map(&mut flight).collect()
    }

    fn axis() -> Vec<Covariate> {
        vec![Covariate { name: "size".into(), edges: vec![0.25, 0.5, 0.75], range: (0.0, 1.0) }]
    }

    fn none(traces: &[Trace]) -> Vec<Trace> {
        traces.iter().map(|trace| trace.with_covariates(&[], 1)).collect()
    }

    #[test]
    fn the_promised_share_leaves_the_band_and_the_field_sees_more() {
        let (learning, judged) = (flights(40, 1), flights(400, 2));
        let (mut left, mut seen, mut seen_fixed) = (0, 0, 0);
        // The promise is of the mean over calibrations: ten of them.
        for round in 0..10 {
            let calibration = flights(39, 100 + round);
            let field = Field::learn(axis(), 1, &learning, &calibration, 0.1).unwrap();
            let fixed =
                Field::learn(vec![], 1, &none(&learning), &none(&calibration), 0.1).unwrap();
            left += judged.iter().filter(|trace| field.is_left_by(trace)).count();
            // A bias that is large for small motions only.
            for trace in &judged {
                let mut faulty = trace.clone();
                faulty.residuals.iter_mut().for_each(|residual| *residual += 0.016);
                seen += usize::from(field.is_left_by(&faulty));
                let faulty = faulty.with_covariates(&[], 1);
                seen_fixed += usize::from(fixed.is_left_by(&faulty));
            }
        }
        let share = left as f64 / 4000.0;
        assert!((0.04..=0.16).contains(&share), "{share}");
        assert!(seen > seen_fixed + 200, "{seen} {seen_fixed}");
    }

    #[test]
    fn a_share_needs_flights_and_validity_ends_with_the_ranges() {
        let learning = flights(5, 1);
        let learn = |count| Field::learn(axis(), 1, &learning, &flights(count, 3), 0.05);
        assert!(matches!(learn(18), Err(BandError::TooFew { flights: 18, needed: 19 })));
        let field = learn(19).unwrap();
        // With 19 flights the band is the largest of their scores: none of them leaves it.
        assert!(flights(19, 3).iter().all(|trace| !field.is_left_by(trace)));
        assert_eq!(field.outside(&[0.5]), 0.0);
        assert!((field.outside(&[1.5]) - 0.5).abs() < 1e-12);
        assert!(field.half_width(0, &[0.9]) > 2.0 * field.half_width(0, &[0.1]));
    }
}
