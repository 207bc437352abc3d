//! The protocols: how rows are held out, and what is reported of each.
//!
//! A protocol is only as honest as the likeness of its training and test rows. From the kindest to
//! the hardest:
//! - a random third, as the seed paper: nearly every test row has a neighbour of the same fault and
//!   intensity in another operating case. Only the same fault of the other actuator in the same case
//!   stays on the same side: without tolerances it is the row's exact mirror image, and a hierarchy
//!   that learns from mirror images would have seen the test row;
//! - groups of one kind and one intensity stay together, mirror images included;
//! - one intensity is left out of every fault;
//! - one operating case is left out;
//! - one kind of fault is left out, for the stage that finds the actuator.

use super::data_set::DataSet;
use super::error::EvaluationError;
use super::parallel::Workers;
use super::run::{Outcome, Scope, first_error, run};
use super::score::{Prediction, Rate, Score};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::evaluation::{
    HELD_OUT, Split, grouped_k_fold, leave_one_group_out, repeated_hold_out,
};
use servotwin_diagnosis::hierarchy::{Place, Question, Settings};

/// A way to hold rows out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// A third of the rows at random, repeated.
    RandomThird,
    /// Folds of groups; a group is one kind at one intensity.
    Grouped,
    /// One intensity at a time.
    LeaveIntensityOut,
    /// One operating case at a time.
    LeaveCaseOut,
    /// One kind of fault at a time, for the stage that finds the actuator.
    LeaveKindOut,
}

/// Every protocol, from the kindest to the hardest.
pub const ALL: [Protocol; 5] = [
    Protocol::RandomThird,
    Protocol::Grouped,
    Protocol::LeaveIntensityOut,
    Protocol::LeaveCaseOut,
    Protocol::LeaveKindOut,
];

/// How often and how finely rows are held out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holding {
    /// Number of random thirds.
    pub repeats: usize,
    /// Number of folds of groups.
    pub folds: usize,
    /// How often the folds are dealt anew.
    pub deals: usize,
    /// The seed.
    pub seed: u64,
}

impl Default for Holding {
    fn default() -> Self {
        Holding { repeats: 10, folds: 5, deals: 2, seed: 1 }
    }
}

impl Protocol {
    /// What it is called.
    pub fn title(self) -> &'static str {
        match self {
            Protocol::RandomThird => "a random third held out",
            Protocol::Grouped => "same fault and intensity kept together",
            Protocol::LeaveIntensityOut => "one intensity left out",
            Protocol::LeaveCaseOut => "one operating case left out",
            Protocol::LeaveKindOut => "one kind of fault left out (actuator only)",
        }
    }

    /// How much of the hierarchy makes sense under it.
    pub fn scope(self) -> Scope {
        match self {
            Protocol::LeaveKindOut => Scope::Actuator,
            Protocol::Grouped => Scope::AllTracing,
            _ => Scope::All,
        }
    }

    /// The splits of the detectable rows; none where there are too few groups to leave one out.
    ///
    /// # Errors
    /// [`EvaluationError::NothingDetectable`] and what making splits says.
    pub fn splits(self, data: &DataSet, holding: Holding) -> Result<Vec<Split>, EvaluationError> {
        let rows = data.detectable()?;
        let Holding { repeats, folds, deals, seed } = holding;
        let groups =
            |key: &dyn Fn(usize) -> u32| rows.iter().map(|&row| key(row)).collect::<Vec<u32>>();
        let of = |row: usize| &data.rows[row];
        let intensities = data.intensities.len() as u32;
        let splits = match self {
            Protocol::RandomThird => {
                let case = data.cases.len() as u32;
                let kind_at = |row: usize| of(row).kind * intensities + of(row).intensity;
                thirds(&groups(&|row| kind_at(row) * case + of(row).case), repeats, seed)?
            }
            Protocol::Grouped => {
                let groups = groups(&|row| of(row).kind * intensities + of(row).intensity);
                dealt(&groups, folds, deals, seed)?
            }
            Protocol::LeaveIntensityOut => left_out(&groups(&|row| of(row).intensity))?,
            Protocol::LeaveCaseOut => left_out(&groups(&|row| of(row).case))?,
            Protocol::LeaveKindOut => left_out(&groups(&|row| of(row).kind))?,
        };
        let real = |places: &[usize]| places.iter().map(|&place| rows[place]).collect();
        let split = |split: &Split| Split { train: real(&split.train), test: real(&split.test) };
        Ok(splits.iter().map(split).collect())
    }
}

