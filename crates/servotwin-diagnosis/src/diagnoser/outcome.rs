//! The result of a diagnosis after every sample.

use serde::{Deserialize, Serialize};

use super::decision::Hypotheses;
use super::environment::Why;
use super::{Diagnoser, LARGEST_COUNT};

/// A finding. Its numbers are indices into the diagnoser's names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IndexedFinding {
    /// Not judged yet: too few samples, or the twin is still settling.
    Unjudged,
    /// No fault found.
    Healthy,
    /// There is a deviation, but its cause is unclear.
    Detected,
    /// There is a fault in an actuator, but the action is unclear.
    Actuator {
        /// Index of the actuator.
        actuator: u32,
    },
    /// The action for an actuator.
    Action {
        /// Index of the actuator.
        actuator: u32,
        /// Index of the action.
        action: u32,
    },
    /// The detail of a fault.
    Detail {
        /// Index of the actuator.
        actuator: u32,
        /// Index of the action.
        action: u32,
        /// Index of the detail.
        detail: u32,
    },
    /// A deviation that resembles no training data.
    Unknown,
    /// An input is implausible, so nothing is judged.
    EnvironmentInvalid {
        /// Index of the input.
        input: u32,
        /// The failed check.
        why: Why,
    },
}

/// The state of the alarm, in alarm-system terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Alarm {
    /// No alarm.
    Normal,
    /// There is evidence, but not enough for an action.
    Pending,
    /// An action is raised.
    Raised,
    /// An action is raised, but its evidence has ended.
    Recovering,
    /// Values are missing.
    NoData,
    /// Values are implausible.
    Error,
}

impl Alarm {
    /// The state in words.
    pub fn name(self) -> &'static str {
        match self {
            Alarm::Normal => "normal",
            Alarm::Pending => "pending",
            Alarm::Raised => "raised",
            Alarm::Recovering => "recovering",
            Alarm::NoData => "no data",
            Alarm::Error => "error",
        }
    }
}

/// A raised action. A shutdown stays until it is carried out or withdrawn, whatever the residuals show later.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Raised {
    /// Index of the actuator.
    pub actuator: u32,
    /// Index of the action.
    pub action: u32,
    /// The detail that most windows named since then, weighted by their confidence; `None` if trees and committee agreed
    /// on none.
    pub detail: Option<u32>,
    /// Number of the sample that raised it.
    pub sample: u64,
    /// Index of the window length that confirmed it last.
    pub length: u32,
    /// The committee's probability of actuator, action and detail together, in the last window that named them.
    pub confidence: f64,
    /// The sum of confidence of the windows that named the detail, less that of the windows that named others; 0 without
    /// a detail.
    pub lead: f64,
}

/// Sizes of a diagnoser's lists, to check stored indices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Places {
    pub(crate) hypotheses: Hypotheses,
    pub(crate) details: usize,
    pub(crate) lengths: usize,
    pub(crate) sensors: usize,
    pub(crate) inputs: usize,
}

impl Places {
    pub(crate) fn of(diagnoser: &Diagnoser) -> Self {
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

    pub(crate) fn has_detail(&self, detail: u32) -> bool {
        (detail as usize) < self.details
    }
}

/// Whether a number is a probability.
pub(super) fn is_share(number: f64) -> bool {
    // Rounding may lift a sum of shares above one.
    (0.0..=1.0 + 1e-9).contains(&number)
}

impl Raised {
    /// The same action, confirmed by a newer window. Another detail needs more confidence in sum than the known one.
    pub(super) fn confirmed(self, new: Raised) -> Raised {
        let newer = Raised { sample: self.sample, ..new };
        if self.detail.is_none() {
            newer
        } else if new.detail == self.detail {
            Raised { lead: self.lead + new.lead, ..newer }
        } else if new.lead > self.lead {
            Raised { lead: new.lead - self.lead, ..newer }
        } else {
            let Raised { detail, confidence, .. } = self;
            Raised { detail, confidence, lead: self.lead - new.lead, ..newer }
        }
    }

