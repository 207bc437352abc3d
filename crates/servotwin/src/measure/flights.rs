//! Evaluates the diagnosis over many flights: latency, certainty and errors.
//!
//! Every flight has an environment, a specimen and noise that were not used in training.

use super::outcome::RunOutcome;
use super::{Answers, OF_FLIGHTS, Rates};
use crate::run::Profile;
use crate::run::fitted_twins::CalibrationRecords;
use crate::study::Study;
use crate::study::suites::JUDGE;
use serde::{Deserialize, Serialize};
use servotwin_learning::metrics::{MedianTime, Tail, clopper_pearson_upper, poisson_mean};
use std::collections::BTreeMap;

/// The least intensity whose latencies are compared with the limit.
pub const STRONG: f64 = 0.5;

/// Latency of an event, s after the onset of the fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Latency {
    /// Number of flights with the event.
    pub(crate) flights: u64,
    /// Median, s.
    pub median_s: f64,
    /// 95 % quantile, s.
    pub p95_s: f64,
    /// Maximum, s.
    pub longest_s: f64,
    /// Pairs of time (s) and the share of *all visible* faults of the class with the event by then.
    pub by_s: Vec<(f64, f64)>,
}

/// Results of the flights with faults that require one action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClassMetrics {
    /// The action for these faults.
    pub action: String,
    /// The smallest and the largest intensity.
    pub intensities: [f64; 2],
    /// All measures of these flights.
    pub rates: Rates,
    /// From the onset to the first of the windows that made the fault visible.
    pub detection: Option<Latency>,
    /// From the onset to the right action.
    pub isolation: Option<Latency>,
    /// From visibility to the right action.
    pub isolation_since_visible: Option<Latency>,
}

/// How fast one kind of fault is noticed, in flights on all actuators.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KindLatency {
    /// The kind of fault.
    pub kind: String,
    /// The least intensity of the counted flights: 0 or [`STRONG`].
    pub least_intensity: f64,
    /// From the onset until the fault was visible.
    pub detection: MedianTime,
    /// From the onset to the right action for the right actuator, where it was the first one and the fault was visible:
    /// the flights that [`RIGHT_ACTION_OF_ALL`](super::RIGHT_ACTION_OF_ALL) counts.
    pub isolation: MedianTime,
}

impl KindLatency {
    fn of(kind: &str, least_intensity: f64, outcomes: &[&RunOutcome]) -> Self {
        let isolated_s = |row: &&RunOutcome| row.right_action_s.filter(|_| row.is_isolated());
        KindLatency {
            kind: kind.into(),
            least_intensity,
            detection: MedianTime::of(outcomes.iter().map(|row| row.visible_s)),
            isolation: MedianTime::of(outcomes.iter().map(isolated_s)),
        }
    }
}

/// Results of flights without a fault, and of the time before faults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HealthyMetrics {
    /// Duration, h.
    pub hours: f64,
    /// Number of actions raised.
    pub alarms: u64,
    /// Number of shutdowns raised.
    pub shutdowns: u64,
    /// Alarms per hour.
    pub alarms_per_h: f64,
    /// The upper limit of that rate with 95 % confidence (one-sided, Poisson).
    pub alarms_per_h_upper: f64,
    /// The same alarms by environment.
    pub environments: EnvironmentMetrics,
    /// The same shutdowns by environment.
    pub shutdown_environments: EnvironmentMetrics,
    /// How near flights without a fault come to an alarm, where each has an environment of its own.
    pub nearness: Option<Nearness>,
}

/// How near healthy flights come to an alarm. The largest evidence of each flight is a block maximum, and their tail
/// gives a rate where counting gives only a bound.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Nearness {
    /// The largest evidence for any action in any flight, in parts of its limit.
    pub largest_evidence: f64,
    /// The largest evidence for a shutdown in any flight, in parts of its limit.
    pub largest_shutdown_evidence: f64,
    /// The tail of the largest evidence for any action, extrapolated to the limit; `None` for too few flights.
    pub tail: Option<Tail>,
    /// The same for shutdowns.
    pub shutdown_tail: Option<Tail>,
}

impl Nearness {
    fn new(flights: &[&RunOutcome]) -> Self {
        let maxima = |evidence: fn(&RunOutcome) -> f64| -> Vec<f64> {
            flights.iter().map(|row| evidence(row)).collect()
        };
        let largest = |maxima: &[f64]| maxima.iter().copied().fold(0.0, f64::max);
        let of_any = maxima(|row| row.evidence);
        let of_shutdown = maxima(|row| row.shutdown_evidence);
        Nearness {
            largest_evidence: largest(&of_any),
            largest_shutdown_evidence: largest(&of_shutdown),
            tail: Tail::fit(&of_any, 1.0),
            shutdown_tail: Tail::fit(&of_shutdown, 1.0),
        }
    }
}

