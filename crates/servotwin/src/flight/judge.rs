//! How fast, how sure, how often wrong: the diagnosis judged over many flights.
//!
//! Every flight is of an environment, a specimen and noise from which nothing was learned. The same
//! flights are watched with several rates of false alarms asked for, which gives the trade of alarms
//! against latency.

use super::campaign::{FlightCampaign, Observer};
use super::plan::{self, Flight, Onset, Purpose};
use super::training_windows::MovingFlight;
use crate::study::{FaultCase, Flights, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::{Diagnoser, Raised, Session};
use servotwin_diagnosis::error::Error;
use servotwin_diagnosis::panel::SensorBand;
use servotwin_learning::metrics::{Rate, Trial};
use std::sync::Arc;

/// The rates of false alarms that are asked for beside the diagnoser's own, per hour.
const ASKED_PER_H: [f64; 2] = [1.0, 1e-6];

/// Intensities from which on latencies are held against their limit.
pub const STRONG: f64 = 0.5;

/// When something happened, s after the onset of the fault: how much of it, and by when.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Latency {
    /// Of how many flights it is known.
    pub flights: u64,
    /// Half of them.
    pub median_s: f64,
    /// 95 % of them.
    pub p95_s: f64,
    /// All.
    pub longest_s: f64,
    /// The share of *all visible* faults of the class by so many seconds.
    pub by_s: Vec<(f64, f64)>,
}

/// What became of the flights with faults of one command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClassMetrics {
    /// The command.
    pub command: String,
    /// The least and the largest intensity.
    pub intensities: [f64; 2],
    /// Flights.
    pub flown: u64,
    /// Those in which the fault was visible at all.
    pub visible: Rate,
    /// Of the visible ones: the right command for the right actuator was raised first.
    pub isolated: Rate,
    /// A command that is less urgent or more, for the right actuator, was raised first.
    pub other_command: Rate,
    /// A command for the wrong actuator was raised first.
    pub wrong_actuator: Rate,
    /// The wrong actuator was to be shut down, first or later.
    pub wrong_shutdown: u64,
    /// No command was ever raised.
    pub silent: Rate,
    /// From the onset to the first of the windows that made it visible.
    pub detection: Option<Latency>,
    /// From the onset to the right command.
    pub isolation: Option<Latency>,
    /// From when the fault was visible to the right command.
    pub isolation_since_visible: Option<Latency>,
}

/// What became of flights without a fault, and of the time before faults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HealthyMetrics {
    /// Hours.
    pub hours: f64,
    /// Commands raised.
    pub alarms: u64,
    /// Shutdowns raised.
    pub shutdowns: u64,
    /// Alarms per hour.
    pub alarms_per_h: f64,
    /// The upper end of the 95 % interval of that (one-sided, Poisson).
    pub alarms_per_h_upper: f64,
    /// How often windows left their bands as if a fault was visible; `None` of results from before this was counted.
    #[serde(default)]
    pub visible_by_chance: Option<u64>,
}

/// One point of the trade.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TradePoint {
    /// False alarms per hour that the decision was asked for.
    pub asked_per_h: f64,
    /// Healthy flights.
    pub healthy: HealthyMetrics,
    /// Visible, strong shutdown faults: when they were isolated.
    pub isolation: Option<Latency>,
    /// The share of visible, strong shutdown faults that were never isolated.
    pub missed: Rate,
    /// Shutdowns of the wrong actuator in all flights.
    pub wrong_shutdowns: u64,
}

/// So many flights without a steady state are named in a line; the results file names all of them.
const MAX_NAMED: usize = 10;

impl FlightMetrics {
    /// Names the flights to learn from that began without a steady state; `None` where all began at rest.
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

/// The figures of merit in one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightMetrics {
    /// The setting's name.
    pub setting: String,
    /// Flights with a fault.
    pub flights: u64,
    /// Flights that could not be simulated to the end, which are left out.
    pub failed: u64,
    /// The same of the flights to learn from.
    #[serde(default)]
    pub failed_to_learn: u64,
    /// Flights to learn from that began without a steady state, which teach nothing.
    #[serde(default)]
    pub on_the_move_to_learn: Vec<MovingFlight>,
    /// How soon 95 % of the visible, strong shutdown faults are to be isolated, s since the onset.
    pub limit_s: f64,
    /// How many of them are.
    pub in_time: Rate,
    /// How many of them were visible by then: little could isolate the others.
    pub visible_in_time: Rate,
    /// How many of them are isolated within that time from when they were visible.
    pub in_time_since_visible: Rate,
    /// By command: all intensities, then the strong ones.
    pub classes: Vec<ClassMetrics>,
    /// By way of beginning, shutdown faults of strong intensity.
    pub onsets: Vec<(String, ClassMetrics)>,
    /// Without a fault.
    pub healthy: HealthyMetrics,
    /// Shutdowns of the wrong actuator, in all flights.
    pub wrong_shutdowns: u64,
    /// Alarms against latency.
    pub trade: Vec<TradePoint>,
    /// Kinds of fault that raised a shutdown of the wrong actuator, with how often.
    pub wrong_kinds: Vec<(String, u64)>,
}

