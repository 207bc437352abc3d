//! `servotwin watch`: runs the twin and the diagnosis on a log or a live stream.

mod outputs;

use super::{note, warn};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, stop};
use outputs::{Outputs, Totals};
use serde_json::json;
use servotwin::evaluation::{EvaluationError, model_file};
use servotwin::files;
use servotwin::flight::band::BandMerit;
use servotwin::flight::watcher::Watcher;
use servotwin::job::{Folder, flights};
use servotwin::sanitize;
use servotwin::signal::Quantity;
use servotwin::study::{Setting, Study};
use servotwin::system::System;
use servotwin::units;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::diagnoser::environment::Input;
use servotwin_model::spec::Unit;
use servotwin_watch::checkpoint::Checkpoint;
use servotwin_watch::counts::{Counts, Kind};
use servotwin_watch::cut::Cut;
use servotwin_watch::map::{Guess, Map, Trust, guess};
use servotwin_watch::sink::{Scene, SinkError};
use servotwin_watch::source::udp::Allowed;
use servotwin_watch::source::{Address, LogColumn, Source, SourceError};
use servotwin_watch::span::Span;
use servotwin_watch::watchdog::WatchdogRules;
use servotwin_watch::{Checkpoints, End, Observer, State, Watch};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Watch an actuator: run its twin and the diagnosis on a log or a live stream.
///
/// A map file assigns the columns of the source to signals. --make-map writes one for a log, for you to review. Without
/// a map file, columns are found by their names. A file is read faster than real time; a stream is read until it ends
/// or until Ctrl-C.
#[derive(clap::Args)]
pub struct Options {
    /// A log (.csv, .parquet, .mcap, .jsonl; .mf4 and .mat if the program has the features of these names), - for lines
    /// from standard input, udp://HOST:PORT to listen on, or mqtt://HOST/TOPIC to subscribe to.
    source: String,
    /// A study file, which names the system [default: paper, the paper's study of the aileron].
    #[arg(long, value_name = "FILE")]
    study: Option<PathBuf>,
    /// The diagnoser, a file written by `servotwin flights` [default: out/diagnoser-realistic.json].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// A confidence band written by `servotwin band`, to use instead of the diagnoser's own. Outcomes outside the range
    /// of its training are marked.
    #[arg(long, value_name = "FILE")]
    band: Option<PathBuf>,
    /// The map file, which assigns columns to signals.
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// For a file: read it from this time on, in seconds after its first sample (12.5, 2min) or as a date
    /// (2026-11-21T08:15:02). For udp://: accept datagrams only from this sender, IP or IP:PORT; repeat the option for
    /// several senders. With 'any', accept all [default: the first sender of a sample, until it is silent for 2 s].
    #[arg(long, value_name = "TIME|ADDRESS")]
    from: Vec<String>,
    /// For a file: read it up to this time.
    #[arg(long, value_name = "TIME")]
    to: Option<String>,
    /// Write a map file for the columns of the source, and exit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["map", "html", "mcap", "events", "checkpoint"])]
    make_map: Option<PathBuf>,
    /// Write the timeline as an HTML file.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write inputs, measured values, twin, residuals, bands and decisions as MCAP for Foxglove, Rerun and PlotJuggler:
    /// into a file, or as a live stream to clients that connect to tcp://HOST:PORT. Repeat the option for both.
    #[arg(long, value_name = "FILE|tcp://HOST:PORT")]
    mcap: Vec<PathBuf>,
    /// Write every change as a line of JSON when it happens.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Save the state of the watch in this file, so that --resume can continue from it.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Continue from the checkpoint.
    #[arg(long, requires = "checkpoint")]
    resume: bool,
    /// For a live source: report missing data when the source or a column sends nothing for this time, by the wall
    /// clock [default: 2 s, or ten periods of the diagnoser if that is longer].
    #[arg(long, value_name = "TIME")]
    no_data_after: Option<String>,
    /// For a live source: time between reports that the watch is alive and how much each output has lost. 0s turns
    /// these reports off.
    #[arg(long, value_name = "TIME", default_value = "10s")]
    heartbeat: String,
}

/// The time between two checkpoints, s.
const CHECKPOINT_S: f64 = 60.0;

