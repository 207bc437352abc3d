//! Sealed flights: judging in environments that nobody has looked at, with a record of every time that anybody did.
//!
//! The seeds that a study file may declare serve development: everything may be tuned on them. A sealed opening judges
//! finished diagnosers with a seed outside of that range ([`SEALED_SEEDS`]), which the number of the opening and the
//! commit determine. The record gets a line before the first flight, so that an aborted opening counts as well. A seed
//! in the record is never drawn again.
//!
//! The record is a CSV file that only grows. In a repository it is `sealed/openings.csv`, found from the current folder
//! upwards; elsewhere it lies in the output folder.

use super::JobError;
use crate::files::{self, FileError};
use crate::manifest::sha256_of_text;
use serde::{Deserialize, Serialize};
use servotwin_io::moment;
use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{SystemTime, UNIX_EPOCH};

/// The seeds of sealed environments. Those of study files end at 999.
pub const SEALED_SEEDS: RangeInclusive<u64> = 1100..=16_383;

/// The record in a repository.
const IN_REPOSITORY: &str = "sealed/openings.csv";

/// The record in an output folder.
const IN_FOLDER: &str = "sealed-openings.csv";

/// The columns of a record.
const HEAD: &str =
    "opening,event,date,commit,version,study,study_sha256,diagnoser_sha256,seed,judged,result";

const OPENED: &str = "opened";
const JUDGED: &str = "judged";

/// An opening of sealed environments, as results name it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Opening {
    /// Its number, from 1, over all studies of the record.
    pub number: u64,
    /// The seed of the environments.
    pub seed: u64,
    /// The commit of the repository with `-dirty` for uncommitted changes, or `none`.
    pub(crate) commit: String,
}

/// How often sealed environments have been opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Openings {
    /// Openings on record.
    pub opened: u64,
    /// Those without a result: they were aborted, or still run.
    pub without_result: u64,
}

/// What an opening judges.
#[derive(Debug, Clone)]
pub struct SealedSubject<'s> {
    /// The study's name.
    pub study: &'s str,
    /// The study's text.
    pub study_text: &'s str,
    /// The hash over the diagnosers.
    pub diagnoser_sha256: String,
    /// Sizes and scenarios.
    pub judged: String,
}

/// The record of all openings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OpeningRecord {
    path: PathBuf,
}

impl OpeningRecord {
    /// The record of the repository around a folder. Outside of a repository, that of the output folder.
    pub fn find(start: &Path, out: &Path) -> Self {
        let folders = start.ancestors().map(|folder| folder.join(IN_REPOSITORY));
        let known = folders.into_iter().find(|path| path.is_file());
        OpeningRecord { path: known.unwrap_or_else(|| out.join(IN_FOLDER)) }
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Counts the openings; none without a file.
    ///
    /// # Errors
    /// The file cannot be read or has a damaged line.
    pub fn count(&self) -> Result<Openings, JobError> {
        if !self.path.exists() {
            return Ok(Openings::default());
        }
        let lines = self.parse(&files::read_text(&self.path)?)?;
        let of = |event: &str| lines.iter().filter(|line| line.event == event).count() as u64;
        let opened = of(OPENED);
        Ok(Openings { opened, without_result: opened.saturating_sub(of(JUDGED)) })
    }

    /// Draws a seed that was never opened and records the opening, before anything is flown.
    ///
    /// # Errors
    /// The file cannot be read or written, has a damaged line, or all seeds were opened.
    pub fn open(&self, subject: &SealedSubject) -> Result<Opening, JobError> {
        let mut file = self.append()?;
        // Two programs that open at the same time get different numbers. Where there are no locks, nothing protects.
        let _ = file.lock();
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(|cause| self.system(cause))?;
        let lines = self.parse(&text)?;
        let number = lines.iter().map(|line| line.number).max().unwrap_or(0) + 1;
        let commit = commit_of(self.path.parent().unwrap_or(Path::new(".")));
        let used: BTreeSet<u64> = lines.iter().filter_map(|line| line.seed).collect();
        let Some(seed) = draw(number, &commit, &used) else {
            return Err(self.damaged(lines.len() + 1, "all sealed seeds were opened"));
        };
        let SealedSubject { study, study_text, diagnoser_sha256, judged } = subject;
        let (version, study_sha256) = (env!("CARGO_PKG_VERSION"), sha256_of_text(study_text));
        let fields = [
            &number.to_string(),
            OPENED,
            &today(),
            &commit,
            version,
            study,
            &study_sha256,
            diagnoser_sha256,
            &seed.to_string(),
            judged,
            "",
        ];
        self.write(&mut file, &fields)?;
        Ok(Opening { number, seed, commit })
    }

    /// Records the result of an opening.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn close(&self, opening: &Opening, result: &str) -> Result<(), JobError> {
        let mut file = self.append()?;
        let _ = file.lock();
        let (number, date) = (opening.number.to_string(), today());
        self.write(&mut file, &[&number, JUDGED, &date, "", "", "", "", "", "", "", result])
    }

