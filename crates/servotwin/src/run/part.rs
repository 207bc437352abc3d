//! Parts of a suite: some of its runs, with one file for each scenario. Records, outcomes of flights and windows to learn
//! from are all stored in parts.
//!
//! A part appears when all its runs have ended, and its bytes depend on the study alone. Parts that are computed
//! anywhere, repeatedly or simultaneously, therefore join to the files of a single machine.

use super::{Run, RunError, fitted_specimen, plan};
use crate::manifest::in_hexadecimal;
use crate::study::{Scenario, Study, Suite};
use crate::table::{Column, Table, TableError, Values};
use servotwin_diagnosis::features::Sensor;
use servotwin_diagnosis::residual::Window;
use servotwin_model::c_source;
use servotwin_model::hash::Fingerprint;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// The folder of parts in an output folder.
pub const PARTS: &str = "parts";

/// The format of parts; those of another format are simulated again.
const FORMAT: &str = "part 1";

/// Samples of plants in a part: 2,500 s at 100 Hz.
const PART_SAMPLES: f64 = 2.5e5;

/// What the search for its steady state adds to a run, in samples.
const SETTLING_SAMPLES: f64 = 1000.0;

/// The most runs that are simulated together, whose rows memory holds until their parts are complete.
const ROUND_RUNS: usize = 40_000;

/// The most samples of twins in memory at a time: about 500 MB.
const ROUND_TWIN_SAMPLES: f64 = 2.5e6;

/// A share of the parts, for one of several machines: `3/100` is the third of a hundred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Number of the share, from 1.
    number: usize,
    of: usize,
}

impl Share {
    /// Whether it contains a part; the parts of all suites of a command are numbered consecutively.
    pub fn holds(self, part: usize) -> bool {
        part % self.of == self.number - 1
    }
}

impl FromStr for Share {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let share = text.split_once('/').and_then(|(number, of)| {
            let (number, of) = (number.trim().parse().ok()?, of.trim().parse().ok()?);
            (1..=of).contains(&number).then_some(Share { number, of })
        });
        share.ok_or("a share is written NUMBER/ALL, such as 3/100, and counts from 1")
    }
}

impl fmt::Display for Share {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}/{}", self.number, self.of)
    }
}

/// The numbers of the runs of each part of a suite, from all its runs. Environments of flights share a part while they fit; the runs of a
/// larger one, or of an operating case, are divided equally, unless the twins of the suite are fitted in it. More
/// environments leave all parts but the last one as they are.
pub(crate) fn parts(
    study: &Study,
    suite: &Suite,
    runs: impl IntoIterator<Item = Run>,
) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<(bool, usize), (Vec<usize>, f64)> = BTreeMap::new();
    for run in runs {
        // Healthy records are apart, because scenarios without noise have none.
        let is_apart = suite.is_records && run.is_healthy();
        let (numbers, seconds) = groups.entry((is_apart, run.environment)).or_default();
        numbers.push(run.number);
        *seconds += run.duration_s;
    }
    let mut parts: Vec<Vec<usize>> = vec![];
    let mut filled = f64::INFINITY;
    for (numbers, seconds) in groups.into_values() {
        let samples = seconds / study.sample_period_s + SETTLING_SAMPLES * numbers.len() as f64;
        let is_divided = (samples > PART_SAMPLES || suite.is_records) && !suite.is_fitted;
        match parts.last_mut().filter(|_| !is_divided && filled + samples <= PART_SAMPLES) {
            Some(part) => {
                part.extend(numbers);
                filled += samples;
            }
            None => {
                let count = if is_divided { (samples / PART_SAMPLES).ceil() as usize } else { 1 };
                let end = |part: usize| part * numbers.len() / count;
                parts.extend((0..count).map(|part| numbers[end(part)..end(part + 1)].to_vec()));
                filled = if is_divided { f64::INFINITY } else { samples };
            }
        }
    }
    parts
}

/// Divides the wanted parts of a suite into rounds of neighbors that are simulated together. A round holds its twins, and the
/// rows of unfinished parts, in memory. Where each twin is fitted anew, each part is a round.
pub(crate) fn rounds(
    (study, suite, scenario): (&Study, &Suite, Scenario),
    parts: &[Vec<usize>],
    wanted: &BTreeSet<usize>,
) -> Vec<Vec<usize>> {
    let twin_samples = suite.longest_s() / study.sample_period_s;
    let twin = |number: usize| {
        if suite.has_own_twins() {
            return (number, None);
        }
        let run = plan::run(study, suite, number);
        (run.environment, fitted_specimen(study, suite, scenario, &run))
    };
    let mut rounds: Vec<Vec<usize>> = vec![];
    let (mut runs, mut twins) = (0, BTreeSet::new());
    for &place in wanted {
        let own = || parts[place].iter().map(|&number| twin(number));
        runs += parts[place].len();
        twins.extend(own());
        let is_full = runs > ROUND_RUNS || twins.len() as f64 * twin_samples > ROUND_TWIN_SAMPLES;
        let is_next = |round: &&mut Vec<usize>| round.ends_with(&[place.wrapping_sub(1)]);
        match rounds.last_mut().filter(is_next).filter(|_| !is_full && !suite.is_fitted) {
            Some(round) => round.push(place),
            None => {
                (runs, twins) = (parts[place].len(), own().collect());
                rounds.push(vec![place]);
            }
        }
    }
    rounds
}

