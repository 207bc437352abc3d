//! How often the largest value of a block reaches a level that hardly any block has reached.
//!
//! A block is what is independent of other blocks, as a flight in an environment of its own. With x the largest value of
//! a block and u a threshold that a share ζ of the blocks exceeds, the excesses have a generalized Pareto distribution:
//!
//! ```text
//! P(x > u + y) = ζ (1 + ξ y/σ)^(−1/ξ),   ζ e^(−y/σ) for ξ = 0                  (1)
//! ```
//!
//! It is the limit for high thresholds, whatever the distribution (Pickands, "Statistical Inference Using Extreme Order
//! Statistics", Annals of Statistics 3, 1975). ζ, ξ and σ are those of the largest likelihood. The interval of the
//! probability at the level holds all values whose profile likelihood is not significantly smaller (Coles, "An
//! Introduction to Statistical Modeling of Extreme Values", 2001, section 4.3.3).
//!
//! The threshold is chosen before looking: a tenth of the blocks exceeds it.

use alloc::vec::Vec;
use core::ops::RangeInclusive;
use serde::{Deserialize, Serialize};

/// One of so many blocks exceeds the threshold.
const ONE_OF: usize = 10;

/// The smallest number of excesses from which a tail is fitted.
const LEAST_EXCESSES: usize = 30;

/// The range of the shape ξ. Below, the likelihood has no regular maximum; above, excesses have no mean.
const SHAPES: RangeInclusive<f64> = -0.5..=1.0;

/// A shape this small is 0: the excesses are exponential.
const NO_SHAPE: f64 = 1e-9;

/// Half of the 95 % quantile of χ² with one degree of freedom.
const DROP_95: f64 = 1.920_729_410_347_062;

/// The smallest probability that differs from zero.
const LEAST_PROBABILITY: f64 = 1e-12;

/// Steps of a search over shapes and scales, of one over shares, and of the bisection of an interval's end.
const STEPS: usize = 30;
const SHARE_STEPS: usize = 12;
const END_STEPS: usize = 24;

/// How far from the counted share ζ is sought, in its standard deviations.
const REACH: f64 = 4.0;

/// The upper tail of block maxima.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tail {
    /// Number of blocks.
    pub blocks: u64,
    /// The threshold u.
    pub threshold: f64,
    /// Number of blocks above it.
    pub excesses: u64,
    /// The shape ξ: 0 for an exponential tail, negative for one that ends.
    pub shape: f64,
    /// The scale σ of the excesses.
    pub(crate) scale: f64,
    /// The level of the following probability.
    pub(crate) level: f64,
    /// The probability that a block's largest value exceeds the level, by (1).
    pub probability: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end of its 95 % interval.
    pub high: f64,
}

impl Tail {
    /// Fits the tail of block maxima and extrapolates it to a level. `None` with fewer than 30 excesses,
    /// or if the threshold is not below the level: then counting gives more.
    pub fn fit(maxima: &[f64], level: f64) -> Option<Self> {
        let mut sorted: Vec<f64> = maxima.iter().copied().filter(|value| !value.is_nan()).collect();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let threshold = *sorted.get(sorted.len() / ONE_OF)?;
        let excesses: Vec<f64> = (sorted.iter().map(|value| value - threshold))
            .take_while(|excess| *excess > 0.0)
            .collect();
        if excesses.len() < LEAST_EXCESSES || threshold >= level {
            return None;
        }
        let fitted = Excesses { blocks: sorted.len() as f64, excesses, reach: level - threshold };
        let best = fitted.best();
        let (low, high) = fitted.interval(&best);
        Some(Tail {
            blocks: sorted.len() as u64,
            threshold,
            excesses: fitted.excesses.len() as u64,
            shape: best.shape,
            scale: best.scale,
            level,
            probability: fitted.share() * survival(fitted.reach, best.shape, best.scale),
            low,
            high,
        })
    }
}

/// The share of excesses beyond `excess`.
fn survival(excess: f64, shape: f64, scale: f64) -> f64 {
    if shape.abs() < NO_SHAPE {
        return libm::exp(-excess / scale);
    }
    let inner = 1.0 + shape * excess / scale;
    if inner <= 0.0 { 0.0 } else { libm::pow(inner, -1.0 / shape) }
}

/// A point of the likelihood.
struct Point {
    shape: f64,
    scale: f64,
    log_likelihood: f64,
}

struct Excesses {
    blocks: f64,
    excesses: Vec<f64>,
    /// The level above the threshold.
    reach: f64,
}

