//! How good the diagnosis is, measured so that it cannot fool us.
//!
//! [`evaluate`] takes a campaign's data set and gives an [`Evaluation`]: what is detected at all,
//! the hierarchy of trees under every protocol, the seed paper's own trees beside it, all
//! classifiers, which features carry the result, which faults are taken for each other; and it looks
//! into the [`Hierarchy`] that [`train`] makes of all detectable rows. The same data set, settings and seeds give the
//! same bytes, on any number of threads.

pub mod ablation;
pub mod ambiguity;
pub mod comparison;
pub mod data_set;
pub mod detection;
mod error;
pub mod foreign;
pub mod leaves;
pub mod model_file;
pub mod parallel;
pub mod protocol;
pub mod run;
pub mod score;
pub mod traces;

pub use data_set::{DataSet, FeatureInfo};
pub use error::EvaluationError;

use parallel::Workers;
use protocol::{Holding, Protocol, ProtocolResult};
use score::Rate;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers;
use servotwin_diagnosis::hierarchy::{Hierarchy, Settings as Training};

/// What is evaluated, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// How the hierarchy is trained.
    pub training: Training,
    /// How rows are held out.
    pub holding: Holding,
    /// How rows are held out where many variations are compared.
    pub short_holding: Holding,
    /// How rows are held out where classifiers are compared.
    pub comparison_holding: Holding,
    /// The command that shuts an actuator down.
    pub shutdown: String,
    /// What residuals carry of noise, quantisation and numerical error, in parts of scale: a
    /// threshold that a feature cannot resolve with it is implausible.
    pub residual_error: f64,
    /// The family of features that the seed paper has.
    pub baseline_family: String,
    /// The classifiers to compare; none for no comparison.
    pub classifiers: Vec<classifiers::Settings>,
    /// Whether to take parts away.
    pub ablation: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            training: Training::default(),
            holding: Holding::default(),
            short_holding: Holding { deals: 1, ..Holding::default() },
            // Folds of a third: as much to learn from as in the random third.
            comparison_holding: Holding { repeats: 1, folds: 3, deals: 1, ..Holding::default() },
            shutdown: "shut_down".into(),
            // 0.2 %: the noise of a sensor (physics: pressure and displacement sensors).
            residual_error: 0.002,
            baseline_family: "moments".into(),
            classifiers: comparison::quick_classifiers(),
            ablation: true,
        }
    }
}

/// Splits that no sensor could resolve, and what they buy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Implausible {
    /// What residuals carry of noise, quantisation and numerical error, in parts of scale.
    pub residual_error: f64,
    /// The splits that trees want which may not use them.
    pub splits: Vec<leaves::ImplausibleSplit>,
    /// Accuracy of the actuator with them forbidden and allowed, grouped protocol.
    pub actuator: Option<(Rate, Rate)>,
    /// Accuracy of the command likewise.
    pub command: Option<(Rate, Rate)>,
}

/// The trees' size: what has to be flown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageSize {
    /// The stage.
    pub stage: String,
    /// Nodes, leaves included; `None` unless it is a tree.
    pub nodes: Option<usize>,
    /// Questions on the longest way.
    pub depth: Option<usize>,
    /// The features it asks for, with the share of the impurity decrease each bought.
    pub importances: Vec<(String, f64)>,
}

/// False alarms: what the hierarchy would do with fault-free specimens that left the band.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FalseAlarms {
    /// Specimens that left the band.
    pub alarms: Rate,
    /// Specimens of which an actuator would be shut down.
    pub shutdowns: Rate,
}

/// Everything measured on a data set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// What is detected at all.
    pub detection: detection::Detection,
    /// Number of features.
    pub features: usize,
    /// Features that are constant, and so say nothing.
    pub constant_features: Vec<String>,
    /// The hierarchy under every protocol.
    pub protocols: Vec<ProtocolResult>,
    /// The seed paper's trees: its features, nothing mirrored or pooled.
    pub baseline: Vec<ProtocolResult>,
    /// The classifiers compared.
    pub classifiers: Vec<comparison::Compared>,
    /// What each part carries.
    pub ablation: Vec<ablation::Ablation>,
    /// Which faults are taken for each other.
    pub ambiguity: ambiguity::Ambiguity,
    /// The least pure leaves of the final trees.
    pub worst_leaves: Vec<leaves::WorstLeaf>,
    /// Splits refused because no sensor could resolve them.
    pub implausible: Implausible,
    /// The final trees.
    pub stages: Vec<StageSize>,
    /// False alarms; `None` without fault-free specimens.
    pub false_alarms: Option<FalseAlarms>,
}

impl Evaluation {
    /// The hierarchy's result under a protocol.
    pub fn protocol(&self, protocol: Protocol) -> Option<&ProtocolResult> {
        self.protocols.iter().find(|result| result.protocol == protocol)
    }
}

/// The share of the time that each protocol takes, as measured on the paper's study.
const PROTOCOL_SHARE: f64 = 0.05;

/// The worst leaves shown of each tree.
const WORST_LEAVES: usize = 3;

/// Trains the hierarchy with all detectable rows.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`] and what training says.
pub fn train(data: &DataSet, training: &Training) -> Result<Hierarchy, EvaluationError> {
    Ok(run::settled(data, training).fit(&data.examples, &data.detectable()?)?)
}

