//! Logs and live streams in, decisions out: the two sides of `servotwin watch`.
//!
//! ```text
//! Source ── rows ──> Map ── samples, SI ──> Sequencer ── periods ──> Observer ──> Sinks
//! ```
//!
//! A [`source::Source`] gives the numbers of a file or a stream, a [`map::Map`] makes inputs and sensor
//! values of them, a [`sequencer::Sequencer`] puts these onto the fixed period, an [`Observer`] is fed with
//! one period after the other, and [`sink::Sink`]s show or keep what it says. What was wrong with the stream
//! is in [`counts::Counts`]. The formats and rules are described in `docs/watch.md`.

mod bits;
pub mod checkpoint;
pub mod counts;
pub mod doubts;
pub mod intake;
pub mod map;
pub mod observer;
pub mod sequencer;
pub mod sink;
pub mod source;

pub use observer::{Finding, Observation, Observer, Phase, State};

use crate::document::Quantity;
use checkpoint::{Checkpoint, CheckpointError};
use counts::{Counts, Kind};
use doubts::Doubts;
use map::Map;
use sequencer::{Sequencer, Tick};
use serde::{Deserialize, Serialize};
use sink::{Sample, Sink, SinkError};
use source::{Read, Row, Source, SourceError};
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};

/// Why watching ended early.
#[derive(Debug)]
pub enum WatchError {
    /// The source failed.
    Source(SourceError),
    /// A result cannot be written.
    Sink(SinkError),
    /// A checkpoint cannot be written or used.
    Checkpoint(CheckpointError),
}

impl fmt::Display for WatchError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WatchError::Source(error) => write!(out, "{error}"),
            WatchError::Sink(error) => write!(out, "{error}"),
            WatchError::Checkpoint(error) => write!(out, "{error}"),
        }
    }
}

impl std::error::Error for WatchError {}

impl From<SourceError> for WatchError {
    fn from(error: SourceError) -> Self {
        WatchError::Source(error)
    }
}

impl From<SinkError> for WatchError {
    fn from(error: SinkError) -> Self {
        WatchError::Sink(error)
    }
}

impl From<CheckpointError> for WatchError {
    fn from(error: CheckpointError) -> Self {
        WatchError::Checkpoint(error)
    }
}

/// What is known between two rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// The place of the last row read.
    place: u64,
    /// How many rows were read, those with flaws included.
    rows: u64,
    sequencer: Sequencer,
    counts: Counts,
    /// For each channel the last value and how many periods ago it was there.
    #[serde(with = "bits::many")]
    held: Vec<f64>,
    ages: Vec<u64>,
    /// What was said last, and how often it changed.
    finding: Finding,
    changes: u64,
    /// The time of the last period, s.
    #[serde(with = "bits::one")]
    time_s: f64,
}

/// Where checkpoints go, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoints {
    /// The file.
    pub path: std::path::PathBuf,
    /// Every so many periods, besides at the end.
    pub every: u64,
}

/// Watches a source.
pub struct Watch<'w> {
    source: &'w mut dyn Source,
    map: &'w Map,
    observer: &'w mut dyn Observer,
    sinks: Vec<&'w mut dyn Sink>,
    checkpoints: Option<Checkpoints>,
    period_s: f64,
    progress: Progress,
    /// Of what was read since this watch began.
    doubts: Doubts,
}

/// How watching ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The source has no more.
    Complete,
    /// The caller wanted to stop.
    Stopped,
}

