//! What a diagnosis says after every sample.

use serde::{Deserialize, Serialize};

use super::environment::Why;

/// What was found. Numbers are places in the diagnoser's names, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Finding {
    /// Nothing was judged yet: too few samples, or the twin is still settling.
    Unjudged,
    /// Nothing is wrong.
    Healthy,
    /// Something is wrong, and it is not sure what.
    Detected,
    /// Something is wrong with an actuator, and it is not sure what is to be done.
    Actuator {
        /// The actuator.
        unit: u32,
    },
    /// What is to be done with an actuator.
    Command {
        /// The actuator.
        unit: u32,
        /// The command.
        command: u32,
    },
    /// What is broken there.
    Detail {
        /// The actuator.
        unit: u32,
        /// The command.
        command: u32,
        /// The detail.
        detail: u32,
    },
    /// Something is wrong that is like nothing trained on.
    Unknown,
    /// A value from outside is not to be believed, so nothing is judged.
    EnvironmentInvalid {
        /// The input.
        input: u32,
        /// Why.
        why: Why,
    },
}

/// The state of the alarm, in the words of alarm systems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Alarm {
    /// Nothing is wrong.
    Normal,
    /// Evidence gathers, and is not enough for a command.
    Pending,
    /// A command is raised.
    Raised,
    /// A command is raised, and there is no evidence for it any more.
    Recovering,
    /// Values are missing.
    NoData,
    /// Values came that make no sense.
    Error,
}

/// A command that is raised. One that switches off stays until it is confirmed or released.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Raised {
    /// The actuator.
    pub unit: u32,
    /// The command.
    pub command: u32,
    /// What is broken, where trees and committee agree on it.
    pub detail: Option<u32>,
    /// The number of the sample with which it was raised.
    pub sample: u64,
    /// The window length that said so last.
    pub length: u32,
    /// The probability of the command by that length's committee when it said so last.
    pub confidence: f64,
}

/// What a diagnosis says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Number of the sample, from 0.
    pub sample: u64,
    /// What was found.
    pub finding: Finding,
    /// The state of the alarm.
    pub alarm: Alarm,
    /// The command that is raised, whatever is found now.
    pub raised: Option<Raised>,
    /// The probability of the finding by the committee that decided (of a command and its detail,
    /// that of the command when its length said so last); 0 where nothing is judged.
    pub confidence: f64,
    /// The number of the sample since when finding and alarm are what they are.
    pub since_sample: u64,
    /// The window length that decided.
    pub length: Option<u32>,
    /// The sensor whose residual is largest in parts of its band, in the window that decided.
    pub worst_sensor: Option<u32>,
    /// That size.
    pub excess: f64,
    /// How far the sample lies outside of what the diagnoser's field was learned from, in parts of the ranges; 0
    /// inside, and without a field.
    #[serde(default)]
    pub outside: f64,
    /// Sensors whose values have been missing for so long that the others are judged without them; then no actuator
    /// but theirs is named, and nothing new is raised of others.
    #[serde(default)]
    pub lost: u32,
    /// Samples so far that were not judged, by reason.
    pub counts: Counts,
}

/// Samples that were not judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    /// A measured value was missing.
    pub missing: u64,
    /// A measured value or one of the twin's was no number, implausible, or lists had other lengths.
    pub errors: u64,
    /// A value from outside was not to be believed.
    pub environment: u64,
    /// The twin was settling.
    pub settling: u64,
}

impl Outcome {
    pub(super) fn first() -> Self {
        Outcome {
            sample: 0,
            finding: Finding::Unjudged,
            alarm: Alarm::Normal,
            raised: None,
            confidence: 0.0,
            since_sample: 0,
            length: None,
            worst_sensor: None,
            excess: 0.0,
            outside: 0.0,
            lost: 0,
            counts: Counts::default(),
        }
    }
}
