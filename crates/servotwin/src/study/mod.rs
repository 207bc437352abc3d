//! A study: which faults, under which operating cases, seen by which sensors.
//!
//! A study file names a system, the commands and loads, the classes of Table 1
//! of the paper with their faults, and how reality differs from the twin. From
//! it come the fault list ([`faults`]), the campaign ([`campaign`]) and the data
//! set.

pub mod campaign;
pub mod faults;
pub mod flights;
pub mod reactions;
mod realism;
mod training;

pub use faults::{Class, FaultCase};
pub use flights::Flights;
pub use reactions::{Reaction, Reactions};
pub(crate) use realism::Imperfection;
pub use realism::{Lot, Realism, Role, Setting, Tolerance};
pub use training::Training;

use crate::files::{self, FileError};
use crate::nearest::nearest;
use crate::signal::Signal;
use crate::system::{System, SystemError};
use serde::Deserialize;
use servotwin_diagnosis::features::{Quantity, Sensor, Sensors};
use servotwin_model::signal::Piecewise;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// The format of study files that this version reads.
pub const FORMAT: u32 = 1;

/// The study that is used where none is named: the paper's.
const DEFAULT: &str = include_str!("../../../../studies/paper.toml");

/// Systems that can be named without a file.
const BUILT_IN: [(&str, &str); 3] = [
    ("aileron_dual", include_str!("../../../../systems/aileron_dual.toml")),
    ("spring_actuator", include_str!("../../../../systems/spring_actuator.toml")),
    ("valve_and_cylinder", include_str!("../../../../systems/valve_and_cylinder.toml")),
];

