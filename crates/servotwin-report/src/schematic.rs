//! A system as a hydraulic drawing: sources at the top, moving parts at the bottom, actuators
//! side by side. Connections start at the port that sets the potential.

use servotwin::system::System;
use servotwin_model::network::{Network, PortOf};
use servotwin_model::spec::PortKind;
use servotwin_plot::SemanticColor;
use servotwin_plot::diagram::{Block, Diagram, Wire};
use std::collections::{BTreeMap, VecDeque};

/// The kinds of connections, in the order of their colors. The order is the same in every drawing.
const MEDIA: [&str; 4] = ["hydraulic", "translational", "signal", "rotational"];

/// Components that oil comes from or returns to.
const SOURCES: [&str; 4] = ["pressure_source", "flow_source", "variable_pump", "tank"];

/// The maximum number of an actuator's blocks side by side. A fuller row is split into several.
const IN_A_ROW: usize = 3;

/// Draws the diagram of a system.
pub fn of(system: &System) -> Diagram {
    let network = system.network();
    let mut diagram = Diagram {
        title: system.title.clone(),
        kinds: MEDIA.map(str::to_owned).to_vec(),
        looks: (0..MEDIA.len()).map(|place| SemanticColor::Medium(place).look()).collect(),
        downwards: true,
        ..Diagram::default()
    };
    for instance in &network.components {
        let (group, name) = instance.id.rsplit_once('.').unwrap_or(("", &instance.id));
        let spec = instance.component.spec();
        let text = if name == spec.kind { name.into() } else { format!("{name}\n{}", spec.kind) };
        let family = spec.ports.first().map_or("", |port| port.kind.family());
        diagram.blocks.push(Block::new(&instance.id, &text, family, group));
    }
    for ports in &network.connections {
        diagram.wires.extend(wires(network, ports));
    }
    for input in &network.inputs {
        let block = format!("input {}", input.id);
        let (group, name) = input.id.rsplit_once('.').unwrap_or(("", &input.id));
        diagram.blocks.push(Block::new(&block, &format!("{name}\ninput"), "signal", group));
        diagram.wires.extend(input.targets.iter().map(|target| {
            let to = &network.components[target.component];
            let port = to.component.spec().ports[target.port].name;
            Wire {
                arrow: true,
                // One line joins everything that an input drives, and the port of an input has no name.
                ports: [" ".into(), port.into()],
                ..Wire::new(&block, &to.id, "signal")
            }
        }));
    }
    place_rows(network, &mut diagram);
    diagram.groups = groups(&diagram);
    diagram
}

fn wires(network: &Network, ports: &[PortOf]) -> Vec<Wire> {
    let id = |port: &PortOf| &network.components[port.component].id;
    let spec = |port: &PortOf| network.components[port.component].component.spec().ports[port.port];
    let Some(from) = ports.iter().find(|port| spec(port).kind.sets()).or(ports.first()) else {
        return Vec::new();
    };
    let others = ports.iter().filter(|port| *port != from);
    let wires = others.map(|port| Wire {
        arrow: matches!(spec(port).kind, PortKind::SignalIn { .. }),
        ports: [spec(from).name.into(), spec(port).name.into()],
        ..Wire::new(id(from), id(port), spec(from).kind.family())
    });
    wires.collect()
}

/// Lists the actuators, with the shared part in the middle.
fn groups(diagram: &Diagram) -> Vec<String> {
    let mut groups: Vec<String> = vec![];
    for block in diagram.blocks.iter().filter(|block| !block.group.is_empty()) {
        if !groups.contains(&block.group) {
            groups.push(block.group.clone());
        }
    }
    groups.insert(groups.len() / 2, String::new());
    groups
}

/// Gives every block its row: the distance from the sources through oil and mechanics. A block that only signals
/// reach stands below its nearest neighbor, and an input stands above what it drives.
fn place_rows(network: &Network, diagram: &mut Diagram) {
    let place: BTreeMap<String, usize> =
        diagram.blocks.iter().enumerate().map(|(place, block)| (block.id.clone(), place)).collect();
    let count = diagram.blocks.len();
    let neighbours = |is_wanted: &dyn Fn(&Wire) -> bool| {
        let mut neighbours = vec![Vec::new(); count];
        for wire in diagram.wires.iter().filter(|wire| is_wanted(wire)) {
            let (from, to) = (place[&wire.from], place[&wire.to]);
            neighbours[from].push(to);
            neighbours[to].push(from);
        }
        neighbours
    };
    let is_signal = |wire: &Wire| wire.kind == "signal";
    let is_input = |wire: &Wire| wire.from.starts_with("input ");
    let mut rows: Vec<Option<usize>> = vec![None; count];
    for (place, instance) in network.components.iter().enumerate() {
        let kind = instance.component.spec().kind;
        rows[place] = SOURCES.contains(&kind).then_some(0);
    }
    spread(&mut rows, &neighbours(&|wire| !is_signal(wire)));
    if rows.iter().all(Option::is_none) {
        // A system without sources starts from its first component.
        rows[..1.min(count)].fill(Some(0));
    }
    spread(&mut rows, &neighbours(&|wire| !is_signal(wire)));
    lower_what_moves(network, &mut rows);
    spread(&mut rows, &neighbours(&|wire| !is_input(wire)));
    let driven = neighbours(&is_input);
    for input in network.components.len()..count {
        let first = driven[input].iter().filter_map(|&target| rows[target]).min();
        rows[input] = Some(first.unwrap_or(0).saturating_sub(1));
    }
    let lines = neighbours(&|_| true).iter().map(Vec::len).collect::<Vec<_>>();
    divide(diagram, &rows, &lines);
}

