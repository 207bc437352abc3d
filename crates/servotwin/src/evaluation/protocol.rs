//! Protocols: how rows are held out, and the results reported for each.
//!
//! A protocol is more realistic the less its test rows resemble its training rows. Some protocols split the judged
//! cases, from the easiest to the hardest:
//! - a random third, as in the seed paper: nearly every test row has a neighbor with the same fault and intensity in
//!   another operating case. Only the same fault of another actuator in the same case stays on the same side. Without
//!   tolerances it is the row's exact symmetric copy, so training on symmetric copies would include the test row;
//! - groups of one kind and one intensity stay together, including symmetric copies;
//! - one intensity, one operating case (its command stays in training at the other load), one command, or one command
//!   and one load are left out;
//! - one kind of fault is left out, for the stages that find the actuator and the action.
//!
//! The others learn from the study's training commands, which no judged case uses:
//! - a new command;
//! - a new command and a fault never seen at its intensity, or at the neighboring intensities either;
//! - a new command, with training on weak faults and testing on strong ones, and the reverse.

use super::data_set::{DataRow, DataSet, TrainingFilter};
use super::error::EvaluationError;
use super::run::{RowOutcome, Scope, ask, first_error, run};
use crate::parallel::Workers;
use crate::study::Role;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, StagePlace};
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::metrics::{Prediction, Rate, Score, Trial};
use servotwin_learning::splits::{
    HELD_OUT, Split, grouped_k_fold, leave_one_group_out, repeated_hold_out,
};

/// A way to hold rows out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// A third of the rows at random, repeated.
    RandomThird,
    /// Folds of groups; a group is one kind at one intensity.
    Grouped,
    /// One intensity at a time.
    LeaveIntensityOut,
    /// One operating case at a time; its command stays in training at the other loads.
    LeaveCaseOut,
    /// One command at a time, at all loads.
    LeaveCommandOut,
    /// One command and one load at a time.
    LeaveCommandAndLoadOut,
    /// One kind of fault at a time, for the stages that find the actuator and the action.
    LeaveKindOut,
    /// Trained on the training commands.
    NewCommand,
    /// Trained on the training commands, without the judged kind at the judged intensity.
    NewCommandAndFault,
    /// Like [`Protocol::NewCommandAndFault`], also without the neighboring intensities.
    NewCommandAndNeighbours,
    /// Trained on weak faults of the training commands, tested on strong ones.
    WeakToStrong,
    /// Trained on strong faults of the training commands, tested on weak ones.
    StrongToWeak,
}

/// Every protocol: first those that split the judged cases, then those with training commands.
pub const ALL: [Protocol; 12] = [
    Protocol::RandomThird,
    Protocol::Grouped,
    Protocol::LeaveIntensityOut,
    Protocol::LeaveCaseOut,
    Protocol::LeaveCommandOut,
    Protocol::LeaveCommandAndLoadOut,
    Protocol::LeaveKindOut,
    Protocol::NewCommand,
    Protocol::NewCommandAndFault,
    Protocol::NewCommandAndNeighbours,
    Protocol::WeakToStrong,
    Protocol::StrongToWeak,
];

/// The greatest intensity of a weak fault.
pub const WEAK: f64 = 0.5;

/// The least intensity of a strong fault.
pub const STRONG: f64 = 0.6;

/// The number of repetitions and folds, the seed and the training rows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Holding {
    /// Number of random thirds.
    pub repeats: usize,
    /// Number of folds of groups.
    pub folds: usize,
    /// The seed of the random splits.
    pub seed: u64,
    /// Which training rows are used.
    pub lessons: TrainingFilter,
}

impl Default for Holding {
    fn default() -> Self {
        Holding { repeats: 3, folds: 5, seed: 1, lessons: TrainingFilter::default() }
    }
}

