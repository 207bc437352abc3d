//! The artefact *sensors*: what each sensor buys.
//!
//! - [`candidates`]: which sets of sensors leave control possible, and what they cost
//! - [`runs`]: the runs of a scenario, and the features that a set leaves
//! - `written`: table and figure
//!
//! Every set that leaves control possible is judged, so the best set of each size and the Pareto front are exact for
//! these runs. The system's own sensors without each single one are judged too, also where control needs it: that is
//! what its residual is worth to the diagnosis.
//!
//! The trees of the study learn from the training commands and from the features that a set leaves, and the list of
//! measures judges them. A fault that no sensor of a set shows gets no action, so all sets have the same denominators.

pub mod candidates;
pub mod runs;
pub(crate) mod written;

use crate::error::SafetyError;
use crate::results::StudyResultsFolder;
use candidates::{Candidates, SensorMask};
use runs::SensorRuns;
use servotwin::job::Crew;
use servotwin::learn;
use servotwin::measure::{
    Measure, RIGHT_ACTION_OF_ALL, Rates, SHUTDOWN_MISSED_OF_ALL, VISIBLE, WRONG_SHUTDOWN,
};
use servotwin::parallel;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What was found of a set.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorSet {
    /// The sensors.
    pub set: SensorMask,
    /// Its cost.
    pub cost: f64,
    /// Whether it holds all sensors that control needs, and those that are kept.
    pub keeps_control: bool,
    /// What its trees achieve.
    pub rates: Rates,
    /// Whether no set that leaves control possible is better.
    pub is_on_front: bool,
}

impl SensorSet {
    /// The number of faults that a measure counts.
    pub fn count(&self, measure: &Measure) -> u64 {
        self.rates.of(measure).count
    }

    /// Number of wrong and missed shutdowns.
    pub fn errors(&self) -> u64 {
        self.count(&WRONG_SHUTDOWN) + self.count(&SHUTDOWN_MISSED_OF_ALL)
    }

    /// Whether it is at least as good as another set in cost, shutdown errors and right actions, and better in one.
    fn beats(&self, other: &SensorSet) -> bool {
        let key = |set: &SensorSet| (set.cost, set.errors(), set.count(&RIGHT_ACTION_OF_ALL));
        let ((cost, errors, right), than) = (key(self), key(other));
        cost <= than.0 && errors <= than.1 && right >= than.2 && (cost, errors, right) != than
    }
}

/// What each sensor of a study buys.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorTrade {
    /// The scenario.
    pub scenario: &'static str,
    /// The sensors.
    pub candidates: Candidates,
    /// Every judged set, in the order of `Candidates::sets`.
    pub sets: Vec<SensorSet>,
    /// What readers must know.
    pub notes: Vec<String>,
}

impl SensorTrade {
    /// Judges every set of sensors of a study. Every set holds those that `keep` names; without a table of `costs` each
    /// sensor costs 1.
    ///
    /// # Errors
    /// There is no data set; the table is wrong; too many sensors may be left out; the caller stopped the work.
    pub fn new(
        results: &StudyResultsFolder,
        keep: &[String],
        costs: Option<&Path>,
        crew: &Crew,
    ) -> Result<Self, SafetyError> {
        let extra = SensorRuns::have_extra(results);
        let candidates = Candidates::new(&results.study, extra, keep, costs)?;
        let runs = SensorRuns::read(results, &candidates)?;
        let (sets, done) = (candidates.sets(), AtomicUsize::new(0));
        let judge = |&set: &SensorMask| {
            let judged = judge(&runs, &candidates, set);
            let share = (1 + done.fetch_add(1, Ordering::Relaxed)) as f64 / sets.len() as f64;
            (crew.progress)("judging sets of sensors", share);
            judged
        };
        let judged =
            parallel::map(&sets, crew.workers, judge).map_err(|_| SafetyError::Cancelled)?;
        let mut sets = judged.into_iter().collect::<Result<Vec<SensorSet>, _>>()?;
        mark_front(&mut sets);
        let mut notes = vec![];
        if results.study.extra_sensor.is_some() && !extra {
            notes.push("the extra sensor is judged in the scenario realistic only".into());
        }
        if runs.data.failed > 0 {
            let failed = runs.data.failed;
            notes.push(format!("{failed} runs were not simulated to the end and are left out"));
        }
        Ok(SensorTrade { scenario: results.scenario.name(), candidates, sets, notes })
    }

    /// What was found of a set.
    pub fn of(&self, set: SensorMask) -> Option<&SensorSet> {
        self.sets.iter().find(|own| own.set == set)
    }

    /// For every number of sensors, the set with the fewest shutdown errors that leaves control possible. Among equals
    /// it has the most right actions, then shows the most faults, then costs the least.
    pub fn best_of_sizes(&self) -> Vec<&SensorSet> {
        let mut best: BTreeMap<u32, &SensorSet> = BTreeMap::new();
        for set in self.sets.iter().filter(|set| set.keeps_control) {
            let first = best.entry(set.set.count_ones()).or_insert(set);
            let key = |set: &SensorSet| {
                let most = [&RIGHT_ACTION_OF_ALL, &VISIBLE].map(|own| Reverse(set.count(own)));
                (set.errors(), most)
            };
            if key(set) < key(first) || (key(set) == key(first) && set.cost < first.cost) {
                *first = set;
            }
        }
        best.into_values().collect()
    }
}

fn judge(
    runs: &SensorRuns,
    candidates: &Candidates,
    set: SensorMask,
) -> Result<SensorSet, SafetyError> {
    Ok(SensorSet {
        set,
        cost: candidates.cost(set),
        keeps_control: candidates.keeps_control(set),
        rates: learn::of_trees(&runs.left_by(candidates, set)?, &runs.settings)?,
        is_on_front: false,
    })
}

fn mark_front(sets: &mut [SensorSet]) {
    let able: Vec<SensorSet> = sets.iter().filter(|set| set.keeps_control).cloned().collect();
    for set in sets.iter_mut().filter(|set| set.keeps_control) {
        set.is_on_front = !able.iter().any(|other| other.beats(set));
    }
}
