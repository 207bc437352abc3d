//! The artefact *sensors*: what each sensor buys.
//!
//! - [`candidates`]: which sets of sensors leave control possible, and what they cost
//! - `upgrades`: better sensors of the same kind, simulated anew
//! - [`runs`]: the runs of a scenario, and the features that a set leaves
//! - `judged`: detection, isolation and shutdowns of a set on commands that it was not trained on
//! - `structure`: which faults no classifier could separate with a set
//! - `written`: tables and figure
//!
//! Every set that leaves control possible is judged, so the best set of each size and the Pareto front are exact for
//! these runs. The system's own sensors without each single one are judged too, also where control needs it: that is
//! what its residual is worth to the diagnosis. Every upgrade is one more set of runs, on which the same sets are judged.

pub mod candidates;
pub(crate) mod judged;
pub mod runs;
pub(crate) mod structure;
pub(crate) mod upgrades;
pub(crate) mod written;

use crate::error::SafetyError;
use crate::results::StudyResultsFolder;
use candidates::{Candidates, SensorMask};
use judged::{FaultAnswer, GROUPS, SensorRates};
use runs::{FaultClass, SensorRuns};
use servotwin::evaluation::protocol::trial;
use servotwin::job::flights::Crew;
use servotwin::parallel;
use servotwin_learning::metrics::Rate;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use structure::Isolability;
use upgrades::SensorUpgrade;

/// What was found of a set.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorSet {
    /// The sensors.
    pub set: SensorMask,
    /// Some of them are upgraded, as an index of [`SensorTrade::upgrades`].
    pub upgrade: Option<usize>,
    /// Its cost.
    pub cost: f64,
    /// Whether it holds all sensors that control needs, and those that are kept.
    pub keeps_control: bool,
    /// What its trees achieve.
    pub rates: SensorRates,
    /// Detected faults within the noise of no other one, of at most one, and of at most two; `None` without enough
    /// healthy specimens.
    pub isolable: Option<[Rate; GROUPS]>,
    /// Whether no set that leaves control possible is better.
    pub is_on_front: bool,
}

impl SensorSet {
    /// Number of wrong and missed shutdowns.
    pub fn errors(&self) -> u64 {
        self.rates.wrong_shutdown.count + self.rates.missed_shutdown.count
    }

    /// Whether it is at least as good as another set in cost, shutdown errors and isolation, and better in one.
    fn beats(&self, other: &SensorSet) -> bool {
        let key = |set: &SensorSet| (set.cost, set.errors(), set.rates.isolated[0].count);
        let ((cost, errors, isolated), than) = (key(self), key(other));
        cost <= than.0 && errors <= than.1 && isolated >= than.2 && (cost, errors, isolated) != than
    }
}

/// Runs of one fault that another one may be confused with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FaultPair {
    /// Detected runs of the first fault.
    pub detected: u64,
    /// Of these: within the noise of the second fault.
    pub alike: u64,
    /// Of these: taken for the second fault.
    pub confused: u64,
    /// Of the confused runs: within the noise of the second fault.
    pub confused_alike: u64,
}

impl FaultPair {
    /// Why the first fault is taken for the second.
    pub(crate) fn verdict(&self) -> &'static str {
        match self.confused {
            0 => "alike, not confused",
            _ if 2 * self.confused_alike >= self.confused => "impossible with these sensors",
            _ => "classifier weak",
        }
    }
}

/// The fault pairs of a set of sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct SetPairs {
    /// The sensors.
    pub set: SensorMask,
    /// Whether it is known which faults look alike; without enough healthy specimens it is not.
    pub is_structural: bool,
    /// Detected runs within the noise of another fault.
    pub alike_runs: u64,
    /// Of these: the trees name the right fault all the same. If runs are alike in truth, about half of them.
    pub alike_right: u64,
    /// The pairs by the names of their faults.
    pub pairs: BTreeMap<(String, String), FaultPair>,
}

/// What each sensor of a study buys.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorTrade {
    /// The scenario.
    pub scenario: &'static str,
    /// The sensors.
    pub candidates: Candidates,
    /// The upgrades.
    pub upgrades: Vec<SensorUpgrade>,
    /// Every judged set, in the order of `Candidates::sets`; then, for each upgrade, those that hold its sensors.
    pub sets: Vec<SensorSet>,
    /// The fault pairs of the system's own sensors and, with an extra sensor, of all.
    pub pairs: Vec<SetPairs>,
    /// What readers must know.
    pub notes: Vec<String>,
}

