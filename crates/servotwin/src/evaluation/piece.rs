//! Splits an evaluation into pieces that can be computed separately, also on other machines, and joins them. Numbers
//! stored in a piece keep their bits.

use super::ablation::{self, Ablation};
use super::ambiguity::{self, Ambiguity};
use super::bands::Band;
use super::baseline::{self, RandomThirds};
use super::comparison::{self, Compared};
use super::isolation::{self, Isolation, IsolationInputs};
use super::protocol::{self, Holding, Protocol, ProtocolResult};
use super::run::{self, RowOutcome, Scope};
use super::{
    Context, DataSet, Evaluation, EvaluationError, EvaluationSettings, Training, TrainingFilter,
};
use super::{banded, commands, detection, false_alarms, flips};
use super::{silence, size};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_diagnosis::residual::BAND;

/// A piece of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Piece {
    /// The nine trees under a protocol.
    Trees(Protocol),
    /// The committee under a protocol.
    Committee(Protocol),
    /// The trees trained on fewer commands.
    Commands,
    /// Trees and committee with detection by the paper's band.
    PaperBand,
    /// The seed paper's trees.
    Baseline,
    /// The seed paper's test, repeated.
    RandomThirds,
    /// All classifiers.
    Classifiers,
    /// The ablation.
    Ablation,
    /// The diagnosis trained on all rows, and its data.
    Trained,
}

/// The result of a piece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Found {
    /// The trees' result and the confusions, if the protocol was possible.
    Trees(Option<(ProtocolResult, Option<Ambiguity>)>),
    /// The committee's result and what is decided with the trees, if the protocol was possible.
    Committee(Option<(ProtocolResult, Option<Isolation>)>),
    /// The trees' results by number of training commands.
    Commands(Vec<(usize, ProtocolResult)>),
    /// The results with detection by the paper's band.
    PaperBand(Vec<ProtocolResult>),
    /// The results of the seed paper's trees.
    Baseline(Vec<ProtocolResult>),
    /// Of the seed paper's trees in its own test, repeated.
    RandomThirds(Vec<RandomThirds>),
    /// Of all classifiers.
    Classifiers(Vec<Compared>),
    /// The ablation.
    Ablation(Vec<Ablation>),
    /// Everything else; the parts of the other pieces are empty.
    Trained(Box<Evaluation>),
}

/// The pieces of an evaluation, in order.
pub fn all(settings: &EvaluationSettings) -> Vec<Piece> {
    let has_several = settings.protocols.len() > 1;
    let trees = settings.protocols.iter().map(|&protocol| Piece::Trees(protocol));
    let committee = settings.committee_protocols.iter().map(|&p| Piece::Committee(p));
    let mut pieces: Vec<Piece> = trees.chain(committee).collect();
    pieces.extend((has_several && settings.learning_curve).then_some(Piece::Commands));
    pieces.extend(settings.learned_bands.then_some(Piece::PaperBand));
    pieces.extend(has_several.then_some(Piece::Baseline));
    // Where classifiers are compared, as in the paper.
    pieces.extend((!settings.classifiers.is_empty()).then_some(Piece::RandomThirds));
    pieces.push(Piece::Classifiers);
    pieces.extend(settings.ablation.then_some(Piece::Ablation));
    pieces.push(Piece::Trained);
    pieces
}

/// Joins the pieces of an evaluation, given in order.
///
/// # Panics
/// If [`Found::Trained`] is missing.
pub fn joined(found: Vec<Found>) -> Evaluation {
    let is_rest = |found: &Found| matches!(found, Found::Trained(_));
    let (rest, pieces): (Vec<Found>, Vec<Found>) = found.into_iter().partition(is_rest);
    let Some(Found::Trained(all)) = rest.into_iter().next() else {
        panic!("an evaluation looks at what was trained")
    };
    let mut all = *all;
    for piece in pieces {
        match piece {
            Found::Trees(of) => {
                let Some((result, ambiguity)) = of else { continue };
                all.protocols.push(result);
                all.ambiguity = ambiguity.unwrap_or(all.ambiguity);
            }
            Found::Committee(of) => {
                let Some((result, isolation)) = of else { continue };
                all.committee.push(result);
                all.isolation.extend(isolation);
            }
            Found::Commands(curve) => all.commands = curve,
            Found::PaperBand(results) => all.paper_band = results,
            Found::Baseline(results) => all.baseline = results,
            Found::RandomThirds(thirds) => all.random_thirds = thirds,
            Found::Classifiers(list) => all.classifiers = list,
            Found::Ablation(list) => all.ablation = list,
            Found::Trained(_) => (),
        }
    }
    all
}

