//! Fault trees in the Open-PSA Model Exchange Format 2.0, which SCRAM, XFTA and other programs read.
//!
//! Only what a top event needs is written: other gates would look like further top events.
//!
//! Source: Epstein and Rauzy, Open-PSA Model Exchange Format 2.0d, 2008.

use super::lanes::{LaneTrees, TreeParameter};
use super::numbers::{BandEnd, ExposureHours};
use super::structure::{BasicEvent, EventLaw, GateKind, TreeGate, TreeInput};
use servotwin::text::escaped;
use std::fmt::Write;

/// The document of the trees with the numbers at one end of their intervals.
pub fn document(name: &str, trees: &LaneTrees, hours: &ExposureHours, end: BandEnd) -> String {
    let tops = trees.tree.tops.iter().map(|top| TreeInput::Gate(top.gate));
    let [gates, events] = trees.tree.below(tops);
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<opsa-mef>\n");
    let _ = writeln!(out, "  <define-fault-tree name=\"{}\">", super::lanes::identifier(name));
    // Top events first, as readers expect.
    let is_top = |gate: usize| trees.tree.tops.iter().any(|top| top.gate == gate);
    let (tops, others): (Vec<usize>, Vec<usize>) =
        gates.into_iter().partition(|&gate| is_top(gate));
    for gate in tops.into_iter().chain(others.into_iter().rev()) {
        write_gate(&mut out, trees, &trees.tree.gates[gate]);
    }
    out += "  </define-fault-tree>\n  <model-data>\n";
    let laws: Vec<EventLaw> = events.iter().map(|&event| trees.tree.events[event].law).collect();
    let is_read = |of: fn(EventLaw) -> Option<usize>, place: usize| {
        laws.iter().any(|&law| of(law) == Some(place))
    };
    let rate = |law| if let EventLaw::Exponential(place, _) = law { Some(place) } else { None };
    let constant = |law| if let EventLaw::Constant(place) = law { Some(place) } else { None };
    for (place, parameter) in trees.rates.iter().enumerate() {
        if is_read(rate, place) {
            write_parameter(&mut out, parameter, " unit=\"hours-1\"", end);
        }
    }
    for (place, parameter) in trees.constants.iter().enumerate() {
        if is_read(constant, place) {
            write_parameter(&mut out, parameter, "", end);
        }
    }
    for event in events {
        write_event(&mut out, trees, &trees.tree.events[event], hours);
    }
    out + "  </model-data>\n</opsa-mef>\n"
}

fn write_parameter(out: &mut String, parameter: &TreeParameter, unit: &str, end: BandEnd) {
    let _ = writeln!(out, "    <define-parameter name=\"{}\"{unit}>", parameter.id);
    let _ = writeln!(out, "      <label>{}</label>", escaped(&parameter.evidence));
    let _ = writeln!(out, "      <float value=\"{:e}\"/>", end.of(parameter.value));
    *out += "    </define-parameter>\n";
}

fn write_gate(out: &mut String, trees: &LaneTrees, gate: &TreeGate) {
    let _ = writeln!(out, "    <define-gate name=\"{}\">", gate.id);
    let _ = writeln!(out, "      <label>{}</label>", escaped(&gate.title));
    let kind = match (gate.kind, gate.inputs.len()) {
        // A formula of one argument has no connective.
        (_, 1) => None,
        (GateKind::And, _) => Some("and"),
        (GateKind::Or, _) => Some("or"),
    };
    let _ = kind.map(|kind| writeln!(out, "      <{kind}>"));
    for input in &gate.inputs {
        let _ = match *input {
            TreeInput::Gate(gate) => {
                writeln!(out, "        <gate name=\"{}\"/>", trees.tree.gates[gate].id)
            }
            TreeInput::Event(event) => {
                writeln!(out, "        <basic-event name=\"{}\"/>", trees.tree.events[event].id)
            }
        };
    }
    let _ = kind.map(|kind| writeln!(out, "      </{kind}>"));
    *out += "    </define-gate>\n";
}

fn write_event(out: &mut String, trees: &LaneTrees, event: &BasicEvent, hours: &ExposureHours) {
    let _ = writeln!(out, "    <define-basic-event name=\"{}\">", event.id);
    let _ = writeln!(out, "      <label>{}</label>", escaped(&event.title));
    let _ = match event.law {
        EventLaw::Constant(place) => {
            writeln!(out, "      <parameter name=\"{}\"/>", trees.constants[place].id)
        }
        EventLaw::Exponential(place, exposure) => {
            let hours = hours.of(exposure);
            writeln!(
                out,
                "      <exponential><parameter name=\"{}\"/><float value=\"{hours:e}\"/></exponential>",
                trees.rates[place].id
            )
        }
    };
    *out += "    </define-basic-event>\n";
}