impl Protocol {
    /// The display title.
    pub fn title(self) -> &'static str {
        match self {
            Protocol::RandomThird => "a random third held out",
            Protocol::Grouped => "kind and intensity held out together",
            Protocol::LeaveIntensityOut => "one intensity left out",
            Protocol::LeaveCaseOut => "one operating case left out",
            Protocol::LeaveCommandOut => "one command left out",
            Protocol::LeaveCommandAndLoadOut => "one command and one load left out",
            Protocol::LeaveKindOut => "one kind of fault left out (actuator and command)",
            Protocol::NewCommand => "new command",
            Protocol::NewCommandAndFault => "new command, fault unseen at its intensity",
            Protocol::NewCommandAndNeighbours => {
                "new command, fault unseen at its and the next intensities"
            }
            Protocol::WeakToStrong => "new command, learnt from weak faults, judged on strong ones",
            Protocol::StrongToWeak => "new command, learnt from strong faults, judged on weak ones",
        }
    }

    /// Which stages of the hierarchy it evaluates.
    pub fn scope(self) -> Scope {
        match self {
            Protocol::LeaveKindOut => Scope::Action,
            Protocol::NewCommandAndFault | Protocol::Grouped => Scope::AllTracing,
            _ => Scope::All,
        }
    }

    /// Whether it needs training commands.
    pub fn needs_training(self) -> bool {
        self >= Protocol::NewCommand
    }

    /// Whether every detected fault is tested exactly once.
    fn tests_all_once(self) -> bool {
        use Protocol::{LeaveCommandAndLoadOut, LeaveKindOut, RandomThird};
        !matches!(self, RandomThird | LeaveKindOut | LeaveCommandAndLoadOut)
    }

    /// Whether it judges a fault, detected or not.
    fn judges(self, data: &DataSet, row: &DataRow) -> bool {
        let weak = data.intensities[row.intensity as usize] <= WEAK;
        match self {
            Protocol::WeakToStrong => !weak,
            Protocol::StrongToWeak => weak,
            _ => true,
        }
    }

    /// The splits; empty if there are too few groups or no training commands.
    ///
    /// # Errors
    /// [`EvaluationError::NothingDetectable`], or a split cannot be made.
    pub fn splits(self, data: &DataSet, holding: Holding) -> Result<Vec<Split>, EvaluationError> {
        match self.needs_training() {
            true => self.splits_with_training(data, holding),
            false => self.splits_of_judged(data, holding),
        }
    }

    fn splits_of_judged(
        self,
        data: &DataSet,
        holding: Holding,
    ) -> Result<Vec<Split>, EvaluationError> {
        let rows = data.detectable()?;
        let Holding { repeats, folds, seed, .. } = holding;
        let groups = |key: &dyn Fn(&DataRow) -> u32| {
            rows.iter().map(|&r| key(&data.rows[r])).collect::<Vec<_>>()
        };
        let kind_at = |row: &DataRow| cluster(data, row);
        let splits = match self {
            Protocol::RandomThird => {
                let cases = data.cases.len() as u32;
                thirds(&groups(&|row| kind_at(row) * cases + row.case), repeats, seed)?
            }
            Protocol::Grouped => folded(&groups(&kind_at), folds, seed)?,
            Protocol::LeaveIntensityOut => left_out(&groups(&|row| row.intensity))?,
            Protocol::LeaveCaseOut => left_out(&groups(&|row| row.case))?,
            Protocol::LeaveCommandOut => left_out(&groups(&|row| row.flown))?,
            Protocol::LeaveKindOut => left_out(&groups(&|row| row.kind))?,
            _ => return Ok(command_and_load_left_out(data, &rows)),
        };
        let real = |places: &[usize]| places.iter().map(|&place| rows[place]).collect();
        let split = |split: &Split| Split { train: real(&split.train), test: real(&split.test) };
        Ok(splits.iter().map(split).collect())
    }

    fn splits_with_training(
        self,
        data: &DataSet,
        holding: Holding,
    ) -> Result<Vec<Split>, EvaluationError> {
        if !data.has_training() {
            return Ok(vec![]);
        }
        // Training on weak faults alone needs artificial stronger ones; artificial weaker ones would be too many.
        let lessons = match self {
            Protocol::WeakToStrong => {
                TrainingFilter { stronger: true, weaker: holding.lessons.faults, ..holding.lessons }
            }
            _ => holding.lessons,
        };
        let (train, test) = (data.learnt_from(lessons)?, data.detectable()?);
        let strong = |row: usize| data.intensities[data.rows[row].intensity as usize] > WEAK;
        let split = |is_train: &dyn Fn(&DataRow, usize) -> bool,
                     is_test: &dyn Fn(usize) -> bool| {
            let healthy_or =
                |&row: &usize| data.rows[row].is_healthy || is_train(&data.rows[row], row);
            Split {
                train: train.iter().copied().filter(healthy_or).collect(),
                test: test.iter().copied().filter(|&row| is_test(row)).collect(),
            }
        };
        let splits = match self {
            Protocol::WeakToStrong => vec![split(&|row, _| row.own_intensity <= WEAK, &strong)],
            Protocol::StrongToWeak => {
                vec![split(&|row, _| row.own_intensity >= STRONG, &|row| !strong(row))]
            }
            Protocol::NewCommand => vec![split(&|_, _| true, &|_| true)],
            _ => {
                let reach = u32::from(self == Protocol::NewCommandAndNeighbours);
                let groups: Vec<u32> = test.iter().map(|&r| cluster(data, &data.rows[r])).collect();
                let folds = folded(&groups, holding.folds, holding.seed)?;
                let of_fold = |fold: &Split| {
                    let held: std::collections::BTreeSet<u32> =
                        fold.test.iter().map(|&place| groups[place]).collect();
                    let is_held = |row: &DataRow| {
                        let last = data.intensities.len() as u32 - 1;
                        let low = row.intensity.saturating_sub(reach);
                        let mut near = low..=(row.intensity + reach).min(last);
                        near.any(|i| {
                            held.contains(&cluster(data, &DataRow { intensity: i, ..row.clone() }))
                        })
                    };
                    split(&|row, _| !is_held(row), &|row| {
                        held.contains(&cluster(data, &data.rows[row]))
                    })
                };
                folds.iter().map(of_fold).collect()
            }
        };
        let is_whole = |split: &Split| !split.test.is_empty() && has_fault(data, &split.train);
        Ok(splits.into_iter().filter(is_whole).collect())
    }
}

