//! Mistakes in a map file and their messages.

use servotwin_io::document::{self, Explained, suggest};
use servotwin_model::spec::Unit;

/// A mistake in a map file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum Mistake {
    /// A mistake that any TOML file can have.
    #[error("{0}")]
    Document(document::TomlMistake),
    /// A name that the system does not have.
    #[error("the system has no {what} '{id}'")]
    UnknownId { what: &'static str, id: String, nearest: Option<String>, known: Vec<String> },
    /// A unit that is not known.
    #[error("unknown unit '{word}'")]
    UnknownUnit { word: String, known: Vec<String> },
    /// A unit of another dimension.
    #[error("'{word}' is no unit of '{id}', which is in {}", .unit.symbol())]
    WrongUnit { word: String, id: String, unit: Unit, known: Vec<String> },
    /// Both or neither of two alternative keys.
    #[error("{place} needs either '{}' or '{}'", .keys.0, .keys.1)]
    OneOf { place: String, keys: (&'static str, &'static str) },
    /// Two sensors have one column.
    #[error("'{other}' and '{id}' have the same column '{column}'")]
    SameColumn { column: String, id: String, other: String },
    /// No sensor has a column.
    #[error("no sensor has a column: there is nothing to watch")]
    NoSensor,
    /// The log has no such column.
    #[error("{log} has no column '{column}'")]
    NoColumn { log: String, column: String, nearest: Option<String>, known: Vec<String> },
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
            Mistake::OneOf { .. } | Mistake::SameColumn { .. } => None,
            Mistake::NoSensor => Some("write: [sensors] and NAME = { column = \"…\" }".into()),
        }
    }
}

impl From<document::TomlMistake> for Mistake {
    fn from(mistake: document::TomlMistake) -> Self {
        Mistake::Document(mistake)
    }
}
