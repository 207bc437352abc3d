//! Flights watched by diagnoses: one observer for every suite of flights, whose result is a row of outcomes.

use super::effects;
use super::evidence::EvidencePeak;
use super::margin::{MarginWatch, SearchObjective};
use super::unseen_faults::{self, Touched};
use crate::ensemble::Variant;
use crate::measure::outcome::{FirstAction, Needed, RunOutcome, Word};
use crate::parallel::Workers;
use crate::records::columns::HEALTHY;
use crate::run::fitted_twins::CalibrationRecords;
use crate::run::other_plant::OtherPlants;
use crate::run::{Observer, Run, RunError, Runner, part, plan};
use crate::study::{Scenario, Study, Suite};
use servotwin_diagnosis::diagnoser::{Alarm, Diagnoser, IndexedFinding, Outcome, Raised, Session};
use servotwin_diagnosis::panel::SensorBand;

/// A diagnosis that watches a flight.
#[derive(Clone)]
pub(crate) struct Watching {
    /// Its session before the first sample.
    pub(crate) session: Session,
    /// The index of the sensor that it lacks.
    pub(crate) missing: Option<usize>,
}

/// What happens in a flight, and what is right.
#[derive(Default)]
pub(crate) struct Truth {
    /// What is known of the flight before it is flown; the rest is default.
    pub(crate) run: RunOutcome,
    /// The actuators at fault.
    pub(crate) at_fault: Vec<usize>,
    /// Healthy actuators whose twin reads a wrong boundary sensor.
    pub(crate) misinformed: Vec<usize>,
    /// What a search looks for that chose the flight.
    pub(crate) objective: Option<SearchObjective>,
}

impl Truth {
    /// The truth of a planned flight of a study.
    pub(crate) fn planned(study: &Study, flight: &Run) -> Self {
        let fault = flight.fault.map(|fault| &study.faults[fault]);
        let class = fault.map(|fault| &study.classes[fault.class]);
        let name = |of: Option<&String>| of.map_or(HEALTHY, String::as_str).to_owned();
        let action = class.map(|class| class.action.clone()).unwrap_or_default();
        let run = RunOutcome {
            number: flight.number as u64,
            environment: flight.environment as u64,
            event: name(fault.map(|fault| &fault.id)),
            kind: name(fault.map(|fault| &fault.kind)),
            intensity: flight.intensity,
            profile: if fault.is_some() { flight.profile.name() } else { "" }.into(),
            onset_s: fault.map(|_| flight.onset_s),
            duration_s: flight.duration_s,
            at_fault: fault
                .map(|fault| study.actuators[fault.actuator].clone())
                .unwrap_or_default(),
            needed: if fault.is_some() { Needed::ItsAction } else { Needed::Nothing },
            needs_shutdown: study.shutdowns().contains(&action),
            class: class.map(|class| class.detail.clone()).unwrap_or_default(),
            action,
            ..RunOutcome::default()
        };
        let at_fault = fault.map(|fault| fault.actuator).into_iter().collect();
        Truth { run, at_fault, ..Truth::default() }
    }

    /// What is known of the flight before it is flown, watched by a diagnoser.
    pub(crate) fn run_watched_by(&self, diagnoser: &Diagnoser) -> RunOutcome {
        let target_per_h = diagnoser.tuning.false_alarm_target_per_h;
        RunOutcome { target_per_h, ..self.run.clone() }
    }

    /// The first sample since the onset.
    pub(crate) fn first_sample(&self, period_s: f64) -> u64 {
        (self.run.onset_s.unwrap_or(f64::INFINITY) / period_s).ceil() as u64
    }

    /// Whether something is wrong with an actuator, or with what its twin reads.
    fn concerns(&self, actuator: usize) -> bool {
        self.at_fault.contains(&actuator) || self.misinformed.contains(&actuator)
    }
}

/// What became of a run.
pub(crate) struct Flown {
    /// One outcome for each diagnosis.
    pub(crate) outcomes: Vec<RunOutcome>,
    /// What became of the calibration flights of all runs beside it, where twins are fitted to plants of another structure.
    pub(crate) calibration: Option<CalibrationRecords>,
}

