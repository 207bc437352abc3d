//! A study: the faults, the operating cases, and the sensors that see them.
//!
//! A study file names a system, the commands and loads, the classes of Table 1
//! of the seed paper with their faults, and how reality differs from the twin. The
//! fault list ([`faults`]), the records (`servotwin::records`) and the data set follow from
//! it.

mod calibration;
mod complete;
pub mod faults;
pub mod flights;
mod ground_test;
mod keys;
mod laws;
pub mod other_plant;
mod quick;
pub(crate) mod reactions;
mod reader;
mod realism;
mod seed;
pub mod suites;
mod training;
mod warning;

pub(crate) use calibration::Calibration;
pub use faults::{Class, FaultCase};
pub use flights::Environment;
pub(crate) use flights::{ChosenEnvironment, EnvironmentRanges, Flights};
pub(crate) use other_plant::{OtherPlant, PlantDraw};
pub use reactions::Reaction;
pub(crate) use reactions::Reactions;
pub use realism::Scenario;
pub(crate) use realism::{MAX_DEVIATION, Plants, Realism, Section, Tolerance};
pub(crate) use seed::{Seed, Stream};
pub use suites::{Purpose, Suite};
pub use training::Training;

use crate::built_in;
use crate::format::{self, At, Names, Value, section};
use crate::kind::{FileType, named_system};
use crate::signal::Signal;
use crate::system::System;
use crate::system::imperfection::Imperfection;
use crate::toml_text::{Collector, Diagnostic, TextSpan, TomlError, TomlText};
use keys::{RUN_S, SAMPLE_HZ, some};
use reader::{Noted, Reader};
use servotwin_diagnosis::diagnoser::tuning::usual_least_on;
use servotwin_diagnosis::features::{MAX_ACTUATORS, MAX_FOLLOWED, Quantity, Sensor, Sensors};
use servotwin_model::signal::Piecewise;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// The format of study files that this version reads.
pub(crate) const FORMAT: u32 = 1;

/// The default study: the seed paper's.
const DEFAULT: (&str, &str) = built_in::STUDIES[0];

section! {
    /// A study as its file declares it.
    struct Text {
        #[expect(dead_code, reason = "it is checked before anything else")]
        must format: u32 = Value::Whole(FORMAT as f64, FORMAT as f64), "version of the file format";
        must name: String, "name of the study in files";
        must title: String, "title of the study, one line";
        must system: At<String>, "a built-in system, or a file in the same folder";
        may seed: u64 = Value::Whole(0.0, 999.0), "seed of everything that is drawn; default 0";
        must duration_s: f64 = RUN_S, "length of every run";
        must sample_hz: f64 = SAMPLE_HZ, "sampling rate";
        must intensities: At<Vec<At<f64>>> = Value::List(0, &INTENSITY),
            "intensities at which every fault is simulated";
        must actuators: Vec<At<String>> = some::<Vec<At<String>>>(),
            "actuators that can fail; [\"\"] if the system is a single actuator";
        must command: CommandText, "commands of the evaluation";
        may load: Option<LoadText>, "loads; every command runs at each of them";
        must sensors: Names<SensorText> = some::<Names<SensorText>>(),
            "sensors that the diagnosis reads";
        may extra_sensor: Option<ExtraText>, "additional sensor whose benefit is assessed";
        may classes: Vec<ClassText>, "groups of faults with the same cause and the same remedy";
        may realistic: Option<realism::Text>, "how real specimens differ from the twin";
        may fitted: Option<At<calibration::Text>>,
            "scenario in which each specimen has a twin fitted to it";
        may training: Option<At<training::Text>>, "commands from which the diagnosis learns";
        may flights: Option<At<flights::Text>>, "flights in which a fault begins";
        may suites: Names<suites::NamedText>, "how many flights there are, and what for";
        may ground_test: Option<At<ground_test::Text>>,
            "test on the ground: one command from rest, one window, one decision";
        may on_ground: bool, "true: the study is that of its tests on the ground";
        may quick: Option<quick::Text>, "smaller sizes of the study, used without `--full`";
        may full: bool, "true selects the full sizes, like `--full`";
        may reactions: Names<reactions::Text>, "effect of each action on the system";
    }
}