    /// Whether a stored one has valid indices and a past sample.
    pub(super) fn fits(&self, places: &Places, samples: u64) -> bool {
        places.has_actuator(self.actuator)
            && places.has_action(self.action)
            && self.detail.is_none_or(|detail| places.has_detail(detail))
            && self.sample <= samples
            && (self.length as usize) < places.lengths
            && is_share(self.confidence)
            && self.lead.is_finite()
            && self.lead >= 0.0
    }
}

impl IndexedFinding {
    fn fits(&self, places: &Places) -> bool {
        match *self {
            IndexedFinding::Unjudged
            | IndexedFinding::Healthy
            | IndexedFinding::Detected
            | IndexedFinding::Unknown => true,
            IndexedFinding::Actuator { actuator } => places.has_actuator(actuator),
            IndexedFinding::Action { actuator, action } => {
                places.has_actuator(actuator) && places.has_action(action)
            }
            IndexedFinding::Detail { actuator, action, detail } => {
                places.has_actuator(actuator)
                    && places.has_action(action)
                    && places.has_detail(detail)
            }
            IndexedFinding::EnvironmentInvalid { input, .. } => (input as usize) < places.inputs,
        }
    }
}

/// The result after a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Number of the sample, from 0.
    pub sample: u64,
    /// The finding.
    pub finding: IndexedFinding,
    /// The state of the alarm.
    pub alarm: Alarm,
    /// The action to carry out, whatever the current finding. A shutdown comes before everything else.
    pub raised: Option<Raised>,
    /// The committee's probability of the finding; for a raised action or detail, that of the action when it was last
    /// confirmed. 0 if nothing is judged.
    pub confidence: f64,
    /// Number of the first sample with the current finding and alarm; that of the next sample, if a command since the
    /// last one changed them.
    pub since_sample: u64,
    /// Index of the deciding window length.
    pub length: Option<u32>,
    /// The sensor with the largest residual in parts of its band, in the deciding window.
    pub worst_sensor: Option<u32>,
    /// That residual, in parts of its band.
    pub excess: f64,
    /// Number of sensors that have been missing for so long that the diagnosis continues without them. Meanwhile only
    /// their own actuator can be named or newly raised.
    pub lost: u32,
    /// Samples not judged so far, by reason.
    pub counts: UnjudgedCounts,
}

/// Samples that were not judged, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnjudgedCounts {
    /// A measured value was missing.
    pub missing: u64,
    /// A measured or twin value was not finite or implausible, or a list had a wrong length.
    pub errors: u64,
    /// An input was implausible.
    pub environment: u64,
    /// The twin was settling.
    pub settling: u64,
}

impl UnjudgedCounts {
    fn fits(&self) -> bool {
        let UnjudgedCounts { missing, errors, environment, settling } = *self;
        [missing, errors, environment, settling].iter().all(|count| *count <= LARGEST_COUNT)
    }
}

impl Outcome {
    /// Whether a stored one has valid indices and sample numbers.
    pub(super) fn fits(&self, places: &Places, samples: u64) -> bool {
        self.finding.fits(places)
            && self.raised.as_ref().is_none_or(|raised| raised.fits(places, samples))
            && self.sample <= samples
            && self.since_sample <= samples
            && is_share(self.confidence)
            && self.length.is_none_or(|length| (length as usize) < places.lengths)
            && self.worst_sensor.is_none_or(|sensor| (sensor as usize) < places.sensors)
            && self.excess.is_finite()
            && self.lost as usize <= places.sensors
            && self.counts.fits()
    }

    pub(super) fn first() -> Self {
        Outcome {
            sample: 0,
            finding: IndexedFinding::Unjudged,
            alarm: Alarm::Normal,
            raised: None,
            confidence: 0.0,
            since_sample: 0,
            length: None,
            worst_sensor: None,
            excess: 0.0,
            lost: 0,
            counts: UnjudgedCounts::default(),
        }
    }
}