/// Receives what became of a run, given by its number, when it has ended.
pub(crate) type Ended<'e> = &'e mut (dyn FnMut(usize, Flown) + Send);

/// All runs of a suite, by number.
pub(crate) fn runs(study: &Study, suite: &Suite) -> Vec<Run> {
    match suite.is_unseen {
        true => unseen_faults::runs(study, suite),
        false => plan::all(study, suite).collect(),
    }
}

/// The numbers of the runs of each part of a suite.
pub(crate) fn parts(study: &Study, suite: &Suite) -> Vec<Vec<usize>> {
    part::parts(study, suite, runs(study, suite))
}

/// Flies runs of a suite in a scenario, given by their numbers and watched by some diagnoses.
///
/// # Errors
/// A command cannot be flown, a twin cannot be simulated, or the run was cancelled.
pub(crate) fn fly(
    (study, suite, scenario): (&Study, &Suite, Scenario),
    watching: &[Watching],
    numbers: &[usize],
    workers: Workers,
    ended: Ended,
) -> Result<(), RunError> {
    if suite.is_unseen {
        unseen_faults::fly((study, suite, scenario), watching, numbers, workers, ended)?;
    } else {
        let runs: Vec<Run> = numbers.iter().map(|&n| plan::run(study, suite, n)).collect();
        if suite.is_closed_loop {
            // The twin of a lane is recorded before any plant flies, but a reaction changes the twin, too.
            let diagnoser = watching[0].session.diagnoser();
            let flown = effects::fly((study, suite, scenario), diagnoser, &runs, workers)?;
            for (number, outcome) in numbers.iter().zip(flown) {
                ended(*number, Flown { outcomes: vec![outcome], calibration: None });
            }
        } else {
            let others = OtherPlants::of(study, suite)?;
            let runner = Runner::new(study, suite, (scenario, others.as_ref()), runs, workers)?;
            let truth = |run: &Run| Truth::planned(study, run);
            watch(&runner, watching, &truth, &|_| None, |_, _| (), ended);
        }
    }
    if workers.is_cancelled() { Err(RunError::Cancelled) } else { Ok(()) }
}

/// Flies runs, each watched by some diagnoses. `truth` says what is right in a run, `touched` changes what the diagnoses
/// receive, `alter` changes the plant.
pub(super) fn watch<'f>(
    flown: &'f Runner,
    watching: &[Watching],
    truth: &(impl Fn(&Run) -> Truth + Sync),
    touched: &(impl Fn(&Run) -> Option<Touched> + Sync),
    alter: impl Fn(&Run, &mut Variant<'f>) + Sync,
    ended: Ended,
) {
    flown.fly_altered(
        alter,
        |run| FlightWatch::new(watching, truth(run), touched(run), flown.period_s()),
        |run, watch, outcome| {
            let outcomes = watch.into_outcomes(outcome.is_ok());
            ended(run.number, Flown { outcomes, calibration: flown.calibration });
        },
    );
}

/// A flight with its diagnoses.
struct FlightWatch {
    diagnoses: Vec<Diagnosis>,
    truth: Truth,
    touched: Option<Touched>,
}

impl FlightWatch {
    fn new(watching: &[Watching], truth: Truth, touched: Option<Touched>, period_s: f64) -> Self {
        let onset = truth.first_sample(period_s);
        let watched = |own: &Watching| Diagnosis::new(own.clone(), &truth, onset);
        let diagnoses = watching.iter().map(watched).collect();
        FlightWatch { diagnoses, truth, touched }
    }

    fn into_outcomes(self, is_finished: bool) -> Vec<RunOutcome> {
        let FlightWatch { diagnoses, truth, .. } = &self;
        let outcome = |own: &Diagnosis| {
            let run = own.run(truth);
            match is_finished {
                true => own.watch.outcome(run, own.session.diagnoser(), truth),
                false => run,
            }
        };
        diagnoses.iter().map(outcome).collect()
    }
}