const INTENSITY: Value = Value::Number(1e-6, 1.0, "");

section! {
    struct CommandText {
        must input: At<String>, "input that the commands drive";
        must signals: Names<Signal> = some::<Names<Signal>>(),
            "commands by name";
    }
}

section! {
    struct LoadText {
        must input: At<String>, "input that carries the load";
        must values: Names<At<f64>> = some::<Names<At<f64>>>(),
            "loads by name, in SI units";
    }
}

section! {
    struct SensorText {
        must quantity: Quantity, "role of the sensor in the diagnosis";
        must actuator: At<usize> = Value::Whole(0.0, 1e6),
            "position of its actuator in `actuators`, from 1; 0 for none";
        may follows_controller: At<bool>,
            "whether it follows other sensors by the law of the controller that drives it";
        may follows: At<Names<f64>>,
            "slopes against the sensors that it follows by a law, in SI units";
    }
}

section! {
    struct ExtraText {
        must id: At<String>, "id of the sensor in the system";
        must title: String, "name of the sensor in the report";
    }
}

section! {
    struct ClassText {
        must detail: At<String>, "faulty component or group of components";
        must action: At<String>, "action that these faults require";
        must faults: Vec<At<String>> = some::<Vec<At<String>>>(),
            "names of faults, without the name of the actuator";
    }
}

/// A study that is ready to run. [`Study::run`] runs it.
pub struct Study {
    /// The name of the study in files.
    pub name: String,
    /// A one-line title for readers.
    pub title: String,
    /// The text of the file, stored beside results.
    pub text: String,
    /// The system that the study is about.
    pub system: System,
    /// The seed of everything that is drawn.
    pub seed: u64,
    /// Length of every run, s.
    pub duration_s: f64,
    /// Time between samples, s.
    pub sample_period_s: f64,
    /// The names of the actuators that can fail.
    pub actuators: Vec<String>,
    /// The intensities of every fault, above 0 and at most 1.
    pub intensities: Vec<f64>,
    /// Every fault at every intensity, in the order of the classes.
    pub faults: Vec<FaultCase>,
    /// The classes in the order of the file.
    pub classes: Vec<Class>,
    /// Operating cases: each command at each load.
    pub cases: Vec<Environment>,
    /// The index of the input that the commands drive.
    pub command_input: usize,
    /// The sensors with residuals, as indices into the system's list. An extra sensor
    /// comes last.
    pub measured: Vec<usize>,
    /// The same sensors as seen by features.
    pub sensors: Sensors,
    /// A description of the extra sensor, if there is one.
    pub extra_sensor: Option<String>,
    /// What all flights have in common; `None` if the study has none.
    pub flights: Option<Flights>,
    /// How reality differs from the twin.
    pub realism: Option<Realism>,
    /// The calibration flight and the specimens of the fitted scenario.
    pub calibration: Option<Calibration>,
    /// The training flights, if they differ from those of the evaluation.
    pub training: Option<Training>,
    /// The reactions of the flight control computer to raised actions.
    pub reactions: Reactions,
    /// Whether the study has its full sizes, rather than those of its section `[quick]`.
    pub is_full: bool,
    suites: suites::Suites,
    /// The path that the study was read from.
    path: String,
    parsed: Box<Text>,
}