impl HealthyMetrics {
    /// Counts the time without a fault in finished flights.
    pub(crate) fn new(rows: &[&RunOutcome]) -> Self {
        let sum = |of: fn(&RunOutcome) -> u64| rows.iter().map(|row| of(row)).sum::<u64>();
        let (alarms, shutdowns) = (sum(|row| row.early_alarms), sum(|row| row.early_shutdowns));
        let hours = rows.iter().map(|row| row.healthy_s()).sum::<f64>() / 3600.0;
        let environments = |count: fn(&RunOutcome) -> u64| {
            let mut alarmed = BTreeMap::new();
            for row in rows.iter().filter(|row| row.healthy_s() > 0.0) {
                *alarmed.entry(row.environment).or_insert(false) |= count(row) > 0;
            }
            EnvironmentMetrics::new(alarmed.into_values())
        };
        let calm: Vec<&RunOutcome> = rows.iter().copied().filter(|row| !row.is_fault()).collect();
        let of_alarms = environments(|row| row.early_alarms);
        let is_one_each = calm.len() == rows.len() && of_alarms.flown == rows.len() as u64;
        HealthyMetrics {
            hours,
            alarms,
            shutdowns,
            alarms_per_h: alarms as f64 / hours.max(f64::MIN_POSITIVE),
            alarms_per_h_upper: poisson_mean(alarms, 0.05) / hours.max(f64::MIN_POSITIVE),
            environments: of_alarms,
            shutdown_environments: environments(|row| row.early_shutdowns),
            nearness: is_one_each.then(|| Nearness::new(&calm)),
        }
    }
}

/// False alarms counted by environment. Alarms cluster: what raises one raises others in the same environment. So hours
/// in one environment are not independent, and environments are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EnvironmentMetrics {
    /// Number of environments with time without a fault.
    pub flown: u64,
    /// Number of these with an alarm in that time.
    pub with_alarm: u64,
    /// The upper limit of the share of environments with an alarm, with 95 % confidence (one-sided, Clopper-Pearson).
    pub share_upper: f64,
}

impl EnvironmentMetrics {
    /// From each environment with time without a fault: whether an alarm was raised in it.
    fn new(alarmed: impl Iterator<Item = bool>) -> Self {
        let (mut flown, mut with_alarm) = (0, 0);
        for alarmed in alarmed {
            flown += 1;
            with_alarm += u64::from(alarmed);
        }
        Self { flown, with_alarm, share_upper: clopper_pearson_upper(with_alarm, flown, 0.95) }
    }
}

/// What flights belong to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightGroup {
    /// The suite.
    pub suite: String,
    /// The scenario.
    pub scenario: String,
    /// The sensor that the diagnosis lacks; empty for none.
    pub missing: String,
}

impl FlightGroup {
    /// The name for readers. Flights of [`JUDGE`] have that of their scenario alone.
    pub(crate) fn title(&self) -> String {
        let FlightGroup { suite, scenario, missing } = self;
        let suite = if suite == JUDGE { String::new() } else { format!("{suite}, ") };
        let without =
            if missing.is_empty() { String::new() } else { format!(" without {missing}") };
        format!("{suite}{scenario}{without}")
    }
}

/// The performance in the flights of a suite in a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightMetrics {
    /// What was flown.
    #[serde(flatten)]
    pub group: FlightGroup,
    /// Number of flights with a fault.
    pub flights: u64,
    /// Number of flights that could not be simulated to the end; they are excluded.
    pub failed: u64,
    /// What became of the calibration flights, where twins are fitted to plants of another structure.
    pub calibration: Option<CalibrationRecords>,
    /// The time limit for isolating 95 % of the visible, strong shutdown faults, s after the onset.
    pub limit_s: f64,
    /// All measures of all faults, and of flights without one.
    pub rates: Rates,
    /// By action, faults of all intensities.
    pub classes: Vec<ClassMetrics>,
    /// By action, faults of at least [`STRONG`].
    pub strong_classes: Vec<ClassMetrics>,
    /// By kind of fault: first all intensities, then the strong ones.
    pub kinds: Vec<KindLatency>,
    /// By kind of onset: strong shutdown faults.
    pub onsets: Vec<(String, ClassMetrics)>,
    /// Results without a fault.
    pub healthy: HealthyMetrics,
    /// Kinds of fault for which a shutdown of the wrong actuator was raised, with the number of flights.
    pub wrong_kinds: Vec<(String, u64)>,
}

