//! Rates with confidence intervals.
//!
//! Rows are not independent: one fault at one intensity occurs in many cases, and adjacent intensities of one kind are
//! similar. So intervals come from a bootstrap of whole clusters (a kind at an intensity). A bootstrap of whole kinds
//! gives a wider interval. Rates of independent cases have Wilson's interval.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use servotwin_diagnosis::random::Random;

/// Half width of the central 95 % of a normal distribution, in standard deviations.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Number of bootstrap resamples.
const RESAMPLES: usize = 1000;

/// Seed of the bootstrap.
const SEED: u64 = 1;

/// A share of cases with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// Number of cases that hold.
    pub count: u64,
    /// Number of all cases.
    pub of: u64,
    /// The share; `None` without cases.
    pub share: Option<f64>,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// The interval with whole kinds of fault as clusters; `None` for independent cases.
    pub by_kind: Option<(f64, f64)>,
}

/// One case of a rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Number of the kind of fault and intensity.
    pub cluster: u32,
    /// Number of the kind of fault.
    pub kind: u32,
    /// Whether the counted event occurred.
    pub holds: bool,
}

impl Default for Rate {
    /// The rate of no case.
    fn default() -> Self {
        Rate::new(0, 0)
    }
}

impl Rate {
    /// The rate of independent cases.
    pub fn new(count: u64, of: u64) -> Self {
        let (low, high) = wilson_interval(count, of, NORMAL_95);
        let share = (of > 0).then(|| count as f64 / of as f64);
        Rate { count, of, share, low, high, by_kind: None }
    }

    /// The rate of cases in dependent clusters.
    pub fn clustered(trials: &[Trial]) -> Self {
        let count = trials.iter().filter(|trial| trial.holds).count() as u64;
        let plain = Rate::new(count, trials.len() as u64);
        let interval = |cluster: fn(&Trial) -> u32| {
            let trials = trials.iter().map(|trial| (cluster(trial), trial.holds));
            cluster_interval(trials, RESAMPLES, SEED)
        };
        let (low, high) = interval(|trial| trial.cluster);
        Rate { low, high, by_kind: Some(interval(|trial| trial.kind)), ..plain }
    }

    /// The rate of items that meet a condition.
    pub fn of<T>(items: &[T], holds: impl Fn(&T) -> bool) -> Self {
        let count = items.iter().filter(|item| holds(item)).count();
        Rate::new(count as u64, items.len() as u64)
    }
}

/// Wilson's interval for `successes` out of `trials`, at `z` standard deviations (1.96 for 95 %); the whole range 0 to
/// 1 without trials.
///
/// Source: Wilson, Journal of the American Statistical Association 22, 1927.
fn wilson_interval(successes: u64, trials: u64, z: f64) -> (f64, f64) {
    if trials == 0 {
        return (0.0, 1.0);
    }
    let n = trials as f64;
    let p = successes as f64 / n;
    let widening = 1.0 + z * z / n;
    let middle = (p + z * z / (2.0 * n)) / widening;
    let half = z * libm::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / widening;
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// The probability that at least `least` of `draws` independent draws succeed, each with `probability` (within 0 … 1,
/// both excluded).
pub fn binomial_tail(least: u64, draws: u64, probability: f64) -> f64 {
    let odds = libm::log(probability / (1.0 - probability));
    let mut logarithm = draws as f64 * libm::log(1.0 - probability);
    let mut sum = 0.0;
    for k in 0..least.min(draws + 1) {
        sum += libm::exp(logarithm);
        logarithm += libm::log((draws - k) as f64 / (k as f64 + 1.0)) + odds;
    }
    1.0 - sum
}

/// The upper end of the one-sided interval of Clopper and Pearson (1934) for the share of successes, after `count`
/// successes in `of` independent trials. 1 if every trial succeeded or there was none.
pub fn clopper_pearson_upper(count: u64, of: u64, confidence: f64) -> f64 {
    if count >= of {
        return 1.0;
    }
    find_share(|share| binomial_tail(count + 1, of, share), confidence)
}

/// The mean of a Poisson distribution that gives at most `count` events with a probability (within 0 … 1, both
/// excluded), by bisection.
pub fn poisson_mean(count: u64, probability: f64) -> f64 {
    let at_most = |mean: f64| {
        let mut term = libm::exp(-mean);
        let mut sum = term;
        for k in 1..=count {
            term *= mean / k as f64;
            sum += term;
        }
        sum
    };
    let (mut low, mut high) = (0.0, 20.0 + 6.0 * count as f64);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if at_most(middle) > probability { low = middle } else { high = middle }
    }
    high
}