    fn append(&self) -> Result<std::fs::File, JobError> {
        if let Some(folder) = self.path.parent() {
            files::create_folder(folder)?;
        }
        let file = OpenOptions::new().create(true).read(true).append(true).open(&self.path);
        file.map_err(|cause| self.system(cause))
    }

    /// Appends a line in one write; the first one gets the head above it.
    fn write(&self, file: &mut std::fs::File, fields: &[&str]) -> Result<(), JobError> {
        let is_new = file.metadata().map_err(|cause| self.system(cause))?.len() == 0;
        let head = if is_new { format!("{HEAD}\n") } else { String::new() };
        let fields: Vec<String> = fields.iter().map(|field| plain(field)).collect();
        let text = format!("{head}{}\n", fields.join(","));
        let written = file.write_all(text.as_bytes()).and_then(|()| file.sync_all());
        written.map_err(|cause| self.system(cause))
    }

    fn parse(&self, text: &str) -> Result<Vec<Line>, JobError> {
        let mut lines = text.lines().enumerate();
        match lines.next() {
            None => return Ok(vec![]),
            Some((_, head)) if head == HEAD => {}
            Some(_) => return Err(self.damaged(1, &format!("the head must be {HEAD}"))),
        }
        let line = |(place, text): (usize, &str)| {
            let wrong = "it takes 11 fields: opening (a number), opened or judged, and others";
            Line::parse(text).ok_or_else(|| self.damaged(place + 1, wrong))
        };
        lines.map(line).collect()
    }

    fn damaged(&self, line: usize, reason: &str) -> JobError {
        JobError::SealedRecord { path: self.path.clone(), line, reason: reason.into() }
    }

    fn system(&self, cause: std::io::Error) -> JobError {
        FileError::from_io(&self.path, cause).into()
    }
}

/// What the program needs of a line.
struct Line {
    number: u64,
    event: String,
    seed: Option<u64>,
}

impl Line {
    fn parse(text: &str) -> Option<Line> {
        let fields: Vec<&str> = text.split(',').collect();
        let [number, event, _, _, _, _, _, _, seed, _, _] = fields[..] else { return None };
        let seed = match event {
            OPENED => Some(seed.parse().ok()?),
            JUDGED => None,
            _ => return None,
        };
        Some(Line { number: number.parse().ok()?, event: event.into(), seed })
    }
}

/// A seed that is not among the used ones; the same number and commit give the same seed.
fn draw(number: u64, commit: &str, used: &BTreeSet<u64>) -> Option<u64> {
    let (first, last) = (*SEALED_SEEDS.start(), *SEALED_SEEDS.end());
    let count = last - first + 1;
    let digest = sha256_of_text(&format!("servotwin sealed {number} {commit}"));
    let offset = u64::from_str_radix(&digest[..12], 16).unwrap_or(0) % count;
    let seeds = (0..count).map(|step| first + (offset + step) % count);
    seeds.into_iter().find(|seed| !used.contains(seed))
}

/// A field without separators and line ends.
fn plain(field: &str) -> String {
    field.replace(',', ";").replace(|letter: char| letter.is_control(), " ")
}

/// The commit of the repository around a folder, or `none`.
fn commit_of(folder: &Path) -> String {
    let mut git = Command::new("git");
    let git = git.arg("-C").arg(folder).stdin(Stdio::null()).stderr(Stdio::null());
    let arguments = ["describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"];
    let output = git.args(arguments).output().ok().filter(|output| output.status.success());
    let text = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    text.filter(|commit| !commit.is_empty()).unwrap_or_else(|| "none".into())
}

/// The date of today, UTC.
fn today() -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let date = moment::date_of(now.as_secs_f64());
    date.and_then(|date| Some(date.split_once(' ')?.0.to_owned())).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_depends_on_number_and_commit_and_is_never_drawn_twice() {
        let none = BTreeSet::new();
        let of = |number, commit| draw(number, commit, &none).unwrap();
        assert_eq!(of(1, "a"), of(1, "a"));
        assert!(of(1, "a") != of(2, "a") && of(1, "a") != of(1, "b"));
        let mut used = none;
        for number in 0..200 {
            let seed = draw(number % 3, "a", &used).unwrap();
            assert!(SEALED_SEEDS.contains(&seed) && used.insert(seed), "{seed} was drawn twice");
        }
        assert_eq!(draw(1, "a", &SEALED_SEEDS.collect()), None);
    }
}
