//! Logs and live streams in, decisions out: the inputs and outputs of `servotwin watch`.
//!
//! ```text
//! Source ── rows ──> Map ── samples, SI ──> Sequencer ── periods ──> Observer ──> Sinks
//! ```
//!
//! A [`source::Source`] returns the numbers of a file or a stream. A [`map::Map`] turns them into inputs and sensor
//! values, and a [`sequencer::Sequencer`] puts these onto the fixed period. An [`Observer`] receives one period after
//! the other, and [`sink::Sink`]s show or store its findings. Irregularities of the stream are in [`counts::WatchCounts`].
//! `docs/watch.md` describes the formats and rules.

mod bits;
pub mod checkpoint;
pub mod counts;
pub mod cut;
pub mod guard;
pub mod intake;
pub mod map;
pub(crate) mod plausibility;
pub mod player;
pub mod sequencer;
pub mod shipped;
pub mod sink;
pub mod source;
pub mod span;
pub mod watchdog;
pub mod whole_table;

pub use servotwin::live::observer::{DiagnosisState, Finding, Observation, Observer, Phase};

use checkpoint::{Checkpoint, CheckpointError};
use counts::{Irregularity, WatchCounts};
use map::Map;
use plausibility::{Lookout, Plausibility};
use sequencer::{Sequencer, Tick};
use serde::{Deserialize, Serialize};
use servotwin::study::Study;
use servotwin_io::toml_text::NumberWithUnit;
use sink::{Sample, Sink, SinkError};
use source::{LogRow, Read, Source, SourceError};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use watchdog::{Alert, Channel, Notice, Silences, WatchEvent, Watchdog, WatchdogRules, wall_time};

/// Why watching ended early.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub enum WatchError {
    /// The source could not be opened or read.
    Source(#[from] SourceError),
    /// A result cannot be written.
    Sink(#[from] SinkError),
    /// A checkpoint cannot be used.
    Checkpoint(#[from] CheckpointError),
}

/// The state between two rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// The place of the last row read.
    place: u64,
    /// How many rows were read, including flawed ones.
    rows: u64,
    /// The values of the row at this place, by which a resumed watch knows its file.
    #[serde(with = "bits::many")]
    last_row: Vec<f64>,
    sequencer: Sequencer,
    counts: WatchCounts,
    /// For each channel, the last value and its age in periods.
    #[serde(with = "bits::many")]
    held: Vec<f64>,
    ages: Vec<u64>,
    /// The last finding, and how often it changed.
    finding: Finding,
    changes: u64,
    /// The time of the last period, s.
    #[serde(with = "bits::one")]
    time_s: f64,
}

/// Runs the pipeline from a source through the observer to the sinks.
pub struct Watch<'w> {
    source: &'w mut dyn Source,
    map: &'w Map,
    observer: &'w mut dyn Observer,
    sinks: Vec<&'w mut dyn Sink>,
    /// The number of periods between two checkpoints; `None` without any.
    save_every: Option<u64>,
    /// `Some` for a live source whose silence is reported.
    watchdog: Option<Watchdog>,
    alerts: Vec<Alert>,
    period_s: f64,
    progress: Progress,
    /// Evidence from the rows read since this watch began.
    plausibility: Plausibility,
    /// Looks for mistakes of columns that begin later.
    lookout: Option<Lookout<'w>>,
    /// What it found and no sink knows.
    implausible: Vec<WatchEvent>,
}

/// How a watch ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The source has ended.
    Complete,
    /// The caller requested the stop.
    Stopped,
    /// The rest of the log contradicts the map.
    Contradicted,
}

impl<'w> Watch<'w> {
    /// Connects source, map and observer before the first row.
    pub fn new(
        source: &'w mut dyn Source,
        map: &'w Map,
        observer: &'w mut dyn Observer,
        period_s: f64,
    ) -> Self {
        let width = map.width();
        let progress = Progress {
            place: 0,
            rows: 0,
            last_row: vec![],
            sequencer: Sequencer::new(period_s, width, map.rules),
            counts: WatchCounts::new(source.counted(), width),
            held: vec![f64::NAN; width],
            ages: vec![0; width],
            finding: Finding::default(),
            changes: 0,
            time_s: f64::NAN,
        };
        let plausibility = Plausibility::new(map);
        Watch {
            source,
            map,
            observer,
            sinks: vec![],
            save_every: None,
            watchdog: None,
            alerts: vec![],
            period_s,
            progress,
            plausibility,
            lookout: None,
            implausible: vec![],
        }
    }