impl Observer for FlightWatch {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]) {
        let (measured, inputs) = match &mut self.touched {
            None => (measured, inputs),
            Some(touched) => {
                touched.take(index, measured, inputs);
                (&touched.measured[..], &touched.inputs[..])
            }
        };
        let (index, truth) = (index as u64, &self.truth);
        for own in &mut self.diagnoses {
            own.take(index, (inputs, measured, twin), truth);
        }
    }

    fn track(&mut self, index: usize, plant: &[f64], twin: &[f64]) {
        for Diagnosis { watch, .. } in &mut self.diagnoses {
            if let Some(margin) = &mut watch.margin {
                margin.track(index as u64, &watch.log.raised, plant, twin);
            }
        }
    }
}

/// A session with what is kept of it.
struct Diagnosis {
    session: Session,
    missing: Option<usize>,
    /// The sensor values without the missing sensor.
    measured: Vec<f64>,
    watch: SessionWatch,
}

impl Diagnosis {
    fn new(Watching { session, missing }: Watching, truth: &Truth, onset: u64) -> Self {
        let watch = SessionWatch::new(session.diagnoser(), truth, onset);
        Diagnosis { session, missing, measured: vec![], watch }
    }

    fn take(
        &mut self,
        index: u64,
        (inputs, measured, twin): (&[f64], &[f64], &[f64]),
        truth: &Truth,
    ) {
        let measured = match self.missing {
            None => measured,
            Some(sensor) => {
                self.measured.clear();
                self.measured.extend_from_slice(measured);
                self.measured[sensor] = f64::NAN;
                &self.measured
            }
        };
        self.session.push(inputs, measured, twin);
        self.watch.take(index, &self.session, truth);
    }

    /// What is known before the flight.
    fn run(&self, truth: &Truth) -> RunOutcome {
        let diagnoser = self.session.diagnoser();
        let missing = self.missing.map(|sensor| diagnoser.sensors[sensor].name.clone());
        RunOutcome { missing: missing.unwrap_or_default(), ..truth.run_watched_by(diagnoser) }
    }
}

/// What is kept of a session.
pub(super) struct SessionWatch {
    switches_off: Vec<bool>,
    /// The first sample since the onset.
    onset: u64,
    log: RaisedLog,
    out_of_bands: OutOfBands,
    of_any: EvidencePeak,
    of_shutdown: EvidencePeak,
    word: Word,
    first_word: Option<u64>,
    margin: Option<MarginWatch>,
}

impl SessionWatch {
    /// For a fault that begins at the sample `onset`.
    pub(crate) fn new(diagnoser: &Diagnoser, truth: &Truth, onset: u64) -> Self {
        let switches_off = diagnoser.tuning.switches_off(diagnoser.names());
        SessionWatch {
            out_of_bands: OutOfBands::new(diagnoser.lengths.len(), onset),
            of_any: EvidencePeak::new(diagnoser, |_, _| true),
            of_shutdown: EvidencePeak::new(diagnoser, |_, action| switches_off[action]),
            switches_off,
            onset,
            log: RaisedLog::default(),
            word: Word::Healthy,
            first_word: None,
            margin: truth.objective.map(|objective| {
                MarginWatch::new(objective, diagnoser, (truth.at_fault.first().copied(), onset))
            }),
        }
    }

    /// Takes a session behind a sample.
    pub(crate) fn take(&mut self, index: u64, session: &Session, truth: &Truth) {
        let outcome = session.outcome();
        self.log.take(outcome);
        if index >= self.onset {
            let word = word(outcome, truth);
            self.word = self.word.max(word);
            self.first_word = self.first_word.or((word > Word::Healthy).then_some(index));
        }
        self.out_of_bands.look(index, session);
        self.of_any.take(session);
        self.of_shutdown.take(session);
        if let Some(margin) = &mut self.margin {
            margin.take(index, session);
        }
    }

