//! One file for each command, and their shared code.

pub(crate) mod catalog;
pub(crate) mod check;
pub(crate) mod describe;
mod design;
pub(crate) mod export;
pub(crate) mod fault_tree;
pub(crate) mod features;
pub(crate) mod fit;
mod flights;
pub(crate) mod fly;
mod fly_truth;
pub(crate) mod fmea;
pub(crate) mod history;
pub(crate) mod init;
mod log_folder;
mod progress;
pub(crate) mod prove;
mod recordings;
mod records;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod sensors;
#[cfg(feature = "serve")]
pub(crate) mod serve;
pub(crate) mod simulate;
pub(crate) mod study;
mod summary;
pub(crate) mod test;
pub(crate) mod tools;
pub(crate) mod watch;
pub(crate) mod worst_case;

use crate::failure::Failure;
use crate::{Global, out, stop};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use servotwin::files;
use servotwin::job::{Crew, Folder, Hold, Job, Kept};
use servotwin::kind::FileType;
use servotwin::parallel::Workers;
use servotwin::signal::WrittenQuantity;
use servotwin::study::{Scenario, Study};
use servotwin::system::System;
use servotwin::table::{self, Table};
use servotwin::toml_text::counted;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::spec::Unit;
use servotwin_watch::shipped;
use servotwin_watch::source::SourceError;
use servotwin_watch::span::LogSpan;
use std::io::Write;
use std::num::NonZeroUsize;
use std::ops::{RangeBounds, RangeInclusive};
use std::path::{Path, PathBuf};

/// The system that a command is about.
#[derive(clap::Args)]
pub(crate) struct SystemOption {
    /// A system file, or the name of a built-in system (aileron_dual, spring_actuator, valve_and_cylinder,
    /// press_axis) [default: aileron_dual, the aileron with two actuators].
    #[arg(value_name = "SYSTEM")]
    path: Option<PathBuf>,
}

impl SystemOption {
    /// Reads the system.
    pub(crate) fn read(&self) -> Result<System, Failure> {
        match &self.path {
            Some(path) => Ok(System::read(path)?),
            None => Ok(System::default()),
        }
    }
}

/// The study that a command runs, and where its results go.
#[derive(clap::Args, Clone)]
pub(crate) struct StudyOptions {
    /// A study file, the name of a built-in study (paper, spring_actuator, press_axis), or a folder with results, which
    /// stands for their study [default: paper, the paper's study of the aileron].
    #[arg(value_name = "STUDY")]
    study: Option<PathBuf>,
    /// The folder for data sets, models, results and the report [default: the folder that stands for the study, or
    /// out].
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Use the full size of the study instead of the quick one: longer records, and flights.
    #[arg(long)]
    full: bool,
    /// Remove results of another study, or of the full size of this study, from the folder.
    #[arg(long)]
    replace: bool,
    /// Number of threads [default: all processors; the results do not depend
    /// on it].
    #[arg(long, value_parser = threads)]
    threads: Option<usize>,
}

impl StudyOptions {
    /// The folder of the results.
    fn folder(&self) -> Folder {
        let own = || self.study.as_deref().filter(|path| path.is_dir());
        Folder::new(self.out.as_deref().or_else(own).unwrap_or(Path::new("out")))
    }

    /// Reads the study and warns about doubtful entries. Its size is full if the user wants that, or if the folder
    /// holds it.
    fn read(&self, global: Global) -> Result<Study, Failure> {
        let study = self.find()?;
        warn(global, &study.warnings_in_words());
        if self.full {
            return Ok(study.full()?);
        }
        let folder = self.folder();
        if study.is_full || self.replace || !folder.holds_full(&study) {
            return Ok(study);
        }
        let folder = folder.path().display();
        note(
            global,
            &format!("{folder} holds the full study, which goes on (--replace for the quick one)"),
        );
        Ok(study.full()?)
    }

    /// The file of a study of recordings, if the user named one.
    fn recordings(&self) -> Option<&Path> {
        let path = self.study.as_deref().filter(|path| path.is_file())?;
        let text = files::read_toml(path).ok()?;
        (FileType::of(&text) == Some(FileType::Recordings)).then_some(path)
    }

    /// Whether the user named a study.
    #[cfg(feature = "serve")]
    fn is_named(&self) -> bool {
        self.study.is_some()
    }

    fn find(&self) -> Result<Study, Failure> {
        find_study(self.study.as_deref())
    }

    /// Prepares the folder for the study, and reports removed results.
    fn keep(&self, study: &Study, global: Global) -> Result<Hold, Failure> {
        let folder = self.folder();
        let Kept { hold, dropped } = folder.keep_study(study, self.replace)?;
        if dropped > 0 {
            removed(global, &folder.path().display().to_string(), dropped);
        }
        Ok(hold)
    }
}

/// The study of a file, a built-in study, or that of a folder with results.
fn find_study(path: Option<&Path>) -> Result<Study, Failure> {
    Ok(match path {
        Some(path) if path.is_dir() => Folder::new(path).read_study()?,
        Some(path) => Study::read(path)?,
        None => Study::default(),
    })
}