/// Random thirds in which rows of a group stay together.
fn thirds(groups: &[u32], repeats: usize, seed: u64) -> Result<Vec<Split>, EvaluationError> {
    let mut names = groups.to_vec();
    names.sort_unstable();
    names.dedup();
    if names.len() < 2 {
        return Ok(vec![]);
    }
    let held_out = repeated_hold_out(names.len(), HELD_OUT, repeats, seed)?;
    let spread = |split: &Split| {
        let is_test = |row: &usize| {
            let place = names.binary_search(&groups[*row]);
            place.is_ok_and(|place| split.test.binary_search(&place).is_ok())
        };
        let (test, train) = (0..groups.len()).partition(is_test);
        Split { train, test }
    };
    Ok(held_out.iter().map(spread).collect())
}

fn dealt(
    groups: &[u32],
    folds: usize,
    deals: usize,
    seed: u64,
) -> Result<Vec<Split>, EvaluationError> {
    let mut splits = vec![];
    for deal in 0..deals {
        if count_groups(groups) >= folds {
            splits.extend(grouped_k_fold(groups, folds, seed + deal as u64)?);
        }
    }
    Ok(splits)
}

fn left_out(groups: &[u32]) -> Result<Vec<Split>, EvaluationError> {
    if count_groups(groups) < 2 {
        return Ok(vec![]);
    }
    Ok(leave_one_group_out(groups)?)
}

fn count_groups(groups: &[u32]) -> usize {
    let mut groups = groups.to_vec();
    groups.sort_unstable();
    groups.dedup();
    groups.len()
}

/// One stage of the hierarchy, asked about the rows that are truly its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageScore {
    /// The paper's letter, with the actuator's number where only its rows are counted.
    pub id: String,
    /// What the stage decides.
    pub question: Question,
    /// The actuator whose rows are counted; `None` for all.
    pub actuator: Option<String>,
    /// The command within which details are told apart.
    pub command: Option<String>,
    /// The score.
    pub score: Score,
}

/// What errors would do to the aircraft. Every rate is of detected faults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Safety {
    /// The fault is given to the wrong actuator.
    pub wrong_actuator: Rate,
    /// A healthy actuator is shut down because the other one has a fault.
    pub wrong_actuator_shutdown: Rate,
    /// A fault that needs a shutdown does not get it (of the faults that need one).
    pub missed_shutdown: Rate,
    /// The right actuator is shut down where less would do (of the faults that need no shutdown).
    pub needless_shutdown: Rate,
}

/// Errors by the component that is broken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentScore {
    /// The component, without the actuator.
    pub component: String,
    /// Its faults are given to the wrong actuator.
    pub wrong_actuator: Rate,
    /// Its faults shut the healthy actuator down.
    pub wrong_actuator_shutdown: Rate,
    /// Actuator, command and detail are right.
    pub right: Rate,
}

/// What a protocol says about a hierarchy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProtocolResult {
    /// Which protocol.
    pub protocol: Protocol,
    /// What it is called.
    pub title: String,
    /// Number of splits.
    pub splits: usize,
    /// Each stage by itself: first over both actuators, then for each.
    pub stages: Vec<StageScore>,
    /// All stages together: actuator, command and detail are right (isolation rate of what was
    /// detected).
    pub end_to_end: Option<Rate>,
    /// Actuator and command are right: all that the flight control computer acts on.
    pub right_action: Option<Rate>,
    /// Detected and isolated, as a share of all faults, the undetectable ones included.
    pub isolated_of_all: Option<f64>,
    /// What errors would do.
    pub safety: Option<Safety>,
    /// Errors by component.
    pub components: Vec<ComponentScore>,
}

