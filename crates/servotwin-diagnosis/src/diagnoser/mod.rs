//! A complete diagnosis for one system as one value, and the session that runs it.
//!
//! ```text
//! inputs   ↘
//! measured → guard → windows → evidence → alarm → outcome
//! twin     ↗
//! ```
//!
//! Each of the four has a file: `guard` rejects samples, [`crate::windows`] slides windows of several lengths over
//! the others, `evidence` judges them (bands, features, trees, committee, then the sequential test of [`decision`]),
//! and `alarm` keeps what is raised.
//!
//! A [`Diagnoser`] never changes; it is stored as JSON ([`FORMAT`]). A [`Session`] holds the state: it takes sample
//! after sample in fixed memory. A stored session continues elsewhere bit for bit. Many sessions share one diagnoser.

use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::baseline;
use crate::error::{Error, require, require_sound};
use crate::features::{self, Quantity, Sensor, Sensors};
use crate::hierarchy::Names;
use crate::panel::Panel;
use crate::sliding::WindowSpan;
use crate::spread::{Spread, Spreads};
use crate::windows::{WindowKind, Windows};

mod alarm;
mod boundary;
pub mod common_mode;
pub mod decision;
pub mod environment;
mod evidence;
mod guard;
pub(crate) mod healthy_evidence;
pub mod novelty;
mod outcome;
mod recorded;
pub(crate) mod scatter;
mod session;
pub mod tuning;

pub use boundary::Boundary;
pub use environment::{InputChecks, Why};
pub use healthy_evidence::HealthyEvidence;
pub use novelty::Novelty;
pub use outcome::{Alarm, IndexedFinding, Outcome, Raised};
pub use recorded::{Nominal, Nominals, Recorded};
pub use scatter::{Scatter, ScatterTest};
pub use session::{Session, StoredSession};
pub use tuning::Tuning;

/// The format name at the start of a stored diagnoser.
pub const FORMAT: &str = "servotwin diagnoser 1";

/// Upper limit of the counts of a stored session.
const LARGEST_COUNT: u64 = 1 << 53;

/// A sensor of the diagnosed system.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiagnosedSensor {
    /// The name from which feature names are built.
    pub name: String,
    /// The measured quantity.
    pub quantity: Quantity,
    /// Index of its actuator; `None` for a sensor of the whole system.
    pub actuator: Option<u32>,
    /// The scale of its residual, in the sensor's SI unit.
    pub scale: f64,
    /// Standard deviation of a sample by noise and quantization, in parts of scale.
    pub noise: f64,
    /// Whether the samples contain this noise; those simulated with perfect sensors do not.
    pub is_noisy: bool,
    /// The sensors that it follows by a law: their indices, and its change for each, in parts of scale.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub follows: Vec<(u32, f64)>,
    /// How the spread of its healthy residual grows; `None` if it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<Spread>,
}

impl DiagnosedSensor {
    /// A sensor as features see it, with the scale of its residual; the spread of healthy residuals does not grow.
    pub fn new(seen: Sensor, scale: f64) -> Self {
        DiagnosedSensor {
            name: seen.name,
            quantity: seen.quantity,
            actuator: seen.actuator.map(|actuator| actuator as u32),
            scale,
            noise: seen.noise,
            is_noisy: seen.is_noisy,
            follows: seen.follows.into_iter().map(|(sensor, by)| (sensor as u32, by)).collect(),
            spread: None,
        }
    }

    /// What its residual is divided by, in words: its scale, and its spread if that grows.
    pub fn residual_divisor(&self) -> &'static str {
        if self.spread.is_some() { "scale and spread" } else { "scale" }
    }
}

/// Bands, models and allowances for windows of one length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Length {
    /// Length of the windows and of their panes.
    pub span: WindowSpan,
    /// Trees, committee, and the bands of the watched sensors, which come first in [`Diagnoser::sensors`].
    pub panel: Panel,
    /// The ranges of the training data, by class.
    pub novelty: Novelty,
    /// The allowances of windows of baseline-corrected residuals; `None` for uncorrected residuals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline_corrected: Option<decision::Allowances>,
}

/// Sensors, windows, bands, features, trees and the decision: enough to diagnose with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diagnoser {
    /// [`FORMAT`].
    pub format: String,
    /// Sampling period, s.
    pub period_s: f64,
    /// The sensors, in the order of their values in a sample.
    pub sensors: Vec<DiagnosedSensor>,
    /// Plausibility limits of the inputs.
    pub environment: InputChecks,
    /// The inputs whose wrong readings look like faults.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub boundaries: Vec<Boundary>,
    /// The window lengths, all with the same actuators, actions and details; the first has uncorrected residuals.
    pub lengths: Vec<Length>,
    /// Settings of the baseline for lengths with baseline-corrected residuals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<baseline::BaselineSettings>,
    /// All constants.
    pub tuning: Tuning,
    /// The scatter of the specimens in training; `None` if training flights give too few.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scatter: Option<Scatter>,
    /// The evidence of held-out healthy flights; `None` if none were flown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub healthy_evidence: Option<HealthyEvidence>,
    /// What it needs to know of records; `None` unless it learned from recordings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded: Option<Recorded>,
}

