//! `servotwin watch`: the twin and the diagnosis beside a log or a live stream.

use super::progress::is_shown;
use super::{SpanOptions, note, warn};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::{Grid, Side};
use crate::{Global, out, stop};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use servotwin::evaluation::{EvaluationError, model_file};
use servotwin::files;
use servotwin::flight::band::BandMerit;
use servotwin::flight::watcher::Watcher;
use servotwin::job::{Folder, flights};
use servotwin::log::checkpoint::Checkpoint;
use servotwin::log::counts::{Counts, Kind};
use servotwin::log::map::{Guess, Map, Trust, guess};
use servotwin::log::sink::events::Events;
use servotwin::log::sink::mcap::{Lost, Mcap};
use servotwin::log::sink::strip::Strip;
use servotwin::log::sink::timeline::Timeline;
use servotwin::log::sink::{Sample, Scene, Sink, SinkError};
use servotwin::log::source::cut::Cut;
use servotwin::log::source::{Address, LogColumn};
use servotwin::log::{Checkpoints, End, Observer, State, Watch};
use servotwin::moment;
use servotwin::sanitize::{self, Printable};
use servotwin::study::{Setting, Study};
use servotwin::system::{System, units};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::diagnoser::environment::Input;
use servotwin_model::lanes::Level;
use std::fs::OpenOptions;
use std::io::{Stdout, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;

/// Watch an actuator: a log, or a live stream, beside its twin.
///
/// Which column is which signal says a map file; --make-map writes one for a log to be looked over.
/// Without one, columns are found by their names. A file is read faster than real time, a stream
/// until it ends or Ctrl-C.
#[derive(clap::Args)]
pub struct Options {
    /// A log (.csv, .parquet, .mcap, .jsonl; .mf4 and .mat with the features of these names), - for lines of standard
    /// input, udp://HOST:PORT to listen at, or mqtt://HOST/TOPIC to subscribe to.
    source: String,
    /// A study file, which names the system; without it, the paper's study of the aileron.
    #[arg(long, value_name = "FILE")]
    study: Option<PathBuf>,
    /// The diagnoser, a file that `servotwin flights` has written [default:
    /// out/diagnoser-realistic.json].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// A confidence band that `servotwin band` has written, instead of the diagnoser's own: where it says nothing,
    /// outcomes are marked.
    #[arg(long, value_name = "FILE")]
    band: Option<PathBuf>,
    /// The map file: which column is which signal.
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    #[command(flatten)]
    span: SpanOptions,
    /// Write a map file for the columns of the source, and end.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["map", "html", "mcap", "events", "checkpoint"])]
    make_map: Option<PathBuf>,
    /// Write the timeline as an HTML file.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write inputs, measured values, twin, residuals, bands and decisions as MCAP, which Foxglove, Rerun and
    /// PlotJuggler open: into a file, or as a live stream to whoever listens at tcp://HOST:PORT. May be given for
    /// both.
    #[arg(long, value_name = "FILE|tcp://HOST:PORT")]
    mcap: Vec<PathBuf>,
    /// Write every change as a line of JSON, as it comes.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Keep here what is needed to go on later.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Go on from the checkpoint.
    #[arg(long, requires = "checkpoint")]
    resume: bool,
}

/// The time between two checkpoints, s.
const CHECKPOINT_S: f64 = 60.0;

impl Options {
    /// The files that it reads and writes.
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

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let study = match &options.study {
        Some(path) => Study::read(path)?,
        None => Study::default(),
    };
    let system = &study.system;
    let address = Address::parse(&options.source)?;
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
    let span = options.span.read()?;
    if !span.is_whole() {
        if address.is_live() {
            return Err(Failure::Options(
                "--from and --to are for files: a live stream has no part",
            ));
        }
        source = Box::new(Cut::new(source, address.to_string(), &map, span));
    }
    let diagnoser = read_diagnoser(options.model.as_deref(), options.band.as_deref())?;
    let needed = needed(&diagnoser, system);
    let shortest = diagnoser.lengths.iter().filter_map(|length| length.span.samples()).min();
    let believed = believed(&diagnoser, system);
    let (mut observer, period_s) = observer(options, &study, diagnoser, &map, &needed, global)?;
    let title = format!("{}: {address}", system.title);
    let scene = Scene::new(&title, system, observer.features(), period_s);
    let resumed = match options.resume {
        true => options.checkpoint.as_deref().map(Checkpoint::read).transpose()?,
        false => None,
    };
    let mut outputs = Outputs::new(options, scene, resumed.as_ref(), global)?;
    let mut watch = Watch::new(&mut *source, &map, &mut observer, period_s);
    watch.believed(&believed);
    if let Some(checkpoint) = resumed {
        watch.resume(checkpoint)?;
    }
    if let Some(path) = &options.checkpoint {
        let every = (CHECKPOINT_S / period_s) as u64;
        watch.checkpoints(Checkpoints { path: path.clone(), every });
    }
    stop::heed();
    let bar = outputs.bar.clone();
    watch.sink(&mut outputs);
    let end = thread::scope(|scope| {
        // A log is mostly read before a compiler would be done.
        if address.is_live() {
            scope.spawn(|| system.compiled.kernels(&system.program, Level::Single));
        }
        let end = watch.run(stop::flag(), &mut |time_s, share| show(&bar, time_s, share));
        system.compiled.give_up();
        end
    });
    bar.finish_and_clear();
    let end = end?;
    let counts = watch.counts().clone();
    let doubts = watch.doubts().sentences(system, &map, period_s, &counts);
    drop(watch);
    if end == End::Complete && counts.samples == 0 {
        return Err(nothing(&address, &counts));
    }
    if let (Some(path), Some(timeline)) = (&options.html, &outputs.timeline) {
        timeline.write(path, &counts)?;
    }
    let mut lost = vec![];
    for mcap in outputs.mcaps.drain(..) {
        lost.extend(mcap.finish()?);
    }
    // Ctrl-C is how a stream is left, but not how a file is done.
    if end == End::Stopped && !address.is_live() {
        return Err(Failure::Stopped);
    }
    let signals: Vec<&str> = (0..map.width()).map(|channel| map.id(channel)).collect();
    let output = match global {
        Global { json: true, .. } => format!("{}\n", summary(&counts, &signals, &lost)),
        Global { quiet: true, .. } => String::new(),
        _ => outputs.strip.text() + "\n" + &people(&counts, &signals, &lost),
    };
    if end == End::Complete && counts.judged == 0 && !options.resume {
        let mut reasons = doubts;
        reasons.extend(unmeasured(&map, &needed));
        if reasons.is_empty() {
            let shortest_s = shortest.map_or(0.0, |n| n as f64 * period_s);
            reasons.push(gaps(&map, &needed, &counts, shortest_s));
        }
        let states = outputs.unjudged.join(" or ");
        let reason =
            format!("nothing could be judged, every period is {states}: {}", reasons.join("; "));
        return Err(Failure::Unjudged { output, log: address.to_string(), reason });
    }
    warn(global, &doubts);
    Ok(output)
}

/// That a log has no column for sensors that the diagnoser reads.
fn unmeasured(map: &Map, needed: &[&str]) -> Option<String> {
    let without: Vec<&str> = map.unmeasured().filter(|id| needed.contains(id)).collect();
    (!without.is_empty()).then(|| format!("the log has no {}", without.join(", ")))
}

/// Why nothing was judged of a log that has all columns, in its units and often enough.
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

/// For each input of the system between which values the diagnoser believes it.
fn believed(diagnoser: &Diagnoser, system: &System) -> Vec<(f64, f64)> {
    let known = |id: &str| diagnoser.environment.inputs.iter().find(|input| input.name == id);
    let inputs = system.network().inputs.iter().map(|input| known(&input.id));
    let range = |input: Option<&Input>| input.map(|input| (input.least, input.largest));
    inputs.map(|input| range(input).unwrap_or((f64::NEG_INFINITY, f64::INFINITY))).collect()
}

/// Why nothing came of a log that was read to its end.
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

/// Twin and diagnosis, with the period of their samples, s.
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

/// The diagnoser where none is named.
fn usual_diagnoser() -> PathBuf {
    Folder::new("out").diagnoser(Setting::Realistic)
}

/// The diagnoser of a file, or the one of the output folder, with a band of its own where one is named.
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

/// The map that is given, or one by the names of the columns.
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

/// Whether the log, or the map, says what the study's command is. A twin that stands still beside an actuator that moves
/// tells faults that are none.
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

/// The columns of a file that a map does not read, as the part of a sentence.
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

/// That a log has no sensor of the study: nothing of it could be judged.
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

/// Says what is uncertain in a map.
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
        // Of a study that was named the map may be filled in by hand; of another it would be of no use.
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

/// Everything that is told each sample.
struct Outputs {
    strip: Strip,
    timeline: Option<Timeline>,
    mcaps: Vec<Mcap>,
    /// What was said instead of a judgement, as it came.
    unjudged: Vec<String>,
    /// Whether it was said that a connection is lost.
    is_loss_told: bool,
    global: Global,
    events: Option<Events<std::fs::File>>,
    lines: Option<Events<Printable<Stdout>>>,
    bar: ProgressBar,
}

impl Outputs {
    fn new(
        options: &Options,
        scene: Scene,
        resumed: Option<&Checkpoint>,
        global: Global,
    ) -> Result<Self, Failure> {
        let events = match &options.events {
            Some(path) => Some(Events::to_file(events_file(path, resumed)?, path)),
            None => None,
        };
        let mcaps = options.mcap.iter().map(|target| Mcap::open(target, &scene));
        Ok(Outputs {
            mcaps: mcaps.collect::<Result<_, _>>()?,
            unjudged: vec![],
            is_loss_told: false,
            global,
            strip: Strip::default(),
            timeline: options.html.is_some().then(|| Timeline::new(scene)),
            events,
            lines: global.json.then(|| Events::new(out::stdout())),
            bar: bar(global),
        })
    }

    /// On a terminal every change is a line as it comes.
    fn told(&self, sample: &Sample) {
        if sample.changed && !self.bar.is_hidden() {
            let words = sample.observation.finding.words();
            self.bar.println(format!("{:>12}  {words}", moment::shown(sample.time_s)));
        }
    }

    fn keep_unjudged(&mut self, state: State) {
        let words = format!("'{}'", state.words());
        if !state.is_judgement() && !self.unjudged.contains(&words) {
            self.unjudged.push(words);
        }
    }

    /// Says once that nobody takes a stream any more.
    fn tell_loss(&mut self) {
        let lost = if self.is_loss_told { None } else { self.mcaps.iter().find_map(Mcap::lost) };
        if let Some(Lost { target, reason, .. }) = lost {
            self.is_loss_told = true;
            let text = format!("{target}: the connection is lost ({reason}); the watch goes on");
            self.bar.suspend(|| warn(self.global, &[text]));
        }
    }
}

impl Sink for Outputs {
    fn connection(&mut self, lost: Option<&str>) -> Result<(), SinkError> {
        let text = match lost {
            Some(cause) => {
                format!("the connection to the source is lost ({cause}); the watch connects again")
            }
            None => "the connection to the source is made again".to_owned(),
        };
        self.bar.suspend(|| warn(self.global, &[text]));
        Ok(())
    }

    fn sample(&mut self, sample: &Sample) -> Result<(), SinkError> {
        self.told(sample);
        self.keep_unjudged(sample.observation.finding.state);
        self.strip.sample(sample)?;
        if let Some(timeline) = &mut self.timeline {
            timeline.sample(sample)?;
        }
        for mcap in &mut self.mcaps {
            mcap.sample(sample)?;
        }
        self.tell_loss();
        if let Some(events) = &mut self.events {
            events.sample(sample)?;
        }
        if let Some(lines) = &mut self.lines {
            lines.sample(sample)?;
        }
        Ok(())
    }
}

/// The file of events: it grows line by line, so that others can follow it. Where a watch goes on, it
/// keeps what it has up to there.
fn events_file(path: &Path, resumed: Option<&Checkpoint>) -> Result<std::fs::File, Failure> {
    let failed = |cause| SinkError::File(files::FileError::from_io(path, cause));
    let kept = match resumed {
        Some(checkpoint) if path.exists() => {
            let text = files::read_text(path).map_err(SinkError::File)?;
            let lines = text.lines().take(checkpoint.events() as usize);
            lines.map(|line| format!("{line}\n")).collect()
        }
        _ => String::new(),
    };
    let mut open = OpenOptions::new();
    let mut file = open.write(true).create(true).truncate(true).open(path).map_err(failed)?;
    file.write_all(kept.as_bytes()).map_err(failed)?;
    Ok(file)
}

fn bar(global: Global) -> ProgressBar {
    if !is_shown(global) {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {percent} %");
    ProgressBar::new(1000).with_style(style.expect("a correct template"))
}

fn show(bar: &ProgressBar, time_s: f64, share: Option<f64>) {
    if time_s.is_finite() {
        bar.set_message(moment::shown(time_s));
    }
    bar.set_position((1000.0 * share.unwrap_or(0.0)) as u64);
}

/// What was counted, for programs: the last line behind the events.
fn summary(counts: &Counts, signals: &[&str], lost: &[Lost]) -> Value {
    let met: serde_json::Map<String, Value> = counts
        .met()
        .map(|(kind, tally)| {
            let first = counts.place(tally);
            (kind.words().0.to_owned(), json!({ "count": tally.count, "first": first }))
        })
        .collect();
    let missing = signals.iter().zip(&counts.missing).filter(|(_, count)| **count > 0);
    let missing: serde_json::Map<String, Value> =
        missing.map(|(id, count)| (id.to_string(), json!(count))).collect();
    let unsent = lost.iter().map(|lost| (lost.target.clone(), json!(lost.unsent)));
    json!({ "summary": {
        "frames": counts.frames,
        "samples": counts.samples,
        "judged": counts.judged,
        "met": met,
        "missing": missing,
        "unsent": unsent.collect::<serde_json::Map<String, Value>>(),
    }})
}

/// What was counted, for people.
fn people(counts: &Counts, signals: &[&str], lost: &[Lost]) -> String {
    let (frames, counted, samples) = (counts.frames, &counts.counted, counts.samples);
    let judged = counts.judged;
    let mut text =
        format!("{frames} {counted}s became {samples} samples, {judged} of them judged\n");
    let missing = signals.iter().zip(&counts.missing).filter(|(_, count)| **count > 0);
    let missing: Vec<String> = missing.map(|(id, count)| format!("{id} in {count}")).collect();
    if !missing.is_empty() {
        text += &format!("samples without a value: {}\n", missing.join(", "));
    }
    for Lost { target, unsent, .. } in lost {
        text += &format!("samples not sent to {target}: {unsent}\n");
    }
    if counts.met().next().is_some() {
        let heads =
            [("how often", Side::Right), ("what was met", Side::Left), ("first", Side::Left)];
        let mut grid = Grid::new(&heads);
        for (kind, tally) in counts.met() {
            let words = kind.words().1.to_owned();
            grid.push(vec![tally.count.to_string(), words, counts.place(tally)]);
        }
        text += "\n";
        text += &grid.text();
    }
    text
}