impl Options {
    /// The files that the command reads and writes.
    pub fn paths(&self) -> Paths {
        let log = match Address::parse(&self.source) {
            Ok(Address::File(path)) => Some(path),
            _ => None,
        };
        let is_file = |target: &&PathBuf| !target.to_string_lossy().contains("://");
        let files = self.mcap.iter().filter(is_file);
        Paths::default()
            .read("the log", log)
            .read_study(self.study.as_ref())
            .read("the diagnoser", [self.model.clone().unwrap_or_else(usual_diagnoser)])
            .read("--band", &self.band)
            .read("--map", &self.map)
            .write("--make-map", Format::TOML, &self.make_map)
            .write("--html", Format::HTML, &self.html)
            .write("--mcap", Format::MCAP, files)
            .write("--events", Format::LINES, &self.events)
            .write("--checkpoint", Format::Any, &self.checkpoint)
    }
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let study = match &options.study {
        Some(path) => Study::read(path)?,
        None => Study::default(),
    };
    let system = &study.system;
    let address = address(options)?;
    if let Some(path) = &options.make_map {
        return make_map(options, &address, &study, path, global);
    }
    let map = map(options, &address, &study, global)?;
    let opened = address.open(map.wanted());
    let mut source = match opened.map_err(|error| map.explain(error)) {
        Ok(source) => source,
        Err(Ok(mistakes)) => return Err(mistakes.into()),
        Err(Err(error)) => return Err(error.into()),
    };
    let span = span(options, &address)?;
    if !span.is_whole() {
        source = Box::new(Cut::new(source, address.to_string(), &map, span));
    }
    let diagnoser = read_diagnoser(options.model.as_deref(), options.band.as_deref())?;
    let needed = needed(&diagnoser, system);
    let shortest = diagnoser.lengths.iter().filter_map(|length| length.span.samples()).min();
    let accepted_ranges = accepted_ranges(&diagnoser, system);
    let (mut observer, period_s) = observer(options, &study, diagnoser, &map, &needed, global)?;
    let watchdog = watchdog(options, period_s)?;
    let title = format!("{}: {address}", system.title);
    let scene = Scene::new(&title, system, observer.features(), period_s);
    let resumed = match options.resume {
        true => options.checkpoint.as_deref().map(Checkpoint::read).transpose()?,
        false => None,
    };
    let setup = Setup { options, study: &study, address: &address, map: &map, period_s, global };
    let watched =
        setup.watch(&mut *source, &mut observer, &accepted_ranges, (scene, watchdog), resumed)?;
    let shortest_s = shortest.map_or(0.0, |samples| samples as f64 * period_s);
    setup.conclude(watched, &needed, shortest_s)
}

/// The source, restricted to the allowed senders.
fn address(options: &Options) -> Result<Address, Failure> {
    let address = Address::parse(&options.source)?;
    if options.from.is_empty() || !address.is_live() {
        return Ok(address);
    }
    let range = || "any, an IP address or IP:PORT".into();
    let allowed = Allowed::parse(&options.from);
    let allowed =
        allowed.map_err(|given| Failure::OutOfRange { option: "--from", given, range: range() })?;
    let none = "--from names the senders of a udp:// source; this source has none";
    address.from_senders(allowed).ok_or(Failure::Options(none))
}

/// The part of a file to read.
fn span(options: &Options, address: &Address) -> Result<Span, Failure> {
    match (address.is_live(), options.from.len(), &options.to) {
        (true, _, None) => Ok(Span::default()),
        (true, _, Some(_)) => Err(Failure::Options("--to is for files: a live stream has no part")),
        (false, 2.., _) => {
            Err(Failure::Options("--from of a file is one time; several are senders of a stream"))
        }
        (false, _, to) => {
            let from = options.from.first().map(String::as_str);
            Ok(Span::parse(from, to.as_deref()).map_err(SourceError::Cut)?)
        }
    }
}

/// The time until a live source counts as silent, and the interval of heartbeats.
fn watchdog(options: &Options, period_s: f64) -> Result<WatchdogRules, Failure> {
    let usual = WatchdogRules::default().no_data_after;
    let ten_periods = Duration::try_from_secs_f64(10.0 * period_s).unwrap_or(usual);
    let no_data_after = match &options.no_data_after {
        Some(text) => Duration::from_secs_f64(seconds("--no-data-after", text, 0.1)?),
        None => usual.max(ten_periods),
    };
    let heartbeat = Duration::from_secs_f64(seconds("--heartbeat", &options.heartbeat, 0.0)?);
    Ok(WatchdogRules { no_data_after, heartbeat: Some(heartbeat).filter(|every| !every.is_zero()) })
}

