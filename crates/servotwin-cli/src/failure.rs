//! Why a command ends without its result, and the exit code for it.

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
#[derive(Debug)]
pub enum Failure {
    /// The system file is missing or has mistakes.
    System(SystemError),
    /// The study file is missing or has mistakes.
    Study(Box<StudyError>),
    /// A campaign could not be run or written.
    Campaign(CampaignError),
    /// A name that the system does not have.
    UnknownName(UnknownName),
    /// A word that no component has.
    NoComponent {
        /// The word.
        word: String,
        /// The nearest kind.
        nearest: Option<String>,
    },
    /// A word that no command has.
    NoCommand {
        /// The word.
        word: String,
        /// All commands.
        known: Vec<String>,
    },
    /// A file that would be overwritten.
    Exists(PathBuf),
    /// An output that is what the command reads.
    Overwritten {
        /// The output.
        written: Named,
        /// What is read.
        read: Named,
    },
    /// Two outputs that are one file.
    Twice {
        /// The one.
        written: Named,
        /// The other.
        again: Named,
    },
    /// An output that ends like a file of another kind.
    Ending {
        /// The option.
        option: &'static str,
        /// The output.
        path: PathBuf,
        /// How it should end.
        ending: &'static str,
    },
    /// A simulation cannot start.
    Simulation {
        /// The option, where one is to blame.
        option: Option<String>,
        /// What is wrong.
        error: Box<SimulationError>,
    },
    /// An option that needs `name=value`.
    NoEqualSign {
        /// The option.
        option: &'static str,
        /// What was written.
        given: String,
    },
    /// An input or a fault that is given twice.
    Repeated {
        /// The option.
        option: &'static str,
        /// The name.
        name: String,
    },
    /// A number of an option that cannot be read.
    Number {
        /// The option.
        option: &'static str,
        /// What is wrong.
        error: QuantityError,
    },
    /// A number of an option outside its range.
    OutOfRange {
        /// The option.
        option: &'static str,
        /// What was written.
        given: String,
        /// The range in words.
        range: Cow<'static, str>,
    },
    /// Options that do not go together.
    Options(&'static str),
    /// A signal that cannot be built.
    Signal {
        /// The option and the input.
        option: String,
        /// What is wrong.
        error: SignalError,
    },
    /// The solver could not finish.
    Run(Stopped),
    /// The equations at rest give numbers that are not finite.
    Eigenvalues,
    /// Ctrl-C.
    Stopped,
    /// Ctrl-C in a job that goes on where it was when it is run again.
    StoppedOnTheWay,
    /// A table cannot be made or written.
    Table(TableError),
    /// A figure cannot be written.
    Figure(FigureError),
    /// A table does not serve for training or testing, or a model cannot be used.
    Evaluation(EvaluationError),
    /// A stage of the main job stopped.
    Job(JobError),
    /// A study file for traces has mistakes, or the traces are not as it says.
    Trace {
        /// The study file.
        path: PathBuf,
        /// What is wrong.
        error: TraceError,
    },
    /// A table is not as a study file for traces, or a model, says.
    NotAs {
        /// The table.
        path: PathBuf,
        /// The study file or the model.
        rule: PathBuf,
        /// What is wrong.
        error: Box<EvaluationError>,
    },
    /// The twin or the diagnosis could not run.
    Runtime(RuntimeError),
    /// The diagnoser of a file is for something else.
    Diagnoser {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        error: RuntimeError,
    },
    /// A folder has no log that can be used.
    NoLogs {
        /// The folder.
        folder: PathBuf,
        /// What is there instead.
        reason: String,
    },
    /// A log has nothing that can be watched.
    NoSample {
        /// The log.
        log: String,
        /// What it has instead.
        reason: String,
    },
    /// A system that is none of the study which is taken where none is named.
    OtherSystem {
        /// The system.
        system: String,
        /// The study.
        study: String,
        /// The study of this system, where it is known.
        own: Option<String>,
    },
    /// A log of which nothing could be judged.
    Unjudged {
        /// The counts, for standard output.
        output: String,
        /// The log.
        log: String,
        /// Why.
        reason: String,
    },
    /// A live watch went on without files that could not be written.
    SinksLost {
        /// The counts, for standard output.
        output: String,
        /// The files, each with the reason.
        files: Vec<String>,
    },
    /// The map of a log has mistakes.
    Map(MapError),
    /// A log or a stream cannot be read, or what comes of it not be written.
    Watch(WatchError),
    /// There is no fit.
    Fit(FitError),
    /// There is no band.
    Band(BandError),
    /// A fitted system cannot be written.
    Rewrite(RewriteError),
    /// A file cannot be written.
    File(FileError),
    /// A record shows what no tolerance explains.
    NoUpdate {
        /// What is known all the same, for standard output.
        output: String,
        /// What is found, as sentences.
        findings: Vec<String>,
    },
    /// A wear reaches its threshold.
    Alarm {
        /// The result all the same, for standard output.
        output: String,
        /// What reaches it, as sentences.
        alarms: Vec<String>,
    },
    /// A merge lacks parts of a campaign.
    PartsMissing(Box<Incomplete>),
    /// Standard output cannot be written.
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

impl fmt::Display for Failure {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::System(SystemError::File(error)) => write!(out, "error: {error}"),
            Failure::System(error) => write!(out, "{error}"),
            Failure::Study(error) => match error.as_ref() {
                StudyError::File(error) => write!(out, "error: {error}"),
                error => write!(out, "{error}"),
            },
            Failure::Campaign(error) => write!(out, "error: {error}"),
            Failure::UnknownName(error) => {
                let list = "; 'servotwin describe' and 'servotwin faults' list them";
                write!(out, "error: {error}{}", if error.is_long() { list } else { "" })
            }
            Failure::NoComponent { word, nearest } => {
                write!(out, "error: no component has '{word}'")?;
                match nearest {
                    Some(kind) => write!(out, "; did you mean '{kind}'?"),
                    None => write!(out, "; 'servotwin components' lists all"),
                }
            }
            Failure::NoCommand { word, known } => {
                write!(out, "error: there is no command '{word}'; ")?;
                match nearest(word, known.iter().map(String::as_str)) {
                    Some(name) => write!(out, "did you mean '{name}'?"),
                    None => write!(out, "there are: {}", known.join(", ")),
                }
            }
            Failure::Exists(path) => {
                write!(out, "error: {} is there already and stays as it is", path.display())
            }
            Failure::Overwritten { written, read } => {
                let (path, other) = (written.path.display(), read.path.display());
                write!(
                    out,
                    "error: {} {path} would overwrite {} {other}, which is read: name another file",
                    written.option, read.option
                )
            }
            Failure::Twice { written, again } => {
                let (path, other) = (written.path.display(), again.path.display());
                write!(
                    out,
                    "error: {} {path} and {} {other} are the same file: name two",
                    written.option, again.option
                )
            }
            Failure::Ending { option, path, ending } => {
                write!(out, "error: {option} must end in .{ending}, not as {} does", path.display())
            }
            Failure::Simulation { option, error } => {
                let option = option.as_ref().map_or_else(String::new, |name| format!("{name}: "));
                write!(out, "error: {option}{error}")
            }
            Failure::NoEqualSign { option, given } => {
                write!(out, "error: {option} needs NAME=VALUE, not '{given}'")
            }
            Failure::Repeated { option, name } => {
                write!(out, "error: {option}: '{name}' is given twice")
            }
            Failure::Number { option, error } => write!(out, "error: {option}: {error}"),
            Failure::OutOfRange { option, given, range } => {
                write!(out, "error: {option} {given} is out of range: {range}")
            }
            Failure::Options(reason) => write!(out, "error: {reason}"),
            Failure::Signal { option, error } => write!(out, "error: {option}: {error}"),
            Failure::Run(stopped) => write!(out, "error: {stopped}"),
            Failure::Eigenvalues => {
                write!(out, "error: the equations at rest give numbers that are not finite")
            }
            Failure::Stopped => write!(out, "stopped"),
            Failure::StoppedOnTheWay => {
                write!(out, "stopped; the same command again goes on where it was")
            }
            Failure::Table(error) => write!(out, "error: {error}"),
            Failure::Figure(error) => write!(out, "error: {error}"),
            Failure::Evaluation(error) => write!(out, "error: {error}"),
            Failure::Job(JobError::Study(error)) => write!(out, "{error}"),
            Failure::Job(error) => write!(out, "error: {error}"),
            Failure::Trace { path, error } => write!(out, "error: {}: {error}", path.display()),
            Failure::NotAs { path, rule, error } => {
                let (path, rule) = (path.display(), rule.display());
                write!(out, "error: {path} is not as {rule} says: {error}")
            }
            Failure::Runtime(error) => write!(out, "error: {error}"),
            Failure::Diagnoser { path, error } => write!(out, "error: {}: {error}", path.display()),
            Failure::NoLogs { folder, reason } => {
                write!(out, "error: {}: {reason}", folder.display())
            }
            Failure::SinksLost { files, .. } => {
                write!(out, "error: not complete: {}", files.join("; "))
            }
            Failure::NoSample { log, reason } | Failure::Unjudged { log, reason, .. } => {
                write!(out, "error: {log}: {reason}")
            }
            Failure::OtherSystem { system, study, own } => {
                let own = own.as_deref().unwrap_or("FILE");
                write!(
                    out,
                    "error: tolerances and faults are a study's, and without --study those of '{study}' \
                     are taken, to which the system '{system}' does not belong: give --study {own}"
                )
            }
            Failure::Map(error) => write!(out, "{error}"),
            Failure::Watch(error) => write!(out, "error: {error}"),
            Failure::Fit(error) => write!(out, "error: {error}"),
            Failure::Band(error) => write!(out, "error: {error}"),
            Failure::Rewrite(error) => write!(out, "error: {error}"),
            Failure::File(error) => write!(out, "error: {error}"),
            Failure::NoUpdate { findings, .. } => write_findings(out, findings),
            Failure::Alarm { alarms, .. } => write!(out, "alarm: {}", alarms.join("; ")),
            Failure::PartsMissing(missing) => write!(out, "error: {missing}"),
            Failure::Print(error) => write!(out, "error: standard output: {error}"),
        }
    }
}

