//! Learns a conditional band from traces of flights: factors of the covariates, and the conformal scale. The equations
//! are in [`super`].

use super::BandError;
use servotwin_diagnosis::conditional_band::{ConditionalBand, Covariate};
use servotwin_learning::metrics::{binomial_tail, find_share};

/// Rounds in which the factors are fitted one after the other.
const ROUNDS: usize = 8;
/// Regularization: the factor of a bin stays near 1 unless this many flights show otherwise. Samples of one flight
/// share a specimen, so flights are counted.
const DOUBT: f64 = 8.0;

/// The residuals of one flight with the covariates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The covariates, ordered by sample.
    pub points: Vec<f64>,
    /// The scaled residuals, ordered by sample.
    pub residuals: Vec<f64>,
}

impl Trace {
    /// The same trace with only some of its covariates.
    pub(super) fn with_covariates(&self, kept: &[usize], width: usize) -> Trace {
        let own = self.points.chunks_exact(width.max(1));
        let points = own.flat_map(|point| kept.iter().map(|&place| point[place])).collect();
        Trace { points, residuals: self.residuals.clone() }
    }

    /// The covariates and residuals of each sample, for given numbers of covariates and sensors.
    fn samples(&self, width: usize, sensors: usize) -> impl Iterator<Item = (&[f64], &[f64])> {
        let residuals = self.residuals.chunks_exact(sensors).enumerate();
        residuals.map(move |(k, residuals)| {
            (self.points.get(k * width..(k + 1) * width).unwrap_or_default(), residuals)
        })
    }

    /// The score max |r|/s over all samples and sensors.
    pub fn score(&self, field: &ConditionalBand) -> f64 {
        let mut most: f64 = 0.0;
        for (point, residuals) in self.samples(field.covariates.len(), field.base.len()) {
            let bins = field.bins(point);
            for (sensor, residual) in residuals.iter().enumerate() {
                most = most.max(residual.abs() / size_in(field, sensor, &bins));
            }
        }
        most
    }

    /// Whether the trace leaves the band.
    pub fn leaves(&self, field: &ConditionalBand) -> bool {
        self.score(field) > field.scale
    }
}

/// The size s of a sensor in the given bins.
fn size_in(field: &ConditionalBand, sensor: usize, bins: &[usize]) -> f64 {
    let factors = field.factors[sensor].iter().zip(bins);
    factors.fold(field.base[sensor], |s, (factors, &bin)| s * factors[bin])
}

/// The share of healthy flights that stays inside a band, over calibrations with this number of flights. The scale is the
/// k-th of n scores, so the share has the distribution Beta(k, n + 1 − k), whatever distribution the scores have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// k and n + 1 − k, the parameters of the distribution.
    pub beta: [usize; 2],
    /// The mean over calibrations: at least one less the target.
    pub mean: f64,
    /// The share that 97.5 % of calibrations exceed.
    pub low: f64,
    /// The share that 2.5 % of calibrations exceed.
    pub high: f64,
    /// The share that 95 % of calibrations exceed.
    pub low_one_sided: f64,
}

/// The coverage of a band with a target share outside and a number of calibration flights.
pub fn coverage(target: f64, flights: usize) -> Coverage {
    let place = place_of(target, flights).clamp(1, flights.max(1));
    // Beta(a, b) is below x if, of a + b − 1 draws with probability x, at least a succeed.
    let quantile = |probability: f64| {
        find_share(|share| binomial_tail(place as u64, flights as u64, share), probability)
    };
    Coverage {
        beta: [place, flights + 1 - place],
        mean: place as f64 / (flights as f64 + 1.0),
        low: quantile(0.025),
        high: quantile(0.975),
        low_one_sided: quantile(0.05),
    }
}

/// k: the rank of the score that becomes q, counted from one.
fn place_of(target: f64, flights: usize) -> usize {
    ((flights as f64 + 1.0) * (1.0 - target) - 1e-9).ceil() as usize
}

/// Learns a band for several sensors: s from the first traces, q from the others. Without covariates the band is
/// constant.
///
/// # Errors
/// There are too few calibration traces for the share.
pub fn learn(
    covariates: Vec<Covariate>,
    sensors: usize,
    learning: &[Trace],
    calibration: &[Trace],
    share: f64,
) -> Result<ConditionalBand, BandError> {
    let flights = calibration.len();
    let place = place_of(share, flights);
    if place > flights || place == 0 {
        let needed = (1.0 / share - 1e-9).ceil() as usize - 1;
        return Err(BandError::TooFew { flights, needed });
    }
    let neutral = covariates.iter().map(|c| vec![1.0; c.edges.len() + 1]).collect();
    let mut field = ConditionalBand {
        covariates,
        base: vec![1.0; sensors],
        factors: vec![neutral; sensors],
        scale: 1.0,
        share,
        calibrated_on: flights,
    };
    for sensor in 0..sensors {
        fit(&mut field, sensor, learning);
    }
    let mut scores: Vec<f64> = calibration.iter().map(|trace| trace.score(&field)).collect();
    scores.sort_by(f64::total_cmp);
    field.scale = scores[place - 1];
    Ok(field)
}

