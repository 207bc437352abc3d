//! How good a classifier is: splits of the samples, and scores of its predictions.
//!
//! All splits are made from explicit seeds and list rows in ascending order.

use alloc::vec;
use alloc::vec::Vec;

use crate::classifiers::{Fit, Settings};
use crate::data::Samples;
use crate::error::{Error, require, same_length};
use crate::random::Random;

/// The share of rows that the seed paper holds out for testing.
pub const HELD_OUT: f64 = 1.0 / 3.0;

/// Rows to train with and rows to test with; none is in both.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// Rows to train with, ascending.
    pub train: Vec<usize>,
    /// Rows to test with, ascending.
    pub test: Vec<usize>,
}

impl Split {
    fn by(rows: usize, is_test: impl Fn(usize) -> bool) -> Self {
        let (test, train) = (0..rows).partition(|&row| is_test(row));
        Split { train, test }
    }
}

/// Holds out a random share of the rows, rounded to the nearest row but leaving one on each side.
///
/// # Errors
/// [`Error::SettingOutOfRange`] unless `0 < held_out < 1`; [`Error::TooFewForFolds`] for fewer
/// than two rows.
pub fn hold_out(rows: usize, held_out: f64, seed: u64) -> Result<Split, Error> {
    require(held_out > 0.0 && held_out < 1.0, "held_out", held_out, "between 0 and 1")?;
    enough(2, rows)?;
    let count = (libm::round(rows as f64 * held_out) as usize).clamp(1, rows - 1);
    let mut order: Vec<usize> = (0..rows).collect();
    Random::new(seed).shuffle(&mut order);
    let mut is_test = vec![false; rows];
    order[..count].iter().for_each(|&row| is_test[row] = true);
    Ok(Split::by(rows, |row| is_test[row]))
}

/// Several independent [`hold_out`] splits.
///
/// # Errors
/// As [`hold_out`].
pub fn repeated_hold_out(
    rows: usize,
    held_out: f64,
    repeats: usize,
    seed: u64,
) -> Result<Vec<Split>, Error> {
    let mut seeds = Random::new(seed);
    (0..repeats).map(|_| hold_out(rows, held_out, seeds.next_u64())).collect()
}

/// Folds in which every class has nearly the same share: counts differ by one at most, for each
/// class and for the whole fold.
///
/// # Errors
/// [`Error::TooFewForFolds`] unless there are at least 2 folds and as many rows as folds.
pub fn stratified_k_fold(labels: &[u32], folds: usize, seed: u64) -> Result<Vec<Split>, Error> {
    enough_folds(folds, labels.len())?;
    let mut order: Vec<usize> = (0..labels.len()).collect();
    Random::new(seed).shuffle(&mut order);
    order.sort_by_key(|&row| labels[row]);
    let mut fold_of = vec![0; labels.len()];
    // Dealt out like cards, class after class, so that the rest of one class and the beginning of
    // the next share a round.
    for (place, &row) in order.iter().enumerate() {
        fold_of[row] = place % folds;
    }
    Ok(splits(&fold_of, folds))
}

/// Folds in which all rows of a group (an operating case, a fault variant) stay together; the
/// largest groups are placed first, each into the smallest fold.
///
/// # Errors
/// [`Error::TooFewForFolds`] unless there are at least 2 folds and as many groups as folds.
pub fn grouped_k_fold(groups: &[u32], folds: usize, seed: u64) -> Result<Vec<Split>, Error> {
    let mut names = distinct(groups);
    enough_folds(folds, names.len())?;
    let size = |name: u32| groups.iter().filter(|&&group| group == name).count();
    Random::new(seed).shuffle(&mut names);
    let mut sized: Vec<(usize, u32)> = names.iter().map(|&name| (size(name), name)).collect();
    // Stable: groups of one size stay shuffled.
    sized.sort_by_key(|&(size, _)| core::cmp::Reverse(size));
    let mut fold_sizes = vec![0; folds];
    let mut fold_of = vec![0; groups.len()];
    for (size, name) in sized {
        let smallest = (0..folds).min_by_key(|&fold| fold_sizes[fold]).unwrap_or(0);
        fold_sizes[smallest] += size;
        for (fold, _) in fold_of.iter_mut().zip(groups).filter(|(_, group)| **group == name) {
            *fold = smallest;
        }
    }
    Ok(splits(&fold_of, folds))
}

