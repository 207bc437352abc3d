//! Compares all classifiers under the same protocols, for the actuator (A) and the command (B).

use super::data_set::DataSet;
use super::error::EvaluationError;
use super::protocol::{Holding, Protocol, trial};
use super::run::settled;
use crate::parallel::{self, Workers};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{ALL, Classifier, ClassifierKind};
use servotwin_diagnosis::hierarchy::{Question, StagePlace};
use servotwin_learning::classifiers::{self, Fit};
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::metrics::{Prediction, Score, Trial};
use servotwin_learning::splits::Split;

/// Depth of the compared CART tree.
const DEPTH: usize = 7;

/// The result of a classifier for one stage under one protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// The classifier's id.
    pub classifier: String,
    /// The classifier's display name.
    pub title: String,
    /// The stage: `A` or `B`.
    pub stage: String,
    /// The protocol of the test.
    pub protocol: Protocol,
    /// The score on the held-out rows.
    pub score: Score,
}

/// A training with its test.
struct Job<'a> {
    settings: classifiers::Settings,
    place: StagePlace,
    split: &'a Split,
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
    let hierarchy = settled(data, hierarchy);
    let asks = |place: &StagePlace| place.question != Question::Detail;
    // Pooled stages need the views; without them every actuator has its own stage.
    let places = data.examples.places(data.examples.views() > 1);
    let places: Vec<StagePlace> = places.into_iter().filter(asks).collect();
    let mut compared = vec![];
    for protocol in [Protocol::RandomThird, Protocol::headline(data)] {
        let splits = protocol.splits(data, holding)?;
        if splits.is_empty() {
            continue;
        }
        let mut jobs = vec![];
        for place in &places {
            for settings in list {
                let job = |split| Job { settings: settings.clone(), place: *place, split };
                jobs.extend(splits.iter().map(job));
            }
        }
        let results = parallel::map(&jobs, workers, |job| test(data, &hierarchy, job))?;
        let results: Result<Vec<Vec<Prediction>>, _> = results.into_iter().collect();
        for (jobs, predictions) in jobs.chunks(splits.len()).zip(results?.chunks(splits.len())) {
            compared.push(of_splits(data, protocol, &jobs[0], predictions));
        }
    }
    Ok(compared)
}

fn of_splits(
    data: &DataSet,
    protocol: Protocol,
    job: &Job,
    predictions: &[Vec<Prediction>],
) -> Compared {
    let names = data.examples.names();
    let classes = data.examples.classes(&job.place);
    let classes = classes.iter().map(|&c| names.class_name(job.place.question, c).to_owned());
    let kind = job.settings.kind();
    Compared {
        classifier: kind.id().into(),
        title: kind.title().into(),
        stage: job.place.id(),
        protocol,
        score: Score::of(classes.collect(), predictions),
    }
}

fn test(
    data: &DataSet,
    hierarchy: &HierarchySettings,
    job: &Job,
) -> Result<Vec<Prediction>, EvaluationError> {
    let samples = |rows: &[usize], mirror| data.examples.samples(&job.place, rows, mirror);
    let train = samples(&job.split.train, hierarchy.mirror)?;
    let test = samples(&job.split.test, false)?;
    let (Some((train, _)), Some((test, rows))) = (train, test) else {
        return Ok(vec![]);
    };
    let model = job.settings.fit(&train)?;
    debug_assert_eq!(model.features(), test.features());
    let predicted = classifiers::predict(&model, &test)?;
    let truth = test.labels().iter();
    let prediction = |((&row, &truth), said): ((&usize, &u32), u32)| {
        let Trial { cluster, kind, .. } = trial(data, row, false);
        Prediction { cluster, kind, truth, said: Some(said) }
    };
    Ok(rows.iter().zip(truth).zip(predicted).map(prediction).collect())
}
