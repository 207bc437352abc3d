//! Measures how good the diagnosis is, with protocols that avoid optimistic results.
//!
//! [`evaluate`] takes the data sets of one scenario and returns an [`Evaluation`]. It covers:
//! - detection;
//! - the nine trees and the committee under every protocol, and the seed paper's trees as a baseline;
//! - comparison of classifiers, ablation, confusions, abstention and sensitivity to disturbances;
//! - the structure of the [`Hierarchy`] from [`train`].
//!
//! The same data sets, settings and seeds give the same bytes on any number of threads.

pub mod ablation;
pub mod abstention;
pub mod ambiguity;
pub mod bands;
pub mod committee;
pub mod comparison;
pub mod data_set;
pub mod detection;
mod error;
pub mod flips;
pub mod leaves;
pub mod model_file;
pub mod piece;
pub mod protocol;
pub mod robustness;
pub mod run;
pub mod table_model;
pub mod traces;

pub use data_set::{DataSet, FeatureInfo, TrainingFilter};
pub use error::{EvaluationError, UnknownClass};
pub use servotwin_learning::metrics;

use crate::parallel::Workers;
use abstention::Abstention;
use bands::Band;
use committee::{Committee, Reliability};
use flips::{Flips, Moving};
use piece::Bench;
use protocol::{Holding, Protocol, ProtocolResult};
use run::{Outcome, first_error};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::{Kind, Model};
use servotwin_diagnosis::hierarchy::{Hierarchy, Question};
use servotwin_diagnosis::residual::BAND;
use servotwin_learning::classifiers;
use servotwin_learning::hierarchy::Settings as Training;
use servotwin_learning::metrics::Rate;
use servotwin_learning::tree::Criterion;

use crate::study::Role;

/// Settings of an evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Training settings of the nine trees.
    pub training: Training,
    /// Training settings of the committee.
    pub committee: Training,
    /// Training rows of the committee; those of the trees are in `holding`.
    pub committee_lessons: TrainingFilter,
    /// How rows are held out.
    pub holding: Holding,
    /// How rows are held out in the comparison of classifiers.
    pub comparison_holding: Holding,
    /// The actions of the study that shut their actuator down.
    pub shutdowns: Vec<String>,
    /// Whether bands learned from healthy specimens decide detection. Otherwise the seed paper's band of 3 % does.
    pub learned_bands: bool,
    /// The feature family of the seed paper.
    pub baseline_family: String,
    /// The protocols of the nine trees.
    pub protocols: Vec<Protocol>,
    /// The protocols of the committee.
    pub committee_protocols: Vec<Protocol>,
    /// The classifiers to compare; empty for no comparison.
    pub classifiers: Vec<classifiers::Settings>,
    /// Whether to run the ablation.
    pub ablation: bool,
    /// Whether to train the trees also on fewer commands.
    #[serde(default = "yes")]
    pub learning_curve: bool,
}

fn yes() -> bool {
    true
}

impl Default for Settings {
    fn default() -> Self {
        let boosted = classifiers::Settings::default_of(Kind::BoostedTrees);
        Settings {
            training: trees(Criterion::Entropy, 7),
            committee: Training::all(boosted),
            committee_lessons: TrainingFilter {
                faults: 0.8,
                weaker: 0.8,
                healthy: 0.0,
                moves: 3,
                ..TrainingFilter::default()
            },
            holding: Holding::default(),
            // Three folds, so that as much is left for training as in the random third.
            comparison_holding: Holding { repeats: 1, folds: 3, ..Holding::default() },
            shutdowns: vec![],
            learned_bands: false,
            baseline_family: "moments".into(),
            protocols: protocol::ALL.into(),
            committee_protocols: OF_COMMITTEE.into(),
            classifiers: comparison::quick_classifiers(),
            ablation: true,
            learning_curve: true,
        }
    }
}

/// The protocols of a quick study: the paper's, and one for each kind of novelty.
const QUICK_PROTOCOLS: [Protocol; 5] = [
    Protocol::RandomThird,
    Protocol::Grouped,
    Protocol::LeaveCommandOut,
    Protocol::LeaveKindOut,
    Protocol::NewCommand,
];

