//! Computes the parts of a suite: a queue of simulations over several parts, and files that are written beside it.
//!
//! What is kept of a run is the business of [`Kept`]: windows of records, windows to learn from, outcomes.

use super::RunError;
use super::part::{self, PartFiles};
use crate::files::create_folder;
use crate::parallel::Workers;
use crate::study::{Scenario, Study, Suite};
use crate::table::{Table, TableError};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;

/// Complete parts that wait for the disk.
const WAITING: usize = 4;

/// Receives what is kept of a run in a scenario: the index of the scenario, the number of the run, and its row.
pub(crate) type Take<'t, R> = &'t mut (dyn FnMut(usize, usize, R) + Send);

/// What is kept of the runs of a suite, in the files of its parts.
pub(crate) trait Kept: Sync {
    /// What is kept of a run.
    type Row: Send;

    /// The study, its suite, and the first of the scenarios, which all have the same plants.
    fn place(&self) -> (&Study, &Suite, Scenario);

    /// The files of the parts in each scenario.
    fn files(&self) -> &[PartFiles];

    /// Simulates the runs of a round, and passes on what is kept of each that a file lacks.
    ///
    /// # Errors
    /// A run cannot begin, or the work was cancelled.
    fn fly(&self, round: &Round, take: Take<Self::Row>) -> Result<(), RunError>;

    /// The table of a part, from the rows of its runs.
    ///
    /// # Errors
    /// The rows make no table.
    fn table(&self, rows: BTreeMap<usize, Self::Row>) -> Result<Table, TableError>;
}

/// How many runs some parts have in all scenarios.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counts {
    pub(crate) all: usize,
    /// Those that files contained before.
    pub(crate) resumed: usize,
}

/// Parts that are simulated together.
pub(crate) struct Round<'r> {
    files: &'r [PartFiles],
    /// The parts that each scenario lacks.
    lacking: &'r [BTreeSet<usize>],
    /// The part of each run.
    part_of: BTreeMap<usize, usize>,
    /// Ends the simulations: nothing is simulated for a disk that takes nothing.
    pub(crate) stop: AtomicBool,
}

impl Round<'_> {
    /// The numbers of its runs in any scenario.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = usize> {
        self.part_of.keys().copied()
    }

    /// Whether the files of the scenario at an index lack a run.
    pub(crate) fn lacks(&self, scenario: usize, number: usize) -> bool {
        let part = self.part_of[&number];
        self.lacking[scenario].contains(&part) && self.files[scenario].parts[part].contains(&number)
    }
}

/// Computes those of the wanted parts whose files are absent or unusable. `progress` receives the number of runs done and of
/// all.
///
/// # Errors
/// A run cannot begin, a file cannot be written, or [`RunError::Cancelled`].
pub(crate) fn compute<K: Kept>(
    kept: &K,
    wanted: &[usize],
    workers: Workers,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Counts, RunError> {
    let files = kept.files();
    let lacking: Vec<_> = files.iter().map(|own| own.missing(wanted.iter().copied())).collect();
    let all = files.iter().map(|own| own.runs_of(wanted)).sum();
    let open = files.iter().zip(&lacking).map(|(own, open)| own.runs_of(open));
    let resumed = all - open.sum::<usize>();
    // Some scenarios have fewer runs in a part than others.
    let longest = |part: usize| files.iter().map(|own| &own.parts[part]).max_by_key(|p| p.len());
    let parts: Vec<Vec<usize>> =
        (0..files[0].parts.len()).map(|part| longest(part).cloned().unwrap_or_default()).collect();
    let open: BTreeSet<usize> = lacking.iter().flatten().copied().collect();
    let mut done = resumed;
    progress(done, all);
    for round in part::rounds(kept.place(), &parts, &open) {
        let of = |&part: &usize| parts[part].iter().map(move |&number| (number, part));
        let (lacking, part_of) = (&lacking[..], round.iter().flat_map(of).collect());
        let round = Round { files, lacking, part_of, stop: AtomicBool::new(false) };
        compute_round(kept, &round, || {
            if workers.is_cancelled() {
                round.stop.store(true, Ordering::Relaxed);
            }
            done += 1;
            progress(done, all);
        })?;
        if workers.is_cancelled() {
            return Err(RunError::Cancelled);
        }
    }
    Ok(Counts { all, resumed })
}

fn compute_round<K: Kept>(
    kept: &K,
    round: &Round,
    mut ended: impl FnMut() + Send,
) -> Result<(), RunError> {
    let files = round.files;
    create_folder(files[0].folder()).map_err(RunError::File)?;
    let (sender, receiver) = sync_channel::<(usize, usize, BTreeMap<usize, K::Row>)>(WAITING);
    std::thread::scope(|scope| {
        let writer = scope.spawn(|| {
            let write = |(scenario, part, rows): (usize, usize, _)| {
                Ok(files[scenario].write(part, kept.table(rows)?)?)
            };
            let written = receiver.into_iter().try_for_each(write);
            round.stop.fetch_or(written.is_err(), Ordering::Relaxed);
            written
        });
        let mut open: BTreeMap<(usize, usize), BTreeMap<usize, K::Row>> = BTreeMap::new();
        let simulated = kept.fly(round, &mut |scenario, number, row| {
            let part = round.part_of[&number];
            let rows = open.entry((scenario, part)).or_default();
            rows.insert(number, row);
            if rows.len() == files[scenario].parts[part].len() {
                let rows = open.remove(&(scenario, part)).expect("just filled");
                // A writer that has stopped has the reason.
                drop(sender.send((scenario, part, rows)));
            }
            ended();
        });
        drop(sender);
        let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        simulated.and(written)
    })
}
