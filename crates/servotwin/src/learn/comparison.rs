//! Compares all classifiers under the same protocols, for the actuator (A) and the action (B).

use super::data_set::DataSet;
use super::error::EvaluationError;
use super::protocol::{Holding, Protocol, stage_score};
use super::run::{RowOutcome, Scope, run};
use crate::parallel::{self, Workers};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{ALL, ClassifierKind};
use servotwin_diagnosis::hierarchy::Question;
use servotwin_learning::classifiers;
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::metrics::Score;
use servotwin_learning::splits::Split;

/// Depth of the compared CART tree.
const DEPTH: usize = 7;

/// The result of a classifier for one stage under one protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// The classifier's id.
    pub(crate) classifier: String,
    /// The classifier's display name.
    pub title: String,
    /// The stage: `A` or `B`.
    pub stage: String,
    /// The protocol of the test.
    pub protocol: Protocol,
    /// The score on the held-out rows.
    pub score: Score,
}

/// Epochs of the perceptron if it is trained many times: as in scikit-learn's run in `golden/`, a quarter of the
/// default.
const EPOCHS: usize = 50;

/// Every classifier with a study's default settings; the tree has the paper's depth, and the perceptron fewer epochs.
pub(crate) fn quick_classifiers() -> Vec<classifiers::Settings> {
    let settings = |kind: &ClassifierKind| {
        let mut settings = classifiers::Settings::default_of(*kind);
        match &mut settings {
            classifiers::Settings::Cart(cart) => cart.max_depth = Some(DEPTH),
            classifiers::Settings::Mlp(mlp) => mlp.max_epochs = EPOCHS,
            _ => {}
        }
        settings
    };
    ALL.iter().map(settings).collect()
}

/// Compares classifiers; symmetric copies and pooling follow the hierarchy's settings.
///
/// # Errors
/// Training fails.
pub(crate) fn evaluate(
    data: &DataSet,
    hierarchy: &HierarchySettings,
    list: &[classifiers::Settings],
    holding: Holding,
    workers: Workers,
) -> Result<Vec<Compared>, EvaluationError> {
    let with = |classifier: &classifiers::Settings| HierarchySettings {
        mirror: hierarchy.mirror,
        pool: hierarchy.pool,
        ..HierarchySettings::all(classifier.clone())
    };
    let mut places = data.examples.places(true);
    places.retain(|place| place.question != Question::Detail);
    let mut compared = vec![];
    for protocol in [Protocol::RandomThird, Protocol::headline(data)] {
        let splits = protocol.splits(data, holding)?;
        let jobs: Vec<(HierarchySettings, &Split)> =
            list.iter().flat_map(|c| splits.iter().map(move |split| (with(c), split))).collect();
        let judged = parallel::map(&jobs, workers, |(training, split)| {
            run(data, training, std::slice::from_ref(*split), Scope::Action, Workers::new(1))
        })?;
        let judged: Vec<Vec<RowOutcome>> =
            judged.into_iter().collect::<Result<Vec<_>, _>>()?.concat();
        for place in &places {
            for (classifier, outcomes) in list.iter().zip(judged.chunks(splits.len().max(1))) {
                let outcomes: Vec<&RowOutcome> = outcomes.iter().flatten().collect();
                compared.push(Compared {
                    classifier: classifier.kind().id().into(),
                    title: classifier.kind().title().into(),
                    stage: place.id(),
                    protocol,
                    score: stage_score(data, &outcomes, place).score,
                });
            }
        }
    }
    Ok(compared)
}
