//! What is watched: a source, its map, and the twin with its diagnosis. Shared by the commands that watch.

use crate::Global;
use crate::commands::{note, warn};
use crate::failure::Failure;
use servotwin::evaluation::{EvaluationError, model_file};
use servotwin::flight::band::BandMerit;
use servotwin::flight::watcher::Watcher;
use servotwin::job::{Folder, flights};
use servotwin::sanitize;
use servotwin::study::{Setting, Study};
use servotwin::system::System;
use servotwin::units;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::diagnoser::environment::InputRange as BoundaryInput;
use servotwin_watch::counts::{Irregularity, WatchCounts};
use servotwin_watch::cut::Cut;
use servotwin_watch::map::{Guess, Map, Trust, guess};
use servotwin_watch::shipped;
use servotwin_watch::source::udp::Allowed;
use servotwin_watch::source::{Address, LogColumn, Source, SourceError};
use servotwin_watch::span::LogSpan;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a source is read and judged.
#[derive(clap::Args, Clone)]
pub struct InputOptions {
    /// The diagnoser, a file written by `servotwin flights` [default: out/diagnoser-realistic.json, or for the built-in
    /// aileron the one that comes with the program].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// A confidence band written by `servotwin band`, to use instead of the diagnoser's own. Outcomes outside the range
    /// of its training are marked.
    #[arg(long, value_name = "FILE")]
    pub band: Option<PathBuf>,
    /// The map file, which assigns columns to signals.
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// For a file: read it from this time on, in seconds after its first sample (12.5, 2min) or as a date
    /// (2026-11-21T08:15:02). For udp://: accept datagrams only from this sender, IP or IP:PORT; repeat the option for
    /// several senders. With 'any', accept all [default: the first sender of a sample, until it is silent for 2 s].
    #[arg(long, value_name = "TIME|ADDRESS")]
    pub from: Vec<String>,
    /// For a file: read it up to this time.
    #[arg(long, value_name = "TIME")]
    pub to: Option<String>,
}

/// The path of a source that is a file.
pub fn log_of(source: &str) -> Option<PathBuf> {
    match Address::parse(source) {
        Ok(Address::File(path)) => Some(path),
        _ => None,
    }
}

impl InputOptions {
    /// The source, restricted to the allowed senders.
    pub fn address(&self, source: &str) -> Result<Address, Failure> {
        let address = Address::parse(source)?;
        if self.from.is_empty() || !address.is_live() {
            return Ok(address);
        }
        let range = || "any, an IP address or IP:PORT".into();
        let allowed = Allowed::parse(&self.from);
        let allowed = allowed.map_err(|given| Failure::OutOfRange {
            option: "--from",
            given,
            range: range(),
        })?;
        let none = "--from names the senders of a udp:// source; this source has none";
        address.from_senders(allowed).ok_or(Failure::Options(none))
    }

    /// Opens a source, or the part of it that the options name, with the map of its columns. `is_study_named` states
    /// whether the user named the study.
    pub fn open(
        &self,
        address: &Address,
        study: &Study,
        is_study_named: bool,
        global: Global,
    ) -> Result<(Map, Box<dyn Source>), Failure> {
        let map = self.map(address, study, is_study_named, global)?;
        let source = match address.open(map.wanted()).map_err(|error| map.explain(error)) {
            Ok(source) => source,
            Err(Ok(mistakes)) => return Err(mistakes.into()),
            Err(Err(error)) => return Err(error.into()),
        };
        let span = self.span(address)?;
        if span.is_whole() {
            return Ok((map, source));
        }
        let source = Box::new(Cut::new(source, address.to_string(), &map, span));
        Ok((map, source))
    }

    /// The part of a file to read.
    fn span(&self, address: &Address) -> Result<LogSpan, Failure> {
        match (address.is_live(), self.from.len(), &self.to) {
            (true, _, None) => Ok(LogSpan::default()),
            (true, _, Some(_)) => {
                Err(Failure::Options("--to is for files: a live stream has no part"))
            }
            (false, 2.., _) => Err(Failure::Options(
                "--from of a file is one time; several are senders of a stream",
            )),
            (false, _, to) => {
                let from = self.from.first().map(String::as_str);
                Ok(LogSpan::parse(from, to.as_deref()).map_err(SourceError::Cut)?)
            }
        }
    }