/// The data with its band and settings, common to all pieces.
pub struct Bench<'b> {
    settings: &'b EvaluationSettings,
    context: &'b Context<'b>,
    unbanded: DataSet,
    data: DataSet,
    bands: Option<Vec<Band>>,
    training: Training,
}

impl<'b> Bench<'b> {
    /// Prepares an evaluation.
    pub fn new(data: &DataSet, settings: &'b EvaluationSettings, context: &'b Context<'b>) -> Self {
        let unbanded = match data.sensors.is_empty() {
            true => data.clone(),
            false => data.with_bands(&vec![BAND; data.sensors.len()]),
        };
        let (data, bands) = banded(data, settings, context.pools);
        let training = run::settled(&data, &settings.training);
        Bench { settings, context, unbanded, data, bands, training }
    }

    /// Evaluates a piece.
    ///
    /// # Errors
    /// [`EvaluationError::NothingDetectable`], or training fails.
    pub fn evaluate(&self, piece: Piece) -> Result<Found, EvaluationError> {
        let Self { settings, data, training, .. } = self;
        let workers = self.context.workers;
        let (of_trees, of_boosted) = (settings.holding.lessons, settings.committee_lessons);
        self.tell(piece);
        Ok(match piece {
            Piece::Trees(Protocol::NewCommand) => {
                let trees = &self.context.trained.trees;
                let found = self.judged_trained(trees, of_trees)?;
                Found::Trees(found.map(|result| (result, None)))
            }
            Piece::Trees(protocol) => {
                let found = self.judged(protocol, data, training, of_trees)?;
                Found::Trees(found.map(|(result, outcomes)| {
                    let is_traced = protocol.scope() == Scope::AllTracing;
                    (result, is_traced.then(|| ambiguity::evaluate(data, &outcomes)))
                }))
            }
            Piece::Committee(Protocol::NewCommand) => {
                let committee = &self.context.trained.committee.hierarchy;
                let found = self.judged_trained(committee, of_boosted)?;
                let isolation = self.isolation(Protocol::NewCommand, &[])?;
                Found::Committee(found.map(|result| (result, isolation)))
            }
            // The committee is calibrated on training commands.
            Piece::Committee(_) if !data.has_training() => Found::Committee(None),
            Piece::Committee(protocol) => {
                let data = &data.for_committee()?;
                match self.judged(protocol, data, &settings.committee, of_boosted)? {
                    None => Found::Committee(None),
                    Some((result, outcomes)) => {
                        Found::Committee(Some((result, self.isolation(protocol, &outcomes)?)))
                    }
                }
            }
            Piece::Commands => Found::Commands(commands(data, settings, workers)?),
            Piece::PaperBand if self.bands.is_none() => Found::PaperBand(vec![]),
            Piece::PaperBand => {
                let both = [
                    (&self.unbanded, &settings.training, of_trees),
                    (&self.unbanded.for_committee()?, &settings.committee, of_boosted),
                ];
                let of = |(data, training, lessons)| {
                    self.judged(Protocol::NewCommand, data, training, lessons)
                };
                let found: Result<Vec<_>, _> = both.into_iter().map(of).collect();
                Found::PaperBand(found?.into_iter().flatten().map(|(result, _)| result).collect())
            }
            Piece::Baseline => {
                Found::Baseline(baseline::evaluate(self.context.all_features, settings, workers)?)
            }
            Piece::RandomThirds => {
                let data = self.context.all_features;
                Found::RandomThirds(baseline::random_thirds(data, settings, workers)?)
            }
            Piece::Classifiers => {
                let (list, holding) = (&settings.classifiers, settings.comparison_holding);
                let compared = comparison::evaluate(data, training, list, holding, workers)?;
                Found::Classifiers(compared)
            }
            Piece::Ablation => {
                // Perturbed windows would not change the comparison of feature families.
                let still = data.without(|row| row.moved > 0);
                Found::Ablation(ablation::evaluate(&still, training, settings.holding, workers)?)
            }
            Piece::Trained => Found::Trained(Box::new(self.trained()?)),
        })
    }