impl Study {
    /// Parses a study. `path` appears in errors, and the file of its system is resolved relative to
    /// it.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse(text: &str, path: &str) -> Result<Self, TomlError> {
        let (parsed, mut mistakes) = read_text(text, path)?;
        match find_system(&parsed.system, path, &mut mistakes) {
            Some(system) => Self::build(text, (parsed, mistakes), path, system?),
            None => Err(mistakes.refuse(path, text)),
        }
    }

    /// Parses a study for an existing system.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse_for(text: &str, path: &str, system: System) -> Result<Self, TomlError> {
        Self::build(text, read_text(text, path)?, path, system)
    }

    fn build(
        source: &str,
        (parsed, mistakes): (Text, Collector),
        path: &str,
        mut system: System,
    ) -> Result<Self, TomlError> {
        let mistakes = RefCell::new(mistakes);
        let reader = Reader { path, source, text: &parsed, system: &system, mistakes };
        reader.check_test_sensors();
        let mistakes = reader.mistakes;
        parsed.add_test_sensors(&mut system);
        let reader = Reader { path, source, text: &parsed, system: &system, mistakes };
        let study = Self::of_parts(&reader);
        Ok(reader.finish(study)?(parsed, system))
    }

    /// Builds all parts, so that the mistakes of each are noted. They become a study with the text and its system.
    fn of_parts(reader: &Reader) -> Result<impl FnOnce(Text, System) -> Self + use<>, Noted> {
        let text = reader.text;
        let sensors = reader.sensors();
        let (classes, faults) = (reader.classes(), reader.faults());
        let command_input = reader.command_input();
        let cases = reader.cases();
        let realism = text.realistic.as_ref().map(|text| Realism::new(text, reader));
        let training = text.training.as_ref().map(|text| Training::new(text, reader)).transpose();
        let flown = reader.flown();
        let reactions = Reactions::new(&text.reactions, reader);
        reader.check_ground_test();
        let (measured, sensors) = sensors?;
        let (calibration, flights, suites) = flown?;
        let (cases, command_input, training) = (cases?, command_input?, training?);
        let reactions = reactions?;
        let (path, source) = (reader.path.to_owned(), reader.source.to_owned());
        Ok(move |parsed: Text, system| Self {
            name: parsed.name.clone(),
            title: parsed.title.clone(),
            text: source,
            seed: parsed.seed,
            duration_s: parsed.duration_s,
            sample_period_s: 1.0 / parsed.sample_hz,
            intensities: parsed.intensities.iter().map(|intensity| intensity.value).collect(),
            actuators: parsed.actuators.iter().map(|actuator| actuator.value.clone()).collect(),
            extra_sensor: parsed.extra_sensor.as_ref().map(|e| e.title.clone()),
            faults,
            classes,
            cases,
            command_input,
            measured,
            sensors,
            flights,
            realism,
            calibration,
            training,
            reactions,
            suites,
            is_full: parsed.is_full(),
            path,
            parsed: Box::new(parsed),
            system,
        })
    }

    fn reader(&self) -> Reader<'_> {
        Reader {
            path: &self.path,
            source: &self.text,
            text: &self.parsed,
            system: &self.system,
            mistakes: RefCell::default(),
        }
    }

    /// What varies between environments; `None` if the study declares no flights.
    pub fn environment_ranges(&self) -> Option<EnvironmentRanges> {
        let of = |Flights { varied, onset_s, duration_s, .. }: &Flights| {
            varied.ranges(&self.actuators, *onset_s, *duration_s)
        };
        self.flights.as_ref().map(of)
    }

    /// Environments by their places in [`Study::environment_ranges`]; `None` if the study declares no flights.
    ///
    /// # Errors
    /// A command cannot be flown.
    pub(crate) fn chosen_environments(
        &self,
        chosen: &[ChosenEnvironment],
    ) -> Result<Option<Vec<Environment>>, TomlError> {
        let Some(Flights { varied, duration_s, .. }) = &self.flights else { return Ok(None) };
        let reader = self.reader();
        let drawn = |(place, chosen): (usize, &ChosenEnvironment)| {
            varied.environment(&reader, chosen, format!("chosen/{place:03}"), *duration_s)
        };
        let drawn = chosen.iter().enumerate().map(drawn).collect();
        reader.finish(drawn).map(Some)
    }

    /// The path of the system file that a study names. `None` if the system is built in or the study is unreadable.
    pub fn system_file(path: &Path) -> Option<PathBuf> {
        let (text, _) = FileType::Study.read(path).ok()?;
        let name = named_system(&text).filter(|name| name.ends_with(".toml"))?;
        Some(beside(&name, path))
    }

    /// Reads a study file or a built-in study by name.
    ///
    /// # Errors
    /// The file cannot be read, or all mistakes in it.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, TomlError> {
        let (text, name) = FileType::Study.read(path.as_ref())?;
        Self::parse(&text, &name)
    }

    /// The operating cases of the records for a purpose. Empty for training if the study has no training commands.
    pub fn cases_of(&self, purpose: Purpose) -> &[Environment] {
        match purpose {
            Purpose::Train => self.training.as_ref().map_or(&[], |training| &training.cases),
            _ => &self.cases,
        }
    }

    /// The index of the actuator that a fault or another part of the system belongs to by its name; `None` if it
    /// belongs to no single one. The only actuator of a study has all.
    pub fn actuator_of(&self, name: &str) -> Option<usize> {
        let has_it = |actuator: &String| {
            let rest = name.strip_prefix(actuator.as_str());
            self.actuators.len() == 1 || rest.is_some_and(|rest| rest.starts_with('.'))
        };
        self.actuators.iter().position(has_it)
    }

    /// The name of a fault without its actuator.
    pub fn kind_of<'f>(&self, fault: &'f str) -> &'f str {
        let own = self
            .actuator_of(fault)
            .map(|actuator| faults::full_name(&self.actuators[actuator], ""));
        own.and_then(|own| fault.strip_prefix(&own)).unwrap_or(fault)
    }

    /// The purposes for which there is a data set.
    pub fn purposes(&self) -> Vec<Purpose> {
        let there = |purpose: &Purpose| !self.cases_of(*purpose).is_empty();
        Purpose::OF_RECORDS.into_iter().filter(there).collect()
    }

    /// The input that carries the load, as an index into the system's inputs; `None` for a study without loads.
    pub fn load_input(&self) -> Option<usize> {
        let load = self.parsed.load.as_ref()?;
        self.system.network().inputs.iter().position(|input| input.id == load.input.value)
    }

    /// A command of the evaluation by its name.
    pub fn command_signal(&self, name: &str) -> Option<&Signal> {
        self.parsed.command.signals.get(name)
    }

    /// A training command that the file names.
    pub fn training_signal(&self, name: &str) -> Option<&Signal> {
        self.parsed.training.as_ref()?.signals.get(name)
    }

    /// The patterns from which training commands are drawn, each with their number.
    pub fn training_draws(&self) -> impl Iterator<Item = (usize, &str)> {
        let draws = self.parsed.training.iter().flat_map(|training| &training.draws);
        draws.map(|draws| (draws.count, draws.signal.as_str()))
    }

    /// The sensors as seen by features in a scenario.
    pub fn sensors_in(&self, scenario: Scenario) -> Sensors {
        let is_noisy = scenario.has_noise();
        Sensors(self.sensors.0.iter().map(|s| Sensor { is_noisy, ..s.clone() }).collect())
    }

    /// The number of sensors without the extra one.
    pub fn base_sensors(&self) -> usize {
        self.measured.len() - usize::from(self.extra_sensor.is_some())
    }

    /// The actions, the most urgent first: those that switch an actuator off, then the others. Each group has the
    /// order of the classes.
    pub fn actions(&self) -> Vec<String> {
        let mut actions: Vec<String> = vec![];
        for class in &self.classes {
            if !actions.contains(&class.action) {
                actions.push(class.action.clone());
            }
        }
        actions.sort_by_key(|action| !self.reactions.switches_off(action));
        actions
    }

    /// Whether the sensors of all actuators correspond, so that features can take each actuator's view.
    pub(crate) fn has_like_actuators(&self) -> bool {
        self.sensors.rotations(self.actuators.len()).is_some()
    }

    /// The number of actuators that must stay on in operation: the study's value, or by default one of several.
    pub fn least_on(&self) -> u32 {
        let said = self.flights.as_ref().and_then(|flights| flights.least_on);
        said.unwrap_or_else(|| usual_least_on(self.actuators.len()))
    }

    /// The actions that switch an actuator off.
    pub fn shutdowns(&self) -> Vec<String> {
        let mut actions = self.actions();
        actions.retain(|action| self.reactions.switches_off(action));
        actions
    }

    /// The scales of residuals, one for each measured sensor, in SI units.
    pub fn scales(&self) -> Vec<f64> {
        self.measured.iter().map(|&s| self.system.sensors[s].scale).collect()
    }
}

