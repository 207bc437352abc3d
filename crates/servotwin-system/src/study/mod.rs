//! A study: the faults, the operating cases, and the sensors that see them.
//!
//! A study file names a system, the commands and loads, the classes of Table 1
//! of the seed paper with their faults, and how reality differs from the twin. The
//! fault list ([`faults`]), the campaign (`servotwin::campaign`) and the data set follow from
//! it.

mod calibration;
mod complete;
pub mod evaluating;
pub mod faults;
pub mod flights;
mod ground_test;
mod keys;
mod laws;
mod mistake;
pub mod other_plant;
mod quick;
pub(crate) mod reactions;
mod reader;
mod realism;
mod seed;
pub mod suites;
mod training;
mod warning;

pub use calibration::Calibration;
pub use evaluating::Evaluating;
pub use faults::{Class, FaultCase};
pub use flights::{ChosenEnvironment, Environment, EnvironmentRanges, Flights};
pub use other_plant::{OtherPlant, PlantDraw};
pub use reactions::{Reaction, Reactions};
pub use realism::{MAX_DEVIATION, Plants, Realism, Scenario, Section, Tolerance};
pub use seed::{Seed, Stream};
pub use suites::{Purpose, Suite};
pub use training::Training;
pub use warning::Warning;

use crate::built_in;
use crate::document::{
    self, Collector, Diagnostic, Entry, KeyPath, TextSpan, entries, plain_table, write_mistakes,
};
use crate::files::FileError;
use crate::format::{self, Value, section};
use crate::kind::{FileType, named_system};
use crate::nearest::nearest;
use crate::signal::Signal;
use crate::system::imperfection::Imperfection;
use crate::system::{System, SystemError};
use keys::{QUANTITY, RUN_S, some};
use mistake::StudyMistake;
use reader::{Noted, OTHER_SENSOR, Reader};
use serde::Deserialize;
use servotwin_diagnosis::diagnoser::tuning::usual_least_on;
use servotwin_diagnosis::features::{MAX_ACTUATORS, MAX_FOLLOWED, Quantity, Sensor, Sensors};
use servotwin_model::signal::Piecewise;
use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

/// The format of study files that this version reads.
pub(crate) const FORMAT: u32 = 1;

/// The default study: the seed paper's.
const DEFAULT: (&str, &str) = built_in::STUDIES[0];

section! {
    /// A study as its file declares it.
    struct Text {
        #[expect(dead_code, reason = "read_text looks at it before anything else")]
        must format: u32 = Value::Whole(FORMAT as f64, FORMAT as f64), "version of the file format";
        must name: String, "name of the study in files";
        must title: String, "title of the study, one line";
        must system: String, "a built-in system, or a file in the same folder";
        #[serde(default)]
        may seed: u64 = Value::Whole(0.0, 999.0), "seed of everything that is drawn; default 0";
        must duration_s: f64 = RUN_S, "length of every run";
        must sample_hz: f64 = Value::Number(1.0, 1e4, "Hz"), "sampling rate";
        must intensities: Vec<f64> = Value::List(0, &INTENSITY),
            "intensities at which every fault is simulated";
        must units: Vec<String> = some::<Vec<String>>(),
            "channels that can fail; [\"\"] if the system is a single channel";
        must command: CommandText, "commands of the evaluation";
        may load: Option<LoadText>, "loads; every command runs at each of them";
        must sensors: BTreeMap<String, SensorText> = some::<BTreeMap<String, SensorText>>(),
            "sensors that the diagnosis reads";
        may extra_sensor: Option<ExtraText>, "additional sensor whose benefit is assessed";
        #[serde(default)]
        may classes: Vec<ClassText>, "groups of faults with the same cause and the same remedy";
        may realistic: Option<realism::Text>, "how real specimens differ from the twin";
        may fitted: Option<calibration::Text>,
            "scenario in which each specimen has a twin fitted to it";
        may training: Option<training::Text>, "commands from which the diagnosis learns";
        may evaluation: Option<evaluating::Text>, "training and evaluation, where not the defaults";
        may flights: Option<flights::Text>, "flights in which a fault begins";
        #[serde(default)]
        may suites: BTreeMap<String, suites::Text>, "how many flights there are, and what for";
        may ground_test: Option<ground_test::Text>,
            "test on the ground: one command from rest, one window, one decision";
        #[serde(default)]
        may on_ground: bool, "true: the study is that of its tests on the ground";
        may quick: Option<quick::Text>, "smaller sizes of the study, used without `--full`";
        #[serde(default)]
        may full: bool, "true selects the full sizes, like `--full`";
        #[serde(default)]
        may reactions: BTreeMap<String, reactions::Text>, "effect of each action on the system";
    }
}