/// The files of the parts of a suite in a scenario.
#[derive(Clone, Debug)]
pub(crate) struct PartFiles {
    folder: PathBuf,
    /// How the names of the files begin.
    pub(crate) stem: String,
    /// The fingerprint of everything that determines a part besides the numbers of its runs.
    fingerprint: Fingerprint,
    /// The numbers of the runs of each part; a part without runs has no file.
    pub(crate) parts: Vec<Vec<usize>>,
}

impl PartFiles {
    /// The files of parts in an output folder.
    pub(crate) fn new(
        folder: impl Into<PathBuf>,
        stem: String,
        mut fingerprint: Fingerprint,
        parts: Vec<Vec<usize>>,
    ) -> Self {
        fingerprint.add(FORMAT);
        PartFiles { folder: folder.into(), stem, fingerprint, parts }
    }

    fn path(&self, part: usize) -> PathBuf {
        self.folder.join(file_name(&self.stem, part))
    }

    /// The folder of all parts.
    pub(crate) fn folder(&self) -> PathBuf {
        self.folder.join(PARTS)
    }

    /// The numbers of all parts.
    pub(crate) fn all(&self) -> Vec<usize> {
        (0..self.parts.len()).collect()
    }

    /// The parts that are absent or unusable. Damaged parts and parts of other runs are made again.
    pub(crate) fn missing(&self, among: impl IntoIterator<Item = usize>) -> BTreeSet<usize> {
        let is_missing = |&part: &usize| !self.parts[part].is_empty() && self.sound(part).is_none();
        among.into_iter().filter(is_missing).collect()
    }

    fn mark(&self, part: usize) -> String {
        let mut mark = self.fingerprint;
        mark.add(&self.parts[part]).to_string()
    }

    fn is_own(&self, part: usize, table: &Table) -> bool {
        table.metadata.get("fingerprint") == Some(&self.mark(part))
    }

    /// Reads a part if it is complete and of these runs.
    fn sound(&self, part: usize) -> Option<Table> {
        let path = self.path(part);
        let table = path.exists().then(|| Table::read(path))?.ok()?;
        let is_whole = table.metadata.get("checksum") == Some(&checksum(&table));
        (is_whole && self.is_own(part, &table)).then_some(table)
    }

    /// Reads a part; `None` for a part without runs.
    ///
    /// # Errors
    /// [`RunError::Unfinished`] if the part cannot be used.
    pub(crate) fn read(&self, part: usize) -> Result<Option<Table>, RunError> {
        if self.parts[part].is_empty() {
            return Ok(None);
        }
        self.sound(part).map(Some).ok_or_else(|| self.unfinished())
    }

    /// The error for missing parts.
    fn unfinished(&self) -> RunError {
        let missing = self.runs_of(&self.missing(0..self.parts.len()));
        RunError::Unfinished { missing, damaged: self.damaged() }
    }

    /// The first part that is damaged.
    fn damaged(&self) -> Option<PathBuf> {
        let is_damaged = |&part: &usize| {
            let path = self.path(part);
            let is_other = || Table::read(&path).is_ok_and(|table| !self.is_own(part, &table));
            path.exists() && self.sound(part).is_none() && !is_other()
        };
        (0..self.parts.len()).find(is_damaged).map(|part| self.path(part))
    }

    /// Number of runs of some parts.
    pub(crate) fn runs_of<'p>(&self, parts: impl IntoIterator<Item = &'p usize>) -> usize {
        parts.into_iter().map(|&part| self.parts[part].len()).sum()
    }

    /// Writes a part.
    pub(crate) fn write(&self, part: usize, table: Table) -> Result<(), TableError> {
        let sum = checksum(&table);
        let table = table.with_metadata("fingerprint", self.mark(part));
        table.with_metadata("checksum", sum).write(self.path(part))
    }
}

/// The file of a part, relative to the output folder.
pub(crate) fn file_name(stem: &str, part: usize) -> String {
    format!("{PARTS}/{stem}-{part:04}.parquet")
}