impl Settings {
    /// Reduces the evaluation to that of a quick study.
    pub fn quick(mut self) -> Self {
        self.protocols.retain(|protocol| QUICK_PROTOCOLS.contains(protocol));
        self.committee_protocols.retain(|protocol| QUICK_PROTOCOLS.contains(protocol));
        Settings { ablation: false, learning_curve: false, ..self }
    }
}

/// Training settings of the nine trees with a given depth.
pub fn trees(criterion: Criterion, depth: usize) -> Training {
    Training::all(classifiers::Settings::Cart(classifiers::cart::Settings {
        criterion,
        max_depth: Some(depth),
        max_bins: Some(256),
        ..Default::default()
    }))
}

/// Size of a stage's model, which the flight software must hold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageSize {
    /// Id of the stage.
    pub stage: String,
    /// Number of nodes, leaves included; `None` unless the model is a tree.
    pub nodes: Option<usize>,
    /// Number of questions on the longest path.
    pub depth: Option<usize>,
    /// Features in use with their share of the impurity decrease, the largest first.
    pub importances: Vec<(String, f64)>,
}

/// False alarms on fault-free specimens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FalseAlarms {
    /// Specimens that left the paper's band of 3 %.
    pub paper_alarms: Rate,
    /// Specimens that left the band in use.
    pub alarms: Rate,
    /// Specimens that left the band in use and that the trees do not call healthy.
    pub trees: Rate,
    /// Specimens in which the trees would shut an actuator down.
    pub tree_shutdowns: Rate,
    /// Specimens that left the band in use and that the committee does not call healthy.
    pub committee: Rate,
    /// Specimens in which the committee would shut an actuator down.
    pub committee_shutdowns: Rate,
}

/// All results of one scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Detection with the band in use.
    pub detection: detection::Detection,
    /// Share of the faults that the paper's band of 3 % detects.
    pub paper_detection: Rate,
    /// Bands learned from healthy specimens.
    pub bands: Option<Vec<Band>>,
    /// Number of features.
    pub features: usize,
    /// Constant features, which carry no information.
    pub constant_features: Vec<String>,
    /// The nine trees under every protocol.
    pub protocols: Vec<ProtocolResult>,
    /// The committee under its protocols.
    pub committee: Vec<ProtocolResult>,
    /// Trees and committee on a new command with the paper's band of 3 %, if it is not in use.
    pub paper_band: Vec<ProtocolResult>,
    /// The trees on a new command, by the number of training commands.
    pub commands: Vec<(usize, ProtocolResult)>,
    /// The seed paper's trees: its features, no symmetric copies, no pooling.
    pub baseline: Vec<ProtocolResult>,
    /// What abstention gains.
    pub abstention: Option<Abstention>,
    /// Calibration quality of the committee's confidence.
    pub reliability: Option<Reliability>,
    /// Answers of the trees and of the committee that change within the uncertainty.
    pub flips: Option<(Flips, Flips)>,
    /// Results of the classifier comparison.
    pub classifiers: Vec<comparison::Compared>,
    /// Results of the ablation.
    pub ablation: Vec<ablation::Ablation>,
    /// Which kinds of fault are confused.
    pub ambiguity: ambiguity::Ambiguity,
    /// The least pure leaves of the final trees.
    pub worst_leaves: Vec<leaves::WorstLeaf>,
    /// Sizes of the final trees.
    pub stages: Vec<StageSize>,
    /// False alarms; `None` without fault-free specimens.
    pub false_alarms: Option<FalseAlarms>,
}

impl Evaluation {
    /// The trees' result under a protocol.
    pub fn protocol(&self, protocol: Protocol) -> Option<&ProtocolResult> {
        self.protocols.iter().find(|result| result.protocol == protocol)
    }

    /// The committee's result under a protocol.
    pub fn committee(&self, protocol: Protocol) -> Option<&ProtocolResult> {
        self.committee.iter().find(|result| result.protocol == protocol)
    }

    /// The trees' result under the hardest available protocol: a new command, or else a fault unseen at its intensity.
    pub fn headline(&self) -> Option<&ProtocolResult> {
        self.protocol(Protocol::NewCommand).or_else(|| self.protocol(Protocol::Grouped))
    }
}

/// Number of worst leaves shown for each tree.
const WORST_LEAVES: usize = 3;

