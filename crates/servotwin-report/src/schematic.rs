//! A system as a schematic: its sources at the left, then valves, cylinders and sensors, the load at the right.
//!
//! Components and connections come from the system file. A component's column is its distance from the sources of oil.

use crate::words::distinct;
use servotwin::system::System;
use servotwin_model::component::Component;
use servotwin_model::network::{Network, PortOf};
use servotwin_model::spec::PortKind;
use servotwin_view::SemanticColor;
use servotwin_view::schematic::{Net, NetEnd, Part, Schematic};
use std::collections::BTreeMap;

/// The kinds of connections, in the order of their colors. The order is the same in every drawing.
const MEDIA: [&str; 4] = ["hydraulic", "translational", "signal", "rotational"];
const SIGNAL: usize = 2;

/// Components that oil comes from. A tank is not one: it stands beside what drains into it.
const SOURCES: [&str; 3] = ["pressure_source", "flow_source", "variable_pump"];

/// The maximum number of an actuator's parts in a column. A fuller column is split into several.
const IN_A_COLUMN: usize = 7;

/// Makes the schematic of a system.
pub fn of(system: &System) -> Schematic {
    let network = system.network();
    let ids = network.components.iter().map(|instance| &instance.id);
    let ids: Vec<&String> = ids.chain(network.inputs.iter().map(|input| &input.id)).collect();
    let groups = groups(&ids);
    let nets = nets(network);
    let columns = columns(network, &nets);
    let part = |(place, id): (usize, &&String)| {
        let (group, name) = id.rsplit_once('.').unwrap_or(("", id));
        let spec = network.components.get(place).map(|instance| instance.component);
        let kind = spec.map_or("input", |spec| spec.kind);
        Part {
            id: if spec.is_some() { (*id).clone() } else { format!("input {id}") },
            text: if name == kind { name.into() } else { format!("{name}\n{kind}") },
            kind: spec.and_then(|spec| spec.ports.first()).map_or(SIGNAL, |port| medium(port.kind)),
            group: groups.iter().position(|known| *known == group).unwrap_or_default(),
            column: columns[place],
        }
    };
    let kind =
        |(place, name): (usize, &&str)| ((*name).to_owned(), SemanticColor::Medium(place).look());
    let mut schematic = Schematic {
        title: system.title.clone(),
        groups: groups.iter().map(|group| (*group).to_owned()).collect(),
        kinds: MEDIA.iter().enumerate().map(kind).collect(),
        parts: ids.iter().enumerate().map(part).collect(),
        nets,
    };
    split_columns(&mut schematic);
    schematic
}

fn medium(kind: PortKind) -> usize {
    MEDIA.iter().position(|name| *name == kind.family()).unwrap_or_default()
}

/// Lists the actuators, with the shared part in the middle.
fn groups<'s>(ids: &[&'s String]) -> Vec<&'s str> {
    let mut groups = distinct(ids.iter().filter_map(|id| Some(id.rsplit_once('.')?.0)));
    groups.insert(groups.len() / 2, "");
    groups
}

/// The connections, then what inputs drive. A net begins with the port that sets its potential or signal.
fn nets(network: &Network) -> Vec<Net> {
    let end = |port: &PortOf| {
        let spec = network.components[port.component].component.ports[port.port];
        let arrow = matches!(spec.kind, PortKind::SignalIn { .. });
        (spec.kind, NetEnd { part: port.component, port: spec.name.into(), arrow })
    };
    let connections = network.connections.iter().map(|ports| {
        let mut ends: Vec<(PortKind, NetEnd)> = ports.iter().map(end).collect();
        ends.sort_by_key(|(kind, _)| !kind.sets());
        let kind = ends.first().map_or(SIGNAL, |(kind, _)| medium(*kind));
        Net { kind, ends: ends.into_iter().map(|(_, end)| end).collect() }
    });
    let inputs = network.inputs.iter().enumerate().map(|(place, input)| {
        let from =
            NetEnd { part: network.components.len() + place, port: String::new(), arrow: false };
        let targets = input.targets.iter().map(|target| end(target).1);
        Net { kind: SIGNAL, ends: [from].into_iter().chain(targets).collect() }
    });
    let mut nets: Vec<Net> = vec![];
    for net in connections.chain(inputs) {
        // A signal that is connected twice is one line.
        match nets.iter_mut().find(|known| known.ends.first() == net.ends.first()) {
            Some(known) => known.ends.extend(net.ends.into_iter().skip(1)),
            None => nets.push(net),
        }
    }
    nets
}

