//! Effects on the actuator and on the system, and the severity, from closed-loop flights.

use super::can_fly;
use super::cell::{Filled, FmeaCell, span_in_words};
use super::fields::{FmeaSources, FmeaSubject, not_in_study};
use super::flights::FmeaFlights;
use super::severity::{SeverityInputs, level};
use servotwin::live::tracking::{TrackedQuantities, command_unit};
use servotwin::measure::outcome::RunOutcome;
use servotwin::study::{FaultCase, Study};
use servotwin::text::{number, spoken};
use servotwin_model::spec::Unit;

/// All flights, and those of a fault.
pub(super) type OwnFlights<'s> = (&'s FmeaFlights, Vec<&'s RunOutcome>);

/// The remedy where a folder with results is missing.
pub(super) const NO_RESULTS: &str =
    "no results: 'servotwin study STUDY --out FOLDER', then 'servotwin fmea FOLDER'";

/// The flights of a fault, or the cell with the reason why there are none.
pub(super) fn flown<'s>(
    sources: &'s FmeaSources,
    subject: &FmeaSubject,
) -> Result<OwnFlights<'s>, FmeaCell> {
    if let Some(Err(nothing_flies)) = sources.results.map(|results| results.flown_setting()) {
        return Err(FmeaCell::missing("not flown in this scenario", nothing_flies.to_string()));
    }
    let Some(flights) = &sources.flights else {
        let remedy = match sources.results {
            None => NO_RESULTS,
            Some(results) if can_fly(results) => {
                "no flights of this scenario: 'servotwin fmea FOLDER'"
            }
            Some(_) => "no diagnoser of this scenario: 'servotwin study FOLDER --suite flights'",
        };
        return Err(FmeaCell::missing("not flown", remedy));
    };
    let own = flights.of(&subject.fault.id);
    match own.is_empty() {
        true if subject.case.is_none() => Err(not_in_study("not flown")),
        true => Err(FmeaCell::missing(
            "not flown",
            format!("{}: no completed flight of this fault", flights.file()),
        )),
        false => Ok((flights, own)),
    }
}

/// Where the flights of a fault stand.
pub(super) fn flight_evidence(flights: &FmeaFlights, own: &[&RunOutcome]) -> String {
    let numbers: Vec<String> = own.iter().map(|flown| flown.number.to_string()).collect();
    let stale = flights.stale.as_ref().map(|why| format!("; STALE: {why} since they were flown"));
    format!(
        "{} runs {} (case {}, scenario {}){}",
        flights.file(),
        numbers.join(", "),
        flights.case,
        flights.scenario,
        stale.unwrap_or_default()
    )
}

/// The first action of every own flight, in words.
pub(super) fn answers(own: &[&RunOutcome]) -> String {
    let answer = |flown: &&RunOutcome| match flown.first_action.as_str() {
        "" => format!("no action at {}", flown.intensity),
        action => {
            let named = format!("{action} {}", flown.first_actuator);
            format!("first action {} at {}", named.trim(), flown.intensity)
        }
    };
    own.iter().map(answer).collect::<Vec<_>>().join(", ")
}

/// The words for the quantity that follows the command: what its error is called, and its unit.
fn error_words(study: &Study) -> (String, Unit) {
    let unit = command_unit(study);
    let tracked = TrackedQuantities::of(study);
    let name = tracked.following.map(|place| tracked.names[place].as_str()).unwrap_or_default();
    let component = spoken(name.rsplit_once('.').map_or(name, |(component, _)| component));
    let words = match (unit, is_aircraft(study)) {
        (Unit::Radian, true) => format!("surface error ({component})"),
        (Unit::Radian, false) => format!("angle error ({component})"),
        _ => format!("position error ({component})"),
    };
    (words, unit)
}

/// Whether the system is part of an aircraft: something in it flies.
fn is_aircraft(study: &Study) -> bool {
    let mut kinds = study.system.network().components.iter().map(|c| c.component.kind);
    kinds.any(|kind| kind == "aerodynamic_load")
}

/// The least differences from the healthy flight that are an effect. Below them are the errors of the solver, whose steps
/// begin anew at the onset: at most 6e-10 m and 5e-3 N in the flights of the aileron, whose smallest effects are 6e-7 m and
/// 6 N.
const MIN_TRAVEL_M: f64 = 1e-8;
const MIN_FORCE_N: f64 = 0.1;

