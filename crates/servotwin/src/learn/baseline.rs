//! The seed paper's trees as the paper describes them: its family of features, CART with Gini of depth 7, each actuator
//! by itself, no mirror images.
//!
//! The paper reports one random third. One third shows little, so the test is repeated with other thirds.

use super::protocol::{self, Holding, Protocol, ProtocolResult};
use super::{DataSet, EvaluationError, EvaluationSettings, Training};
use crate::parallel::{self, Workers};
use crate::records::DataFeature;
use serde::{Deserialize, Serialize};

/// The paper's family of features.
const FAMILY: &str = "moments";

/// Number of random thirds.
const REPEATS: u64 = 30;

/// The accuracies of a stage in the paper's test, one for each random third.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RandomThirds {
    /// The stage: `A` or `B`.
    pub stage: String,
    /// Shares from 0 to 1.
    pub accuracies: Vec<f64>,
}

impl RandomThirds {
    /// The mean.
    pub fn mean(&self) -> f64 {
        self.accuracies.iter().sum::<f64>() / self.accuracies.len() as f64
    }

    /// The standard deviation over thirds.
    pub fn deviation(&self) -> f64 {
        let mean = self.mean();
        let squares = self.accuracies.iter().map(|share| (share - mean).powi(2)).sum::<f64>();
        (squares / (self.accuracies.len() as f64 - 1.0)).sqrt()
    }

    /// How many thirds have a lower accuracy.
    pub fn below(&self, accuracy: f64) -> usize {
        self.accuracies.iter().filter(|share| **share < accuracy).count()
    }
}

/// The data with the paper's features, and how its trees are trained; `None` where the data lacks the features.
fn prepared(data: &DataSet) -> Result<Option<(DataSet, Training)>, EvaluationError> {
    let family = |feature: &DataFeature| feature.family == FAMILY;
    if !data.features.iter().any(family) {
        return Ok(None);
    }
    let training = Training { mirror: false, pool: false, ..Training::default() };
    Ok(Some((data.with_features(family)?, training)))
}

/// The paper's trees on new commands; `None` without training commands.
///
/// # Errors
/// What training returns.
pub(crate) fn on_new_commands(
    data: &DataSet,
    settings: &EvaluationSettings,
    workers: Workers,
) -> Result<Option<ProtocolResult>, EvaluationError> {
    let Some((data, training)) = prepared(data)? else { return Ok(None) };
    let (holding, shutdowns) = (settings.holding, data.actions(&settings.shutdowns));
    protocol::evaluate(Protocol::NewCommand, &data, &training, holding, &shutdowns, workers)
}

/// The paper's own test with many random thirds.
///
/// # Errors
/// What training returns.
pub(crate) fn random_thirds(
    data: &DataSet,
    settings: &EvaluationSettings,
    workers: Workers,
) -> Result<Vec<RandomThirds>, EvaluationError> {
    let Some((data, training)) = prepared(data)? else { return Ok(vec![]) };
    let seeds: Vec<u64> = (0..REPEATS).map(|repeat| settings.holding.seed + repeat).collect();
    let judged = parallel::map(&seeds, workers, |&seed| {
        let holding = Holding { repeats: 1, seed, ..settings.holding };
        let alone = Workers::new(1);
        protocol::evaluate(Protocol::RandomThird, &data, &training, holding, &[], alone)
    })?;
    let judged = judged.into_iter().collect::<Result<Vec<_>, _>>()?;
    let accuracies = |stage: &str| {
        let results = judged.iter().flatten();
        results.filter_map(|result| result.stage(stage)?.accuracy.share).collect()
    };
    let stages =
        ["A", "B"].map(|stage| RandomThirds { stage: stage.into(), accuracies: accuracies(stage) });
    Ok(stages.into_iter().filter(|stage| stage.accuracies.len() > 1).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reported_figure_is_placed_among_the_thirds() {
        let thirds = RandomThirds { stage: "B".into(), accuracies: vec![0.96, 0.98, 1.0, 0.98] };
        assert!((thirds.mean() - 0.98).abs() < 1e-12);
        assert!((thirds.deviation() - (0.0008_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!([thirds.below(0.95), thirds.below(0.98), thirds.below(0.99)], [0, 1, 3]);
    }
}
