//! All that a diagnosis beside a running actuator needs, as one value, and the session that it runs in.
//!
//! ```text
//! inputs   → environment   (believed?)
//! measured → streams       (windows of several lengths) → judge (bands, features, trees, committee)
//! twin     ↗               → decision (the sequential test) → alarm → outcome
//! ```
//!
//! A [`Diagnoser`] never changes; it is stored as JSON ([`FORMAT`]). A [`Session`] is the state beside
//! it: it takes one sample after the other, in fixed memory, and can be stored and go on elsewhere to
//! the bit. Many sessions share one diagnoser.

use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::baseline;
use crate::conditional_band::ConditionalBand;
use crate::error::{Error, require};
use crate::features::{self, Quantity, Sensors};
use crate::hierarchy::Names;
use crate::panel::Panel;
use crate::sliding::Span;

mod alarm;
mod common_mode;
pub mod decision;
pub mod environment;
pub mod novelty;
mod outcome;
mod sensor_health;
mod session;
mod streams;
mod window_classifier;

pub use environment::{Environment, Invalid, Why};
pub use novelty::Novelty;
pub use outcome::{Alarm, Counts, Finding, Outcome, Raised};
pub use session::{Session, State};

/// The word that a stored diagnoser begins with.
pub const FORMAT: &str = "servotwin diagnoser 1";

/// No count of a stored session is larger.
const LARGEST_COUNT: u64 = 1 << 53;

/// A sensor whose residual is watched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// The name that features are built from.
    pub name: String,
    /// What it measures.
    pub quantity: Quantity,
    /// The actuator it belongs to, a place in the names; `None` for a sensor of the whole.
    #[serde(rename = "unit")]
    pub actuator: Option<u32>,
    /// What its residual is divided by, in the sensor's SI unit.
    pub scale: f64,
    /// Standard deviation that noise and quantisation give a sample, in parts of scale.
    pub noise: f64,
    /// Whether the samples carry it: those of a simulation with perfect sensors do not.
    pub is_noisy: bool,
    /// Which others it follows by a law: their places, and how far it moves for each, in parts of scale.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub follows: Vec<(u32, f64)>,
}

/// What is known of windows of one length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Length {
    /// How long the windows are.
    pub span: Span,
    /// Bands of the first sensors (those that are watched, in the order of
    /// [`Diagnoser::sensors`]), trees and committee.
    pub panel: Panel,
    /// What the classes looked like in training.
    pub novelty: Novelty,
    /// Of windows of what residuals are beyond the reference; `None` of residuals as they are.
    #[serde(default, rename = "relative", skip_serializing_if = "Option::is_none")]
    pub baseline_corrected: Option<decision::Allowances>,
}

/// Sensors, windows, bands, features, trees and the decision: enough to diagnose with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diagnoser {
    /// [`FORMAT`].
    pub format: String,
    /// Time from sample to sample, in s.
    pub period_s: f64,
    /// The sensors, in the order in which their values come.
    pub sensors: Vec<Sensor>,
    /// What is expected of values from outside.
    pub environment: Environment,
    /// The window lengths, all with the same actuators, commands and details; the first is of residuals as they are.
    pub lengths: Vec<Length>,
    /// What the windows of lengths that are relative are beyond.
    #[serde(default, rename = "reference", skip_serializing_if = "Option::is_none")]
    pub baseline: Option<baseline::Settings>,
    /// A band that depends on what is asked, instead of the bands of all lengths.
    #[serde(default, rename = "field", skip_serializing_if = "Option::is_none")]
    pub conditional_band: Option<ConditionalBand>,
    /// When something is raised.
    pub decision: decision::Settings,
}

impl Diagnoser {
    /// The names that findings stand for.
    ///
    /// # Panics
    /// Without any window length, which [`Diagnoser::check`] refuses.
    pub fn names(&self) -> &Names {
        &self.lengths[0].panel.trees.names
    }

    /// The sensors as features see them.
    pub fn sensors_seen(&self) -> Sensors {
        let seen = |s: &Sensor| features::Sensor {
            name: s.name.clone(),
            quantity: s.quantity,
            actuator: s.actuator.map(|actuator| actuator as usize),
            noise: s.noise,
            is_noisy: s.is_noisy,
            follows: s.follows.iter().map(|&(other, weight)| (other as usize, weight)).collect(),
            stands_in: false,
        };
        Sensors(self.sensors.iter().map(seen).collect())
    }

    /// What residuals are divided by, sensor by sensor.
    pub fn scales(&self) -> Vec<f64> {
        self.sensors.iter().map(|sensor| sensor.scale).collect()
    }

    /// Number of sensors whose bands decide whether something is wrong: the first so many.
    pub fn watched(&self) -> usize {
        self.lengths.first().map_or(0, |length| length.panel.bands.len())
    }

    /// How many views of a row a length's novelty looks at.
    fn views_of_novelty(&self, length: &Length) -> usize {
        let actuators = self.names().actuators.len();
        let is_alike = self.sensors_seen().rotations(actuators).is_some();
        let learnt = !length.novelty.classes.is_empty();
        if learnt && is_alike { actuators } else { 1 }
    }

