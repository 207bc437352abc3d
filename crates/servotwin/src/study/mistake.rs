//! Everything that can be wrong with a study file beside its form, in words.

use super::realism::REALISTIC;
use crate::document::{self, Explained, suggest};
use std::fmt;

/// What is wrong with a study file.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// With any TOML file.
    Document(document::Mistake),
    /// A name that the system does not have.
    Unknown {
        /// What the name should be.
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest right one.
        nearest: Option<String>,
        /// All right ones, where they are few.
        known: Vec<String>,
    },
    /// A fault or a parameter of a component that all units share, where one of each unit is meant.
    Shared {
        /// What it is.
        what: &'static str,
        /// Its name.
        name: String,
        /// The first of the units.
        unit: String,
    },
    /// A number outside its range.
    OutOfRange {
        /// The field.
        field: String,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: String,
    },
    /// A signal that cannot be built.
    Signal {
        /// The signal.
        name: String,
        /// Why.
        error: String,
    },
    /// Something that must not be empty.
    Empty {
        /// The fields of which one is needed.
        field: &'static str,
    },
    /// Something that stands twice.
    Repeated {
        /// What it is.
        what: &'static str,
        /// Its name or value.
        name: String,
    },
    /// The whole system is a unit beside others.
    WholeBesideUnits,
    /// No class has a fault.
    NoFaults,
    /// Flights need noise and specimens.
    NoRealism,
}

impl From<document::Mistake> for Mistake {
    fn from(mistake: document::Mistake) -> Self {
        Mistake::Document(mistake)
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mistake::Document(mistake) => write!(out, "{mistake}"),
            Mistake::Unknown { what, name, .. } => write!(out, "there is no {what} '{name}'"),
            Mistake::Shared { what, name, unit } => write!(
                out,
                "the {what} '{name}' is of a component that units share: a name here stands for one of every unit, '{unit}.{name}' and so on"
            ),
            Mistake::OutOfRange { field, value, allowed } => {
                let value = document::Quantity(*value, "");
                write!(out, "{field} is {value}, but must be {allowed}")
            }
            Mistake::Signal { name, error } => write!(out, "signal '{name}': {error}"),
            Mistake::Empty { field } => write!(out, "'{field}' is empty"),
            Mistake::Repeated { what, name } => write!(out, "the {what} '{name}' stands twice"),
            Mistake::NoFaults => write!(out, "the study has no faults"),
            Mistake::NoRealism => write!(out, "flights need the section 'realistic'"),
            Mistake::WholeBesideUnits => {
                write!(out, "the unit '' is the whole system, which has no other units")
            }
        }
    }
}

impl Explained for Mistake {
    fn help(&self) -> Option<String> {
        match self {
            Mistake::Document(mistake) => mistake.help(),
            Mistake::Unknown { nearest: None, known, .. } if known.is_empty() => None,
            Mistake::Unknown { nearest, known, .. } => Some(suggest(nearest, known)),
            Mistake::Shared { .. } => Some(
                "a diagnosis says which unit is at fault, and of what units share it is none: leave it out, or write \
                 a second study with units = [\"\"], in which the whole system is one unit"
                    .into(),
            ),
            Mistake::NoFaults => Some("add [[classes]] with 'faults'".into()),
            Mistake::NoRealism => Some(REALISTIC.example.into()),
            _ => None,
        }
    }
}