/// One split for each group, in ascending order: test with the group, train with all others.
///
/// # Errors
/// [`Error::TooFewForFolds`] for fewer than two groups.
pub fn leave_one_group_out(groups: &[u32]) -> Result<Vec<Split>, Error> {
    let names = distinct(groups);
    enough(2, names.len())?;
    Ok(names.iter().map(|&name| Split::by(groups.len(), |row| groups[row] == name)).collect())
}

fn distinct(groups: &[u32]) -> Vec<u32> {
    let mut names = groups.to_vec();
    names.sort_unstable();
    names.dedup();
    names
}

fn splits(fold_of: &[usize], folds: usize) -> Vec<Split> {
    (0..folds).map(|fold| Split::by(fold_of.len(), |row| fold_of[row] == fold)).collect()
}

fn enough(folds: usize, available: usize) -> Result<(), Error> {
    if available >= folds { Ok(()) } else { Err(Error::TooFewForFolds { folds, available }) }
}

fn enough_folds(folds: usize, available: usize) -> Result<(), Error> {
    require(folds >= 2, "folds", folds as f64, ">= 2")?;
    enough(folds, available)
}

/// Counts of (true class, predicted class).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confusion {
    classes: usize,
    /// Row-major by true class.
    counts: Vec<u64>,
}

impl Confusion {
    /// An empty table.
    pub fn new(classes: usize) -> Self {
        Confusion { classes, counts: vec![0; classes * classes] }
    }

    /// The table of some predictions.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::LabelOutOfRange`].
    pub fn of(classes: usize, truth: &[u32], predicted: &[u32]) -> Result<Self, Error> {
        same_length("predictions", truth.len(), predicted.len())?;
        let mut confusion = Confusion::new(classes);
        for (row, (&truth, &predicted)) in truth.iter().zip(predicted).enumerate() {
            let label = truth.max(predicted);
            if label as usize >= classes {
                return Err(Error::LabelOutOfRange { row, label, classes });
            }
            confusion.counts[truth as usize * classes + predicted as usize] += 1;
        }
        Ok(confusion)
    }

