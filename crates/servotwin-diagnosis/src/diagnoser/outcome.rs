//! What a diagnosis says after every sample.

use serde::{Deserialize, Serialize};

use super::decision::Hypotheses;
use super::environment::Why;
use super::{Diagnoser, LARGEST_COUNT};

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
        #[serde(rename = "unit")]
        actuator: u32,
    },
    /// What is to be done with an actuator.
    #[serde(rename = "command")]
    Action {
        /// The actuator.
        #[serde(rename = "unit")]
        actuator: u32,
        /// The command.
        #[serde(rename = "command")]
        action: u32,
    },
    /// What is broken there.
    Detail {
        /// The actuator.
        #[serde(rename = "unit")]
        actuator: u32,
        /// The command.
        #[serde(rename = "command")]
        action: u32,
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
    #[serde(rename = "unit")]
    pub actuator: u32,
    /// The command.
    #[serde(rename = "command")]
    pub action: u32,
    /// What is broken, where trees and committee agree on it.
    pub detail: Option<u32>,
    /// The number of the sample with which it was raised.
    pub sample: u64,
    /// The window length that said so last.
    pub length: u32,
    /// The probability of the command by that length's committee when it said so last.
    pub confidence: f64,
}

/// How many places there are in the lists of a diagnoser: a stored number must be one of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Places {
    pub hypotheses: Hypotheses,
    pub details: usize,
    pub lengths: usize,
    pub sensors: usize,
    pub inputs: usize,
}

impl Places {
    pub fn of(diagnoser: &Diagnoser) -> Self {
        let names = diagnoser.names();
        Places {
            hypotheses: Hypotheses::of(names),
            details: names.details.len(),
            lengths: diagnoser.lengths.len(),
            sensors: diagnoser.sensors.len(),
            inputs: diagnoser.environment.inputs.len(),
        }
    }

    fn has_actuator(&self, actuator: u32) -> bool {
        (actuator as usize) < self.hypotheses.actuators
    }

    fn has_action(&self, action: u32) -> bool {
        (action as usize) < self.hypotheses.actions
    }

    pub fn has_detail(&self, detail: u32) -> bool {
        (detail as usize) < self.details
    }
}

/// Whether a number is a probability.
pub(super) fn is_share(number: f64) -> bool {
    // A sum of shares may be above one by what it was rounded by.
    (0.0..=1.0 + 1e-9).contains(&number)
}

impl Raised {
    /// Whether a stored one names places that there are, and a sample that was.
    pub(super) fn fits(&self, places: &Places, samples: u64) -> bool {
        places.has_actuator(self.actuator)
            && places.has_action(self.action)
            && self.detail.is_none_or(|detail| places.has_detail(detail))
            && self.sample <= samples
            && (self.length as usize) < places.lengths
            && is_share(self.confidence)
    }
}

impl Finding {
    fn fits(&self, places: &Places) -> bool {
        match *self {
            Finding::Unjudged | Finding::Healthy | Finding::Detected | Finding::Unknown => true,
            Finding::Actuator { actuator } => places.has_actuator(actuator),
            Finding::Action { actuator, action } => {
                places.has_actuator(actuator) && places.has_action(action)
            }
            Finding::Detail { actuator, action, detail } => {
                places.has_actuator(actuator)
                    && places.has_action(action)
                    && places.has_detail(detail)
            }
            Finding::EnvironmentInvalid { input, .. } => (input as usize) < places.inputs,
        }
    }
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

impl Counts {
    fn fits(&self) -> bool {
        let Counts { missing, errors, environment, settling } = *self;
        [missing, errors, environment, settling].iter().all(|count| *count <= LARGEST_COUNT)
    }
}

impl Outcome {
    /// Whether a stored one names places that there are, and samples that were.
    pub(super) fn fits(&self, places: &Places, samples: u64) -> bool {
        self.finding.fits(places)
            && self.raised.as_ref().is_none_or(|raised| raised.fits(places, samples))
            && self.sample <= samples
            && self.since_sample <= samples
            && is_share(self.confidence)
            && self.length.is_none_or(|length| (length as usize) < places.lengths)
            && self.worst_sensor.is_none_or(|sensor| (sensor as usize) < places.sensors)
            && self.excess.is_finite()
            && self.outside.is_finite()
            && self.lost as usize <= places.sensors
            && self.counts.fits()
    }

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
