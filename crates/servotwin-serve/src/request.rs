//! What a viewer may ask for, as JSON.
//!
//! ```json
//! {"inject": {"fault": "actuator_1.leakage_a.leakage", "intensity": 0.5, "onset": "step"}}
//! {"remove": "actuator_1.leakage_a.leakage"}
//! {"restart": true}
//! {"pause": true}
//! ```

use crate::injection::{InjectedOnset, Injection};
use serde::Deserialize;
use servotwin::nearest::UnknownName;
use servotwin::system::System;
use servotwin_model::program::FaultAt;

/// The longest request, in bytes.
pub(crate) const LONGEST: usize = 4096;

/// The number of requests that may wait between two samples.
pub(crate) const WAITING: usize = 64;

/// A request of a viewer.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Injects a fault, or changes one that is injected.
    Inject(Inject),
    /// Removes an injected fault, by its name.
    Remove(String),
    /// Begins a new flight without faults.
    Restart(bool),
    /// Holds the flight, or lets it go on.
    Pause(bool),
}

/// A fault to be injected.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inject {
    /// The fault's name.
    pub(crate) fault: String,
    /// Its intensity, 0 to 1.
    pub(crate) intensity: f64,
    /// How it begins.
    pub(crate) onset: InjectedOnset,
}

/// Why a request is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Refused {
    /// It is longer than [`LONGEST`].
    #[error("a request has at most {LONGEST} bytes")]
    TooLong,
    /// It is no request.
    #[error("not understood: {0}")]
    NotUnderstood(String),
    /// The system has no such fault.
    #[error(transparent)]
    UnknownFault(#[from] UnknownName),
    /// An intensity outside of its range.
    #[error("the intensity is {0}: allowed are 0 to 1")]
    Intensity(f64),
    /// An actuator that is measured cannot be changed from here.
    #[error("what is measured takes no requests")]
    Measured,
    /// More requests came than the flight takes between two samples.
    #[error("too many requests at once")]
    TooMany,
}

impl Request {
    /// Reads a request.
    ///
    /// # Errors
    /// [`Refused::TooLong`], [`Refused::NotUnderstood`].
    pub(crate) fn read(text: &str) -> Result<Self, Refused> {
        if text.len() > LONGEST {
            return Err(Refused::TooLong);
        }
        serde_json::from_str(text).map_err(|error| Refused::NotUnderstood(error.to_string()))
    }
}

impl Inject {
    /// The fault of a system, from a time on, s.
    ///
    /// # Errors
    /// [`Refused::UnknownFault`], [`Refused::Intensity`].
    pub(crate) fn injection(&self, system: &System, since_s: f64) -> Result<Injection, Refused> {
        let (component, fault) = system.find_fault(&self.fault)?;
        if !(0.0..=1.0).contains(&self.intensity) {
            return Err(Refused::Intensity(self.intensity));
        }
        Ok(Injection {
            name: self.fault.clone(),
            fault: FaultAt { component, fault, intensity: self.intensity },
            onset: self.onset,
            since_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read() {
        let text = r#"{"inject": {"fault": "a.b.c", "intensity": 0.5, "onset": "ramp"}}"#;
        let inject = Inject { fault: "a.b.c".into(), intensity: 0.5, onset: InjectedOnset::Ramp };
        assert_eq!(Request::read(text), Ok(Request::Inject(inject)));
        assert_eq!(Request::read(r#"{"pause": true}"#), Ok(Request::Pause(true)));
    }

    #[test]
    fn garbage_is_refused() {
        for text in
            ["", "{", "[]", r#"{"inject": 1}"#, r#"{"fly": true}"#, r#"{"speed": 4}"#, "\u{0}"]
        {
            assert!(matches!(Request::read(text), Err(Refused::NotUnderstood(_))), "{text}");
        }
        assert_eq!(Request::read(&" ".repeat(LONGEST + 1)), Err(Refused::TooLong));
    }

    #[test]
    fn impossible_faults_are_refused_with_the_place_and_the_range() {
        let system = System::read("aileron_dual").unwrap();
        let inject = |fault: &str, intensity: f64| {
            Inject { fault: fault.into(), intensity, onset: InjectedOnset::Step }
                .injection(&system, 0.0)
        };
        assert!(inject("actuator_1.leakage_a.leakage", 0.5).is_ok());
        let message = inject("actuator_1.leakage_a.leakge", 0.5).unwrap_err().to_string();
        assert!(message.contains("did you mean 'actuator_1.leakage_a.leakage'?"), "{message}");
        for intensity in [-0.1, 1.1, f64::NAN] {
            assert!(matches!(
                inject("actuator_1.leakage_a.leakage", intensity),
                Err(Refused::Intensity(_))
            ));
        }
    }
}