impl Excesses {
    /// The counted ζ.
    fn share(&self) -> f64 {
        self.excesses.len() as f64 / self.blocks
    }

    fn log_likelihood_of_share(&self, share: f64) -> f64 {
        let count = self.excesses.len() as f64;
        count * libm::log(share) + (self.blocks - count) * libm::log(1.0 - share)
    }

    fn log_likelihood_of_excesses(&self, shape: f64, scale: f64) -> f64 {
        let count = self.excesses.len() as f64;
        if shape.abs() < NO_SHAPE {
            return -count * libm::log(scale) - self.excesses.iter().sum::<f64>() / scale;
        }
        let log = |excess: &f64| libm::log((1.0 + shape * excess / scale).max(f64::MIN_POSITIVE));
        let sum: f64 = self.excesses.iter().map(log).sum();
        -count * libm::log(scale) - (1.0 + 1.0 / shape) * sum
    }

    /// The point of the largest likelihood: for each shape the best scale.
    fn best(&self) -> Point {
        let mean = self.excesses.iter().sum::<f64>() / self.excesses.len() as f64;
        let largest = self.excesses.iter().copied().fold(0.0, f64::max);
        let of_shape = |shape: f64| {
            // A tail that ends does so behind the largest excess.
            let least = libm::log((-shape * largest).max(0.05 * mean) * (1.0 + 1e-9));
            let of_scale =
                |log_scale: f64| self.log_likelihood_of_excesses(shape, libm::exp(log_scale));
            highest(least..=libm::log(20.0 * mean).max(least + 1.0), STEPS, of_scale)
        };
        let (shape, excesses) = highest(SHAPES, STEPS, |shape| of_shape(shape).1);
        let scale = libm::exp(of_shape(shape).0);
        let log_likelihood = excesses + self.log_likelihood_of_share(self.share());
        Point { shape, scale, log_likelihood }
    }

    /// The largest log-likelihood of all points with this probability at the level.
    fn profile(&self, probability: f64) -> f64 {
        let share = self.share();
        let spread = libm::sqrt((1.0 - share) / (share * self.blocks));
        let logs = libm::log(share) - REACH * spread
            ..=(libm::log(share) + REACH * spread).min(libm::log(1.0 - 1e-9));
        let of_both = |share: f64, shape: f64| {
            let beyond = (probability / share).min(1.0 - 1e-9);
            let inner = match shape.abs() < NO_SHAPE {
                true => -libm::log(beyond),
                false => (libm::pow(beyond, -shape) - 1.0) / shape,
            };
            let scale = self.reach / inner;
            let is_inside = |excess: &f64| 1.0 + shape * excess / scale > 0.0;
            match self.excesses.iter().all(is_inside) {
                true => self.log_likelihood_of_excesses(shape, scale),
                false => f64::MIN,
            }
        };
        let of_share = |log_share: f64| {
            let share = libm::exp(log_share);
            let excesses = highest(SHAPES, STEPS, |shape| of_both(share, shape)).1;
            excesses + self.log_likelihood_of_share(share)
        };
        highest(logs, SHARE_STEPS, of_share).1
    }

    /// The largest log-likelihood of all tails that end before the level; `None` if an excess lies beyond it.
    fn profile_of_none(&self) -> Option<f64> {
        let largest = self.excesses.iter().copied().fold(0.0, f64::max);
        if largest >= self.reach {
            return None;
        }
        let of_shape = |shape: f64| {
            let scales =
                libm::log(-shape * largest * (1.0 + 1e-9))..=libm::log(-shape * self.reach);
            let of_scale = |log: f64| self.log_likelihood_of_excesses(shape, libm::exp(log));
            highest(scales, STEPS, of_scale).1
        };
        let excesses = highest(*SHAPES.start()..=-1e-3, STEPS, of_shape).1;
        Some(excesses + self.log_likelihood_of_share(self.share()))
    }

