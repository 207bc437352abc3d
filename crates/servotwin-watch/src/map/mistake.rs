//! What can be wrong with a map file, in words.

use servotwin_io::document::{self, Explained, suggest};
use servotwin_model::spec::Unit;

/// What is wrong with a map file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mistake {
    /// With any TOML file.
    #[error("{0}")]
    Document(document::Mistake),
    /// A name that the system does not have.
    #[error("the system has no {what} '{id}'")]
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
    #[error("unknown unit '{word}'")]
    UnknownUnit {
        /// The word.
        word: String,
        /// What would do.
        known: Vec<String>,
    },
    /// The unit of something else.
    #[error("'{word}' is no unit of '{id}', which is in {}", .unit.symbol())]
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
    #[error("{place} needs either '{}' or '{}'", .keys.0, .keys.1)]
    OneOf {
        /// Where.
        place: String,
        /// The keys.
        keys: (&'static str, &'static str),
    },
    /// No sensor has a column.
    #[error("no sensor has a column: there is nothing to watch")]
    NoSensor,
    /// The log has no such column.
    #[error("{log} has no column '{column}'")]
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