    /// Reads the given map, or makes one from the names of the columns.
    fn map(
        &self,
        address: &Address,
        study: &Study,
        is_study_named: bool,
        global: Global,
    ) -> Result<Map, Failure> {
        let system = &study.system;
        if let Some(path) = &self.map {
            let map = Map::read(path, system)?;
            let unmeasured: Vec<&str> = map.unmeasured().collect();
            if !unmeasured.is_empty() {
                note(global, &format!("without a column: {}", unmeasured.join(", ")));
            }
            commanded(&map, address, study)?;
            return Ok(map);
        }
        if address.is_live() {
            return Err(Failure::Options(
                "a live stream needs --map FILE; --make-map FILE writes one",
            ));
        }
        let columns = address.columns()?;
        let guess = guess(&columns, study, Trust::Certain);
        if guess.sensors.len() == system.sensors.len() {
            return Err(foreign(is_study_named, address, study, &columns));
        }
        let map = Map::parse(&guess.text, "the columns as they were found", system)?;
        told(&guess, global);
        commanded(&map, address, study)?;
        Ok(map)
    }
}

/// The range of each input of the system that the diagnoser accepts.
pub fn accepted_ranges(diagnoser: &Diagnoser, system: &System) -> Vec<(f64, f64)> {
    let known = |id: &str| diagnoser.environment.inputs.iter().find(|input| input.name == id);
    let inputs = system.network().inputs.iter().map(|input| known(&input.id));
    let range = |input: Option<&BoundaryInput>| input.map(|input| (input.least, input.largest));
    inputs.map(|input| range(input).unwrap_or((f64::NEG_INFINITY, f64::INFINITY))).collect()
}

/// Builds the twin and the diagnosis.
pub fn observer<'s>(
    study: &'s Study,
    (path, diagnoser): (&Path, Arc<Diagnoser>),
) -> Result<Watcher<'s>, Failure> {
    let unfit = |error| Failure::Diagnoser { path: path.into(), error };
    Watcher::new(study, diagnoser).map_err(unfit)
}

/// Warns of sensors that the diagnoser reads and the map lacks.
pub fn warn_of_lacking(map: &Map, needed: &[&str], global: Global) {
    let lacking: Vec<&str> = map.unmeasured().filter(|id| needed.contains(id)).collect();
    if !lacking.is_empty() {
        let lacking = lacking.join(", ");
        let text = format!(
            "less can be judged without {lacking}, which the diagnoser reads; a map file says which columns they are, \
             --make-map writes one"
        );
        warn(global, &[text]);
    }
}

/// The sensors that a diagnoser reads.
pub fn needed<'s>(diagnoser: &Diagnoser, system: &'s System) -> Vec<&'s str> {
    let read = |label: &String| diagnoser.sensors.iter().any(|sensor| sensor.name == *label);
    let sensors = system.sensors.iter().filter(|sensor| read(&sensor.label));
    sensors.map(|sensor| sensor.id.as_str()).collect()
}

/// The path of the default diagnoser.
pub fn usual_diagnoser() -> PathBuf {
    Folder::new("out").diagnoser(Setting::Realistic)
}

/// Reads a diagnoser from a file, and replaces its band if one is named.
pub fn read_diagnoser(model: &Path, band: Option<&Path>) -> Result<Diagnoser, Failure> {
    with_band(model_file::read_diagnoser(model)?, band)
}

/// The diagnoser that the options name, or that of the default output folder. If it is missing, the built-in aileron has
/// a shipped one.
pub fn diagnoser(
    input: &InputOptions,
    study: &Study,
    global: Global,
) -> Result<Diagnoser, Failure> {
    let band = input.band.as_deref();
    if let Some(path) = &input.model {
        return read_diagnoser(path, band);
    }
    let shipped = (!usual_diagnoser().exists()).then(|| shipped::diagnoser(study)).flatten();
    if let Some(shipped) = shipped {
        let text = "the diagnosis comes with the program and allows for no tolerances; servotwin flights learns one that does";
        note(global, text);
        return with_band(shipped, band);
    }
    with_band(flights::diagnoser(&Folder::new("out"), Setting::Realistic)?, band)
}

/// The diagnoser with the band of a file, if one is named, instead of its own.
pub fn with_band(diagnoser: Diagnoser, band: Option<&Path>) -> Result<Diagnoser, Failure> {
    let Some(path) = band else { return Ok(diagnoser) };
    let band: BandMerit = model_file::read(path)?;
    let corrupt = |source| EvaluationError::CorruptModel { path: path.into(), source };
    Ok(band.put_into(diagnoser).map_err(corrupt)?)
}