impl FlightMetrics {
    /// Evaluates the outcomes of flights against a latency limit.
    pub fn of(study: &Study, group: FlightGroup, limit_s: f64, outcomes: &[RunOutcome]) -> Self {
        let judged = Judged::new(study, limit_s, outcomes);
        let faults = judged.faults(|_| true);
        FlightMetrics {
            group,
            flights: faults.len() as u64,
            failed: outcomes.iter().filter(|row| !row.is_finished).count() as u64,
            calibration: None,
            limit_s,
            rates: judged.rates(&judged.rows),
            classes: judged.classes(0.0),
            strong_classes: judged.classes(STRONG),
            kinds: [0.0, STRONG].into_iter().flat_map(|least| judged.kinds(least)).collect(),
            onsets: judged.onsets(),
            healthy: HealthyMetrics::new(&judged.rows),
            wrong_kinds: judged.wrong_kinds(),
        }
    }

    /// The name for readers of what was flown.
    pub fn title(&self) -> String {
        self.group.title()
    }
}

/// The finished flights of one diagnosis.
struct Judged<'j> {
    study: &'j Study,
    limit_s: f64,
    rows: Vec<&'j RunOutcome>,
    /// The first fault of each kind, and of each kind at each intensity.
    clusters: BTreeMap<(&'j str, u64), (u32, u32)>,
}

impl<'j> Judged<'j> {
    fn new(study: &'j Study, limit_s: f64, all: &'j [RunOutcome]) -> Self {
        let rows = all.iter().filter(|row| row.is_finished).collect();
        let mut kinds = BTreeMap::new();
        let mut clusters = BTreeMap::new();
        for (fault, place) in study.faults.iter().zip(0..) {
            let kind = *kinds.entry(fault.kind.as_str()).or_insert(place);
            let intensity = fault.at.intensity.to_bits();
            clusters.entry((fault.kind.as_str(), intensity)).or_insert((kind, place));
        }
        Judged { study, limit_s, rows, clusters }
    }

    /// The flights with a fault that a choice selects.
    fn faults(&self, choice: impl Fn(&RunOutcome) -> bool) -> Vec<&'j RunOutcome> {
        let is_chosen = |row: &&RunOutcome| row.is_fault() && choice(row);
        self.rows.iter().copied().filter(is_chosen).collect()
    }

    /// By action: the flights with faults of at least an intensity.
    fn classes(&self, least_intensity: f64) -> Vec<ClassMetrics> {
        let class = |action: &String| {
            self.class(action, |row| row.action == *action && row.intensity >= least_intensity)
        };
        self.study.actions().iter().filter_map(class).collect()
    }

    /// By kind of onset: strong faults that need a shutdown.
    fn onsets(&self) -> Vec<(String, ClassMetrics)> {
        let off = self.study.shutdowns().join(", ");
        let is_meant = |row: &RunOutcome| row.needs_shutdown && row.intensity >= STRONG;
        let one = |onset: Profile| {
            let class = self.class(&off, |row| is_meant(row) && row.profile == onset.name())?;
            Some((onset.name().to_owned(), class))
        };
        Profile::ALL.into_iter().filter_map(one).collect()
    }

    fn class(&self, action: &str, choice: impl Fn(&RunOutcome) -> bool) -> Option<ClassMetrics> {
        let outcomes = self.faults(choice);
        let (first, others) = outcomes.split_first()?;
        let intensities = others.iter().fold([first.intensity; 2], |[low, high], row| {
            [low.min(row.intensity), high.max(row.intensity)]
        });
        let visible: Vec<&RunOutcome> =
            outcomes.iter().copied().filter(|row| row.visible_s.is_some()).collect();
        let of = visible.len() as u64;
        let times = |of_row: fn(&RunOutcome) -> Option<f64>| {
            latency(visible.iter().filter_map(|row| of_row(row)), of)
        };
        Some(ClassMetrics {
            action: action.into(),
            intensities,
            rates: self.rates(&outcomes),
            detection: times(|row| row.visible_s),
            isolation: times(|row| row.right_action_s),
            isolation_since_visible: times(RunOutcome::waited_s),
        })
    }

    /// The latency of every kind of fault from an intensity on, in the order of the study.
    fn kinds(&self, least_intensity: f64) -> Vec<KindLatency> {
        let mut kinds: BTreeMap<u32, Vec<&RunOutcome>> = BTreeMap::new();
        for row in self.faults(|row| row.intensity >= least_intensity) {
            kinds.entry(self.clusters_of(row).0).or_default().push(row);
        }
        let latency = |own: Vec<&RunOutcome>| KindLatency::of(&own[0].kind, least_intensity, &own);
        kinds.into_values().map(latency).collect()
    }

    /// The numbers of a fault's kind, and of its kind at its intensity.
    fn clusters_of(&self, row: &RunOutcome) -> (u32, u32) {
        let key = (row.kind.as_str(), row.intensity.to_bits());
        self.clusters.get(&key).copied().unwrap_or_default()
    }

    /// All measures of some flights. Faults of one kind at one intensity are correlated, and so are those of one kind.
    fn rates(&self, flights: &[&'j RunOutcome]) -> Rates {
        let answers = Answers::of(self.study);
        Rates::count((OF_FLIGHTS, self.limit_s), answers, flights, |row| {
            let (kind, cluster) = self.clusters_of(row);
            row.is_fault().then_some((cluster, kind))
        })
    }

    /// The kinds of fault in which a healthy actuator was shut down, with the number of flights.
    fn wrong_kinds(&self) -> Vec<(String, u64)> {
        let mut kinds: Vec<(String, u64)> = vec![];
        for row in self.faults(|row| row.shutdown_healthy) {
            match kinds.iter_mut().find(|(kind, _)| *kind == row.kind) {
                Some((_, count)) => *count += 1,
                None => kinds.push((row.kind.clone(), 1)),
            }
        }
        kinds
    }
}