    /// A finding in words: `actuator_1 / shut_down / leak`.
    pub fn describe(&self, finding: Finding) -> String {
        let names = self.names();
        let name = |list: &[String], place: u32| {
            list.get(place as usize).map_or("?", String::as_str).into()
        };
        let actuator = |place| name(&names.actuators, place);
        let action = |place| name(&names.actions, place);
        let words: Vec<String> = match finding {
            Finding::Unjudged => alloc::vec!["not judged".into()],
            Finding::Healthy => alloc::vec![crate::hierarchy::HEALTHY.into()],
            Finding::Detected => alloc::vec!["detected, not isolated".into()],
            Finding::Unknown => alloc::vec!["unknown".into()],
            Finding::Actuator { actuator: u } => alloc::vec![actuator(u)],
            Finding::Action { actuator: u, action: c } => alloc::vec![actuator(u), action(c)],
            Finding::Detail { actuator: u, action: c, detail } => {
                alloc::vec![actuator(u), action(c), name(&names.details, detail)]
            }
            Finding::EnvironmentInvalid { input, why } => {
                let known = self.environment.inputs.get(input as usize);
                let input = known.map_or("?", |input| input.name.as_str());
                let why = match why {
                    Why::Missing => "missing",
                    Why::NotFinite => "not finite",
                    Why::OutOfRange => "out of range",
                    Why::Frozen => "frozen",
                    Why::Contradicts => "contradicts another",
                };
                alloc::vec!["environment invalid".into(), input.into(), why.into()]
            }
        };
        // The only unit of a study may have no name.
        let named: Vec<&str> = words.iter().map(String::as_str).filter(|w| !w.is_empty()).collect();
        if named.is_empty() { crate::hierarchy::FAULTY.into() } else { named.join(" / ") }
    }

    /// Checks that the parts fit each other; for diagnosers that come from outside.
    ///
    /// # Errors
    /// [`Error::CorruptModel`], [`Error::SettingOutOfRange`], and what the parts say.
    pub fn check(&self) -> Result<(), Error> {
        holds(self.format == FORMAT, "the format is another one")?;
        let period = self.period_s;
        require((1e-6..=1e3).contains(&period), "period_s", period, "1e-6 to 1000 s")?;
        holds(!self.lengths.is_empty(), "there is no window length")?;
        self.environment.check()?;
        self.lengths.iter().try_for_each(|length| self.check_length(length))?;
        self.check_sensors()?;
        if let Some(band) = &self.conditional_band {
            band.check(self.watched(), self.sensors.len(), self.environment.inputs.len())?;
        }
        self.decision.check(self.names())?;
        let is_plain = self.lengths[0].baseline_corrected.is_none();
        holds(is_plain, "the first window length is not of residuals as they are")?;
        streams::Streams::new(self).map(drop)?;
        self.lengths
            .iter()
            .try_for_each(|length| window_classifier::WindowClassifier::new(self, length).map(drop))
    }

    fn check_sensors(&self) -> Result<(), Error> {
        let actuators = self.names().actuators.len();
        for sensor in &self.sensors {
            let (scale, noise) = (sensor.scale, sensor.noise);
            require(scale > 0.0 && scale.is_finite(), "scale", scale, "above 0")?;
            require((0.0..=1.0).contains(&noise), "noise", noise, "0 to 1 of scale")?;
            let known = sensor.actuator.is_none_or(|actuator| (actuator as usize) < actuators);
            holds(known, "a sensor belongs to an actuator that is not there")?;
            let is_sound = |&(other, weight): &(u32, f64)| {
                (other as usize) < self.sensors.len() && weight.is_finite()
            };
            let follows = &sensor.follows;
            let fits = follows.len() <= features::MAX_FOLLOWED && follows.iter().all(is_sound);
            holds(fits, "a sensor follows one that is not there, or too many")?;
        }
        Ok(())
    }

    fn check_length(&self, length: &Length) -> Result<(), Error> {
        let Length { panel, novelty, baseline_corrected, .. } = length;
        panel.check()?;
        baseline_corrected.iter().try_for_each(decision::Allowances::check)?;
        let of = |names: &Names| [&names.actuators, &names.actions, &names.details].map(Vec::clone);
        let names = &panel.trees.names;
        holds(of(names) == of(self.names()), "window lengths have other names")?;
        holds(!names.actions.is_empty(), "there is no command")?;
        holds(panel.bands.len() == self.watched(), "window lengths have other bands")?;
        let fits = panel.bands.len() <= self.sensors.len();
        let same = panel.bands.iter().zip(&self.sensors).all(|(b, s)| b.sensor == s.name);
        holds(fits && same, "bands are not those of the first sensors")?;
        novelty.check(names.actions.len(), names.features.len())
    }
}

fn holds(holds: bool, broken: &'static str) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::CorruptModel { broken }) }
}