/// The default protocols of the committee.
const OF_COMMITTEE: [Protocol; 4] = [
    Protocol::NewCommand,
    Protocol::NewCommandAndFault,
    Protocol::WeakToStrong,
    Protocol::StrongToWeak,
];

/// The protocols of the seed paper's trees.
const OF_BASELINE: [Protocol; 4] =
    [Protocol::RandomThird, Protocol::Grouped, Protocol::LeaveCaseOut, Protocol::LeaveCommandOut];

/// Numbers of training commands in the learning curve.
const COMMANDS: [usize; 6] = [1, 2, 4, 8, 12, 16];

/// The trained diagnosis of one scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Trained {
    /// The learned bands, if in use.
    pub bands: Option<Vec<Band>>,
    /// The nine trees.
    pub trees: Hierarchy,
    /// The committee.
    pub committee: Committee,
}

/// The data with the band that the settings choose, and the bands learned from the data.
pub fn banded(
    data: &DataSet,
    settings: &Settings,
    pools: &[usize],
) -> (DataSet, Option<Vec<Band>>) {
    let bands = bands::learn(data, pools);
    match bands.as_ref().filter(|_| settings.learned_bands) {
        None if data.sensors.is_empty() => (data.clone(), bands),
        Some(learned) => {
            let limits: Vec<f64> = learned.iter().map(|band| band.half_width).collect();
            (data.with_bands(&limits), bands)
        }
        None => (data.with_bands(&vec![BAND; data.sensors.len()]), bands),
    }
}

/// Trains trees and committee on all training rows, detected with the band in use.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`] and errors of training.
pub fn train(
    data: &DataSet,
    settings: &Settings,
    pools: &[usize],
    workers: Workers,
) -> Result<Trained, EvaluationError> {
    let (data, bands) = banded(data, settings, pools);
    let rows = data.learnt_from(settings.holding.lessons)?;
    let trees = run::fit(&data, &run::settled(&data, &settings.training), &rows, workers)?;
    let rows = data.learnt_from(settings.committee_lessons)?;
    let committee = committee::train(&data.for_committee()?, &settings.committee, &rows, workers)?;
    Ok(Trained { bands: bands.filter(|_| settings.learned_bands), trees, committee })
}

/// Inputs of an evaluation besides data and settings.
pub struct Context<'c> {
    /// The diagnosis trained on all rows.
    pub trained: &'c Trained,
    /// For each sensor with a band, a pool index that like sensors share.
    pub pools: &'c [usize],
    /// The same data with every feature, for the paper's trees.
    pub all_features: &'c DataSet,
    /// The windows to disturb within their uncertainty.
    pub moving: Option<&'c Moving<'c>>,
    /// The threads to use.
    pub workers: Workers<'c>,
    /// Receives the current activity and the approximate progress from 0 to 1.
    pub progress: &'c dyn Fn(&str, f64),
}

/// Evaluates the data sets of one scenario, piece by piece.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`] and errors of training.
pub fn evaluate(
    data: &DataSet,
    settings: &Settings,
    context: &Context,
) -> Result<Evaluation, EvaluationError> {
    let bench = Bench::new(data, settings, context);
    let found = piece::all(settings).into_iter().map(|piece| bench.evaluate(piece));
    Ok(piece::joined(found.collect::<Result<_, _>>()?))
}

/// The judged faults for abstention and flips: detected and no symmetric copies. Empty without separate training rows.
fn unseen(data: &DataSet) -> Vec<usize> {
    if !data.has_training() {
        return vec![];
    }
    let wanted = |row: &data_set::Row| !row.is_healthy && row.is_detected() && !row.reflected;
    data.rows_where(Role::Judged, wanted)
}

/// The results of abstention, and the calibration of the confidence.
fn silence(
    data: &DataSet,
    settings: &Settings,
    trained: &Trained,
) -> Result<Option<(Abstention, Reliability)>, EvaluationError> {
    let rows = unseen(data);
    if rows.is_empty() {
        return Ok(None);
    }
    let committee = run::ask(data, &trained.committee.hierarchy, &rows)?;
    let trees = run::ask(data, &trained.trees, &rows)?;
    let shutdowns = data.commands(&settings.shutdowns);
    let least = trained.committee.least_confidence;
    let is_right = |o: &Outcome| matches!(first_error(data, o), None | Some(Question::Detail));
    let reliability = committee::reliability(&committee, is_right);
    Ok(Some((abstention::evaluate(data, &committee, &trees, least, &shutdowns), reliability)))
}

