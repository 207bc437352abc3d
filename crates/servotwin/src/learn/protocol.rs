//! Protocols: how rows are held out, and the results reported for each.
//!
//! A protocol is more realistic the less its test rows resemble its training rows. From the easiest to the hardest:
//! - a random third of the judged cases, as in the seed paper: nearly every test row has a neighbor with the same fault
//!   and intensity in another operating case. Only the same fault of another actuator in the same case stays on the same
//!   side. Without tolerances it is the row's exact symmetric copy, so training on symmetric copies would include the
//!   test row;
//! - one kind of fault of the judged cases is left out, for the stages that find the actuator and the action;
//! - a fault that was never seen at its intensity;
//! - a new command.
//!
//! The last two learn from the study's training commands, which no judged case uses. Without such commands a fault at an
//! unseen intensity is learned from the judged cases, and nothing is judged on a new command.

use super::data_set::{DataRow, DataSet, TrainingFilter};
use super::error::EvaluationError;
use super::run::{RowOutcome, Scope, ask, first_error, run};
use crate::measure::outcome::RunOutcome;
use crate::measure::{
    Answers, Measure, OF_BANDS, OF_HEALTHY, OF_ISOLATION, OF_RECORDS, OF_SOME_RECORDS, Rates,
};
use crate::parallel::Workers;
use crate::study::Purpose;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::Error;
use servotwin_diagnosis::hierarchy::{HEALTHY, Hierarchy, Question, StagePlace};
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::metrics::{Prediction, Score};
use servotwin_learning::splits::{Split, grouped_k_fold, leave_one_group_out, random_thirds};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// A way to hold rows out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// A third of the judged rows at random, repeated.
    RandomThird,
    /// One kind of fault at a time, for the stages that find the actuator and the action.
    KindLeftOut,
    /// Folds of groups; a group is one kind at one intensity. Trained on the training commands, if there are any.
    UnseenIntensity,
    /// Trained on the training commands.
    NewCommand,
}

/// Every protocol, from the easiest to the hardest.
pub const ALL: [Protocol; 4] =
    [Protocol::RandomThird, Protocol::KindLeftOut, Protocol::UnseenIntensity, Protocol::NewCommand];

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
    /// The protocol whose results are quoted: a new command, or without training commands a fault at an intensity that
    /// was never seen.
    pub(crate) fn headline(data: &DataSet) -> Self {
        if data.has_training() { Protocol::NewCommand } else { Protocol::UnseenIntensity }
    }

    /// The display title.
    pub fn title(self) -> &'static str {
        match self {
            Protocol::RandomThird => "a random third held out",
            Protocol::KindLeftOut => "one kind of fault left out (actuator and action)",
            Protocol::UnseenIntensity => "fault unseen at its intensity",
            Protocol::NewCommand => "new command",
        }
    }

    /// Which stages of the hierarchy it evaluates.
    pub(crate) fn scope(self) -> Scope {
        match self {
            Protocol::KindLeftOut => Scope::Action,
            _ => Scope::All,
        }
    }

    /// The measures of its answers. Measures of all faults need every detected fault tested exactly once.
    fn measures(self) -> &'static [&'static Measure] {
        match self {
            Protocol::RandomThird => OF_SOME_RECORDS,
            _ => OF_RECORDS,
        }
    }

    /// The splits; empty if there are too few groups, no training commands, or nothing to judge.
    ///
    /// # Errors
    /// [`EvaluationError::NothingDetectable`], or a split cannot be made.
    pub fn splits(self, data: &DataSet, holding: Holding) -> Result<Vec<Split>, EvaluationError> {
        let names = data.examples.names();
        let decides_nothing = names.actuators.len() == 1 && names.actions.len() == 1;
        if decides_nothing && self.scope() == Scope::Action {
            return Ok(vec![]);
        }
        let test = data.detectable()?;
        let learned = || data.learnt_from(holding.lessons);
        let Holding { repeats, folds, seed, .. } = holding;
        let groups = |key: &dyn Fn(&DataRow) -> u32| {
            test.iter().map(|&row| key(&data.rows[row])).collect::<Vec<_>>()
        };
        let cases = data.cases.len() as u32;
        let splits = match self {
            Protocol::RandomThird => {
                random_thirds(&groups(&|row| cluster(data, row) * cases + row.case), repeats, seed)
            }
            Protocol::KindLeftOut => leave_one_group_out(&groups(&|row| row.kind)),
            Protocol::UnseenIntensity => {
                grouped_k_fold(&groups(&|row| cluster(data, row)), folds, seed)
            }
            Protocol::NewCommand if data.has_training() => {
                return Ok(vec![Split { train: learned()?, test }]);
            }
            Protocol::NewCommand => return Ok(vec![]),
        };
        let splits = match splits {
            Err(Error::TooFewForFolds { .. }) => return Ok(vec![]),
            splits => splits?,
        };
        let real = |places: &[usize]| places.iter().map(|&place| test[place]).collect();
        let split = |split: &Split| Split { train: real(&split.train), test: real(&split.test) };
        let mut splits: Vec<Split> = splits.iter().map(split).collect();
        if self == Protocol::UnseenIntensity && data.has_training() {
            splits = taught_by_commands(data, &learned()?, splits);
        }
        splits.retain(|split| !split.test.is_empty());
        Ok(splits)
    }
}

