//! Trains diagnoses, and judges what is trained on held-out data.
//!
//! The diagnosis in flight learns from the windows that a session sees:
//!
//! - [`windows`]: the windows that it examines
//! - [`spreads`]: how the spread of healthy residuals grows with the flow
//! - [`training_windows`]: the windows taken out of flights, one table for each kind
//! - [`train`](mod@train): bands, trees and committee for each kind
//! - `boundaries`: what a wrong reading of a boundary value does
//!
//! Of records, [`evaluate`] takes the data sets of a scenario and returns an [`Evaluation`]. It covers detection, the nine trees
//! and the committee under every protocol, the seed paper's trees, all classifiers, and what may stay not isolated.
//! It also examines the [`Hierarchy`] that [`train()`] returns. The same data sets, settings and seeds give the same
//! bytes, on any number of threads.

pub mod bands;
pub mod baseline;
pub(crate) mod boundaries;
pub mod committee;
pub(crate) mod comparison;
pub mod data_set;
pub mod detection;
mod error;
pub mod isolation;
pub mod model_file;
pub(crate) mod perturbation;
pub mod protocol;
pub(crate) mod run;
pub mod spreads;
pub mod train;
pub mod training_windows;
pub mod windows;

pub use data_set::DataSet;
pub(crate) use data_set::TrainingFilter;
pub use error::EvaluationError;
pub use servotwin_learning::metrics;

use crate::measure::Rates;
use crate::parallel::Workers;
use bands::Band;
use baseline::RandomThirds;
use protocol::{Holding, Protocol, ProtocolResult, isolated, summary};
use run::Scope;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{ClassifierKind, Model};
use servotwin_diagnosis::diagnoser::{Novelty, Tuning};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_diagnosis::panel::{Panel, SensorBand};
use servotwin_diagnosis::residual::BAND;
use servotwin_learning::classifiers;
use servotwin_learning::hierarchy::HierarchySettings as Training;
use servotwin_learning::novelty;
use servotwin_learning::splits::Split;
use servotwin_learning::tree::Criterion;

/// The scope and methods of an evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvaluationSettings {
    /// Training settings of the nine trees.
    pub training: Training,
    /// Training settings of the committee.
    pub committee: Training,
    /// Which training rows the committee learns from; `holding` selects those of the trees.
    pub committee_lessons: TrainingFilter,
    /// How rows are held out.
    pub holding: Holding,
    /// How rows are held out for comparing classifiers.
    pub comparison_holding: Holding,
    /// The commands that switch their actuator off, from the study.
    pub shutdowns: Vec<String>,
    /// Whether detection uses the bands learned from healthy specimens; otherwise it uses the seed paper's band of 3 %.
    pub learned_bands: bool,
    /// The protocols for the nine trees.
    pub protocols: Vec<Protocol>,
    /// The protocols for the committee.
    pub committee_protocols: Vec<Protocol>,
    /// The classifiers to compare; empty for no comparison.
    pub classifiers: Vec<classifiers::Settings>,
}

impl Default for EvaluationSettings {
    fn default() -> Self {
        let boosted = classifiers::Settings::default_of(ClassifierKind::BoostedTrees);
        EvaluationSettings {
            training: trees(Criterion::Entropy, 7),
            committee: Training::all(boosted),
            committee_lessons: TrainingFilter { faults: 0.8, weaker: 0.8, healthy: 0.0, moves: 2 },
            holding: Holding::default(),
            // Perturbed copies would not change the order of the classifiers.
            comparison_holding: Holding {
                repeats: 1,
                folds: 3,
                lessons: TrainingFilter { moves: 0, ..TrainingFilter::default() },
                ..Holding::default()
            },
            shutdowns: vec![],
            learned_bands: false,
            protocols: protocol::ALL.into(),
            committee_protocols: OF_COMMITTEE.into(),
            classifiers: comparison::quick_classifiers(),
        }
    }
}

impl EvaluationSettings {
    /// Reduces an evaluation for a quick study.
    pub(crate) fn quick(mut self) -> Self {
        // Training a committee without each kind of fault in turn would lengthen the evaluation by half.
        self.committee_protocols.retain(|protocol| *protocol == Protocol::NewCommand);
        self
    }
}

