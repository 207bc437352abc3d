//! Effects on the actuator and on the system, and the severity, from closed-loop flights.

use super::can_fly;
use super::cell::{FmeaCell, span_in_words};
use super::fields::{FmeaSources, FmeaSubject, actuator_of, not_in_study};
use super::flights::{FILE, FlownFault, FmeaFlights};
use super::severity::{SeverityInputs, level};
use servotwin::flight::tracking::{TrackedQuantities, command_unit};
use servotwin::study::{FaultCase, Study};
use servotwin::text::spoken;
use servotwin_model::spec::Unit;

/// All flights, and those of a fault with their rows in the file.
pub(super) type OwnFlights<'s> = (&'s FmeaFlights, Vec<(usize, &'s FlownFault)>);

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
            Some(_) => "no diagnoser of this scenario: 'servotwin flights FOLDER --out FOLDER'",
        };
        return Err(FmeaCell::missing("not flown", remedy));
    };
    let own = flights.of(&subject.fault.id);
    match own.is_empty() {
        true if subject.case.is_none() => Err(not_in_study("not flown")),
        true => Err(FmeaCell::missing(
            "not flown",
            format!("{FILE}: no completed flight of this fault"),
        )),
        false => Ok((flights, own)),
    }
}

/// Where the flights of a fault stand.
pub(super) fn flight_evidence(flights: &FmeaFlights, own: &[(usize, &FlownFault)]) -> String {
    let rows: Vec<String> = own.iter().map(|(row, _)| row.to_string()).collect();
    let stale = flights.stale.as_ref().map(|why| format!("; STALE: {why} since they were flown"));
    format!(
        "safety/{FILE} rows {} (case {}, scenario {}){}",
        rows.join(", "),
        flights.case,
        flights.scenario,
        stale.unwrap_or_default()
    )
}

