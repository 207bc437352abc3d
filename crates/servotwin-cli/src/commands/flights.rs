//! Suites of flights: trains the diagnosis in operation, flies suites with it, and describes what became of them.

use super::progress::Stages;
use super::study::Options;
use super::{StudyOptions, workers};
use crate::failure::Failure;
use crate::{Global, stop};
use servotwin::flight::unseen_faults::UnseenFaultOutcome;
use servotwin::job::flights::{self, Crew, FlightResults, scenarios};
use servotwin::job::outcomes::{self, FlownSuite};
use servotwin::job::sealed::OpeningRecord;
use servotwin::job::tasks::{self, Place, Task};
use servotwin::job::{Folder, JobError, manifest};
use servotwin::measure::flights::FlightMetrics;
use servotwin::run::fitted_twins::CalibrationRecords;
use servotwin::study::suites::{FLIGHTS, RECORDS};
use servotwin::study::{Purpose, Scenario, Study, Suite};
use servotwin_report::lines;
use servotwin_report::vocabulary::Vocabulary;
use servotwin_report::words::{by_environment_and_tail, share_of};
use servotwin_view::document::{Document, Table, Verdict, line};
use servotwin_view::row;
use std::collections::BTreeMap;

/// Flies the suites of the options.
pub(super) fn run(options: &Options, global: Global) -> Result<Document, Failure> {
    let study = options.study.read(global)?;
    let scenarios = chosen_scenarios(&study, options.scenario.as_deref())?;
    match options.sealed {
        true => sealed(&options.study, &study, &scenarios, global),
        false => {
            check(&study)?;
            let suites = chosen_suites(options, &study)?;
            let is_learning = suites.iter().any(|suite| suite.purpose == Purpose::Train);
            match options.share {
                None if !is_learning => {
                    flown(&options.study, &study, (&suites, &scenarios), global)
                }
                _ => {
                    let is_wanted = |scenario| scenarios.contains(&scenario);
                    in_parts(options, (&study, &suites), is_wanted, global)
                }
            }
        }
    }
}

/// The scenarios in which a study flies, or the named one of them.
fn chosen_scenarios(study: &Study, named: Option<&str>) -> Result<Vec<Scenario>, Failure> {
    let all = scenarios(study);
    let Some(name) = named.filter(|_| study.flights.is_some()) else { return Ok(all) };
    match all.iter().find(|scenario| scenario.name() == name) {
        Some(&scenario) => Ok(vec![scenario]),
        None => {
            let known: Vec<&str> = all.iter().map(|scenario| scenario.name()).collect();
            let range = format!("this study flies in {}", known.join(" and "));
            Err(Failure::out_of_range("--scenario", name, range))
        }
    }
}

/// The named suites; none for [`FLIGHTS`].
fn chosen_suites(options: &Options, study: &Study) -> Result<Vec<Suite>, Failure> {
    if options.suite.iter().all(|name| name == FLIGHTS) {
        return Ok(vec![]);
    }
    let suite = |name: &String| {
        let all = || study.suites().filter(|s| s.purpose != Purpose::Tune);
        let unknown = || {
            let known: Vec<&str> = all().map(|suite| suite.name.as_str()).collect();
            let range = format!(
                "{RECORDS}, {FLIGHTS}, or the suites of the study, {}; the first two stand alone",
                known.join(", ")
            );
            Failure::out_of_range("--suite", name, range)
        };
        let mut suite = all().find(|suite| suite.name == *name).ok_or_else(unknown)?.clone();
        suite.seed = options.seed.unwrap_or(suite.seed);
        Ok(match options.environments {
            Some(count) => suite.with_environments(count as usize),
            None => suite,
        })
    };
    options.suite.iter().map(suite).collect()
}

