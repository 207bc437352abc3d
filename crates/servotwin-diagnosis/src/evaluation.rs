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
        let z = 1.959_963_984_540_054;
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
}
