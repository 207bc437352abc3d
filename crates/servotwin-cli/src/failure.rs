//! The reasons why a command fails, and their exit codes.

use crate::hint;
use servotwin::campaign::CampaignError;
use servotwin::evaluation::EvaluationError;
use servotwin::figure::FigureError;
use servotwin::files::FileError;
use servotwin::fit::FitError;
use servotwin::flight::runtime::RuntimeError;
use servotwin::job::JobError;
use servotwin::nearest::{UnknownName, nearest};
use servotwin::recordings::RecordingError;
use servotwin::rest::{RestError, Stopped};
use servotwin::signal::{QuantityError, SignalError};
use servotwin::simulate::SimulationError;
use servotwin::study::StudyError;
use servotwin::system::{RewriteError, SystemError};
use servotwin::table::TableError;
use servotwin_export::ExportError;
use servotwin_safety::SafetyError;
use servotwin_watch::WatchError;
use servotwin_watch::checkpoint::CheckpointError;
use servotwin_watch::guard::IntakeError;
use servotwin_watch::map::MapError;
use servotwin_watch::sink::SinkError;
use servotwin_watch::source::SourceError;
use servotwin_watch::span::CutError;
use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::PathBuf;

/// A file, with the option that names it.
#[derive(Debug)]
pub(crate) struct Named {
    /// The option, or a description of the file.
    pub option: &'static str,
    pub path: PathBuf,
}

