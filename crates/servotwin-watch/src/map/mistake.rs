//! What can be wrong with a map file, in words.

use servotwin_io::document::{self, Explained, suggest};
use servotwin_model::spec::Unit;
use std::fmt;

/// What is wrong with a map file.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// With any TOML file.
    Document(document::Mistake),
    /// A name that the system does not have.
    UnknownId {
        /// Input or sensor.
        what: &'static str,
        /// The name.
        id: String,
        /// The nearest known one.
        nearest: Option<String>,
        /// All known ones.
        known: Vec<String>,
    },
    /// A unit that is not known.
    UnknownUnit {
        /// The word.
        word: String,
        /// What would do.
        known: Vec<String>,
    },
    /// The unit of something else.
    WrongUnit {
        /// The word.
        word: String,
        /// What it is for.
        id: String,
        /// Its unit.
        unit: Unit,
        /// What would do.
        known: Vec<String>,
    },
    /// Both or neither of two keys.
    OneOf {
        /// Where.
        place: String,
        /// The keys.
        keys: (&'static str, &'static str),
    },
    /// No sensor has a column.
    NoSensor,
    /// The log has no such column.
    NoColumn {
        /// The log.
        log: String,
        /// The column.
        column: String,
        /// The nearest one.
        nearest: Option<String>,
        /// All there are.
        known: Vec<String>,
    },
}

impl fmt::Display for Mistake {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mistake::Document(mistake) => write!(out, "{mistake}"),
            Mistake::UnknownId { what, id, .. } => write!(out, "the system has no {what} '{id}'"),
            Mistake::UnknownUnit { word, .. } => write!(out, "unknown unit '{word}'"),
            Mistake::WrongUnit { word, id, unit, .. } => {
                write!(out, "'{word}' is no unit of '{id}', which is in {}", unit.symbol())
            }
            Mistake::OneOf { place, keys: (one, other) } => {
                write!(out, "{place} needs either '{one}' or '{other}'")
            }
            Mistake::NoSensor => write!(out, "no sensor has a column: there is nothing to watch"),
            Mistake::NoColumn { log, column, .. } => write!(out, "{log} has no column '{column}'"),
        }
    }
}

impl Explained for Mistake {
    fn help(&self) -> Option<String> {
        match self {
            Mistake::Document(mistake) => mistake.help(),
            Mistake::UnknownId { nearest, known, .. }
            | Mistake::NoColumn { nearest, known, .. } => Some(suggest(nearest, known)),
            Mistake::UnknownUnit { known, .. } | Mistake::WrongUnit { known, .. } => {
                Some(format!("known: {}", known.join(", ")))
            }
            Mistake::OneOf { .. } => None,
            Mistake::NoSensor => Some("write: [sensors] and NAME = { column = \"…\" }".into()),
        }
    }
}

impl From<document::Mistake> for Mistake {
    fn from(mistake: document::Mistake) -> Self {
        Mistake::Document(mistake)
    }
}
