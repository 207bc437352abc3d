//! Splits of samples into training and test rows.
//!
//! Every split depends on an explicit seed and lists rows in ascending order.

use alloc::vec;
use alloc::vec::Vec;
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::random::Random;

/// Share of test rows in the seed paper.
pub const HELD_OUT: f64 = 1.0 / 3.0;

/// Training and test rows; no row is in both.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// Training rows, ascending.
    pub train: Vec<usize>,
    /// Test rows, ascending.
    pub test: Vec<usize>,
}

impl Split {
    fn by(rows: usize, is_test: impl Fn(usize) -> bool) -> Self {
        let (test, train) = (0..rows).partition(|&row| is_test(row));
        Split { train, test }
    }
}

/// Holds out a random share of the rows, rounded to the nearest row, with at least one row on each side.
fn hold_out(rows: usize, held_out: f64, seed: u64) -> Result<Split, Error> {
    require(held_out > 0.0 && held_out < 1.0, "held_out", held_out, "between 0 and 1")?;
    enough(2, rows)?;
    let count = (libm::round(rows as f64 * held_out) as usize).clamp(1, rows - 1);
    let mut order: Vec<usize> = (0..rows).collect();
    Random::new(seed).shuffle(&mut order);
    let mut is_test = vec![false; rows];
    order[..count].iter().for_each(|&row| is_test[row] = true);
    Ok(Split::by(rows, |row| is_test[row]))
}

/// Several independent splits that hold out a random share of the rows, with at least one row on each side.
///
/// # Errors
/// [`Error::SettingOutOfRange`] unless `0 < held_out < 1`; [`Error::TooFewForFolds`] for fewer than two rows.
pub fn repeated_hold_out(
    rows: usize,
    held_out: f64,
    repeats: usize,
    seed: u64,
) -> Result<Vec<Split>, Error> {
    let mut seeds = Random::new(seed);
    (0..repeats).map(|_| hold_out(rows, held_out, seeds.next_u64())).collect()
}

/// Folds in which all rows of a group (an operating case, a fault variant) stay together. The largest groups come
/// first, each into the smallest fold.
///
/// # Errors
/// [`Error::TooFewForFolds`] unless there are at least 2 folds and as many groups as folds.
pub fn grouped_k_fold(groups: &[u32], folds: usize, seed: u64) -> Result<Vec<Split>, Error> {
    let mut names = distinct(groups);
    enough_folds(folds, names.len())?;
    let size = |name: u32| groups.iter().filter(|&&group| group == name).count();
    Random::new(seed).shuffle(&mut names);
    let mut sized: Vec<(usize, u32)> = names.iter().map(|&name| (size(name), name)).collect();
    // Stable: groups of the same size stay shuffled.
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

/// One split for each group, in ascending order: the group is for testing, all others for training.
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
