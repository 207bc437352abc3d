//! A system as a block diagram: components as blocks, connections as wires from the port that sets.

use crate::figure::diagram::{Block, Diagram, Wire};
use crate::system::System;
use servotwin_model::network::{Network, PortOf};
use servotwin_model::spec::PortKind;

/// The diagram of a system.
pub fn of(system: &System) -> Diagram {
    let network = system.network();
    let mut diagram = Diagram { title: system.title.clone(), ..Diagram::default() };
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
        let group = input.id.rsplit_once('.').map_or("", |(group, _)| group);
        diagram.blocks.push(Block::new(&block, &format!("{}\ninput", input.id), "input", group));
        diagram.wires.extend(input.targets.iter().map(|target| Wire {
            arrow: true,
            ..Wire::new(&block, &network.components[target.component].id, "signal")
        }));
    }
    diagram
}

fn wires(network: &Network, ports: &[PortOf]) -> Vec<Wire> {
    let id = |port: &PortOf| &network.components[port.component].id;
    let kind =
        |port: &PortOf| network.components[port.component].component.spec().ports[port.port].kind;
    let Some(from) = ports.iter().find(|port| kind(port).sets()).or(ports.first()) else {
        return Vec::new();
    };
    let others = ports.iter().filter(|port| *port != from);
    let wires = others.map(|port| Wire {
        arrow: matches!(kind(port), PortKind::SignalIn { .. }),
        ..Wire::new(id(from), id(port), kind(from).family())
    });
    wires.collect()
}