/// Computes the parts of some suites, or a share of them, without joining them.
pub(super) fn in_parts(
    options: &Options,
    (study, changed): (&Study, &[Suite]),
    is_wanted: impl Fn(Scenario) -> bool,
    global: Global,
) -> Result<Document, Failure> {
    stop::heed();
    let folder = options.study.folder();
    let _hold = folder.join_study(study)?;
    let place = Place { study, changed, folder: &folder };
    let all = tasks::tasks(place, &options.suite, is_wanted)?;
    let is_own = |&(number, _): &(usize, &Task)| options.share.is_none_or(|own| own.holds(number));
    let own: Vec<Task> =
        all.iter().enumerate().filter(is_own).map(|(_, task)| task.clone()).collect();
    with_crew(options.study.threads, global, |crew| tasks::run(place, &own, crew))?;
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
    let values =
        [("folder", folder.path().into()), ("parts", own.len().into()), ("all", all.len().into())];
    let verdict = line(
        "{folder}: {parts} of {all} parts belong to this share and are complete. When all parts are, the same command \
         without --share joins them; 'servotwin study --suite flights' trains with those of learn and hard_negatives.",
        values,
    );
    let mut document = Document::new("share", Verdict::good(verdict));
    document.table("suites", table);
    Ok(document)
}

/// Flies some suites with the diagnosers in the folder of the options; without any, learns first, and flies every suite
/// that is not on request.
pub(super) fn flown(
    options: &StudyOptions,
    study: &Study,
    (suites, scenarios): (&[Suite], &[Scenario]),
    global: Global,
) -> Result<Document, Failure> {
    check(study)?;
    stop::heed();
    let folder = options.folder();
    let _hold = options.keep(study, global)?;
    let results = with_crew(options.threads, global, |crew| match suites {
        [] => flights::fly_all(&folder, study, scenarios, crew),
        suites => {
            let suites: Vec<&Suite> = suites.iter().collect();
            flights::fly(&folder, study, &suites, scenarios, (crew, &|share| share))
        }
    })?;
    manifest::write(&folder, study)?;
    let names: Vec<String> = suites.iter().map(|suite| suite.name.clone()).collect();
    described(&folder, &results, study, &names)
}

/// Refuses a study without flights.
fn check(study: &Study) -> Result<(), Failure> {
    if study.flights.is_none() { Err(JobError::NoFlights.into()) } else { Ok(()) }
}

/// Judges the stored diagnosers in sealed environments.
fn sealed(
    options: &StudyOptions,
    study: &Study,
    scenarios: &[Scenario],
    global: Global,
) -> Result<Document, Failure> {
    check(study)?;
    stop::heed();
    let folder = options.folder();
    let _hold = options.keep(study, global)?;
    let here = std::env::current_dir().unwrap_or_default();
    let record = OpeningRecord::find(&here, folder.path());
    let sealed = with_crew(options.threads, global, |crew| {
        flights::fly_sealed(&folder, study, scenarios, &record, crew)
    })?;
    manifest::write(&folder, study)?;
    let mut document = described(&folder, &sealed.results, study, &[])?;
    document.verdict = Some(Verdict::neutral(sealed.in_words(None)));
    document.text(format!("Recorded in {}.", record.path().display()));
    document.data("opening", &sealed.opening);
    document.data("openings", &sealed.openings);
    Ok(document)
}

/// Runs work with threads and its progress on a terminal. Ctrl-C stops it.
pub(crate) fn with_crew<T, E>(
    threads: Option<usize>,
    global: Global,
    work: impl FnOnce(&Crew) -> Result<T, E>,
) -> Result<T, Failure>
where
    Failure: From<E>,
{
    let stages = Stages::in_lines(global);
    let crew =
        Crew { workers: workers(threads), progress: &|what, share| stages.show(what, share) };
    let done = work(&crew);
    stages.end();
    stop::check()?;
    Ok(done?)
}

