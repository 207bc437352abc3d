//! `servotwin study`: runs the main job, from the study file to the report, or some suites of it.

use super::progress::{Stages, with_crew};
use super::{StudyOptions, flights, recordings, records, remark, removed, summary, workers};
use crate::failure::Failure;
use crate::{Global, Run, stop};
use servotwin::job::tasks::Task;
use servotwin::job::{self, Crew, Folder, Job, JobError, Results, StudyEvent, StudyRun};
use servotwin::records::RunError;
use servotwin::run::part::Share;
use servotwin::study::suites::{FLIGHTS, MAX_ENVIRONMENTS, RECORDS};
use servotwin::study::{Purpose, Scenario, Study};
use servotwin_view::document::{Document, Table, Verdict, line};
use servotwin_view::row;
use std::collections::BTreeMap;
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
    study: StudyOptions,
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
    suite: Vec<String>,
    /// Only run this scenario: perfect sensors and a plant that equals the twin (ideal), sensors with noise
    /// and quantization (noise), these sensors and specimens with tolerances (realistic), or such specimens with twins
    /// fitted to them (fitted) [default: all but fitted].
    #[arg(long, conflicts_with = "fitted", value_parser = super::scenario())]
    scenario: Option<Scenario>,
    /// Another number of environments of these suites.
    #[arg(long, value_name = "COUNT", requires = "suite",
          value_parser = clap::value_parser!(u32).range(1..=MAX_ENVIRONMENTS as i64))]
    environments: Option<u32>,
    /// Another seed of these suites, 0 to 999.
    #[arg(long, value_name = "SEED", requires = "suite",
          value_parser = clap::value_parser!(u64).range(0..=999))]
    seed: Option<u64>,
    /// Simulate only one share of these suites, e.g. 3/100 for the third of 100 shares. Use this for machines that
    /// have the folder in common, or whose 'parts' folders you copy together. The same command without --share
    /// simulates what is missing, and joins all.
    #[arg(long, requires = "suite")]
    share: Option<Share>,
    /// Judge the diagnosers in the folder in sealed environments: drawn with a seed that no study file can declare.
    /// Learns nothing. Every opening adds a line to sealed/openings.csv of the repository, or to sealed-openings.csv
    /// in the output folder, before the first flight. Writes `flights-sealed.json`.
    #[arg(long, conflicts_with = "suite")]
    sealed: bool,
}

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        stop::heed();
        if let Some(path) = self.study.recordings().filter(|_| self.suite.is_empty()) {
            return recordings::run(path, &self.study);
        }
        let study = self.study.read(global)?;
        match self.suite[..] {
            [] if self.sealed => flights::sealed(&self.study, &study, &self.flown(&study)?, global),
            [] if study.is_on_ground() => suites(self, &study, &[FLIGHTS.into()], global),
            [] => whole(self, &study, global).map_err(Failure::on_the_way),
            _ => suites(self, &study, &self.suite, global),
        }
    }
}

impl Options {
    /// Everything but a study and its folder as it is by default.
    pub(super) fn of(study: StudyOptions) -> Self {
        Options {
            study,
            fitted: false,
            suite: vec![],
            scenario: None,
            environments: None,
            seed: None,
            share: None,
            sealed: false,
        }
    }

    /// Whether a scenario is the named one, or without a name a usual one.
    fn wants(&self, study: &Study, scenario: Scenario) -> bool {
        match self.scenario {
            Some(named) => named == scenario,
            None => scenario.is_usual() || study.is_on_ground(),
        }
    }

    /// The scenarios of flights.
    fn flown(&self, study: &Study) -> Result<Vec<Scenario>, Failure> {
        if study.flights.is_none() {
            return Err(JobError::NoFlights.into());
        }
        let all = job::flights::scenarios(study);
        let own: Vec<Scenario> =
            all.iter().copied().filter(|&scenario| self.wants(study, scenario)).collect();
        match self.scenario {
            Some(named) if own.is_empty() => {
                let known: Vec<&str> = all.iter().map(|scenario| scenario.name()).collect();
                let range = format!("this study flies in {}", known.join(" and "));
                Err(Failure::out_of_range("--scenario", named.name(), range))
            }
            _ => Ok(own),
        }
    }

    /// Refuses options that the suites do not have.
    fn check(&self, suites: &[String]) -> Result<(), Failure> {
        let has = |name: &str| suites.iter().any(|suite| suite == name);
        let is_changed = self.environments.is_some() || self.seed.is_some();
        if (is_changed && (has(RECORDS) || has(FLIGHTS))) || (self.share.is_some() && has(FLIGHTS))
        {
            return Err(Failure::usage(
                "--environments and --seed change a suite of flights that --suite names; --share divides one, or the records",
            ));
        }
        Ok(())
    }
}

