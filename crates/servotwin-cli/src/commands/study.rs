//! `servotwin study`: runs the main job, from the study file to the report.

use super::campaign::{bar, describe, named};
use super::progress::{Notes, Stages};
use super::{StudyOptions, recordings, removed, summary};
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use indicatif::ProgressBar;
use serde_json::json;
use servotwin::job::{Folder, Results, StudyEvent, StudyRun};
use servotwin::study::Study;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Simulate a study, train and evaluate its diagnosis, and write the report.
///
/// Runs `campaign`, `train`, `evaluate`, `flights` and `report` one after the other. The first scenario already
/// produces a report, and the next ones extend it. An interrupted study continues where it stopped, and the results are
/// the same to the byte.
///
/// A study of recordings has measured records instead of a simulated plant (docs/own-data.md). It learns its targets from
/// their windows, judges each by what other groups teach, and writes the windows, the outcomes, the model and the results.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    study: StudyOptions,
    /// Also run the scenario in which every specimen has a twin fitted to it in a calibration flight.
    #[arg(long)]
    fitted: bool,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let begin = Instant::now();
    stop::heed();
    if let Some(path) = options.study.recordings() {
        return recordings::run(path, &options.study, global);
    }
    let study = options.study.read(global)?;
    let screen = Screen::new(global, options, &study);
    let run = StudyRun {
        replace: options.study.replace,
        fitted: options.fitted,
        workers: super::evaluate::workers(options.study.threads),
        observer: &|event| screen.show(event),
        ..StudyRun::new(&study, &options.study.out)
    };
    let results = run.run();
    screen.end();
    let results = results?;
    servotwin_report::write(results.folder(), &study)?;
    let path = results.folder().report().display().to_string();
    let seconds = begin.elapsed().as_secs_f64();
    Ok(match global {
        Global { json: true, .. } => json(&json!({
            "report": path,
            "evaluation": run.folder.results().display().to_string(),
            "manifest": run.folder.manifest().display().to_string(),
        })),
        Global { quiet: true, .. } => String::new(),
        _ => {
            let summary = summary::text(&results.evaluation, &study);
            let more = if study.is_full { "" } else { MORE };
            format!("{summary}\n{path}, after {seconds:.0} s\n{more}")
        }
    })
}

const MORE: &str =
    "This was the quick study; --full has longer records, more training commands, and flights\n";

/// Shows the progress of a study to the user.
struct Screen<'s> {
    global: Global,
    study: &'s Study,
    folder: Folder,
    notes: Notes,
    state: Mutex<State>,
}

/// The current stage.
struct State {
    begin: Instant,
    /// The number of the stage among all, as text.
    number: String,
    rows: Option<ProgressBar>,
    stages: Option<Stages>,
}

impl<'s> Screen<'s> {
    fn new(global: Global, options: &Options, study: &'s Study) -> Self {
        let state =
            State { begin: Instant::now(), number: String::new(), rows: None, stages: None };
        Screen {
            global,
            study,
            folder: Folder::new(&options.study.out),
            notes: Notes::new(global),
            state: Mutex::new(state),
        }
    }

    /// Writes the report of the results so far, and shows their main figures.
    fn report(&self, results: &Results) {
        let path = self.folder.report();
        let note = match servotwin_report::write(&self.folder, self.study) {
            Ok(()) => format!("{}: {}", path.display(), summary::brief(results, self.study)),
            // A lasting error also fails the final report, which then ends the command.
            Err(error) => format!("no report yet: {error}"),
        };
        self.notes.write(&note);
    }

    fn show(&self, event: &StudyEvent) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            StudyEvent::Removed { files } => {
                removed(self.global, &self.folder.path().display().to_string(), *files);
            }
            StudyEvent::Began { stage, of } => state.number = format!("{stage}/{of} "),
            StudyEvent::Rows { campaign, done, all } => {
                let name = state.number.clone() + &named(&campaign.scenarios, campaign.purpose);
                let new = || bar(&name, self.global);
                let (done, all) = (*done as u64, *all as u64);
                state.rows.get_or_insert_with(new).update(|bar| {
                    bar.set_len(all);
                    bar.set_pos(done);
                });
            }
            StudyEvent::Simulated { campaign, outcome } => {
                let seconds = state.end_stage();
                self.notes.write(describe(campaign, outcome, seconds).trim_end());
            }
            StudyEvent::FlightsKept => self.notes.write(
                "kept what was measured in the full flights (without flights.json the small ones are flown)",
            ),
            StudyEvent::Flying { what, share } | StudyEvent::Evaluating { what, share } => {
                let what = state.number.clone() + what;
                let stages = || Stages::new(self.global);
                state.stages.get_or_insert_with(stages).show(&what, *share);
            }
            StudyEvent::Flown(_) => {
                self.notes.write(&format!("flown in {:.1} s", state.end_stage()));
            }
            StudyEvent::Evaluated { results, remaining } => {
                let seconds = state.end_stage();
                self.notes.write(&format!("trained and evaluated in {seconds:.1} s"));
                if *remaining > 0 {
                    self.report(results);
                }
            }
        }
    }

    fn end(&self) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).end_stage();
    }
}

impl State {
    /// Clears the progress. Returns the time since the last stage ended, s.
    fn end_stage(&mut self) -> f64 {
        if let Some(bar) = self.rows.take() {
            bar.finish_and_clear();
        }
        if let Some(stages) = self.stages.take() {
            stages.end();
        }
        let seconds = self.begin.elapsed().as_secs_f64();
        self.begin = Instant::now();
        seconds
    }
}
