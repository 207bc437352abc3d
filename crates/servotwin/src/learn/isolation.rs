//! Isolation: what trees and committee decide together if a fault may also stay *not isolated*.
//!
//! A fault of a kind that was not trained has no right class. Something is wrong with its actuator, but nothing is shut
//! down because of it; a person or the limits on tracking and force decide. A fault is isolated where trees and committee
//! choose the same actuator and action, and training rows of that action resemble the fault ([`explained`]).

use super::data_set::{DataRow, DataSet};
use super::error::EvaluationError;
use super::protocol::{self, Protocol};
use super::run::RowOutcome;
use crate::parallel::{self, Workers};
use servotwin_diagnosis::hierarchy::{Question, StagePlace};
use servotwin_diagnosis::panel::agree;
use servotwin_learning::explained::{self, ExplainedActions, Origins};
use servotwin_learning::splits::Split;

pub use servotwin_learning::explained::LEVEL;

/// The protocols whose isolation is reported: kinds that were not trained, and known kinds under new commands.
pub(crate) const PROTOCOLS: [Protocol; 2] = [Protocol::KindLeftOut, Protocol::NewCommand];

/// Decides the faults of a protocol's splits from the answers of trees and committee: which of the committee's answers
/// count.
///
/// # Errors
/// The training rows teach no resemblance.
pub(crate) fn decide(
    protocol: Protocol,
    data: &DataSet,
    pool: bool,
    splits: &[Split],
    [trees, committee]: [&[Vec<RowOutcome>]; 2],
    workers: Workers,
) -> Result<Vec<Vec<RowOutcome>>, EvaluationError> {
    let places: Vec<usize> = (0..splits.len()).collect();
    let decide = |&split: &usize| {
        let known = learn(data, pool, protocol, &splits[split].train)?;
        let mut row = vec![0.0; data.features.len()];
        let fault = |(trees, outcome): (&RowOutcome, &RowOutcome)| {
            let [trees, both] = [trees, outcome].map(|o| o.said.actuator_and_action());
            let is_decided =
                agree(trees, both, 1.0, None) && is_explained(data, &known, outcome, &mut row);
            RowOutcome { is_decided, ..*outcome }
        };
        Ok(trees[split].iter().zip(&committee[split]).map(fault).collect())
    };
    parallel::map(&places, workers, decide)?.into_iter().collect()
}

/// Learns the explained actions of every stage that decides the action, from the detected faults among the rows.
fn learn(
    data: &DataSet,
    pool: bool,
    protocol: Protocol,
    train: &[usize],
) -> Result<Vec<(StagePlace, ExplainedActions)>, EvaluationError> {
    let clusters: Vec<u32> = data.rows.iter().map(|row| protocol::cluster(data, row)).collect();
    let cases = data.cases.len() as u32;
    // Rows of a new command share no command with the training rows. Where a kind is new, its cases are known. Then the
    // same fault of both actuators stays together, because one may be the symmetric copy of the other.
    let group = |(row, &cluster): (&DataRow, &u32)| match protocol {
        Protocol::NewCommand => row.flown,
        _ => cluster * cases + row.case,
    };
    let groups: Vec<u32> = data.rows.iter().zip(&clusters).map(group).collect();
    let mut rows = train.to_vec();
    rows.retain(|&row| {
        let row = &data.rows[row];
        !row.is_healthy && row.moved == 0 && row.is_detected()
    });
    let places = data.examples.places(pool).into_iter();
    let origins = Origins { clusters: &clusters, groups: &groups };
    let mut known = vec![];
    for place in places.filter(|place| place.question == Question::Action) {
        let learned = explained::learn(&data.examples, &place, &rows, origins, LEVEL)?;
        known.extend(learned.map(|learned| (place, learned)));
    }
    Ok(known)
}

/// Whether training rows of the decided action resemble the fault. Without an action there is nothing to explain.
fn is_explained(
    data: &DataSet,
    known: &[(StagePlace, ExplainedActions)],
    outcome: &RowOutcome,
    row: &mut [f64],
) -> bool {
    let Some((actuator, action)) = outcome.said.actuator.zip(outcome.said.action) else {
        return true;
    };
    let mut stages = known.iter().filter(|(place, _)| place.is_asked(actuator, action));
    let Some((place, known)) = stages.next() else { return false };
    data.examples.row_into(place.view(actuator), outcome.row, row);
    known.explains(row, action as usize)
}