impl ProtocolResult {
    /// The score of a stage by its letter.
    pub fn stage(&self, id: &str) -> Option<&Score> {
        self.stages.iter().find(|stage| stage.id == id).map(|stage| &stage.score)
    }
}

/// A protocol's result, and the outcome of every held-out row, split by split.
type Judged = (ProtocolResult, Vec<Vec<Outcome>>);

/// Runs a protocol; with the outcomes from which the result was counted. `None` where the data set
/// has too few groups for it.
///
/// # Errors
/// What training says.
pub fn evaluate(
    protocol: Protocol,
    data: &DataSet,
    settings: &Settings,
    holding: Holding,
    shutdown: &str,
    workers: Workers,
) -> Result<Option<Judged>, EvaluationError> {
    let single = data.examples.names().actuators.len() == 1;
    if single && protocol.scope() == Scope::Actuator {
        return Ok(None);
    }
    let splits = protocol.splits(data, holding)?;
    if splits.is_empty() {
        return Ok(None);
    }
    let outcomes = run(data, settings, &splits, protocol.scope(), workers)?;
    let result = summary(protocol, data, &outcomes, shutdown);
    Ok(Some((result, outcomes)))
}

/// Counts a protocol's result from its outcomes.
pub fn summary(
    protocol: Protocol,
    data: &DataSet,
    outcomes: &[Vec<Outcome>],
    shutdown: &str,
) -> ProtocolResult {
    let counting = Counting::new(data, outcomes, shutdown);
    let full = protocol.scope() != Scope::Actuator;
    let right = counting.rate(|_| true, |outcome| first_error(data, outcome).is_none());
    let acted =
        |outcome: &Outcome| matches!(first_error(data, outcome), None | Some(Question::Detail));
    let detected = Rate::of(&data.rows, |row| row.detectable).share;
    ProtocolResult {
        protocol,
        title: protocol.title().into(),
        splits: outcomes.len(),
        stages: stage_scores(data, outcomes, full),
        end_to_end: full.then_some(right),
        right_action: full.then(|| counting.rate(|_| true, acted)),
        isolated_of_all: right.share.zip(detected).filter(|_| full).map(|(a, b)| a * b),
        safety: full.then(|| counting.safety()),
        components: if full { counting.components() } else { vec![] },
    }
}

fn stage_scores(data: &DataSet, outcomes: &[Vec<Outcome>], full: bool) -> Vec<StageScore> {
    let actuators = data.examples.names().actuators.len();
    let mut places = data.examples.places(true);
    if actuators > 1 {
        let own = data.examples.places(false);
        places.extend(own.into_iter().filter(|place| place.question != Question::Actuator));
    }
    places.retain(|place| full || place.question == Question::Actuator);
    places.iter().map(|place| stage_score(data, outcomes, place)).collect()
}

fn stage_score(data: &DataSet, outcomes: &[Vec<Outcome>], place: &Place) -> StageScore {
    let names = data.examples.names();
    let classes = data.examples.classes(place);
    let local = |class: u32| classes.iter().position(|known| *known == class).map(|c| c as u32);
    let prediction = |outcome: &Outcome| -> Option<Prediction> {
        let truth = data.examples.labels()[outcome.row];
        if !place.is_asked(truth.actuator, truth.command) {
            return None;
        }
        let (truth, said) = match place.question {
            Question::Actuator => (truth.actuator, Some(outcome.said.actuator)),
            Question::Command => (truth.command, outcome.command),
            Question::Detail => (truth.detail, outcome.detail),
        };
        Some((outcome.row, local(truth)?, said.and_then(local)))
    };
    let splits: Vec<Vec<Prediction>> =
        outcomes.iter().map(|split| split.iter().filter_map(prediction).collect()).collect();
    let class_names = classes.iter().map(|&c| names.class_name(place.question, c).to_owned());
    StageScore {
        id: place.id(),
        question: place.question,
        actuator: place.actuator.map(|actuator| names.actuators[actuator as usize].clone()),
        command: place.command.map(|command| names.commands[command as usize].clone()),
        score: Score::of(class_names.collect(), &splits),
    }
}

