//! A table in memory that is watched as a whole, with the guards of a log.

use super::guard::{self, IntakeError, LogPlan, Opened};
use super::map::Map;
use super::sink::{Sample, Sink, SinkError};
use super::source::table::{TableRows, table_columns};
use super::{End, Finding, Watch, WatchError};
use servotwin::live::runtime::RuntimeError;
use servotwin::live::watcher::Watcher;
use servotwin::study::Study;
use servotwin::table::Table;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The table's name in messages.
const NAME: &str = "the table";

/// What was found in a table.
pub struct TableFindings {
    /// Each finding that differs from the one before, with its time, s.
    pub changes: Vec<(f64, Finding)>,
    /// What may be wrong with the table, as sentences.
    pub warnings: Vec<String>,
}

/// Why a table is not judged.
#[derive(Debug, thiserror::Error)]
pub enum TableWatchError {
    /// The diagnoser was trained for another study.
    #[error(transparent)]
    Diagnoser(#[from] RuntimeError),
    /// Its columns are not those of the study.
    #[error(transparent)]
    Columns(#[from] IntakeError),
    /// It cannot be read.
    #[error(transparent)]
    Watch(#[from] WatchError),
    /// Its values contradict its columns, or leave nothing to judge.
    #[error("{NAME}: {0}")]
    Unjudged(String),
    /// The caller requested the stop.
    #[error("stopped")]
    Stopped,
}

/// Watches the rows of a table with twin and diagnosis. Columns are found by their names.
///
/// # Errors
/// There is no time, the columns are not those of the study, the values contradict them, or nothing could be judged.
pub fn watch_table(
    study: &Study,
    diagnoser: &Arc<Diagnoser>,
    table: &Table,
    stop: &AtomicBool,
) -> Result<TableFindings, TableWatchError> {
    let (system, period_s) = (&study.system, diagnoser.period_s);
    // The notes are about inputs that stay at their defaults.
    let LogPlan { map, warnings, .. } = guard::plan(NAME, &table_columns(table), study, true)?;
    if map.time_column().is_none() {
        let reason = "no column is a time, such as time_s, and without it nobody knows the rate";
        return Err(TableWatchError::Unjudged(reason.into()));
    }
    let rows = || TableRows::of_table(NAME, table, map.wanted()).map_err(WatchError::from);
    let observer = || Watcher::new(study, diagnoser.clone());
    let mut open = |_: &Map| -> Result<Opened, TableWatchError> {
        Ok((Box::new(rows()?), Box::new(observer()?)))
    };
    let doubts = guard::trial(&mut open, &map, study, period_s)?.contradictions;
    if !doubts.is_empty() {
        return Err(TableWatchError::Unjudged(doubts.join("; ")));
    }
    let (mut rows, mut observer) = (rows()?, observer()?);
    let mut changes = Changes(vec![]);
    let mut watch = Watch::new(&mut rows, &map, &mut observer, period_s);
    watch.expect(study, &guard::accepted_ranges(diagnoser, system));
    watch.sink(&mut changes);
    if watch.run(stop, &mut |_, _| ())? == End::Stopped {
        return Err(TableWatchError::Stopped);
    }
    let counts = watch.counts().clone();
    let (contradictions, mut doubts) = (watch.contradictions(), watch.doubts());
    drop(watch);
    doubts.extend(observer.wider_than_trained());
    let needed = guard::needed(diagnoser, system);
    let reason = match (counts.samples, counts.judged, contradictions.is_empty()) {
        (0, ..) => guard::nothing(&map, &counts),
        (_, 0, _) => guard::unjudged(doubts, &map, diagnoser, system, &counts),
        (.., false) => contradictions.join("; "),
        _ => {
            let is_silent = |channel: &usize| counts.missing[*channel] >= counts.samples;
            let silent = (map.inputs()..map.width()).filter(is_silent).map(|c| map.id(c));
            let mut without: Vec<&str> = map.unmeasured().chain(silent).collect();
            without.retain(|id| needed.contains(id));
            without.sort_unstable();
            without.dedup();
            let lacking = format!("the diagnosis does without {}", without.join(", "));
            let mut all = warnings;
            all.extend(guard::of_records(diagnoser));
            all.extend((!without.is_empty()).then_some(lacking));
            all.extend(counts.met_in_words());
            all.extend(guard::lost_in_words(&map, &counts));
            all.extend(doubts);
            return Ok(TableFindings { changes: changes.0, warnings: all });
        }
    };
    Err(TableWatchError::Unjudged(reason))
}

/// Keeps each change of the finding.
struct Changes(Vec<(f64, Finding)>);

impl Sink for Changes {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        if sample.changed {
            self.0.push((sample.time_s, sample.finding.clone()));
        }
        Ok(())
    }
}