impl Diagnoser {
    /// The names that a finding's indices refer to.
    ///
    /// # Panics
    /// Without any window length; [`Diagnoser::check`] rejects that.
    pub fn names(&self) -> &Names {
        &self.lengths[0].panel.trees.names
    }

    /// The sensors as the features need them.
    pub fn sensors_seen(&self) -> Sensors {
        let seen = |s: &DiagnosedSensor| features::Sensor {
            name: s.name.clone(),
            quantity: s.quantity,
            actuator: s.actuator.map(|actuator| actuator as usize),
            noise: s.noise,
            is_noisy: s.is_noisy,
            follows: s.follows.iter().map(|&(other, weight)| (other as usize, weight)).collect(),
        };
        Sensors(self.sensors.iter().map(seen).collect())
    }

    /// The scale of each sensor's residual, SI.
    pub(crate) fn scales(&self) -> Vec<f64> {
        self.sensors.iter().map(|sensor| sensor.scale).collect()
    }

    /// Number of watched sensors: the first ones, whose bands decide whether there is a deviation.
    pub fn watched(&self) -> usize {
        self.lengths.first().map_or(0, |length| length.panel.bands.len())
    }

    /// The length of a record, s, of a diagnoser of records: it judges each one alone and gathers no evidence.
    pub fn record_s(&self) -> Option<f64> {
        let [only] = &self.lengths[..] else { return None };
        (only.span.panes == 1).then(|| only.span.samples() as f64 * self.period_s)
    }

    /// The number of samples in a time, rounded up.
    pub fn samples(&self, time_s: f64) -> u64 {
        libm::ceil(time_s / self.period_s) as u64
    }

    /// The constants for a length: baseline-corrected windows have allowances of their own.
    pub fn tuning_of(&self, length: &Length) -> Tuning {
        match &length.baseline_corrected {
            Some(allowances) => self.tuning.allowing(allowances),
            None => self.tuning.clone(),
        }
    }

    /// The same diagnoser with larger allowances of a shutdown against health, in windows of all kinds.
    #[must_use]
    pub fn with_shutdown_margin(&self, added_nats: f64) -> Self {
        let mut changed = self.clone();
        changed.tuning.off_allowance_nats += added_nats;
        let corrected = changed.lengths.iter_mut().filter_map(|l| l.baseline_corrected.as_mut());
        corrected.for_each(|allowances| allowances.off_nats += added_nats);
        changed
    }

    /// The limits of the evidence for a length.
    pub fn limits_of(&self, length: &Length) -> decision::DecisionLimits {
        let is_off = self.tuning.switches_off(self.names());
        let (tuning, window_s) =
            (self.tuning_of(length), length.span.samples() as f64 * self.period_s);
        decision::DecisionLimits::new(
            &tuning,
            decision::Hypotheses::of(self.names()),
            &is_off,
            window_s,
        )
    }

    /// Number of views of a row that a length's trees, committee and novelty score need.
    pub fn views_of(&self, length: &Length) -> usize {
        let of_models = length.panel.trees.views().max(length.panel.committee.views());
        of_models.max(self.views_of_novelty(length))
    }

    /// Number of views that the models of any length need: more than one where actuators are alike.
    pub fn views(&self) -> usize {
        self.lengths.iter().map(|length| self.views_of(length)).max().unwrap_or(1)
    }

    /// Number of views that a length's novelty score needs.
    fn views_of_novelty(&self, length: &Length) -> usize {
        let actuators = self.names().actuators.len();
        let is_alike = self.sensors_seen().rotations(actuators).is_some();
        let learnt = !length.novelty.classes.is_empty();
        if learnt && is_alike { actuators } else { 1 }
    }