/// Settings for the nine trees with a depth limit.
pub(crate) fn trees(criterion: Criterion, depth: usize) -> Training {
    Training::all(classifiers::Settings::Cart(classifiers::cart::Settings {
        criterion,
        max_depth: Some(depth),
        max_bins: Some(256),
        ..Default::default()
    }))
}

/// The size of a stage's tree, as needed in flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageSize {
    /// The stage's id.
    pub stage: String,
    /// Number of nodes including leaves; `None` unless it is a tree.
    pub nodes: Option<usize>,
    /// Number of questions on the longest path.
    pub depth: Option<usize>,
    /// The features in use, with their shares of the impurity decrease.
    pub importances: Vec<(String, f64)>,
}

/// All results on the data sets of a scenario.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// What the band in use shows, of all faults and of healthy specimens.
    pub in_band: Rates,
    /// What the paper's band of 3 % shows of them.
    pub in_paper_band: Rates,
    /// Which faults the band in use detects, and from which intensity on.
    pub detection: detection::Detection,
    /// Bands learned from healthy specimens.
    pub bands: Option<Vec<Band>>,
    /// Constant features, which carry no information.
    pub constant_features: Vec<String>,
    /// The nine trees under every protocol.
    pub protocols: Vec<ProtocolResult>,
    /// The committee under its protocols.
    pub committee: Vec<ProtocolResult>,
    /// The seed paper's trees on new commands: its features, without symmetric copies and pooling.
    pub baseline: Option<ProtocolResult>,
    /// The same trees in the seed paper's test, repeated.
    pub random_thirds: Vec<RandomThirds>,
    /// What trees and committee decide together if a fault may stay not isolated, where kinds are left out and under new
    /// commands.
    pub isolation: Vec<ProtocolResult>,
    /// Results of the classifier comparison.
    pub classifiers: Vec<comparison::Compared>,
    /// The sizes of the final trees.
    pub stages: Vec<StageSize>,
    /// What the final trees and the final committee say of healthy specimens.
    pub healthy: [Rates; 2],
}

impl Evaluation {
    /// The trees' result under a protocol.
    pub fn protocol(&self, protocol: Protocol) -> Option<&ProtocolResult> {
        self.protocols.iter().find(|result| result.protocol == protocol)
    }

    /// What is decided under a protocol if a fault may stay not isolated.
    pub fn isolation(&self, protocol: Protocol) -> Option<&ProtocolResult> {
        self.isolation.iter().find(|result| result.protocol == protocol)
    }

    /// The committee's result under a protocol.
    pub fn committee(&self, protocol: Protocol) -> Option<&ProtocolResult> {
        self.committee.iter().find(|result| result.protocol == protocol)
    }

    /// The trees' result under the protocol that is quoted (`Protocol::headline`).
    pub fn headline(&self) -> Option<&ProtocolResult> {
        self.protocol(Protocol::NewCommand).or_else(|| self.protocol(Protocol::UnseenIntensity))
    }
}

/// Protocols of the committee.
const OF_COMMITTEE: [Protocol; 3] =
    [Protocol::KindLeftOut, Protocol::UnseenIntensity, Protocol::NewCommand];

/// The data with the band that the settings select, and the bands that can be learned from it.
pub fn banded(
    data: &DataSet,
    settings: &EvaluationSettings,
    pools: &[usize],
) -> (DataSet, Option<Vec<Band>>) {
    let bands = bands::learn(data, pools, bands::ALARMS);
    match bands.as_ref().filter(|_| settings.learned_bands) {
        None if data.sensors.is_empty() => (data.clone(), bands),
        Some(learned) => {
            let limits: Vec<f64> = learned.iter().map(|band| band.half_width).collect();
            (data.with_bands(&limits), bands)
        }
        None => (data.with_bands(&vec![BAND; data.sensors.len()]), bands),
    }
}

