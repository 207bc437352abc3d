//! Abstention: accuracy of the committee when it answers only if it is certain, or if the trees agree.

use super::data_set::DataSet;
use super::protocol::trial;
use super::run::{RowOutcome, first_error};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::hierarchy::Question;
use servotwin_diagnosis::panel::agree;
use servotwin_learning::metrics::{Rate, Trial};

/// The shares of least certain answers that are withheld.
pub const SHARES: [f64; 7] = [0.0, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2];

/// The remaining result when some answers are withheld.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Share of detected faults without an answer.
    pub abstained: Rate,
    /// Of the faults answered: actuator and action are right.
    pub right_action: Rate,
    /// Of the faults answered: the wrong actuator is shut down.
    pub wrong_actuator_shutdown: Rate,
    /// Of the answered faults that need a shutdown: the answer is wrong.
    pub shutdown_answered_wrongly: Rate,
}

/// The trade-off between abstention and errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Abstention {
    /// For each of [`SHARES`], the result without the least certain answers.
    pub levels: Vec<Level>,
    /// The result with a confidence threshold that would have withheld 2 % on training commands left out of training.
    pub fixed: Option<(f64, Level)>,
    /// The result if trees and committee must agree.
    pub agreement: Level,
    /// The result if both conditions must hold.
    pub both: Option<Level>,
}

/// Evaluates the trade-off over the outcomes of committee and trees on the same rows. `least` is a confidence threshold
/// chosen without these outcomes.
pub fn evaluate(
    data: &DataSet,
    committee: &[RowOutcome],
    trees: &[RowOutcome],
    least: Option<f64>,
    shutdowns: &[u32],
) -> Abstention {
    let mut order: Vec<usize> = (0..committee.len()).collect();
    let confidence = |place: usize| committee[place].said.confidence;
    // Stable sort: equally certain answers stay in row order.
    order.sort_by(|&a, &b| confidence(a).total_cmp(&confidence(b)));
    let level = |answers: &dyn Fn(usize) -> bool| level(data, committee, answers, shutdowns);
    let share = |share: &f64| {
        let silent = (share * committee.len() as f64).floor() as usize;
        let mut answered = vec![true; committee.len()];
        order[..silent].iter().for_each(|&place| answered[place] = false);
        level(&|place| answered[place])
    };
    let agrees = |place: usize, least: Option<f64>| {
        let [of_trees, of_committee] =
            [trees, committee].map(|said| said[place].said.actuator_and_action());
        agree(of_trees, of_committee, confidence(place), least)
    };
    let sure = |place: usize| least.is_some_and(|least| confidence(place) >= least);
    Abstention {
        levels: SHARES.iter().map(share).collect(),
        fixed: least.map(|least| (least, level(&sure))),
        agreement: level(&|place| agrees(place, None)),
        both: least.map(|_| level(&|place| agrees(place, least))),
    }
}

fn level(
    data: &DataSet,
    outcomes: &[RowOutcome],
    answers: &dyn Fn(usize) -> bool,
    shutdowns: &[u32],
) -> Level {
    let trials = |among: &dyn Fn(usize) -> bool, holds: &dyn Fn(&RowOutcome) -> bool| {
        let places = (0..outcomes.len()).filter(|&place| among(place));
        let of = |place: usize| trial(data, outcomes[place].row, holds(&outcomes[place]));
        Rate::clustered(&places.map(of).collect::<Vec<Trial>>())
    };
    let label = |outcome: &RowOutcome| data.examples.labels()[outcome.row];
    let is_right = |o: &RowOutcome| matches!(first_error(data, o), None | Some(Question::Detail));
    let wrong = |o: &RowOutcome| {
        let shuts = o.said.action.is_some_and(|command| shutdowns.contains(&command));
        shuts && o.said.actuator.is_some_and(|said| said != label(o).actuator)
    };
    let needs = |place: usize| shutdowns.contains(&label(&outcomes[place]).action);
    let abstained = (0..outcomes.len()).map(|p| trial(data, outcomes[p].row, !answers(p)));
    Level {
        abstained: Rate::clustered(&abstained.collect::<Vec<_>>()),
        right_action: trials(answers, &is_right),
        wrong_actuator_shutdown: trials(answers, &wrong),
        shutdown_answered_wrongly: trials(&|p| answers(p) && needs(p), &|o| !is_right(o)),
    }
}
