//! Shares with their intervals, and scores of predictions.
//!
//! Wilson's interval supposes independent trials. Where a row was tested several times (repeated
//! splits), the trials are taken to be as many as there are different rows.

use serde::{Deserialize, Serialize};
use servotwin_diagnosis::evaluation::wilson_interval;

/// Standard deviations of a 95 % interval.
const Z_95: f64 = 1.959_963_984_540_054;

/// A share of cases with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// How many.
    pub count: u64,
    /// Of how many.
    pub of: u64,
    /// The share; `None` of nothing.
    pub share: Option<f64>,
    /// Lower end of Wilson's interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Rate {
    /// A share of independent cases.
    pub fn new(count: u64, of: u64) -> Self {
        Rate::repeated(count, of, of)
    }

    /// A share of cases of which only `independent` are different.
    pub fn repeated(count: u64, of: u64, independent: u64) -> Self {
        let share = (of > 0).then(|| count as f64 / of as f64);
        let trials = independent.min(of);
        let successes = (share.unwrap_or(0.0) * trials as f64).round() as u64;
        let (low, high) = wilson_interval(successes, trials, Z_95);
        Rate { count, of, share, low, high }
    }

    /// The share of a test that holds.
    pub fn of<T>(items: &[T], holds: impl Fn(&T) -> bool) -> Self {
        let count = items.iter().filter(|item| holds(item)).count();
        Rate::new(count as u64, items.len() as u64)
    }
}

/// How good predictions of one question were.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Share of right predictions.
    pub accuracy: Rate,
    /// Mean recall of the classes that occurred.
    pub balanced_accuracy: Option<f64>,
    /// The classes.
    pub classes: Vec<String>,
    /// `confusion[truth][predicted]`.
    pub confusion: Vec<Vec<u64>>,
    /// Share of right predictions in each split.
    pub per_split: Vec<Option<f64>>,
}

/// One prediction: the row, its class and the class predicted, if any.
pub type Prediction = (usize, u32, Option<u32>);

impl Score {
    /// The score of predictions, split by split.
    pub fn of(classes: Vec<String>, splits: &[Vec<Prediction>]) -> Self {
        let mut confusion = vec![vec![0; classes.len()]; classes.len()];
        for &(_, truth, predicted) in splits.iter().flatten() {
            if let Some(predicted) = predicted {
                confusion[truth as usize][predicted as usize] += 1;
            }
        }
        let right = |split: &[Prediction]| {
            split.iter().filter(|(_, truth, predicted)| Some(*truth) == *predicted).count() as u64
        };
        let all: Vec<Prediction> = splits.iter().flatten().copied().collect();
        let per_split =
            splits.iter().map(|split| Rate::new(right(split), split.len() as u64).share);
        Score {
            accuracy: Rate::repeated(right(&all), all.len() as u64, different_rows(&all)),
            balanced_accuracy: balanced(&all, classes.len()),
            confusion,
            per_split: per_split.collect(),
            classes,
        }
    }
}

fn different_rows(predictions: &[Prediction]) -> u64 {
    let mut rows: Vec<usize> = predictions.iter().map(|(row, _, _)| *row).collect();
    rows.sort_unstable();
    rows.dedup();
    rows.len() as u64
}

fn balanced(predictions: &[Prediction], classes: usize) -> Option<f64> {
    let mut seen = vec![(0u64, 0u64); classes];
    for &(_, truth, predicted) in predictions {
        let (right, all) = &mut seen[truth as usize];
        *all += 1;
        *right += u64::from(predicted == Some(truth));
    }
    seen.retain(|(_, all)| *all > 0);
    let recalls = seen.iter().map(|&(right, all)| right as f64 / all as f64);
    (!seen.is_empty()).then(|| recalls.sum::<f64>() / seen.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_rows_do_not_narrow_the_interval() {
        let once = Rate::new(90, 100);
        let often = Rate::repeated(900, 1000, 100);
        assert_eq!((once.low, once.high), (often.low, often.high));
        assert_eq!(Rate::new(0, 0).share, None);
    }

    #[test]
    fn a_missing_prediction_is_wrong() {
        let split = vec![(0, 0, Some(0)), (1, 1, None), (2, 1, Some(1)), (3, 1, Some(0))];
        let score = Score::of(vec!["a".into(), "b".into()], &[split]);
        assert_eq!(score.accuracy.share, Some(0.5));
        assert_eq!(score.confusion, [[1, 0], [1, 1]]);
        assert_eq!(score.balanced_accuracy, Some((1.0 + 1.0 / 3.0) / 2.0));
    }
}
