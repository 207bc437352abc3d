//! `servotwin watch`: runs the twin and the diagnosis on a log or a live stream.

pub(crate) mod input;
mod outputs;

use super::{find_study, note, quantity, recordings, warn};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run, stop};
use input::{InputOptions, diagnoser, log_of, observer, tell, usual_diagnoser, warn_of_lacking};
use outputs::{Outputs, Shown, Totals};
use servotwin::files;
use servotwin::learn::model_file;
use servotwin::live::watcher::Watcher;
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::{Diagnoser, Recorded};
use servotwin_model::spec::Unit;
use servotwin_view::document::{Content, Document, Form, Value, Verdict, line};
use servotwin_view::render;
use servotwin_watch::checkpoint::Checkpoint;
use servotwin_watch::guard::{self, accepted_ranges, needed};
use servotwin_watch::map::{Map, Trust, guess};
use servotwin_watch::sink::{Scene, SinkError};
use servotwin_watch::source::{Address, Source};
use servotwin_watch::watchdog::WatchdogRules;
use servotwin_watch::{End, Watch};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Watch an actuator: run its twin and the diagnosis on a log or a live stream.
///
/// A map file assigns the columns of the source to signals. --make-map writes one for a log, for you to review. Without
/// a map file, columns are found by their names. A file is read faster than real time; a stream is read until it ends
/// or until Ctrl-C.
///
/// With a diagnoser of a study of recordings (--model FOLDER/diagnoser-of-TARGET.json), the windows of a log are answered
/// for without a twin.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// A log (.csv, .parquet, .jsonl), - for lines from standard input, or udp://HOST:PORT to listen on.
    source: String,
    /// A study file, which names the system [default: paper, the paper's study of the aileron].
    #[arg(long, value_name = "FILE")]
    study: Option<PathBuf>,
    #[command(flatten)]
    input: InputOptions,
    /// Write a map file for the columns of the source, and exit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["map", "html", "events", "checkpoint"])]
    make_map: Option<PathBuf>,
    /// Write a page with all charts and events as an HTML file.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write every change as a line of JSON when it happens.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Save the state of the watch in this file, so that --resume can continue from it.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Continue from the checkpoint.
    #[arg(long, requires = "checkpoint")]
    resume: bool,
    /// Withdraw the actions that stand before continuing from the checkpoint. All is judged anew, also a fault that
    /// lasts.
    #[arg(long, requires = "resume")]
    reset: bool,
    /// For a live source: report missing data when the source or a column sends nothing for this time, by the wall
    /// clock [default: 2 s, or ten periods of the diagnoser if that is longer].
    #[arg(long, value_name = "TIME")]
    no_data_after: Option<String>,
    /// For a live source: time between reports that the watch is alive and how much each output has lost. 0s turns
    /// these reports off.
    #[arg(long, value_name = "TIME", default_value = "10s")]
    heartbeat: String,
}

/// The exit code of a log or stream whose findings must not be believed.
const REFUSED: u8 = 3;

/// The time between two checkpoints, s.
const CHECKPOINT_S: f64 = 60.0;

impl Run for Options {
    fn paths(&self) -> Paths {
        Paths::default()
            .read("the log", log_of(&self.source))
            .read_study(self.study.as_ref())
            .read("the diagnoser", [self.input.model.clone().unwrap_or_else(usual_diagnoser)])
            .read("--map", &self.input.map)
            .write("--make-map", Format::TOML, &self.make_map)
            .write("--html", Format::HTML, &self.html)
            .write("--events", Format::LINES, &self.events)
            .write("--checkpoint", Format::Any, &self.checkpoint)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        let options = self;
        let input = &self.input;
        let named = input.model.as_deref().map(model_file::read_diagnoser).transpose()?;
        if let Some(own) = &named
            && let Some(recorded) = &own.recorded
        {
            return watch_recording(options, (own, recorded), global);
        }
        let study = find_study(self.study.as_deref())?;
        let address = Address::parse(&self.source)?;
        if let Some(path) = &self.make_map {
            return make_map(options, &address, &study, path, global);
        }
        let (map, mut source) = input.open(&address, &study, self.study.is_some(), global)?;
        let diagnoser = Arc::new(named.map_or_else(|| diagnoser(&study, global), Ok)?);
        let path = input.model.clone().unwrap_or_else(usual_diagnoser);
        warn_of_lacking(&map, &needed(&diagnoser, &study.system), global);
        guard::of_records(&diagnoser).iter().for_each(|text| note(global, text));
        if !address.is_live() && !self.resume {
            input.try_log(&address, &map, &study, (&path, &diagnoser), global)?;
        }
        let mut observer = observer(&study, (&path, diagnoser.clone()))?;
        let setup = Setup { options, study: &study, diagnoser: &diagnoser, address, map, global };
        setup.watch(&mut *source, &mut observer)
    }
}