    fn judged(
        &self,
        protocol: Protocol,
        data: &DataSet,
        training: &Training,
        lessons: TrainingFilter,
    ) -> Result<Option<protocol::JudgedProtocol>, EvaluationError> {
        let Self { settings, context, .. } = self;
        let holding = Holding { lessons, ..settings.holding };
        let shutdowns = &settings.shutdowns;
        protocol::evaluate(protocol, data, training, holding, shutdowns, context.workers)
    }

    /// What trees and committee decide if a fault may stay not isolated.
    fn isolation(
        &self,
        protocol: Protocol,
        committee: &[Vec<RowOutcome>],
    ) -> Result<Option<Isolation>, EvaluationError> {
        if !isolation::PROTOCOLS.contains(&protocol) {
            return Ok(None);
        }
        let Context { trained, workers, .. } = *self.context;
        let inputs =
            IsolationInputs { data: &self.data, settings: self.settings, trained, workers };
        inputs.evaluate(protocol, committee)
    }

    /// The result on new commands of the diagnosis trained on all training rows.
    fn judged_trained(
        &self,
        trained: &Hierarchy,
        lessons: TrainingFilter,
    ) -> Result<Option<ProtocolResult>, EvaluationError> {
        let holding = Holding { lessons, ..self.settings.holding };
        protocol::evaluate_trained(&self.data, trained, holding, &self.settings.shutdowns)
    }

    fn trained(&self) -> Result<Evaluation, EvaluationError> {
        let Self { settings, context, unbanded, data, .. } = self;
        let trained = context.trained;
        let silence = silence(data, settings, trained)?;
        let (abstention, reliability) = silence.map_or((None, None), |(a, r)| (Some(a), Some(r)));
        Ok(Evaluation {
            detection: detection::evaluate(data),
            paper_detection: detection::share(unbanded, true),
            bands: self.bands.clone(),
            features: data.features.len(),
            constant_features: data.constant.clone(),
            abstention,
            reliability,
            flips: flips(data, trained, context)?,
            ambiguity: ambiguity::evaluate(data, &[]),
            stages: trained.trees.stages.iter().map(|stage| size(&trained.trees, stage)).collect(),
            false_alarms: false_alarms(unbanded, data, trained, &settings.shutdowns)?,
            protocols: vec![],
            committee: vec![],
            isolation: vec![],
            paper_band: vec![],
            commands: vec![],
            baseline: vec![],
            random_thirds: vec![],
            classifiers: vec![],
            ablation: vec![],
        })
    }

    /// Reports the current step and the approximate progress.
    fn tell(&self, piece: Piece) {
        let place = |protocol| self.settings.protocols.iter().position(|p| *p == protocol);
        let (what, share) = match piece {
            Piece::Trees(protocol) => {
                (protocol.title(), 0.075 * place(protocol).unwrap_or(0) as f64)
            }
            Piece::Committee(_) => ("committee", 0.3),
            Piece::Commands => ("fewer commands", 0.4),
            Piece::PaperBand => ("the fixed band", 0.45),
            Piece::Baseline => ("trees of fewer features", 0.5),
            Piece::RandomThirds => ("the seed paper's test", 0.52),
            Piece::Classifiers => ("comparing classifiers", 0.55),
            Piece::Ablation => ("taking parts away", 0.8),
            Piece::Trained => ("moving windows", 0.9),
        };
        (self.context.progress)(what, share);
    }
}