/// Reports that results of an earlier version of the study were removed.
fn removed(global: Global, folder: &str, files: usize) {
    let files = counted(files, "result file");
    note(global, &format!("{folder}: {files} of before the study was changed removed"));
}

/// Learns the diagnoser that a folder lacks.
fn learned(
    (folder, study): (&Folder, &Study),
    scenario: Scenario,
    threads: Option<usize>,
    global: Global,
) -> Result<Diagnoser, Failure> {
    note(global, &format!("learning in flights first ({})", folder.diagnoser(scenario).display()));
    let crew = Crew::quiet(workers(threads));
    let learned = Job { crew, ..Job::new(study, folder) }.learn(scenario);
    stop::check()?;
    Ok(learned?)
}

/// The diagnoser of a scenario in a folder. If it is missing and `may_be_shipped`, the built-in aileron has one that comes
/// with the program.
fn diagnoser_at_hand(
    (folder, study): (&Folder, &Study),
    scenario: Scenario,
    may_be_shipped: bool,
    global: Global,
) -> Result<Option<Diagnoser>, Failure> {
    if folder.diagnoser(scenario).exists() {
        return Ok(Some(servotwin::job::flights::diagnoser(folder, scenario)?));
    }
    let shipped = may_be_shipped.then(|| shipped::diagnoser(study)).flatten();
    if shipped.is_some() {
        let text = "the diagnosis comes with the program and allows for no tolerances; servotwin study --suite flights \
                    learns one that does";
        note(global, text);
    }
    Ok(shipped)
}

/// Parses one of some values by its name.
fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(name)).map(move |text| {
        let found = all.into_iter().find(|&value| name(value) == text);
        found.expect("clap admits known names only")
    })
}

/// Parses the name of a scenario.
fn scenario() -> impl TypedValueParser<Value = Scenario> {
    one_of(Scenario::ALL, Scenario::name)
}

/// The SI value of an option in a range, which `words` describe.
fn quantity(
    option: &str,
    text: &str,
    unit: Unit,
    range: impl RangeBounds<f64>,
    words: &str,
) -> Result<f64, Failure> {
    let value = WrittenQuantity::in_unit(text, unit);
    match value.map_err(|error| Failure::option(option, error))? {
        value if range.contains(&value) => Ok(value),
        _ => Err(Failure::out_of_range(option, text, words)),
    }
}

/// The numbers greater than zero.
const POSITIVE: RangeInclusive<f64> = f64::MIN_POSITIVE..=f64::MAX;

/// A number of threads that Ctrl-C can stop.
fn workers(threads: Option<usize>) -> Workers<'static> {
    threads.map_or(Workers::all(), Workers::new).stopped_by(stop::flag())
}

/// Parses a number of threads from the command line.
fn threads(text: &str) -> Result<usize, String> {
    let threads = text.parse::<NonZeroUsize>();
    threads.map(NonZeroUsize::get).map_err(|_| "a number of threads is 1 or more".into())
}

/// Reads a table, and notes an unusual dialect and left-out columns.
fn read_table(path: &Path, global: Global) -> Result<Table, Failure> {
    let table = table::read_usable(path)?;
    if let Some(dialect) = &table.origin().dialect {
        note(global, &format!("{}: read with {dialect}", path.display()));
    }
    for (_, reason) in table.origin().left_out() {
        note(global, &format!("{}: a column is left out: {reason}", path.display()));
    }
    Ok(table)
}

/// The part of a log that a command reads.
#[derive(clap::Args, Clone)]
pub(crate) struct SpanOptions {
    /// Read the log from this time on: seconds after its first sample (12.5, 2min), or a date (2026-11-21T08:15:02).
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    from: Option<String>,
    /// Read the log up to this time.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    to: Option<String>,
}

impl SpanOptions {
    /// Whether the whole log is read.
    fn is_whole(&self) -> bool {
        self.from.is_none() && self.to.is_none()
    }

    /// Reads both times.
    pub(crate) fn read(&self) -> Result<LogSpan, Failure> {
        let span = LogSpan::parse(self.from.as_deref(), self.to.as_deref());
        Ok(span.map_err(SourceError::Cut)?)
    }
}

/// Writes a remark beside the result to standard error, unless `--quiet` or `--json` is set.
fn remark(global: Global, text: &str) {
    if !global.quiet && !global.json {
        // If standard error is closed, there is no way to report that.
        let _ = writeln!(out::stderr(), "{text}");
    }
}

/// Writes a note to standard error, unless `--quiet` is set.
fn note(global: Global, text: &str) {
    if !global.quiet {
        // If standard error is closed, there is no way to report that.
        let _ = writeln!(out::stderr(), "note: {text}");
    }
}

/// Writes warnings to standard error, unless `--quiet` is set.
fn warn(global: Global, warnings: &[String]) {
    if !global.quiet {
        for warning in warnings {
            let _ = writeln!(out::stderr(), "warning: {warning}");
        }
    }
}