fn has_fault(data: &DataSet, rows: &[usize]) -> bool {
    rows.iter().any(|&row| !data.rows[row].is_healthy)
}

/// Index of a kind at an intensity.
pub(super) fn cluster(data: &DataSet, row: &DataRow) -> u32 {
    row.kind * data.intensities.len() as u32 + row.intensity
}

/// One trial of a rate over rows.
pub fn trial(data: &DataSet, row: usize, holds: bool) -> Trial {
    let row = &data.rows[row];
    Trial { cluster: cluster(data, row), kind: row.kind, holds }
}

/// For every case, a split whose training cases share neither its command nor its load.
fn command_and_load_left_out(data: &DataSet, rows: &[usize]) -> Vec<Split> {
    let load = |case: u32| data.cases[case as usize].rsplit_once('/').map(|(_, load)| load);
    let apart = |row: usize, case: u32, flown: u32| {
        data.rows[row].flown != flown && load(data.rows[row].case) != load(case)
    };
    let mut cases: Vec<(u32, u32)> =
        rows.iter().map(|&row| (data.rows[row].case, data.rows[row].flown)).collect();
    cases.sort_unstable();
    cases.dedup();
    let split = |&(case, flown): &(u32, u32)| Split {
        train: rows.iter().copied().filter(|&row| apart(row, case, flown)).collect(),
        test: rows.iter().copied().filter(|&row| data.rows[row].case == case).collect(),
    };
    cases.iter().map(split).filter(|split| !split.train.is_empty()).collect()
}

/// Random thirds that keep groups together.
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

fn folded(groups: &[u32], folds: usize, seed: u64) -> Result<Vec<Split>, EvaluationError> {
    if count_groups(groups) < folds {
        return Ok(vec![]);
    }
    Ok(grouped_k_fold(groups, folds, seed)?)
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

/// The score of one stage on the rows that truly belong to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageScore {
    /// The paper's letter, followed by the actuator's number if only its rows are counted.
    pub id: String,
    /// The question that the stage decides.
    pub question: Question,
    /// The actuator whose rows are counted; `None` for all.
    pub actuator: Option<String>,
    /// The command whose details the stage distinguishes.
    pub command: Option<String>,
    /// The score with its confusion matrix.
    pub score: Score,
}

