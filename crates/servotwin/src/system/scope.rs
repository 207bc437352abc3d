//! The parsed content of a system or an assembly: components, inputs and connections, with their places in the file.

use crate::toml_text::{Diagnostic, TextSpan};
use servotwin_model::components::Component;
use servotwin_model::fluid::Fluid;
use servotwin_model::network::{ExternalInput, Instance, Network, PortOf};
use servotwin_model::spec::{Port, PortKind, Unit};
use std::collections::BTreeMap;

/// A component as read from the file.
#[derive(Clone)]
pub(super) struct Part {
    pub id: String,
    /// The place of its name; for an assembly's component, within the assembly.
    pub(crate) at: TextSpan,
    pub(crate) component: &'static Component,
    /// The values in SI; NaN where a required one is missing.
    pub(crate) parameters: Vec<f64>,
    pub(crate) faults: Vec<f64>,
    /// The index of its declared fluid.
    pub(crate) fluid: Option<usize>,
    /// Whether all its values could be read.
    pub(crate) sound: bool,
}

impl Part {
    pub(crate) fn new(id: String, at: TextSpan, component: &'static Component) -> Self {
        let Instance { parameters, fault_full, .. } = Instance::new("", component);
        Self { id, at, component, parameters, faults: fault_full, fluid: None, sound: true }
    }
}

/// A port with its place in a connection.
#[derive(Clone)]
pub(super) struct End {
    pub(crate) port: PortOf,
    pub(crate) at: TextSpan,
}

/// An external input.
#[derive(Clone)]
pub(super) struct Input {
    pub(crate) id: String,
    pub(crate) at: TextSpan,
    pub(crate) unit: Unit,
    /// The place of the unit.
    pub(crate) unit_at: TextSpan,
    /// NaN if the file has no readable value.
    pub(crate) default: f64,
    pub(crate) targets: Vec<End>,
}

/// Help for signals with several sources.
pub(super) const ONE_SOURCE: &str = "a signal has one source: keep one of them";

/// The content of a system or of an assembly.
#[derive(Clone, Default)]
pub(super) struct Scope {
    pub(crate) parts: Vec<Part>,
    /// The index in `parts` of each component.
    places: BTreeMap<String, usize>,
    pub(crate) inputs: Vec<Input>,
    pub(crate) connections: Vec<Vec<End>>,
    /// Names that are declared but could not be read: references to them are not reported again.
    pub(crate) broken: Vec<String>,
    /// Whether all components and connections could be read.
    pub(crate) complete: bool,
}

impl Scope {
    pub(crate) fn new(complete: bool) -> Self {
        Self { complete, ..Self::default() }
    }

    /// Marks a declaration that could not be read.
    pub(crate) fn breaks(&mut self, name: &str) {
        self.broken.push(name.into());
        self.complete = false;
    }

    /// The components of a kind.
    pub(crate) fn of_kind(&self, kind: &'static str) -> impl Iterator<Item = usize> {
        (0..self.parts.len()).filter(move |part| self.parts[*part].component.kind == kind)
    }

    /// All signal outputs of components, with their ids and units.
    pub(crate) fn outputs(&self) -> impl Iterator<Item = (String, PortOf, Unit)> {
        let ports = |(component, part): (usize, &Part)| {
            (0..part.component.ports.len()).map(move |port| PortOf { component, port })
        };
        let ports = self.parts.iter().enumerate().flat_map(ports);
        ports.filter_map(|port| match self.port(port).kind {
            PortKind::SignalOut { unit } => Some((self.port_id(port), port, unit)),
            _ => None,
        })
    }

    /// The mistake that two inputs feed one signal.
    pub(crate) fn two_inputs(&self, first: usize, second: usize) -> Diagnostic {
        let [first, second] = [first, second].map(|input| &self.inputs[input].id);
        let message = format!("the inputs '{first}' and '{second}' feed the same signal");
        Diagnostic::new(message).with_help(ONE_SOURCE)
    }

    /// The mistake that an input feeds what an output gives.
    pub(crate) fn input_and_output(&self, input: usize, output: &str) -> Diagnostic {
        let input = &self.inputs[input].id;
        let message = format!("the input '{input}' meets the output '{output}'");
        Diagnostic::new(message).with_help(ONE_SOURCE)
    }