/// Times at which shares are reported, s.
const TIMES_S: [f64; 10] = [0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0];

pub(crate) fn latency(times_s: impl Iterator<Item = f64>, of: u64) -> Option<Latency> {
    let mut times_s: Vec<f64> = times_s.collect();
    times_s.sort_by(f64::total_cmp);
    let last = times_s.len().checked_sub(1)?;
    let quantile = |share: f64| times_s[(share * times_s.len() as f64).ceil() as usize - 1];
    let by = |limit_s: f64| {
        let soon = times_s.iter().filter(|time| **time <= limit_s).count();
        (limit_s, soon as f64 / of.max(1) as f64)
    };
    Some(Latency {
        flights: times_s.len() as u64,
        median_s: quantile(0.5),
        p95_s: quantile(0.95),
        longest_s: times_s[last],
        by_s: TIMES_S.into_iter().map(by).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::outcome::FirstAction;
    use super::*;

    #[test]
    fn a_late_correction_and_an_action_for_an_invisible_fault_are_no_isolation() {
        let outcome = |visible_s: Option<f64>, first: FirstAction| RunOutcome {
            visible_s,
            right_action_s: Some(2.0),
            first,
            ..RunOutcome::default()
        };
        let outcomes = [
            outcome(Some(1.0), FirstAction::Right),
            outcome(Some(1.0), FirstAction::OtherActuator),
            outcome(None, FirstAction::Right),
        ];
        let kind = KindLatency::of("leak", 0.0, &outcomes.each_ref());
        assert_eq!((kind.isolation.events, kind.isolation.of), (1, 3));
        assert_eq!(kind.detection.events, 2);
    }

    #[test]
    fn nothing_seen_bounds_the_rate_by_three_over_the_time() {
        assert!((poisson_mean(0, 0.05) - 2.9957).abs() < 1e-3);
        // From tables of the chi-squared distribution.
        assert!((poisson_mean(1, 0.05) - 4.7439).abs() < 1e-3);
        assert!((poisson_mean(10, 0.05) - 16.9622).abs() < 1e-3);
    }

    #[test]
    fn an_environment_counts_once_however_many_alarms_it_has() {
        let none = EnvironmentMetrics::new(vec![false; 480].into_iter());
        assert_eq!((none.flown, none.with_alarm), (480, 0));
        // Without an event the limit is 1 − 0.05^(1/n).
        assert!((none.share_upper - 0.006_222).abs() < 1e-6, "{}", none.share_upper);
        let two = EnvironmentMetrics::new([true, false, true, false, false].into_iter());
        assert_eq!((two.flown, two.with_alarm), (5, 2));
        // The table of Clopper and Pearson for two of five.
        assert!((two.share_upper - 0.810_7).abs() < 1e-4, "{}", two.share_upper);
        assert_eq!(EnvironmentMetrics::new([].into_iter()).share_upper, 1.0);
    }

    #[test]
    fn latencies_are_quantiles_of_those_that_came_and_shares_of_all() {
        let found = latency((1..=10).map(f64::from), 20).unwrap();
        assert_eq!(
            (found.flights, found.median_s, found.p95_s, found.longest_s),
            (10, 5.0, 10.0, 10.0)
        );
        assert_eq!(found.by_s.last(), Some(&(5.0, 0.25)));
        assert!(latency(std::iter::empty(), 3).is_none());
    }
}
