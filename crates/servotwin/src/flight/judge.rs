//! Evaluates the diagnosis over many flights: latency, certainty and errors.
//!
//! Every flight has an environment, a specimen and noise that were not used in training. In the full size, the same
//! flights are evaluated at several target rates of false alarms, which gives the trade-off between alarms and latency.
//! The few hours of the usual size cannot tell these rates apart.

use super::campaign::{FlightCampaign, Observer};
use super::plan::{self, Onset, PlannedFlight, Purpose};
use super::training_windows::MovingFlight;
use crate::study::{FaultCase, Flights, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Diagnoser, HealthyEvidence, Outcome, Raised, Session};
use servotwin_diagnosis::error::Error;
use servotwin_diagnosis::panel::SensorBand;
use servotwin_learning::metrics::{
    MedianTime, Rate, Trial, clopper_pearson_upper, poisson_at_most,
};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Target rates of false alarms besides the diagnoser's own, per hour.
const ASKED_PER_H: [f64; 2] = [1.0, 1e-6];

/// The least intensity whose latencies are compared with the limit.
pub const STRONG: f64 = 0.5;

/// Latency of an event, s after the onset of the fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Latency {
    /// Number of flights with the event.
    pub flights: u64,
    /// Median, s.
    pub median_s: f64,
    /// 95 % quantile, s.
    pub p95_s: f64,
    /// Maximum, s.
    pub longest_s: f64,
    /// Pairs of time (s) and the share of *all visible* faults of the class with the event by then.
    pub by_s: Vec<(f64, f64)>,
}

/// Results of the flights with faults of one command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClassMetrics {
    /// The command for these faults.
    pub command: String,
    /// The smallest and the largest intensity.
    pub intensities: [f64; 2],
    /// Number of flights.
    pub flown: u64,
    /// Flights in which the fault was visible.
    pub visible: Rate,
    /// Visible faults for which the right command for the right actuator was raised first.
    pub isolated: Rate,
    /// Visible faults for which another command for the right actuator was raised first.
    pub other_command: Rate,
    /// Visible faults for which a command for the wrong actuator was raised first.
    pub wrong_actuator: Rate,
    /// Flights in which a shutdown of the wrong actuator was raised at any time.
    pub wrong_shutdown: u64,
    /// Visible faults for which no command was raised.
    pub silent: Rate,
    /// From the onset to the first of the windows that made the fault visible.
    pub detection: Option<Latency>,
    /// From the onset to the right action.
    pub isolation: Option<Latency>,
    /// From visibility to the right command.
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
    /// the flights that [`ClassMetrics::isolated`] counts.
    pub isolation: MedianTime,
}

impl KindLatency {
    fn of(kind: &str, least_intensity: f64, outcomes: &[FlightOutcome]) -> Self {
        KindLatency {
            kind: kind.into(),
            least_intensity,
            detection: MedianTime::of(outcomes.iter().map(|outcome| outcome.seen_s)),
            isolation: MedianTime::of(outcomes.iter().map(|outcome| {
                let is_isolated = outcome.is_isolated() && outcome.seen_s.is_some();
                outcome.isolated_s.filter(|_| is_isolated)
            })),
        }
    }
}

/// Results of flights without a fault, and of the time before faults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HealthyMetrics {
    /// Duration, h.
    pub hours: f64,
    /// Number of commands raised.
    pub alarms: u64,
    /// Number of shutdowns raised.
    pub shutdowns: u64,
    /// Alarms per hour.
    pub alarms_per_h: f64,
    /// The upper limit of that rate with 95 % confidence (one-sided, Poisson).
    pub alarms_per_h_upper: f64,
    /// How often windows left their bands as if a fault were visible.
    pub visible_by_chance: u64,
    /// Number of flights without a fault, and of those with an alarm.
    pub flights: [u64; 2],
    /// The same alarms by environment.
    pub environments: EnvironmentMetrics,
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
    pub(super) fn new(alarmed: impl Iterator<Item = bool>) -> Self {
        let (mut flown, mut with_alarm) = (0, 0);
        for alarmed in alarmed {
            flown += 1;
            with_alarm += u64::from(alarmed);
        }
        Self { flown, with_alarm, share_upper: clopper_pearson_upper(with_alarm, flown, 0.95) }
    }
}

