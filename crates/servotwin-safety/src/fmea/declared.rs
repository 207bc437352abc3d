//! Cells from declarations: the system, the catalogue, the study and the user's table of rates.

use super::cell::{Filled, FmeaCell};
use super::effects::{answers, flight_evidence, flown};
use super::fields::{FmeaSources, FmeaSubject, not_in_study};
use crate::rates::{FailureRate, FailureRates};
use servotwin::shown::shown;
use servotwin::study::{Reaction, Study};
use servotwin::text::{rounded, spoken};

pub(super) fn actuator(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let study = sources.study;
    let name = match study.actuator_of(&subject.fault.id).map(|own| study.actuators[own].as_str()) {
        Some("") => "the only one".into(),
        Some(actuator) => spoken(actuator),
        None => "shared".into(),
    };
    Ok(FmeaCell::new(name, "study.toml actuators"))
}

pub(super) fn component(_: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let fault = subject.fault;
    Ok(FmeaCell::new(
        format!("{} ({})", fault.component, spoken(fault.kind)),
        format!("system.toml components.{}", fault.component),
    ))
}

pub(super) fn fault_mode(_: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let fault = subject.fault;
    let name = fault.id.rsplit('.').next().unwrap_or_default();
    Ok(FmeaCell::new(
        format!("{}: {} ({})", spoken(name), fault.summary, fault.category),
        format!("catalog {}, fault {name}", fault.kind),
    ))
}

pub(super) fn range(_: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let fault = subject.fault;
    Ok(FmeaCell::new(
        format!(
            "{}: {} … {} at intensity 1",
            fault.parameter,
            shown(fault.healthy, fault.unit),
            shown(fault.full, fault.unit)
        ),
        format!(
            "system.toml components.{}, catalog {} {}",
            fault.component, fault.kind, fault.parameter
        ),
    ))
}

pub(super) fn action(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    let Some(case) = subject.case else {
        let flown = flown(sources, subject);
        let (flights, own) = flown.map_err(|_| not_in_study("none: not in the study"))?;
        let text = format!("no class of the study names one: {}", answers(&own));
        return Ok(FmeaCell::new(text, flight_evidence(flights, &own)));
    };
    let study = sources.study;
    let class = &study.classes[case.class];
    let reaction = study.reactions.of(case.actuator, &class.action, Some(&class.detail));
    Ok(FmeaCell::new(
        format!("{}: {}", spoken(&class.action), reaction_in_words(study, &reaction)),
        format!("study.toml classes {}, reactions", class.detail),
    ))
}

/// What a reaction does.
fn reaction_in_words(study: &Study, reaction: &Reaction) -> String {
    let network = study.system.network();
    let mut parts = vec![];
    if reaction.switches_off {
        parts.push("switches the actuator off".to_owned());
    }
    for &(input, value) in &reaction.inputs {
        let input = &network.inputs[input];
        parts.push(format!("{} = {}", input.id, shown(value, input.unit)));
    }
    for &(component, parameter, value) in &reaction.parameters {
        let instance = &network.components[component];
        let unit = instance.component.parameters[parameter].unit;
        parts.push(format!("{} = {}", instance.parameter_name(parameter), shown(value, unit)));
    }
    let ignored = reaction.takes_out.iter().map(|&sensor| study.sensors.0[sensor].name.as_str());
    let ignored = ignored.collect::<Vec<_>>();
    if !ignored.is_empty() {
        parts.push(format!("ignores {}", ignored.join(", ")));
    }
    match parts.is_empty() {
        true => "no reaction of the system".into(),
        false => parts.join("; "),
    }
}

/// A cell about the user's rate of a fault. Without a rate it stays empty: a rate is never invented.
fn of_rate(
    sources: &FmeaSources,
    subject: &FmeaSubject,
    text: fn(&FailureRate) -> String,
) -> FmeaCell {
    let of = |rates: &FailureRates| {
        let rate = rates.of(&subject.fault.id, subject.kind)?;
        Some(FmeaCell::new(text(rate), rates.place(rate)))
    };
    sources.rates.as_ref().and_then(of).unwrap_or_default()
}

pub(super) fn failure_rate(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    // No rate is known to more than six digits; the unit's division has more.
    Ok(of_rate(sources, subject, |rate| format!("{:e}", rounded(rate.per_h, 6))))
}

pub(super) fn failure_rate_source(sources: &FmeaSources, subject: &FmeaSubject) -> Filled {
    Ok(of_rate(sources, subject, |rate| rate.source.clone()))
}

pub(super) fn remarks(_: &FmeaSources, _: &FmeaSubject) -> Filled {
    Ok(FmeaCell::default())
}
