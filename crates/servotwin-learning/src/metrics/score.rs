//! Scores of predictions.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::{Rate, Trial};

/// Quality of the predictions for one question.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Share of right predictions, with an interval over clusters.
    pub accuracy: Rate,
    /// Names of the classes.
    pub classes: Vec<String>,
    /// `confusion[truth][predicted]`, without the rows that have no prediction.
    pub confusion: Vec<Vec<u64>>,
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

impl Score {
    /// The score of predictions.
    pub fn of(classes: Vec<String>, predictions: &[Prediction]) -> Self {
        let mut confusion = vec![vec![0; classes.len()]; classes.len()];
        for &Prediction { truth, said, .. } in predictions {
            said.iter().for_each(|&said| confusion[truth as usize][said as usize] += 1);
        }
        let trial = |&Prediction { cluster, kind, truth, said }: &Prediction| Trial {
            cluster,
            kind,
            holds: said == Some(truth),
        };
        let trials: Vec<Trial> = predictions.iter().map(trial).collect();
        Score { accuracy: Rate::clustered(&trials), classes, confusion }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_prediction_is_wrong() {
        let said = |cluster, truth, said| Prediction { cluster, kind: 0, truth, said };
        let all = [said(0, 0, Some(0)), said(1, 1, None), said(2, 1, Some(1)), said(3, 1, Some(0))];
        let score = Score::of(vec!["a".into(), "b".into()], &all);
        assert_eq!(score.accuracy.share, Some(0.5));
        assert_eq!(score.confusion, [[1, 0], [1, 1]]);
    }
}