/// A point of the trade-off between alarms and latency.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TradePoint {
    /// The target rate of false alarms, per hour.
    pub asked_per_h: f64,
    /// Results of healthy flights.
    pub healthy: HealthyMetrics,
    /// Isolation latency of visible, strong shutdown faults.
    pub isolation: Option<Latency>,
    /// Share of visible, strong shutdown faults that were never isolated.
    pub missed: Rate,
    /// Number of flights with a shutdown of the wrong actuator.
    pub wrong_shutdowns: u64,
}

/// Counts of visible, strong faults.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StrongFaults {
    /// Number for which the right command was raised first.
    pub count: u64,
    /// Number of all of them.
    pub of: u64,
}

/// The most flights without a steady state that are named in a message; the results file lists all.
const MAX_NAMED: usize = 10;

impl FlightMetrics {
    /// Counts the visible faults of at least [`STRONG`] for which the right command was raised first.
    pub fn strong(&self) -> StrongFaults {
        // Where all faults are strong, the classes of all intensities have the same content as those of the strong ones.
        let strong: BTreeMap<&str, &ClassMetrics> = (self.classes.iter())
            .filter(|class| class.intensities[0] >= STRONG)
            .map(|class| (class.command.as_str(), class))
            .collect();
        strong.into_values().fold(StrongFaults::default(), |sum, class| StrongFaults {
            count: sum.count + class.isolated.count,
            of: sum.of + class.isolated.of,
        })
    }

    /// Flights, of all with a fault, in which the right action for the right actuator came first. A fault that never
    /// became visible counts as missed.
    pub fn right_actions(&self) -> Rate {
        let sum = |of: fn(&ClassMetrics) -> u64| self.of_all_intensities().map(of).sum();
        Rate::new(sum(|class| class.isolated.count), sum(|class| class.flown))
    }

    /// Flights, of all with a fault that needs one of these shutdowns, in which it was not the first action.
    pub fn missed_shutdowns(&self, shutdowns: &[String]) -> Rate {
        let own = self.of_all_intensities().filter(|class| shutdowns.contains(&class.command));
        let (missed, flown) = own.fold((0, 0), |(missed, flown), class| {
            (missed + class.flown - class.isolated.count, flown + class.flown)
        });
        Rate::new(missed, flown)
    }

    /// The first entry of every action, which has all intensities.
    fn of_all_intensities(&self) -> impl Iterator<Item = &ClassMetrics> {
        let is_first = |place: usize, class: &ClassMetrics| {
            self.classes[..place].iter().all(|other| other.command != class.command)
        };
        let classes = self.classes.iter().enumerate();
        classes.filter(move |(place, class)| is_first(*place, class)).map(|(_, class)| class)
    }

    /// Names the training flights that began without a steady state; `None` if there are none.
    pub fn without_steady_state(&self) -> Option<String> {
        let moving = &self.on_the_move_to_learn;
        let name = |one: &MovingFlight| format!("{} (environment {})", one.flight, one.environment);
        let named: Vec<String> = moving.iter().take(MAX_NAMED).map(name).collect();
        let more = match moving.len().saturating_sub(MAX_NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        (!moving.is_empty()).then(|| {
            format!(
                "{}: {} flights to learn from began without a steady state and teach nothing: {}{more}",
                self.setting,
                moving.len(),
                named.join(", ")
            )
        })
    }
}

/// The performance in one scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightMetrics {
    /// The scenario's name.
    pub setting: String,
    /// Number of flights with a fault.
    pub flights: u64,
    /// Number of flights that could not be simulated to the end; they are excluded.
    pub failed: u64,
    /// The same for the training flights.
    pub failed_to_learn: u64,
    /// Training flights that began without a steady state; they are excluded from training.
    pub on_the_move_to_learn: Vec<MovingFlight>,
    /// The evidence of held-out healthy flights after training; `None` if none were flown.
    pub healthy_evidence: Option<HealthyEvidence>,
    /// The time limit for isolating 95 % of the visible, strong shutdown faults, s after the onset.
    pub limit_s: f64,
    /// The share isolated within the limit.
    pub in_time: Rate,
    /// The share visible within the limit; the others could hardly be isolated.
    pub visible_in_time: Rate,
    /// The share isolated within the limit after they became visible.
    pub in_time_since_visible: Rate,
    /// By command: first all intensities, then the strong ones.
    pub classes: Vec<ClassMetrics>,
    /// By kind of fault: first all intensities, then the strong ones.
    pub kinds: Vec<KindLatency>,
    /// By kind of onset: strong shutdown faults.
    pub onsets: Vec<(String, ClassMetrics)>,
    /// Results without a fault.
    pub healthy: HealthyMetrics,
    /// Number of flights with a shutdown of the wrong actuator.
    pub wrong_shutdowns: u64,
    /// The trade-off between alarms and latency; in the usual size only the diagnoser's own target rate.
    pub trade: Vec<TradePoint>,
    /// Kinds of fault for which a shutdown of the wrong actuator was raised, with the number of flights.
    pub wrong_kinds: Vec<(String, u64)>,
}