/// Judges the windows of a log by a diagnoser of recordings, which brings its study and its nominal values.
fn watch_recording(
    options: &Options,
    known: (&Diagnoser, &Recorded),
    global: Global,
) -> Result<Document, Failure> {
    let Options { study, make_map, html, events, checkpoint, .. } = options;
    let others = [study, make_map, html, events, checkpoint, &options.input.map];
    match log_of(&options.source).filter(|_| others.iter().all(|other| other.is_none())) {
        Some(log) => recordings::watch(&log, known, global),
        None => Err(Failure::usage(
            "a diagnoser of recordings judges a table, and takes no other option of watch",
        )),
    }
}

/// The time until a live source counts as silent, and the interval of heartbeats.
fn watchdog(options: &Options, period_s: f64) -> Result<WatchdogRules, Failure> {
    let seconds = |option, text, least_s: f64| {
        let words = format!("{least_s} s to 86,400 s");
        let value = quantity(option, text, Unit::Second, least_s..=86_400.0, &words);
        value.map(Duration::from_secs_f64)
    };
    let no_data_after = match &options.no_data_after {
        Some(text) => seconds("--no-data-after", text, 0.1)?,
        None => WatchdogRules::of_period(period_s).no_data_after,
    };
    let heartbeat = seconds("--heartbeat", &options.heartbeat, 0.0)?;
    Ok(WatchdogRules { no_data_after, heartbeat: Some(heartbeat).filter(|every| !every.is_zero()) })
}

/// The settings of a watch, apart from its source and its observer.
struct Setup<'s> {
    options: &'s Options,
    study: &'s Study,
    diagnoser: &'s Diagnoser,
    address: Address,
    map: Map,
    global: Global,
}