/// One judged set, with the answers that pairs are counted from.
type Judged = (SensorSet, Vec<FaultAnswer>, Option<Isolability>);

/// What a user wants to know of sensors.
#[derive(Debug, Clone, Default)]
pub struct TradeOptions<'o> {
    /// Sensors that every set holds.
    pub keep: &'o [String],
    /// The table of costs; without one each sensor costs 1.
    pub costs: Option<&'o Path>,
    /// The table of upgrades.
    pub upgrades: Option<&'o Path>,
}

impl SensorTrade {
    /// Judges every set of sensors of a study, and those with each upgrade.
    ///
    /// # Errors
    /// There is no data set; a table is wrong; too many sensors may be left out; an upgrade cannot be simulated; the
    /// caller stopped the work.
    pub fn new(
        results: &StudyResultsFolder,
        options: &TradeOptions,
        crew: &Crew,
    ) -> Result<Self, SafetyError> {
        let extra = SensorRuns::have_extra(results);
        let candidates = Candidates::new(&results.study, extra, options.keep, options.costs)?;
        let upgrades =
            options.upgrades.map(|p| SensorUpgrade::read(p, &results.study, &candidates));
        let upgrades = upgrades.transpose()?.unwrap_or_default();
        let runs = SensorRuns::read(results, &candidates)?;
        let judged = judge_all((&runs, &candidates), &candidates.sets(), None, crew)?;
        let is_paired = |set: SensorMask| set == candidates.base() || set == candidates.all();
        let paired = judged.iter().filter(|(own, ..)| is_paired(own.set));
        let pairs = paired.map(|judged| SetPairs::count(&runs, judged)).collect();
        let is_structural = judged.iter().all(|(own, ..)| own.isolable.is_some());
        let mut notes = notes(results, is_structural, extra, runs.data.failed);
        let mut sets: Vec<SensorSet> = judged.into_iter().map(|(set, ..)| set).collect();
        for (place, upgrade) in upgrades.iter().enumerate() {
            let upgraded = upgrade.simulated(results, crew)?;
            let candidates = upgrade.priced(&candidates);
            let runs = SensorRuns::read(&upgraded, &candidates)?;
            notes.extend(left_out(runs.data.failed, &format!(" with {}", upgrade.name)));
            let mut wanted = candidates.sets();
            let is_upgraded = |set: SensorMask| set & upgrade.sensors == upgrade.sensors;
            wanted.retain(|&set| candidates.keeps_control(set) && is_upgraded(set));
            let judged = judge_all((&runs, &candidates), &wanted, Some(place), crew)?;
            sets.extend(judged.into_iter().map(|(set, ..)| set));
        }
        mark_front(&mut sets);
        let scenario = results.scenario.name();
        Ok(SensorTrade { scenario, candidates, upgrades, sets, pairs, notes })
    }

    /// What was found of a set, without upgrades or with one.
    pub fn of(&self, set: SensorMask, upgrade: Option<usize>) -> Option<&SensorSet> {
        self.sets.iter().find(|own| own.set == set && own.upgrade == upgrade)
    }

    /// The system's own sensors with an upgrade.
    pub fn upgraded(&self, upgrade: usize) -> Option<&SensorSet> {
        self.of(self.candidates.base() | self.upgrades[upgrade].sensors, Some(upgrade))
    }

    /// For every number of sensors, the set with the fewest shutdown errors that leaves control possible, without
    /// upgrades. Among equals it isolates the most faults, then detects the most, then costs the least.
    pub fn best_of_sizes(&self) -> Vec<&SensorSet> {
        let mut best: BTreeMap<u32, &SensorSet> = BTreeMap::new();
        for set in self.sets.iter().filter(|set| set.keeps_control && set.upgrade.is_none()) {
            let first = best.entry(set.set.count_ones()).or_insert(set);
            let key = |s: &SensorSet| {
                let Rate { count, .. } = s.rates.isolated[0];
                (s.errors(), u64::MAX - count, u64::MAX - s.rates.detected.count)
            };
            if key(set) < key(first) || (key(set) == key(first) && set.cost < first.cost) {
                *first = set;
            }
        }
        best.into_values().collect()
    }
}