/// Describes the results of the named suites for readers, or of those that are always flown; the report has the details.
fn described(
    folder: &Folder,
    results: &FlightResults,
    study: &Study,
    suites: &[String],
) -> Result<Document, Failure> {
    let words = Vocabulary::of(study);
    let is_shown = |metrics: &&FlightMetrics| match suites.is_empty() {
        true => metrics.group.missing.is_empty(),
        false => suites.contains(&metrics.group.suite),
    };
    let shown: Vec<&FlightMetrics> = results.suites.iter().filter(is_shown).collect();
    let run = words.run();
    let flown: u64 = shown.iter().map(|metrics| metrics.flights).sum();
    let named = |flown: &&FlownSuite| suites.contains(&flown.suite);
    let all_healthy = outcomes::healthy(folder)?;
    let healthy_runs: Vec<&FlownSuite> = all_healthy.iter().filter(named).collect();
    let verdict = match healthy_runs.first().filter(|_| shown.is_empty()) {
        Some(own) => format!("{}: {}", own.title(), by_environment_and_tail(&own.healthy())[0]),
        None => format!("{flown} {run}s with a fault are judged, whether a sensor shows it or not"),
    };
    let mut document = Document::new("flights", Verdict::neutral(verdict));
    shown.iter().for_each(|metrics| summary(&mut document, metrics, &words));
    if suites.is_empty() {
        let lines = results.left_out.iter();
        let lines = lines.filter_map(|(scenario, own)| own.without_steady_state(scenario));
        lines.for_each(|line| _ = document.note(line));
    }
    for metrics in results.unseen.iter().filter(|metrics| suites.contains(&metrics.suite)) {
        let mut section = Document::section("", metrics.scenario.as_str());
        for set in &metrics.sets {
            section.text(challenge_line(set, &words));
        }
        document.add(section);
    }
    healthy_runs.into_iter().for_each(|own| healthy(&mut document, own));
    if let Some(ranges) = lines::flown_ranges(study) {
        document.text(format!("flown: {ranges}"));
    }
    document.text(
        "Every flight is a row of the files outcomes-*.parquet; 'servotwin report' shows more.",
    );
    document.data("results", results);
    Ok(document)
}

/// What the flights of a suite in a scenario show, over all faults and intensities.
fn summary(document: &mut Document, metrics: &FlightMetrics, words: &Vocabulary) {
    let FlightMetrics { flights, failed, .. } = metrics;
    let (title, run) = (metrics.title(), words.run());
    document.text(format!("{title}: {flights} {run}s with a fault, {failed} not finished"));
    let rates = lines::in_flight(metrics, words).into_iter();
    let rates = rates.map(|(title, rate)| format!("{title} {}", share_of(rate).text));
    document.text(format!("  {}", rates.collect::<Vec<_>>().join("; ")));
    document.text(format!("  false alarms {}", lines::alarms_in_words(&metrics.healthy)));
    if let Some(calibration) = &metrics.calibration {
        document.text(fitted_plants(calibration));
    }
}

/// Describes the healthy flights of a suite in a scenario.
fn healthy(document: &mut Document, flown: &FlownSuite) {
    let (count, failed, healthy) = (flown.outcomes.len(), flown.failed(), flown.healthy());
    let title = format!(
        "{}: {count} healthy flights of {} s, each in an environment of its own (seed {}), {failed} not finished; {:.1} h",
        flown.title(),
        flown.longest_s(),
        flown.seed,
        healthy.hours
    );
    let mut section = Document::section("", title);
    by_environment_and_tail(&healthy).into_iter().for_each(|line| _ = section.text(line));
    document.add(section);
}

/// Describes the flights beside twins that are fitted to plants of another structure.
fn fitted_plants(calibration: &CalibrationRecords) -> String {
    let CalibrationRecords { flown, rejected, with_findings } = calibration;
    format!(
        "  of {flown} twins {rejected} stayed nominal, because their records were rejected; {with_findings} fits left a \
         deviation"
    )
}

/// Describes the flights of a challenge set in a line.
fn challenge_line(set: &UnseenFaultOutcome, words: &Vocabulary) -> String {
    let UnseenFaultOutcome { title, flights, right_action, other_action, .. } = set;
    let [need, missed] = set.missed_shutdowns;
    let wrong = match words.has_several() {
        true => format!(", shutdowns of a healthy {} {}", words.unit(), set.wrong_shutdowns()),
        false => String::new(),
    };
    let latency = set.latency.as_ref().map_or(String::new(), |latency| {
        format!("; right action after median {:.2} s, p95 {:.2} s", latency.median_s, latency.p95_s)
    });
    format!(
        "challenge {title}: of {flights} flights ({} failed) {right_action} right action first, {other_action} other action \
         first, {} no action; missed shutdowns {missed} of {need}{wrong}, false alarms before the onset {}{latency}",
        set.failed,
        set.without_action(),
        set.false_alarms,
    )
}
