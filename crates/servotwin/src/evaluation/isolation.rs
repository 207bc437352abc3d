//! Isolation: what trees and committee decide if a fault may also stay *not isolated*.
//!
//! A fault of a kind that was not trained has no right class. Something is wrong with its actuator, but nothing is shut
//! down because of it; a person or the limits on tracking and force decide. Four rules are compared, each stricter than
//! the one before. [`RULE`] is the one that costs known kinds little.

use super::data_set::DataSet;
use super::error::EvaluationError;
use super::protocol::{self, Holding, Protocol, trial};
use super::run::{self, RowOutcome, first_error};
use super::{EvaluationSettings, Trained};
use crate::parallel::{self, Workers};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::explained::{ExplainedActions, Explanation};
use servotwin_diagnosis::hierarchy::{Question, StagePlace};
use servotwin_diagnosis::panel::agree;
use servotwin_learning::explained::{self, LEVEL, Origins};
use servotwin_learning::metrics::{Rate, Trial};

/// The protocols whose isolation is reported: kinds that were not trained, and known kinds under new commands.
pub(crate) const PROTOCOLS: [Protocol; 2] = [Protocol::KindLeftOut, Protocol::NewCommand];

/// When a fault counts as isolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IsolationRule {
    /// Always, by the committee.
    Always,
    /// Where trees and committee choose the same actuator and action.
    Agreement,
    /// Where they agree, and training rows of that action resemble the fault.
    Explained,
    /// Where they agree, and training rows of that action alone resemble the fault.
    ExplainedAlone,
}

/// The rule that results quote: an unknown kind must resemble the training rows of an action before it is decided.
pub const RULE: IsolationRule = IsolationRule::Explained;

impl IsolationRule {
    /// All rules, each stricter than the one before.
    pub const ALL: [IsolationRule; 4] = [
        IsolationRule::Always,
        IsolationRule::Agreement,
        IsolationRule::Explained,
        IsolationRule::ExplainedAlone,
    ];

    fn isolates(self, judged: &JudgedFault) -> bool {
        let (agrees, explanation) = (judged.agrees, judged.explanation);
        match self {
            IsolationRule::Always => true,
            IsolationRule::Agreement => agrees,
            IsolationRule::Explained => agrees && explanation != Explanation::No,
            IsolationRule::ExplainedAlone => agrees && explanation == Explanation::Only,
        }
    }
}

/// The decisions under a rule. The faults are the detected ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IsolationRates {
    /// The rule.
    pub rule: IsolationRule,
    /// Faults that are decided.
    pub decided: Rate,
    /// Of the decided faults: actuator and action are right.
    pub right_action: Rate,
    /// Of all faults: actuator and action are right, or the fault is not isolated.
    pub right_or_not_isolated: Rate,
    /// Of all faults: a healthy actuator is shut down.
    pub wrong_actuator_shutdown: Rate,
    /// Of the faults that need a shutdown: their actuator is not shut down, because of a wrong decision or none.
    pub missed_shutdown: Rate,
    /// Of the other faults: their actuator is shut down.
    pub needless_shutdown: Rate,
}

/// The decisions under a protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Isolation {
    /// The protocol.
    pub protocol: Protocol,
    /// The display title.
    pub title: String,
    /// Share of known rows that their own action may leave unexplained.
    pub level: f64,
    /// The decisions under each rule.
    pub rules: Vec<IsolationRates>,
    /// The kinds of fault that [`RULE`] decides wrongly, with the share of their faults, most faults first.
    pub wrong_kinds: Vec<(String, Rate)>,
}

impl Isolation {
    /// The decisions under a rule.
    pub fn rates(&self, rule: IsolationRule) -> Option<&IsolationRates> {
        self.rules.iter().find(|rates| rates.rule == rule)
    }
}

/// A held-out fault: the committee's outcome, and whether trees and training rows support it.
struct JudgedFault {
    outcome: RowOutcome,
    agrees: bool,
    explanation: Explanation,
}