pub(super) fn on_actuator(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let (flights, own) = flown(sources, subject)?;
    let evidence = flight_evidence(flights, &own);
    let flown = |of: fn(&RunOutcome) -> Option<f64>| own.iter().filter_map(move |flown| of(flown));
    if flown(|flown| flown.travel_difference_m).count() == 0 {
        let reason = match sources.study.actuator_of(&subject.fault.id) {
            None => "not measured: the component belongs to no single actuator",
            Some(_) => "not measured: the actuator has no piston",
        };
        return Err(FmeaCell::missing(reason, evidence));
    }
    let span = |of, (unit, factor), least: f64| {
        span_in_words(
            flown(of).filter(|effect| *effect >= least).map(|effect| effect * factor),
            unit,
        )
    };
    let travel = span(|flown| flown.travel_difference_m, ("mm", 1e3), MIN_TRAVEL_M);
    let force = span(|flown| flown.force_difference_n, ("kN", 1e-3), MIN_FORCE_N);
    let parts = [
        travel.map(|span| format!("piston by up to {span}")),
        force.map(|span| format!("rod force by up to {span}")),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    let intensities = intensities(&own);
    let text = match parts.is_empty() {
        true => format!("does not differ from the healthy flight (intensities {intensities})"),
        false => format!(
            "differs from the healthy flight: {} (intensities {intensities})",
            parts.join(", ")
        ),
    };
    Ok(FmeaCell::new(text, evidence))
}

/// The intensities of some flights.
pub(super) fn intensities(own: &[&RunOutcome]) -> String {
    own.iter().map(|flown| flown.intensity.to_string()).collect::<Vec<_>>().join(", ")
}

pub(super) fn on_system(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let (flights, own) = flown(sources, subject)?;
    let study = sources.study;
    let place = if is_aircraft(study) { "aircraft" } else { "machine" };
    let mut parts = vec![];
    let (words, unit) = error_words(study);
    let span = |own: &[&RunOutcome], of: fn(&RunOutcome) -> Option<f64>| {
        let values =
            own.iter().filter_map(|flown| of(flown)).map(|si| unit.difference_to_shown(si));
        span_in_words(values, unit.shown())
    };
    let shown = |of| span(&own, of);
    if let (Some(alone), Some(with)) =
        (shown(|flown| flown.error_rms), shown(|flown| flown.reacting_error_rms))
    {
        let healthy = flights.healthy().and_then(|flown| span(&[flown], |flown| flown.error_rms));
        let healthy = healthy.unwrap_or_default();
        parts.push(format!(
            "rms {words} {alone} without the diagnosis, {with} with it, {healthy} healthy"
        ));
    }
    if let Some(largest) = shown(|flown| flown.error_max) {
        parts.push(format!("largest without it {largest}"));
    }
    let fight = |of: fn(&RunOutcome) -> Option<f64>| {
        span_in_words(own.iter().filter_map(|flown| of(flown)).map(|n| n / 1e3), "kN")
    };
    if let (Some(alone), Some(with)) =
        (fight(|flown| flown.force_fight_rms_n), fight(|flown| flown.reacting_force_fight_rms_n))
    {
        parts.push(format!("rms force fight {alone} without it, {with} with it"));
    }
    parts.push(lanes_in_words(study, &own));
    let text = format!("{place}: {}", parts.join("; "));
    Ok(FmeaCell::new(text, flight_evidence(flights, &own)))
}

/// The names of the lanes that were switched off.
fn lanes_off(flown: &RunOutcome) -> Vec<&str> {
    flown.switched_off.split(',').filter(|name| !name.is_empty()).collect()
}

/// Which lanes the diagnosis switched off.
fn lanes_in_words(study: &Study, own: &[&RunOutcome]) -> String {
    let lanes = study.actuators.len();
    let each = own.iter().map(|flown| match lanes_off(flown) {
        off if off.is_empty() => format!("no lane lost at {}", flown.intensity),
        off => {
            let names = off.join(" ");
            format!("{} of {lanes} lanes off at {} ({names})", off.len(), flown.intensity)
        }
    });
    each.collect::<Vec<_>>().join(", ")
}

pub(super) fn severity(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let lanes = sources.study.actuators.len();
    let Ok((flights, own)) = flown(sources, subject) else {
        let case = subject.case.ok_or_else(|| not_in_study("not assessed"))?;
        return Ok(by_action_alone(sources.study, case));
    };
    let growth = growth(flights, &own);
    let inputs = SeverityInputs {
        growth,
        lanes_off: own.iter().map(|flown| lanes_off(flown).len()).max().unwrap_or(0),
        lanes,
        changes_mode: own.iter().any(|flown| flown.changes_mode),
    };
    let measured = match growth {
        Some(growth) => format!("g = {}", number(growth, 3)),
        None => "g is not measured".into(),
    };
    let (level, clause) = level(inputs);
    let evidence =
        format!("rule of docs/safety.md, {measured}; {}", flight_evidence(flights, &own));
    Ok(FmeaCell::new(format!("{level}: {clause}"), evidence))
}

/// What the level would be if the study's action were raised.
fn by_action_alone(study: &Study, case: &FaultCase) -> FmeaCell {
    let class = &study.classes[case.class];
    let reaction = study.reactions.of(case.actuator, &class.action, Some(&class.detail));
    let (level, clause) = level(SeverityInputs {
        growth: None,
        lanes_off: usize::from(reaction.switches_off),
        lanes: study.actuators.len(),
        changes_mode: reaction.changes_mode(),
    });
    FmeaCell::new(
        format!("at least {level} if the action is raised (not flown): {clause}"),
        "rule of docs/safety.md, from the action alone",
    )
}

/// The growth of the tracking error at the largest flown intensity, as a part of the command.
fn growth(flights: &FmeaFlights, own: &[&RunOutcome]) -> Option<f64> {
    let strongest = own.iter().max_by(|a, b| a.intensity.total_cmp(&b.intensity))?;
    let growth = (strongest.error_rms? - flights.healthy()?.error_rms?) / strongest.command_rms?;
    growth.is_finite().then_some(growth)
}