    /// The outcome of a finished run, which was watched by a diagnoser.
    pub(crate) fn outcome(
        &self,
        run: RunOutcome,
        diagnoser: &Diagnoser,
        truth: &Truth,
    ) -> RunOutcome {
        let period_s = diagnoser.period_s;
        let onset_s = run.onset_s.unwrap_or(f64::INFINITY);
        let after = |sample: u64| sample as f64 * period_s - onset_s;
        let (late, early): (Vec<&Raised>, Vec<&Raised>) =
            self.log.raised.iter().partition(|raised| after(raised.sample) >= 0.0);
        let is_off = |raised: &&&Raised| self.switches_off[raised.action as usize];
        let actuator = |raised: &Raised| raised.actuator as usize;
        let names = diagnoser.names();
        let is_right = |raised: &Raised| {
            let name = &names.actions[raised.action as usize];
            self.is_right((raised, name), &run, truth)
        };
        let named = |of: &[String], place: fn(&Raised) -> usize| {
            late.first().map(|raised| of[place(raised)].clone()).unwrap_or_default()
        };
        let first = late.first().map_or(FirstAction::None, |raised| match raised {
            raised if is_right(raised) => FirstAction::Right,
            raised if truth.concerns(actuator(raised)) => FirstAction::OtherAction,
            _ => FirstAction::OtherActuator,
        });
        let off = |among: &dyn Fn(usize) -> bool| {
            late.iter().filter(is_off).any(|raised| among(actuator(raised)))
        };
        let outcome = RunOutcome {
            visible_s: self.out_of_bands.seen.map(after),
            visible_by_chance: self.out_of_bands.by_chance,
            first,
            first_action: named(&names.actions, |raised| raised.action as usize),
            first_class: late
                .first()
                .and_then(|raised| Some(names.details[raised.detail? as usize].clone()))
                .unwrap_or_default(),
            first_actuator: named(&names.actuators, |raised| raised.actuator as usize),
            first_confidence: late.first().map(|raised| raised.confidence),
            first_action_s: late.first().map(|raised| after(raised.sample)),
            right_action_s: late
                .iter()
                .find(|raised| is_right(raised))
                .map(|raised| after(raised.sample)),
            word: self.word,
            first_word_s: self.first_word.map(|sample| after(sample).max(0.0)),
            early_alarms: early.len() as u64,
            early_shutdowns: early.iter().filter(is_off).count() as u64,
            shutdown_at_fault: off(&|own| truth.at_fault.contains(&own)),
            shutdown_misinformed: off(&|own| truth.misinformed.contains(&own)),
            shutdown_healthy: off(&|own| !truth.concerns(own)),
            evidence: self.of_any.largest,
            shutdown_evidence: self.of_shutdown.largest,
            is_finished: true,
            ..run
        };
        let margin = self.margin.as_ref();
        let margin = margin.map(|own| own.margin(&outcome, &self.log.raised, period_s));
        RunOutcome { margin, ..outcome }
    }

    /// Whether an action is right after the onset.
    fn is_right(
        &self,
        (raised, name): (&Raised, &String),
        run: &RunOutcome,
        truth: &Truth,
    ) -> bool {
        let is_off = self.switches_off[raised.action as usize];
        truth.concerns(raised.actuator as usize)
            && match run.needed {
                Needed::Nothing => false,
                Needed::ItsAction => *name == run.action,
                Needed::Shutdown => is_off,
                Needed::NoShutdown => !is_off,
                Needed::Any => true,
            }
    }
}

/// The most specific output of a sample.
fn word(outcome: &Outcome, truth: &Truth) -> Word {
    let lacks = outcome.lost > 0 || matches!(outcome.alarm, Alarm::NoData | Alarm::Error);
    let said = match outcome.finding {
        IndexedFinding::Healthy | IndexedFinding::Unjudged => Word::Healthy,
        IndexedFinding::Unknown => Word::Unknown,
        IndexedFinding::EnvironmentInvalid { .. } => Word::EnvironmentInvalid,
        IndexedFinding::Detected => Word::Detected,
        IndexedFinding::Actuator { actuator }
        | IndexedFinding::Action { actuator, .. }
        | IndexedFinding::Detail { actuator, .. } => match truth.concerns(actuator as usize) {
            true => Word::Actuator,
            false => Word::Detected,
        },
    };
    said.max(if lacks { Word::NoData } else { Word::Healthy })
}