    /// A finding in words: `actuator_1 / shut_down / leak`.
    pub fn describe(&self, finding: IndexedFinding) -> String {
        let names = self.names();
        let name = |list: &[String], place: u32| {
            list.get(place as usize).map_or("?", String::as_str).into()
        };
        let actuator = |place| name(&names.actuators, place);
        let action = |place| name(&names.actions, place);
        let words: Vec<String> = match finding {
            IndexedFinding::Unjudged => alloc::vec!["not judged".into()],
            IndexedFinding::Healthy => alloc::vec![crate::hierarchy::HEALTHY.into()],
            IndexedFinding::Detected => alloc::vec!["detected, not isolated".into()],
            IndexedFinding::Unknown => alloc::vec!["unknown".into()],
            IndexedFinding::Actuator { actuator: u } => alloc::vec![actuator(u)],
            IndexedFinding::Action { actuator: u, action: c } => {
                alloc::vec![actuator(u), action(c)]
            }
            IndexedFinding::Detail { actuator: u, action: c, detail } => {
                alloc::vec![actuator(u), action(c), name(&names.details, detail)]
            }
            IndexedFinding::EnvironmentInvalid { input, why } => {
                let known = self.environment.inputs.get(input as usize);
                let input = known.map_or("?", |input| input.name.as_str());
                let why = match why {
                    Why::Missing => "missing",
                    Why::NotFinite => "not finite",
                    Why::OutOfRange => "out of range",
                    Why::Frozen => "frozen",
                    Why::Contradicts => "contradicts another",
                    Why::Doubtful => "doubtful: its sensor or what it measures",
                };
                alloc::vec!["environment invalid".into(), input.into(), why.into()]
            }
        };
        // The only actuator of a study may have no name.
        let named: Vec<&str> = words.iter().map(String::as_str).filter(|w| !w.is_empty()).collect();
        if named.is_empty() { crate::hierarchy::FAULTY.into() } else { named.join(" / ") }
    }

    /// Empty windows of all lengths.
    ///
    /// # Errors
    /// As [`Windows::new`].
    pub(crate) fn windows(&self) -> Result<Windows, Error> {
        let kind = |length: &Length| WindowKind {
            span: length.span,
            is_baseline_corrected: length.baseline_corrected.is_some(),
        };
        let kinds: Vec<WindowKind> = self.lengths.iter().map(kind).collect();
        let spreads = self.sensors.iter().map(|sensor| sensor.spread).collect();
        let spreads = Spreads::new(spreads, self.period_s);
        Windows::new((spreads, self.watched()), &kinds, self.baseline)
    }

    /// Checks that the parts of a loaded diagnoser fit together.
    ///
    /// # Errors
    /// [`Error::CorruptModel`], [`Error::SettingOutOfRange`], and the errors of the parts.
    pub fn check(&self) -> Result<(), Error> {
        require_sound(self.format == FORMAT, "the format is another one")?;
        let period = self.period_s;
        require((1e-6..=1e3).contains(&period), "period_s", period, "1e-6 to 1000 s")?;
        require_sound(!self.lengths.is_empty(), "there is no window length")?;
        self.environment.check()?;
        let inputs = self.environment.inputs.len();
        self.boundaries.iter().try_for_each(|known| known.check(inputs, self.watched()))?;
        self.lengths.iter().try_for_each(|length| self.check_length(length))?;
        self.check_sensors()?;
        self.tuning.check(self.names())?;
        self.scatter.iter().try_for_each(Scatter::check)?;
        self.healthy_evidence.iter().try_for_each(HealthyEvidence::check)?;
        let is_plain = self.lengths[0].baseline_corrected.is_none();
        require_sound(is_plain, "the first window length is not of residuals as they are")?;
        self.windows().map(drop)?;
        self.lengths
            .iter()
            .try_for_each(|length| evidence::LengthEvidence::new(self, length).map(drop))
    }

    fn check_sensors(&self) -> Result<(), Error> {
        let actuators = self.names().actuators.len();
        for sensor in &self.sensors {
            let (scale, noise) = (sensor.scale, sensor.noise);
            require(scale > 0.0 && scale.is_finite(), "scale", scale, "above 0")?;
            require((0.0..=1.0).contains(&noise), "noise", noise, "0 to 1 of scale")?;
            let known = sensor.actuator.is_none_or(|actuator| (actuator as usize) < actuators);
            require_sound(known, "a sensor belongs to an actuator that is not there")?;
            let is_sound = |&(other, weight): &(u32, f64)| {
                (other as usize) < self.sensors.len() && weight.is_finite()
            };
            let follows = &sensor.follows;
            let fits = follows.len() <= features::MAX_FOLLOWED && follows.iter().all(is_sound);
            require_sound(fits, "a sensor follows one that is not there, or too many")?;
            sensor.spread.iter().try_for_each(|spread| spread.check(self.sensors.len()))?;
        }
        Ok(())
    }

    fn check_length(&self, length: &Length) -> Result<(), Error> {
        let Length { panel, novelty, baseline_corrected, .. } = length;
        panel.check()?;
        baseline_corrected.iter().try_for_each(decision::Allowances::check)?;
        let of = |names: &Names| [&names.actuators, &names.actions, &names.details].map(Vec::clone);
        let names = &panel.trees.names;
        require_sound(of(names) == of(self.names()), "window lengths have other names")?;
        require_sound(!names.actions.is_empty(), "there is no action")?;
        require_sound(panel.bands.len() == self.watched(), "window lengths have other bands")?;
        let fits = panel.bands.len() <= self.sensors.len();
        let same = panel.bands.iter().zip(&self.sensors).all(|(b, s)| b.sensor == s.name);
        require_sound(fits && same, "bands are not those of the first sensors")?;
        novelty.check(names.actions.len(), names.features.len())
    }
}