impl<'w> Watch<'w> {
    /// Everything joined, before the first row.
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
            sequencer: Sequencer::new(period_s, width, map.rules),
            counts: Counts::new(source.counted(), width),
            held: vec![f64::NAN; width],
            ages: vec![0; width],
            finding: Finding::default(),
            changes: 0,
            time_s: f64::NAN,
        };
        let doubts = Doubts::new(map);
        Watch {
            source,
            map,
            observer,
            sinks: vec![],
            checkpoints: None,
            period_s,
            progress,
            doubts,
        }
    }

    /// Adds somebody who is told everything.
    pub fn sink(&mut self, sink: &'w mut dyn Sink) {
        self.sinks.push(sink);
    }

    /// Says in which ranges the observer believes the inputs.
    pub fn believed(&mut self, ranges: &[(f64, f64)]) {
        self.doubts.narrow(ranges);
    }

    /// Writes checkpoints.
    pub fn checkpoints(&mut self, checkpoints: Checkpoints) {
        self.checkpoints = Some(checkpoints);
    }

    /// Goes on where a checkpoint was written. A file is read up to there, a stream goes on as it
    /// comes.
    ///
    /// # Errors
    /// The checkpoint is of another map or cannot be used, or the file is shorter.
    pub fn resume(&mut self, checkpoint: Checkpoint) -> Result<(), WatchError> {
        self.progress = checkpoint.progress(self.map, self.period_s)?;
        self.observer.restore(&checkpoint.observer).map_err(CheckpointError::Observer)?;
        let last = self.progress.place;
        let mut row = Row::default();
        while !self.source.is_live() && row.place < last {
            if self.source.read(&mut row)? == Read::End {
                return Err(CheckpointError::ShortLog { needed: last }.into());
            }
        }
        if self.source.is_live() {
            // Its lines are counted anew.
            self.progress.place = 0;
        }
        Ok(())
    }

    /// Watches until the source ends or `stop` is set. `show` is told the time and how much is read.
    ///
    /// # Errors
    /// The source fails, or a result cannot be written.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        show: &mut dyn FnMut(f64, Option<f64>),
    ) -> Result<End, WatchError> {
        let mut row = Row::default();
        let mut saved = self.progress.counts.samples;
        let mut shown = 0_u64;
        let end = loop {
            if stop.load(Ordering::Relaxed) {
                break End::Stopped;
            }
            if !self.row(&mut row)? {
                break End::Complete;
            }
            let samples = self.progress.counts.samples;
            let due = |every: u64| samples - saved >= every;
            if self.checkpoints.as_ref().is_some_and(|checkpoints| due(checkpoints.every)) {
                saved = samples;
                self.save()?;
            }
            if self.source.is_live() || samples - shown >= 1000 {
                shown = samples;
                show(self.progress.time_s, self.source.share());
            }
        };
        // Where it stopped is where it goes on: what waits is not given on before.
        self.save()?;
        if end == End::Complete || self.checkpoints.is_none() {
            self.progress.sequencer.end(&mut self.progress.counts);
            self.drain()?;
        }
        Ok(end)
    }

    /// What was counted.
    pub fn counts(&self) -> &Counts {
        &self.progress.counts
    }

    /// What in the log speaks against its map.
    pub fn doubts(&self) -> &Doubts {
        &self.doubts
    }

    /// Reads on; `false` at the end.
    fn row(&mut self, row: &mut Row) -> Result<bool, WatchError> {
        let read = self.source.read(row)?;
        let progress = &mut self.progress;
        match read {
            Read::Row => {
                let mut sample = self.map.sample(row, progress.rows);
                progress.begin(row.place);
                if row.bad > 0 {
                    let detail = row.bad_in_words(self.map.wanted());
                    progress.counts.note_with(Kind::BadValue, row.place, &detail);
                }
                self.doubts.sample(&sample);
                if let Some((id, value)) = self.map.leave_out(&mut sample) {
                    let detail = format_args!("{id} = {} in SI", Quantity(value, ""));
                    progress.counts.note_with(Kind::Impossible, row.place, &detail);
                }
                if sample.time_s.is_finite() {
                    progress.sequencer.push(sample, &mut progress.counts);
                } else {
                    progress.counts.note(Kind::NoTime, row.place);
                }
                self.drain()?;
            }
            Read::Flawed(flaw) => {
                progress.begin(row.place);
                progress.counts.note_with(flaw.kind(), row.place, &flaw);
            }
            Read::Disconnected { cause } => {
                progress.counts.note_with(Kind::Disconnected, progress.place, &cause);
                progress.sequencer.flush();
                self.drain()?;
                self.tell_connection(Some(&cause))?;
            }
            Read::Reconnected => {
                progress.counts.note(Kind::Reconnected, progress.place);
                self.tell_connection(None)?;
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

    fn tell_connection(&mut self, lost: Option<&str>) -> Result<(), WatchError> {
        for sink in &mut self.sinks {
            sink.connection(lost)?;
        }
        Ok(())
    }

    /// Gives on all that may be given on.
    fn drain(&mut self) -> Result<(), WatchError> {
        let Progress { sequencer, counts, held, ages, finding, changes, time_s, .. } =
            &mut self.progress;
        while let Some(tick) = sequencer.next(counts) {
            let (now_s, place, values) = match tick {
                Tick::Restart => {
                    self.observer.restart();
                    held.fill(f64::NAN);
                    continue;
                }
                Tick::Sample { time_s, place, values } => (time_s, place, values),
            };
            *time_s = now_s;
            let values = complete(self.map, values, held, ages, self.period_s);
            for (channel, (value, count)) in values.iter().zip(&mut counts.missing).enumerate() {
                *count += u64::from(value.is_nan() && self.map.is_known(channel));
            }
            let (inputs, measured) = values.split_at(self.map.inputs());
            let observation = self.observer.push(now_s, inputs, measured);
            self.doubts.twin(measured, observation.twin);
            counts.judged += u64::from(observation.finding.state.is_judgement());
            let changed = !observation.finding.says_the_same(finding);
            if changed {
                finding.clone_from(observation.finding);
                *changes += 1;
            }
            let sample = Sample { time_s: now_s, place, inputs, measured, observation, changed };
            for sink in &mut self.sinks {
                sink.sample(&sample)?;
            }
        }
        Ok(())
    }

    fn save(&mut self) -> Result<(), WatchError> {
        let Some(checkpoints) = &self.checkpoints else { return Ok(()) };
        for sink in &mut self.sinks {
            sink.flush()?;
        }
        let checkpoint =
            Checkpoint::new(&self.progress, self.map, self.period_s, self.observer.save());
        Ok(checkpoint.write(&checkpoints.path)?)
    }
}

impl Progress {
    /// Whether everything in it is of so many inputs and sensors.
    fn has_width(&self, width: usize) -> bool {
        self.held.len() == width
            && self.ages.len() == width
            && self.counts.has_width(width)
            && self.sequencer.has_width(width)
    }

    /// Counts a row.
    fn begin(&mut self, place: u64) {
        self.counts.frames += u64::from(place != self.place);
        self.place = place;
        self.rows += 1;
    }
}

/// The values of a period with constants, and with those held that the map wants held. `held` has
/// the last values, and has the result until the next period.
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
        } else if !value.is_nan() {
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
