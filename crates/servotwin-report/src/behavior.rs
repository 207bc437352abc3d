//! The parts of a system and its behavior at rest, as a document.

use servotwin::rest::Rest;
use servotwin::system::System;
use servotwin_view::document::{Document, Form, Table, Value};
use servotwin_view::row;
use std::f64::consts::TAU;

/// Describes a system: its components, states, inputs and sensors, and its eigenvalues at rest.
pub fn document(system: &System, rest: &Rest) -> Document {
    let verdict = format!("{}: {}", system.name, system.title);
    let mut document = Document::listing("describe", verdict);
    document.fact("name", "", system.name.as_str());
    document.fact("title", "", system.title.as_str());
    document.fact("rest_is_found", "", rest.is_found);
    document.fact("limit_cycle_measured", "", rest.limit_cycle);
    components(system, &mut document);
    states(system, rest, &mut document);
    let mut inputs = Table::of("id:input | default | unit:");
    for input in &system.network().inputs {
        let default = Value::mixed(input.default, input.unit);
        inputs.push(row![input.id.as_str(), default, input.unit.symbol()]);
    }
    document.table("inputs", inputs.captioned("Inputs"));
    let mut sensors = Table::of("id:sensor | label: | signal | unit: | scale");
    for sensor in &system.sensors {
        let scale = Value::difference(sensor.scale, sensor.unit, 5);
        let (id, label, signal) = (&sensor.id, &sensor.label, &sensor.signal);
        sensors.push(row![id, label, signal, sensor.unit.symbol(), scale]);
    }
    document.table("sensors", sensors.captioned("Sensors"));
    eigenvalues(rest, &mut document);
    document
}

fn components(system: &System, document: &mut Document) {
    let mut section = Document::section("components", "Components").formed(Form::Listing);
    for instance in &system.network().components {
        let spec = instance.component;
        let title = format!("{} ({}): {}", instance.id, spec.kind, spec.summary);
        let mut own = Document::section(instance.id.clone(), title);
        let mut table = Table::of("name:parameter | unit: | value");
        for (declared, &value) in spec.parameters.iter().zip(&instance.parameters) {
            table.push(row![
                declared.name,
                declared.unit.symbol(),
                Value::mixed(value, declared.unit)
            ]);
        }
        own.fact("kind", "", spec.kind);
        own.fact("summary", "", spec.summary);
        own.fact("faults", "", Value::list(spec.faults.iter().map(|fault| fault.name)));
        own.table("parameters", table);
        section.add(own);
    }
    document.add(section);
}

/// The accuracy of a state at rest, as a share of its scale.
const KNOWN: f64 = 1e-12;

fn states(system: &System, rest: &Rest, document: &mut Document) {
    let mut table = Table::of("name:state | unit: | rest | scale");
    for (state, &value) in system.program.states().iter().zip(&rest.states) {
        // A smaller value is only noise of the search for rest.
        let shown = if value.abs() < KNOWN * state.scale { 0.0 } else { value };
        table.push(row![
            state.name.as_str(),
            state.unit.symbol(),
            Value::number(value, Value::mixed(shown, state.unit).text),
            Value::difference(state.scale, state.unit, 5),
        ]);
    }
    document.table("states", table.captioned("States at rest"));
}

/// The eigenvalues. People see one of each conjugate pair, and no oscillation from rounding noise.
fn eigenvalues(rest: &Rest, document: &mut Document) {
    let pairs: Vec<[f64; 2]> = rest.eigenvalues.iter().map(|value| [value.re, value.im]).collect();
    document.data("eigenvalues_per_s", &pairs);
    let mut table = Table::of(":real 1/s | :imaginary rad/s | :frequency Hz | :damping ratio");
    for value in rest.eigenvalues.iter().filter(|value| value.im >= 0.0) {
        let swings = value.im > 1e-9 * value.norm();
        let only = |number: f64, digits| swings.then(|| Value::digits(number, digits));
        table.push(row![
            Value::digits(value.re, 5),
            only(value.im, 5),
            only(value.norm() / TAU, 4),
            only(-value.re / value.norm(), 3),
        ]);
    }
    document.table("", table.captioned("Eigenvalues at rest"));
}