impl Setup<'_> {
    /// Watches until the source ends or Ctrl-C, and then ends all outputs.
    fn watch(&self, source: &mut dyn Source, observer: &mut Watcher) -> Result<Document, Failure> {
        let Setup { options, study, diagnoser, address, map, global } = self;
        let (system, period_s) = (&study.system, diagnoser.period_s);
        let rules = watchdog(options, period_s)?;
        let scene = Scene::of_study(&format!("{}: {address}", system.title), study, diagnoser);
        let resumed = match options.resume {
            true => options.checkpoint.as_deref().map(Checkpoint::read).transpose()?,
            false => None,
        };
        let mut outputs = Outputs::new(options, address, scene, resumed.as_ref(), *global)?;
        let mut watch = Watch::new(source, map, observer, period_s);
        watch.expect(study, &accepted_ranges(diagnoser, system));
        if let Some(checkpoint) = resumed {
            watch.resume(checkpoint)?;
        }
        if options.reset {
            watch.reset_alarm();
        }
        if options.checkpoint.is_some() {
            watch.save_every((CHECKPOINT_S / period_s) as u64);
        }
        if address.is_live() {
            watch.watchdog(rules);
        }
        stop::heed();
        let show = outputs.shows_progress(address.is_live());
        let Outputs { shown, threads, .. } = &mut outputs;
        watch.sink(shown);
        watch.sink(threads);
        let mut run = || watch.run(stop::flag(), &mut |time_s, share| show(time_s, share));
        // A log is usually read to its end before a compiler would finish.
        let end = match address.is_live() {
            true => system.compiled.beside(&system.program, run),
            false => run(),
        }?;
        let (counts, silences) = (watch.counts().clone(), watch.silences());
        let (contradictions, mut doubts) = (watch.contradictions(), watch.doubts());
        drop(watch);
        doubts.extend(observer.wider_than_trained());
        if end == End::Complete && counts.samples == 0 {
            return Err(Failure::input(format!("{address}: {}", guard::nothing(map, &counts))));
        }
        let (totals, shown) = outputs.end(counts, silences)?;
        // Ctrl-C is the normal end of a stream, but leaves a file unfinished.
        if end == End::Stopped && !address.is_live() {
            return Err(Failure::stopped());
        }
        let verdict = self.verdict(end, &totals, &shown, (doubts, contradictions));
        self.document(verdict, &totals, shown)
    }

    /// What the diagnosis says at the end, or why it must not be believed; an exit code, and whether findings are shown.
    fn verdict(
        &self,
        end: End,
        totals: &Totals,
        shown: &Shown,
        (mut doubts, contradictions): (Vec<String>, Vec<String>),
    ) -> (Verdict, u8, bool) {
        let Setup { options, study, diagnoser, address, map, global } = self;
        let counts = &totals.counts;
        let refused = |reason, is_shown| {
            (Verdict::act(format!("error: {address}: {reason}")), REFUSED, is_shown)
        };
        if end == End::Complete && counts.judged == 0 && !options.resume {
            let reasons = guard::unjudged(doubts, map, diagnoser, &study.system, counts);
            let states = shown.unjudged.iter().map(|state| format!("'{}'", state.words()));
            let states = states.collect::<Vec<_>>().join(" or ");
            let reason = format!("nothing could be judged, every period is {states}: {reasons}");
            return refused(reason, true);
        }
        doubts.retain(|doubt| !contradictions.contains(doubt));
        warn(*global, &doubts);
        if !contradictions.is_empty() {
            let remedy = if end == End::Contradicted { "; --to reads the part before" } else { "" };
            let source = if address.is_live() { "stream" } else { "log" };
            let reason = format!(
                "the findings are not those of the actuator, because the {source} contradicts its map: {}{remedy}",
                contradictions.join("; ")
            );
            // False findings are not shown where no line was written before they were known to be false.
            return refused(reason, address.is_live());
        }
        let lost = totals.lost_files();
        if !lost.is_empty() {
            return (Verdict::act(format!("error: not complete: {}", lost.join("; "))), 1, true);
        }
        let said = shown.last.as_deref().unwrap_or("no data");
        (Verdict::neutral(format!("at the end: {said}")), 0, true)
    }

    /// The result of the watch, which is also on its page.
    fn document(
        &self,
        (verdict, exit_code, is_shown): (Verdict, u8, bool),
        totals: &Totals,
        Shown { strip, page, .. }: Shown,
    ) -> Result<Document, Failure> {
        let Setup { options, address, map, global, .. } = self;
        let mut document = Document::new("watch", verdict).formed(Form::Line);
        document.exit_code = exit_code;
        if is_shown {
            document.push("", Content::Raw(format!("\n{}\n", strip.text())));
        }
        if is_shown || global.json {
            totals.describe(map, &mut document);
        }
        let (Some(path), Some(page)) = (&options.html, page) else { return Ok(document) };
        let verdict = document.verdict.as_ref().map_or("", |verdict| &verdict.line.text);
        let page = page.screen.page(verdict, &render::terminal(&document, true, None));
        match files::write_text(path, &page) {
            // What hours of a stream gave is shown, though its page cannot be written.
            Err(error) if address.is_live() => {
                document.verdict = Some(Verdict::act(format!("error: not complete: {error}")));
                document.exit_code = document.exit_code.max(1);
            }
            written => written.map_err(SinkError::File)?,
        }
        Ok(document)
    }
}

/// Writes a map file for the columns of a source.
fn make_map(
    options: &Options,
    address: &Address,
    study: &Study,
    path: &Path,
    global: Global,
) -> Result<Document, Failure> {
    let system = &study.system;
    if path.exists() {
        return Err(Failure::usage("the map file exists already; it may hold work of a person"));
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
            let log = address.to_string();
            return Err(Failure::of_intake(&log, guard::foreign(&log, &columns, study, false)));
        }
        let text = format!("no column is a sensor of the study '{}': fill them in", study.name);
        warn(global, &[text]);
    }
    files::write_text(path, &guess.text).map_err(SinkError::File)?;
    let (warnings, notes) = guess.remarks();
    tell(&warnings, &notes, global);
    let inputs = system.network().inputs.len();
    let values = [
        ("map", path.into()),
        ("sensors_found", found.into()),
        ("sensors", system.sensors.len().into()),
        ("inputs_found", (inputs - guess.inputs.len()).into()),
        ("inputs", inputs.into()),
        ("unused", guess.unused.len().into()),
    ];
    let verdict = line(
        "{map}: {sensors_found} of {sensors} sensors and {inputs_found} of {inputs} inputs found, {unused} columns not \
         used",
        values,
    );
    let mut document = Document::new("make-map", Verdict::good(verdict));
    document.fact("time", "", Value::of("", &guess.time));
    document.fact("sensors_lacking", "", Value::of("", &guess.sensors));
    document.fact("inputs_lacking", "", Value::of("", &guess.inputs));
    document.fact("units_assumed", "", Value::of("", &guess.assumed));
    document.fact("likely", "", Value::of("", &guess.likely));
    document.fact("doubts", "", Value::of("", &guess.doubts));
    document.fact("columns_unused", "", Value::of("", &guess.unused));
    Ok(document)
}
