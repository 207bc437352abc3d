//! Suites of flights in words: what was flown, and what became of it.

use super::StudyOptions;
use super::progress::with_crew;
use crate::Global;
use crate::failure::Failure;
use servotwin::flight::unseen_faults::UnseenFaultRates;
use servotwin::job::flights::FlightResults;
use servotwin::job::outcomes::{self, FlownSuite};
use servotwin::job::sealed::OpeningRecord;
use servotwin::job::{Folder, Job, manifest};
use servotwin::measure::flights::FlightMetrics;
use servotwin::measure::unseen::{
    EARLY_ALARM, NEVER_SHUT_DOWN, NO_RESPONSE, OTHER_RESPONSE, RIGHT_RESPONSE,
};
use servotwin::study::suites::{FLIGHTS, RECORDS};
use servotwin::study::{Scenario, Study};
use servotwin_report::lines;
use servotwin_report::vocabulary::Vocabulary;
use servotwin_report::words::{fitted_twins, healthy_flights, share_of};
use servotwin_view::document::{Document, Verdict};

/// Judges the stored diagnosers in sealed environments.
pub(super) fn sealed(
    options: &StudyOptions,
    study: &Study,
    scenarios: &[Scenario],
    global: Global,
) -> Result<Document, Failure> {
    let folder = options.folder();
    let _hold = options.keep(study, global)?;
    let here = std::env::current_dir().unwrap_or_default();
    let record = OpeningRecord::find(&here, folder.path());
    let sealed = with_crew(options.threads, global, |crew| {
        Job { crew: *crew, ..Job::new(study, &folder) }.fly_sealed(scenarios, &record)
    })?;
    manifest::write(&folder, study)?;
    let mut document = described(&folder, &sealed.results, study, &[])?;
    document.verdict = Some(Verdict::neutral(sealed.in_words(None)));
    document.text(format!("Recorded in {}.", record.path().display()));
    document.data("opening", &sealed.opening);
    document.data("openings", &sealed.openings);
    Ok(document)
}

/// Describes the results of the named suites for readers, or without a name of those that are always flown; the report has the
/// details.
pub(super) fn described(
    folder: &Folder,
    results: &FlightResults,
    study: &Study,
    names: &[String],
) -> Result<Document, Failure> {
    let is_named = |name: &&String| *name != FLIGHTS && *name != RECORDS;
    let suites: Vec<&String> = names.iter().filter(is_named).collect();
    let words = Vocabulary::of(study);
    let is_shown = |metrics: &&FlightMetrics| match suites.is_empty() {
        true => metrics.group.missing.is_empty(),
        false => suites.contains(&&metrics.group.suite),
    };
    let shown: Vec<&FlightMetrics> = results.suites.iter().filter(is_shown).collect();
    let run = words.run();
    let flown: u64 = shown.iter().map(|metrics| metrics.flights).sum();
    let named = |flown: &&FlownSuite| suites.contains(&&flown.suite);
    let all_healthy = outcomes::healthy(folder)?;
    let healthy_runs: Vec<&FlownSuite> = all_healthy.iter().filter(named).collect();
    let verdict = match healthy_runs.first().filter(|_| shown.is_empty()) {
        Some(own) => format!("{}: {}", own.title(), healthy_flights(own).1[0]),
        None => format!("{flown} {run}s with a fault are judged, whether a sensor shows it or not"),
    };
    let mut document = Document::new("flights", Verdict::neutral(verdict));
    shown.iter().for_each(|metrics| summary(&mut document, metrics, &words));
    if suites.is_empty() {
        let lines = results.left_out.iter();
        let lines = lines.filter_map(|(scenario, own)| own.without_steady_state(scenario));
        lines.for_each(|line| _ = document.note(line));
    }
    for metrics in results.unseen.iter().filter(|metrics| suites.contains(&&metrics.suite)) {
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
        document.text(format!("  {}", fitted_twins(calibration)));
    }
}

/// Describes the healthy flights of a suite in a scenario.
fn healthy(document: &mut Document, flown: &FlownSuite) {
    let (title, lines) = healthy_flights(flown);
    let mut section = Document::section("", title);
    lines.into_iter().for_each(|line| _ = section.text(line));
    document.add(section);
}

/// Describes the flights of a challenge set in a line.
fn challenge_line(set: &UnseenFaultRates, words: &Vocabulary) -> String {
    let UnseenFaultRates { title, flights, failed, rates, wrong, .. } = set;
    let [right, other, none] =
        [RIGHT_RESPONSE, OTHER_RESPONSE, NO_RESPONSE].map(|measure| set.count(&measure));
    let missed = rates.of(&NEVER_SHUT_DOWN);
    let wrong = match words.has_several() {
        true => format!(", shutdowns of a healthy {} {}", words.actuator(), wrong.len()),
        false => String::new(),
    };
    let latency = set.latency.as_ref().map_or(String::new(), |latency| {
        format!("; right action after median {:.2} s, p95 {:.2} s", latency.median_s, latency.p95_s)
    });
    format!(
        "challenge {title}: of {flights} flights ({failed} failed) {right} right action first, {other} other action first, \
         {none} no action; missed shutdowns {} of {}{wrong}, false alarms before the onset {}{latency}",
        missed.count,
        missed.of,
        set.count(&EARLY_ALARM),
    )
}