/// Trains trees and committee on all training rows that the band in use detects.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`], or training fails.
pub fn train(
    data: &DataSet,
    settings: &EvaluationSettings,
    pools: &[usize],
    workers: Workers,
) -> Result<Panel, EvaluationError> {
    let (data, bands) = banded(data, settings, pools);
    let bands = bands.filter(|_| settings.learned_bands);
    let band = |(place, sensor): (usize, &String)| SensorBand {
        sensor: sensor.clone(),
        half_width: bands.as_ref().map_or(BAND, |bands| bands[place].half_width),
    };
    let bands = data.sensors.iter().enumerate().map(band).collect();
    train_on(&data, &data, bands, settings, workers)
}

/// Trains the trees on some rows of a data set, and the committee on all, each on those that the settings select.
///
/// # Errors
/// As [`train`].
pub(crate) fn train_on(
    for_trees: &DataSet,
    data: &DataSet,
    bands: Vec<SensorBand>,
    settings: &EvaluationSettings,
    workers: Workers,
) -> Result<Panel, EvaluationError> {
    let rows = for_trees.learnt_from(settings.holding.lessons)?;
    let trees = run::fit(for_trees, &settings.training, &rows, Scope::All, workers)?;
    let rows = data.learnt_from(settings.committee_lessons)?;
    let (committee, least_confidence) =
        committee::train(&data.for_committee()?, &settings.committee, &rows, workers)?;
    Ok(Panel { bands, least_confidence, trees, committee })
}

/// The known ranges of the rows from which a committee learns.
///
/// # Errors
/// As [`train`].
pub(crate) fn novelty(
    data: &DataSet,
    settings: &EvaluationSettings,
) -> Result<Novelty, EvaluationError> {
    let rows = data.learnt_from(settings.committee_lessons)?;
    let groups: Vec<u32> = data.rows.iter().map(|row| row.flown).collect();
    Ok(novelty::learn(&data.examples, &rows, &groups, Tuning::default().known_share)?)
}

/// What the bands in use and the nine trees alone show of a data set with bands, under the protocol that is quoted.
/// Without a fault to learn from, nothing is answered.
///
/// # Errors
/// Training fails.
pub fn of_trees(data: &DataSet, settings: &EvaluationSettings) -> Result<Rates, EvaluationError> {
    let (protocol, shutdowns) = (Protocol::headline(data), data.actions(&settings.shutdowns));
    let (training, alone) = (&settings.training, Workers::new(1));
    let holding = settings.holding;
    let judged = match protocol::evaluate(protocol, data, training, holding, &shutdowns, alone) {
        Err(EvaluationError::NothingDetectable { .. }) => None,
        judged => judged?,
    };
    let judged = judged.unwrap_or_else(|| summary(protocol, data, &[], &shutdowns));
    Ok(protocol::in_bands(data).and(judged.rates))
}

/// Inputs of an evaluation besides data and settings.
pub struct Context<'c> {
    /// The diagnosis trained on all rows.
    pub trained: &'c Panel,
    /// For each sensor with a band, a number that is equal for like sensors.
    pub pools: &'c [usize],
    /// The same data with every feature, including unused ones, for the paper's trees.
    pub all_features: &'c DataSet,
    /// The worker threads.
    pub workers: Workers<'c>,
    /// Receives a description of the current step, and the approximate progress from 0 to 1.
    pub progress: &'c dyn Fn(&str, f64),
}