/// The inputs of an evaluation.
pub(crate) struct IsolationInputs<'i> {
    /// The data with the features of the trees.
    pub data: &'i DataSet,
    pub settings: &'i EvaluationSettings,
    /// The diagnosis trained on all rows.
    pub trained: &'i Trained,
    /// The worker threads.
    pub workers: Workers<'i>,
}

impl IsolationInputs<'_> {
    /// Evaluates one of [`PROTOCOLS`]. `committee` holds the committee's outcomes where kinds are left out. `None` if
    /// nothing is judged.
    ///
    /// # Errors
    /// Training fails.
    pub(crate) fn evaluate(
        &self,
        protocol: Protocol,
        committee: &[Vec<RowOutcome>],
    ) -> Result<Option<Isolation>, EvaluationError> {
        let Self { data, settings, trained, workers } = self;
        let holding = Holding { lessons: settings.committee_lessons, ..settings.holding };
        let splits = protocol::judged_splits(protocol, data, holding)?;
        if splits.is_empty() {
            return Ok(None);
        }
        let (trees, committee) = match protocol {
            Protocol::NewCommand => {
                let ask = |hierarchy| run::ask(data, hierarchy, &splits[0].test);
                (vec![ask(&trained.trees)?], vec![ask(&trained.committee.hierarchy)?])
            }
            _ => {
                let scope = protocol.scope();
                let trees = run::run(data, &settings.training, &splits, scope, *workers)?;
                (trees, committee.to_vec())
            }
        };
        let of_committee = &data.for_committee()?;
        let places: Vec<usize> = (0..splits.len()).collect();
        let judge = |&split: &usize| {
            let known = learn(of_committee, settings, protocol, &splits[split].train)?;
            judge(of_committee, &known, &trees[split], &committee[split])
        };
        let judged: Result<Vec<_>, _> =
            parallel::map(&places, *workers, judge)?.into_iter().collect();
        let judged: Vec<JudgedFault> = judged?.into_iter().flatten().collect();
        let shutdowns = data.commands(&settings.shutdowns);
        let rates = |rule| rates(data, &judged, rule, &shutdowns);
        Ok(Some(Isolation {
            protocol,
            title: protocol.title().into(),
            level: LEVEL,
            rules: IsolationRule::ALL.map(rates).into(),
            wrong_kinds: wrong_kinds(data, &judged),
        }))
    }
}

fn judge(
    data: &DataSet,
    known: &[(StagePlace, ExplainedActions)],
    trees: &[RowOutcome],
    committee: &[RowOutcome],
) -> Result<Vec<JudgedFault>, EvaluationError> {
    let mut row = vec![0.0; data.features.len()];
    let fault = |(of_trees, outcome): (&RowOutcome, &RowOutcome)| {
        let [trees, committee] = [of_trees, outcome].map(|o| o.said.actuator_and_action());
        Ok(JudgedFault {
            outcome: *outcome,
            agrees: agree(trees, committee, 1.0, None),
            explanation: explain(data, known, outcome, &mut row)?,
        })
    };
    trees.iter().zip(committee).map(fault).collect()
}

/// Learns the explained actions of every stage that decides the action, from the detected faults among the rows.
fn learn(
    data: &DataSet,
    settings: &EvaluationSettings,
    protocol: Protocol,
    train: &[usize],
) -> Result<Vec<(StagePlace, ExplainedActions)>, EvaluationError> {
    let clusters: Vec<u32> = data.rows.iter().map(|row| protocol::cluster(data, row)).collect();
    let cases = data.cases.len() as u32;
    // Rows of a new command share no command with the training rows. Where a kind is new, its cases are known. Then the
    // same fault of both actuators stays together, because one may be the symmetric copy of the other.
    let group = |(row, &cluster): (&super::data_set::DataRow, &u32)| match protocol {
        Protocol::NewCommand => row.flown,
        _ => cluster * cases + row.case,
    };
    let groups: Vec<u32> = data.rows.iter().zip(&clusters).map(group).collect();
    let mut rows = train.to_vec();
    rows.retain(|&row| {
        let row = &data.rows[row];
        !row.is_healthy && row.moved == 0 && row.is_detected()
    });
    let pool = run::settled(data, &settings.committee).pool;
    let places = data.examples.places(pool).into_iter();
    let origins = Origins { clusters: &clusters, groups: &groups };
    let mut known = vec![];
    for place in places.filter(|place| place.question == Question::Action) {
        let learned = explained::learn(&data.examples, &place, &rows, origins, LEVEL)?;
        known.extend(learned.map(|learned| (place, learned)));
    }
    Ok(known)
}