/// The performance with a missing sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MissingSensorMetrics {
    /// The scenario's name.
    pub setting: String,
    /// The sensor, which is missing during the whole flight.
    pub sensor: String,
    /// Number of flights with a fault.
    pub flights: u64,
    /// The share of visible, strong shutdown faults isolated within the limit.
    pub in_time: Rate,
    /// The share of visible, strong shutdown faults isolated at any time.
    pub isolated: Rate,
    /// Results without a fault.
    pub healthy: HealthyMetrics,
    /// Number of flights with a shutdown of the wrong actuator.
    pub wrong_shutdowns: u64,
}

/// The output of one session in one flight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct RaisedLog {
    /// Every command, at the time it was raised.
    pub raised: Vec<Raised>,
}

impl RaisedLog {
    /// Takes the outcome of a sample. A command that changes only its details is no new one.
    pub fn take(&mut self, outcome: &Outcome) {
        let before = self.raised.last().map(|raised| (raised.actuator, raised.action));
        let is_new = |raised: &Raised| raised.sample == outcome.sample;
        if let Some(raised) = outcome.raised.filter(is_new)
            && before != Some((raised.actuator, raised.action))
        {
            self.raised.push(raised);
        }
    }
}

/// The recorded results of evaluated flights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WatchedFlights {
    ended: Vec<Remembered>,
    /// Number of flights that failed.
    failed: u64,
}

impl WatchedFlights {
    /// Adds the results of other flights.
    pub fn add(&mut self, other: WatchedFlights) {
        self.ended.extend(other.ended);
        self.failed += other.failed;
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Remembered {
    /// Number of the flight.
    number: usize,
    seen: Option<u64>,
    by_chance: u64,
    stories: Vec<RaisedLog>,
}

/// The results of a flight: first the diagnoser's own session, then those at other target rates.
struct Ended {
    flight: PlannedFlight,
    /// The sample from which the fault is visible.
    seen: Option<u64>,
    /// How often a fault would have been called visible before the onset.
    by_chance: u64,
    stories: Vec<RaisedLog>,
}

struct Watching {
    sessions: Vec<(Session, RaisedLog)>,
    /// The index of a missing sensor.
    missing: Option<usize>,
    /// The sensor values without the missing sensor.
    measured: Vec<f64>,
    visibility: Visibility,
}

/// Whether the fault of a flight is visible: from the first of consecutive windows that left a band.
pub(super) struct Visibility {
    onset: u64,
    /// One counter for each window length.
    out_of_band: Vec<OutOfBand>,
    /// The sample from which it is visible.
    pub seen: Option<u64>,
    /// How often a fault was called visible before the onset.
    by_chance: u64,
}

/// Consecutive windows that left a band.
#[derive(Clone, Copy, Default)]
struct OutOfBand {
    windows: u32,
    /// The sample at which the first of them ended.
    first: u64,
}

impl OutOfBand {
    /// Takes a window of `panes` panes that ends at `index`; `None` means a window over all samples. Once there are
    /// enough consecutive windows, it returns the sample at which the first of them ended. The first and the last
    /// window share no sample, because a single sample that leaves a band by chance is in every window for a window's
    /// length.
    fn take(&mut self, index: u64, has_left: bool, panes: Option<u32>) -> Option<u64> {
        if !has_left {
            self.windows = 0;
            return None;
        }
        self.first = if self.windows == 0 { index } else { self.first };
        self.windows += 1;
        let enough = panes.map_or(1, |panes| panes + 1);
        (self.windows == enough).then_some(self.first)
    }
}

impl Visibility {
    /// For a diagnoser with a number of window lengths, and a fault that begins at the sample `onset`.
    pub fn new(lengths: usize, onset: u64) -> Self {
        let out_of_band = vec![OutOfBand::default(); lengths];
        Visibility { onset, out_of_band, seen: None, by_chance: 0 }
    }

    /// Takes the windows that end at a sample.
    pub fn look(&mut self, index: u64, session: &Session) {
        let diagnoser = session.diagnoser();
        if index == self.onset {
            self.out_of_band.fill(OutOfBand::default());
        }
        for (place, out_of_band) in self.out_of_band.iter_mut().enumerate() {
            if !session.has_new_window(place) || !session.is_full(place) {
                continue;
            }
            let (window, length) = (session.window(place), &diagnoser.lengths[place]);
            let bands = length.panel.bands.iter().enumerate();
            let is_out =
                |(sensor, band): (usize, &SensorBand)| window.largest(sensor) > band.half_width;
            let has_left = match window.excess() {
                Some(excess) => excess.iter().any(|excess| *excess > 1.0),
                None => bands.into_iter().any(is_out),
            };
            let Some(first) = out_of_band.take(index, has_left, length.span.panes) else {
                continue;
            };
            if index < self.onset {
                self.by_chance += 1;
            } else if self.seen.is_none_or(|seen| first < seen) {
                self.seen = Some(first);
            }
        }
    }
}

impl Observer for Watching {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        let measured = match self.missing {
            None => measured,
            Some(sensor) => {
                self.measured.clear();
                self.measured.extend_from_slice(measured);
                self.measured[sensor] = f64::NAN;
                &self.measured
            }
        };
        for (session, story) in &mut self.sessions {
            story.take(session.push(inputs, measured, twin));
        }
        self.visibility.look(index as u64, &self.sessions[0].0);
    }
}

/// The target rates of false alarms of which a diagnoser is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rates {
    /// The diagnoser's own.
    Own,
    /// Others besides, for the trade-off between alarms and latency.
    Several,
}

