//! The reason why a command does not finish: a message and an exit code. A result that calls for a person is no failure
//! but a verdict.

use servotwin::files::FileError;
use servotwin::fit::FitError;
use servotwin::job::JobError;
use servotwin::learn::EvaluationError;
use servotwin::live::runtime::RuntimeError;
use servotwin::nearest::UnknownName;
use servotwin::recordings::RecordingError;
use servotwin::records::RunError;
use servotwin::rest::RestError;
use servotwin::signal::SignalError;
use servotwin::system::RewriteError;
use servotwin::table::TableError;
use servotwin::toml_text::Diagnostic;
use servotwin::toml_text::TomlError;
use servotwin_export::ExportError;
use servotwin_safety::SafetyError;
use servotwin_view::document::{Content, Document, Form, Table, Verdict};
use servotwin_view::row;
use servotwin_watch::WatchError;
use servotwin_watch::checkpoint::CheckpointError;
use servotwin_watch::guard::IntakeError;
use servotwin_watch::sink::SinkError;
use servotwin_watch::source::SourceError;
use servotwin_watch::span::CutError;
use std::fmt::Display;
use std::path::Path;

/// The run failed, or a result could not be written.
const FAILED: u8 = 1;
/// Wrong usage: an option, a signal, a name that the system does not have.
const USAGE: u8 = 2;
/// An input file is missing or has mistakes.
const INPUT: u8 = 3;
/// Stopped by Ctrl-C or another request to end.
pub(crate) const STOPPED: u8 = 130;

/// The reason why a command does not finish.
#[derive(Debug)]
pub(crate) struct Failure {
    /// The exit code of the program, as listed at the top of `main.rs`.
    pub exit_code: u8,
    /// What a person reads.
    pub message: String,
    /// The mistakes of a file.
    mistakes: Vec<Diagnostic>,
}

impl Failure {
    fn new(exit_code: u8, message: impl Display) -> Self {
        Failure { exit_code, message: format!("error: {message}"), mistakes: vec![] }
    }

    /// Wrong usage.
    pub(crate) fn usage(message: impl Display) -> Self {
        Failure::new(USAGE, message)
    }

    /// An option with a wrong value.
    pub(crate) fn option(option: impl Display, message: impl Display) -> Self {
        Failure::new(USAGE, format!("{option}: {message}"))
    }

    /// A value outside its range.
    pub(crate) fn out_of_range(option: &str, given: impl Display, range: impl Display) -> Self {
        Failure::new(USAGE, format!("{option} {given} is out of range: {range}"))
    }

    /// Fails if a file is there already, which a person may have written.
    pub(crate) fn if_exists(path: &Path) -> Result<(), Self> {
        match path.exists() {
            true => Err(Failure::usage(format!(
                "{} is there already and stays as it is",
                path.display()
            ))),
            false => Ok(()),
        }
    }

    /// An input that is missing or has mistakes.
    pub(crate) fn input(message: impl Display) -> Self {
        Failure::new(INPUT, message)
    }

    /// A run that failed, or a result that cannot be written.
    pub(crate) fn work(message: impl Display) -> Self {
        Failure::new(FAILED, message)
    }

    /// The user pressed Ctrl-C.
    pub(crate) fn stopped() -> Self {
        Failure { exit_code: STOPPED, message: "stopped".into(), mistakes: vec![] }
    }

    /// The failure of a job that resumes when it is run again.
    pub(crate) fn on_the_way(mut self) -> Self {
        if self.exit_code == STOPPED {
            self.message = "stopped; the same command again goes on where it was".into();
        }
        self
    }

    /// A signal of an option that cannot be built.
    pub(crate) fn signal(option: impl Display, error: &SignalError) -> Self {
        let is_file = matches!(error, SignalError::Table(_) | SignalError::Rows { .. });
        Failure::new(if is_file { INPUT } else { USAGE }, format!("{option}: {error}"))
    }

    /// A log that cannot be read with its map.
    pub(crate) fn of_intake(name: &str, error: IntakeError) -> Self {
        match error {
            IntakeError::Source(error) => error.into(),
            IntakeError::Map(error) => error.into(),
            IntakeError::Table(error) => error.into(),
            IntakeError::Record(error) => FitError::Record { name: name.into(), error }.into(),
            refused @ IntakeError::Refused { .. } => Failure::input(refused),
        }
    }

    /// Recordings that contradict their study.
    pub(crate) fn of_recordings(path: &Path, error: RecordingError) -> Self {
        match error {
            RecordingError::Evaluation(EvaluationError::Cancelled) => Failure::stopped(),
            error => Failure::input(format!("{}: {error}", path.display())),
        }
    }

    /// A diagnoser that belongs to another system.
    pub(crate) fn of_diagnoser(path: &Path, error: &RuntimeError) -> Self {
        let code = if matches!(error, RuntimeError::Twin { .. }) { FAILED } else { INPUT };
        Failure::new(code, format!("{}: {error}", path.display()))
    }

    /// Mistakes of a file, whose message begins with their place.
    fn of_mistakes(message: &impl Display, mistakes: &[Diagnostic]) -> Self {
        let (message, mistakes) = (message.to_string(), mistakes.to_vec());
        Failure { exit_code: INPUT, message, mistakes }
    }

