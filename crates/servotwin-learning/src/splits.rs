//! Splits of samples into training and test rows.
//!
//! Every split depends on an explicit seed and lists rows in ascending order.

use alloc::vec;
use alloc::vec::Vec;
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::random::Random;

/// Share of test rows in the seed paper.
const HELD_OUT: f64 = 1.0 / 3.0;

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

/// Several independent splits that hold out a random third of the groups, rounded, with at least one on each side.
///
/// # Errors
/// [`Error::TooFewForFolds`] for fewer than two groups.
pub fn random_thirds(groups: &[u32], repeats: usize, seed: u64) -> Result<Vec<Split>, Error> {
    let names = distinct(groups);
    enough(2, names.len())?;
    let count = (libm::round(names.len() as f64 * HELD_OUT) as usize).clamp(1, names.len() - 1);
    let mut seeds = Random::new(seed);
    let one = |_| {
        let mut order = names.clone();
        Random::new(seeds.next_u64()).shuffle(&mut order);
        order.truncate(count);
        order.sort_unstable();
        Split::by(groups.len(), |row| order.binary_search(&groups[row]).is_ok())
    };
    Ok((0..repeats).map(one).collect())
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