/// Checks that the log or the map provides the study's command. Without it, the twin would stand still next to a moving
/// actuator, and the diagnosis would report false faults.
fn commanded(map: &Map, address: &Address, study: &Study) -> Result<(), Failure> {
    let command = study.command_input;
    if !map.is_default(command) {
        return Ok(());
    }
    let input = &study.system.network().inputs[command];
    let unused = match address.is_live() {
        true => String::new(),
        false => unused(map, address)?,
    };
    let (id, unit) = (&input.id, units::word(input.unit));
    let reason = format!(
        "no column is the input '{id}', which the study '{}' commands, and without it the twin stands still{unused}; \
         name its column in a map file (--make-map writes one) below [inputs], {id} = {{ column = \"…\", unit = \"{unit}\" }}, \
         or say that it is the same always, {id} = {{ value = {:?}, unit = \"{unit}\" }}",
        study.name, input.default
    );
    Err(Failure::NoSample { log: address.to_string(), reason })
}

/// Names the columns of a file that the map does not read, as part of a sentence.
fn unused(map: &Map, address: &Address) -> Result<String, Failure> {
    let columns = address.columns()?;
    let names = columns.iter().map(|column| column.name.as_str());
    let unused: Vec<&str> =
        names.filter(|name| !map.wanted().names.iter().any(|wanted| wanted == name)).collect();
    Ok(match unused.is_empty() {
        true => ", and no column is left that may be it".into(),
        false => format!("; columns that nothing was found for: {}", sanitize::list(&unused)),
    })
}

/// The failure for a log without any sensor of the study.
pub fn foreign(
    is_study_named: bool,
    address: &Address,
    study: &Study,
    columns: &[LogColumn],
) -> Failure {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let names = sanitize::list(&names);
    let (name, system) = (&study.name, &study.system.name);
    let what = match is_study_named {
        true => "--study names another, --make-map writes a map to be filled in",
        false => "it is taken where --study names none",
    };
    let reason = format!(
        "no column is a sensor of the study '{name}' of the system '{system}': {what}; the columns are {names}"
    );
    Failure::NoSample { log: address.to_string(), reason }
}

/// Warns about uncertain entries of a map.
pub fn told(guess: &Guess, global: Global) {
    let list = |names: &[String]| names.join(", ");
    let mut warnings = vec![];
    if !guess.time {
        warnings.push("no column with the time: 100 rows for a second are assumed".to_owned());
    }
    if !guess.assumed.is_empty() {
        let assumed = sanitize::list(&guess.assumed);
        warnings.push(format!("no unit is given for {assumed}: look at what is assumed"));
    }
    warnings.extend(guess.doubts.iter().cloned());
    if !guess.likely.is_empty() {
        warnings.push(format!("likely by their names: {}; look them over", list(&guess.likely)));
    }
    warn(global, &warnings);
    if !guess.sensors.is_empty() {
        note(global, &format!("no column for the sensors {}", list(&guess.sensors)));
    }
    if !guess.inputs.is_empty() {
        let text =
            format!("no column for the inputs {}: they are at their defaults", list(&guess.inputs));
        note(global, &text);
    }
    let is_lacking = !guess.sensors.is_empty() || !guess.inputs.is_empty();
    if is_lacking && !guess.unused.is_empty() {
        let unused = sanitize::list(&guess.unused);
        note(global, &format!("columns that are no input and no sensor: {unused}"));
    }
}

/// Explains why a log gave no sample to judge.
pub fn nothing(address: &Address, counts: &WatchCounts) -> Failure {
    let timeless = counts.of(Irregularity::NoTime);
    let reason = match counts.frames {
        0 => "nothing stands below the names of its columns".to_owned(),
        frames if timeless.count == frames => format!(
            "no row has a time ({}); a date needs unit = \"date\" below [time] in a map file, which --make-map writes",
            counts.place(timeless)
        ),
        _ => {
            let met = counts.met().map(|(kind, tally)| {
                format!("{} in {}, first {}", kind.words().1, tally.count, counts.place(tally))
            });
            format!("no row is a sample: {}", met.collect::<Vec<_>>().join("; "))
        }
    };
    Failure::NoSample { log: address.to_string(), reason }
}