impl Default for Study {
    /// The seed paper's study of the aileron.
    fn default() -> Self {
        Self::parse(DEFAULT.1, &format!("studies/{}.toml", DEFAULT.0))
            .unwrap_or_else(|error| panic!("{error}"))
    }
}

/// The JSON Schema of study files, as [`crate::system::schema`].
pub fn schema() -> serde_json::Value {
    format::schema("servotwin study file", Text::KEYS, serde_json::Map::new())
}

/// The keys of a study file.
pub fn keys() -> &'static [format::Key] {
    Text::KEYS
}

/// Reads a text, with the mistakes on which nothing else depends. Others are the error: without a value, what depends on
/// it cannot be checked.
fn read_text(text: &str, path: &str) -> Result<(Text, Collector), TomlError> {
    if let Some(mistakes) = FileType::Study.wanted(text) {
        return Err(mistakes.refuse(path, text));
    }
    let mut mistakes = Collector::default();
    let Some(document) = TomlText::parse(text, FORMAT, &mut mistakes) else {
        return Err(mistakes.refuse(path, text));
    };
    let parsed = Text::of(&document.root(), (&(0..0), "the file"), &mut mistakes);
    match parsed.filter(|parsed| parsed.check_lists(&mut mistakes)) {
        Some(parsed) => {
            let parsed = parsed.in_its_size();
            Ok((if parsed.on_ground { parsed.on_ground() } else { parsed }, mistakes))
        }
        None => Err(mistakes.refuse(path, text)),
    }
}