const INTENSITY: Value = Value::Number(1e-6, 1.0, "");

section! {
    struct CommandText {
        must input: String, "input that the commands drive";
        must signals: BTreeMap<String, Signal> = some::<BTreeMap<String, Signal>>(),
            "commands by name";
    }
}

section! {
    struct LoadText {
        must input: String, "input that carries the load";
        must values: BTreeMap<String, f64> = some::<BTreeMap<String, f64>>(),
            "loads by name, in SI units";
    }
}

section! {
    struct SensorText {
        must quantity: String = QUANTITY, "role of the sensor in the diagnosis";
        must unit: usize = Value::Whole(0.0, 1e6),
            "position of its channel in `units`, from 1; 0 for none";
        #[serde(default)]
        may follows_controller: bool,
            "whether it follows other sensors by the law of the controller that drives it";
        #[serde(default)]
        may follows: BTreeMap<String, f64>,
            "slopes against the sensors that it follows by a law, in SI units";
    }
}

section! {
    struct ExtraText {
        must id: String, "id of the sensor in the system";
        must title: String, "name of the sensor in the report";
    }
}

section! {
    struct ClassText {
        must detail: String, "faulty component or group of components";
        must command: String, "action that these faults require";
        must faults: Vec<String> = some::<Vec<String>>(),
            "names of faults, without the name of the channel";
    }
}

/// A study that is ready to run. The trait `servotwin::job::RunStudy` runs it.
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
    pub units: Vec<String>,
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
    /// The settings of training and evaluation in the file.
    pub evaluating: Evaluating,
    /// The reactions of the flight control computer to raised actions.
    pub reactions: Reactions,
    /// Whether the study has its full sizes, rather than those of its section `[quick]`.
    pub is_full: bool,
    suites: suites::Suites,
    /// The path that the study was read from.
    path: String,
    parsed: Box<Text>,
}

/// The reason why a study cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The file cannot be read.
    #[error(transparent)]
    File(FileError),
    /// The system has mistakes.
    #[error(transparent)]
    System(SystemError),
    /// The file has mistakes.
    #[error(fmt = write_mistakes)]
    Mistakes {
        /// The path of the file as the caller gave it.
        path: String,
        /// All mistakes, in the order of the file.
        mistakes: Vec<Diagnostic>,
    },
}