    /// The failure for programs.
    pub(crate) fn document(&self) -> Document {
        let mut document = Document::new("failure", Verdict::act(self.message.as_str()));
        document.fact("exit_code", "", u64::from(self.exit_code));
        let mut table = Table::of("line | column | message | help");
        for Diagnostic { line, column, message, help, .. } in &self.mistakes {
            table.push(row![*line, *column, message, help.clone()]);
        }
        document.push("mistakes", Content::Table(table));
        document.formed(Form::Line)
    }
}

/// The failure of each error.
macro_rules! failures {
    ($($error:ty: |$name:ident| $failure:expr;)*) => {$(
        impl From<$error> for Failure {
            fn from($name: $error) -> Self {
                $failure
            }
        }
    )*};
}

failures! {
    RestError: |error| Failure::work(error);
    RuntimeError: |error| Failure::work(error);
    RewriteError: |error| Failure::input(error);
    TableError: |error| Failure::new(of_table(&error), error);
    FileError: |error| Failure::work(error);
    ExportError: |error| match error {
        ExportError::File(error) => error.into(),
        ExportError::FolderInUse(_) | ExportError::Damaged { .. } => Failure::usage(error),
        ExportError::NoExport(_)
        | ExportError::Classifier { .. }
        | ExportError::TooMany { .. }
        | ExportError::Unsupported(_) => Failure::input(error),
        _ => Failure::work(error),
    };
    UnknownName: |name| {
        let list = match name.is_long() {
            true => "; 'servotwin describe' and 'servotwin describe --faults' list them",
            false => "",
        };
        Failure::usage(format!("{name}{list}"))
    };
    TomlError: |error| match &error {
        TomlError::Mistakes { mistakes, .. } => Failure::of_mistakes(&error, mistakes),
        TomlError::File(error) => Failure::input(error),
    };
    RunError: |error| match &error {
        RunError::Cancelled => Failure::stopped(),
        // The study lacks a section that the named scenario needs.
        RunError::NoSection { .. } => Failure::usage(error),
        RunError::Unfinished { damaged: Some(_), .. }
        | RunError::File(FileError::Altered { .. })
        | RunError::Table(TableError::File(FileError::Altered { .. })) => {
            Failure::input(error)
        }
        _ => Failure::work(error),
    };
    FitError: |error| match error {
        FitError::Cancelled => Failure::stopped(),
        FitError::Record { .. } => Failure::input(error),
        error => Failure::work(error),
    };
    EvaluationError: |error| match &error {
        EvaluationError::Cancelled => Failure::stopped(),
        EvaluationError::File(own) => Failure::new(of_file(own), error),
        EvaluationError::Table(own) => Failure::new(of_table(own), error),
        _ => Failure::input(error),
    };
    JobError: |error| match error {
        JobError::Evaluation(error) => error.into(),
        JobError::Run(error) => error.into(),
        JobError::File(FileError::Altered { .. }) => Failure::input(error),
        JobError::File(_) | JobError::Busy { .. } => Failure::work(error),
        JobError::OtherResults { .. } => {
            Failure::usage(format!("{error} (--out), or --replace removes them"))
        }
        JobError::NoFlights | JobError::NoRun { .. } => Failure::usage(error),
        JobError::Study(error) => (*error).into(),
        JobError::NoDataSet { ref folder } => {
            let folder = folder.display();
            Failure::input(format!(
                "{error}; 'servotwin study --suite records --out {folder}' makes it"
            ))
        }
        error => Failure::input(error),
    };
    SafetyError: |error| match error {
        SafetyError::Cancelled => Failure::stopped(),
        SafetyError::Job(error) => error.into(),
        SafetyError::File(error) => error.into(),
        SafetyError::Table(error) => error.into(),
        SafetyError::Hours { .. }
        | SafetyError::SheetFormat { .. }
        | SafetyError::NoSensor { .. }
        | SafetyError::TooManySensors { .. }
        | SafetyError::NoScenario { .. }
        | SafetyError::NoFlights { .. } => Failure::usage(error),
        error => Failure::input(error),
    };
    WatchError: |error| match error {
        WatchError::Source(error) => error.into(),
        WatchError::Checkpoint(error) => error.into(),
        WatchError::Sink(error) => error.into(),
    };
    SourceError: |error| match &error {
        SourceError::Cut(CutError::NoTime { .. }) => Failure::usage(format!("--{error}")),
        SourceError::Cut(_) => Failure::input(format!("{error} (--from, --to)")),
        SourceError::Address { .. } => Failure::usage(error),
        SourceError::Connection { .. } => Failure::work(error),
        _ => Failure::input(error),
    };
    SinkError: |error| Failure::work(error);
    CheckpointError: |error| match &error {
        CheckpointError::Content { .. } => {
            Failure::input(format!("{error}; begin anew without --resume"))
        }
        _ => Failure::input(error),
    };
}

#[cfg(feature = "serve")]
failures! {
    servotwin_serve::ServeError: |error| Failure::work(error);
}

/// A failed write is no input mistake.
fn of_file(error: &FileError) -> u8 {
    match error {
        FileError::MissingFolder { .. }
        | FileError::DiskFull { .. }
        | FileError::ReadOnly { .. }
        | FileError::SizeLimit { .. }
        | FileError::System { .. } => FAILED,
        _ => INPUT,
    }
}

fn of_table(error: &TableError) -> u8 {
    match error {
        TableError::UnknownFormat { .. } => USAGE,
        TableError::File(error) => of_file(error),
        _ => INPUT,
    }
}
