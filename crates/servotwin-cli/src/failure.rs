//! Why a command ends without its result, and the exit code for it.

use crate::hint;
use crate::incomplete::Incomplete;
use servotwin::campaign::CampaignError;
use servotwin::evaluation::EvaluationError;
use servotwin::evaluation::table_model::TableModelError;
use servotwin::evaluation::traces::TraceError;
use servotwin::figure::FigureError;
use servotwin::files::FileError;
use servotwin::fit::FitError;
use servotwin::flight::band::BandError;
use servotwin::flight::runtime::RuntimeError;
use servotwin::job::JobError;
use servotwin::nearest::{UnknownName, nearest};
use servotwin::rest::{RestError, Stopped};
use servotwin::signal::{QuantityError, SignalError};
use servotwin::simulate::SimulationError;
use servotwin::study::StudyError;
use servotwin::system::{RewriteError, SystemError};
use servotwin::table::TableError;
use servotwin_watch::WatchError;
use servotwin_watch::checkpoint::CheckpointError;
use servotwin_watch::map::MapError;
use servotwin_watch::sink::SinkError;
use servotwin_watch::source::SourceError;
use servotwin_watch::span::CutError;
use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::PathBuf;

/// A file with the option that names it.
#[derive(Debug)]
pub struct Named {
    /// The option, or what is read.
    pub option: &'static str,
    /// The file.
    pub path: PathBuf,
}