fn flips(
    data: &DataSet,
    trained: &Trained,
    context: &Context,
) -> Result<Option<(Flips, Flips)>, EvaluationError> {
    let rows = unseen(data);
    let Some(moving) = context.moving.filter(|_| !rows.is_empty()) else { return Ok(None) };
    let of = |hierarchy| flips::evaluate(data, hierarchy, moving, &rows, context.workers);
    Ok(Some((of(&trained.trees)?, of(&trained.committee.hierarchy)?)))
}

/// The trees on new commands, trained on the first 1, 2, 4, … training commands.
fn commands(
    data: &DataSet,
    settings: &Settings,
    workers: Workers,
) -> Result<Vec<(usize, ProtocolResult)>, EvaluationError> {
    let mut flown: Vec<u32> =
        data.rows_where(Role::Training, |_| true).iter().map(|&row| data.rows[row].flown).collect();
    flown.sort_unstable();
    flown.dedup();
    let mut curve = vec![];
    for count in COMMANDS.into_iter().filter(|&count| count < flown.len()) {
        let first = &flown[..count];
        let fewer = data.without(|row| row.role == Role::Training && !first.contains(&row.flown));
        let protocol = Protocol::NewCommand;
        let Settings { training, holding, shutdowns, .. } = settings;
        let found = protocol::evaluate(protocol, &fewer, training, *holding, shutdowns, workers)?;
        curve.extend(found.map(|(result, _)| (count, result)));
    }
    Ok(curve)
}

/// The paper's trees: its feature family, one tree for each actuator, no symmetric copies.
fn baseline(
    data: &DataSet,
    settings: &Settings,
    workers: Workers,
) -> Result<Vec<ProtocolResult>, EvaluationError> {
    let family = |info: &FeatureInfo| info.family == settings.baseline_family;
    if !data.features.iter().any(family) {
        return Ok(vec![]);
    }
    let data = data.with_features(family)?;
    let training = Training { mirror: false, pool: false, ..Training::default() };
    let mut results = vec![];
    for protocol in OF_BASELINE {
        let Settings { holding, shutdowns, .. } = settings;
        let found = protocol::evaluate(protocol, &data, &training, *holding, shutdowns, workers)?;
        results.extend(found.map(|(result, _)| result));
    }
    Ok(results)
}

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

/// Answers of trees and committee for healthy specimens that left the band.
fn false_alarms(
    unbanded: &DataSet,
    data: &DataSet,
    trained: &Trained,
    shutdowns: &[String],
) -> Result<Option<FalseAlarms>, EvaluationError> {
    let healthy = data.rows_where(Role::Judged, |row| row.is_healthy);
    if healthy.is_empty() {
        return Ok(None);
    }
    let alarms: Vec<usize> =
        healthy.iter().copied().filter(|&row| data.rows[row].is_detected()).collect();
    let shutdowns = data.commands(shutdowns);
    let of = healthy.len() as u64;
    let said = |hierarchy: &Hierarchy| -> Result<(Rate, Rate), EvaluationError> {
        let outcomes = run::ask(data, hierarchy, &alarms)?;
        let faults = outcomes.iter().filter(|outcome| outcome.said.actuator.is_some()).count();
        let shuts = |o: &&Outcome| o.said.action.is_some_and(|c| shutdowns.contains(&c));
        let shutdowns = outcomes.iter().filter(shuts).count();
        Ok((Rate::new(faults as u64, of), Rate::new(shutdowns as u64, of)))
    };
    let (trees, tree_shutdowns) = said(&trained.trees)?;
    let (committee, committee_shutdowns) = said(&trained.committee.hierarchy)?;
    Ok(Some(FalseAlarms {
        paper_alarms: Rate::of(&healthy, |&row| unbanded.rows[row].is_detected()),
        alarms: Rate::new(alarms.len() as u64, of),
        trees,
        tree_shutdowns,
        committee,
        committee_shutdowns,
    }))
}