/// The value of a time option, s, with a minimum of `least_s`.
fn seconds(option: &'static str, text: &str, least_s: f64) -> Result<f64, Failure> {
    let value =
        Quantity::in_unit(text, Unit::Second).map_err(|error| Failure::Number { option, error })?;
    match (least_s..=86_400.0).contains(&value) {
        true => Ok(value),
        false => {
            let (given, range) = (text.into(), format!("{least_s} s to 86,400 s").into());
            Err(Failure::OutOfRange { option, given, range })
        }
    }
}

/// The settings of a watch, apart from its source and its observer.
struct Setup<'s> {
    options: &'s Options,
    study: &'s Study,
    address: &'s Address,
    map: &'s Map,
    period_s: f64,
    global: Global,
}

/// The result of a watch.
struct Watched {
    end: End,
    totals: Totals,
    doubts: Vec<String>,
    /// The states without a judgment, in the order of their first appearance.
    unjudged: Vec<State>,
    /// The lines for readers.
    text: String,
}

impl Setup<'_> {
    /// Watches until the source ends or Ctrl-C, and then ends all outputs.
    fn watch(
        &self,
        source: &mut dyn Source,
        observer: &mut Watcher,
        accepted_ranges: &[(f64, f64)],
        (scene, watchdog): (Scene, WatchdogRules),
        resumed: Option<Checkpoint>,
    ) -> Result<Watched, Failure> {
        let Setup { options, study, address, map, period_s, global } = *self;
        let system = &study.system;
        let mut outputs = Outputs::new(options, address, scene, resumed.as_ref(), global)?;
        let mut watch = Watch::new(source, map, observer, period_s);
        watch.accept_ranges(accepted_ranges);
        if let Some(checkpoint) = resumed {
            watch.resume(checkpoint)?;
        }
        if let Some(path) = &options.checkpoint {
            let every = (CHECKPOINT_S / period_s) as u64;
            watch.checkpoints(Checkpoints { path: path.clone(), every });
        }
        if address.is_live() {
            watch.watchdog(watchdog);
        }
        stop::heed();
        let show = outputs.shows_progress(address.is_live());
        let Outputs { shown, threads, .. } = &mut outputs;
        watch.sink(shown);
        watch.sink(threads);
        let end = thread::scope(|scope| {
            // A log is usually read to its end before a compiler would finish.
            if address.is_live() {
                scope.spawn(|| system.compiled.steps_for_live(&system.program));
            }
            let end = watch.run(stop::flag(), &mut |time_s, share| show(time_s, share));
            system.compiled.give_up();
            end
        });
        let end = end?;
        let (counts, silences) = (watch.counts().clone(), watch.silences());
        let saved = watch.checkpoint_loss();
        let mut doubts = watch.plausibility().sentences(system, map, period_s, &counts);
        drop(watch);
        doubts.extend(observer.wider_than_trained());
        if end == End::Complete && counts.samples == 0 {
            return Err(nothing(address, &counts));
        }
        let (totals, shown) = outputs.end(options, counts, silences, saved, address.is_live())?;
        let (unjudged, text) = (shown.unjudged, shown.strip.text());
        Ok(Watched { end, totals, doubts, unjudged, text })
    }

    /// Returns the text for standard output, or the reason why the run failed.
    fn conclude(
        &self,
        watched: Watched,
        needed: &[&str],
        shortest_s: f64,
    ) -> Result<String, Failure> {
        let Setup { options, address, map, global, .. } = *self;
        let Watched { end, totals, doubts, unjudged, text } = watched;
        // Ctrl-C is the normal end of a stream, but leaves a file unfinished.
        if end == End::Stopped && !address.is_live() {
            return Err(Failure::Stopped);
        }
        let signals: Vec<&str> = (0..map.width()).map(|channel| map.id(channel)).collect();
        let output = match global {
            Global { json: true, .. } => format!("{}\n", totals.json(&signals)),
            Global { quiet: true, .. } => String::new(),
            _ => text + "\n" + &totals.text(&signals),
        };
        let counts = &totals.counts;
        if end == End::Complete && counts.judged == 0 && !options.resume {
            let mut reasons = doubts;
            reasons.extend(unmeasured(map, needed));
            if reasons.is_empty() {
                reasons.push(gaps(map, needed, counts, shortest_s));
            }
            let states = unjudged.iter().map(|state| format!("'{}'", state.words()));
            let states = states.collect::<Vec<_>>().join(" or ");
            let reasons = reasons.join("; ");
            let reason = format!("nothing could be judged, every period is {states}: {reasons}");
            return Err(Failure::Unjudged { output, log: address.to_string(), reason });
        }
        warn(global, &doubts);
        match totals.lost_files() {
            files if files.is_empty() => Ok(output),
            files => Err(Failure::SinksLost { output, files }),
        }
    }
}