/// The same test rows, learned from rows of training commands without the faults that are tested.
fn taught_by_commands(data: &DataSet, lessons: &[usize], splits: Vec<Split>) -> Vec<Split> {
    let of_fold = |Split { test, .. }: Split| {
        let held: BTreeSet<u32> = test.iter().map(|&row| cluster(data, &data.rows[row])).collect();
        let teaches = |row: &DataRow| row.is_healthy || !held.contains(&cluster(data, row));
        let train = lessons.iter().copied().filter(|&row| teaches(&data.rows[row])).collect();
        Split { train, test }
    };
    let has_fault = |split: &Split| split.train.iter().any(|&row| !data.rows[row].is_healthy);
    splits.into_iter().map(of_fold).filter(has_fault).collect()
}

/// Index of a kind at an intensity.
pub(super) fn cluster(data: &DataSet, row: &DataRow) -> u32 {
    row.kind * data.intensities.len() as u32 + row.intensity
}

/// What the bands of a data set show, of judged faults and of healthy specimens.
pub(crate) fn in_bands(data: &DataSet) -> Rates {
    let (outcomes, shutdowns) = (vec![], &[]);
    let counting = Counting { data, outcomes, shutdowns, measures: OF_BANDS, names_class: false };
    let rows = data.rows_where(Purpose::Test, |_| true).into_iter();
    counting.counted(&rows.map(|row| counting.unanswered(row)).collect::<Vec<_>>())
}

/// What is said of healthy specimens that leave their bands.
///
/// # Errors
/// The hierarchy has other features.
pub(crate) fn of_healthy(
    data: &DataSet,
    hierarchy: &Hierarchy,
    shutdowns: &[u32],
) -> Result<Rates, EvaluationError> {
    let alarmed = data.rows_where(Purpose::Test, |row| row.is_healthy && row.is_detected());
    let outcomes = ask(&data.examples, hierarchy, &alarmed)?;
    let outcomes = outcomes.iter().collect();
    let counting = Counting { data, outcomes, shutdowns, measures: OF_HEALTHY, names_class: false };
    Ok(counting.rates(|row| data.rows[row].is_healthy))
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
    /// The action whose details the stage distinguishes.
    pub action: Option<String>,
    /// The score with its confusion matrix.
    pub score: Score,
}

/// Errors by faulty component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentScore {
    /// The component, without the actuator.
    pub component: String,
    /// All measures of its faults.
    pub rates: Rates,
}

/// Wrong answers of one kind about the faults of a kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Confused {
    /// The true kind, without the actuator.
    pub kind: String,
    /// The first question that was answered wrongly.
    pub question: Question,
    /// The answer: `healthy`, `another actuator`, or the name of an action or of a fault class.
    pub taken_for: String,
    /// The number of such answers.
    pub count: u64,
    /// The number of all tests of the kind.
    pub of: u64,
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
    /// Each stage separately: first over all actuators, then for each. Empty where a fault may stay not isolated.
    pub stages: Vec<StageScore>,
    /// All measures. Those of all faults, also the undetected ones, are there unless the protocol tests faults
    /// repeatedly.
    pub rates: Rates,
    /// Errors by component.
    pub components: Vec<ComponentScore>,
    /// Wrong answers by kind of fault, the most frequent first. Where a fault may stay not isolated, those about actuator and
    /// action that count.
    pub confused: Vec<Confused>,
}

impl ProtocolResult {
    /// The score of the stage with this id.
    pub fn stage(&self, id: &str) -> Option<&Score> {
        self.stages.iter().find(|stage| stage.id == id).map(|stage| &stage.score)
    }

    /// The kinds of fault with wrong answers: their number and that of all tests of the kind, most answers first.
    pub fn wrong_kinds(&self) -> Vec<(&str, [u64; 2])> {
        let mut kinds: BTreeMap<&str, [u64; 2]> = BTreeMap::new();
        for Confused { kind, count, of, .. } in &self.confused {
            let [wrong, _] = kinds.get(kind.as_str()).copied().unwrap_or_default();
            kinds.insert(kind, [wrong + count, *of]);
        }
        let mut kinds: Vec<_> = kinds.into_iter().collect();
        kinds.sort_by_key(|(_, [wrong, _])| Reverse(*wrong));
        kinds
    }
}