    /// Adds the counts of another table.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] if it has another number of classes.
    pub fn add(&mut self, other: &Confusion) -> Result<(), Error> {
        same_length("classes", self.classes, other.classes)?;
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, count)| *sum += count);
        Ok(())
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// How often `truth` was predicted as `predicted`.
    ///
    /// # Panics
    /// If a class is not below [`Confusion::classes`].
    pub fn count(&self, truth: usize, predicted: usize) -> u64 {
        assert!(predicted < self.classes, "class {predicted} of {}", self.classes);
        self.counts[truth * self.classes + predicted]
    }

    /// Number of predictions.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Number of right predictions.
    pub fn correct(&self) -> u64 {
        (0..self.classes).map(|class| self.count(class, class)).sum()
    }

    /// Share of right predictions; `None` without predictions.
    pub fn accuracy(&self) -> Option<f64> {
        share(self.correct(), self.total())
    }

    /// Share of a class that was predicted as such; `None` if the class did not occur.
    pub fn recall(&self, class: usize) -> Option<f64> {
        let occurred = (0..self.classes).map(|predicted| self.count(class, predicted)).sum();
        share(self.count(class, class), occurred)
    }

    /// Share of the predictions of a class that were right; `None` if it was never predicted.
    pub fn precision(&self, class: usize) -> Option<f64> {
        let predicted = (0..self.classes).map(|truth| self.count(truth, class)).sum();
        share(self.count(class, class), predicted)
    }

    /// Mean recall of the classes that occurred; `None` without predictions.
    pub fn balanced_accuracy(&self) -> Option<f64> {
        let recalls: Vec<f64> = (0..self.classes).filter_map(|class| self.recall(class)).collect();
        (!recalls.is_empty()).then(|| recalls.iter().sum::<f64>() / recalls.len() as f64)
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// Wilson's interval for a share of which `successes` out of `trials` were seen, at `z` standard
/// deviations (1.96 for 95 %); the whole range 0 to 1 without trials.
///
/// Source: Wilson, Journal of the American Statistical Association 22, 1927.
pub fn wilson_interval(successes: u64, trials: u64, z: f64) -> (f64, f64) {
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

/// 95 % interval of a share `Σ count / Σ of` whose rows come in clusters that are not independent:
/// whole clusters are drawn again with replacement, `resamples` times, and the interval holds the
/// middle 95 % of the shares (percentile bootstrap). Row `i` belongs to `clusters[i]`, brings
/// `count[i]` successes of `of[i]` trials. The same numbers and seed give the same bits; the order of
/// the rows does not matter where sums are exact.
///
/// Clusters without trials are left out, for they say nothing. Where all clusters have one share (every
/// trial succeeded, none did, or there is one cluster only) drawing again cannot show what was never seen:
/// the interval is then Wilson's, with a trial per cluster, as it would be if the rows of a cluster stood or
/// fell together, of the numbers of successes on both sides of the share. So it is the whole range without
/// clusters, and wide for a single one.
///
/// Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13; drawing
/// clusters: Davison and Hinkley, Bootstrap Methods and their Application, 1997, section 3.8.
///
/// # Panics
/// Unless `clusters`, `count` and `of` have one length.
pub fn cluster_bootstrap(
    clusters: &[u32],
    count: &[f64],
    of: &[f64],
    resamples: usize,
    seed: u64,
) -> (f64, f64) {
    assert!(clusters.len() == count.len() && count.len() == of.len(), "one entry per row");
    let sums = cluster_sums(clusters, count, of);
    let (successes, trials) =
        sums.iter().fold((0.0, 0.0), |(count, of), cluster| (count + cluster.0, of + cluster.1));
    let number = sums.len() as u64;
    if sums.iter().all(|(count, of)| count * trials == successes * of) {
        let whole = if number > 0 { number as f64 * (successes / trials) } else { 0.0 };
        let wilson = |successes: f64| wilson_interval(successes as u64, number, NORMAL_95);
        return (wilson(libm::floor(whole)).0, wilson(libm::ceil(whole)).1);
    }
    if resamples == 0 {
        return (0.0, 1.0);
    }
    let mut random = Random::new(seed);
    let mut resampled = || {
        let drawn = sums.iter().map(|_| sums[random.index(sums.len())]);
        let (count, of) = drawn.fold((0.0, 0.0), |(c, o), (count, of)| (c + count, o + of));
        count / of
    };
    let mut shares: Vec<f64> = (0..resamples).map(|_| resampled()).collect();
    shares.sort_by(f64::total_cmp);
    (quantile(&shares, 0.025), quantile(&shares, 0.975))
}

/// Standard deviations of a normal distribution that hold 95 % of it.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// The sums of every cluster that has trials, in ascending order of the clusters.
fn cluster_sums(clusters: &[u32], count: &[f64], of: &[f64]) -> Vec<(f64, f64)> {
    let mut sums = alloc::collections::BTreeMap::new();
    for ((&cluster, &count), &of) in clusters.iter().zip(count).zip(of) {
        let sum: &mut (f64, f64) = sums.entry(cluster).or_default();
        *sum = (sum.0 + count, sum.1 + of);
    }
    sums.into_values().filter(|(_, of)| *of > 0.0).collect()
}

/// A quantile of ascending values, between two of them linearly.
fn quantile(ascending: &[f64], share: f64) -> f64 {
    let place = share * (ascending.len() - 1) as f64;
    let below = place as usize;
    let above = (below + 1).min(ascending.len() - 1);
    ascending[below] + (place - below as f64) * (ascending[above] - ascending[below])
}

/// Trains on each split's training rows and counts the predictions of its test rows, one table
/// per split.
///
/// # Errors
/// What training says, and [`Error::IndexOutOfRange`] for splits of other samples.
pub fn cross_validate(
    settings: &Settings,
    samples: &Samples,
    splits: &[Split],
) -> Result<Vec<Confusion>, Error> {
    let one = |split: &Split| {
        let model = settings.fit(&samples.select_rows(&split.train)?)?;
        let test = samples.select_rows(&split.test)?;
        Confusion::of(samples.classes(), test.labels(), &model.predict(&test)?)
    };
    splits.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn scores_of_a_small_table() {
        let table = Confusion::of(3, &[0, 0, 0, 1, 1], &[0, 0, 1, 1, 1]).unwrap();
        assert_eq!(table.accuracy(), Some(0.8));
        assert_eq!(table.recall(0), Some(2.0 / 3.0));
        assert_eq!(table.recall(2), None);
        assert_eq!(table.precision(1), Some(2.0 / 3.0));
        assert_eq!(table.precision(2), None);
        assert_eq!(table.balanced_accuracy(), Some((2.0 / 3.0 + 1.0) / 2.0));
        assert_eq!(Confusion::new(2).accuracy(), None);
    }

    /// Rows in clusters of `size`, a share `share` of which succeed; `together` makes all rows of a
    /// cluster agree.
    fn clustered(number: u32, size: u32, share: f64, together: bool) -> (Vec<u32>, Vec<f64>) {
        let mut random = Random::new(5);
        let mut rows = (vec![], vec![]);
        for cluster in 0..number {
            let common = random.unit();
            for _ in 0..size {
                let own = random.unit();
                rows.0.push(cluster);
                rows.1.push(f64::from((if together { common } else { own }) < share));
            }
        }
        rows
    }

    #[test]
    fn rows_that_agree_within_clusters_count_once() {
        // 100 clusters of 25 rows: independent rows make an interval of 2500 trials, rows that
        // stand and fall together one of 100 trials, five times as wide.
        for (together, trials) in [(false, 2500), (true, 100)] {
            let (clusters, count) = clustered(100, 25, 0.8, together);
            let of = vec![1.0; count.len()];
            let share = count.iter().sum::<f64>() / count.len() as f64;
            let (low, high) = cluster_bootstrap(&clusters, &count, &of, 4000, 1);
            let successes = libm::round(share * trials as f64) as u64;
            let expected = wilson_interval(successes, trials, NORMAL_95);
            let ratio = (high - low) / (expected.1 - expected.0);
            assert!((0.8..1.25).contains(&ratio), "together {together}: {ratio}");
            assert!(low < share && share < high);
        }
    }

    #[test]
    fn the_interval_holds_the_truth_about_as_often_as_it_says() {
        // 400 experiments of 60 clusters of unequal size whose own shares scatter around 0.7.
        let mut held = 0;
        for experiment in 0..400 {
            let mut random = Random::stream(9, experiment);
            let (mut clusters, mut count, mut of) = (vec![], vec![], vec![]);
            for cluster in 0..60 {
                let share = random.between(0.4, 1.0);
                for _ in 0..5 + random.index(10) {
                    clusters.push(cluster);
                    count.push(f64::from(random.unit() < share));
                    of.push(1.0);
                }
            }
            let (low, high) = cluster_bootstrap(&clusters, &count, &of, 300, experiment);
            held += u32::from(low <= 0.7 && 0.7 <= high);
        }
        assert!((360..=395).contains(&held), "{held} of 400");
    }

    #[test]
    fn what_was_never_seen_is_not_excluded() {
        let clusters = [3, 3, 8, 8, 1, 1, 7];
        let of = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0];
        assert_eq!(
            cluster_bootstrap(&clusters, &[0.0; 7], &of, 100, 0),
            wilson_interval(0, 3, NORMAL_95)
        );
        assert_eq!(
            cluster_bootstrap(&clusters, &of, &of, 100, 0),
            wilson_interval(3, 3, NORMAL_95)
        );
        assert_eq!(cluster_bootstrap(&[], &[], &[], 100, 0), (0.0, 1.0));
        assert_eq!(cluster_bootstrap(&[4, 4], &[1.0, 0.0], &[1.0, 1.0], 100, 0), (0.0, 1.0));
        // Three clusters that are all half right.
        let half = [1.0, 0.0, 1.0, 0.0, 1.0, 0.0];
        let (low, high) = cluster_bootstrap(&[1, 1, 2, 2, 3, 3], &half, &[1.0; 6], 100, 0);
        assert!(low < 0.1 && high > 0.9, "{low} to {high}");
    }

    #[test]
    fn the_order_of_rows_does_not_matter_but_the_seed_does() {
        let (clusters, mut count) = clustered(20, 3, 0.6, true);
        // Shares that hardly ever coincide.
        (0..count.len()).for_each(|row| count[row] *= 1.0 - row as f64 / 256.0);
        let of = vec![1.0; count.len()];
        let there = cluster_bootstrap(&clusters, &count, &of, 500, 2);
        let reversed = |list: &[f64]| list.iter().rev().copied().collect::<Vec<f64>>();
        let back: Vec<u32> = clusters.iter().rev().copied().collect();
        assert_eq!(cluster_bootstrap(&back, &reversed(&count), &of, 500, 2), there);
        assert_ne!(cluster_bootstrap(&clusters, &count, &of, 500, 3), there);
    }
}