/// Counts over the outcomes of a protocol.
struct Counting<'a> {
    data: &'a DataSet,
    outcomes: Vec<&'a Outcome>,
    /// The command that shuts an actuator down.
    shutdown: Option<u32>,
}

impl<'a> Counting<'a> {
    fn new(data: &'a DataSet, outcomes: &'a [Vec<Outcome>], shutdown: &str) -> Self {
        let commands = &data.examples.names().commands;
        let shutdown = commands.iter().position(|name| name == shutdown).map(|c| c as u32);
        Counting { data, outcomes: outcomes.iter().flatten().collect(), shutdown }
    }

    fn rate(&self, among: impl Fn(&Outcome) -> bool, holds: impl Fn(&Outcome) -> bool) -> Rate {
        let asked: Vec<&&Outcome> = self.outcomes.iter().filter(|outcome| among(outcome)).collect();
        let count = asked.iter().filter(|outcome| holds(outcome)).count();
        let mut rows: Vec<usize> = asked.iter().map(|outcome| outcome.row).collect();
        rows.sort_unstable();
        rows.dedup();
        Rate::repeated(count as u64, asked.len() as u64, rows.len() as u64)
    }

    fn is_wrong_actuator(&self, outcome: &Outcome) -> bool {
        outcome.said.actuator != self.data.examples.labels()[outcome.row].actuator
    }

    fn shuts_down(&self, outcome: &Outcome) -> bool {
        self.shutdown.is_some() && outcome.said.command == self.shutdown
    }

    fn needs_shutdown(&self, outcome: &Outcome) -> bool {
        Some(self.data.examples.labels()[outcome.row].command) == self.shutdown
    }

    fn safety(&self) -> Safety {
        let wrong = |outcome: &Outcome| self.is_wrong_actuator(outcome);
        let wrong_shutdown = |outcome: &Outcome| wrong(outcome) && self.shuts_down(outcome);
        let right_shutdown = |outcome: &Outcome| !wrong(outcome) && self.shuts_down(outcome);
        let needed = |outcome: &Outcome| self.needs_shutdown(outcome);
        Safety {
            wrong_actuator: self.rate(|_| true, wrong),
            wrong_actuator_shutdown: self.rate(|_| true, wrong_shutdown),
            missed_shutdown: self.rate(needed, |outcome| !right_shutdown(outcome)),
            needless_shutdown: self.rate(|outcome| !needed(outcome), right_shutdown),
        }
    }

    fn components(&self) -> Vec<ComponentScore> {
        let component = |outcome: &Outcome| self.data.component(self.data.rows[outcome.row].kind);
        let mut names: Vec<&str> = self.outcomes.iter().map(|outcome| component(outcome)).collect();
        names.sort_unstable();
        names.dedup();
        let score = |name: &&str| {
            let own = |outcome: &Outcome| component(outcome) == *name;
            let wrong = |outcome: &Outcome| self.is_wrong_actuator(outcome);
            ComponentScore {
                component: (*name).to_owned(),
                wrong_actuator: self.rate(own, wrong),
                wrong_actuator_shutdown: self
                    .rate(own, |outcome| wrong(outcome) && self.shuts_down(outcome)),
                right: self.rate(own, |outcome| first_error(self.data, outcome).is_none()),
            }
        };
        names.iter().map(score).collect()
    }
}
