//! The outputs of a watch: those kept in memory until the end, and those written on threads of their own.

use super::super::progress::is_shown;
use super::super::{note, warn};
use super::Options;
use crate::failure::Failure;
use crate::{Global, out};
use indicatif::{ProgressBar, ProgressStyle};
use servotwin::files;
use servotwin::moment;
use servotwin::sanitize;
use servotwin_view::document::{Document, Table, Value};
use servotwin_view::row;
use servotwin_watch::DiagnosisState;
use servotwin_watch::checkpoint::Checkpoint;
use servotwin_watch::counts::WatchCounts;
use servotwin_watch::guard;
use servotwin_watch::map::Map as LogMap;
use servotwin_watch::player::PlayerRecord;
use servotwin_watch::sink::events::{Events, is_change};
use servotwin_watch::sink::strip::Strip;
use servotwin_watch::sink::threads::{SinkKind, SinkRules, SinkThreads};
use servotwin_watch::sink::{CheckpointFile, Sample, Scene, Sink, SinkError, Watched};
use servotwin_watch::source::Address;
use servotwin_watch::watchdog::{Notice, Silences, SinkLoss, WatchEvent, without_name};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

/// All outputs of a watch.
pub(crate) struct Outputs {
    /// The outputs that stay in memory.
    pub shown: Shown,
    /// The outputs that are written while samples arrive.
    pub threads: SinkThreads,
    bar: ProgressBar,
}

impl Outputs {
    /// Opens all outputs that the options name.
    pub(crate) fn new(
        options: &Options,
        address: &Address,
        scene: Scene,
        resumed: Option<&Checkpoint>,
        global: Global,
    ) -> Result<Self, Failure> {
        let is_live = address.is_live();
        let bar = bar(global, is_live);
        let mut threads = SinkThreads::new(is_live);
        let rules = |name: &str, waits, kind| SinkRules { name: name.into(), waits, kind };
        let of_file = |path: &Path, kind| {
            // A file or the writer of standard input can wait for slow outputs, but for no checkpoint.
            let waits = if kind == SinkKind::Checkpoint { !is_live } else { address.waits() };
            rules(&path.to_string_lossy(), waits, kind)
        };
        if is_live {
            let terminal = Box::new(Terminal { bar: bar.clone(), global });
            threads.add(rules("terminal", false, SinkKind::Terminal), terminal);
        }
        if let Some(path) = &options.events {
            let events = Events::to_file(events_file(path, resumed)?, path);
            threads.add(of_file(path, SinkKind::Changes), Box::new(events));
        }
        if let Some(path) = &options.checkpoint {
            let file = CheckpointFile(path.clone());
            threads.add(of_file(path, SinkKind::Checkpoint), Box::new(file));
        }
        if global.json {
            let lines = Box::new(Events::new(out::stdout()));
            threads.add(rules("standard output", address.waits(), SinkKind::Stream), lines);
        }
        let record = || PlayerRecord::new(&scene.title, scene.period_s, scene.signals.clone());
        let record = options.html.is_some().then(record);
        let page = record.map(|record| Watched::new(scene, record));
        let shown = Shown { strip: Strip::default(), page, unjudged: vec![], last: None };
        Ok(Outputs { shown, threads, bar })
    }

    /// Returns a function that shows the progress of a log. For a live source, the terminal's thread does that instead.
    pub(crate) fn shows_progress(&self, is_live: bool) -> impl Fn(f64, Option<f64>) + use<> {
        let bar = self.bar.clone();
        move |time_s, share| {
            if !is_live {
                show(&bar, time_s, share);
            }
        }
    }

    /// Ends all outputs that are written while samples arrive.
    ///
    /// # Errors
    /// An output of a log cannot be written.
    pub(crate) fn end(
        mut self,
        counts: WatchCounts,
        silences: Silences,
    ) -> Result<(Totals, Shown), Failure> {
        let losses = self.threads.finish()?;
        self.bar.finish_and_clear();
        Ok((Totals { counts, silences, losses }, self.shown))
    }
}