/// The consequences of errors for the aircraft. All rates but one refer to detected faults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Safety {
    /// The fault is attributed to the wrong actuator.
    pub wrong_actuator: Rate,
    /// A healthy actuator is shut down because another one has a fault.
    pub wrong_actuator_shutdown: Rate,
    /// A fault that needs a shutdown does not get it, of the detected faults that need one.
    pub missed_shutdown: Rate,
    /// The same among all faults that need a shutdown, including undetected ones; `None` unless the protocol tests
    /// every fault once.
    pub missed_shutdown_of_all: Option<Rate>,
    /// The right actuator is shut down although the fault needs no shutdown (of such faults).
    pub needless_shutdown: Rate,
}

/// Errors by faulty component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentScore {
    /// The component, without the actuator.
    pub component: String,
    /// Faults attributed to the wrong actuator.
    pub wrong_actuator: Rate,
    /// Faults that shut the healthy actuator down.
    pub wrong_actuator_shutdown: Rate,
    /// Actuator, action and detail are right.
    pub right: Rate,
}

/// The result of a hierarchy under a protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProtocolResult {
    /// The protocol.
    pub protocol: Protocol,
    /// The display title.
    pub title: String,
    /// Number of splits.
    pub splits: usize,
    /// Each stage separately: first over all actuators, then for each.
    pub stages: Vec<StageScore>,
    /// All stages together: actuator, command and detail are right (isolation rate of the detected faults).
    pub end_to_end: Option<Rate>,
    /// Actuator and command are right: the flight control computer acts on these.
    pub right_action: Option<Rate>,
    /// Detected and isolated faults as a share of all faults, including undetectable ones.
    pub isolated_of_all: Option<f64>,
    /// Consequences of errors.
    pub safety: Option<Safety>,
    /// Errors by component.
    pub components: Vec<ComponentScore>,
}

impl ProtocolResult {
    /// The score of the stage with this id.
    pub fn stage(&self, id: &str) -> Option<&Score> {
        self.stages.iter().find(|stage| stage.id == id).map(|stage| &stage.score)
    }
}

/// A protocol's result with the outcome of every held-out row, by split.
pub type JudgedProtocol = (ProtocolResult, Vec<Vec<RowOutcome>>);

/// Runs a protocol; also returns the outcomes behind the result. `None` if the data set has too few groups.
///
/// # Errors
/// Training fails.
pub fn evaluate(
    protocol: Protocol,
    data: &DataSet,
    settings: &HierarchySettings,
    holding: Holding,
    shutdowns: &[String],
    workers: Workers,
) -> Result<Option<JudgedProtocol>, EvaluationError> {
    let splits = judged_splits(protocol, data, settings, holding)?;
    if splits.is_empty() {
        return Ok(None);
    }
    let outcomes = run(data, settings, &splits, protocol.scope(), workers)?;
    let result = summary(protocol, data, &outcomes, shutdowns);
    Ok(Some((result, outcomes)))
}

/// The same for [`Protocol::NewCommand`], using a hierarchy already trained with those settings on all training rows.
///
/// # Errors
/// A split cannot be made, or the hierarchy does not fit the data.
pub fn evaluate_trained(
    data: &DataSet,
    (settings, hierarchy): (&HierarchySettings, &Hierarchy),
    holding: Holding,
    shutdowns: &[String],
) -> Result<Option<ProtocolResult>, EvaluationError> {
    let protocol = Protocol::NewCommand;
    let splits = judged_splits(protocol, data, settings, holding)?;
    let Some(split) = splits.first() else { return Ok(None) };
    let outcomes = [ask(data, hierarchy, &split.test)?];
    Ok(Some(summary(protocol, data, &outcomes, shutdowns)))
}