/// Reports sensors of the diagnoser that have no column in the log.
fn unmeasured(map: &Map, needed: &[&str]) -> Option<String> {
    let without: Vec<&str> = map.unmeasured().filter(|id| needed.contains(id)).collect();
    (!without.is_empty()).then(|| format!("the log has no {}", without.join(", ")))
}

/// Explains why no sample was judged in a log that has all columns, the right units and a sufficient rate.
fn gaps(map: &Map, needed: &[&str], counts: &Counts, shortest_s: f64) -> String {
    let samples = counts.samples;
    let missing = |channel: usize| counts.missing[channel];
    let of = |channel: &usize| needed.contains(&map.id(*channel)) && missing(*channel) > 0;
    let channels = (map.inputs()..map.width()).filter(of);
    let often = channels.map(|channel| format!("{} in {}", map.id(channel), missing(channel)));
    let often: Vec<String> = often.collect();
    match often.is_empty() {
        true => {
            format!("of {samples} samples no {shortest_s} s without a gap, the shortest window")
        }
        false => format!("of {samples} samples are without a value: {}", often.join(", ")),
    }
}

/// The range of each input of the system that the diagnoser accepts.
fn accepted_ranges(diagnoser: &Diagnoser, system: &System) -> Vec<(f64, f64)> {
    let known = |id: &str| diagnoser.environment.inputs.iter().find(|input| input.name == id);
    let inputs = system.network().inputs.iter().map(|input| known(&input.id));
    let range = |input: Option<&Input>| input.map(|input| (input.least, input.largest));
    inputs.map(|input| range(input).unwrap_or((f64::NEG_INFINITY, f64::INFINITY))).collect()
}

/// Explains why a log gave no sample to judge.
fn nothing(address: &Address, counts: &Counts) -> Failure {
    let timeless = counts.of(Kind::NoTime);
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

/// Builds the twin and the diagnosis, and returns them with their sample period, s.
fn observer<'s>(
    options: &Options,
    study: &'s Study,
    diagnoser: Diagnoser,
    map: &Map,
    needed: &[&str],
    global: Global,
) -> Result<(Watcher<'s>, f64), Failure> {
    let lacking: Vec<&str> = map.unmeasured().filter(|id| needed.contains(id)).collect();
    if !lacking.is_empty() {
        warn(
            global,
            &[format!(
                "less can be judged without {}, which the diagnoser reads; a map file says which columns they are, --make-map writes one",
                lacking.join(", ")
            )],
        );
    }
    let period_s = diagnoser.period_s;
    let path = options.model.clone().unwrap_or_else(usual_diagnoser);
    let unfit = |error| Failure::Diagnoser { path, error };
    let watcher = Watcher::new(study, Arc::new(diagnoser)).map_err(unfit)?;
    Ok((watcher, period_s))
}

/// The sensors that a diagnoser reads.
fn needed<'s>(diagnoser: &Diagnoser, system: &'s System) -> Vec<&'s str> {
    let read = |label: &String| diagnoser.sensors.iter().any(|sensor| sensor.name == *label);
    let sensors = system.sensors.iter().filter(|sensor| read(&sensor.label));
    sensors.map(|sensor| sensor.id.as_str()).collect()
}

