//! Scores of predictions.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::{Rate, Trial};

/// Quality of the predictions for one question.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Share of right predictions.
    pub accuracy: Rate,
    /// Mean recall of the classes that occurred.
    pub balanced_accuracy: Option<f64>,
    /// Names of the classes.
    pub classes: Vec<String>,
    /// `confusion[truth][predicted]`, without the rows that have no prediction.
    pub confusion: Vec<Vec<u64>>,
    /// Share of right predictions in each split.
    pub per_split: Vec<Option<f64>>,
}

/// One prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Cluster of dependent rows.
    pub cluster: u32,
    /// Group of dependent clusters.
    pub kind: u32,
    /// The true class.
    pub truth: u32,
    /// The predicted class, if any.
    pub said: Option<u32>,
}

impl Prediction {
    fn is_right(&self) -> bool {
        self.said == Some(self.truth)
    }

    fn trial(&self) -> Trial {
        Trial { cluster: self.cluster, kind: self.kind, holds: self.is_right() }
    }
}

impl Score {
    /// The score of predictions, split by split, with an interval over clusters.
    pub fn of(classes: Vec<String>, splits: &[Vec<Prediction>]) -> Self {
        let mut confusion = vec![vec![0; classes.len()]; classes.len()];
        let mut occurred = vec![0_u64; classes.len()];
        let all = splits.iter().flatten();
        for &Prediction { truth, said, .. } in all.clone() {
            occurred[truth as usize] += 1;
            said.iter().for_each(|&said| confusion[truth as usize][said as usize] += 1);
        }
        let recall = |class: usize| confusion[class][class] as f64 / occurred[class] as f64;
        let there = (0..classes.len()).filter(|&class| occurred[class] > 0);
        let recalls: Vec<f64> = there.map(recall).collect();
        let balanced = recalls.iter().sum::<f64>() / recalls.len() as f64;
        let right = |split: &Vec<Prediction>| Rate::of(split, Prediction::is_right).share;
        let per_split = splits.iter().map(right).collect();
        let trials: Vec<Trial> = all.map(Prediction::trial).collect();
        Score {
            accuracy: Rate::clustered(&trials),
            balanced_accuracy: (!recalls.is_empty()).then_some(balanced),
            classes,
            confusion,
            per_split,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_prediction_is_wrong() {
        let said = |cluster, truth, said| Prediction { cluster, kind: 0, truth, said };
        let split =
            vec![said(0, 0, Some(0)), said(1, 1, None), said(2, 1, Some(1)), said(3, 1, Some(0))];
        let score = Score::of(vec!["a".into(), "b".into()], &[split]);
        assert_eq!(score.accuracy.share, Some(0.5));
        assert_eq!(score.confusion, [[1, 0], [1, 1]]);
        assert_eq!(score.balanced_accuracy, Some((1.0 + 1.0 / 3.0) / 2.0));
        assert_eq!(Score::of(vec!["a".into()], &[]).balanced_accuracy, None);
    }
}