/// Fits the size s of a sensor.
fn fit(field: &mut ConditionalBand, sensor: usize, learning: &[Trace]) {
    let (width, sensors) = (field.covariates.len(), field.base.len());
    // For each flight, the bins of its samples and the squares of their residuals.
    let squares = |trace: &Trace| -> Vec<(Vec<usize>, f64)> {
        let of = |(point, residuals): (&[f64], &[f64])| {
            (field.bins(point), residuals[sensor] * residuals[sensor])
        };
        trace.samples(width, sensors).map(of).collect()
    };
    let flights: Vec<Vec<(Vec<usize>, f64)>> = learning.iter().map(squares).collect();
    let count = flights.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let mean = flights.iter().flatten().map(|(_, square)| square).sum::<f64>() / count;
    field.base[sensor] = mean.max(f64::MIN_POSITIVE).sqrt();
    for _ in 0..ROUNDS {
        for covariate in 0..width {
            let bins = field.factors[sensor][covariate].len();
            let (mut found, mut expected) = (vec![DOUBT; bins], vec![DOUBT; bins]);
            for flight in &flights {
                let (mut own, mut samples) = (vec![0.0; bins], vec![0.0; bins]);
                for (place, square) in flight {
                    let s = size_in(field, sensor, place);
                    own[place[covariate]] += square / (s * s);
                    samples[place[covariate]] += 1.0;
                }
                for bin in (0..bins).filter(|&bin| samples[bin] > 0.0) {
                    found[bin] += own[bin] / samples[bin];
                    expected[bin] += 1.0;
                }
            }
            for (bin, factor) in field.factors[sensor][covariate].iter_mut().enumerate() {
                *factor *= (found[bin] / expected[bin]).sqrt();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::random::NormalDeviates;
    use servotwin_diagnosis::conditional_band::CovariateSource;

    /// Flights whose residual grows with the covariate and depends on the specimen.
    fn flights(count: usize, seed: u64) -> Vec<Trace> {
        let mut random = NormalDeviates::new(seed);
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
        vec![Covariate {
            name: "size".into(),
            source: CovariateSource::Input { input: 0 },
            edges: vec![0.25, 0.5, 0.75],
            range: (0.0, 1.0),
        }]
    }

    fn none(traces: &[Trace]) -> Vec<Trace> {
        traces.iter().map(|trace| trace.with_covariates(&[], 1)).collect()
    }

    #[test]
    fn the_promised_share_leaves_the_band_and_the_field_sees_more() {
        let (learning, judged) = (flights(40, 1), flights(400, 2));
        let (mut left, mut seen, mut seen_fixed) = (0, 0, 0);
        // The guarantee applies to the mean over calibrations, so ten are averaged.
        for round in 0..10 {
            let calibration = flights(39, 100 + round);
            let field = learn(axis(), 1, &learning, &calibration, 0.1).unwrap();
            let fixed = learn(vec![], 1, &none(&learning), &none(&calibration), 0.1).unwrap();
            left += judged.iter().filter(|trace| trace.leaves(&field)).count();
            // A bias that is only large for small motions.
            for trace in &judged {
                let mut faulty = trace.clone();
                faulty.residuals.iter_mut().for_each(|residual| *residual += 0.016);
                seen += usize::from(faulty.leaves(&field));
                let faulty = faulty.with_covariates(&[], 1);
                seen_fixed += usize::from(faulty.leaves(&fixed));
            }
        }
        let share = left as f64 / 4000.0;
        assert!((0.04..=0.16).contains(&share), "{share}");
        assert!(seen > seen_fixed + 200, "{seen} {seen_fixed}");
    }

    #[test]
    fn the_coverage_of_a_calibration_is_the_one_that_draws_have() {
        let of_24 = coverage(0.05, 24);
        // The scale is the largest of 24 scores, so the coverage is U^(1/24).
        assert_eq!(of_24.beta, [24, 1]);
        assert!((of_24.mean - 24.0 / 25.0).abs() < 1e-12);
        let root = |u: f64| u.powf(1.0 / 24.0);
        assert!((of_24.low_one_sided - root(0.05)).abs() < 1e-9, "{of_24:?}");
        assert!((of_24.low - root(0.025)).abs() < 1e-9 && (of_24.high - root(0.975)).abs() < 1e-9);
        let (mut random, mut outside) = (NormalDeviates::new(3), 0);
        let of_59 = coverage(0.1, 59);
        for _ in 0..2000 {
            let mut scores: Vec<f64> = (0..59).map(|_| random.unit()).collect();
            scores.sort_by(f64::total_cmp);
            let covered = scores[place_of(0.1, 59) - 1];
            outside += usize::from(!(of_59.low..=of_59.high).contains(&covered));
        }
        assert!((70..=130).contains(&outside), "{outside} of 2000");
    }

    #[test]
    fn a_share_needs_flights_and_validity_ends_with_the_ranges() {
        let learning = flights(5, 1);
        let with = |count| learn(axis(), 1, &learning, &flights(count, 3), 0.05);
        assert!(matches!(with(18), Err(BandError::TooFew { flights: 18, needed: 19 })));
        let field = with(19).unwrap();
        // With 19 flights, the band is the largest of their scores, so none of them leaves it.
        assert!(flights(19, 3).iter().all(|trace| !trace.leaves(&field)));
        assert_eq!(field.outside(&[0.5]), 0.0);
        assert!((field.outside(&[1.5]) - 0.5).abs() < 1e-12);
        assert!(field.half_width(0, &[0.9]) > 2.0 * field.half_width(0, &[0.1]));
    }
}
