//! What viewers receive besides samples: what is shown, and the state of its diagnosis.

use crate::injection::Injection;
use serde::Serialize;
use serde_json::{Value, json};
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::{Diagnoser, Raised, Session};
use servotwin_report::schematic;
use servotwin_watch::player::PlayerSignal;

/// Where the samples come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum SourceKind {
    /// A simulated flight, which takes faults.
    Flight,
    /// A stream that is watched.
    Stream,
}

/// Everything that a viewer must know to show frames, and to inject faults into a flight.
pub(crate) fn about(
    kind: SourceKind,
    title: &str,
    study: &Study,
    diagnoser: &Diagnoser,
    list: &[PlayerSignal],
) -> Value {
    let system = &study.system;
    let faults = if kind == SourceKind::Flight { system.fault_list() } else { vec![] };
    let components = system.network().components.iter().map(|instance| {
        let own = faults.iter().filter(|fault| fault.component == instance.id);
        let own = own.map(|fault| {
            json!({ "id": fault.id, "summary": fault.summary, "answer": answer(study, &fault.id) })
        });
        let spec = instance.component;
        json!({
            "id": instance.id, "kind": spec.kind, "summary": spec.summary,
            "faults": own.collect::<Vec<_>>(),
        })
    });
    json!({
        "kind": kind,
        "title": title,
        "period_s": diagnoser.period_s,
        "actuators": diagnoser.names().actuators,
        "signals": list,
        "components": components.collect::<Vec<_>>(),
        "schematic": schematic::of(system).draw().svg,
        "effects": effects(kind, study, diagnoser),
        "version": env!("CARGO_PKG_VERSION"),
    })
}

/// The action that a fault calls for, and its cause; null for a fault that the study does not have.
fn answer(study: &Study, fault: &str) -> Value {
    let known = study.faults.iter().find(|known| known.id == fault);
    known.map_or(Value::Null, |known| {
        let class = &study.classes[known.class];
        json!({ "action": class.action, "detail": class.detail })
    })
}

/// What each action does to a simulated flight, in words. What is measured is not acted on from here.
fn effects(kind: SourceKind, study: &Study, diagnoser: &Diagnoser) -> Value {
    let names = diagnoser.names();
    if kind != SourceKind::Flight {
        return Value::Null;
    }
    let details = || names.details.iter().map(|detail| Some(detail.as_str())).chain([None]);
    let effect = |action: &String| {
        let mut reactions = details().map(|detail| study.reactions.of(0, action, detail));
        let words = match reactions.find(|reaction| *reaction != Default::default()) {
            Some(reaction) if reaction.switches_off => {
                "The actuator is off and damped until a new flight begins."
            }
            Some(_) => "The actuator goes on with other settings or sensors.",
            None => "Nothing changes in this flight.",
        };
        (action.clone(), json!(words))
    };
    Value::Object(names.actions.iter().map(effect).collect())
}

/// An action of the diagnosis in names.
pub(crate) fn named(diagnoser: &Diagnoser, raised: &Raised) -> Value {
    let names = diagnoser.names();
    json!({
        "actuator": names.actuators[raised.actuator as usize],
        "action": names.actions[raised.action as usize],
        "detail": raised.detail.map(|detail| &names.details[detail as usize]),
    })
}

/// The state of a flight as viewers get it, with all actions so far and the faults that were injected by hand.
pub(crate) fn state(
    session: &Session,
    actions: &[Value],
    injections: &[Injection],
    is_paused: bool,
) -> Value {
    let (outcome, diagnoser) = (session.outcome(), session.diagnoser());
    let injected = injections.iter().map(|Injection { name, fault, onset, since_s }| {
        let intensity = fault.intensity;
        json!({ "fault": name, "intensity": intensity, "onset": onset, "since_s": since_s })
    });
    json!({
        "alarm": outcome.alarm,
        "finding": diagnoser.describe(outcome.finding),
        "worst_sensor": outcome.worst_sensor.map(|s| &diagnoser.sensors[s as usize].name),
        "injected": injected.collect::<Vec<_>>(),
        "actions": actions,
        "is_paused": is_paused,
    })
}
