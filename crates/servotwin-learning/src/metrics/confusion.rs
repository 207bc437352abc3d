//! Counts of right and wrong predictions.

use alloc::vec;
use alloc::vec::Vec;

use servotwin_diagnosis::error::{Error, same_length};

/// Counts of (true class, predicted class), and of rows without a prediction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confusion {
    /// `counts[truth][predicted]`.
    counts: Vec<Vec<u64>>,
    /// Rows of each true class without a prediction.
    missing: Vec<u64>,
}

impl Confusion {
    /// An empty table.
    pub(crate) fn new(classes: usize) -> Self {
        Confusion { counts: vec![vec![0; classes]; classes], missing: vec![0; classes] }
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
            confusion.count(truth, Some(predicted));
        }
        Ok(confusion)
    }

    /// Counts one row.
    ///
    /// # Panics
    /// If there is no such class.
    pub(crate) fn count(&mut self, truth: u32, predicted: Option<u32>) {
        match predicted {
            Some(predicted) => self.counts[truth as usize][predicted as usize] += 1,
            None => self.missing[truth as usize] += 1,
        }
    }

    /// `counts[truth][predicted]`, without the rows that have no prediction.
    pub(crate) fn counts(&self) -> &[Vec<u64>] {
        &self.counts
    }

    /// Number of rows.
    pub(crate) fn total(&self) -> u64 {
        self.counts.iter().flatten().chain(&self.missing).sum()
    }

    /// Share of right predictions; `None` without rows.
    pub fn accuracy(&self) -> Option<f64> {
        share((0..self.counts.len()).map(|class| self.counts[class][class]).sum(), self.total())
    }

    /// Share of a class that was predicted as such; `None` if the class did not occur.
    pub(crate) fn recall(&self, class: usize) -> Option<f64> {
        let occurred = self.counts[class].iter().sum::<u64>() + self.missing[class];
        share(self.counts[class][class], occurred)
    }

    /// Mean recall of the classes that occurred; `None` without rows.
    pub(crate) fn balanced_accuracy(&self) -> Option<f64> {
        let recalls: Vec<f64> =
            (0..self.counts.len()).filter_map(|class| self.recall(class)).collect();
        (!recalls.is_empty()).then(|| recalls.iter().sum::<f64>() / recalls.len() as f64)
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_of_a_small_table() {
        let table = Confusion::of(3, &[0, 0, 0, 1, 1], &[0, 0, 1, 1, 1]).unwrap();
        assert_eq!(table.accuracy(), Some(0.8));
        assert_eq!(table.recall(0), Some(2.0 / 3.0));
        assert_eq!(table.recall(2), None);
        assert_eq!(table.balanced_accuracy(), Some((2.0 / 3.0 + 1.0) / 2.0));
        assert_eq!(Confusion::new(2).accuracy(), None);
    }
}