/// The first action of every own flight, in words.
pub(super) fn answers(own: &[(usize, &FlownFault)]) -> String {
    let answer = |(_, flown): &(usize, &FlownFault)| match flown.action.as_str() {
        "" => format!("no action at {}", flown.intensity),
        action => format!("first action {action} at {}", flown.intensity),
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
    let mut kinds = study.system.network().components.iter().map(|c| c.component.spec().kind);
    kinds.any(|kind| kind == "aerodynamic_load")
}

/// The least differences from the healthy flight that are an effect. Below them are the errors of the solver, whose steps
/// begin anew at the onset: at most 6e-10 m and 5e-3 N in the flights of the aileron, whose smallest effects are 6e-7 m and
/// 6 N.
const MIN_TRAVEL_M: f64 = 1e-8;
const MIN_FORCE_N: f64 = 0.1;

pub(super) fn on_actuator(sources: &FmeaSources, subject: &FmeaSubject) -> FmeaCell {
    let (flights, own) = match flown(sources, subject) {
        Ok(found) => found,
        Err(cell) => return cell,
    };
    let evidence = flight_evidence(flights, &own);
    let flown = |of: fn(&FlownFault) -> f64| own.iter().map(move |(_, flown)| of(flown));
    if flown(|flown| flown.travel_difference_m).all(f64::is_nan) {
        let reason = match actuator_of(sources.study, &subject.fault.id) {
            None => "not measured: the component belongs to no single actuator",
            Some(_) => "not measured: the actuator has no piston",
        };
        return FmeaCell::missing(reason, evidence);
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
    FmeaCell::new(text, evidence)
}

fn intensities(own: &[(usize, &FlownFault)]) -> String {
    own.iter().map(|(_, flown)| flown.intensity.to_string()).collect::<Vec<_>>().join(", ")
}

pub(super) fn on_system(sources: &FmeaSources, subject: &FmeaSubject) -> FmeaCell {
    let (flights, own) = match flown(sources, subject) {
        Ok(found) => found,
        Err(cell) => return cell,
    };
    let study = sources.study;
    let place = if is_aircraft(study) { "aircraft" } else { "machine" };
    let mut parts = vec![];
    let (words, unit) = error_words(study);
    let shown = |of: fn(&FlownFault) -> f64| {
        let values = own.iter().map(|(_, flown)| unit.difference_to_shown(of(flown)));
        span_in_words(values, unit.shown())
    };
    let healthy = flights.healthy().map(|flown| unit.difference_to_shown(flown.error_alone[0]));
    if let (Some(alone), Some(with)) =
        (shown(|flown| flown.error_alone[0]), shown(|flown| flown.error_reacting[0]))
    {
        let healthy = span_in_words(healthy.into_iter(), unit.shown()).unwrap_or_default();
        parts.push(format!(
            "rms {words} {alone} without the diagnosis, {with} with it, {healthy} healthy"
        ));
    }
    if let Some(largest) = shown(|flown| flown.error_alone[1]) {
        parts.push(format!("largest without it {largest}"));
    }
    let fight = |place: usize| {
        span_in_words(own.iter().map(|(_, flown)| flown.force_fight_n[place] / 1e3), "kN")
    };
    if let (Some(alone), Some(with)) = (fight(0), fight(1)) {
        parts.push(format!("rms force fight {alone} without it, {with} with it"));
    }
    parts.push(lanes_in_words(study, &own));
    FmeaCell::new(format!("{place}: {}", parts.join("; ")), flight_evidence(flights, &own))
}

/// Which lanes the diagnosis switched off.
fn lanes_in_words(study: &Study, own: &[(usize, &FlownFault)]) -> String {
    let lanes = study.units.len();
    let each = own.iter().map(|(_, flown)| {
        let off = flown.lane_count();
        match off {
            0 => format!("no lane lost at {}", flown.intensity),
            off => {
                format!("{off} of {lanes} lanes off at {} ({})", flown.intensity, flown.lanes_off)
            }
        }
    });
    each.collect::<Vec<_>>().join(", ")
}

pub(super) fn severity(sources: &FmeaSources, subject: &FmeaSubject) -> FmeaCell {
    let lanes = sources.study.units.len();
    let Ok((flights, own)) = flown(sources, subject) else {
        return subject.case.map_or_else(
            || not_in_study("not assessed"),
            |case| by_action_alone(sources.study, case),
        );
    };
    let growth = growth(flights, &own);
    let each = || own.iter().map(|(_, flown)| flown);
    let inputs = SeverityInputs {
        growth,
        lanes_off: each().map(|own| own.lane_count()).max().unwrap_or(0),
        lanes,
        changes_mode: each().any(|own| own.changes_mode),
    };
    let measured = match growth {
        Some(growth) => format!("g = {}", servotwin::shown::number(growth, 3)),
        None => "g is not measured".into(),
    };
    let (level, clause) = level(inputs);
    FmeaCell::new(
        format!("{level}: {clause}"),
        format!("rule of docs/safety.md, {measured}; {}", flight_evidence(flights, &own)),
    )
}

/// What the level would be if the study's action were raised.
fn by_action_alone(study: &Study, case: &FaultCase) -> FmeaCell {
    let class = &study.classes[case.class];
    let reaction = study.reactions.of(case.unit, &class.command, Some(&class.detail));
    let (level, clause) = level(SeverityInputs {
        growth: None,
        lanes_off: usize::from(reaction.switches_off),
        lanes: study.units.len(),
        changes_mode: reaction.changes_mode(),
    });
    FmeaCell::new(
        format!("at least {level} if the action is raised (not flown): {clause}"),
        "rule of docs/safety.md, from the action alone",
    )
}

/// The growth of the tracking error at the largest flown intensity, as a part of the command.
fn growth(flights: &FmeaFlights, own: &[(usize, &FlownFault)]) -> Option<f64> {
    let strongest = own.iter().max_by(|a, b| a.1.intensity.total_cmp(&b.1.intensity))?.1;
    let growth =
        (strongest.error_alone[0] - flights.healthy()?.error_alone[0]) / strongest.command_rms;
    growth.is_finite().then_some(growth)
}
