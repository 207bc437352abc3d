//! `servotwin study`: runs the main job, from the study file to the report, or some suites of it.

use super::progress::{Notes, Stages};
use super::records::{bar, describe, named};
use super::{StudyOptions, flights, recordings, records, removed, summary, workers};
use crate::failure::Failure;
use crate::{Global, Run, stop};
use indicatif::ProgressBar;
use servotwin::job::{Folder, Results, StudyEvent, StudyRun};
use servotwin::run::part::Share;
use servotwin::study::suites::{FLIGHTS, MAX_ENVIRONMENTS, RECORDS};
use servotwin::study::{Scenario, Study};
use servotwin_view::document::Document;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Simulate a study, train and evaluate its diagnosis, and write the report.
///
/// Without --suite: simulates the records of every scenario, trains and evaluates trees and committee on them, flies
/// (with --full), and writes the report. The first scenario already produces a report, and the next ones extend it. An
/// interrupted study continues where it stopped, and the results are the same to the byte.
///
/// A study of recordings has measured records instead of a simulated plant (docs/own-data.md). It learns its targets from
/// their windows, judges each by what other groups teach, and writes the windows, the outcomes, the model and the results.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    pub(super) study: StudyOptions,
    /// Also run the scenario in which every specimen has a twin fitted to it in a calibration flight.
    #[arg(long, conflicts_with = "suite")]
    fitted: bool,
    /// Only run these suites, separated by commas. 'records' simulates every fault in every operating case and writes
    /// the data sets. 'flights' trains the diagnosis on flights in which faults begin (diagnoser-SCENARIO.json) and
    /// judges it in every suite that is not on request. Another suite is flown with the diagnosers in the folder, and
    /// nothing is learned: judge, unseen, other_structure, other_structure_fitted, missing_sensors, healthy,
    /// healthy_other_structure, effects, or one of the study's own. Every flight becomes a row of
    /// outcomes-SUITE-SCENARIO.parquet. An interrupted suite goes on where it was last stored.
    #[arg(long, value_name = "SUITES", value_delimiter = ',')]
    pub(super) suite: Vec<String>,
    /// Only run this scenario: perfect sensors and a plant that equals the twin (ideal), sensors with noise
    /// and quantization (noise), these sensors and specimens with tolerances (realistic), or such specimens with twins
    /// fitted to them (fitted) [default: all but fitted].
    #[arg(long, conflicts_with = "fitted", value_parser = Scenario::ALL.map(Scenario::name))]
    pub(super) scenario: Option<String>,
    /// Another number of environments of these suites.
    #[arg(long, value_name = "COUNT", requires = "suite",
          value_parser = clap::value_parser!(u32).range(1..=MAX_ENVIRONMENTS as i64))]
    pub(super) environments: Option<u32>,
    /// Another seed of these suites, 0 to 999.
    #[arg(long, value_name = "SEED", requires = "suite",
          value_parser = clap::value_parser!(u64).range(0..=999))]
    pub(super) seed: Option<u64>,
    /// Simulate only one share of these suites, e.g. 3/100 for the third of 100 shares. Use this for machines that
    /// have the folder in common, or whose 'parts' folders you copy together. The same command without --share
    /// simulates what is missing, and joins all.
    #[arg(long, requires = "suite", conflicts_with = "keep_traces")]
    pub(super) share: Option<Share>,
    /// Also write the time series of every record (gigabytes).
    #[arg(long, requires = "suite")]
    pub(super) keep_traces: bool,
    /// Judge the diagnosers in the folder in sealed environments: drawn with a seed that no study file can declare.
    /// Learns nothing. Every opening adds a line to sealed/openings.csv of the repository, or to sealed-openings.csv
    /// in the output folder, before the first flight. Writes `flights-sealed.json`.
    #[arg(long, conflicts_with = "suite")]
    pub(super) sealed: bool,
}

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        let is_records = self.suite == [RECORDS];
        if !is_records && self.keep_traces {
            return Err(Failure::usage("--keep-traces is for --suite records"));
        }
        let is_changed = self.environments.is_some() || self.seed.is_some();
        let is_learning = self.suite == [FLIGHTS];
        if (is_records && is_changed) || (is_learning && (is_changed || self.share.is_some())) {
            return Err(Failure::usage(
                "--environments and --seed change a suite of flights that --suite names; --share divides one, or the records",
            ));
        }
        match self.suite[..] {
            [] if !self.sealed => whole(self, global).map_err(Failure::on_the_way),
            _ if is_records => records::run(self, global).map_err(Failure::on_the_way),
            _ => flights::run(self, global),
        }
    }
}

/// Runs the main job.
fn whole(options: &Options, global: Global) -> Result<Document, Failure> {
    stop::heed();
    if let Some(path) = options.study.recordings() {
        return recordings::run(path, &options.study);
    }
    let study = options.study.read(global)?;
    if study.is_on_ground() {
        return flights::run(options, global);
    }
    let folder = options.study.folder();
    let screen = Screen::new(global, folder.clone(), &study);
    let run = StudyRun {
        replace: options.study.replace,
        fitted: options.fitted,
        only: options.scenario.as_deref().and_then(Scenario::named),
        workers: workers(options.study.threads),
        observer: &|event| screen.show(event),
        ..StudyRun::new(&study, folder.path())
    };
    let results = run.run();
    screen.end();
    let results = results?;
    servotwin_report::write(results.folder(), &study)?;
    let mut document = summary::document(&results.evaluation, &study);
    document.fact("report", "report", &results.folder().report());
    document.fact("evaluation", "", &run.folder.results());
    document.fact("manifest", "", &run.folder.manifest());
    if !study.is_full {
        document.note(MORE);
    }
    Ok(document)
}

const MORE: &str =
    "this was the quick study; --full has longer records, more training commands, and flights";

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
    fn new(global: Global, folder: Folder, study: &'s Study) -> Self {
        let state =
            State { begin: Instant::now(), number: String::new(), rows: None, stages: None };
        Screen { global, study, folder, notes: Notes::new(global), state: Mutex::new(state) }
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
                self.notes.write(&describe(campaign, outcome, seconds).text);
            }
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