impl Text {
    /// Notes duplicates in lists whose elements must be unique, and impossible actuators; `false` for the latter.
    fn check_lists(&self, mistakes: &mut Collector) -> bool {
        let mut once = |what: &str, elements: Vec<(String, &TextSpan)>| {
            let mut seen: Vec<String> = vec![];
            for (name, at) in elements {
                if seen.contains(&name) {
                    let mistake = format!("the {what} '{name}' stands twice");
                    mistakes.note(at, Diagnostic::new(mistake));
                }
                seen.push(name);
            }
        };
        let numbers = self.intensities.iter().map(|own| (own.value.to_string(), &own.at));
        let names = |own: &'_ At<String>| own.value.clone();
        once("intensity", numbers.collect());
        once("actuator", self.actuators.iter().map(|own| (names(own), &own.at)).collect());
        // A fault belongs to one class, and a parameter to one tolerance.
        let faults = self.classes.iter().flat_map(|class| &class.faults);
        once("fault", faults.map(|own| (names(own), &own.at)).collect());
        let tolerances = self.realistic.iter().flat_map(|realistic| &realistic.tolerances);
        let parameters = tolerances.flat_map(|tolerance| &tolerance.parameters);
        once("tolerance of", parameters.map(|own| (names(own), &own.at)).collect());
        let whole =
            self.actuators.iter().find(|actuator| actuator.is_empty() && self.actuators.len() > 1);
        if let Some(whole) = whole {
            let message = "the actuator '' is the whole system, which has no other actuators";
            mistakes.note(&whole.at, Diagnostic::new(message));
        }
        let surplus = self.actuators.get(MAX_ACTUATORS);
        if let Some(surplus) = surplus {
            let (count, allowed) = (self.actuators.len(), format!("at most {MAX_ACTUATORS}"));
            let mistake = Diagnostic::not_allowed("number of actuators", count, allowed);
            mistakes.note(&surplus.at, mistake);
        }
        whole.is_none() && surplus.is_none()
    }
}

/// Finds the system of a study; notes an unknown name.
fn find_system(
    name: &At<String>,
    study: &str,
    mistakes: &mut Collector,
) -> Option<Result<System, TomlError>> {
    if let Some(text) = built_in::find(&built_in::SYSTEMS, name) {
        return Some(System::parse(text, &format!("systems/{}.toml", **name)));
    }
    if !name.ends_with(".toml") {
        let known = built_in::SYSTEMS.iter().map(|(known, _)| *known);
        let message = format!("there is no built-in system (a file ends in .toml) '{}'", **name);
        mistakes.note(&name.at, Diagnostic::unknown(message, name, known));
        return None;
    }
    Some(System::read(beside(name, Path::new(study))))
}

/// The path where a study looks for its system file.
fn beside(name: &str, study: &Path) -> PathBuf {
    study.parent().unwrap_or(Path::new("")).join(name)
}