/// A study as its file says it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: u32,
    name: String,
    title: String,
    system: String,
    duration_s: f64,
    sample_hz: f64,
    intensities: Vec<f64>,
    units: Vec<String>,
    command: CommandText,
    load: Option<LoadText>,
    sensors: BTreeMap<String, SensorText>,
    extra_sensor: Option<ExtraText>,
    #[serde(default)]
    classes: Vec<ClassText>,
    realistic: Option<realism::Text>,
    training: Option<training::Text>,
    flights: Option<flights::Text>,
    #[serde(default)]
    reactions: BTreeMap<String, reactions::Text>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CommandText {
    input: String,
    signals: BTreeMap<String, Signal>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LoadText {
    input: String,
    values: BTreeMap<String, f64>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorText {
    quantity: String,
    unit: usize,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExtraText {
    id: String,
    title: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ClassText {
    detail: String,
    command: String,
    faults: Vec<String>,
}

/// One operating case: a command at a load.
#[derive(Clone, Debug)]
pub struct OperatingCase {
    /// `command/load`, e.g. `S2/100`.
    pub name: String,
    /// The command alone, e.g. `S2`.
    pub command: String,
    /// One signal per input of the system.
    pub inputs: Vec<Piecewise>,
}

/// A study that can be run.
pub struct Study {
    /// The name in files.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// The file's text, to be kept beside results.
    pub text: String,
    /// The system.
    pub system: System,
    /// Length of every run, s.
    pub duration_s: f64,
    /// Time between samples, s.
    pub sample_period_s: f64,
    /// The units that can fail.
    pub units: Vec<String>,
    /// The intensities of every fault.
    pub intensities: Vec<f64>,
    /// Every fault with every intensity, in the order of the classes.
    pub faults: Vec<FaultCase>,
    /// The classes, in the order of the file.
    pub classes: Vec<Class>,
    /// Commands × loads.
    pub cases: Vec<OperatingCase>,
    /// The input that the commands drive.
    pub command_input: usize,
    /// The sensors that residuals are made of, as positions in the system's
    /// list; the extra one, where there is one, is the last.
    pub measured: Vec<usize>,
    /// The same sensors as features see them.
    pub sensors: Sensors,
    /// What the extra sensor is, in words.
    pub extra_sensor: Option<String>,
    /// How reality differs from the twin.
    pub realism: Option<Realism>,
    /// The flights from which the diagnosis learns, where they are others than those it is judged
    /// on.
    pub training: Option<Training>,
    /// What the flight control computer does when a command is raised.
    pub reactions: Reactions,
    /// Where it was read.
    path: String,
    parsed: Box<Text>,
}

/// Why there is no study.
#[derive(Debug)]
pub enum StudyError {
    /// The file cannot be read.
    File(FileError),
    /// The file is not as a study file must be; the message has line and column.
    Syntax {
        /// The file.
        path: String,
        /// What is wrong.
        error: Box<toml::de::Error>,
    },
    /// The system has mistakes.
    System(SystemError),
    /// A name that the system does not have.
    Unknown {
        /// The study file.
        path: String,
        /// What the name should be.
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest right one.
        nearest: Option<String>,
    },
    /// A number outside its range.
    OutOfRange {
        /// The study file.
        path: String,
        /// The field.
        field: String,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A signal that cannot be built.
    Signal {
        /// The study file.
        path: String,
        /// The signal.
        name: String,
        /// Why.
        error: Box<crate::signal::SignalError>,
    },
    /// A list that must not be empty.
    Empty {
        /// The study file.
        path: String,
        /// The list.
        field: &'static str,
    },
}

impl fmt::Display for StudyError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StudyError::File(error) => write!(out, "{error}"),
            StudyError::Syntax { path, error } => write!(out, "{path}: {error}"),
            StudyError::System(error) => write!(out, "{error}"),
            StudyError::Unknown { path, what, name, nearest } => {
                write!(out, "{path}: there is no {what} '{name}'")?;
                match nearest {
                    Some(nearest) => write!(out, "; did you mean '{nearest}'?"),
                    None => Ok(()),
                }
            }
            StudyError::OutOfRange { path, field, value, allowed } => {
                write!(out, "{path}: {field} is {value}, but must be {allowed}")
            }
            StudyError::Signal { path, name, error } => {
                write!(out, "{path}: signal '{name}': {error}")
            }
            StudyError::Empty { path, field } => write!(out, "{path}: '{field}' is empty"),
        }
    }
}

impl std::error::Error for StudyError {}

/// What a parser knows while it reads one study.
struct Reader<'a> {
    path: &'a str,
    text: &'a Text,
    system: &'a System,
}

impl Study {
    /// Reads a study from a text; `path` is shown in errors, and a system that
    /// is named as a file is looked for beside it.
    ///
    /// # Errors
    /// The first mistake that was found.
    pub fn parse(text: &str, path: &str) -> Result<Self, StudyError> {
        let parsed = parse_text(text, path)?;
        let system = find_system(&parsed.system, path)?;
        Self::build(text, parsed, path, system)
    }

    /// Reads a study from a text, with the system in a file of its own: as results are stored.
    ///
    /// # Errors
    /// The first mistake that was found.
    pub fn parse_with_system(text: &str, path: &Path, system: &Path) -> Result<Self, StudyError> {
        let path = path.display().to_string();
        let system = System::read(system).map_err(StudyError::System)?;
        Self::build(text, parse_text(text, &path)?, &path, system)
    }

    fn build(text: &str, parsed: Text, path: &str, system: System) -> Result<Self, StudyError> {
        let reader = Reader { path, text: &parsed, system: &system };
        reader.check_numbers()?;
        let (measured, sensors) = reader.sensors()?;
        let classes = reader.classes();
        let faults = reader.faults(&classes)?;
        let cases = reader.cases()?;
        let command_input = reader.input(&reader.text.command.input)?;
        let realism = match &reader.text.realistic {
            Some(text) => Some(Realism::new(text, &reader)?),
            None => None,
        };
        let training = match &reader.text.training {
            Some(text) => Some(Training::new(text, &reader)?),
            None => None,
        };
        if let Some(text) = &reader.text.flights {
            text.check_all(&reader)?;
        }
        let reactions = Reactions::new(&reader.text.reactions, &reader)?;
        Ok(Self {
            name: parsed.name.clone(),
            title: parsed.title.clone(),
            text: text.into(),
            duration_s: parsed.duration_s,
            sample_period_s: 1.0 / parsed.sample_hz,
            intensities: parsed.intensities.clone(),
            units: parsed.units.clone(),
            extra_sensor: parsed.extra_sensor.as_ref().map(|e| e.title.clone()),
            faults,
            classes,
            cases,
            command_input,
            measured,
            sensors,
            realism,
            training,
            reactions,
            path: path.into(),
            parsed: Box::new(parsed),
            system,
        })
    }

    fn reader(&self) -> Reader<'_> {
        Reader { path: &self.path, text: &self.parsed, system: &self.system }
    }

    /// The flights in which the diagnosis at work learns and is judged, drawn anew: their commands
    /// take a second to make, and most commands need none.
    ///
    /// # Errors
    /// A command that cannot be flown.
    pub fn flights(&self) -> Result<Option<Flights>, StudyError> {
        let text = self.parsed.flights.as_ref();
        text.map(|text| Flights::new(text, &self.reader())).transpose()
    }

    /// The same flights in full number, where the study says how many that is.
    ///
    /// # Errors
    /// As [`Study::flights`].
    pub fn full_flights(&self) -> Result<Option<Flights>, StudyError> {
        let text = self.parsed.flights.as_ref().and_then(flights::Text::full);
        text.map(|text| Flights::new(&text, &self.reader())).transpose()
    }

    /// Reads a study file.
    ///
    /// # Errors
    /// The file cannot be read, or the first mistake that was found.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, StudyError> {
        let path = path.as_ref();
        let text = files::read_text(path).map_err(StudyError::File)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// The operating cases of a role; none for training where the study has none of its own.
    pub fn cases_of(&self, role: Role) -> &[OperatingCase] {
        match role {
            Role::Judged => &self.cases,
            Role::Training => self.training.as_ref().map_or(&[], |training| &training.cases),
        }
    }

    /// The roles for which there is a data set.
    pub fn roles(&self) -> Vec<Role> {
        let there = |role: &Role| !self.cases_of(*role).is_empty();
        Role::ALL.into_iter().filter(there).collect()
    }

    /// The sensors as features see them in a setting.
    pub fn sensors_in(&self, setting: Setting) -> Sensors {
        let is_noisy = setting.has_noise();
        Sensors(self.sensors.0.iter().map(|s| Sensor { is_noisy, ..s.clone() }).collect())
    }

    /// Number of sensors without the extra one.
    pub fn base_sensors(&self) -> usize {
        self.measured.len() - usize::from(self.extra_sensor.is_some())
    }

    /// The scales that residuals are divided by.
    pub fn scales(&self) -> Vec<f64> {
        self.measured.iter().map(|&s| self.system.sensors[s].scale).collect()
    }
}