/// The fingerprint of a study's model, on which all parts depend: the equations with their parameters, and the sensors.
pub(crate) fn model_mark(study: &Study) -> Fingerprint {
    let mut mark = Fingerprint::default();
    let equations = c_source::write_equations(&study.system.program, "model", &[]);
    mark.add(&equations.expect("a prefix that is a name"));
    mark.add(&study.system.text).add(&study.measured);
    for Sensor { name, quantity, actuator, noise, is_noisy, follows } in &study.sensors.0 {
        mark.add(name).add(quantity.name()).add(actuator).add(noise).add(is_noisy).add(follows);
    }
    mark
}

/// Checksum over the rows of a part, which detects flipped bits.
fn checksum(table: &Table) -> String {
    let mut digest = Sha256::new();
    for column in table.columns() {
        digest.update(column.name.as_bytes());
        match &column.values {
            Values::Float(values) => values.iter().for_each(|v| digest.update(v.to_le_bytes())),
            Values::Unsigned(values) => values.iter().for_each(|v| digest.update(v.to_le_bytes())),
            Values::Text(values) => values.iter().for_each(|v| digest.update(v.as_bytes())),
            Values::Flag(values) => values.iter().for_each(|&v| digest.update([u8::from(v)])),
            _ => {}
        }
    }
    in_hexadecimal(digest)
}

/// The columns with the values of windows, by row.
pub(crate) fn window_columns(windows: &[&Window]) -> impl Iterator<Item = Column> {
    let values: Vec<Vec<f64>> = windows.iter().map(|window| window.to_values()).collect();
    let count = values.first().map_or(0, Vec::len);
    (0..count).map(move |place| {
        let column: Vec<f64> = values.iter().map(|row| row[place]).collect();
        Column::new(window_column(place), "", column)
    })
}

/// Reads the windows written as [`window_columns`], of so many sensors, some of which are watched.
pub(crate) fn windows_of(
    table: &Table,
    (sensors, watched): (usize, usize),
) -> Result<Vec<Window>, TableError> {
    let count = Window::watching(sensors, watched).to_values().len();
    let columns = (0..count).map(|place| table.f64(&window_column(place)));
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    let window = |row: usize| {
        let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
        Window::from_values(sensors, watched, &values).expect("as many values as counted")
    };
    Ok((0..table.row_count()).map(window).collect())
}

/// Name of the column with one of a window's values.
fn window_column(place: usize) -> String {
    format!("w:{place:03}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Purpose;
    use crate::study::suites::{HEALTHY, JUDGE};

    #[test]
    fn a_share_is_read_from_its_text_and_counts_from_one() {
        let share: Share = "3/100".parse().unwrap();
        assert_eq!(share.to_string(), "3/100");
        let held: Vec<usize> = (0..250).filter(|&part| share.holds(part)).collect();
        assert_eq!(held, [2, 102, 202]);
        for wrong in ["", "3", "0/3", "4/3", "-1/3", "a/b", "1/2/3"] {
            assert!(wrong.parse::<Share>().is_err(), "{wrong}");
        }
    }

    fn all_parts(study: &Study, suite: &Suite) -> Vec<Vec<usize>> {
        parts(study, suite, plan::all(study, suite))
    }

    #[test]
    fn parts_hold_every_run_once_and_are_no_larger_than_one_size() {
        let study = Study::default();
        let records = Purpose::OF_RECORDS.map(|purpose| study.records(purpose));
        let flights = study.suites().filter(|suite| !suite.is_unseen && !suite.is_fitted);
        for suite in records.iter().chain(flights) {
            let parts = all_parts(&study, suite);
            let mut all: Vec<usize> = parts.iter().flatten().copied().collect();
            assert!(!suite.is_records || all.is_sorted(), "records join by concatenation");
            all.sort_unstable();
            assert!(all.into_iter().eq(0..plan::count(&study, suite)), "{}", suite.name);
            for part in parts {
                let seconds: f64 =
                    part.iter().map(|&number| plan::run(&study, suite, number).duration_s).sum();
                let samples = seconds / study.sample_period_s;
                // The runs of a divided environment differ in length.
                assert!(samples < 1.5 * PART_SAMPLES, "{}: {samples}", suite.name);
            }
        }
    }

    #[test]
    fn more_environments_leave_all_parts_but_the_last_one() {
        let study = Study::default();
        let suite = study.suite(HEALTHY).unwrap();
        let few = all_parts(&study, suite);
        let more = all_parts(&study, &suite.clone().with_environments(2 * suite.environments));
        assert!(few.len() > 1 && few[..few.len() - 1] == more[..few.len() - 1]);
        let judge = study.suite(JUDGE).unwrap();
        assert!(all_parts(&study, judge).len() > 1);
    }
}