/// The path of the default diagnoser.
pub fn usual_diagnoser() -> PathBuf {
    Folder::new("out").diagnoser(Setting::Realistic)
}

/// Reads a diagnoser from a file or from the default output folder, and replaces its band if one is named.
pub fn read_diagnoser(model: Option<&Path>, band: Option<&Path>) -> Result<Diagnoser, Failure> {
    let diagnoser = match model {
        Some(path) => model_file::read_diagnoser(path)?,
        None => flights::diagnoser(&Folder::new("out"), Setting::Realistic)?,
    };
    let Some(path) = band else { return Ok(diagnoser) };
    let band: BandMerit = model_file::read(path)?;
    let corrupt = |source| EvaluationError::CorruptModel { path: path.into(), source };
    Ok(band.put_into(diagnoser).map_err(corrupt)?)
}

/// Reads the given map, or makes one from the names of the columns.
fn map(
    options: &Options,
    address: &Address,
    study: &Study,
    global: Global,
) -> Result<Map, Failure> {
    let system = &study.system;
    if let Some(path) = &options.map {
        let map = Map::read(path, system)?;
        let unmeasured: Vec<&str> = map.unmeasured().collect();
        if !unmeasured.is_empty() {
            note(global, &format!("without a column: {}", unmeasured.join(", ")));
        }
        commanded(&map, address, study)?;
        return Ok(map);
    }
    if address.is_live() {
        return Err(Failure::Options("a live stream needs --map FILE; --make-map FILE writes one"));
    }
    let columns = address.columns()?;
    let guess = guess(&columns, study, Trust::Certain);
    if guess.sensors.len() == system.sensors.len() {
        return Err(foreign(options, address, study, &columns));
    }
    let map = Map::parse(&guess.text, "the columns as they were found", system)?;
    told(&guess, global);
    commanded(&map, address, study)?;
    Ok(map)
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
fn foreign(options: &Options, address: &Address, study: &Study, columns: &[LogColumn]) -> Failure {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let names = sanitize::list(&names);
    let (name, system) = (&study.name, &study.system.name);
    let what = match options.study {
        Some(_) => "--study names another, --make-map writes a map to be filled in",
        None => "it is taken where --study names none",
    };
    let reason = format!(
        "no column is a sensor of the study '{name}' of the system '{system}': {what}; the columns are {names}"
    );
    Failure::NoSample { log: address.to_string(), reason }
}

/// Warns about uncertain entries of a map.
fn told(guess: &Guess, global: Global) {
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

/// Writes a map file for the columns of a source.
fn make_map(
    options: &Options,
    address: &Address,
    study: &Study,
    path: &Path,
    global: Global,
) -> Result<String, Failure> {
    let system = &study.system;
    if path.exists() {
        return Err(Failure::Options("the map file exists already; it may hold work of a person"));
    }
    if address.is_live() {
        note(global, &format!("waiting for the first line of {address}"));
    }
    let columns = address.columns()?;
    let guess = guess(&columns, study, Trust::Likely);
    let found = system.sensors.len() - guess.sensors.len();
    if found == 0 {
        // With a named study, the user can fill the map in by hand. The default study may be the wrong one, so its
        // map would be useless.
        if options.study.is_none() {
            return Err(foreign(options, address, study, &columns));
        }
        let text = format!("no column is a sensor of the study '{}': fill them in", study.name);
        warn(global, &[text]);
    }
    files::write_atomically(path, |out| out.write_all(guess.text.as_bytes()))
        .map_err(SinkError::File)?;
    told(&guess, global);
    let inputs = system.network().inputs.len();
    let result = json!({
        "map": path.display().to_string(),
        "time": guess.time,
        "sensors_found": found,
        "sensors_lacking": guess.sensors,
        "inputs_lacking": guess.inputs,
        "units_assumed": guess.assumed,
        "likely": guess.likely,
        "doubts": guess.doubts,
        "columns_unused": guess.unused,
    });
    Ok(match global {
        Global { json: true, .. } => crate::render::json(&result),
        Global { quiet: true, .. } => String::new(),
        _ => format!(
            "{}: {found} of {} sensors and {} of {inputs} inputs found, {} columns not used\n",
            path.display(),
            system.sensors.len(),
            inputs - guess.inputs.len(),
            guess.unused.len()
        ),
    })
}
