//! Scores of predictions.

use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::{Confusion, Rate, Trial};

/// Quality of the predictions for one question.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Share of right predictions.
    pub accuracy: Rate,
    /// Mean recall of the classes that occurred.
    pub balanced_accuracy: Option<f64>,
    /// Names of the classes.
    pub classes: Vec<String>,
    /// `confusion[truth][predicted]`.
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
        let mut confusion = Confusion::new(classes.len());
        let all = splits.iter().flatten();
        all.clone().for_each(|prediction| confusion.count(prediction.truth, prediction.said));
        let right = |split: &Vec<Prediction>| Rate::of(split, Prediction::is_right).share;
        let per_split = splits.iter().map(right).collect();
        let trials: Vec<Trial> = all.map(Prediction::trial).collect();
        Score {
            accuracy: Rate::clustered(&trials),
            balanced_accuracy: confusion.balanced_accuracy(),
            classes,
            confusion: confusion.counts().to_vec(),
            per_split,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn a_missing_prediction_is_wrong() {
        let said = |cluster, truth, said| Prediction { cluster, kind: 0, truth, said };
        let split =
            vec![said(0, 0, Some(0)), said(1, 1, None), said(2, 1, Some(1)), said(3, 1, Some(0))];
        let score = Score::of(vec!["a".into(), "b".into()], &[split]);
        assert_eq!(score.accuracy.share, Some(0.5));
        assert_eq!(score.confusion, [[1, 0], [1, 1]]);
        assert_eq!(score.balanced_accuracy, Some((1.0 + 1.0 / 3.0) / 2.0));
    }
}