/// What the training rows say about the decided action. Without an action there is nothing to explain.
fn explain(
    data: &DataSet,
    known: &[(StagePlace, ExplainedActions)],
    outcome: &RowOutcome,
    row: &mut [f64],
) -> Result<Explanation, EvaluationError> {
    let Some((actuator, action)) = outcome.said.actuator.zip(outcome.said.action) else {
        return Ok(Explanation::Only);
    };
    let mut stages = known.iter().filter(|(place, _)| place.is_asked(actuator, action));
    let Some((place, known)) = stages.next() else { return Ok(Explanation::No) };
    data.examples.row_into(place.view(actuator), outcome.row, row);
    let mut distances = vec![0.0; known.rows.len()];
    known.distances_into(row, &mut known.scratch(), &mut distances)?;
    Ok(known.explanation(&distances, action as usize))
}

fn is_right(data: &DataSet, fault: &JudgedFault) -> bool {
    matches!(first_error(data, &fault.outcome), None | Some(Question::Detail))
}

fn wrong_kinds(data: &DataSet, judged: &[JudgedFault]) -> Vec<(String, Rate)> {
    let wrong = |kind: usize| {
        let own = judged.iter().filter(|fault| data.rows[fault.outcome.row].kind as usize == kind);
        let is_wrong = |fault: &&JudgedFault| RULE.isolates(fault) && !is_right(data, fault);
        (data.kinds[kind].clone(), Rate::of(&own.collect::<Vec<_>>(), is_wrong))
    };
    let mut kinds: Vec<(String, Rate)> = (0..data.kinds.len()).map(wrong).collect();
    kinds.retain(|(_, rate)| rate.count > 0);
    kinds.sort_by_key(|(_, rate)| core::cmp::Reverse(rate.count));
    kinds
}

fn rates(
    data: &DataSet,
    judged: &[JudgedFault],
    rule: IsolationRule,
    shutdowns: &[u32],
) -> IsolationRates {
    let rate = |among: &dyn Fn(&JudgedFault) -> bool, holds: &dyn Fn(&JudgedFault) -> bool| {
        let faults = judged.iter().filter(|fault| among(fault));
        let trials = faults.map(|fault| trial(data, fault.outcome.row, holds(fault)));
        Rate::clustered(&trials.collect::<Vec<Trial>>())
    };
    let label = |fault: &JudgedFault| data.examples.labels()[fault.outcome.row];
    let is_decided = |fault: &JudgedFault| rule.isolates(fault);
    let is_right = |fault: &JudgedFault| is_right(data, fault);
    let shuts_down = |fault: &JudgedFault| {
        let action = fault.outcome.said.action;
        is_decided(fault) && action.is_some_and(|action| shutdowns.contains(&action))
    };
    let is_own = |fault: &JudgedFault| fault.outcome.said.actuator == Some(label(fault).actuator);
    let shuts_own = |fault: &JudgedFault| shuts_down(fault) && is_own(fault);
    let needs = |fault: &JudgedFault| shutdowns.contains(&label(fault).action);
    IsolationRates {
        rule,
        decided: rate(&|_| true, &is_decided),
        right_action: rate(&is_decided, &is_right),
        right_or_not_isolated: rate(&|_| true, &|fault| !is_decided(fault) || is_right(fault)),
        wrong_actuator_shutdown: rate(&|_| true, &|fault| shuts_down(fault) && !is_own(fault)),
        missed_shutdown: rate(&needs, &|fault| !shuts_own(fault)),
        needless_shutdown: rate(&|fault| !needs(fault), &shuts_own),
    }
}