/// The outputs that stay in memory until the end.
pub(crate) struct Shown {
    /// The strip of states, and the changes.
    pub strip: Strip,
    /// The page of the watch, if one is wanted.
    pub page: Option<Watched<PlayerRecord>>,
    /// The states without a judgment, in the order of their first appearance.
    pub unjudged: Vec<DiagnosisState>,
    /// The finding of the last sample in words.
    pub last: Option<String>,
}

impl Sink for Shown {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        let state = sample.finding.state;
        if !state.is_judgement() && !self.unjudged.contains(&state) {
            self.unjudged.push(state);
        }
        if sample.changed || self.last.is_none() {
            self.last = Some(sample.finding.words());
        }
        if let Some(page) = &mut self.page {
            page.sample(sample)?;
        }
        self.strip.sample(sample)
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        if let Some(page) = &mut self.page {
            page.notice(notice)?;
        }
        self.strip.notice(notice)
    }
}

/// Prints every change of a live source on a line as it arrives, and its current state below.
struct Terminal {
    bar: ProgressBar,
    global: Global,
}

impl Terminal {
    fn holds(&self, time_s: f64, state: DiagnosisState) {
        self.bar.set_message(format!("{}  {}", moment::shown(time_s), state.words()));
    }
}

impl Sink for Terminal {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        if self.bar.is_hidden() {
            return Ok(());
        }
        let finding = &sample.finding;
        if sample.changed {
            let words = finding.words();
            let words = sanitize::printable(&words);
            self.bar.println(format!("{:>12}  {words}", moment::shown(sample.time_s)));
        }
        self.holds(sample.time_s, finding.state);
        Ok(())
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        let time_s = notice.time_s.unwrap_or(0.0);
        let Some(words) = notice.words() else { return Ok(()) };
        let is_over =
            matches!(notice.event, WatchEvent::DataAgain | WatchEvent::ChannelDataAgain { .. });
        let text = match notice.time_s {
            Some(time_s) => {
                format!("{}: after {}: {words}", notice.wall_time, moment::shown(time_s))
            }
            None => format!("{}: {words}", notice.wall_time),
        };
        self.bar.suspend(|| match is_over {
            true => note(self.global, &text),
            false => warn(self.global, &[text]),
        });
        self.holds(time_s, notice.state);
        Ok(())
    }
}

/// Opens the file of events, which grows line by line so that other programs can follow it. A resumed watch keeps the
/// lines up to the checkpoint.
fn events_file(path: &Path, resumed: Option<&Checkpoint>) -> Result<File, Failure> {
    let failed = |cause| SinkError::File(files::FileError::from_io(path, cause));
    let kept = match resumed {
        Some(checkpoint) if path.exists() => {
            kept_lines(&files::read_text(path).map_err(SinkError::File)?, checkpoint.events())
        }
        _ => 0,
    };
    // Kept lines are not rewritten, because a full disk would lose them.
    let mut file =
        OpenOptions::new().write(true).create(true).truncate(false).open(path).map_err(failed)?;
    if file.metadata().is_ok_and(|data| data.is_file()) {
        file.set_len(kept).map_err(failed)?;
        file.seek(SeekFrom::End(0)).map_err(failed)?;
    }
    Ok(file)
}

/// The length in bytes of the complete lines up to the given number of changes.
fn kept_lines(text: &str, changes: u64) -> u64 {
    let (mut kept, mut found) = (0, 0);
    for line in text.split_inclusive('\n').filter(|line| line.ends_with('\n')) {
        found += u64::from(is_change(line));
        if found > changes {
            break;
        }
        kept += line.len() as u64;
    }
    kept
}

