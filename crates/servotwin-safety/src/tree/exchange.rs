//! Fault trees in the Open-PSA Model Exchange Format 2.0, which SCRAM, XFTA and other programs read.
//!
//! Only what a top event needs is written: other gates would look like further top events.
//!
//! Source: Epstein and Rauzy, Open-PSA Model Exchange Format 2.0d, 2008.

use super::lanes::LaneTrees;
use super::numbers::{BandEnd, ExposureHours};
use super::structure::{BasicEvent, EventLaw, GateKind, TreeGate, TreeInput};
use servotwin::text::escaped;
use std::fmt::Write;

/// The document of the trees with the numbers at one end of their intervals.
pub fn document(name: &str, trees: &LaneTrees, hours: &ExposureHours, end: BandEnd) -> String {
    let needed = Needed::of(trees);
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<opsa-mef>\n");
    let _ = writeln!(out, "  <define-fault-tree name=\"{}\">", super::lanes::identifier(name));
    // Top events first, as readers expect.
    let is_top = |gate: usize| trees.tree.tops.iter().any(|top| top.gate == gate);
    let (tops, others): (Vec<usize>, Vec<usize>) =
        needed.gates.iter().copied().partition(|&gate| is_top(gate));
    for gate in tops.into_iter().chain(others.into_iter().rev()) {
        write_gate(&mut out, trees, &trees.tree.gates[gate]);
    }
    out += "  </define-fault-tree>\n  <model-data>\n";
    for (parameter, value) in needed.parameters(trees) {
        let unit = if parameter.is_rate { " unit=\"hours-1\"" } else { "" };
        let _ = writeln!(out, "    <define-parameter name=\"{}\"{unit}>", parameter.id);
        let _ = writeln!(out, "      <label>{}</label>", escaped(parameter.evidence));
        let _ = writeln!(out, "      <float value=\"{:e}\"/>", end.of(value));
        out += "    </define-parameter>\n";
    }
    for &event in &needed.events {
        write_event(&mut out, trees, &trees.tree.events[event], hours);
    }
    out + "  </model-data>\n</opsa-mef>\n"
}

/// The gates and events below the top events, ascending.
struct Needed {
    gates: Vec<usize>,
    events: Vec<usize>,
}

/// A parameter of the document.
struct MefParameter<'t> {
    id: &'t str,
    evidence: &'t str,
    is_rate: bool,
}

impl Needed {
    fn of(trees: &LaneTrees) -> Self {
        let tree = &trees.tree;
        let (mut gates, mut events) =
            (vec![false; tree.gates.len()], vec![false; tree.events.len()]);
        let mut open: Vec<usize> = tree.tops.iter().map(|top| top.gate).collect();
        while let Some(gate) = open.pop() {
            if std::mem::replace(&mut gates[gate], true) {
                continue;
            }
            for input in &tree.gates[gate].inputs {
                match *input {
                    TreeInput::Gate(below) => open.push(below),
                    TreeInput::Event(event) => events[event] = true,
                }
            }
        }
        let places = |list: Vec<bool>| (0..list.len()).filter(|&at| list[at]).collect::<Vec<_>>();
        Needed { gates: places(gates), events: places(events) }
    }

    fn parameters<'t>(
        &self,
        trees: &'t LaneTrees,
    ) -> Vec<(MefParameter<'t>, crate::interval::CountedValue)> {
        let laws: Vec<EventLaw> =
            self.events.iter().map(|&event| trees.tree.events[event].law).collect();
        let is_read = |is_rate: bool, place: usize| {
            laws.iter().any(|law| match *law {
                EventLaw::Exponential(own, _) => is_rate && own == place,
                EventLaw::Constant(own) => !is_rate && own == place,
            })
        };
        let lists = [(true, &trees.rates), (false, &trees.constants)];
        let all = lists.into_iter().flat_map(|(is_rate, list)| {
            list.iter().enumerate().map(move |(place, parameter)| (is_rate, place, parameter))
        });
        let read = all.filter(|(is_rate, place, _)| is_read(*is_rate, *place));
        let parameter =
            |(is_rate, _, parameter): (bool, usize, &'t super::lanes::TreeParameter)| {
                let (id, evidence) = (parameter.id.as_str(), parameter.evidence.as_str());
                (MefParameter { id, evidence, is_rate }, parameter.value)
            };
        read.map(parameter).collect()
    }
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