    pub(crate) fn part(&self, id: &str) -> Option<usize> {
        self.places.get(id).copied()
    }

    pub(crate) fn add(&mut self, part: Part) {
        // If a name occurs twice, the first counts; the second is a mistake.
        self.places.entry(part.id.clone()).or_insert(self.parts.len());
        self.parts.push(part);
    }

    pub(crate) fn input(&self, id: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.id == id)
    }

    /// Whether a name belongs to a declaration that could not be read.
    pub(crate) fn is_broken(&self, name: &str) -> bool {
        let belongs = |broken: &String| {
            name.strip_prefix(broken.as_str())
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        self.broken.iter().any(belongs)
    }

    pub(crate) fn has(&self, id: &str) -> bool {
        self.part(id).is_some() || self.input(id).is_some() || self.broken.iter().any(|b| b == id)
    }

    /// Includes all parts of an assembly under the name of its instance.
    pub(crate) fn include(&mut self, instance: &str, assembly: Scope) {
        let first = self.parts.len();
        let prefixed = |id: &str| format!("{instance}.{id}");
        let shifted = |end: End| {
            let PortOf { component, port } = end.port;
            End { port: PortOf { component: first + component, port }, at: end.at }
        };
        for part in assembly.parts {
            self.add(Part { id: prefixed(&part.id), ..part });
        }
        self.inputs.extend(assembly.inputs.into_iter().map(|input| Input {
            id: prefixed(&input.id),
            targets: input.targets.into_iter().map(shifted).collect(),
            ..input
        }));
        let connections = assembly.connections.into_iter();
        self.connections.extend(connections.map(|c| c.into_iter().map(shifted).collect()));
        self.broken.extend(assembly.broken.iter().map(|id| prefixed(id)));
        self.complete &= assembly.complete;
    }

    pub(crate) fn port(&self, port: PortOf) -> &'static Port {
        &self.parts[port.component].component.ports[port.port]
    }

    /// The id of a port, `component.port`.
    pub(crate) fn port_id(&self, port: PortOf) -> String {
        format!("{}.{}", self.parts[port.component].id, self.port(port).name)
    }

    /// All ports of a port's node, starting with itself.
    pub(crate) fn joined(&self, port: PortOf) -> Vec<PortOf> {
        let mut node = vec![port];
        let mut next = 0;
        while next < node.len() {
            let of_this =
                self.connections.iter().filter(|c| c.iter().any(|e| e.port == node[next]));
            let found: Vec<PortOf> = of_this.flatten().map(|end| end.port).collect();
            for port in found {
                if !node.contains(&port) {
                    node.push(port);
                }
            }
            next += 1;
        }
        node
    }

    /// The place where the file names a port, otherwise its component.
    pub(crate) fn mention(&self, port: PortOf) -> TextSpan {
        let fed = self.inputs.iter().flat_map(|input| &input.targets);
        let mut ends = self.connections.iter().flatten().chain(fed);
        ends.find(|end| end.port == port)
            .map_or_else(|| self.parts[port.component].at.clone(), |end| end.at.clone())
    }

    /// Builds the network, with the fluid of each component.
    pub(crate) fn network(&self, fluids: &[Fluid]) -> Network {
        let fluid =
            |part: &Part| part.fluid.map_or_else(Fluid::default, |index| fluids[index].clone());
        let components = self.parts.iter().map(|part| Instance {
            id: part.id.clone(),
            component: part.component,
            parameters: part.parameters.clone(),
            fault_full: part.faults.clone(),
            fluid: fluid(part),
        });
        let ports = |ends: &Vec<End>| ends.iter().map(|end| end.port).collect();
        let inputs = self.inputs.iter().map(|input| ExternalInput {
            id: input.id.clone(),
            unit: input.unit,
            default: input.default,
            targets: ports(&input.targets),
        });
        Network {
            components: components.collect(),
            connections: self.connections.iter().map(ports).collect(),
            inputs: inputs.collect(),
        }
    }
}