fn bar(global: Global, is_live: bool) -> ProgressBar {
    if !is_shown(global) {
        return ProgressBar::hidden();
    }
    // A stream has no known end.
    let template = if is_live { "{msg}" } else { "{msg} {wide_bar} {percent} %" };
    let style = ProgressStyle::with_template(template);
    ProgressBar::new(1000).with_style(style.expect("a correct template"))
}

fn show(bar: &ProgressBar, time_s: f64, share: Option<f64>) {
    if time_s.is_finite() {
        bar.set_message(moment::shown(time_s));
    }
    bar.set_position((1000.0 * share.unwrap_or(0.0)) as u64);
}

/// The totals of a watch.
pub(crate) struct Totals {
    /// The counts of the log or stream.
    pub counts: WatchCounts,
    silences: Silences,
    losses: Vec<SinkLoss>,
}

impl Totals {
    /// The incomplete files, each with the reason.
    pub(crate) fn lost_files(&self) -> Vec<String> {
        let lost = self.losses.iter().filter(|loss| loss.is_file);
        // The reason already begins with the name of the file.
        lost.filter_map(|loss| loss.failure.clone()).collect()
    }

    /// Adds the totals.
    pub(crate) fn describe(&self, map: &LogMap, document: &mut Document) {
        let Totals { counts, silences, losses } = self;
        let missing = counts.missing.iter().enumerate().filter(|(_, count)| **count > 0);
        let missing: BTreeMap<&str, u64> = missing.map(|(k, count)| (map.id(k), *count)).collect();
        let lost = losses.iter().filter(|loss| loss.lost > 0);
        let unsent: BTreeMap<&str, u64> = lost.map(|own| (own.sink.as_str(), own.lost)).collect();
        let failed = losses.iter().filter_map(|loss| Some((&*loss.sink, loss.failure.as_deref()?)));
        let failed: BTreeMap<&str, &str> = failed.collect();
        let (frames, counted, samples) = (counts.frames, &counts.counted, counts.samples);
        let judged = counts.judged;
        document
            .text(format!("{frames} {counted}s became {samples} samples, {judged} of them judged"));
        document.fact("frames", "", frames);
        document.fact("samples", "", samples);
        document.fact("judged", "", judged);
        document.fact("missing", "", Value::of("", &missing));
        document.fact("unsent", "", Value::of("", &unsent));
        document.fact("failed", "", Value::of("", &failed));
        document.fact("silences", "", Value::of("", silences));
        if let Some(lost) = guard::lost_in_words(map, counts) {
            document.text(lost);
        }
        if silences.source > 0 {
            let Silences { source, source_s, .. } = silences;
            document.text(format!("silences of the source: {source}, {source_s:.1} s in all"));
        }
        for SinkLoss { sink, lost, failure, .. } in losses {
            if *lost > 0 {
                document.text(format!("samples not sent to {sink}: {lost}"));
            }
            if let Some(reason) = failure {
                document.text(format!("{sink} failed: {}", without_name(sink, reason)));
            }
        }
        let mut met = Table::of("count:how often | kind:what was met | first");
        for (kind, tally) in counts.met() {
            let (name, words) = kind.words();
            met.push(row![tally.count, Value::of(words, &name), counts.place(tally)]);
        }
        document.table("met", met);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_kept_up_to_the_checkpoint_with_the_notices_between() {
        let change = "{\"time_s\":1.0,\"place\":1,\"state\":\"healthy\"}\n";
        let notice = "{\"event\":\"heartbeat\",\"state\":\"healthy\"}\n";
        let text = [change, notice, notice, change, notice, change].concat();
        let up_to = |changes| &text[..kept_lines(&text, changes) as usize];
        assert_eq!(up_to(0), "");
        assert_eq!(up_to(1), [change, notice, notice].concat());
        assert_eq!(up_to(2), [change, notice, notice, change, notice].concat());
        assert_eq!(up_to(9), text);
        // A truncated line is dropped.
        assert_eq!(kept_lines(&(change.to_owned() + "{\"time"), 9), change.len() as u64);
    }
}