/// Runs some suites, or a share of their parts.
pub(super) fn suites(
    options: &Options,
    study: &Study,
    names: &[String],
    global: Global,
) -> Result<Document, Failure> {
    options.check(names)?;
    let (folder, threads) = (options.study.folder(), options.study.threads);
    let job = Job::new(study, &folder);
    let mut changed = vec![];
    for name in names.iter().filter(|&name| name != RECORDS && name != FLIGHTS) {
        let suite = job.suite(name).map_err(|error| Failure::option("--suite", error))?;
        let mut suite = suite.clone();
        suite.seed = options.seed.unwrap_or(suite.seed);
        changed.push(match options.environments {
            Some(count) => suite.with_environments(count as usize),
            None => suite,
        });
    }
    if names.iter().any(|name| name != RECORDS) {
        options.flown(study)?;
    }
    let wanted = |scenario| options.wants(study, scenario);
    options.scenario.map_or(Ok(()), |scenario| RunError::check(scenario, study))?;
    let job = Job { changed: &changed, ..job };
    if options.share.is_some() || changed.iter().any(|suite| suite.purpose == Purpose::Train) {
        let _hold = folder.join_study(study)?;
        let done = with_crew(threads, global, |crew| {
            in_parts(Job { crew: *crew, ..job }, (names, options.share), wanted)
        });
        return done.map_err(Failure::on_the_way);
    }
    let _hold = options.study.keep(study, global)?;
    let done =
        with_crew(threads, global, |crew| Job { crew: *crew, ..job }.run_suites(names, wanted));
    let (records, flown) = done.map_err(Failure::on_the_way)?;
    let mut document = match &flown {
        Some(results) => flights::described(&folder, results, study, names)?,
        None => Document::new("records", records::verdict(&folder, &records)),
    };
    records::describe(&mut document, study, &records);
    Ok(document)
}

/// Computes the parts of some suites, or a share of them, without joining them.
fn in_parts(
    job: Job,
    (suites, share): (&[String], Option<Share>),
    wanted: impl Fn(Scenario) -> bool,
) -> Result<Document, JobError> {
    let all = job.tasks(suites, wanted)?;
    let is_own = |&(number, _): &(usize, &Task)| share.is_none_or(|own| own.holds(number));
    let own: Vec<Task> =
        all.iter().enumerate().filter(is_own).map(|(_, task)| task.clone()).collect();
    job.run(&own)?;
    let mut counts: BTreeMap<(&str, String), [usize; 2]> = BTreeMap::new();
    for (place, list) in [&own, &all].into_iter().enumerate() {
        for Task { suite, scenarios, .. } in list {
            let names: Vec<&str> = scenarios.iter().map(|scenario| scenario.name()).collect();
            counts.entry((suite, names.join(" and "))).or_default()[place] += 1;
        }
    }
    let mut table = Table::of("suite | scenario | parts | all:of");
    for ((suite, scenario), [own, all]) in counts {
        table.push(row![suite, scenario, own, all]);
    }
    let values = [
        ("folder", job.folder.path().into()),
        ("parts", own.len().into()),
        ("all", all.len().into()),
    ];
    let verdict = line(
        "{folder}: {parts} of {all} parts belong to this share and are complete. When all parts are, the same command \
         without --share joins them; 'servotwin study --suite flights' trains with those of learn and hard_negatives.",
        values,
    );
    let mut document = Document::new("share", Verdict::good(verdict));
    document.table("suites", table);
    Ok(document)
}

/// Runs the main job.
fn whole(options: &Options, study: &Study, global: Global) -> Result<Document, Failure> {
    let folder = options.study.folder();
    let screen = Screen::new(global, &folder, study);
    let progress = |what: &str, share: f64| screen.show(what, share);
    let crew = Crew { workers: workers(options.study.threads), progress: &progress };
    let run = StudyRun {
        replace: options.study.replace,
        fitted: options.fitted,
        only: options.scenario,
        observer: &|event| screen.note(event),
        ..StudyRun::new(Job { crew, ..Job::new(study, &folder) })
    };
    let results = run.run();
    screen.end_stage();
    let results = results?;
    servotwin_report::write(&folder, study)?;
    let mut document = summary::document(&results.evaluation, study);
    document.fact("report", "report", &folder.report());
    document.fact("evaluation", "", &folder.results());
    document.fact("manifest", "", &folder.manifest());
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
    folder: &'s Folder,
    /// The current stage and when it began.
    stage: Mutex<(Option<Stages>, Instant)>,
}

impl<'s> Screen<'s> {
    fn new(global: Global, folder: &'s Folder, study: &'s Study) -> Self {
        let stage = Mutex::new((None, Instant::now()));
        Screen { global, study, folder, stage }
    }

    fn show(&self, what: &str, share: f64) {
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        stage.0.get_or_insert_with(|| Stages::new(self.global)).show(what, share);
    }

    /// Clears the progress. Returns the time since the last stage ended, s.
    fn end_stage(&self) -> f64 {
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let (stages, begin) = std::mem::replace(&mut *stage, (None, Instant::now()));
        stages.iter().for_each(Stages::end);
        begin.elapsed().as_secs_f64()
    }

    fn note(&self, event: &StudyEvent) {
        let seconds = self.end_stage();
        match event {
            StudyEvent::Removed { files } => {
                removed(self.global, &self.folder.path().display().to_string(), *files);
            }
            StudyEvent::Simulated(records) => {
                remark(self.global, &records::line_of(self.study, records));
            }
            StudyEvent::Flown(_) => remark(self.global, &format!("flown in {seconds:.1} s")),
            StudyEvent::Evaluated { results, remaining } => {
                remark(self.global, &format!("trained and evaluated in {seconds:.1} s"));
                if *remaining > 0 {
                    self.report(results);
                }
            }
        }
    }

    /// Writes the report of the results so far, and shows their main figures.
    fn report(&self, results: &Results) {
        let path = self.folder.report();
        let note = match servotwin_report::write(self.folder, self.study) {
            Ok(()) => format!("{}: {}", path.display(), summary::brief(results, self.study)),
            // A lasting error also fails the final report, which then ends the command.
            Err(error) => format!("no report yet: {error}"),
        };
        remark(self.global, &note);
    }
}