/// What readers must know of the study's own runs.
fn notes(
    results: &StudyResultsFolder,
    is_structural: bool,
    has_extra: bool,
    failed: usize,
) -> Vec<String> {
    let too_few = format!(
        "the scenario {} has too few healthy specimens for a covariance of all sensors, so structural isolability is \
         missing",
        results.scenario.name()
    );
    let extra = results.study.extra_sensor.as_ref().filter(|_| !has_extra);
    let extra = extra.map(|_| "the extra sensor is judged in the scenario realistic only".into());
    let too_few = (!is_structural).then_some(too_few);
    too_few.into_iter().chain(extra).chain(left_out(failed, "")).collect()
}

fn left_out(failed: usize, how: &str) -> Option<String> {
    let text = || format!("{failed} runs{how} were not simulated to the end and are left out");
    (failed > 0).then(text)
}

/// Judges sets of sensors, on the runs of the study or of an upgrade.
fn judge_all(
    (runs, candidates): (&SensorRuns, &Candidates),
    sets: &[SensorMask],
    upgrade: Option<usize>,
    crew: &Crew,
) -> Result<Vec<Judged>, SafetyError> {
    let done = AtomicUsize::new(0);
    let judge = |&set: &SensorMask| {
        let judged = judge(runs, candidates, set);
        let share = (1 + done.fetch_add(1, Ordering::Relaxed)) as f64 / sets.len() as f64;
        (crew.progress)("judging sets of sensors", share);
        judged.map(|(own, answers, alike)| (SensorSet { upgrade, ..own }, answers, alike))
    };
    let judged = parallel::map(sets, crew.workers, judge).map_err(|_| SafetyError::Cancelled)?;
    judged.into_iter().collect()
}

fn judge(
    runs: &SensorRuns,
    candidates: &Candidates,
    set: SensorMask,
) -> Result<Judged, SafetyError> {
    let answers = judged::answers(runs, candidates, set)?;
    let alike = structure::isolability(runs, candidates, set);
    let isolable = alike.as_ref().map(|alike| {
        [1, 2, 3].map(|size| {
            let holds = |(place, answer): (usize, &FaultAnswer)| {
                let holds = answer.is_detected && alike.is_isolable(place, size);
                trial(&runs.data, answer.row, holds)
            };
            Rate::clustered(&answers.iter().enumerate().map(holds).collect::<Vec<_>>())
        })
    });
    let found = SensorSet {
        set,
        upgrade: None,
        cost: candidates.cost(set),
        keeps_control: candidates.keeps_control(set),
        rates: judged::rates(runs, set, &answers),
        isolable,
        is_on_front: false,
    };
    Ok((found, answers, alike))
}

fn mark_front(sets: &mut [SensorSet]) {
    let able: Vec<SensorSet> = sets.iter().filter(|set| set.keeps_control).cloned().collect();
    for set in sets.iter_mut().filter(|set| set.keeps_control) {
        set.is_on_front = !able.iter().any(|other| other.beats(set));
    }
}

impl SetPairs {
    /// Counts, for every fault, the faults that its detected runs look like or are taken for.
    fn count(runs: &SensorRuns, (own, answers, alike): &Judged) -> Self {
        let mut pairs: BTreeMap<(FaultClass, FaultClass), FaultPair> = BTreeMap::new();
        let mut detected: BTreeMap<FaultClass, u64> = BTreeMap::new();
        let (mut alike_runs, mut alike_right) = (0, 0);
        for (place, answer) in answers.iter().enumerate().filter(|(_, answer)| answer.is_detected) {
            let truth = runs.class(answer.row);
            *detected.entry(truth).or_default() += 1;
            let like = alike.as_ref().map_or(&[][..], |alike| &alike.alike[place]);
            alike_runs += u64::from(!like.is_empty());
            alike_right += u64::from(!like.is_empty() && answer.fault == Some(truth));
            for &other in like {
                pairs.entry((truth, other)).or_default().alike += 1;
            }
            if let Some(other) = answer.fault.filter(|other| *other != truth) {
                let pair = pairs.entry((truth, other)).or_default();
                pair.confused += 1;
                pair.confused_alike += u64::from(like.contains(&other));
            }
        }
        let named = |((truth, other), pair): ((FaultClass, FaultClass), FaultPair)| {
            let names = (runs.fault_name(truth), runs.fault_name(other));
            (names, FaultPair { detected: detected[&truth], ..pair })
        };
        let pairs = pairs.into_iter().map(named).collect();
        SetPairs { set: own.set, is_structural: alike.is_some(), alike_runs, alike_right, pairs }
    }
}