/// Evaluates a data set, and the hierarchy trained with all its detectable rows. `progress` is told
/// what is being done, and roughly how much is done, from 0 to 1.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`] and what training says.
pub fn evaluate(
    data: &DataSet,
    hierarchy: &Hierarchy,
    settings: &Settings,
    workers: Workers,
    progress: &dyn Fn(&str, f64),
) -> Result<Evaluation, EvaluationError> {
    let Settings { holding, short_holding, .. } = *settings;
    let rows = data.detectable()?;
    let training = run::settled(data, &settings.training);
    let mut protocols = vec![];
    let mut ambiguity = ambiguity::evaluate(data, &[]);
    for (place, protocol) in protocol::ALL.into_iter().enumerate() {
        progress(protocol.title(), PROTOCOL_SHARE * place as f64);
        let found =
            protocol::evaluate(protocol, data, &training, holding, &settings.shutdown, workers)?;
        let Some((result, outcomes)) = found else {
            continue;
        };
        protocols.push(result);
        if protocol == Protocol::Grouped {
            ambiguity = ambiguity::evaluate(data, &outcomes);
        }
    }
    progress("the paper's trees", 0.25);
    let baseline = baseline(data, settings, workers)?;
    progress("comparing classifiers", 0.3);
    let list = &settings.classifiers;
    let compared = settings.comparison_holding;
    let classifiers = comparison::evaluate(data, &training, list, compared, workers)?;
    progress("taking parts away", 0.7);
    let ablation = match settings.ablation {
        true => ablation::evaluate(data, &training, short_holding, workers)?,
        false => vec![],
    };
    progress("implausible splits", 0.95);
    let evaluation = Evaluation {
        detection: detection::evaluate(data),
        features: data.features.len(),
        constant_features: data.constant.clone(),
        worst_leaves: leaves::worst(data, &training, hierarchy, &rows, WORST_LEAVES)?,
        implausible: implausible(data, settings, workers)?,
        stages: hierarchy.stages.iter().map(|stage| size(hierarchy, stage)).collect(),
        false_alarms: false_alarms(data, hierarchy, &settings.shutdown)?,
        protocols,
        baseline,
        classifiers,
        ablation,
        ambiguity,
    };
    Ok(evaluation)
}

/// The paper's trees: its family of features, each actuator for itself, no mirror images.
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
    let holding = settings.holding;
    let mut results = vec![];
    for protocol in [Protocol::RandomThird, Protocol::Grouped, Protocol::LeaveCaseOut] {
        let shutdown = &settings.shutdown;
        let found = protocol::evaluate(protocol, &data, &training, holding, shutdown, workers)?;
        results.extend(found.map(|(result, _)| result));
    }
    Ok(results)
}

/// Trains once more with every feature's resolution, and compares.
fn implausible(
    data: &DataSet,
    settings: &Settings,
    workers: Workers,
) -> Result<Implausible, EvaluationError> {
    let residual_error = settings.residual_error;
    let resolutions = data.resolutions(residual_error);
    let forbidden = Training { resolutions, ..settings.training.clone() };
    let splits = leaves::implausible(&train(data, &forbidden)?);
    let mut compared = Implausible { residual_error, splits, actuator: None, command: None };
    if compared.splits.is_empty() {
        return Ok(compared);
    }
    let result = |training: &Training| {
        let short_holding = settings.short_holding;
        let shutdown = &settings.shutdown;
        protocol::evaluate(Protocol::Grouped, data, training, short_holding, shutdown, workers)
    };
    let allowed = Training { resolutions: vec![], ..settings.training.clone() };
    let (forbidden, allowed) = (result(&forbidden)?, result(&allowed)?);
    let pair = |id: &str| {
        let of = |result: &Option<(ProtocolResult, _)>| {
            result.as_ref().and_then(|(result, _)| Some(result.stage(id)?.accuracy))
        };
        of(&forbidden).zip(of(&allowed))
    };
    (compared.actuator, compared.command) = (pair("A"), pair("B"));
    Ok(compared)
}

fn size(hierarchy: &Hierarchy, stage: &servotwin_diagnosis::hierarchy::Stage) -> StageSize {
    let classifiers::Model::Cart(tree) = &stage.model else {
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

fn false_alarms(
    data: &DataSet,
    hierarchy: &Hierarchy,
    shutdown: &str,
) -> Result<Option<FalseAlarms>, EvaluationError> {
    let Some(healthy) = &data.healthy else {
        return Ok(None);
    };
    let shutdown = hierarchy.names.commands.iter().position(|name| name == shutdown);
    let mut scratch = hierarchy.scratch();
    let mut views = vec![vec![0.0; data.features.len()]; healthy.views()];
    let mut shutdowns = 0;
    let alarms: Vec<usize> = (0..data.alarms.len()).filter(|&row| data.alarms[row]).collect();
    for &row in &alarms {
        for (view, values) in views.iter_mut().enumerate() {
            healthy.row_into(view, row, values);
        }
        let rows: Vec<&[f64]> = views.iter().map(Vec::as_slice).collect();
        let said = hierarchy.diagnose(&rows, &mut scratch)?.command;
        shutdowns += u64::from(shutdown.is_some() && said.map(|c| c as usize) == shutdown);
    }
    let of = data.alarms.len() as u64;
    Ok(Some(FalseAlarms {
        alarms: Rate::new(alarms.len() as u64, of),
        shutdowns: Rate::new(shutdowns, of),
    }))
}