/// Runs a protocol with trees that learn anew; `None` if the data set has too few groups.
///
/// # Errors
/// Training fails.
pub(crate) fn evaluate(
    protocol: Protocol,
    data: &DataSet,
    settings: &HierarchySettings,
    holding: Holding,
    shutdowns: &[u32],
    workers: Workers,
) -> Result<Option<ProtocolResult>, EvaluationError> {
    let splits = protocol.splits(data, holding)?;
    if splits.is_empty() {
        return Ok(None);
    }
    let outcomes = run(data, settings, &splits, protocol.scope(), workers)?;
    Ok(Some(summary(protocol, data, &outcomes, shutdowns)))
}

/// Counts a protocol's result from its outcomes, split by split. `shutdowns` are the actions that shut their actuator
/// down.
pub(crate) fn summary(
    protocol: Protocol,
    data: &DataSet,
    outcomes: &[Vec<RowOutcome>],
    shutdowns: &[u32],
) -> ProtocolResult {
    let full = protocol.scope() != Scope::Action;
    let counted = Counting {
        data,
        outcomes: outcomes.iter().flatten().collect(),
        shutdowns,
        measures: protocol.measures(),
        names_class: full,
    };
    ProtocolResult {
        protocol,
        title: protocol.title().into(),
        splits: outcomes.len(),
        stages: stage_scores(data, &counted.outcomes, full),
        rates: counted.rates(|_| true),
        components: if full { counted.components() } else { vec![] },
        confused: if full { counted.confused() } else { vec![] },
    }
}

/// Counts a protocol's result from what trees and committee decide together, where a fault may stay not isolated.
pub(crate) fn isolated(
    protocol: Protocol,
    data: &DataSet,
    outcomes: &[Vec<RowOutcome>],
    shutdowns: &[u32],
) -> ProtocolResult {
    let decided = outcomes.iter().flatten().collect();
    let measures = OF_ISOLATION;
    let counted = Counting { data, outcomes: decided, shutdowns, measures, names_class: false };
    let mut confused = counted.confused();
    confused.retain(|confused| confused.question != Question::Detail);
    ProtocolResult {
        protocol,
        title: protocol.title().into(),
        splits: outcomes.len(),
        stages: vec![],
        rates: counted.rates(|_| true),
        components: vec![],
        confused,
    }
}

fn stage_scores(data: &DataSet, outcomes: &[&RowOutcome], full: bool) -> Vec<StageScore> {
    let actuators = data.examples.names().actuators.len();
    let mut places = data.examples.places(true);
    if actuators > 1 {
        let own = data.examples.places(false);
        places.extend(own.into_iter().filter(|place| place.question != Question::Actuator));
    }
    places.retain(|place| full || place.question != Question::Detail);
    places.iter().map(|place| stage_score(data, outcomes, place)).collect()
}

pub(super) fn stage_score(
    data: &DataSet,
    outcomes: &[&RowOutcome],
    place: &StagePlace,
) -> StageScore {
    let names = data.examples.names();
    let classes = data.examples.classes(place);
    let local = |class: u32| classes.iter().position(|known| *known == class).map(|c| c as u32);
    let prediction = |outcome: &&RowOutcome| -> Option<Prediction> {
        let truth = data.examples.labels()[outcome.row];
        let row = &data.rows[outcome.row];
        if row.is_healthy || !place.is_asked(truth.actuator, truth.action) {
            return None;
        }
        let healthy = data.examples.names().healthy();
        let (truth, said) = match place.question {
            Question::Actuator => (truth.actuator, outcome.said.actuator.or(Some(healthy))),
            Question::Action => (truth.action, outcome.action),
            Question::Detail => (truth.detail, outcome.detail),
        };
        Some(Prediction {
            cluster: cluster(data, row),
            kind: row.kind,
            truth: local(truth)?,
            said: said.and_then(local),
        })
    };
    let predictions: Vec<Prediction> = outcomes.iter().filter_map(prediction).collect();
    let class_names = classes.iter().map(|&c| names.class_name(place.question, c).to_owned());
    StageScore {
        id: place.id(),
        question: place.question,
        actuator: place.actuator.map(|actuator| names.actuators[actuator as usize].clone()),
        action: place.action.map(|action| names.actions[action as usize].clone()),
        score: Score::of(class_names.collect(), &predictions),
    }
}