/// Evaluates the data sets of a scenario.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`], or training fails.
pub fn evaluate(
    data: &DataSet,
    settings: &EvaluationSettings,
    context: &Context,
) -> Result<Evaluation, EvaluationError> {
    let Context { trained, all_features, workers, progress, .. } = *context;
    let unbanded = match data.sensors.is_empty() {
        true => data.clone(),
        false => data.with_bands(&vec![BAND; data.sensors.len()]),
    };
    let (data, bands) = banded(data, settings, context.pools);
    let data = &data;
    let shutdowns = data.actions(&settings.shutdowns);
    let of_healthy = |hierarchy| protocol::of_healthy(data, hierarchy, &shutdowns);
    let mut evaluation = Evaluation {
        in_band: protocol::in_bands(data),
        in_paper_band: protocol::in_bands(&unbanded),
        detection: detection::evaluate(data),
        bands,
        constant_features: data.constant.clone(),
        stages: trained.trees.stages.iter().map(|stage| size(&trained.trees, stage)).collect(),
        healthy: [of_healthy(&trained.trees)?, of_healthy(&trained.committee)?],
        ..Evaluation::default()
    };
    under_protocols(data, settings, context, &mut evaluation)?;
    if settings.protocols.len() > 1 {
        progress("trees of fewer features", 0.5);
        evaluation.baseline = baseline::on_new_commands(all_features, settings, workers)?;
    }
    if !settings.classifiers.is_empty() {
        // Where classifiers are compared, as in the paper.
        progress("the seed paper's test", 0.52);
        evaluation.random_thirds = baseline::random_thirds(all_features, settings, workers)?;
        progress("comparing classifiers", 0.55);
        let (list, holding) = (&settings.classifiers, settings.comparison_holding);
        evaluation.classifiers =
            comparison::evaluate(data, &settings.training, list, holding, workers)?;
    }
    Ok(evaluation)
}

/// Evaluates trees and committee under every protocol, and what may stay not isolated.
fn under_protocols(
    data: &DataSet,
    settings: &EvaluationSettings,
    context: &Context,
    evaluation: &mut Evaluation,
) -> Result<(), EvaluationError> {
    let Context { trained, workers, progress, .. } = *context;
    let (holding, shutdowns) = (settings.holding, data.actions(&settings.shutdowns));
    let of_committee = data.for_committee()?;
    let answers = |protocol: Protocol, data: &DataSet, hierarchy, training, splits: &[Split]| {
        match protocol {
            Protocol::NewCommand => Ok(vec![run::ask(&data.examples, hierarchy, &splits[0].test)?]),
            _ => run::run(data, training, splits, protocol.scope(), workers),
        }
    };
    for (place, &protocol) in settings.protocols.iter().enumerate() {
        progress(protocol.title(), 0.125 * place as f64);
        let splits = protocol.splits(data, holding)?;
        if splits.is_empty() {
            continue;
        }
        let trees = answers(protocol, data, &trained.trees, &settings.training, &splits)?;
        evaluation.protocols.push(summary(protocol, data, &trees, &shutdowns));
        // The committee is calibrated on training commands.
        if !data.has_training() || !settings.committee_protocols.contains(&protocol) {
            continue;
        }
        let holding = Holding { lessons: settings.committee_lessons, ..holding };
        let splits = protocol.splits(data, holding)?;
        let hierarchy = &trained.committee;
        let committee = answers(protocol, &of_committee, hierarchy, &settings.committee, &splits)?;
        evaluation.committee.push(summary(protocol, data, &committee, &shutdowns));
        if isolation::PROTOCOLS.contains(&protocol) {
            let pool = run::settled(data, &settings.committee).pool;
            let voices = [&trees[..], &committee];
            let data = &of_committee;
            let decided = isolation::decide(protocol, data, pool, &splits, voices, workers)?;
            evaluation.isolation.push(isolated(protocol, data, &decided, &shutdowns));
        }
    }
    Ok(())
}

/// The size of a stage's tree.
fn size(hierarchy: &Hierarchy, stage: &servotwin_diagnosis::hierarchy::Stage) -> StageSize {
    let Model::Cart(tree) = &stage.model else {
        return StageSize {
            stage: stage.id.clone(),
            nodes: None,
            depth: None,
            importances: vec![],
        };
    };
    let name = |column: u32| hierarchy.names.features[column as usize].clone();
    let named = stage.columns.iter().map(|&column| name(column)).zip(tree.importances());
    let mut importances: Vec<(String, f64)> = named.filter(|(_, share)| *share > 0.0).collect();
    importances.sort_by(|a, b| b.1.total_cmp(&a.1));
    StageSize {
        stage: stage.id.clone(),
        nodes: Some(tree.nodes()),
        depth: Some(tree.depth()),
        importances,
    }
}