/// What the diagnosis is worth where a sensor gives nothing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MissingSensorMetrics {
    /// The setting's name.
    pub setting: String,
    /// The sensor that is missing from the beginning of every flight.
    pub sensor: String,
    /// Flights with a fault.
    pub flights: u64,
    /// Visible, strong shutdown faults that are isolated in time, and that are isolated at all.
    pub in_time: Rate,
    /// Likewise, at any time.
    pub isolated: Rate,
    /// Without a fault.
    pub healthy: HealthyMetrics,
    /// Shutdowns of the wrong actuator, in all flights.
    pub wrong_shutdowns: u64,
}

/// What one session said in one flight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct RaisedLog {
    /// Every command when it was raised.
    raised: Vec<Raised>,
}

/// What is remembered of flights that were watched.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WatchedFlights {
    ended: Vec<Remembered>,
    /// Flights that could not be finished.
    failed: u64,
}

impl WatchedFlights {
    /// Adds what is remembered of other flights.
    pub fn add(&mut self, other: WatchedFlights) {
        self.ended.extend(other.ended);
        self.failed += other.failed;
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Remembered {
    /// The flight's number.
    number: usize,
    seen: Option<u64>,
    by_chance: u64,
    stories: Vec<RaisedLog>,
}

/// What is remembered of a flight: the diagnoser's own session first, then those of other rates.
struct Ended {
    flight: Flight,
    /// The sample since which the fault is visible.
    seen: Option<u64>,
    /// How often one would have been called visible before there was one.
    by_chance: u64,
    stories: Vec<RaisedLog>,
}

struct Watching {
    sessions: Vec<(Session, RaisedLog)>,
    /// A sensor that gives nothing.
    missing: Option<usize>,
    /// What it leaves of a sample.
    measured: Vec<f64>,
    onset: u64,
    /// For each length of a window.
    out_of_band: Vec<OutOfBand>,
    seen: Option<u64>,
    /// How often one was before the onset.
    by_chance: u64,
}

/// Windows in a row that left a band.
#[derive(Clone, Copy, Default)]
struct OutOfBand {
    windows: u32,
    /// The sample at which the first of them ended.
    first: u64,
}

impl OutOfBand {
    /// Takes the window of so many panes that ends at a sample (`None`: all that was ever measured). When there are
    /// enough in a row, once, the sample at which the first of them ended: the first and the last have no sample in
    /// common, for by chance one sample leaves a band, and that is in every window for a window's length.
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

impl Watching {
    /// A fault is visible from the first of windows in a row that left a band.
    fn look(&mut self, index: u64) {
        let Some((session, _)) = self.sessions.first() else { return };
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
            let before = story.raised.last().map(|raised| (raised.actuator, raised.action));
            let outcome = session.push(inputs, measured, twin);
            let is_new = |raised: &Raised| raised.sample == outcome.sample;
            if let Some(raised) = outcome.raised.filter(is_new)
                && before != Some((raised.actuator, raised.action))
            {
                story.raised.push(raised);
            }
        }
        self.look(index as u64);
    }
}

/// Flies the planned flights of a setting, watched by a diagnoser.
///
/// # Errors
/// What [`Diagnoser::check`] says.
pub fn watch(
    flown: &FlightCampaign,
    diagnoser: &Diagnoser,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<WatchedFlights, Error> {
    let with_rate = |false_alarms_per_h| {
        let mut other = diagnoser.clone();
        other.decision.false_alarms_per_h = false_alarms_per_h;
        Session::new(Arc::new(other))
    };
    let sessions = asked(diagnoser).into_iter().map(with_rate).collect::<Result<Vec<_>, _>>()?;
    Ok(watched(flown, &sessions, None, progress))
}

/// Flies the planned flights of a setting, watched by a diagnoser to which a sensor gives nothing, and judges what
/// was said.
///
/// # Errors
/// What [`Diagnoser::check`] says.
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
    let off = judged.off_command().unwrap_or_default();
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

/// Lets sessions watch the planned flights.
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
            onset: (flight.onset_s / period_s).ceil() as u64,
            out_of_band: vec![OutOfBand::default(); lengths],
            seen: None,
            by_chance: 0,
        },
        |flight, watching, outcome| {
            match outcome {
                Ok(_) => {
                    let Watching { seen, by_chance, sessions, .. } = watching;
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

/// What is remembered of flights, by the flights of their plan.
fn ended(plan: &[Flight], mut remembered: Vec<Remembered>) -> Vec<Ended> {
    remembered.sort_by_key(|remembered| remembered.number);
    let of = |Remembered { number, seen, by_chance, stories }| Ended {
        flight: plan[number],
        seen,
        by_chance,
        stories,
    };
    remembered.into_iter().map(of).collect()
}

/// Judges what was said in all flights that there are to be judged in, against the latency that is asked
/// for.
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

/// The diagnoser's own rate first.
fn asked(diagnoser: &Diagnoser) -> Vec<f64> {
    let own = diagnoser.decision.false_alarms_per_h;
    let others = ASKED_PER_H.into_iter().filter(|rate| *rate != own);
    std::iter::once(own).chain(others).collect()
}

/// What became of a flight with a fault.
struct FlightOutcome {
    kind: String,
    /// Faults of one kind at one intensity hang together, and so do those of one kind.
    cluster: u32,
    kind_number: u32,
    /// Seconds from the onset to the first of the windows that made it visible, and to the right command.
    seen_s: Option<f64>,
    isolated_s: Option<f64>,
    /// Actuator and command raised first after the onset, against those of the fault.
    first: Option<(bool, bool)>,
    /// The wrong actuator was to be shut down at any time.
    is_wrong_shutdown: bool,
}

impl FlightOutcome {
    /// How long it took to isolate what was visible.
    fn waited_s(&self) -> Option<f64> {
        Some((self.isolated_s? - self.seen_s?).max(0.0))
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
                commands.iter().filter_map(|command| {
                    self.class(0, command, |flight| flight.intensity >= least)
                }),
            );
        }
        let ways = [
            ("at once", Onset::Step),
            ("drift", Onset::Drift),
            ("intermittent", Onset::Intermittent),
        ];
        let off = self.off_command().unwrap_or_default();
        let onsets = ways.into_iter().filter_map(|(name, onset)| {
            let choice = |f: &Flight| f.onset == onset && f.intensity >= STRONG;
            Some((name.to_owned(), self.class(0, off, choice)?))
        });
        let onsets = onsets.collect();
        let soon = |time_s: f64| time_s <= limit_s;
        let mut trade: Vec<TradePoint> = asked(self.diagnoser)
            .iter()
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
            on_the_move_to_learn: vec![],
            limit_s,
            in_time: self.share(off, &|outcome| outcome.isolated_s.is_some_and(soon)),
            visible_in_time: self.share(off, &|outcome| outcome.seen_s.is_some_and(soon)),
            in_time_since_visible: self.share(off, &|outcome| outcome.waited_s().is_some_and(soon)),
            classes,
            onsets,
            healthy: self.healthy(0),
            wrong_shutdowns: wrong_kinds.iter().map(|(_, count)| count).sum(),
            trade,
            wrong_kinds,
        }
    }

    fn off_command(&self) -> Option<&str> {
        self.diagnoser.decision.off_actions.first().map(String::as_str)
    }

    fn is_off(&self, command: u32) -> bool {
        let name = &self.diagnoser.names().actions[command as usize];
        self.diagnoser.decision.off_actions.contains(name)
    }

    fn outcomes(&self, session: usize, choice: impl Fn(&Flight) -> bool) -> Vec<FlightOutcome> {
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

    fn class(
        &self,
        session: usize,
        command: &str,
        choice: impl Fn(&Flight) -> bool,
    ) -> Option<ClassMetrics> {
        let is_of = |flight: &Flight| {
            let class = flight.fault.map(|f| &self.study.classes[self.study.faults[f].class]);
            class.is_some_and(|class| class.command == command) && choice(flight)
        };
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
            command: command.into(),
            intensities: ends,
            flown: outcomes.len() as u64,
            visible: self::rate(&all, &|outcome| outcome.seen_s.is_some()),
            isolated: rate(&|outcome| outcome.first == Some((true, true))),
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

    /// The share of visible, strong faults of a command of which something holds.
    fn share(&self, command: &str, holds: &dyn Fn(&FlightOutcome) -> bool) -> Rate {
        let is_of = |flight: &Flight| {
            let class = flight.fault.map(|f| &self.study.classes[self.study.faults[f].class]);
            class.is_some_and(|class| class.command == command) && flight.intensity >= STRONG
        };
        let outcomes = self.outcomes(0, is_of);
        let visible: Vec<&FlightOutcome> =
            outcomes.iter().filter(|outcome| outcome.seen_s.is_some()).collect();
        rate(&visible, holds)
    }

    fn healthy(&self, session: usize) -> HealthyMetrics {
        let (mut seconds, mut alarms, mut shutdowns) = (0.0, 0, 0);
        for Ended { flight, stories, .. } in self.ended {
            let until_s = flight.onset_s.min(flight.duration_s);
            seconds += until_s;
            let early = stories[session].raised.iter();
            for raised in early.filter(|r| (r.sample as f64 * self.period_s) < until_s) {
                alarms += 1;
                shutdowns += u64::from(self.is_off(raised.action));
            }
        }
        let hours = seconds / 3600.0;
        HealthyMetrics {
            hours,
            alarms,
            shutdowns,
            alarms_per_h: alarms as f64 / hours.max(f64::MIN_POSITIVE),
            alarms_per_h_upper: most_of_poisson(alarms) / hours.max(f64::MIN_POSITIVE),
            visible_by_chance: Some(self.ended.iter().map(|ended| ended.by_chance).sum()),
        }
    }

    fn trade(&self, session: usize, asked_per_h: f64) -> TradePoint {
        let strong = |flight: &Flight| flight.intensity >= STRONG;
        let class = self.off_command().and_then(|command| self.class(session, command, strong));
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

/// In how many flights the wrong actuator was to be shut down.
fn wrong_shutdowns(outcomes: &[FlightOutcome]) -> u64 {
    outcomes.iter().filter(|outcome| outcome.is_wrong_shutdown).count() as u64
}

/// The share of flights of which something holds; its interval is that of whole clusters.
fn rate(outcomes: &[&FlightOutcome], holds: &dyn Fn(&FlightOutcome) -> bool) -> Rate {
    let trial = |outcome: &&FlightOutcome| Trial {
        cluster: outcome.cluster,
        kind: outcome.kind_number,
        holds: holds(outcome),
    };
    Rate::clustered(&outcomes.iter().map(trial).collect::<Vec<_>>())
}

/// Times at which the share of faults is told, s.
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

/// The mean of a Poisson distribution that gives at most `count` with a probability of 5 %.
fn most_of_poisson(count: u64) -> f64 {
    let at_most = |mean: f64| {
        let mut term = (-mean).exp();
        let mut sum = term;
        for k in 1..=count {
            term *= mean / k as f64;
            sum += term;
        }
        sum
    };
    let (mut low, mut high) = (0.0, 10.0 + 4.0 * count as f64);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if at_most(middle) > 0.05 { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_in_a_row_are_enough_where_the_first_and_the_last_share_no_sample() {
        // One sample leaves a band, in the last of five panes: it is in five windows.
        let mut by_chance = OutOfBand::default();
        for index in 0..20 {
            let has_left = (4..9).contains(&index);
            assert_eq!(by_chance.take(index, has_left, Some(5)), None, "{index}");
        }
        // Since the tenth one they all do; a gap makes the count begin anew.
        let mut lasts = OutOfBand::default();
        let taken = (0..30).map(|index| lasts.take(index, index >= 10 && index != 14, Some(5)));
        let seen: Vec<(u64, u64)> =
            (0..).zip(taken).filter_map(|(index, first)| Some((index, first?))).collect();
        assert_eq!(seen, [(20, 15)]);
        // What never forgets needs no second window.
        assert_eq!(OutOfBand::default().take(7, true, None), Some(7));
    }

    #[test]
    fn nothing_seen_bounds_the_rate_by_three_over_the_time() {
        assert!((most_of_poisson(0) - 2.9957).abs() < 1e-3);
        // From tables of the chi-squared distribution.
        assert!((most_of_poisson(1) - 4.7439).abs() < 1e-3);
        assert!((most_of_poisson(10) - 16.9622).abs() < 1e-3);
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
