//! Cells about detection and isolation, from records, the evaluation and flights.

use super::cell::{Filled, FmeaCell, rate_in_words, span_in_words};
use super::effects::{NO_RESULTS, OwnFlights, flight_evidence, flown, intensities};
use super::fields::{FmeaSources, FmeaSubject, not_in_study};
use super::residuals::{MovedResidual, ResidualRuns};
use servotwin::job::results::SubjectResult;
use servotwin::learn::protocol::{Confused, Protocol};
use servotwin::measure::FALSE_ALARM;
use servotwin::measure::flights::{KindLatency, STRONG};
use servotwin::measure::outcome::{FirstAction, RunOutcome};
use servotwin::shown::shown;
use servotwin::text::{first_of, number};
use servotwin_diagnosis::hierarchy::{HEALTHY, Question};
use servotwin_learning::metrics::{MedianTime, Rate};
use servotwin_model::program::FaultAt;

/// The most sensors that a cell names.
const MAX_SENSORS: usize = 5;

fn runs<'s>(sources: &'s FmeaSources, subject: &FmeaSubject) -> Result<&'s ResidualRuns, FmeaCell> {
    match (&sources.runs, subject.case) {
        (_, None) => Err(not_in_study("not in the records")),
        (None, _) => Err(FmeaCell::missing("not simulated", NO_RESULTS)),
        (Some(runs), _) if runs.of(&subject.fault.id).is_empty() => Err(FmeaCell::missing(
            "not simulated",
            format!("{}: no completed run of this fault", runs.file),
        )),
        (Some(runs), _) => Ok(runs),
    }
}

/// The evaluation of the quoted scenario, with its place in the file.
fn evaluated<'s>(
    sources: &'s FmeaSources,
    subject: &FmeaSubject,
) -> Result<(&'s SubjectResult, String), FmeaCell> {
    if subject.case.is_none() {
        return Err(not_in_study("not evaluated"));
    }
    let missing = || {
        FmeaCell::missing("not evaluated", "no evaluation.json: 'servotwin study FOLDER' writes it")
    };
    let results = sources.results.ok_or_else(|| FmeaCell::missing("not evaluated", NO_RESULTS))?;
    let result = results.evaluated().ok_or_else(missing)?;
    Ok((result, format!("evaluation.json {}", result.subject.name())))
}

pub(super) fn local_effect(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let runs = runs(sources, subject)?;
    let strong = runs.strong(&subject.fault.id);
    let (first, count) = (strong.first().map_or(0, |run| run.row), strong.len());
    let bands = match runs.are_learned {
        true => "bands of evaluation.json",
        false => "band of 3 %",
    };
    let evidence = format!(
        "{}: {count} runs with intensity {STRONG} and more, first in row {first}; {bands}",
        runs.file
    );
    let moved = runs.moved(&subject.fault.id);
    if moved.is_empty() {
        let text = "no residual leaves its band in half of the strong runs";
        return Ok(FmeaCell::new(text, evidence));
    }
    let words = |moved: &MovedResidual| {
        format!(
            "{} ({} % of scale, {} of {count})",
            moved.sensor,
            number(100.0 * moved.median, 3),
            moved.beyond
        )
    };
    let named: Vec<String> = moved.iter().map(words).collect();
    let text = format!("residuals leave their bands: {}", first_of(&named, MAX_SENSORS));
    Ok(FmeaCell::new(text, evidence))
}