/// Finds the share at which a probability reaches a value, by bisection. The probability must grow with the share.
pub fn find_share(probability: impl Fn(f64) -> f64, value: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match probability(middle) < value {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

/// 95 % interval of the share of trials that hold, each with its cluster. The percentile bootstrap draws whole clusters
/// with replacement, `resamples` times, and the interval holds the middle 95 % of the shares. The order of the trials
/// does not matter.
///
/// If all clusters have the same share (every trial holds, none does, or there is one cluster), resampling cannot show
/// unseen outcomes. The interval is then Wilson's with one trial per cluster, as if the trials of a cluster always
/// agreed. Its ends use the numbers of successes below and above the share. So it is the whole range without clusters,
/// and wide for a single one.
///
/// Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13; drawing
/// clusters: Davison and Hinkley, Bootstrap Methods and their Application, 1997, section 3.8.
fn cluster_interval(
    trials: impl Iterator<Item = (u32, bool)>,
    resamples: usize,
    seed: u64,
) -> (f64, f64) {
    let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for (cluster, holds) in trials {
        let (count, of) = sums.entry(cluster).or_default();
        *count += f64::from(holds);
        *of += 1.0;
    }
    let sums: Vec<(f64, f64)> = sums.into_values().collect();
    let add = |(count, of): (f64, f64), own: &(f64, f64)| (count + own.0, of + own.1);
    let (successes, trials) = sums.iter().fold((0.0, 0.0), add);
    let number = sums.len() as u64;
    if sums.iter().all(|(count, of)| count * trials == successes * of) {
        let whole = if number > 0 { number as f64 * (successes / trials) } else { 0.0 };
        let wilson = |successes: f64| wilson_interval(successes as u64, number, NORMAL_95);
        return (wilson(libm::floor(whole)).0, wilson(libm::ceil(whole)).1);
    }
    let mut random = Random::new(seed);
    let mut resampled = || {
        let drawn = sums.iter().map(|_| &sums[random.index(sums.len())]);
        let (count, of) = drawn.fold((0.0, 0.0), add);
        count / of
    };
    let mut shares: Vec<f64> = (0..resamples).map(|_| resampled()).collect();
    shares.sort_by(f64::total_cmp);
    (quantile(&shares, 0.025), quantile(&shares, 0.975))
}

/// A quantile of ascending values, linearly interpolated.
fn quantile(ascending: &[f64], share: f64) -> f64 {
    let place = share * (ascending.len() - 1) as f64;
    let below = place as usize;
    let above = (below + 1).min(ascending.len() - 1);
    ascending[below] + (place - below as f64) * (ascending[above] - ascending[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn wilson_of_known_values() {
        // Newcombe 1998, table I: 81 of 263, 15 of 148 and 0 of 20 at 95 %.
        let z = NORMAL_95;
        for (successes, trials, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611)]
        {
            let interval = wilson_interval(successes, trials, z);
            assert!((interval.0 - low).abs() < 5e-5 && (interval.1 - high).abs() < 5e-5);
        }
        assert_eq!(wilson_interval(0, 0, z), (0.0, 1.0));
    }

    fn bootstrap(trials: &[(u32, bool)], resamples: usize, seed: u64) -> (f64, f64) {
        cluster_interval(trials.iter().copied(), resamples, seed)
    }

    #[test]
    fn rows_that_agree_within_clusters_count_once() {
        // 100 clusters of 25 rows: independent rows give an interval of 2500 trials. Rows that always agree give one of
        // 100 trials, five times as wide.
        for (together, number) in [(false, 2500), (true, 100)] {
            let mut random = Random::new(5);
            let mut trials = vec![];
            for cluster in 0..100 {
                let common = random.unit();
                let own = (0..25).map(|_| if together { common } else { random.unit() });
                trials.extend(own.map(|own| (cluster, own < 0.8)));
            }
            let share = trials.iter().filter(|trial| trial.1).count() as f64 / 2500.0;
            let (low, high) = bootstrap(&trials, 4000, 1);
            let successes = libm::round(share * number as f64) as u64;
            let expected = wilson_interval(successes, number, NORMAL_95);
            let ratio = (high - low) / (expected.1 - expected.0);
            assert!((0.8..1.25).contains(&ratio), "together {together}: {ratio}");
            assert!(low < share && share < high);
            let back: Vec<(u32, bool)> = trials.iter().rev().copied().collect();
            assert_eq!(bootstrap(&back, 4000, 1), (low, high));
        }
    }

    #[test]
    fn the_interval_holds_the_truth_about_as_often_as_it_says() {
        // 400 experiments of 60 clusters of unequal size, whose own rates scatter around 0.7.
        let mut held = 0;
        for experiment in 0..400 {
            let mut random = Random::stream(9, experiment);
            let mut trials = vec![];
            for cluster in 0..60 {
                let share = random.between(0.4, 1.0);
                for _ in 0..5 + random.index(10) {
                    trials.push((cluster, random.unit() < share));
                }
            }
            let (low, high) = bootstrap(&trials, 300, experiment);
            held += u32::from(low <= 0.7 && 0.7 <= high);
        }
        assert!((360..=395).contains(&held), "{held} of 400");
    }

    #[test]
    fn what_was_never_seen_is_not_excluded() {
        let all = |holds: bool| [3, 3, 8, 8, 1, 1].map(|cluster| (cluster, holds));
        assert_eq!(bootstrap(&all(false), 100, 0), wilson_interval(0, 3, NORMAL_95));
        assert_eq!(bootstrap(&all(true), 100, 0), wilson_interval(3, 3, NORMAL_95));
        assert_eq!(bootstrap(&[], 100, 0), (0.0, 1.0));
        assert_eq!(bootstrap(&[(4, true), (4, false)], 100, 0), (0.0, 1.0));
        // Three clusters, each half right.
        let half = [1, 1, 2, 2, 3, 3].into_iter().zip([true, false].into_iter().cycle());
        let (low, high) = bootstrap(&half.collect::<Vec<_>>(), 100, 0);
        assert!(low < 0.1 && high > 0.9, "{low} to {high}");
    }

    #[test]
    fn an_interval_is_as_wide_as_its_clusters_are_few() {
        let trial =
            |k: u32| Trial { cluster: k / 10, kind: k / 100, holds: !(k / 10).is_multiple_of(3) };
        let trials: Vec<Trial> = (0..400).map(trial).collect();
        let rate = Rate::clustered(&trials);
        let alone = Rate::new(rate.count, rate.of);
        assert!(rate.high - rate.low > 2.0 * (alone.high - alone.low), "{rate:?} {alone:?}");
        assert!(rate.low < 0.67 && rate.high > 0.67);
        // No event in forty clusters is weaker evidence than no event in 400 cases.
        let none = trials.iter().map(|t| Trial { holds: false, ..*t }).collect::<Vec<_>>();
        assert_eq!(Rate::clustered(&none).high, Rate::new(0, 40).high);
        assert_eq!(Rate::new(0, 0).share, None);
    }
}
