//! A system and a study to start with, which run unchanged: a servo actuator, two of them on one load, or a press axis.

use crate::built_in;
use crate::format::is_id;

const SYSTEM: &str = include_str!("template/system.toml");
const STUDY: &str = include_str!("template/study.toml");
const DUAL_SYSTEM: &str = include_str!("template/dual_system.toml");
const DUAL_STUDY: &str = include_str!("template/dual_study.toml");

/// Name of the built-in system and study for a press.
const PRESS: &str = "press_axis";

/// Which system the files describe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Like {
    /// An actuator with a servo valve against a spring; its command is an angle.
    ServoActuator,
    /// Two equal actuators on one load, written once as an assembly: the redundancy of the built-in `aileron_dual`
    /// without the details of an aircraft.
    AileronDual,
    /// A vertical ram with a proportional valve, a pump and an accumulator; its command is a position.
    PressAxis,
}

impl Like {
    /// All templates.
    pub const ALL: [Like; 3] = [Like::ServoActuator, Like::AileronDual, Like::PressAxis];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Like::ServoActuator => "servo_actuator",
            Like::AileronDual => "aileron_dual",
            Like::PressAxis => PRESS,
        }
    }

    /// A description as text.
    pub fn words(self) -> &'static str {
        match self {
            Like::ServoActuator => "a servo actuator against a spring",
            Like::AileronDual => "two servo actuators on one load",
            Like::PressAxis => "the axis of a press",
        }
    }

    /// Guesses the template from a name: a press if it contains that word.
    pub fn of_name(name: &str) -> Self {
        match name.split('_').any(|word| word == "press") {
            true => Like::PressAxis,
            false => Like::ServoActuator,
        }
    }

    /// A command signal that the system can follow.
    pub fn command(self) -> &'static str {
        match self {
            Like::ServoActuator | Like::AileronDual => "step:size=5deg",
            Like::PressAxis => "step:size=50mm",
        }
    }
}

/// The two files with a user's name.
pub struct Template {
    name: String,
    like: Like,
}

impl Template {
    /// Creates a template; `None` if a system cannot have this name.
    pub fn new(name: &str, like: Like) -> Option<Self> {
        is_id(name).then(|| Self { name: name.into(), like })
    }

    /// File name of the system.
    pub fn system_name(&self) -> String {
        format!("{}.toml", self.name)
    }

    /// File name of the study.
    pub fn study_name(&self) -> String {
        format!("{}_study.toml", self.name)
    }

    /// Text of the system file.
    pub fn system(&self) -> String {
        match self.like {
            Like::ServoActuator => SYSTEM.replace("NAME", &self.name),
            Like::AileronDual => DUAL_SYSTEM.replace("NAME", &self.name),
            Like::PressAxis => built_in(&built_in::SYSTEMS).replace(PRESS, &self.name),
        }
    }

    /// Text of the study file, which expects the system file in the same folder.
    pub fn study(&self) -> String {
        match self.like {
            Like::ServoActuator => STUDY.replace("NAME", &self.name),
            Like::AileronDual => DUAL_STUDY.replace("NAME", &self.name),
            Like::PressAxis => built_in(&built_in::STUDIES)
                .replace(&format!("studies/{PRESS}.toml"), &self.study_name())
                .replace(
                    &format!("system = \"{PRESS}\""),
                    &format!("system = \"{}\"", self.system_name()),
                )
                .replace("out_press", &format!("out_{}", self.name))
                .replace(PRESS, &self.name),
        }
    }
}

fn built_in(list: &[(&'static str, &'static str)]) -> &'static str {
    built_in::find(list, PRESS).expect("it is built in")
}
