//! Shares with their intervals, and scores of predictions.
//!
//! Rows are not independent: one fault at one intensity is flown in many cases, and neighbouring
//! intensities of one kind are alike. So intervals come from a bootstrap that draws whole clusters
//! (a kind at an intensity), and a wider one from drawing whole kinds ([`cluster_bootstrap`]). Shares
//! of things that are independent have Wilson's interval.

use serde::{Deserialize, Serialize};
use servotwin_diagnosis::evaluation::{cluster_bootstrap, wilson_interval};

/// Standard deviations of a 95 % interval.
const Z_95: f64 = 1.959_963_984_540_054;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 1000;

/// Its seed.
const SEED: u64 = 1;

/// A share of cases with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// How many.
    pub count: u64,
    /// Of how many.
    pub of: u64,
    /// The share; `None` of nothing.
    pub share: Option<f64>,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// The interval with whole kinds of fault as clusters, where there are such.
    pub by_kind: Option<(f64, f64)>,
}

/// One case of a share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Kind of fault and intensity.
    pub cluster: u32,
    /// Kind of fault.
    pub kind: u32,
    /// Whether what is counted happened.
    pub holds: bool,
}

impl Rate {
    /// A share of independent cases.
    pub fn new(count: u64, of: u64) -> Self {
        let (low, high) = wilson_interval(count, of, Z_95);
        let share = (of > 0).then(|| count as f64 / of as f64);
        Rate { count, of, share, low, high, by_kind: None }
    }

    /// A share of cases that hang together in clusters.
    pub fn clustered(trials: &[Trial]) -> Self {
        let count = trials.iter().filter(|trial| trial.holds).count() as u64;
        let plain = Rate::new(count, trials.len() as u64);
        let (low, high) = interval(trials, |trial| trial.cluster);
        Rate { low, high, by_kind: Some(interval(trials, |trial| trial.kind)), ..plain }
    }

    /// The share of a test that holds.
    pub fn of<T>(items: &[T], holds: impl Fn(&T) -> bool) -> Self {
        let count = items.iter().filter(|item| holds(item)).count();
        Rate::new(count as u64, items.len() as u64)
    }
}

fn interval(trials: &[Trial], cluster: impl Fn(&Trial) -> u32) -> (f64, f64) {
    let clusters: Vec<u32> = trials.iter().map(cluster).collect();
    let holds: Vec<f64> = trials.iter().map(|t| f64::from(u8::from(t.holds))).collect();
    cluster_bootstrap(&clusters, &holds, &vec![1.0; trials.len()], RESAMPLES, SEED)
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

/// One prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Rows that hang together.
    pub cluster: u32,
    /// Clusters that hang together.
    pub kind: u32,
    /// The class.
    pub truth: u32,
    /// The class predicted, if any.
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
    /// The score of predictions, split by split.
    pub fn of(classes: Vec<String>, splits: &[Vec<Prediction>]) -> Self {
        let mut confusion = vec![vec![0; classes.len()]; classes.len()];
        for prediction in splits.iter().flatten() {
            if let Some(said) = prediction.said {
                confusion[prediction.truth as usize][said as usize] += 1;
            }
        }
        let right = |split: &[Prediction]| split.iter().filter(|p| p.is_right()).count() as u64;
        let all: Vec<Prediction> = splits.iter().flatten().copied().collect();
        let per_split =
            splits.iter().map(|split| Rate::new(right(split), split.len() as u64).share);
        Score {
            accuracy: Rate::clustered(&all.iter().map(Prediction::trial).collect::<Vec<_>>()),
            balanced_accuracy: balanced(&all, classes.len()),
            confusion,
            per_split: per_split.collect(),
            classes,
        }
    }
}

fn balanced(predictions: &[Prediction], classes: usize) -> Option<f64> {
    let mut seen = vec![(0u64, 0u64); classes];
    for prediction in predictions {
        let (right, all) = &mut seen[prediction.truth as usize];
        *all += 1;
        *right += u64::from(prediction.is_right());
    }
    seen.retain(|(_, all)| *all > 0);
    let recalls = seen.iter().map(|&(right, all)| right as f64 / all as f64);
    (!seen.is_empty()).then(|| recalls.sum::<f64>() / seen.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_as_wide_as_its_clusters_are_few() {
        let trial =
            |k: u32| Trial { cluster: k / 10, kind: k / 100, holds: !(k / 10).is_multiple_of(3) };
        let trials: Vec<Trial> = (0..400).map(trial).collect();
        let rate = Rate::clustered(&trials);
        let alone = Rate::new(rate.count, rate.of);
        assert!(rate.high - rate.low > 2.0 * (alone.high - alone.low), "{rate:?} {alone:?}");
        assert!(rate.low < 0.67 && rate.high > 0.67);
        // Nothing seen in forty clusters is not nothing seen in 400 cases.
        let none = trials.iter().map(|t| Trial { holds: false, ..*t }).collect::<Vec<_>>();
        assert_eq!(Rate::clustered(&none).high, Rate::new(0, 40).high);
        assert_eq!(Rate::new(0, 0).share, None);
    }

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
