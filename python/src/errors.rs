//! Errors of the toolkit as exceptions of `servotwin.errors`, with file, line and range.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotwin::files::FileError;
use servotwin::nearest::{UnknownName, nearest};
use servotwin::rest::{RestError, Stopped};
use servotwin::signal::{QuantityError, SignalError};
use servotwin::table::{ContentError, TableError};
use servotwin::toml_text::Diagnostic;
use servotwin::toml_text::TomlError;
use std::fmt::Display;

/// What is known of an error besides its message.
#[derive(Clone, Debug)]
enum Detail {
    Text(String),
    Count(usize),
    Number(f64),
    Range(f64, f64),
    Names(Vec<String>),
    Mistakes(Vec<Place>),
}

/// A mistake of a file.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    file: String,
    mistake: Diagnostic,
}

impl Place {
    /// A mistake of the file with this path.
    pub(crate) fn new(file: &str, mistake: Diagnostic) -> Self {
        Place { file: file.into(), mistake }
    }

    /// The Python object.
    pub(crate) fn to_python<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let class = py.import("servotwin.errors")?.getattr("Mistake")?;
        let Diagnostic { line, column, width, message, help, range, allowed, .. } = &self.mistake;
        let (help, allowed) = (help.as_ref(), allowed.as_ref());
        class.call1((&self.file, *line, *column, *width, message, help, *range, allowed))
    }
}

/// An error on its way to Python.
#[derive(Clone, Debug)]
pub(crate) struct Failure {
    class: &'static str,
    message: String,
    details: Vec<(&'static str, Detail)>,
}

impl Failure {
    fn new(class: &'static str, message: impl Display) -> Self {
        Failure { class, message: message.to_string(), details: vec![] }
    }

    /// A value that is not as it must be.
    pub(crate) fn value(message: impl Display) -> Self {
        Self::new("InputError", message)
    }

    /// A number outside its range.
    pub(crate) fn range(name: &str, value: f64, (least, largest): (f64, f64), unit: &str) -> Self {
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let text = format!("{name} is {value}{unit}, but must be within {least} … {largest}{unit}");
        Self::value(text).within((least, largest))
    }

    /// A column that a table does not have.
    pub(crate) fn no_column(given: &str, known: Vec<String>) -> Self {
        let near = nearest(given, known.iter().map(String::as_str)).map(str::to_owned);
        let hint =
            near.as_ref().map_or_else(String::new, |name| format!("; did you mean '{name}'?"));
        unknown(format!("the table has no column '{given}'{hint}"), given.into(), near, known)
    }

    /// The same error with what is allowed.
    pub(crate) fn within(self, (least, largest): (f64, f64)) -> Self {
        self.with("range", Detail::Range(least, largest))
    }

    /// The same error with a word in front, such as the input that it is about.
    pub(crate) fn about(mut self, what: &str) -> Self {
        self.message = format!("{what}: {}", self.message);
        self
    }

    fn with(mut self, name: &'static str, detail: Detail) -> Self {
        self.details.push((name, detail));
        self
    }

    /// A stage of a study that cannot be done.
    pub(crate) fn stage(message: impl Display) -> Self {
        Self::new("StageError", message)
    }

    /// The same error with the file that it is about.
    pub(crate) fn in_file(self, file: impl Display) -> Self {
        self.with("file", Detail::Text(file.to_string()))
    }