/// The reason why a command fails.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// The system file is missing or has mistakes.
    #[error("{}", of_system(.0))]
    System(#[from] SystemError),
    /// The study file is missing or has mistakes.
    #[error("{}", of_study(.0))]
    Study(Box<StudyError>),
    /// The live page cannot be served.
    #[cfg(feature = "serve")]
    #[error("error: {0}")]
    Serve(#[from] servotwin_serve::ServeError),
    /// A campaign could not be simulated or written.
    #[error("error: {0}")]
    Campaign(CampaignError),
    /// A name that the system does not have.
    #[error("error: {name}{list}", name = .0, list = if .0.is_long() { LIST_OF_NAMES } else { "" })]
    UnknownName(#[from] UnknownName),
    /// A word that no component has.
    #[error(
        "error: no component has '{word}'; {}",
        meant(.nearest.as_deref(), "'servotwin catalog' lists all")
    )]
    NoComponent { word: String, nearest: Option<String> },
    /// A word that no command has.
    #[error(
        "error: there is no command '{word}'; {}",
        meant(nearest(.word, .known.iter().map(String::as_str)), &format!("there are: {}", .known.join(", ")))
    )]
    NoCommand { word: String, known: Vec<String> },
    /// An output file exists already and would be overwritten.
    #[error("error: {} is there already and stays as it is", .0.display())]
    Exists(PathBuf),
    /// An output file is also an input of the command.
    #[error("error: {written} would overwrite {read}, which is read: name another file")]
    Overwritten { written: Named, read: Named },
    /// Two outputs are the same file.
    #[error("error: {written} and {again} are the same file: name two")]
    Twice { written: Named, again: Named },
    /// An output has the extension of another kind of file.
    #[error("error: {option} must end in .{ending}, not as {} does", .path.display())]
    Ending { option: &'static str, path: PathBuf, ending: &'static str },
    /// A simulation cannot start.
    #[error(
        "error: {}{error}",
        .option.as_ref().map_or_else(String::new, |name| format!("{name}: "))
    )]
    Simulation { option: Option<String>, error: Box<SimulationError> },
    /// An option that requires `name=value`.
    #[error("error: {option} needs NAME=VALUE, not '{given}'")]
    NoEqualSign { option: &'static str, given: String },
    /// An input or a fault that is given twice.
    #[error("error: {option}: '{name}' is given twice")]
    Repeated { option: &'static str, name: String },
    /// An option's number that cannot be parsed.
    #[error("error: {option}: {error}")]
    Number { option: &'static str, error: QuantityError },
    /// An option's number outside its range.
    #[error("error: {option} {given} is out of range: {range}")]
    OutOfRange { option: &'static str, given: String, range: Cow<'static, str> },
    /// A wrong combination of options.
    #[error("error: {0}")]
    Options(&'static str),
    /// A signal that cannot be built.
    #[error("error: {option}: {error}")]
    Signal { option: String, error: SignalError },
    /// The solver could not finish.
    #[error("error: {0}")]
    Run(Stopped),
    /// The equations at rest produce numbers that are not finite.
    #[error("error: the equations at rest give numbers that are not finite")]
    Eigenvalues,
    /// The user pressed Ctrl-C.
    #[error("stopped")]
    Stopped,
    /// The user pressed Ctrl-C in a job that resumes when it is run again.
    #[error("stopped; the same command again goes on where it was")]
    StoppedOnTheWay,
    /// A table cannot be made or written.
    #[error("error: {0}")]
    Table(#[from] TableError),
    /// A figure cannot be written.
    #[error("error: {0}")]
    Figure(#[from] FigureError),
    /// A data set or a model is unusable.
    #[error("error: {0}")]
    Evaluation(EvaluationError),
    /// A stage of the main job stopped.
    #[error("{}", hint::of_job(.0))]
    Job(JobError),
    /// A study file of recordings has mistakes, or the recordings contradict it.
    #[error("{}", hint::of_recordings(.path, .error))]
    Recording { path: PathBuf, error: RecordingError },
    /// A table contradicts a study file of recordings.
    #[error("error: {path} does not follow {study}: {error}")]
    NotAs { path: PathBuf, study: PathBuf, error: Box<EvaluationError> },
    /// The twin or the diagnosis could not run.
    #[error("error: {0}")]
    Runtime(RuntimeError),
    /// The diagnoser in a file belongs to another system.
    #[error("error: {}: {error}", .path.display())]
    Diagnoser { path: PathBuf, error: RuntimeError },
    /// A folder has no usable log.
    #[error("error: {}: {reason}", .folder.display())]
    NoLogs { folder: PathBuf, reason: String },
    /// A log without samples to watch.
    #[error("error: {log}: {reason}")]
    NoSample { log: String, reason: String },
    /// A system that does not belong to the default study.
    #[error(
        "error: tolerances and faults are a study's, and without --study those of '{study}' are taken, to which the \
         system '{system}' does not belong: give --study {}",
        .own.as_deref().unwrap_or("FILE")
    )]
    OtherSystem { system: String, study: String, own: Option<String> },
    /// A log in which no sample was judged.
    #[error("error: {log}: {reason}")]
    Unjudged { output: String, log: String, reason: String },
    /// An export cannot be written or proven.
    #[error("error: {0}")]
    Export(#[from] ExportError),
    /// An export is not that of its diagnoser, or decides otherwise.
    #[error("error: the export in {} is not proven", .folder.display())]
    NotProven { folder: PathBuf, output: String },
    /// A live watch continued after some files could not be written.
    #[error("error: not complete: {}", .files.join("; "))]
    SinksLost { output: String, files: Vec<String> },
    /// The map of a log has mistakes.
    #[error("{0}")]
    Map(#[from] MapError),
    /// A log or stream cannot be read, or its outputs cannot be written.
    #[error("{}", hint::of_watch(.0))]
    Watch(#[from] WatchError),
    /// A fit failed.
    #[error("error: {0}")]
    Fit(FitError),
    /// A fitted system cannot be written.
    #[error("error: {0}")]
    Rewrite(#[from] RewriteError),
    /// An artefact of the safety case cannot be made.
    #[error("error: {0}")]
    Safety(SafetyError),
    /// A file cannot be written.
    #[error("error: {0}")]
    File(#[from] FileError),
    /// A record has findings that no tolerance explains, so the twin is not updated.
    #[error("{}", first_findings(.findings))]
    NoUpdate { output: String, findings: Vec<String> },
    /// Wear reaches its threshold.
    #[error("alarm: {}", .alarms.join("; "))]
    Alarm { output: String, alarms: Vec<String> },
    /// Standard output cannot be written.
    #[error("error: standard output: {0}")]
    Print(io::Error),
}

impl Failure {
    /// Turns `Stopped` into the failure of a job that resumes when it is run again.
    pub(crate) fn on_the_way(self) -> Self {
        match self {
            Failure::Stopped => Failure::StoppedOnTheWay,
            other => other,
        }
    }

    /// The failure of a log that cannot be read with its map.
    pub(crate) fn of_intake(name: &str, error: IntakeError) -> Self {
        match error {
            IntakeError::Source(error) => error.into(),
            IntakeError::Map(error) => error.into(),
            IntakeError::Table(error) => error.into(),
            IntakeError::Record(error) => {
                Failure::Fit(FitError::Record { name: name.into(), error })
            }
            IntakeError::Refused { log, reason } => Failure::NoSample { log, reason },
        }
    }

    /// The exit code of the program, as listed at the top of `main.rs`.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Failure::System(_)
            | Failure::Study(_)
            | Failure::Recording { .. }
            | Failure::NotAs { .. }
            | Failure::NoLogs { .. }
            | Failure::NoSample { .. }
            | Failure::OtherSystem { .. }
            | Failure::Unjudged { .. } => 3,
            Failure::Diagnoser { error: RuntimeError::Twin { .. }, .. } => 1,
            Failure::Diagnoser { .. } => 3,
            Failure::Evaluation(error) => of_evaluation(error),
            Failure::Signal { error: SignalError::Table(_) | SignalError::Rows { .. }, .. } => 3,
            Failure::UnknownName(_)
            | Failure::NoComponent { .. }
            | Failure::NoCommand { .. }
            | Failure::Exists(_)
            | Failure::Overwritten { .. }
            | Failure::Twice { .. }
            | Failure::Ending { .. }
            | Failure::Simulation { .. }
            | Failure::NoEqualSign { .. }
            | Failure::Repeated { .. }
            | Failure::Number { .. }
            | Failure::OutOfRange { .. }
            | Failure::Options(_)
            | Failure::Signal { .. } => 2,
            Failure::SinksLost { .. } => 1,
            #[cfg(feature = "serve")]
            Failure::Serve(servotwin_serve::ServeError::Session(_)) => 3,
            #[cfg(feature = "serve")]
            Failure::Serve(_) => 1,
            Failure::Map(_) => 3,
            Failure::Fit(FitError::Record { .. }) | Failure::Rewrite(_) => 3,
            Failure::Watch(WatchError::Source(
                SourceError::Address { .. }
                | SourceError::Feature { .. }
                | SourceError::Cut(CutError::NoTime { .. }),
            )) => 2,
            Failure::Watch(WatchError::Source(SourceError::Connection { .. })) => 1,
            Failure::Watch(WatchError::Source(_)) => 3,
            Failure::Watch(WatchError::Checkpoint(CheckpointError::File(_))) => 1,
            Failure::Watch(WatchError::Checkpoint(_)) => 3,
            Failure::Watch(WatchError::Sink(_)) => 1,
            Failure::Table(error) => of_table(error),
            Failure::Figure(FigureError::UnknownFormat { .. }) => 2,
            Failure::Campaign(error) | Failure::Job(JobError::Campaign(error)) => {
                of_campaign(error)
            }
            Failure::Job(JobError::File(FileError::Altered { .. })) => 3,
            Failure::Job(JobError::File(_) | JobError::Busy { .. }) => 1,
            Failure::Job(
                JobError::OtherResults { .. } | JobError::NoFlights | JobError::NoRun { .. },
            ) => 2,
            Failure::Job(JobError::Evaluation(error)) => of_evaluation(error),
            Failure::Job(_) => 3,
            Failure::Run(_)
            | Failure::Eigenvalues
            | Failure::Figure(_)
            | Failure::Runtime(_)
            | Failure::Fit(_)
            | Failure::File(_)
            | Failure::NoUpdate { .. }
            | Failure::Alarm { .. }
            | Failure::Print(_) => 1,
            Failure::Safety(error) => of_safety(error),
            Failure::Export(error) => of_export(error),
            Failure::NotProven { .. } => 1,
            Failure::Stopped | Failure::StoppedOnTheWay => 130,
        }
    }
}

/// The exit code for a campaign. Its files are written by servotwin, so they are no input mistake unless damaged.
fn of_campaign(error: &CampaignError) -> u8 {
    match error {
        // The study lacks a section that the named scenario needs.
        CampaignError::NoSection { .. } => 2,
        CampaignError::Unfinished { damaged: Some(_), .. }
        | CampaignError::File(FileError::Altered { .. })
        | CampaignError::Table(TableError::File(FileError::Altered { .. })) => 3,
        _ => 1,
    }
}

/// The exit code for an artefact of the safety case.
fn of_export(error: &ExportError) -> u8 {
    match error {
        ExportError::FolderInUse(_) | ExportError::Damaged { .. } => 2,
        ExportError::File(error) => of_file(error),
        ExportError::NoExport(_)
        | ExportError::Classifier { .. }
        | ExportError::TooMany { .. }
        | ExportError::Unsupported(_) => 3,
        _ => 1,
    }
}

fn of_safety(error: &SafetyError) -> u8 {
    match error {
        SafetyError::Hours { .. }
        | SafetyError::SheetFormat { .. }
        | SafetyError::NoSensor { .. }
        | SafetyError::TooManySensors { .. }
        | SafetyError::NoScenario { .. }
        | SafetyError::NoFlights { .. } => 2,
        SafetyError::File(error) => of_file(error),
        SafetyError::Table(error) => of_table(error),
        _ => 3,
    }
}

/// The exit code for a file. A failed write is no input mistake.
fn of_file(error: &FileError) -> u8 {
    match error {
        FileError::MissingFolder { .. }
        | FileError::DiskFull { .. }
        | FileError::ReadOnly { .. }
        | FileError::SizeLimit { .. }
        | FileError::System { .. } => 1,
        _ => 3,
    }
}

fn of_table(error: &TableError) -> u8 {
    match error {
        TableError::UnknownFormat { .. } => 2,
        TableError::File(error) => of_file(error),
        _ => 3,
    }
}

fn of_evaluation(error: &EvaluationError) -> u8 {
    match error {
        EvaluationError::File(error) => of_file(error),
        EvaluationError::Table(error) => of_table(error),
        _ => 3,
    }
}

/// The hint after a name whose list of alternatives is too long for a message.
const LIST_OF_NAMES: &str = "; 'servotwin describe' and 'servotwin describe --faults' list them";

impl fmt::Display for Named {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} {}", self.option, self.path.display())
    }
}

/// Suggests the name that was probably meant, or else the given text.
fn meant(nearest: Option<&str>, else_text: &str) -> String {
    nearest.map_or_else(|| else_text.to_owned(), |name| format!("did you mean '{name}'?"))
}

/// Formats an error of a system. Mistakes in a file begin with their place instead of `error`.
fn of_system(error: &SystemError) -> String {
    match error {
        SystemError::File(error) => format!("error: {error}"),
        error => error.to_string(),
    }
}

fn of_study(error: &StudyError) -> String {
    match error {
        StudyError::File(error) => format!("error: {error}"),
        error => error.to_string(),
    }
}

/// Lists the first findings, and counts the others.
fn first_findings(findings: &[String]) -> String {
    const SHOWN: usize = 4;
    let mut text =
        "error: no update, nothing is written: the record shows what no tolerance explains"
            .to_owned();
    for finding in findings.iter().take(SHOWN) {
        text += &format!("\n  {finding}");
    }
    match findings.len().saturating_sub(SHOWN) {
        0 => {}
        more => text += &format!("\n  and {more} more"),
    }
    text
}

impl From<RestError> for Failure {
    fn from(error: RestError) -> Self {
        match error {
            RestError::Stopped(stopped) => Failure::Run(stopped),
            RestError::NotFinite => Failure::Eigenvalues,
        }
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        Failure::Study(Box::new(error))
    }
}

impl From<CampaignError> for Failure {
    fn from(error: CampaignError) -> Self {
        match error {
            CampaignError::Cancelled => Failure::Stopped,
            error => Failure::Campaign(error),
        }
    }
}

impl From<FitError> for Failure {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Cancelled => Failure::Stopped,
            error => Failure::Fit(error),
        }
    }
}

impl From<EvaluationError> for Failure {
    fn from(error: EvaluationError) -> Self {
        match error {
            EvaluationError::Cancelled => Failure::Stopped,
            error => Failure::Evaluation(error),
        }
    }
}

impl From<JobError> for Failure {
    fn from(error: JobError) -> Self {
        match error {
            JobError::Evaluation(EvaluationError::Cancelled)
            | JobError::Campaign(CampaignError::Cancelled) => Failure::Stopped,
            error => Failure::Job(error),
        }
    }
}

impl From<SafetyError> for Failure {
    fn from(error: SafetyError) -> Self {
        match error {
            SafetyError::Cancelled => Failure::Stopped,
            SafetyError::Job(error) => error.into(),
            error => Failure::Safety(error),
        }
    }
}

impl From<SourceError> for Failure {
    fn from(error: SourceError) -> Self {
        Failure::Watch(error.into())
    }
}

impl From<SinkError> for Failure {
    fn from(error: SinkError) -> Self {
        Failure::Watch(error.into())
    }
}

impl From<CheckpointError> for Failure {
    fn from(error: CheckpointError) -> Self {
        Failure::Watch(error.into())
    }
}