impl Rates {
    /// Those for flights of the full size, or of the usual one.
    pub fn of_size(is_full: bool) -> Self {
        if is_full { Rates::Several } else { Rates::Own }
    }
}

/// Flies the planned flights of a scenario, observed by a diagnoser.
///
/// # Errors
/// The error of [`Diagnoser::check`].
pub fn watch(
    flown: &FlightCampaign,
    diagnoser: &Diagnoser,
    rates: Rates,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<WatchedFlights, Error> {
    let with_rate = |false_alarms_per_h| {
        let mut other = diagnoser.clone();
        other.tuning.false_alarms_per_h = false_alarms_per_h;
        Session::new(Arc::new(other))
    };
    let sessions = match rates {
        Rates::Own => vec![Session::new(Arc::new(diagnoser.clone()))?],
        Rates::Several => asked(diagnoser).into_iter().map(with_rate).collect::<Result<_, _>>()?,
    };
    Ok(watched(flown, &sessions, None, progress))
}

/// Flies the planned flights of a scenario with a missing sensor, and evaluates the results.
///
/// # Errors
/// The error of [`Diagnoser::check`].
pub fn without(
    study: &Study,
    flown: &FlightCampaign,
    (setting, limit_s): (&str, f64),
    diagnoser: &Arc<Diagnoser>,
    sensor: usize,
) -> Result<MissingSensorMetrics, Error> {
    let sessions = [Session::new(diagnoser.clone())?];
    let watched = watched(flown, &sessions, Some(sensor), &|_, _| ());
    let ended = ended(&flown.plan, watched.ended);
    let judged = Judged { study, diagnoser, ended: &ended, period_s: study.sample_period_s };
    let off = judged.off_commands();
    let outcomes = judged.outcomes(0, |_| true);
    Ok(MissingSensorMetrics {
        setting: setting.into(),
        sensor: diagnoser.sensors[sensor].name.clone(),
        flights: outcomes.len() as u64,
        in_time: judged
            .share(off, &|outcome| outcome.isolated_s.is_some_and(|time_s| time_s <= limit_s)),
        isolated: judged.share(off, &|outcome| outcome.isolated_s.is_some()),
        healthy: judged.healthy(0),
        wrong_shutdowns: wrong_shutdowns(&outcomes),
    })
}

/// Runs sessions on the planned flights.
fn watched(
    flown: &FlightCampaign,
    sessions: &[Session],
    missing: Option<usize>,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> WatchedFlights {
    let period_s = flown.period_s();
    let lengths = sessions[0].diagnoser().lengths.len();
    let mut watched = WatchedFlights::default();
    flown.fly(
        &flown.which,
        |flight| Watching {
            sessions: sessions.iter().map(|s| (s.clone(), RaisedLog::default())).collect(),
            missing,
            measured: vec![],
            visibility: Visibility::new(lengths, (flight.onset_s / period_s).ceil() as u64),
        },
        |flight, watching, outcome| {
            match outcome {
                Ok(_) => {
                    let Watching { visibility, sessions, .. } = watching;
                    let Visibility { seen, by_chance, .. } = visibility;
                    let stories = sessions.into_iter().map(|(_, story)| story).collect();
                    let number = flight.number;
                    watched.ended.push(Remembered { number, seen, by_chance, stories });
                }
                Err(_) => watched.failed += 1,
            }
            progress(watched.ended.len() + watched.failed as usize, flown.which.len());
        },
    );
    watched
}

/// Combines the recorded results with the flights of their plan.
fn ended(plan: &[PlannedFlight], mut remembered: Vec<Remembered>) -> Vec<Ended> {
    remembered.sort_by_key(|remembered| remembered.number);
    let of = |Remembered { number, seen, by_chance, stories }| Ended {
        flight: plan[number],
        seen,
        by_chance,
        stories,
    };
    remembered.into_iter().map(of).collect()
}

/// Evaluates all test flights against a latency limit.
pub fn merit(
    study: &Study,
    flights: &Flights,
    (setting, limit_s): (&str, f64),
    diagnoser: &Diagnoser,
    watched: WatchedFlights,
) -> FlightMetrics {
    let plan = plan::flights(study, flights, Purpose::Judge);
    let WatchedFlights { ended, failed } = watched;
    let ended = self::ended(&plan, ended);
    let judged = Judged { study, diagnoser, ended: &ended, period_s: study.sample_period_s };
    judged.merit((setting, limit_s), failed)
}

/// The target rates, the diagnoser's own first.
fn asked(diagnoser: &Diagnoser) -> Vec<f64> {
    let own = diagnoser.tuning.false_alarms_per_h;
    let others = ASKED_PER_H.into_iter().filter(|rate| *rate != own);
    std::iter::once(own).chain(others).collect()
}

/// The outcome of a flight with a fault.
struct FlightOutcome {
    kind: String,
    /// Faults of one kind at one intensity are correlated, and so are those of one kind.
    cluster: u32,
    kind_number: u32,
    /// Seconds from the onset until the fault was visible, and until the right command.
    seen_s: Option<f64>,
    isolated_s: Option<f64>,
    /// Whether the actuator and the command raised first after the onset were right.
    first: Option<(bool, bool)>,
    /// Whether a shutdown of the wrong actuator was raised at any time.
    is_wrong_shutdown: bool,
}

impl FlightOutcome {
    /// The time from visibility to isolation, s.
    fn waited_s(&self) -> Option<f64> {
        Some((self.isolated_s? - self.seen_s?).max(0.0))
    }

    /// Whether the right command for the right actuator was raised first.
    fn is_isolated(&self) -> bool {
        self.first == Some((true, true))
    }
}

struct Judged<'j> {
    study: &'j Study,
    diagnoser: &'j Diagnoser,
    ended: &'j [Ended],
    period_s: f64,
}

impl Judged<'_> {
    fn merit(&self, (setting, limit_s): (&str, f64), failed: u64) -> FlightMetrics {
        let commands = &self.diagnoser.names().actions;
        let mut classes = vec![];
        for least in [0.0, STRONG] {
            classes.extend(
                commands.chunks(1).filter_map(|command| {
                    self.class(0, command, |flight| flight.intensity >= least)
                }),
            );
        }
        let ways = [
            ("at once", Onset::Step),
            ("drift", Onset::Drift),
            ("intermittent", Onset::Intermittent),
        ];
        let off = self.off_commands();
        let onsets = ways.into_iter().filter_map(|(name, onset)| {
            let choice = |f: &PlannedFlight| f.onset == onset && f.intensity >= STRONG;
            Some((name.to_owned(), self.class(0, off, choice)?))
        });
        let onsets = onsets.collect();
        let soon = |time_s: f64| time_s <= limit_s;
        let mut trade: Vec<TradePoint> = asked(self.diagnoser)
            .iter()
            .take(self.sessions())
            .enumerate()
            .map(|(s, rate)| self.trade(s, *rate))
            .collect();
        trade.sort_by(|a, b| b.asked_per_h.total_cmp(&a.asked_per_h));
        let mut wrong_kinds: Vec<(String, u64)> = vec![];
        for outcome in self.outcomes(0, |_| true).iter().filter(|outcome| outcome.is_wrong_shutdown)
        {
            match wrong_kinds.iter_mut().find(|(kind, _)| *kind == outcome.kind) {
                Some((_, count)) => *count += 1,
                None => wrong_kinds.push((outcome.kind.clone(), 1)),
            }
        }
        FlightMetrics {
            setting: setting.into(),
            flights: self.ended.iter().filter(|ended| ended.flight.fault.is_some()).count() as u64,
            failed,
            failed_to_learn: 0,
            healthy_evidence: self.diagnoser.healthy_evidence,
            on_the_move_to_learn: vec![],
            limit_s,
            in_time: self.share(off, &|outcome| outcome.isolated_s.is_some_and(soon)),
            visible_in_time: self.share(off, &|outcome| outcome.seen_s.is_some_and(soon)),
            in_time_since_visible: self.share(off, &|outcome| outcome.waited_s().is_some_and(soon)),
            classes,
            kinds: [0.0, STRONG].into_iter().flat_map(|least| self.kinds(least)).collect(),
            onsets,
            healthy: self.healthy(0),
            wrong_shutdowns: wrong_kinds.iter().map(|(_, count)| count).sum(),
            trade,
            wrong_kinds,
        }
    }

    /// The number of target rates that every flight was judged at.
    fn sessions(&self) -> usize {
        self.ended.first().map_or(1, |ended| ended.stories.len())
    }

    /// All actions that switch off.
    fn off_commands(&self) -> &[String] {
        &self.diagnoser.tuning.off_actions
    }

    fn is_off(&self, command: u32) -> bool {
        let name = &self.diagnoser.names().actions[command as usize];
        self.diagnoser.tuning.off_actions.contains(name)
    }

    fn outcomes(
        &self,
        session: usize,
        choice: impl Fn(&PlannedFlight) -> bool,
    ) -> Vec<FlightOutcome> {
        let chosen = self.ended.iter().filter(|ended| choice(&ended.flight));
        chosen.filter_map(|ended| self.outcome(ended, session)).collect()
    }

    fn outcome(&self, ended: &Ended, session: usize) -> Option<FlightOutcome> {
        let fault = &self.study.faults[ended.flight.fault?];
        let names = self.diagnoser.names();
        let (unit, class) = (&self.study.units[fault.unit], &self.study.classes[fault.class]);
        let onset = ended.flight.onset_s;
        let story = &ended.stories[session];
        let after = |sample: u64| sample as f64 * self.period_s - onset;
        let since = story.raised.iter().filter(|raised| after(raised.sample) >= 0.0);
        let judged = |raised: &&Raised| {
            let is_unit = names.actuators[raised.actuator as usize] == *unit;
            (is_unit, is_unit && names.actions[raised.action as usize] == class.command)
        };
        let right = since.clone().find(|raised| judged(raised).1);
        let faults = &self.study.faults;
        let first = |same: &dyn Fn(&FaultCase) -> bool| {
            faults.iter().position(same).unwrap_or_default() as u32
        };
        let is_kind = |other: &FaultCase| other.kind == fault.kind;
        Some(FlightOutcome {
            kind: fault.kind.clone(),
            cluster: first(&|o| is_kind(o) && o.at.intensity == fault.at.intensity),
            kind_number: first(&is_kind),
            seen_s: ended.seen.map(after),
            isolated_s: right.map(|raised| after(raised.sample)),
            first: since.clone().next().map(|raised| judged(&raised)),
            is_wrong_shutdown: story.raised.iter().any(|raised| {
                self.is_off(raised.action) && !judged(&raised).0 && after(raised.sample) >= 0.0
            }),
        })
    }

    /// Whether the fault of a flight calls for one of these commands.
    fn calls_for(&self, flight: &PlannedFlight, commands: &[String]) -> bool {
        let class = flight.fault.map(|f| &self.study.classes[self.study.faults[f].class]);
        class.is_some_and(|class| commands.contains(&class.command))
    }

    fn class(
        &self,
        session: usize,
        commands: &[String],
        choice: impl Fn(&PlannedFlight) -> bool,
    ) -> Option<ClassMetrics> {
        let is_of = |flight: &PlannedFlight| self.calls_for(flight, commands) && choice(flight);
        let intensities = self.ended.iter().map(|e| &e.flight).filter(|f| is_of(f));
        let intensities = intensities.map(|flight| flight.intensity);
        let ends = intensities
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], i| [low.min(i), high.max(i)]);
        let outcomes = self.outcomes(session, is_of);
        if outcomes.is_empty() {
            return None;
        }
        let visible: Vec<&FlightOutcome> =
            outcomes.iter().filter(|outcome| outcome.seen_s.is_some()).collect();
        let of = visible.len() as u64;
        let rate = |choice: &dyn Fn(&FlightOutcome) -> bool| rate(&visible, choice);
        let all: Vec<&FlightOutcome> = outcomes.iter().collect();
        Some(ClassMetrics {
            command: commands.join(", "),
            intensities: ends,
            flown: outcomes.len() as u64,
            visible: self::rate(&all, &|outcome| outcome.seen_s.is_some()),
            isolated: rate(&|outcome| outcome.is_isolated()),
            other_command: rate(&|outcome| outcome.first == Some((true, false))),
            wrong_actuator: rate(&|outcome| outcome.first == Some((false, false))),
            wrong_shutdown: wrong_shutdowns(&outcomes),
            silent: rate(&|outcome| outcome.first.is_none()),
            detection: latency(visible.iter().filter_map(|outcome| outcome.seen_s), of),
            isolation: latency(visible.iter().filter_map(|outcome| outcome.isolated_s), of),
            isolation_since_visible: latency(
                visible.iter().filter_map(|outcome| outcome.waited_s()),
                of,
            ),
        })
    }

    /// The latency of every kind of fault from an intensity on, in the order of the study.
    fn kinds(&self, least_intensity: f64) -> Vec<KindLatency> {
        let mut kinds: BTreeMap<u32, Vec<FlightOutcome>> = BTreeMap::new();
        for outcome in self.outcomes(0, |flight| flight.intensity >= least_intensity) {
            kinds.entry(outcome.kind_number).or_default().push(outcome);
        }
        let latency =
            |own: Vec<FlightOutcome>| KindLatency::of(&own[0].kind, least_intensity, &own);
        kinds.into_values().map(latency).collect()
    }

    /// The share of visible, strong faults of some commands that satisfy a condition.
    fn share(&self, commands: &[String], holds: &dyn Fn(&FlightOutcome) -> bool) -> Rate {
        let is_of =
            |flight: &PlannedFlight| self.calls_for(flight, commands) && flight.intensity >= STRONG;
        let outcomes = self.outcomes(0, is_of);
        let visible: Vec<&FlightOutcome> =
            outcomes.iter().filter(|outcome| outcome.seen_s.is_some()).collect();
        rate(&visible, holds)
    }

    fn healthy(&self, session: usize) -> HealthyMetrics {
        let (mut seconds, mut alarms, mut shutdowns) = (0.0, 0, 0);
        let mut alarmed = BTreeMap::new();
        let mut flights = [0, 0];
        for Ended { flight, stories, .. } in self.ended {
            let until_s = flight.onset_s.min(flight.duration_s);
            seconds += until_s;
            let before = alarms;
            let early = stories[session].raised.iter();
            for raised in early.filter(|r| (r.sample as f64 * self.period_s) < until_s) {
                alarms += 1;
                shutdowns += u64::from(self.is_off(raised.action));
            }
            if until_s > 0.0 {
                *alarmed.entry(flight.environment).or_insert(false) |= alarms > before;
            }
            if flight.fault.is_none() {
                flights[0] += 1;
                flights[1] += u64::from(alarms > before);
            }
        }
        let hours = seconds / 3600.0;
        HealthyMetrics {
            hours,
            alarms,
            shutdowns,
            alarms_per_h: alarms as f64 / hours.max(f64::MIN_POSITIVE),
            alarms_per_h_upper: most_of_poisson(alarms) / hours.max(f64::MIN_POSITIVE),
            visible_by_chance: self.ended.iter().map(|ended| ended.by_chance).sum(),
            flights,
            environments: EnvironmentMetrics::new(alarmed.into_values()),
        }
    }

    fn trade(&self, session: usize, asked_per_h: f64) -> TradePoint {
        let strong = |flight: &PlannedFlight| flight.intensity >= STRONG;
        let class = self.class(session, self.off_commands(), strong);
        let of = class.as_ref().map_or(0, |class| class.visible.count);
        let isolated = class.as_ref().and_then(|class| class.isolation.as_ref());
        let isolated = isolated.map_or(0, |latency| latency.flights);
        let outcomes = self.outcomes(session, |_| true);
        TradePoint {
            asked_per_h,
            healthy: self.healthy(session),
            isolation: class.and_then(|class| class.isolation),
            missed: Rate::new(of - isolated, of),
            wrong_shutdowns: wrong_shutdowns(&outcomes),
        }
    }
}