pub(super) fn means(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let (mut parts, mut evidence) = (vec![], vec![]);
    let (runs, own) = (runs(sources, subject), flown(sources, subject));
    if let Ok(runs) = &runs {
        parts.push(match runs.moved(&subject.fault.id).first() {
            Some(first) => format!("twin residual of {} beyond its band", first.sensor),
            None => "no residual in half of the strong runs".into(),
        });
        evidence.push(runs.file.clone());
    }
    let judged = sources.results.and_then(|results| results.flown());
    if let Some(flights) = judged.and(sources.study.flights.as_ref()) {
        let windows: Vec<String> = flights.windows_s.iter().map(|s| format!("{s} s")).collect();
        parts.push(format!(
            "trees and committee on windows of {}, evidence accumulated until the alarm",
            windows.join(" and ")
        ));
        evidence.push("study.toml flights.windows_s".into());
    }
    if let Ok(own) = &own {
        parts.push(reported_in_words(own));
        evidence.push(flight_evidence(own.0, &own.1));
    }
    let is_own = |test: &&RunOutcome| test.event == subject.fault.id && test.is_finished;
    let tests: Vec<&RunOutcome> = sources.tests.iter().filter(is_own).collect();
    if !tests.is_empty() {
        let counted = counted_in_words(&tests, "tests on the ground");
        parts.push(counted);
        evidence.push("ground_test/outcomes-judge-fitted.parquet".into());
    }
    match (runs, own) {
        (Err(not_run), Err(_)) if tests.is_empty() => Err(not_run),
        _ => Ok(FmeaCell::new(parts.join("; "), evidence.join("; "))),
    }
}

/// The intensities at which the own flights reported the fault.
fn reported_in_words((_, own): &OwnFlights) -> String {
    counted_in_words(own, "own flights")
}

/// How many of some flights reported their fault, and at which intensities.
fn counted_in_words(all: &[&RunOutcome], of: &str) -> String {
    let reported: Vec<&RunOutcome> =
        all.iter().copied().filter(|flown| flown.reports_fault()).collect();
    let (count, all) = (reported.len(), all.len());
    match count {
        0 => format!("reported in 0 of {all} {of}"),
        _ => format!("reported in {count} of {all} {of} (intensity {})", intensities(&reported)),
    }
}

pub(super) fn latency(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let (mut parts, mut evidence) = (vec![], vec![]);
    let own = flown(sources, subject);
    if let Ok((flights, own)) = &own {
        let count = own.len();
        let event = |name: &str, of: fn(&RunOutcome) -> Option<f64>| {
            let times = || own.iter().filter_map(|flown| of(flown));
            let happened = times().count();
            match span_in_words(times(), "s") {
                Some(span) => format!("{name} after {span} in {happened} of {count} own flights"),
                None => format!("{name} in 0 of {count} own flights"),
            }
        };
        parts.push(event("reported", |flown| flown.first_word_s.filter(|_| flown.reports_fault())));
        parts.push(event("action", |flown| flown.first_action_s));
        evidence.push(flight_evidence(flights, own));
    }
    match kind_latencies(sources, subject) {
        Some((judged, place)) => {
            parts.extend(judged.into_iter().map(latency_in_words));
            evidence.push(place);
        }
        None => {
            evidence.push("no judged latencies: 'servotwin study FOLDER --suite flights'".into())
        }
    }
    match own {
        Err(not_flown) if parts.is_empty() => Err(not_flown),
        _ => Ok(FmeaCell::new(parts.join("; "), evidence.join("; "))),
    }
}

/// The latencies of the fault's kind in the judged flights: all intensities, then the strong ones.
fn kind_latencies<'s>(
    sources: &'s FmeaSources,
    subject: &FmeaSubject,
) -> Option<(Vec<&'s KindLatency>, String)> {
    let metrics = sources.results?.flown()?;
    let own: Vec<_> = metrics.kinds.iter().filter(|own| own.kind == subject.kind).collect();
    let place = format!(
        "flights.json, {}: kinds {} (medians with order-statistic intervals, 95 %; a flight without the event \
         counts as the longest)",
        metrics.title(),
        subject.kind
    );
    (!own.is_empty()).then_some((own, place))
}

fn latency_in_words(own: &KindLatency) -> String {
    let flights = match own.least_intensity > 0.0 {
        true => format!("intensity {} and more", own.least_intensity),
        false => "all intensities".into(),
    };
    let [visible, action] = [&own.detection, &own.isolation].map(median_in_words);
    format!("judged flights, {flights}: visible {visible}, right action {action}")
}

/// A median with its interval and its counts.
fn median_in_words(median: &MedianTime) -> String {
    let time = |time_s: Option<f64>| match time_s {
        Some(time_s) => format!("{} s", number(time_s, 3)),
        None => "the flight's end".into(),
    };
    let [middle, low, high] = [median.median_s, median.low_s, median.high_s].map(time);
    format!("after {middle} ({low} … {high}) in {} of {}", median.events, median.of)
}