/// Why a command ends without its result.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The system file is missing or has mistakes.
    #[error("{}", of_system(.0))]
    System(#[from] SystemError),
    /// The study file is missing or has mistakes.
    #[error("{}", of_study(.0))]
    Study(Box<StudyError>),
    /// A campaign could not be run or written.
    #[error("{}", hint::of_campaign(.0))]
    Campaign(CampaignError),
    /// A name that the system does not have.
    #[error("error: {name}{list}", name = .0, list = if .0.is_long() { LIST_OF_NAMES } else { "" })]
    UnknownName(#[from] UnknownName),
    /// A word that no component has.
    #[error(
        "error: no component has '{word}'; {}",
        meant(.nearest.as_deref(), "'servotwin components' lists all")
    )]
    NoComponent {
        /// The word.
        word: String,
        /// The nearest kind.
        nearest: Option<String>,
    },
    /// A word that no command has.
    #[error(
        "error: there is no command '{word}'; {}",
        meant(nearest(.word, .known.iter().map(String::as_str)), &format!("there are: {}", .known.join(", ")))
    )]
    NoCommand {
        /// The word.
        word: String,
        /// All commands.
        known: Vec<String>,
    },
    /// A file that would be overwritten.
    #[error("error: {} is there already and stays as it is", .0.display())]
    Exists(PathBuf),
    /// An output that is what the command reads.
    #[error("error: {written} would overwrite {read}, which is read: name another file")]
    Overwritten {
        /// The output.
        written: Named,
        /// What is read.
        read: Named,
    },
    /// Two outputs that are one file.
    #[error("error: {written} and {again} are the same file: name two")]
    Twice {
        /// The one.
        written: Named,
        /// The other.
        again: Named,
    },
    /// An output that ends like a file of another kind.
    #[error("error: {option} must end in .{ending}, not as {} does", .path.display())]
    Ending {
        /// The option.
        option: &'static str,
        /// The output.
        path: PathBuf,
        /// How it should end.
        ending: &'static str,
    },
    /// A simulation cannot start.
    #[error(
        "error: {}{error}",
        .option.as_ref().map_or_else(String::new, |name| format!("{name}: "))
    )]
    Simulation {
        /// The option, where one is to blame.
        option: Option<String>,
        /// What is wrong.
        error: Box<SimulationError>,
    },
    /// An option that needs `name=value`.
    #[error("error: {option} needs NAME=VALUE, not '{given}'")]
    NoEqualSign {
        /// The option.
        option: &'static str,
        /// What was written.
        given: String,
    },
    /// An input or a fault that is given twice.
    #[error("error: {option}: '{name}' is given twice")]
    Repeated {
        /// The option.
        option: &'static str,
        /// The name.
        name: String,
    },
    /// A number of an option that cannot be read.
    #[error("error: {option}: {error}")]
    Number {
        /// The option.
        option: &'static str,
        /// What is wrong.
        error: QuantityError,
    },
    /// A number of an option outside its range.
    #[error("error: {option} {given} is out of range: {range}")]
    OutOfRange {
        /// The option.
        option: &'static str,
        /// What was written.
        given: String,
        /// The range in words.
        range: Cow<'static, str>,
    },
    /// Options that do not go together.
    #[error("error: {0}")]
    Options(&'static str),
    /// A signal that cannot be built.
    #[error("error: {option}: {error}")]
    Signal {
        /// The option and the input.
        option: String,
        /// What is wrong.
        error: SignalError,
    },
    /// The solver could not finish.
    #[error("error: {0}")]
    Run(Stopped),
    /// The equations at rest give numbers that are not finite.
    #[error("error: the equations at rest give numbers that are not finite")]
    Eigenvalues,
    /// Ctrl-C.
    #[error("stopped")]
    Stopped,
    /// Ctrl-C in a job that goes on where it was when it is run again.
    #[error("stopped; the same command again goes on where it was")]
    StoppedOnTheWay,
    /// A table cannot be made or written.
    #[error("error: {0}")]
    Table(#[from] TableError),
    /// A figure cannot be written.
    #[error("error: {0}")]
    Figure(#[from] FigureError),
    /// A table does not serve for training or testing, or a model cannot be used.
    #[error("{}", hint::of_evaluation(.0))]
    Evaluation(EvaluationError),
    /// A stage of the main job stopped.
    #[error("{}", hint::of_job(.0))]
    Job(JobError),
    /// A study file for traces has mistakes, or the traces are not as it says.
    #[error("{}", hint::of_traces(.path, .error))]
    Trace {
        /// The study file.
        path: PathBuf,
        /// What is wrong.
        error: TraceError,
    },
    /// A table is not as a study file for traces, or a model, says.
    #[error("error: {path} is not as {rule} says: {error}{}", hint::for_table(.error))]
    NotAs {
        /// The table.
        path: PathBuf,
        /// The study file or the model.
        rule: PathBuf,
        /// What is wrong.
        error: Box<EvaluationError>,
    },
    /// The twin or the diagnosis could not run.
    #[error("error: {0}")]
    Runtime(RuntimeError),
    /// The diagnoser of a file is for something else.
    #[error("error: {}: {error}", .path.display())]
    Diagnoser {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        error: RuntimeError,
    },
    /// A folder has no log that can be used.
    #[error("error: {}: {reason}", .folder.display())]
    NoLogs {
        /// The folder.
        folder: PathBuf,
        /// What is there instead.
        reason: String,
    },
    /// A log has nothing that can be watched.
    #[error("error: {log}: {reason}")]
    NoSample {
        /// The log.
        log: String,
        /// What it has instead.
        reason: String,
    },
    /// A system that is none of the study which is taken where none is named.
    #[error(
        "error: tolerances and faults are a study's, and without --study those of '{study}' are taken, to which the \
         system '{system}' does not belong: give --study {}",
        .own.as_deref().unwrap_or("FILE")
    )]
    OtherSystem {
        /// The system.
        system: String,
        /// The study.
        study: String,
        /// The study of this system, where it is known.
        own: Option<String>,
    },
    /// A log of which nothing could be judged.
    #[error("error: {log}: {reason}")]
    Unjudged {
        /// The counts, for standard output.
        output: String,
        /// The log.
        log: String,
        /// Why.
        reason: String,
    },
    /// A live watch went on without files that could not be written.
    #[error("error: not complete: {}", .files.join("; "))]
    SinksLost {
        /// The counts, for standard output.
        output: String,
        /// The files, each with the reason.
        files: Vec<String>,
    },
    /// The map of a log has mistakes.
    #[error("{0}")]
    Map(#[from] MapError),
    /// A log or a stream cannot be read, or what comes of it not be written.
    #[error("{}", hint::of_watch(.0))]
    Watch(#[from] WatchError),
    /// There is no fit.
    #[error("error: {0}")]
    Fit(FitError),
    /// There is no band.
    #[error("error: {0}")]
    Band(BandError),
    /// A fitted system cannot be written.
    #[error("error: {0}")]
    Rewrite(#[from] RewriteError),
    /// A file cannot be written.
    #[error("error: {0}")]
    File(#[from] FileError),
    /// A record shows what no tolerance explains.
    #[error("{}", first_findings(.findings))]
    NoUpdate {
        /// What is known all the same, for standard output.
        output: String,
        /// What is found, as sentences.
        findings: Vec<String>,
    },
    /// A wear reaches its threshold.
    #[error("alarm: {}", .alarms.join("; "))]
    Alarm {
        /// The result all the same, for standard output.
        output: String,
        /// What reaches it, as sentences.
        alarms: Vec<String>,
    },
    /// A merge lacks parts of a campaign.
    #[error("error: {0}")]
    PartsMissing(Box<Incomplete>),
    /// Standard output cannot be written.
    #[error("error: standard output: {0}")]
    Print(io::Error),
}

impl Failure {
    /// The same of a job that goes on where it was when it is run again.
    pub fn on_the_way(self) -> Self {
        match self {
            Failure::Stopped => Failure::StoppedOnTheWay,
            other => other,
        }
    }

    /// The exit code of the program, as the head of `main.rs` lists them.
    pub fn exit_code(&self) -> u8 {
        match self {
            Failure::System(_)
            | Failure::Study(_)
            | Failure::Trace { .. }
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
            Failure::Watch(WatchError::Sink(SinkError::Target { .. })) => 2,
            Failure::Watch(WatchError::Sink(_)) => 1,
            Failure::Table(error) => of_table(error),
            Failure::Figure(FigureError::UnknownFormat { .. }) => 2,
            Failure::Campaign(error) | Failure::Job(JobError::Campaign(error)) => {
                of_campaign(error)
            }
            Failure::Job(JobError::File(FileError::Altered { .. })) => 3,
            Failure::Job(JobError::File(_) | JobError::Busy { .. }) => 1,
            Failure::Job(JobError::OtherResults { .. }) => 2,
            Failure::Job(JobError::Evaluation(error) | JobError::Unreadable { error, .. }) => {
                of_evaluation(error)
            }
            Failure::Job(_) => 3,
            Failure::Run(_)
            | Failure::Eigenvalues
            | Failure::Figure(_)
            | Failure::Runtime(_)
            | Failure::Fit(_)
            | Failure::Band(_)
            | Failure::File(_)
            | Failure::NoUpdate { .. }
            | Failure::Alarm { .. }
            | Failure::Print(_) => 1,
            Failure::PartsMissing(_) => 4,
            Failure::Stopped | Failure::StoppedOnTheWay => 130,
        }
    }
}

/// A campaign's files are its own: what is wrong with them is no mistake of an input file, unless it was damaged.
fn of_campaign(error: &CampaignError) -> u8 {
    match error {
        // A setting was asked for that the study does not have.
        CampaignError::NoSection { .. } => 2,
        CampaignError::Unfinished { damaged: Some(_), .. }
        | CampaignError::File(FileError::Altered { .. })
        | CampaignError::Table(TableError::File(FileError::Altered { .. })) => 3,
        _ => 1,
    }
}

/// What cannot be written is no mistake of an input file.
fn of_file(error: &FileError) -> u8 {
    match error {
        FileError::MissingFolder { .. }
        | FileError::DiskFull { .. }
        | FileError::ReadOnly { .. }
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
        // What an option asks for, and the table does not have.
        EvaluationError::TableModel(TableModelError::NoRow { .. })
        | EvaluationError::TooFewGroups { .. }
        | EvaluationError::Diagnosis(servotwin_diagnosis::Error::TooFewForFolds { .. }) => 2,
        _ => 3,
    }
}

/// What follows a name that a list in a message would not hold.
const LIST_OF_NAMES: &str = "; 'servotwin describe' and 'servotwin faults' list them";

impl fmt::Display for Named {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} {}", self.option, self.path.display())
    }
}

/// The name that was likely meant, or else what there is.
fn meant(nearest: Option<&str>, else_text: &str) -> String {
    nearest.map_or_else(|| else_text.to_owned(), |name| format!("did you mean '{name}'?"))
}

/// Mistakes of a file begin with their place instead of `error`.
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

/// The first findings, and how many there are.
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

impl From<BandError> for Failure {
    fn from(error: BandError) -> Self {
        match error {
            BandError::Flights(CampaignError::Cancelled) => Failure::Stopped,
            BandError::Flights(error) => Failure::Campaign(error),
            error @ BandError::TooFew { .. } => Failure::Band(error),
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