/// The index of the load input and its value; `None` if the study has no load.
type Load = Option<(usize, Piecewise)>;

impl Reader<'_> {
    /// What is flown: the calibration flight, the flights, and their suites.
    fn flown(&self) -> Result<(Option<Calibration>, Option<Flights>, suites::Suites), Noted> {
        let text = self.text;
        let flights = text.flights.as_ref().map(|text| Flights::new(text, self)).transpose();
        let fitted = text.fitted.as_ref().filter(|_| !text.on_ground);
        let calibration = fitted.map(|text| Calibration::new(text, self)).transpose();
        let flights = flights?;
        let test = text.ground_test.as_ref().filter(|_| text.on_ground);
        let first_test = flights.as_ref().zip(test);
        let first_test =
            first_test.map(|(flights, test)| Calibration::first_test(flights, &test.at, self));
        let suites = flights.as_ref().map(|flights| suites::suites(self, flights)).transpose();
        if let (None, Some(name)) = (&flights, text.suites.keys().next()) {
            self.empty(&name.at, "flights");
        }
        let calibration = first_test.transpose()?.or(calibration?);
        Ok((calibration, flights, suites?.unwrap_or_default()))
    }

    /// The indices of the measured sensors in the system's order, with the extra one
    /// last.
    fn sensors(&self) -> Result<(Vec<usize>, Sensors), Noted> {
        let list = &self.system.sensors;
        let ids = || list.iter().map(|s| s.id.as_str());
        let mut measured = Vec::new();
        let mut seen = Vec::new();
        for id in self.text.sensors.keys() {
            if !ids().any(|known| known == id.as_str()) {
                self.unknown(&id.at, ("sensor in the system", id), ids());
            }
        }
        for (position, sensor) in list.iter().enumerate() {
            let Some(text) = self.text.sensors.get(sensor.id.as_str()) else { continue };
            if let Ok(sensor) = self.sensor(position, text) {
                measured.push(position);
                seen.push(sensor);
            }
        }
        if let Some(extra) = &self.text.extra_sensor {
            let position = ids().position(|id| id == extra.id.as_str());
            let what = ("sensor in the system", extra.id.as_str());
            let unknown = || self.unknown(&extra.id.at, what, ids());
            let position = position.ok_or_else(unknown)?;
            let sensor = self.seen(position, Quantity::Surface, None);
            if measured.contains(&position) {
                self.repeated("sensor", &extra.id.at, &extra.id);
            }
            measured.push(position);
            seen.push(sensor);
        }
        self.add_laws(&measured, &mut seen);
        Ok((measured, Sensors(seen)))
    }

    fn sensor(&self, position: usize, text: &SensorText) -> Result<Sensor, Noted> {
        let quantity = text.quantity;
        // All actuators move the surface together, so its sensor belongs to none of them.
        let actuator = self.actuator(&text.actuator)?.filter(|_| quantity != Quantity::Surface);
        Ok(self.seen(position, quantity, actuator))
    }

    /// The index of the actuator with a position, from 1; `None` for 0.
    fn actuator(&self, At { value: actuator, at }: &At<usize>) -> Result<Option<usize>, Noted> {
        let actuators = self.text.actuators.len();
        let allowed = format!("0 … {actuators}, as there are actuators");
        self.range(("actuator", at), *actuator as f64, *actuator <= actuators, allowed)?;
        Ok(actuator.checked_sub(1))
    }

    /// A sensor as seen by features, by its index in the system.
    fn seen(&self, position: usize, quantity: Quantity, actuator: Option<usize>) -> Sensor {
        let own = &self.system.sensors[position];
        // Noise and quantization of a sample, as a share of the sensor's scale.
        let noise = Imperfection::of(self.system, position).deviation() / own.scale;
        let name = own.id.clone();
        Sensor { name, quantity, actuator, noise, is_noisy: true, follows: vec![] }
    }

    /// Adds the sensors that each sensor follows. `measured` has the indices of all sensors. Mistakes are noted.
    fn add_laws(&self, measured: &[usize], seen: &mut [Sensor]) {
        for (place, sensor) in seen.iter_mut().enumerate() {
            let id = &self.system.sensors[measured[place]].id;
            let Some(text) = self.text.sensors.get(id.as_str()) else { continue };
            if text.follows_controller.value {
                let law = laws::of_controller(self.system, measured, place);
                if law.is_empty() {
                    let mistake = format!(
                        "no controller drives what '{id}' measures by what other sensors of the study read"
                    );
                    self.note(&text.follows_controller.at, Diagnostic::new(mistake));
                }
                sensor.follows = self.in_scales(measured, place, &law);
                continue;
            }
            let At { value: follows, at } = &text.follows;
            let (count, few) = (follows.len(), follows.len() <= MAX_FOLLOWED);
            let allowed = format!("at most {MAX_FOLLOWED} others");
            let _ = self.range(("follows", at), count as f64, few, allowed);
            let follow = |(id, &weight): (&At<String>, &f64)| {
                self.follow(measured, place, (id, weight)).ok()
            };
            sensor.follows = follows.iter().filter_map(follow).collect();
        }
    }

    /// The sensors that a sensor follows, with weights in shares of scale instead of SI.
    fn in_scales(
        &self,
        measured: &[usize],
        place: usize,
        law: &[(usize, f64)],
    ) -> Vec<(usize, f64)> {
        let scale = |place: usize| self.system.sensors[measured[place]].scale;
        law.iter().map(|&(other, weight)| (other, weight * (scale(other) / scale(place)))).collect()
    }

    /// The place of a followed sensor, and its weight in shares of scale.
    fn follow(
        &self,
        measured: &[usize],
        place: usize,
        (followed, weight): (&At<String>, f64),
    ) -> Result<(usize, f64), Noted> {
        let sensor = |place: usize| &self.system.sensors[measured[place]];
        let others = || (0..measured.len()).filter(|&other| other != place);
        let known = || others().map(|other| sensor(other).id.as_str());
        let other = others().find(|&other| sensor(other).id == followed.value);
        let what = ("other sensor", followed.as_str());
        let other = other.ok_or_else(|| self.unknown(&followed.at, what, known()))?;
        Ok(self.in_scales(measured, place, &[(other, weight)])[0])
    }

    fn cases(&self) -> Result<Vec<Environment>, Noted> {
        let loads = self.loads();
        let command = self.command_input()?;
        let mut commands = vec![];
        for (name, signal) in &self.text.command.signals {
            let (signal, duration_s) = (Ok(signal.clone()), self.text.duration_s);
            let built = self.signal((name, &name.at), signal, command, duration_s);
            commands.extend(built.map(|built| (name, built)));
        }
        let (loads, mut cases) = (loads?, Vec::new());
        for (name, built) in commands {
            for (load_name, load) in &loads {
                let mut inputs = self.default_inputs();
                inputs[command] = built.clone();
                if let Some((input, value)) = load {
                    inputs[*input] = value.clone();
                }
                let case = format!("{}{load_name}", **name);
                if cases.iter().any(|other: &Environment| other.name == case) {
                    self.repeated("case", &name.at, &case);
                }
                let (command, parameters) = (name.value.clone(), vec![]);
                cases.push(Environment { name: case, command, inputs, parameters });
            }
        }
        Ok(cases)
    }

    /// The suffix that each load adds to the names of cases, with the load itself.
    fn loads(&self) -> Result<Vec<(String, Load)>, Noted> {
        let Some(load) = &self.text.load else { return Ok(vec![(String::new(), None)]) };
        let input = self.input(&load.input.at, &load.input)?;
        let mut values: Vec<_> = load.values.iter().collect();
        // By value: `50` comes before `100`, unlike in alphabetical order.
        values.sort_by(|a, b| a.1.total_cmp(b.1));
        let values = values.into_iter().map(|(name, value)| {
            let curve = self.constant((name, &value.at), input, value.value)?;
            Ok((format!("/{}", **name), Some((input, curve))))
        });
        Ok(self.sound(values))
    }

    fn default_inputs(&self) -> Vec<Piecewise> {
        let inputs = &self.system.network().inputs;
        inputs.iter().map(|i| Piecewise::constant(i.default).expect("checked")).collect()
    }
}