pub(super) fn smallest(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let own = flown(sources, subject)
        .map(|own| FmeaCell::new(reported_in_words(&own), flight_evidence(own.0, &own.1)));
    match (smallest_in_bands(sources, subject), own) {
        (Ok(bands), Ok(own)) => Ok(FmeaCell::new(
            format!("{}; {}", bands.text, own.text),
            format!("{}; {}", bands.evidence, own.evidence),
        )),
        (Err(missing), own) => own.or(Err(missing)),
        (known, Err(_)) => known,
    }
}

/// The least intensity from which on a residual of the records leaves its band.
fn smallest_in_bands(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let (result, place) = evaluated(sources, subject)?;
    let least = result.evaluation.detection.least.iter().enumerate();
    let own: Vec<_> = least.filter(|(_, least)| least.fault == subject.fault.id).collect();
    let Some((first, _)) = own.first() else {
        return Err(FmeaCell::missing(
            "not evaluated",
            format!("{place} detection.least: no entry of this fault"),
        ));
    };
    let figure = sources.results.and_then(|results| {
        results.figure(&format!("least_intensity_{}.svg", result.subject.name()))
    });
    let evidence = format!(
        "{place} detection.least entries {} … {}{}",
        first + 1,
        first + own.len(),
        figure.map_or(String::new(), |figure| format!(", {figure}"))
    );
    let found: Vec<f64> = own.iter().filter_map(|(_, least)| least.intensity).collect();
    let (visible, of) = (found.len(), own.len());
    let unseen = |count: usize| {
        format!("not visible in bands at the largest intensity in {count} of {of} cases")
    };
    let Some(largest) = found.iter().copied().reduce(f64::max) else {
        return Ok(FmeaCell::new(unseen(of), evidence));
    };
    let tested = sources.study.faults.iter().filter(|case| case.id == subject.fault.id);
    let least = tested.map(|case| case.at.intensity).fold(f64::INFINITY, f64::min);
    // Nothing weaker was tested, so the true limit may be anywhere below.
    let bound = |intensity: f64| if intensity <= least + 1e-9 { "≤ " } else { "" };
    let below = bound(found.iter().copied().fold(largest, f64::min));
    let span = span_in_words(found.into_iter(), "").unwrap_or_default();
    let missed = match of - visible {
        0 => String::new(),
        missed => format!("; {}", unseen(missed)),
    };
    let text = format!(
        "visible in bands from intensity {below}{} on in {visible} of {of} cases ({} at {}{largest}){missed}",
        span.trim(),
        physical(sources, subject, largest),
        bound(largest)
    );
    Ok(FmeaCell::new(text, evidence))
}

/// The parameter of a fault at an intensity, with its name and unit.
fn physical(sources: &FmeaSources, subject: &FmeaSubject, intensity: f64) -> String {
    let fault = subject.fault;
    let Some(case) = subject.case else { return String::new() };
    let program = &sources.study.system.program;
    let spec = sources.study.system.network().components[case.at.component].component;
    let values = program.parameters(&[FaultAt { intensity, ..case.at }]);
    let value = spec.parameter(fault.parameter).map(|place| values[case.at.component][place]);
    format!(
        "{} = {}",
        fault.parameter,
        value.map_or_else(String::new, |value| shown(value, fault.unit))
    )
}

/// How often a fault gets its right action, in flights that were judged or else in its own closed-loop flights.
struct RightActions {
    /// Of all flights with the fault, at all intensities.
    of_all: Rate,
    /// Of the flights in which it is visible; the own flights do not count these.
    of_visible: Option<Rate>,
    /// Flights without a fault in which any action was raised.
    false_alarms: Rate,
    /// Which flights, in words.
    flights: &'static str,
    evidence: String,
}