    /// Adds a sink that receives every period and event.
    pub fn sink(&mut self, sink: &'w mut dyn Sink) {
        self.sinks.push(sink);
    }

    /// Looks all the time whether the columns can be those of a study's system, and reports it when they cannot; such a
    /// log ends there. `ranges` are those in which the observer accepts the inputs.
    pub fn expect(&mut self, study: &'w Study, ranges: &[(f64, f64)]) {
        self.plausibility.narrow(ranges);
        self.lookout = Some(Lookout::new(study, self.map, self.period_s, self.source.counted()));
    }

    /// Lets the sinks save a checkpoint every so many periods, and another one at the end.
    pub fn save_every(&mut self, periods: u64) {
        self.save_every = Some(periods);
    }

    /// Enables the watchdog: wall-clock reports of silence, and heartbeats.
    pub fn watchdog(&mut self, rules: WatchdogRules) {
        let allowance = |channel: usize| {
            let hold = Duration::try_from_secs_f64(self.map.hold_s(channel));
            self.map.is_column(channel).then_some(hold.unwrap_or(Duration::ZERO))
        };
        let channel = |number: usize| Channel::new(self.map.id(number), allowance(number));
        let channels = (0..self.map.width()).map(channel).collect();
        self.watchdog = Some(Watchdog::new(rules, channels, Instant::now()));
    }

    /// How often the watchdog reported that no data came.
    pub fn silences(&self) -> Silences {
        self.watchdog.as_ref().map(|watchdog| watchdog.silences.clone()).unwrap_or_default()
    }

    /// Resumes from a checkpoint. A file is read up to its row; a stream continues with the next data.
    ///
    /// # Errors
    /// The checkpoint belongs to another map or log or cannot be used, or the file is shorter.
    pub fn resume(&mut self, checkpoint: Checkpoint) -> Result<(), WatchError> {
        self.progress = checkpoint.progress(self.map, self.period_s)?.clone();
        self.observer.restore(&checkpoint.observer).map_err(CheckpointError::Observer)?;
        let last = self.progress.place;
        let (mut row, mut place, mut last_row) = (LogRow::default(), 0, vec![]);
        while !self.source.is_live() && row.place < last {
            match self.source.read(&mut row)? {
                Read::End => return Err(CheckpointError::ShortLog { needed: last }.into()),
                Read::Row if row.place != place => last_row.clone_from(&row.values),
                _ => {}
            }
            place = row.place;
        }
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        if !self.source.is_live() && bits(&last_row) != bits(&self.progress.last_row) {
            return Err(CheckpointError::Other { what: "log" }.into());
        }
        if self.source.is_live() {
            // Lines of a live source are counted anew.
            self.progress.place = 0;
        }
        Ok(())
    }

    /// Withdraws everything that was raised. All is judged anew, also a fault that lasts.
    pub fn reset_alarm(&mut self) {
        self.observer.reset_alarm();
    }