/// Every action of a session, at the time it was raised.
#[derive(Clone, Debug, Default)]
pub(super) struct RaisedLog {
    pub(crate) raised: Vec<Raised>,
}

impl RaisedLog {
    /// Takes the outcome of a sample. An action that changes only its details is no new one.
    pub(crate) fn take(&mut self, outcome: &Outcome) {
        let before = self.raised.last().map(|raised| (raised.actuator, raised.action));
        let is_new = |raised: &Raised| raised.sample == outcome.sample;
        if let Some(raised) = outcome.raised.filter(is_new)
            && before != Some((raised.actuator, raised.action))
        {
            self.raised.push(raised);
        }
    }
}

/// Whether the fault of a flight is visible: from the first of consecutive windows that left a band.
pub(super) struct OutOfBands {
    onset: u64,
    /// One counter for each window length.
    out_of_band: Vec<OutOfBand>,
    /// The sample from which it is visible.
    pub(crate) seen: Option<u64>,
    /// How often a fault was called visible before the onset.
    pub(crate) by_chance: u64,
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
    /// length. A window of one pane is judged once.
    fn take(&mut self, index: u64, has_left: bool, panes: u32) -> Option<u64> {
        if !has_left {
            self.windows = 0;
            return None;
        }
        self.first = if self.windows == 0 { index } else { self.first };
        self.windows += 1;
        let enough = if panes > 1 { panes + 1 } else { 1 };
        (self.windows == enough).then_some(self.first)
    }
}

impl OutOfBands {
    /// For a diagnoser with a number of window lengths, and a fault that begins at the sample `onset`.
    pub(crate) fn new(lengths: usize, onset: u64) -> Self {
        let out_of_band = vec![OutOfBand::default(); lengths];
        OutOfBands { onset, out_of_band, seen: None, by_chance: 0 }
    }

    /// Takes the windows that end at a sample.
    pub(crate) fn look(&mut self, index: u64, session: &Session) {
        let diagnoser = session.diagnoser();
        if index == self.onset {
            self.out_of_band.fill(OutOfBand::default());
        }
        for (place, out_of_band) in self.out_of_band.iter_mut().enumerate() {
            if !session.has_new_window(place) || !session.is_full(place) {
                continue;
            }
            let (window, length) = (session.window(place), &diagnoser.lengths[place]);
            let is_out =
                |(sensor, band): (usize, &SensorBand)| window.largest(sensor) > band.half_width;
            let has_left = length.panel.bands.iter().enumerate().any(is_out);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::suites::UNSEEN;

    #[test]
    fn parts_hold_every_run_with_an_unseen_fault_once() {
        let study = Study::default();
        let suite = study.suite(UNSEEN).unwrap();
        let runs = runs(&study, suite);
        let numbers = runs.iter().map(|run| run.number);
        assert!(numbers.eq(0..runs.len()) && !runs.is_empty());
        let parts = parts(&study, suite);
        let mut all = parts.concat();
        all.sort_unstable();
        assert!(parts.len() > 1 && all.into_iter().eq(0..runs.len()), "{}", parts.len());
    }

    #[test]
    fn windows_in_a_row_are_enough_where_the_first_and_the_last_share_no_sample() {
        // A single sample leaves a band, in the last of five panes: it is in five windows.
        let mut by_chance = OutOfBand::default();
        for index in 0..20 {
            let has_left = (4..9).contains(&index);
            assert_eq!(by_chance.take(index, has_left, 5), None, "{index}");
        }
        // From the tenth sample on all windows leave the band; a gap restarts the count.
        let mut lasts = OutOfBand::default();
        let taken = (0..30).map(|index| lasts.take(index, index >= 10 && index != 14, 5));
        let seen: Vec<(u64, u64)> =
            (0..).zip(taken).filter_map(|(index, first)| Some((index, first?))).collect();
        assert_eq!(seen, [(20, 15)]);
        assert_eq!(OutOfBand::default().take(1999, true, 1), Some(1999));
    }
}