    fn to_python(&self, py: Python<'_>) -> PyResult<PyErr> {
        let class = py.import("servotwin.errors")?.getattr(self.class)?;
        let details = PyDict::new(py);
        for (name, detail) in &self.details {
            match detail {
                Detail::Text(text) => details.set_item(name, text)?,
                Detail::Count(count) => details.set_item(name, count)?,
                Detail::Number(number) => details.set_item(name, number)?,
                Detail::Range(least, largest) => details.set_item(name, (least, largest))?,
                Detail::Names(names) => details.set_item(name, names)?,
                Detail::Mistakes(places) => {
                    let places = places.iter().map(|place| place.to_python(py));
                    details.set_item(name, places.collect::<PyResult<Vec<_>>>()?)?;
                }
            }
        }
        Ok(PyErr::from_value(class.call((&self.message,), Some(&details))?))
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| failure.to_python(py).unwrap_or_else(|error| error))
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        let class = match error {
            FileError::Missing { .. } | FileError::MissingFolder { .. } => "MissingFileError",
            _ => "FileError",
        };
        let failure = Failure::new(class, &error).in_file(error.path().display());
        match error {
            FileError::NotText { line, .. } => failure.with("line", Detail::Count(line)),
            _ => failure,
        }
    }
}

impl From<TomlError> for Failure {
    fn from(error: TomlError) -> Self {
        let message = error.to_string();
        match error {
            TomlError::File(error) => error.into(),
            TomlError::Mistakes { path, mistakes } => self::mistakes(message, &path, mistakes),
        }
    }
}

/// All mistakes of a file; what is known of the first is known of the error.
fn mistakes(message: String, path: &str, mistakes: Vec<Diagnostic>) -> Failure {
    let mut failure = Failure::new("MistakesError", message).in_file(path);
    if let Some(first) = mistakes.first() {
        failure = failure
            .with("line", Detail::Count(first.line))
            .with("column", Detail::Count(first.column));
        if let Some((least, largest)) = first.range {
            failure = failure.with("range", Detail::Range(least, largest));
        }
        if let Some(allowed) = &first.allowed {
            failure = failure.with("allowed", Detail::Text(allowed.clone()));
        }
    }
    let place = |mistake| Place::new(path, mistake);
    failure.with("mistakes", Detail::Mistakes(mistakes.into_iter().map(place).collect()))
}

impl From<TableError> for Failure {
    fn from(error: TableError) -> Self {
        let message = error.to_string();
        match error {
            TableError::File(error) => error.into(),
            TableError::UnknownFormat { path } => Self::value(message).in_file(path.display()),
            TableError::Content { path, problem } => {
                let failure = Failure::new("MistakesError", message).in_file(path.display());
                match problem {
                    ContentError::Line { line, .. } => failure.with("line", Detail::Count(line)),
                    _ => failure,
                }
            }
            TableError::UnknownColumn { column, nearest, known } => {
                unknown(message, column, nearest, known)
            }
            _ => Self::value(message),
        }
    }
}

fn unknown(message: String, given: String, nearest: Option<String>, known: Vec<String>) -> Failure {
    let failure = Failure::new("UnknownNameError", message).with("given", Detail::Text(given));
    let failure = failure.with("known", Detail::Names(known));
    match nearest {
        Some(nearest) => failure.with("nearest", Detail::Text(nearest)),
        None => failure,
    }
}

impl From<UnknownName> for Failure {
    fn from(error: UnknownName) -> Self {
        let nearest = error.nearest().map(str::to_owned);
        unknown(error.to_string(), error.given, nearest, error.known)
    }
}

impl From<Stopped> for Failure {
    fn from(stopped: Stopped) -> Self {
        Failure::new("RunError", &stopped)
            .with("time_s", Detail::Number(stopped.time_s))
            .with("state", Detail::Text(stopped.state))
    }
}

impl From<RestError> for Failure {
    fn from(error: RestError) -> Self {
        match error {
            RestError::Stopped(stopped) => stopped.into(),
            RestError::NotFinite => Failure::new("RunError", error),
        }
    }
}

impl From<SignalError> for Failure {
    fn from(error: SignalError) -> Self {
        match error {
            SignalError::Table(error) => (*error).into(),
            error => Self::value(error),
        }
    }
}

impl From<QuantityError> for Failure {
    fn from(error: QuantityError) -> Self {
        Self::value(error)
    }
}