impl Default for Study {
    /// The paper's study of the aileron.
    fn default() -> Self {
        Self::parse(DEFAULT, "studies/paper.toml").unwrap_or_else(|error| panic!("{error}"))
    }
}

fn parse_text(text: &str, path: &str) -> Result<Text, StudyError> {
    toml::from_str(text)
        .map_err(|error| StudyError::Syntax { path: path.into(), error: Box::new(error) })
}

fn find_system(name: &str, study: &str) -> Result<System, StudyError> {
    if let Some((name, text)) = BUILT_IN.iter().find(|(known, _)| *known == name) {
        return System::parse(text, &format!("systems/{name}.toml")).map_err(StudyError::System);
    }
    if !name.ends_with(".toml") {
        let known = BUILT_IN.iter().map(|(known, _)| *known);
        return Err(StudyError::Unknown {
            path: study.into(),
            what: "built-in system (a file ends in .toml)",
            name: name.into(),
            nearest: nearest(name, known).map(Into::into),
        });
    }
    let beside: PathBuf = Path::new(study).parent().unwrap_or(Path::new("")).join(name);
    System::read(beside).map_err(StudyError::System)
}

impl Reader<'_> {
    fn unknown<'n>(
        &self,
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'n str>,
    ) -> StudyError {
        StudyError::Unknown {
            path: self.path.into(),
            what,
            name: name.into(),
            nearest: nearest(name, known).map(Into::into),
        }
    }

    fn range(
        &self,
        field: impl Into<String>,
        value: f64,
        ok: bool,
        allowed: &'static str,
    ) -> Result<(), StudyError> {
        if ok {
            return Ok(());
        }
        Err(StudyError::OutOfRange { path: self.path.into(), field: field.into(), value, allowed })
    }

    fn check_numbers(&self) -> Result<(), StudyError> {
        let t = &self.text;
        let format = f64::from(t.format);
        self.range("format", format, t.format == FORMAT, "1")?;
        let d = t.duration_s;
        self.range("duration_s", d, (0.1..=1e5).contains(&d), "0.1 … 100,000 s")?;
        let f = t.sample_hz;
        self.range("sample_hz", f, (1.0..=1e4).contains(&f), "1 … 10,000 Hz")?;
        for &i in &t.intensities {
            self.range("an intensity", i, i > 0.0 && i <= 1.0, "above 0, at most 1")?;
        }
        let empty = |field| Err(StudyError::Empty { path: self.path.into(), field });
        if t.units.is_empty() {
            return empty("units");
        }
        if t.command.signals.is_empty() {
            return empty("command.signals");
        }
        if t.sensors.is_empty() {
            return empty("sensors");
        }
        Ok(())
    }

    /// Positions of the measured sensors, in the system's order, the extra one
    /// last.
    fn sensors(&self) -> Result<(Vec<usize>, Sensors), StudyError> {
        let list = &self.system.sensors;
        let ids = || list.iter().map(|s| s.id.as_str());
        let mut measured = Vec::new();
        let mut seen = Vec::new();
        for id in self.text.sensors.keys() {
            if !ids().any(|known| known == id) {
                return Err(self.unknown("sensor in the system", id, ids()));
            }
        }
        for (position, sensor) in list.iter().enumerate() {
            let Some(text) = self.text.sensors.get(&sensor.id) else { continue };
            measured.push(position);
            seen.push(self.sensor(position, text)?);
        }
        if let Some(extra) = &self.text.extra_sensor {
            let position = ids().position(|id| id == extra.id);
            let position =
                position.ok_or_else(|| self.unknown("sensor in the system", &extra.id, ids()))?;
            measured.push(position);
            let (name, noise) = (list[position].label.clone(), self.noise(position));
            seen.push(Sensor {
                name,
                quantity: Quantity::Surface,
                unit: None,
                noise,
                is_noisy: true,
            });
        }
        Ok((measured, Sensors(seen)))
    }

    fn sensor(&self, position: usize, text: &SensorText) -> Result<Sensor, StudyError> {
        let label = &self.system.sensors[position].label;
        let words = || Quantity::ALL.iter().map(|(_, word)| *word);
        let found = Quantity::ALL.iter().find(|(_, word)| *word == text.quantity);
        let (quantity, _) =
            found.ok_or_else(|| self.unknown("quantity", &text.quantity, words()))?;
        let known = text.unit <= self.text.units.len();
        self.range(format!("unit of {label}"), text.unit as f64, known, "0 … number of units")?;
        // A surface is moved by all units, whatever the file says.
        let unit = text.unit.checked_sub(1).filter(|_| *quantity != Quantity::Surface);
        let (name, noise) = (label.clone(), self.noise(position));
        Ok(Sensor { name, quantity: *quantity, unit, noise, is_noisy: true })
    }

    /// What a sample of a sensor carries of noise and quantisation, in parts of its scale.
    fn noise(&self, position: usize) -> f64 {
        let scale = self.system.sensors[position].scale;
        Imperfection::of(&self.system, position).deviation() / scale
    }

    fn cases(&self) -> Result<Vec<OperatingCase>, StudyError> {
        let command = self.input(&self.text.command.input)?;
        let loads: Vec<(String, Option<(usize, f64)>)> = match &self.text.load {
            None => vec![(String::new(), None)],
            Some(load) => {
                let input = self.input(&load.input)?;
                let values = sorted_by_value(&load.values);
                values.into_iter().map(|(n, v)| (format!("/{n}"), Some((input, v)))).collect()
            }
        };
        let mut cases = Vec::new();
        for (name, signal) in &self.text.command.signals {
            for (load_name, load) in &loads {
                let mut inputs = self.default_inputs();
                inputs[command] = self.signal(name, signal, command)?;
                if let Some((input, value)) = *load {
                    inputs[input] = Piecewise::constant(value).expect("a finite value");
                }
                let name = name.clone();
                let case = format!("{name}{load_name}");
                cases.push(OperatingCase { name: case, command: name, inputs });
            }
        }
        Ok(cases)
    }

    fn default_inputs(&self) -> Vec<Piecewise> {
        let inputs = &self.system.network().inputs;
        inputs.iter().map(|i| Piecewise::constant(i.default).expect("checked")).collect()
    }

    fn signal(&self, name: &str, signal: &Signal, input: usize) -> Result<Piecewise, StudyError> {
        let unit = self.system.network().inputs[input].unit;
        signal.build(unit, self.text.duration_s).map_err(|error| StudyError::Signal {
            path: self.path.into(),
            name: name.into(),
            error: Box::new(error),
        })
    }

    fn input(&self, id: &str) -> Result<usize, StudyError> {
        let inputs = &self.system.network().inputs;
        let position = inputs.iter().position(|i| i.id == id);
        let known = inputs.iter().map(|i| i.id.as_str());
        position.ok_or_else(|| self.unknown("input of the system", id, known))
    }
}

/// `50` before `100`, although it is not so in the alphabet.
fn sorted_by_value(values: &BTreeMap<String, f64>) -> Vec<(String, f64)> {
    let mut sorted: Vec<(String, f64)> = values.iter().map(|(n, v)| (n.clone(), *v)).collect();
    sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
    sorted
}