/// The first findings, and how many there are.
fn write_findings(out: &mut fmt::Formatter<'_>, findings: &[String]) -> fmt::Result {
    const SHOWN: usize = 4;
    write!(
        out,
        "error: no update, nothing is written: the record shows what no tolerance explains"
    )?;
    for finding in findings.iter().take(SHOWN) {
        write!(out, "\n  {finding}")?;
    }
    match findings.len().saturating_sub(SHOWN) {
        0 => Ok(()),
        more => write!(out, "\n  and {more} more"),
    }
}

impl From<UnknownName> for Failure {
    fn from(error: UnknownName) -> Self {
        Failure::UnknownName(error)
    }
}

impl From<RestError> for Failure {
    fn from(error: RestError) -> Self {
        match error {
            RestError::Stopped(stopped) => Failure::Run(stopped),
            RestError::NotFinite => Failure::Eigenvalues,
        }
    }
}

impl From<SystemError> for Failure {
    fn from(error: SystemError) -> Self {
        Failure::System(error)
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

impl From<RewriteError> for Failure {
    fn from(error: RewriteError) -> Self {
        Failure::Rewrite(error)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Failure::File(error)
    }
}

impl From<TableError> for Failure {
    fn from(error: TableError) -> Self {
        Failure::Table(error)
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

impl From<FigureError> for Failure {
    fn from(error: FigureError) -> Self {
        Failure::Figure(error)
    }
}

impl From<MapError> for Failure {
    fn from(error: MapError) -> Self {
        Failure::Map(error)
    }
}

impl From<WatchError> for Failure {
    fn from(error: WatchError) -> Self {
        Failure::Watch(error)
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