impl RightActions {
    /// The counts, or the cell with the reason why there are none.
    fn of(sources: &FmeaSources, subject: &FmeaSubject) -> Result<Self, FmeaCell> {
        if let Some((own, evidence)) = kind_latencies(sources, subject)
            && let Some(all) = own.first()
            && let Some(metrics) = sources.results.and_then(|results| results.flown())
        {
            let (right, visible) = (all.isolation.events, all.detection.events);
            return Ok(RightActions {
                of_all: Rate::new(right, all.isolation.of),
                of_visible: Some(Rate::new(right, visible)),
                false_alarms: metrics.rates.of(&FALSE_ALARM),
                flights: "judged flights with this kind of fault",
                evidence,
            });
        }
        let (flights, own) = flown(sources, subject)?;
        if subject.case.is_none() {
            return Err(not_in_study("no right action to compare with"));
        }
        let right = own.iter().filter(|flown| flown.first == FirstAction::Right).count() as u64;
        let [alarmed, healthy] = FALSE_ALARM.count(flights.healthy().into_iter());
        Ok(RightActions {
            of_all: Rate::new(right, own.len() as u64),
            of_visible: None,
            false_alarms: Rate::new(alarmed, healthy),
            flights: "own flights",
            evidence: flight_evidence(flights, &own),
        })
    }

    /// The share of faults with the right action above the share of false alarms: of the faults that no false alarm
    /// would have answered, those that are answered.
    fn coverage(&self) -> f64 {
        let by_chance = self.false_alarms.share.unwrap_or(0.0);
        let above = self.of_all.share.unwrap_or(0.0) - by_chance;
        if above > 0.0 { above / (1.0 - by_chance) } else { 0.0 }
    }
}

pub(super) fn isolation(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let right = RightActions::of(sources, subject)?;
    let (rate, which) = match &right.of_visible {
        Some(rate) => (rate, "in which it is visible"),
        None => (&right.of_all, "at all flown intensities"),
    };
    let text = format!(
        "right action for the right actuator first: {}, {} {which}",
        rate_in_words(rate),
        right.flights
    );
    Ok(FmeaCell::new(text, right.evidence))
}

pub(super) fn confused_with(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let (result, place) = evaluated(sources, subject)?;
    let protocol = result.evaluation.protocol(Protocol::UnseenIntensity);
    let all = protocol.iter().flat_map(|protocol| &protocol.confused).enumerate();
    let own: Vec<_> = all.filter(|(_, confused)| confused.kind == subject.kind).collect();
    let in_words = |(_, confused): &(usize, &Confused)| {
        let share =
            format!("{:.1} % of its tests", 100.0 * confused.count as f64 / confused.of as f64);
        match confused.question {
            _ if confused.taken_for == HEALTHY => format!("no fault at all ({share})"),
            Question::Actuator => format!("{} ({share})", confused.taken_for),
            Question::Action => format!("{} ({share}, wrong action)", confused.taken_for),
            Question::Detail => format!("{} ({share}, wrong fault class)", confused.taken_for),
        }
    };
    let mut parts: Vec<String> = own.iter().map(in_words).collect();
    let rows: Vec<String> = own.iter().map(|(row, _)| (row + 1).to_string()).collect();
    let list = "protocols, unseen_intensity, confused";
    let mut evidence = match rows.is_empty() {
        true => format!("{place} {list}: none of this kind"),
        false => format!("{place} {list}: entries {}", rows.join(", ")),
    };
    if let Some(metrics) = sources.results.and_then(|results| results.flown())
        && let Some((_, count)) = metrics.wrong_kinds.iter().find(|(kind, _)| *kind == subject.kind)
    {
        parts.push(format!("shuts a healthy actuator down in {count} judged flights"));
        evidence += &format!("; flights.json, {}: wrong_kinds", metrics.title());
    }
    let text = if parts.is_empty() { "none counted".into() } else { parts.join("; ") };
    Ok(FmeaCell::new(text, evidence))
}

pub(super) fn coverage(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let right = RightActions::of(sources, subject)?;
    let text = format!(
        "{:.1} % above false alarms: right action in {}, {}; an action without a fault in {}",
        100.0 * right.coverage(),
        rate_in_words(&right.of_all),
        right.flights,
        rate_in_words(&right.false_alarms)
    );
    Ok(FmeaCell::new(text, right.evidence))
}

/// The diagnostic coverage of a fault as a number.
pub(crate) fn coverage_share(sources: &FmeaSources, subject: &FmeaSubject) -> Option<f64> {
    RightActions::of(sources, subject).ok().map(|right| right.coverage())
}