/// The splits with their judged rows; empty if nothing is judged.
pub(super) fn judged_splits(
    protocol: Protocol,
    data: &DataSet,
    settings: &HierarchySettings,
    holding: Holding,
) -> Result<Vec<Split>, EvaluationError> {
    let names = data.examples.names();
    let decides_nothing = names.actuators.len() == 1 && names.actions.len() == 1;
    if decides_nothing && protocol.scope() == Scope::Action {
        return Ok(vec![]);
    }
    let mut splits = protocol.splits(data, holding)?;
    if settings.mirror && settings.pool && data.examples.views() > 1 {
        // The hierarchy treats a row and its symmetric copy alike, so they count once.
        for split in &mut splits {
            split.test.retain(|&row| !data.rows[row].reflected);
        }
    }
    splits.retain(|split| !split.test.is_empty());
    Ok(splits)
}

/// Computes a protocol's result from its outcomes.
pub fn summary(
    protocol: Protocol,
    data: &DataSet,
    outcomes: &[Vec<RowOutcome>],
    shutdowns: &[String],
) -> ProtocolResult {
    let counting = Counting::new(protocol, data, outcomes, shutdowns);
    let full = protocol.scope() != Scope::Action;
    let right = counting.rate(|_| true, |outcome| first_error(data, outcome).is_none());
    let acted =
        |outcome: &RowOutcome| matches!(first_error(data, outcome), None | Some(Question::Detail));
    let judged = data.rows_where(Role::Judged, |r| !r.is_healthy && protocol.judges(data, r));
    let detected = Rate::of(&judged, |&row| data.rows[row].is_detected()).share;
    ProtocolResult {
        protocol,
        title: protocol.title().into(),
        splits: outcomes.len(),
        stages: stage_scores(data, outcomes, full),
        end_to_end: full.then_some(right),
        right_action: Some(counting.rate(|_| true, acted)),
        isolated_of_all: right.share.zip(detected).filter(|_| full).map(|(a, b)| a * b),
        safety: (!counting.shutdowns.is_empty()).then(|| counting.safety()),
        components: if full { counting.components() } else { vec![] },
    }
}

fn stage_scores(data: &DataSet, outcomes: &[Vec<RowOutcome>], full: bool) -> Vec<StageScore> {
    let actuators = data.examples.names().actuators.len();
    let mut places = data.examples.places(true);
    if actuators > 1 {
        let own = data.examples.places(false);
        places.extend(own.into_iter().filter(|place| place.question != Question::Actuator));
    }
    places.retain(|place| full || place.question != Question::Detail);
    places.iter().map(|place| stage_score(data, outcomes, place)).collect()
}

fn stage_score(data: &DataSet, outcomes: &[Vec<RowOutcome>], place: &StagePlace) -> StageScore {
    let names = data.examples.names();
    let classes = data.examples.classes(place);
    let local = |class: u32| classes.iter().position(|known| *known == class).map(|c| c as u32);
    let prediction = |outcome: &RowOutcome| -> Option<Prediction> {
        let truth = data.examples.labels()[outcome.row];
        let row = &data.rows[outcome.row];
        if row.is_healthy || !place.is_asked(truth.actuator, truth.action) {
            return None;
        }
        let healthy = data.examples.names().healthy();
        let (truth, said) = match place.question {
            Question::Actuator => (truth.actuator, outcome.said.actuator.or(Some(healthy))),
            Question::Action => (truth.action, outcome.command),
            Question::Detail => (truth.detail, outcome.detail),
        };
        Some(Prediction {
            cluster: cluster(data, row),
            kind: row.kind,
            truth: local(truth)?,
            said: said.and_then(local),
        })
    };
    let splits: Vec<Vec<Prediction>> =
        outcomes.iter().map(|split| split.iter().filter_map(prediction).collect()).collect();
    let class_names = classes.iter().map(|&c| names.class_name(place.question, c).to_owned());
    StageScore {
        id: place.id(),
        question: place.question,
        actuator: place.actuator.map(|actuator| names.actuators[actuator as usize].clone()),
        command: place.action.map(|command| names.actions[command as usize].clone()),
        score: Score::of(class_names.collect(), &splits),
    }
}