    /// Watches until the source ends or `stop` is set. `show` receives the time and the share read so far.
    ///
    /// # Errors
    /// The source fails, or a result cannot be written.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        show: &mut dyn FnMut(f64, Option<f64>),
    ) -> Result<End, WatchError> {
        let mut row = LogRow::default();
        let mut saved = self.progress.counts.samples;
        let mut shown = 0_u64;
        let end = loop {
            if stop.load(Ordering::Relaxed) {
                break End::Stopped;
            }
            if !self.row(&mut row)? {
                break End::Complete;
            }
            self.check_clock_and_sinks()?;
            if !self.source.is_live() && self.plausibility.is_contradicted() {
                return Ok(End::Contradicted);
            }
            let samples = self.progress.counts.samples;
            if self.save_every.is_some_and(|every| samples - saved >= every) {
                saved = samples;
                self.save(false)?;
            }
            if self.source.is_live() || samples - shown >= 1000 {
                shown = samples;
                show(self.progress.time_s, self.source.share());
            }
        };
        // The checkpoint precedes draining, so that a resumed watch still holds the waiting samples.
        self.save(true)?;
        if end == End::Complete || self.save_every.is_none() {
            self.progress.sequencer.end(&mut self.progress.counts);
            self.drain()?;
        }
        self.conclude();
        self.check_clock_and_sinks()?;
        Ok(end)
    }

    /// Reports a contradiction that no pane has shown.
    fn conclude(&mut self) {
        let is_known = self.lookout.is_none() || self.plausibility.is_contradicted();
        let found = if is_known { vec![] } else { self.contradictions() };
        let event = WatchEvent::Contradicted { reason: found.join("; "), from_s: None };
        self.implausible.extend((!found.is_empty()).then_some(event));
    }

    /// The counts so far.
    pub fn counts(&self) -> &WatchCounts {
        &self.progress.counts
    }

    /// What contradicts the map beyond doubt, as sentences; nothing for a watch that [`expect`](Self::expect)s nothing.
    pub fn contradictions(&self) -> Vec<String> {
        let counts = &self.progress.counts;
        let of = |lookout: &Lookout| {
            self.plausibility.contradictions(lookout.system(), self.map, counts)
        };
        self.lookout.as_ref().map_or(vec![], of)
    }

    /// All evidence against the map, contradictions first; see [`contradictions`](Self::contradictions).
    pub fn doubts(&self) -> Vec<String> {
        let (period_s, counts) = (self.period_s, &self.progress.counts);
        let of = |lookout: &Lookout| {
            self.plausibility.sentences(lookout.system(), self.map, period_s, counts)
        };
        self.lookout.as_ref().map_or(vec![], of)
    }

    /// Reads the next row; `false` at the end.
    fn row(&mut self, row: &mut LogRow) -> Result<bool, WatchError> {
        let read = self.source.read(row)?;
        let progress = &mut self.progress;
        match read {
            Read::Row => {
                let sample = self.map.sample(row, progress.rows);
                if row.place != progress.place {
                    progress.last_row.clone_from(&row.values);
                }
                progress.begin(row.place);
                if row.bad > 0 {
                    let detail = row.bad_in_words(self.map.wanted());
                    progress.counts.note_with(Irregularity::BadValue, row.place, &detail);
                }
                self.plausibility.sample(&sample);
                if let Some((id, value)) = self.map.impossible(&sample) {
                    let detail = format_args!("{id} = {} in SI", NumberWithUnit(value, ""));
                    progress.counts.note_with(Irregularity::Impossible, row.place, &detail);
                }
                if sample.time_s.is_finite() {
                    progress.sequencer.push(sample, &mut progress.counts);
                } else {
                    progress.counts.note(Irregularity::NoTime, row.place);
                }
                self.drain()?;
            }
            Read::Flawed(flaw) => {
                progress.begin(row.place);
                progress.counts.note_flaw(row.place, &flaw);
            }
            Read::Dropped(flaw) => {
                progress.counts.frames += flaw.count;
                progress.counts.note_flaw(row.place, &flaw);
            }
            Read::Pause => {
                progress.sequencer.flush();
                self.drain()?;
            }
            Read::Nothing => {}
            Read::End => return Ok(false),
        }
        Ok(true)
    }

    /// Passes on all periods that are complete.
    fn drain(&mut self) -> Result<(), WatchError> {
        let Progress { sequencer, counts, held, ages, finding, changes, time_s, .. } =
            &mut self.progress;
        while let Some(tick) = sequencer.next(counts) {
            let (now_s, place, values) = match tick {
                Tick::Restart => {
                    self.observer.restart();
                    self.lookout.iter_mut().for_each(Lookout::restart);
                    held.fill(f64::NAN);
                    continue;
                }
                Tick::Sample { time_s, place, values } => (time_s, place, values),
            };
            *time_s = now_s;
            if let Some(watchdog) = &mut self.watchdog {
                watchdog.note_data(values, &mut self.alerts);
            }
            let as_logged = &values[self.map.inputs()..];
            let values = complete(self.map, values, held, ages, self.period_s);
            for (channel, (value, count)) in values.iter().zip(&mut counts.missing).enumerate() {
                *count += u64::from(value.is_nan() && self.map.is_known(channel));
            }
            let (inputs, measured) = values.split_at(self.map.inputs());
            let observation = self.observer.push(now_s, inputs, measured);
            // A twin whose input is not accepted follows an earlier value, and is no comparison for a sensor.
            if observation.finding.state == DiagnosisState::EnvironmentInvalid {
                self.plausibility.invalid(inputs, observation.finding.evidence.first());
            } else {
                self.plausibility.beside.take(as_logged, observation.twin);
                let (twin, whole) = (observation.twin, &self.plausibility.beside);
                let lookout = self.lookout.as_mut();
                let late =
                    lookout.and_then(|l| l.take((place, now_s), [inputs, as_logged], twin, whole));
                if let Some(late) = late {
                    let event = late.clone().event();
                    self.implausible.extend(self.plausibility.find(late).then_some(event));
                }
            }
            counts.judged += u64::from(observation.finding.state.is_judgement());
            let changed = !observation.finding.says_the_same(finding);
            if changed {
                finding.clone_from(observation.finding);
                *changes += 1;
            }
            if self.sinks.is_empty() {
                continue;
            }
            let sample = Sample::new((now_s, place), inputs, measured, &observation, changed);
            for sink in &mut self.sinks {
                sink.sample(&sample)?;
            }
        }
        Ok(())
    }

    /// Checks the wall clock and the sinks, and reports alerts and failures.
    fn check_clock_and_sinks(&mut self) -> Result<(), WatchError> {
        let watchdog = self.watchdog.as_mut();
        let is_beat = watchdog.is_some_and(|dog| dog.check(Instant::now(), &mut self.alerts));
        for (event, lasts) in std::mem::take(&mut self.alerts) {
            self.report(event, Some(lasts))?;
        }
        if is_beat {
            let WatchCounts { frames, samples, .. } = self.progress.counts;
            let sinks = self.sinks.iter().flat_map(|sink| sink.losses()).collect();
            self.report(WatchEvent::Heartbeat { frames, samples, sinks }, None)?;
        }
        for event in std::mem::take(&mut self.implausible) {
            self.report(event, None)?;
        }
        let of_sinks = self.sinks.iter_mut().flat_map(|sink| sink.failures());
        let failed: Vec<(String, String)> = of_sinks.collect();
        for (sink, reason) in failed {
            self.report(WatchEvent::SinkFailed { sink, reason }, None)?;
        }
        Ok(())
    }

    /// Sends a notice to all sinks.
    fn report(&mut self, event: WatchEvent, lasts: Option<Duration>) -> Result<(), WatchError> {
        let watchdog = self.watchdog.as_ref();
        let Progress { finding, time_s, .. } = &self.progress;
        let silent = lasts.or(watchdog.map(Watchdog::silent)).unwrap_or_default();
        let is_silent = watchdog.is_some_and(Watchdog::is_silent);
        let is_contradicted = matches!(event, WatchEvent::Contradicted { .. });
        let notice = Notice {
            event,
            wall_time: wall_time(),
            time_s: time_s.is_finite().then_some(*time_s),
            silent_s: silent.as_secs_f64(),
            state: if is_silent { DiagnosisState::NoData } else { finding.state },
            phase: if is_contradicted { Phase::None } else { finding.phase },
        };
        for sink in &mut self.sinks {
            sink.notice(&notice)?;
        }
        Ok(())
    }

    /// Saves a checkpoint behind everything that was written before it.
    fn save(&mut self, is_last: bool) -> Result<(), WatchError> {
        if self.save_every.is_none() {
            return Ok(());
        }
        let state = self.observer.save();
        let checkpoint = Checkpoint::new(&self.progress, self.map, self.period_s, state);
        let checkpoint = Arc::new(checkpoint);
        for sink in &mut self.sinks {
            sink.flush()?;
        }
        for sink in &mut self.sinks {
            sink.save(&checkpoint, is_last)?;
        }
        Ok(())
    }
}

impl Progress {
    /// Counts a row, and its frame if that is new.
    fn begin(&mut self, place: u64) {
        self.counts.frames += u64::from(place != self.place);
        self.place = place;
        self.rows += 1;
    }
}

/// The possible values of a period with constants, and with held values where the map requests them. `held` keeps the
/// last values, and stores the result until the next period.
fn complete<'h>(
    map: &Map,
    values: &[f64],
    held: &'h mut [f64],
    ages: &mut [u64],
    period_s: f64,
) -> &'h [f64] {
    for (channel, &value) in values.iter().enumerate() {
        if let Some(constant) = map.constant(channel) {
            held[channel] = constant;
        } else if map.can_be(channel, value) {
            (held[channel], ages[channel]) = (value, 0);
        } else {
            ages[channel] += 1;
            let stands = ages[channel] as f64 * period_s <= map.hold_s(channel);
            if !stands {
                held[channel] = f64::NAN;
            }
        }
    }
    held
}