/// The column of each component and input: its distance from the sources through oil and motion, with the mechanical
/// parts right of all valves. What only signals reach stands right of its nearest neighbor. Tanks and inputs stand
/// left of theirs.
fn columns(network: &Network, nets: &[Net]) -> Vec<usize> {
    let specs: Vec<&Component> = network.components.iter().map(|one| one.component).collect();
    let is_left = |part: usize| specs.get(part).is_none_or(|spec| spec.kind == "tank");
    let joined = |with_signals: bool| -> Vec<Vec<usize>> {
        let nets = nets.iter().filter(|net| with_signals || net.kind != SIGNAL);
        let parts =
            nets.map(|net| net.ends.iter().map(|end| end.part).filter(|part| !is_left(*part)));
        parts.map(Iterator::collect).collect()
    };
    let mut columns = vec![None; specs.len() + network.inputs.len()];
    for (column, spec) in columns.iter_mut().zip(&specs) {
        *column = SOURCES.contains(&spec.kind).then_some(1);
    }
    spread(&mut columns, &joined(false));
    shift_mechanics(&specs, &mut columns);
    spread(&mut columns, &joined(true));
    // What no source reaches starts from its first component.
    for part in (0..specs.len()).filter(|part| !is_left(*part)) {
        columns[part].get_or_insert(1);
        spread(&mut columns, &joined(true));
    }
    for part in (0..columns.len()).filter(|part| is_left(*part)) {
        let own = nets.iter().filter(|net| net.ends.iter().any(|end| end.part == part));
        let others = own.flat_map(|net| &net.ends).filter(|end| !is_left(end.part));
        let nearest = others.filter_map(|end| columns[end.part]).min();
        columns[part] = Some(nearest.unwrap_or(2) - 1);
    }
    columns.into_iter().map(Option::unwrap_or_default).collect()
}

/// Puts the parts that nets reach one column right of those that reach them.
fn spread(columns: &mut [Option<usize>], nets: &[Vec<usize>]) {
    for column in 0..2 * columns.len() {
        for net in nets {
            if net.iter().any(|&part| columns[part] == Some(column)) {
                net.iter().for_each(|&part| _ = columns[part].get_or_insert(column + 1));
            }
        }
    }
}

/// Moves mechanical parts right of everything that oil flows through, e.g. a cylinder right of its valves.
fn shift_mechanics(specs: &[&Component], columns: &mut [Option<usize>]) {
    let is_oil = |kind: PortKind| matches!(kind, PortKind::Hydraulic { .. });
    let is_motion = |kind: PortKind| !is_oil(kind) && medium(kind) != SIGNAL;
    let count = |part: usize, wanted: &dyn Fn(PortKind) -> bool| {
        specs[part].ports.iter().filter(|port| wanted(port.kind)).count()
    };
    let (moved, others): (Vec<usize>, Vec<usize>) =
        (0..specs.len()).partition(|&part| count(part, &is_motion) > 0);
    let valves = others.into_iter().filter(|&part| count(part, &is_oil) > 1);
    let last_valve = valves.filter_map(|part| columns[part]).max();
    let first = moved.iter().filter_map(|&part| columns[part]).min();
    let Some((last_valve, first)) = last_valve.zip(first) else { return };
    for part in moved {
        columns[part] = columns[part].map(|column| column + (last_valve + 1).saturating_sub(first));
    }
}

/// Splits a column with too many parts of one actuator. Parts with a single connection come first, except for
/// inputs, which stand beside what they drive.
fn split_columns(schematic: &mut Schematic) {
    let last = schematic.parts.iter().map(|part| part.column).max().unwrap_or(0);
    let ends = schematic.nets.iter().flat_map(|net| &net.ends);
    let mut counts = vec![0; schematic.parts.len()];
    ends.for_each(|end| counts[end.part] += 1);
    let mut stacks: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (place, part) in schematic.parts.iter().enumerate() {
        stacks.entry((part.column, part.group)).or_default().push(place);
    }
    let is_input: Vec<bool> =
        schematic.parts.iter().map(|part| part.id.starts_with("input ")).collect();
    let mut left = 0;
    for column in 0..=last {
        let own = || stacks.iter().filter(|((other, _), _)| *other == column).map(|(_, own)| own);
        let splits = own().map(Vec::len).max().unwrap_or(0).div_ceil(IN_A_COLUMN);
        for stack in own() {
            let mut stack = stack.clone();
            stack.sort_by_key(|&place| counts[place] > 1 || is_input[place]);
            let each = stack.len().div_ceil(splits);
            for (rank, place) in stack.into_iter().enumerate() {
                schematic.parts[place].column = left + rank / each;
            }
        }
        left += splits;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oil_comes_from_the_left_and_the_load_stands_at_the_right() {
        let schematic = of(&servotwin::study::Study::default().system);
        let column =
            |id: &str| schematic.parts.iter().find(|part| part.id == id).map(|part| part.column);
        let chain = ["supply", "supply_valve", "servo_valve", "cylinder", "attachment"];
        let columns = chain.map(|name| column(&format!("actuator_1.{name}")));
        assert!(columns.is_sorted_by(|a, b| a < b), "{columns:?}");
        assert!(column("aileron") > columns[4]);
        assert_eq!(schematic.groups, ["actuator_1", "", "actuator_2"]);
        let figure = schematic.draw();
        for name in [">p<", ">t<", ">rod<", "data-component=\"actuator_2.leakage_a\""] {
            assert!(figure.svg.contains(name), "no {name}");
        }
        // The legend lists every medium once.
        for medium in MEDIA {
            assert_eq!(figure.svg.matches(&format!(">{medium}<")).count(), 1, "{medium}");
        }
    }
}
