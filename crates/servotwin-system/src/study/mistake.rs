//! Mistakes of a study file beyond its form, with their messages.

use super::realism::REALISTIC;
use crate::document::{self, Explained, NumberWithUnit, suggest};

/// A mistake in a study file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum StudyMistake {
    /// A mistake of form that any TOML file can have.
    #[error(transparent)]
    Document(#[from] document::TomlMistake),
    /// A name that the system does not have. `known` lists the valid names, unless there are too many.
    #[error("there is no {what} '{name}'")]
    Unknown { what: &'static str, name: String, nearest: Option<String>, known: Vec<String> },
    /// A fault or a parameter of a component that all actuators share, where each actuator needs its own.
    /// `unit` is the name of the first actuator.
    #[error(
        "the {what} '{name}' is of a component that units share: a name here stands for one of every unit, '{unit}.{name}' and so on"
    )]
    Shared { what: &'static str, name: String, unit: String },
    /// A number outside its range.
    #[error("{field} is {}, but must be {allowed}", NumberWithUnit(*.value, ""))]
    OutOfRange { field: String, value: f64, allowed: String },
    /// A signal that cannot be built.
    #[error("signal '{name}': {error}")]
    Signal { name: String, error: String },
    /// An entry that must not be empty.
    #[error("'{field}' is empty")]
    Empty { field: &'static str },
    /// An entry that occurs twice.
    #[error("the {what} '{name}' stands twice")]
    Repeated { what: &'static str, name: String },
    /// An actuator with the empty name, which stands for the whole system, next to other actuators.
    #[error("the unit '' is the whole system, which has no other units")]
    WholeBesideUnits,
    /// A sensor that should follow a controller, but no controller drives what it measures.
    #[error(
        "no controller drives what '{sensor}' measures by what other sensors of the study read"
    )]
    NoController { sensor: String },
    /// A study whose classes have no faults.
    #[error("the study has no faults")]
    NoFaults,
    /// A kind of component that cannot stand for another. `what` names what it lacks.
    #[error("'{kind}' cannot stand for '{own}': it has no {what}")]
    NoStandIn { kind: String, own: String, what: String },
    /// A draw that is neither a factor nor an offset, or both.
    #[error("a draw has either 'times' or 'plus'")]
    TimesOrPlus,
    /// A key that a suite in closed loop cannot have.
    #[error("a suite in closed loop has no '{key}'")]
    ClosedLoop { key: &'static str },
    /// A suite with a known name that is flown as it is not known.
    #[error("of the suites with a known name 'effects' alone is flown in closed loop")]
    KnownClosedLoop,
    /// A suite with the name of several suites, or of records.
    #[error("'{name}' is a name for suites that every study has: choose another one")]
    TakenName { name: String },
    /// Flights without the noise and specimens of `[realistic]`.
    #[error("flights need the section 'realistic'")]
    NoRealism,
}

impl Explained for StudyMistake {
    fn help(&self) -> Option<String> {
        match self {
            StudyMistake::Document(mistake) => mistake.help(),
            StudyMistake::Unknown { nearest: None, known, .. } if known.is_empty() => None,
            StudyMistake::Unknown { nearest, known, .. } => Some(suggest(nearest, known)),
            StudyMistake::Shared { .. } => Some(
                "a diagnosis says which unit is at fault, and of what units share it is none: leave it out, or write \
                 a second study with units = [\"\"], in which the whole system is one unit"
                    .into(),
            ),
            StudyMistake::NoFaults => Some("add [[classes]] with 'faults'".into()),
            StudyMistake::TimesOrPlus => {
                Some("times = [0.9, 1.1] is a range of factors, plus = [-10, 10] of offsets".into())
            }
            StudyMistake::NoRealism => Some(REALISTIC.example.into()),
            _ => None,
        }
    }

    fn range(&self) -> Option<(f64, f64)> {
        match self {
            StudyMistake::Document(mistake) => mistake.range(),
            _ => None,
        }
    }

    fn allowed(&self) -> Option<String> {
        match self {
            StudyMistake::OutOfRange { allowed, .. } => Some(allowed.clone()),
            _ => None,
        }
    }
}