/// Measures over outcomes.
pub(super) struct Counting<'a> {
    pub(crate) data: &'a DataSet,
    pub(crate) outcomes: Vec<&'a RowOutcome>,
    /// The actions that shut their actuator down.
    pub(crate) shutdowns: &'a [u32],
    /// What is counted.
    pub(crate) measures: &'a [&'a Measure],
    /// Whether the class of a fault is asked, too.
    pub(crate) names_class: bool,
}

impl Counting<'_> {
    /// All measures of the rows that a choice selects.
    pub(super) fn rates(&self, choice: impl Fn(usize) -> bool) -> Rates {
        let asked = self.outcomes.iter().filter(|outcome| choice(outcome.row));
        let asked = asked.map(|outcome| self.outcome(outcome));
        let hidden = self.data.rows_where(Purpose::Test, |row| !row.is_detected()).into_iter();
        let hidden = hidden.filter(|&row| choice(row)).map(|row| self.unanswered(row));
        self.counted(&asked.chain(hidden).collect::<Vec<_>>())
    }

    /// The measures of some outcomes. Healthy records are independent of each other.
    fn counted(&self, rows: &[RunOutcome]) -> Rates {
        let answers = Answers {
            has_several: self.data.examples.names().actuators.len() > 1,
            has_shutdown: !self.shutdowns.is_empty(),
        };
        let rows: Vec<&RunOutcome> = rows.iter().collect();
        Rates::count((self.measures, 0.0), answers, &rows, |own| {
            let row = &self.data.rows[own.number as usize];
            own.is_fault().then(|| (cluster(self.data, row), row.kind))
        })
    }

    /// The outcome of a record before anything is said of it.
    fn unanswered(&self, row: usize) -> RunOutcome {
        let (own, names) = (&self.data.rows[row], self.data.examples.names());
        let truth = self.data.examples.labels()[row];
        let record = RunOutcome { number: row as u64, ..RunOutcome::default() };
        if own.is_healthy {
            return record.seen(own.is_detected());
        }
        let class = names.details.get(truth.detail as usize);
        let record = RunOutcome {
            at_fault: names.actuators[truth.actuator as usize].clone(),
            action: names.actions[truth.action as usize].clone(),
            class: class.filter(|_| self.names_class).cloned().unwrap_or_default(),
            intensity: own.own_intensity,
            onset_s: Some(0.0),
            needs_shutdown: self.shutdowns.contains(&truth.action),
            ..record
        };
        record.seen(own.is_detected())
    }

    /// The outcome of a record with what is said of it. An answer that does not count is none.
    fn outcome(&self, RowOutcome { row, said, is_decided, .. }: &RowOutcome) -> RunOutcome {
        let unanswered = self.unanswered(*row);
        match is_decided {
            true => unanswered.answered(said, self.data.examples.names(), self.shutdowns),
            false => unanswered,
        }
    }

    fn components(&self) -> Vec<ComponentScore> {
        let component = |row: usize| self.data.component(self.data.rows[row].kind);
        let mut names: Vec<&str> = self.outcomes.iter().map(|own| component(own.row)).collect();
        names.sort_unstable();
        names.dedup();
        let score = |name: &&str| ComponentScore {
            component: (*name).to_owned(),
            rates: self.rates(|row| component(row) == *name),
        };
        names.iter().map(score).collect()
    }

    fn confused(&self) -> Vec<Confused> {
        let names = self.data.examples.names();
        let mut tests = vec![0_u64; self.data.kinds.len()];
        let mut counts: BTreeMap<(u32, Question, &str), u64> = BTreeMap::new();
        for outcome in &self.outcomes {
            let kind = self.data.rows[outcome.row].kind;
            tests[kind as usize] += 1;
            let error = first_error(self.data, outcome).filter(|_| outcome.is_decided);
            let Some(question) = error else { continue };
            let said = match question {
                Question::Actuator => outcome.said.actuator.map(|_| "another actuator"),
                Question::Action => outcome.said.action.map(|said| &*names.actions[said as usize]),
                Question::Detail => outcome.said.detail.map(|said| &*names.details[said as usize]),
            };
            *counts.entry((kind, question, said.unwrap_or(HEALTHY))).or_default() += 1;
        }
        let confused =
            |((kind, question, taken_for), count): ((u32, Question, &str), u64)| Confused {
                kind: self.data.kinds[kind as usize].clone(),
                question,
                taken_for: taken_for.to_owned(),
                count,
                of: tests[kind as usize],
            };
        let mut all: Vec<Confused> = counts.into_iter().map(confused).collect();
        // Equally frequent ones stay in the order of the kinds.
        all.sort_by_key(|confused| Reverse(confused.count));
        all
    }
}