    /// The 95 % interval of the probability at the level.
    fn interval(&self, best: &Point) -> (f64, f64) {
        let least_likely = best.log_likelihood - DROP_95;
        let is_inside = |log: f64| self.profile(libm::exp(log)) >= least_likely;
        // Bisection in the logarithm, between a value inside and one outside.
        let end = |mut inside: f64, mut outside: f64| {
            for _ in 0..END_STEPS {
                let middle = 0.5 * (inside + outside);
                if is_inside(middle) { inside = middle } else { outside = middle }
            }
            libm::exp(outside)
        };
        let (least, most) = (libm::log(LEAST_PROBABILITY), libm::log(self.share()));
        let probability = self.share() * survival(self.reach, best.shape, best.scale);
        let ends_before = self.profile_of_none().is_some_and(|likely| likely >= least_likely);
        let likeliest = libm::log(probability.max(LEAST_PROBABILITY));
        let low = match ends_before || is_inside(least) {
            true => 0.0,
            false => end(likeliest, least),
        };
        // If the likeliest tail ends before the level, others may reach it.
        let steps = (0..=END_STEPS).rev();
        let mut grid = steps.map(|k| likeliest + (most - likeliest) * k as f64 / END_STEPS as f64);
        let high = grid.find(|log| is_inside(*log)).map_or(0.0, |inside| end(inside, most));
        (low, high)
    }
}

/// The place and the value of the largest value of a function with a single maximum, by golden sections.
fn highest(range: RangeInclusive<f64>, steps: usize, value: impl Fn(f64) -> f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut low, mut high) = range.into_inner();
    let (mut left, mut right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..steps {
        if at_left > at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - GOLDEN * (high - low);
            at_left = value(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + GOLDEN * (high - low);
            at_right = value(right);
        }
    }
    if at_left > at_right { (left, at_left) } else { (right, at_right) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin_diagnosis::random::Random;

    /// Block maxima whose excesses over 0.2 have a known tail; nine of ten blocks stay below.
    fn drawn(random: &mut Random, blocks: usize, shape: f64, scale: f64) -> Vec<f64> {
        let maximum = |_| {
            if random.unit() > 0.15 {
                return 0.2 * random.unit();
            }
            let beyond = random.unit().max(1e-12);
            0.2 + match shape == 0.0 {
                true => -scale * libm::log(beyond),
                false => scale * (libm::pow(beyond, -shape) - 1.0) / shape,
            }
        };
        (0..blocks).map(maximum).collect()
    }

    #[test]
    fn the_interval_holds_the_truth_about_as_often_as_it_says() {
        for (shape, scale) in [(0.0, 0.12), (0.2, 0.08), (-0.2, 0.3)] {
            let truth = 0.15 * survival(0.8, shape, scale);
            let mut held = 0;
            for experiment in 0..100 {
                let mut random = Random::stream(3, experiment);
                let tail = Tail::fit(&drawn(&mut random, 1000, shape, scale), 1.0).unwrap();
                assert!(tail.low <= tail.probability && tail.probability <= tail.high, "{tail:?}");
                held += u32::from(tail.low <= truth && truth <= tail.high);
            }
            assert!((87..=99).contains(&held), "shape {shape}: {held} of 100 hold {truth:.2e}");
        }
    }

    #[test]
    fn more_blocks_find_the_tail_that_was_drawn() {
        for (shape, scale) in [(0.0, 0.12), (0.2, 0.08), (-0.2, 0.3)] {
            let tail = Tail::fit(&drawn(&mut Random::new(5), 20_000, shape, scale), 1.0).unwrap();
            assert!((tail.shape - shape).abs() < 0.08, "{tail:?}");
            // Of a generalized Pareto distribution, the excesses over a higher threshold are one of another scale.
            let expected = scale + shape * (tail.threshold - 0.2);
            assert!((tail.scale / expected - 1.0).abs() < 0.1, "{tail:?} {expected}");
            let truth = 0.15 * survival(0.8, shape, scale);
            let ratio = tail.probability / truth;
            assert!((0.4..2.5).contains(&ratio), "{tail:?} {truth}");
            assert!(tail.high < 6.0 * tail.low, "{tail:?}");
        }
    }

    #[test]
    fn too_few_excesses_are_not_extrapolated() {
        let few: Vec<f64> = (0..250).map(|k| 0.001 * f64::from(k)).collect();
        assert_eq!(Tail::fit(&few, 1.0), None);
        assert_eq!(Tail::fit(&[0.0; 1000], 1.0), None, "no block exceeds the threshold");
        let high: Vec<f64> = (0..1000).map(|k| 0.002 * f64::from(k)).collect();
        assert_eq!(Tail::fit(&high, 1.0), None, "half of the blocks exceed the level");
        assert_eq!(Tail::fit(&[], 1.0), None);
        let known = high.iter().map(|value| 0.4 * value).collect::<Vec<_>>();
        let tail = Tail::fit(&known, 1.0).unwrap();
        // All values are below 0.8, and evenly spread: the tail ends.
        assert!(tail.shape < -0.4 && tail.low == 0.0 && tail.probability < 1e-6, "{tail:?}");
    }
}