/// Moves mechanical parts below everything that oil flows through, e.g. a cylinder below its valves.
fn lower_what_moves(network: &Network, rows: &mut [Option<usize>]) {
    let ports = |place: usize, wanted: fn(PortKind) -> bool| {
        let ports = network.components[place].component.spec().ports;
        ports.iter().filter(|port| wanted(port.kind)).count()
    };
    let oil = |place: usize| ports(place, |kind| matches!(kind, PortKind::Hydraulic { .. }));
    let motion = |place: usize| {
        ports(place, |kind| {
            matches!(kind, PortKind::Translational { .. } | PortKind::Rotational { .. })
        })
    };
    let places = || 0..network.components.len();
    let moved: Vec<usize> = places().filter(|&place| motion(place) > 0).collect();
    let valves = places().filter(|&place| motion(place) == 0 && oil(place) > 1);
    let lowest = valves.filter_map(|place| rows[place]).max();
    let highest = moved.iter().filter_map(|&place| rows[place]).min();
    let Some((lowest, highest)) = lowest.zip(highest) else { return };
    let by = (lowest + 1).saturating_sub(highest);
    for place in moved {
        rows[place] = rows[place].map(|row| row + by);
    }
}

fn spread(rows: &mut [Option<usize>], neighbours: &[Vec<usize>]) {
    // Start from the upper rows, so that each distance is the shortest.
    let mut start: Vec<usize> = (0..rows.len()).filter(|&place| rows[place].is_some()).collect();
    start.sort_by_key(|&place| (rows[place], place));
    let mut queue: VecDeque<usize> = start.into();
    while let Some(place) = queue.pop_front() {
        for &next in &neighbours[place] {
            let row = rows[place].map(|row| row + 1);
            if rows[next].is_none() {
                rows[next] = row;
                queue.push_back(next);
            }
        }
    }
}

/// Splits a row with too many blocks of one actuator. Blocks with a single line come first.
fn divide(diagram: &mut Diagram, rows: &[Option<usize>], lines: &[usize]) {
    let last = rows.iter().flatten().max().copied().unwrap_or(0);
    let mut above = 0;
    for row in 0..=last {
        let mut by_group: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (place, own) in rows.iter().enumerate() {
            // An unconnected block stands at the top.
            if own.unwrap_or(0) == row {
                by_group.entry(diagram.blocks[place].group.clone()).or_default().push(place);
            }
        }
        let fullest = by_group.values().map(Vec::len).max().unwrap_or(0);
        let parts = fullest.div_ceil(IN_A_ROW).max(1);
        for mut places in by_group.into_values() {
            places.sort_by_key(|&place| (lines[place] > 1, place));
            let each = places.len().div_ceil(parts).max(1);
            for (rank, &place) in places.iter().enumerate() {
                diagram.blocks[place].layer = Some(above + rank / each);
            }
        }
        above += parts;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(diagram: &Diagram, id: &str) -> usize {
        diagram.blocks.iter().find(|block| block.id == id).and_then(|block| block.layer).unwrap()
    }

    #[test]
    fn oil_comes_from_the_top_and_the_load_hangs_at_the_bottom() {
        let study = servotwin::study::Study::default();
        let diagram = of(&study.system);
        let chain = ["supply", "supply_valve", "servo_valve", "cylinder", "attachment"];
        let layers = chain.map(|name| layer(&diagram, &format!("actuator_1.{name}")));
        assert!(layers.is_sorted_by(|a, b| a < b), "{layers:?}");
        assert!(layer(&diagram, "aileron") > layers[4]);
        assert_eq!(diagram.groups, ["actuator_1", "", "actuator_2"]);
        let figure = diagram.draw();
        // Components with one port are included.
        for name in [">p<", ">t<", ">rod<", ">port<"] {
            assert!(figure.svg.contains(name), "no port {name}");
        }
        // Supply, lines and sensors share one line. A dot marks where it branches.
        assert!(figure.svg.contains("<circle"));
        // The legend lists every medium once.
        for medium in MEDIA {
            assert_eq!(figure.svg.matches(&format!(">{medium}<")).count(), 1, "{medium}");
        }
    }
}