/// The number of flights in which a shutdown of the wrong actuator was raised.
fn wrong_shutdowns(outcomes: &[FlightOutcome]) -> u64 {
    outcomes.iter().filter(|outcome| outcome.is_wrong_shutdown).count() as u64
}

/// The share of flights that satisfy a condition; its interval is over whole clusters.
fn rate(outcomes: &[&FlightOutcome], holds: &dyn Fn(&FlightOutcome) -> bool) -> Rate {
    let trial = |outcome: &&FlightOutcome| Trial {
        cluster: outcome.cluster,
        kind: outcome.kind_number,
        holds: holds(outcome),
    };
    Rate::clustered(&outcomes.iter().map(trial).collect::<Vec<_>>())
}

/// Times at which shares are reported, s.
const TIMES_S: [f64; 10] = [0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0];

pub(super) fn latency(times_s: impl Iterator<Item = f64>, of: u64) -> Option<Latency> {
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

/// The mean of a Poisson distribution that gives at most `count` events with a probability of 5 %.
fn most_of_poisson(count: u64) -> f64 {
    let (mut low, mut high) = (0.0, 10.0 + 4.0 * count as f64);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if poisson_at_most(count, middle) > 0.05 { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_in_a_row_are_enough_where_the_first_and_the_last_share_no_sample() {
        // A single sample leaves a band, in the last of five panes: it is in five windows.
        let mut by_chance = OutOfBand::default();
        for index in 0..20 {
            let has_left = (4..9).contains(&index);
            assert_eq!(by_chance.take(index, has_left, Some(5)), None, "{index}");
        }
        // From the tenth sample on all windows leave the band; a gap restarts the count.
        let mut lasts = OutOfBand::default();
        let taken = (0..30).map(|index| lasts.take(index, index >= 10 && index != 14, Some(5)));
        let seen: Vec<(u64, u64)> =
            (0..).zip(taken).filter_map(|(index, first)| Some((index, first?))).collect();
        assert_eq!(seen, [(20, 15)]);
        // A window over all samples needs no second one.
        assert_eq!(OutOfBand::default().take(7, true, None), Some(7));
    }

    #[test]
    fn a_late_correction_and_an_action_for_an_invisible_fault_are_no_isolation() {
        let outcome = |seen_s: Option<f64>, first: Option<(bool, bool)>| FlightOutcome {
            kind: "leak".into(),
            cluster: 0,
            kind_number: 0,
            seen_s,
            isolated_s: Some(2.0),
            first,
            is_wrong_shutdown: false,
        };
        let right = Some((true, true));
        let outcomes = [
            outcome(Some(1.0), right),
            outcome(Some(1.0), Some((false, false))),
            outcome(None, right),
        ];
        let kind = KindLatency::of("leak", 0.0, &outcomes);
        assert_eq!((kind.isolation.events, kind.isolation.of), (1, 3));
        assert_eq!(kind.detection.events, 2);
    }

    #[test]
    fn nothing_seen_bounds_the_rate_by_three_over_the_time() {
        assert!((most_of_poisson(0) - 2.9957).abs() < 1e-3);
        // From tables of the chi-squared distribution.
        assert!((most_of_poisson(1) - 4.7439).abs() < 1e-3);
        assert!((most_of_poisson(10) - 16.9622).abs() < 1e-3);
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