/// Counts over the outcomes of a protocol.
struct Counting<'a> {
    protocol: Protocol,
    data: &'a DataSet,
    outcomes: Vec<&'a RowOutcome>,
    /// The actions that shut their actuator down.
    shutdowns: Vec<u32>,
}

impl<'a> Counting<'a> {
    fn new(
        protocol: Protocol,
        data: &'a DataSet,
        outcomes: &'a [Vec<RowOutcome>],
        shutdowns: &[String],
    ) -> Self {
        let (outcomes, shutdowns) = (outcomes.iter().flatten().collect(), data.commands(shutdowns));
        Counting { protocol, data, outcomes, shutdowns }
    }

    fn trials(
        &self,
        among: impl Fn(&RowOutcome) -> bool,
        holds: impl Fn(&RowOutcome) -> bool,
    ) -> Vec<Trial> {
        let asked = self.outcomes.iter().filter(|outcome| among(outcome));
        asked.map(|outcome| trial(self.data, outcome.row, holds(outcome))).collect()
    }

    fn rate(
        &self,
        among: impl Fn(&RowOutcome) -> bool,
        holds: impl Fn(&RowOutcome) -> bool,
    ) -> Rate {
        Rate::clustered(&self.trials(among, holds))
    }

    /// Missed shutdowns among all faults: those of detected faults, and all undetected faults.
    fn missed_of_all(&self, missed: &[Trial]) -> Option<Rate> {
        if !self.protocol.tests_all_once() {
            return None;
        }
        let labels = self.data.examples.labels();
        let counts_once =
            self.outcomes.iter().all(|outcome| !self.data.rows[outcome.row].reflected);
        let hidden = self.data.rows_where(Role::Judged, |row| {
            let counted = !(counts_once && row.reflected);
            !row.is_healthy && !row.is_detected() && counted && self.protocol.judges(self.data, row)
        });
        let hidden = hidden.into_iter().filter(|&row| self.shutdowns.contains(&labels[row].action));
        let mut trials = missed.to_vec();
        trials.extend(hidden.map(|row| trial(self.data, row, true)));
        Some(Rate::clustered(&trials))
    }

    fn is_wrong_actuator(&self, outcome: &RowOutcome) -> bool {
        let truth = self.data.examples.labels()[outcome.row].actuator;
        outcome.said.actuator.is_some_and(|said| said != truth)
    }

    fn shuts_down(&self, outcome: &RowOutcome) -> bool {
        outcome.said.action.is_some_and(|command| self.shutdowns.contains(&command))
    }

    fn needs_shutdown(&self, outcome: &RowOutcome) -> bool {
        self.shutdowns.contains(&self.data.examples.labels()[outcome.row].action)
    }

    fn safety(&self) -> Safety {
        let wrong = |outcome: &RowOutcome| self.is_wrong_actuator(outcome);
        let wrong_shutdown = |outcome: &RowOutcome| wrong(outcome) && self.shuts_down(outcome);
        let right_shutdown = |outcome: &RowOutcome| !wrong(outcome) && self.shuts_down(outcome);
        let needed = |outcome: &RowOutcome| self.needs_shutdown(outcome);
        let missed = self.trials(needed, |outcome| !right_shutdown(outcome));
        Safety {
            wrong_actuator: self.rate(|_| true, wrong),
            wrong_actuator_shutdown: self.rate(|_| true, wrong_shutdown),
            missed_shutdown: Rate::clustered(&missed),
            missed_shutdown_of_all: self.missed_of_all(&missed),
            needless_shutdown: self.rate(|outcome| !needed(outcome), right_shutdown),
        }
    }

    fn components(&self) -> Vec<ComponentScore> {
        let component =
            |outcome: &RowOutcome| self.data.component(self.data.rows[outcome.row].kind);
        let mut names: Vec<&str> = self.outcomes.iter().map(|outcome| component(outcome)).collect();
        names.sort_unstable();
        names.dedup();
        let score = |name: &&str| {
            let own = |outcome: &RowOutcome| component(outcome) == *name;
            let wrong = |outcome: &RowOutcome| self.is_wrong_actuator(outcome);
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