impl Study {
    /// Parses a study. `path` appears in errors, and the file of its system is resolved relative to
    /// it.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse(text: &str, path: &str) -> Result<Self, StudyError> {
        let understood = read_text(text, path)?;
        let system = find_system(&understood.parsed.system, path);
        let system = system.map_err(|error| {
            error.unwrap_or_else(|unknown| {
                let mut mistakes = understood.mistakes.clone();
                mistakes.note(&system_at(text), unknown);
                StudyError::Mistakes { path: path.into(), mistakes: mistakes.locate(text) }
            })
        })?;
        Self::build(text, understood, path, system)
    }

    /// Parses a study and reads its system from a separate file, as stored beside results.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse_with_system(text: &str, path: &Path, system: &Path) -> Result<Self, StudyError> {
        let system = System::read(system).map_err(StudyError::System)?;
        Self::parse_for(text, &path.display().to_string(), system)
    }

    /// Reads a study file or a built-in study by name, with the system from a separate file.
    ///
    /// # Errors
    /// A file cannot be read, or all mistakes in it.
    pub fn read_with_system(path: &Path, system: &Path) -> Result<Self, StudyError> {
        let (text, _) = FileType::Study.read(path).map_err(StudyError::File)?;
        Self::parse_with_system(&text, path, system)
    }

    /// Parses a study for an existing system.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse_for(text: &str, path: &str, system: System) -> Result<Self, StudyError> {
        Self::build(text, read_text(text, path)?, path, system)
    }

    fn build(
        source: &str,
        Understood { parsed, doubtful, mistakes }: Understood,
        path: &str,
        system: System,
    ) -> Result<Self, StudyError> {
        let (mistakes, document) = (RefCell::new(mistakes), OnceCell::new());
        let text = &parsed;
        let reader = Reader { path, source, text, system: &system, mistakes, document, doubtful };
        let parts = Parts::new(&reader);
        let Parts {
            measured,
            sensors,
            classes,
            faults,
            cases,
            command_input,
            flights,
            realism,
            calibration,
            training,
            evaluating,
            reactions,
            suites,
        } = reader.finish(parts)?;
        Ok(Self {
            name: parsed.name.clone(),
            title: parsed.title.clone(),
            text: source.into(),
            seed: parsed.seed,
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
            flights,
            realism,
            calibration,
            training,
            evaluating,
            reactions,
            suites,
            is_full: parsed.is_full(),
            path: path.into(),
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
            document: OnceCell::new(),
            doubtful: vec![],
        }
    }

    /// What varies between environments; `None` if the study declares no flights.
    pub fn environment_ranges(&self) -> Option<EnvironmentRanges> {
        let of = |Flights { varied, onset_s, duration_s, .. }: &Flights| {
            varied.ranges(&self.units, *onset_s, *duration_s)
        };
        self.flights.as_ref().map(of)
    }

    /// Environments by their places in [`Study::environment_ranges`]; `None` if the study declares no flights.
    ///
    /// # Errors
    /// A command cannot be flown.
    pub fn chosen_environments(
        &self,
        chosen: &[ChosenEnvironment],
    ) -> Result<Option<Vec<Environment>>, StudyError> {
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
    pub fn read(path: impl AsRef<Path>) -> Result<Self, StudyError> {
        let (text, name) = FileType::Study.read(path.as_ref()).map_err(StudyError::File)?;
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
    pub fn unit_of(&self, name: &str) -> Option<usize> {
        let has_it = |unit: &String| {
            let rest = name.strip_prefix(unit.as_str());
            self.units.len() == 1 || rest.is_some_and(|rest| rest.starts_with('.'))
        };
        self.units.iter().position(has_it)
    }

    /// The purposes for which there is a data set.
    pub fn purposes(&self) -> Vec<Purpose> {
        let there = |purpose: &Purpose| !self.cases_of(*purpose).is_empty();
        Purpose::OF_RECORDS.into_iter().filter(there).collect()
    }

    /// The input that carries the load, as an index into the system's inputs; `None` for a study without loads.
    pub fn load_input(&self) -> Option<usize> {
        let load = self.parsed.load.as_ref()?;
        self.system.network().inputs.iter().position(|input| input.id == load.input)
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
    pub fn commands(&self) -> Vec<String> {
        let mut commands: Vec<String> = vec![];
        for class in &self.classes {
            if !commands.contains(&class.command) {
                commands.push(class.command.clone());
            }
        }
        commands.sort_by_key(|command| !self.reactions.switches_off(command));
        commands
    }

    /// Whether the sensors of all actuators correspond, so that features can take each actuator's view.
    pub fn has_like_units(&self) -> bool {
        self.sensors.rotations(self.units.len()).is_some()
    }

    /// The number of actuators that must stay on in operation: the study's value, or by default one of several.
    pub fn least_on(&self) -> u32 {
        let said = self.flights.as_ref().and_then(|flights| flights.least_on);
        said.unwrap_or_else(|| usual_least_on(self.units.len()))
    }

    /// The actions that switch an actuator off.
    pub fn shutdowns(&self) -> Vec<String> {
        let mut commands = self.commands();
        commands.retain(|command| self.reactions.switches_off(command));
        commands
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

/// The keys of a study file.
pub fn keys() -> &'static [format::Key] {
    Text::KEYS
}

/// Reads a text and collects its mistakes of form. If nothing else can be checked, those mistakes are the
/// error.
fn read_text(text: &str, path: &str) -> Result<Understood, StudyError> {
    if let Some(mistakes) = FileType::Study.wanted(text) {
        return Err(StudyError::Mistakes { path: path.into(), mistakes });
    }
    let mut mistakes = Collector::new();
    let root = document::parse(text, &mut mistakes);
    let mut parsed = None;
    let all = entries(root.get_ref());
    let format = all.iter().find(|entry| entry.key == "format");
    let found = format.and_then(|entry| entry.number().ok());
    if let (Some(found), Some(format)) = (found, format)
        && found != f64::from(FORMAT)
    {
        let mistake = document::TomlMistake::Format { found, supported: FORMAT };
        mistakes.note(&format.value_at(), mistake);
    }
    if mistakes.is_empty() {
        let note = &mut |at: &TextSpan, mistake| mistakes.note(at, mistake);
        format::check_table(Text::KEYS, &(0..0), "the file", &all, note);
        repetitions(&all, &mut mistakes);
        // The mistakes are already noted, and must not prevent further checks.
        match Text::deserialize(format::mended(Text::KEYS, plain_table(root.get_ref()))) {
            Ok(text) => {
                let text = text.in_its_size();
                parsed = Some(if text.on_ground { text.on_ground() } else { text });
            }
            Err(error) if mistakes.is_empty() => {
                let message = error.message().to_owned();
                mistakes.note(&(0..0), document::TomlMistake::Syntax { message });
            }
            Err(_) => {}
        }
    }
    let mut doubtful = format::doubtful(Text::KEYS, &all);
    if !mistakes.all(|mistake| is_form(mistake) || matches!(mistake, StudyMistake::Repeated { .. }))
    {
        doubtful.push("units");
    }
    // Without the name of a system, no other name can be looked up.
    match parsed.filter(|_| !doubtful.contains(&"system")) {
        Some(parsed) => Ok(Understood { parsed, doubtful, mistakes }),
        None => Err(StudyError::Mistakes { path: path.into(), mistakes: mistakes.locate(text) }),
    }
}

/// Whether a mistake concerns the form of the file.
fn is_form(mistake: &StudyMistake) -> bool {
    matches!(mistake, StudyMistake::Document(_))
}

/// A parsed file, with substitutes for unreadable entries.
struct Understood {
    parsed: Text,
    /// The keys that have a substitute.
    doubtful: Vec<&'static str>,
    mistakes: Collector<StudyMistake>,
}

/// Notes duplicates in lists whose elements must be unique.
fn repetitions(root: &[Entry], mistakes: &mut Collector<StudyMistake>) {
    let mut told = |what: &'static str, elements: Vec<Entry>| {
        let mut seen: Vec<String> = vec![];
        for element in elements {
            let text = element.text().map(str::to_owned);
            let Ok(name) = text.or_else(|_| element.number().map(|n| n.to_string())) else {
                continue;
            };
            if seen.contains(&name) {
                let name = name.clone();
                mistakes.note(&element.value_at(), StudyMistake::Repeated { what, name });
            }
            seen.push(name);
        }
    };
    told("intensity", listed(root, "intensities"));
    told("unit", listed(root, "units"));
    // A fault belongs to one class, and a parameter to one tolerance.
    told("fault", listed_in(&listed(root, "classes"), "faults"));
    let realistic = root.iter().find(|entry| entry.key == "realistic");
    let realistic = realistic.and_then(|entry| entry.table().ok()).map(entries).unwrap_or_default();
    told("tolerance of", listed_in(&listed(&realistic, "tolerances"), "parameters"));
    let units = listed(root, "units");
    if let Some(whole) = units.iter().find(|unit| unit.text() == Ok("")).filter(|_| units.len() > 1)
    {
        mistakes.note(&whole.value_at(), StudyMistake::WholeBesideUnits);
    }
    if let Some(surplus) = units.get(MAX_ACTUATORS) {
        let allowed = format!("at most {MAX_ACTUATORS}");
        let (field, value) = ("number of units".into(), units.len() as f64);
        mistakes.note(&surplus.value_at(), StudyMistake::OutOfRange { field, value, allowed });
    }
}

/// The elements of a list.
fn listed<'a>(table: &[Entry<'a>], key: &'static str) -> Vec<Entry<'a>> {
    let entry = table.iter().find(|entry| entry.key == key);
    let list = entry.and_then(|entry| entry.list().ok()).unwrap_or_default();
    list.iter().map(|value| Entry::element(key, value)).collect()
}

/// The elements of the same list in each of several tables.
fn listed_in<'a>(tables: &[Entry<'a>], key: &'static str) -> Vec<Entry<'a>> {
    let tables = tables.iter().filter_map(|entry| entry.table().ok());
    tables.flat_map(|table| listed(&entries(table), key)).collect()
}

/// The place in the text where it names its system.
fn system_at(text: &str) -> TextSpan {
    let (root, _) = DeTable::parse_recoverable(text);
    let all = entries(root.get_ref());
    all.iter().find(|entry| entry.key == "system").map_or(0..0, Entry::value_at)
}

/// Finds the system of a study. An unknown name is returned as a mistake of the study.
fn find_system(name: &str, study: &str) -> Result<System, Result<StudyError, StudyMistake>> {
    let system = |error| Ok(StudyError::System(error));
    if let Some(text) = built_in::find(&built_in::SYSTEMS, name) {
        return System::parse(text, &format!("systems/{name}.toml")).map_err(system);
    }
    if !name.ends_with(".toml") {
        let known = built_in::SYSTEMS.iter().map(|(known, _)| *known);
        return Err(Err(StudyMistake::Unknown {
            what: "built-in system (a file ends in .toml)",
            name: name.into(),
            nearest: nearest(name, known.clone()).map(Into::into),
            known: known.map(Into::into).collect(),
        }));
    }
    System::read(beside(name, Path::new(study))).map_err(system)
}

/// The path where a study looks for its system file.
fn beside(name: &str, study: &Path) -> PathBuf {
    study.parent().unwrap_or(Path::new("")).join(name)
}

/// The parts of a study, built from its parsed text.
struct Parts {
    measured: Vec<usize>,
    sensors: Sensors,
    classes: Vec<Class>,
    faults: Vec<FaultCase>,
    cases: Vec<Environment>,
    command_input: usize,
    flights: Option<Flights>,
    realism: Option<Realism>,
    calibration: Option<Calibration>,
    training: Option<Training>,
    evaluating: Evaluating,
    reactions: Reactions,
    suites: suites::Suites,
}

impl Parts {
    /// Builds all parts, so that the mistakes of each are noted.
    fn new(reader: &Reader) -> Result<Self, Noted> {
        let text = reader.text;
        let sensors = reader.sensors();
        let classes = reader.classes();
        let faults = reader.faults(&classes);
        let command_input = reader.command_input();
        let cases = reader.cases();
        let realism = text.realistic.as_ref().map(|text| Realism::new(text, reader)).transpose();
        let training = text.training.as_ref().map(|text| Training::new(text, reader)).transpose();
        let evaluating = text.evaluation.as_ref().map(|text| Evaluating::new(text, reader));
        let flown = Self::flown(reader);
        let reactions = Reactions::new(&text.reactions, reader);
        reader.check_ground_test();
        let (measured, sensors) = sensors?;
        let (calibration, flights, suites) = flown?;
        Ok(Parts {
            measured,
            sensors,
            classes,
            faults: faults?,
            cases: cases?,
            command_input: command_input?,
            flights,
            realism: realism?,
            calibration,
            training: training?,
            evaluating: evaluating.transpose()?.unwrap_or_default(),
            reactions: reactions?,
            suites,
        })
    }

    /// What is flown: the calibration flight, the flights, and their suites.
    fn flown(
        reader: &Reader,
    ) -> Result<(Option<Calibration>, Option<Flights>, suites::Suites), Noted> {
        let text = reader.text;
        let flights = text.flights.as_ref().map(|text| Flights::new(text, reader)).transpose();
        let fitted = text.fitted.as_ref().filter(|_| !text.on_ground);
        let calibration = fitted.map(|text| Calibration::new(text, reader)).transpose();
        let flights = flights?;
        let first_test = flights.as_ref().filter(|_| text.on_ground);
        let first_test = first_test.map(|flights| Calibration::first_test(flights, reader));
        let suites = flights.as_ref().map(|flights| suites::suites(reader, flights)).transpose();
        if let (None, Some(name)) = (&flights, text.suites.keys().next()) {
            reader.empty(&KeyPath::of(&["suites", name]), "flights");
        }
        let calibration = first_test.transpose()?.or(calibration?);
        Ok((calibration, flights, suites?.unwrap_or_default()))
    }
}

/// The index of the load input and its value; `None` if the study has no load.
type Load = Option<(usize, Piecewise)>;

impl Reader<'_> {
    /// The indices of the measured sensors in the system's order, with the extra one
    /// last.
    fn sensors(&self) -> Result<(Vec<usize>, Sensors), Noted> {
        let list = &self.system.sensors;
        let ids = || list.iter().map(|s| s.id.as_str());
        let mut measured = Vec::new();
        let mut seen = Vec::new();
        for id in self.text.sensors.keys() {
            if !ids().any(|known| known == id) {
                let at = KeyPath::of(&["sensors", id]).name();
                self.unknown(&at, "sensor in the system", id, ids());
            }
        }
        for (position, sensor) in list.iter().enumerate() {
            let Some(text) = self.text.sensors.get(&sensor.id) else { continue };
            if let Ok(sensor) = self.sensor(position, text) {
                measured.push(position);
                seen.push(sensor);
            }
        }
        if let Some(extra) = &self.text.extra_sensor {
            let position = ids().position(|id| id == extra.id);
            let at = KeyPath::of(&["extra_sensor", "id"]);
            let unknown = || self.unknown(&at, "sensor in the system", &extra.id, ids());
            let position = position.ok_or_else(unknown)?;
            let (name, noise) = (extra.id.clone(), self.noise(position));
            let sensor = Sensor {
                name,
                quantity: Quantity::Surface,
                actuator: None,
                noise,
                is_noisy: true,
                follows: vec![],
            };
            if measured.contains(&position) {
                let name = extra.id.clone();
                self.note(&self.span(&at), StudyMistake::Repeated { what: "sensor", name });
            }
            measured.push(position);
            seen.push(sensor);
        }
        self.add_laws(&measured, &mut seen);
        Ok((measured, Sensors(seen)))
    }

    fn sensor(&self, position: usize, text: &SensorText) -> Result<Sensor, Noted> {
        let id = &self.system.sensors[position].id;
        let at = KeyPath::of(&["sensors", id]);
        let words = || Quantity::ALL.iter().map(|(_, word)| *word);
        let found = Quantity::ALL.iter().find(|(_, word)| *word == text.quantity);
        let (quantity, _) = found.ok_or_else(|| {
            self.unknown(&at.key("quantity"), "quantity", &text.quantity, words())
        })?;
        let known = text.unit <= self.text.units.len();
        let units = self.text.units.len();
        self.range(
            &at.key("unit"),
            text.unit as f64,
            known,
            format!("0 … {units}, as there are units"),
        )?;
        // All actuators move the surface together, so its sensor belongs to none of them.
        let unit = text.unit.checked_sub(1).filter(|_| *quantity != Quantity::Surface);
        let (name, noise) = (id.clone(), self.noise(position));
        Ok(Sensor {
            name,
            quantity: *quantity,
            actuator: unit,
            noise,
            is_noisy: true,
            follows: vec![],
        })
    }

    /// Adds the sensors that each sensor follows. `measured` has the indices of all sensors. Mistakes are noted.
    fn add_laws(&self, measured: &[usize], seen: &mut [Sensor]) {
        for (place, sensor) in seen.iter_mut().enumerate() {
            let id = &self.system.sensors[measured[place]].id;
            let Some(text) = self.text.sensors.get(id) else { continue };
            if text.follows_controller {
                let law = laws::of_controller(self.system, measured, place);
                let at = KeyPath::of(&["sensors", id, "follows_controller"]);
                if law.is_empty() {
                    self.note(&self.span(&at), StudyMistake::NoController { sensor: id.clone() });
                }
                sensor.follows = self.in_scales(measured, place, &law);
                continue;
            }
            let at = KeyPath::of(&["sensors", id, "follows"]);
            let (count, few) = (text.follows.len(), text.follows.len() <= MAX_FOLLOWED);
            let _ = self.range(&at, count as f64, few, format!("at most {MAX_FOLLOWED} others"));
            let follow = |(id, &weight): (&String, &f64)| {
                self.follow(&at, measured, place, (id, weight)).ok()
            };
            sensor.follows = text.follows.iter().filter_map(follow).collect();
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
        at: &KeyPath,
        measured: &[usize],
        place: usize,
        (followed, weight): (&str, f64),
    ) -> Result<(usize, f64), Noted> {
        let sensor = |place: usize| &self.system.sensors[measured[place]];
        let others = || (0..measured.len()).filter(|&other| other != place);
        let known = || others().map(|other| sensor(other).id.as_str());
        let other = others().find(|&other| sensor(other).id == followed);
        let other = other.ok_or_else(|| {
            self.unknown(&at.key(followed).name(), OTHER_SENSOR, followed, known())
        })?;
        Ok(self.in_scales(measured, place, &[(other, weight)])[0])
    }

    /// The standard deviation of a sample from noise and quantization, as a share of the sensor's scale.
    fn noise(&self, position: usize) -> f64 {
        let scale = self.system.sensors[position].scale;
        Imperfection::of(self.system, position).deviation() / scale
    }

    fn cases(&self) -> Result<Vec<Environment>, Noted> {
        let loads = self.loads();
        let command = self.command_input()?;
        let mut commands = vec![];
        for (name, signal) in &self.text.command.signals {
            let (signal, duration_s) = (Ok(signal.clone()), self.text.duration_s);
            let built = self.signal(
                &KeyPath::of(&["command", "signals", name]).name(),
                name,
                signal,
                command,
                duration_s,
            );
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
                let case = format!("{name}{load_name}");
                if cases.iter().any(|other: &Environment| other.name == case) {
                    let at = KeyPath::of(&["command", "signals", name]).name();
                    let mistake = StudyMistake::Repeated { what: "case", name: case.clone() };
                    self.note(&self.span(&at), mistake);
                }
                cases.push(Environment {
                    name: case,
                    command: name.clone(),
                    inputs,
                    parameters: vec![],
                });
            }
        }
        Ok(cases)
    }

    /// The suffix that each load adds to the names of cases, with the load itself.
    fn loads(&self) -> Result<Vec<(String, Load)>, Noted> {
        let Some(load) = &self.text.load else { return Ok(vec![(String::new(), None)]) };
        let input = self.input(&KeyPath::of(&["load", "input"]), &load.input)?;
        let values = sorted_by_value(&load.values).into_iter().map(|(name, value)| {
            let value = self.constant(&KeyPath::of(&["load", "values", &name]), input, value)?;
            Ok((format!("/{name}"), Some((input, value))))
        });
        Ok(self.sound(values))
    }

    fn default_inputs(&self) -> Vec<Piecewise> {
        let inputs = &self.system.network().inputs;
        inputs.iter().map(|i| Piecewise::constant(i.default).expect("checked")).collect()
    }
}

/// Sorts by value: `50` comes before `100`, unlike in alphabetical order.
fn sorted_by_value(values: &BTreeMap<String, f64>) -> Vec<(String, f64)> {
    let mut sorted: Vec<(String, f64)> = values.iter().map(|(n, v)| (n.clone(), *v)).collect();
    sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
    sorted
}
