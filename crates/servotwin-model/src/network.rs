//! A system (components, connections and inputs) and the wiring of its components.
//!
//! All mistakes are collected with the indices of their component, connection or
//! input, so that a parser can name file, line and column.

pub use crate::wiring::PortOf;

use crate::component::Component;
use crate::fluid::Fluid;
use crate::hash::{Canonical, Fingerprint};
use crate::spec::{PortKind, Unit};
use crate::wiring::{Collected, Node, Role, Sum, Variable, Wiring};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

/// A component of a system.
#[derive(Clone)]
pub struct Instance {
    /// The id, unique in the system, e.g. `actuator_1.servo_valve`.
    pub id: String,
    /// The component of the catalogue.
    pub component: &'static Component,
    /// The parameters in SI units, in declared order.
    pub parameters: Vec<f64>,
    /// The value of each fault's law at intensity 1, in declared order.
    pub fault_full: Vec<f64>,
    /// The fluid, for components that fix a circuit's pressure.
    pub fluid: Fluid,
}

impl Instance {
    /// A component with its declared defaults. Mandatory parameters are NaN
    /// until they are set.
    pub fn new(id: impl Into<String>, component: &'static Component) -> Self {
        let spec = component;
        Self {
            id: id.into(),
            component,
            parameters: spec.parameters.iter().map(|p| p.default.unwrap_or(f64::NAN)).collect(),
            fault_full: spec.faults.iter().map(|f| f.full).collect(),
            fluid: Fluid::default(),
        }
    }

    /// The full name of a parameter, by its index.
    pub fn parameter_name(&self, parameter: usize) -> String {
        format!("{}.{}", self.id, self.component.parameters[parameter].name)
    }

    /// The full name of a fault, by its index.
    pub fn fault_name(&self, fault: usize) -> String {
        format!("{}.{}", self.id, self.component.faults[fault].name)
    }

    /// The full names of all its parameters.
    pub fn parameter_names(&self) -> impl Iterator<Item = String> {
        (0..self.parameters.len()).map(|parameter| self.parameter_name(parameter))
    }

    /// The full names of all its faults.
    pub fn fault_names(&self) -> impl Iterator<Item = String> {
        (0..self.fault_full.len()).map(|fault| self.fault_name(fault))
    }

    /// The permitted range of a parameter: as declared, and for a circuit's temperature also within the validity of the
    /// fluid's equations.
    pub fn range(&self, parameter: usize) -> (f64, f64) {
        let spec = self.component;
        let declared = &spec.parameters[parameter];
        if !(spec.reference && declared.name == "temperature_k") {
            return (declared.min, declared.max);
        }
        let (coldest, hottest) = self.fluid.range_k();
        (declared.min.max(coldest), declared.max.min(hottest))
    }

    /// Sets a parameter by name.
    ///
    /// # Panics
    /// If the component declares no such parameter.
    pub fn with(mut self, parameter: &str, value: f64) -> Self {
        let index = self.component.parameter(parameter).expect("a declared parameter");
        self.parameters[index] = value;
        self
    }
}

/// The parameters of sources and tanks that describe the fluid. All sources and tanks of one circuit have the same
/// values.
pub const FLUID_PARAMETERS: [&str; 3] = ["temperature_k", "bulk_modulus_factor", "air_factor"];

/// An external signal: a command, a boundary value, a load.
#[derive(Clone, Debug)]
pub struct ExternalInput {
    /// The id, unique among inputs.
    pub id: String,
    /// The unit.
    pub unit: Unit,
    /// The value if a run provides no signal.
    pub default: f64,
    /// The signal inputs it feeds.
    pub targets: Vec<PortOf>,
}

/// A system before compilation.
#[derive(Clone, Default)]
pub struct Network {
    /// The components.
    pub components: Vec<Instance>,
    /// Each connection joins the ports it lists.
    pub connections: Vec<Vec<PortOf>>,
    /// The external inputs.
    pub inputs: Vec<ExternalInput>,
}

impl Network {
    /// A number that differs between networks with other components, parameters, fluids, connections or inputs.
    pub(crate) fn identity(&self) -> u64 {
        let Network { components, connections, inputs } = self;
        Fingerprint::default().add(components).add(connections).add(inputs).value()
    }
}

impl Canonical for Instance {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let Instance { id, component, parameters, fault_full, fluid } = self;
        fingerprint.add(id).add(component.kind);
        fingerprint.add(parameters).add(fault_full).add(fluid);
    }
}

impl Canonical for ExternalInput {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let ExternalInput { id, unit, default, targets } = self;
        fingerprint.add(id).add(unit.symbol()).add(default).add(targets);
    }
}

/// A mistake in a network.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// A port that must be connected is open.
    OpenPort(PortOf),
    /// A connection joins ports of different families.
    MixedKinds {
        /// Index of the connection.
        connection: usize,
        /// The first port.
        first: PortOf,
        /// The port that does not fit.
        second: PortOf,
    },
    /// A signal of one unit is connected to an input of another, or an input of the
    /// system to a port that reads no signal.
    MixedUnits {
        /// The source; `None` for an input of the system.
        from: Option<PortOf>,
        /// The input.
        to: PortOf,
    },
    /// Two components set the same pressure, motion or signal.
    TwoSources {
        /// The first source.
        first: PortOf,
        /// The second source.
        second: PortOf,
    },
    /// No component sets the pressure, motion or signal that this port reads.
    NoSource(PortOf),
    /// A hydraulic circuit has neither a source nor a tank.
    NoReference {
        /// A component of the circuit.
        component: usize,
    },
    /// The sources of a circuit have different fluids or temperatures.
    TwoFluids {
        /// The first source.
        first: usize,
        /// The source that differs.
        second: usize,
    },
    /// Signals depend on each other without a state in between.
    AlgebraicLoop {
        /// The components in the loop.
        components: Vec<usize>,
    },
    /// A component rejects its combination of parameters.
    Impossible {
        /// Index of the component.
        component: usize,
        /// What does not fit.
        reason: String,
    },
    /// The system has no states.
    Empty,
    /// More variables than a program can address.
    TooLarge,
}

impl Network {
    /// The permitted range of an external input: the intersection of the ranges of its targets.
    pub fn input_range(&self, input: usize) -> (f64, f64) {
        let ranges = self.inputs[input].targets.iter().filter_map(|target| {
            let spec = self.components[target.component].component;
            spec.input_range(&spec.ports[target.port])
        });
        ranges.fold((f64::NEG_INFINITY, f64::INFINITY), |(low, high), (min, max)| {
            (low.max(min), high.min(max))
        })
    }

    /// Joins ports to nodes and lets every component wire its equations. Returns the collected wiring and, for each
    /// component, the one that determines its circuit's fluid.
    ///
    /// # Errors
    /// The mistakes found.
    pub(crate) fn wired(&self) -> Result<(Collected, Vec<usize>), Vec<Mistake>> {
        let mut joints = Joints::new(self);
        let mut mistakes = Vec::new();
        joints.connect(self, &mut mistakes);
        joints.check_sources(self, &mut mistakes);
        let circuits = self.circuits(&joints, &mut mistakes);
        for (component, instance) in self.components.iter().enumerate() {
            if let Err(reason) = (instance.component.check)(&instance.parameters) {
                mistakes.push(Mistake::Impossible { component, reason });
            }
        }
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        Ok((self.wire(&joints), circuits))
    }

    /// The kind of a port.
    pub(crate) fn kind(&self, port: PortOf) -> PortKind {
        self.components[port.component].component.ports[port.port].kind
    }

    /// For each component the one that determines its circuit's fluid: the first
    /// pressure reference of the circuit, or itself if it has no fluid.
    fn circuits(&self, joints: &Joints, mistakes: &mut Vec<Mistake>) -> Vec<usize> {
        let n = self.components.len();
        let mut group: Vec<usize> = (0..n).collect();
        let mut hydraulic = vec![false; n];
        let mut first_of_joint: Vec<Option<usize>> = vec![None; joints.count()];
        for (port, joint) in joints.ports(self) {
            if !matches!(self.kind(port), PortKind::Hydraulic { .. }) {
                continue;
            }
            hydraulic[port.component] = true;
            match first_of_joint[joint] {
                Some(other) => unite(&mut group, other, port.component),
                None => first_of_joint[joint] = Some(port.component),
            }
        }
        let roots: Vec<usize> = (0..n).map(|c| root(&group, c)).collect();
        let mut ruler: Vec<Option<usize>> = vec![None; n];
        for c in (0..n).filter(|&c| self.components[c].component.reference) {
            let circuit = roots[c];
            match ruler[circuit] {
                None => ruler[circuit] = Some(c),
                Some(first) => {
                    if !self.same_fluid(first, c) {
                        mistakes.push(Mistake::TwoFluids { first, second: c });
                    }
                }
            }
        }
        let mut reported = vec![false; n];
        (0..n)
            .map(|c| match ruler[roots[c]] {
                Some(source) => source,
                None => {
                    if hydraulic[c] && !reported[roots[c]] {
                        reported[roots[c]] = true;
                        mistakes.push(Mistake::NoReference { component: c });
                    }
                    c
                }
            })
            .collect()
    }

    fn same_fluid(&self, a: usize, b: usize) -> bool {
        let (a, b) = (&self.components[a], &self.components[b]);
        let value =
            |i: &Instance, name: &str| i.component.parameter(name).map(|index| i.parameters[index]);
        a.fluid == b.fluid && FLUID_PARAMETERS.iter().all(|name| value(a, name) == value(b, name))
    }

    fn wire(&self, joints: &Joints) -> Collected {
        let mut collected = Collected::default();
        let states = self.allocate_states(&mut collected);
        let nodes = joints.allocate(self, &mut collected);
        for (component, instance) in self.components.iter().enumerate() {
            let spec = instance.component;
            let ports: Vec<Option<Node>> = (0..spec.ports.len())
                .map(|port| joints.of(PortOf { component, port }).map(|j| nodes[j]))
                .collect();
            let connected = ports
                .iter()
                .enumerate()
                .filter_map(|(port, node)| node.map(|node| (PortOf { component, port }, node)));
            collected.nodes.extend(connected);
            let mut wiring = Wiring {
                collected: &mut collected,
                component,
                kind: spec.kind,
                ports: spec.ports,
                nodes: &ports,
                states: (spec.states, &states[component]),
                parameters: (spec.parameters, &instance.parameters),
            };
            (spec.connect)(&mut wiring);
        }
        collected
    }

    fn allocate_states(&self, collected: &mut Collected) -> Vec<Vec<(Variable, Sum)>> {
        let all = self.components.iter().enumerate();
        all.map(|(component, instance)| {
            let count = instance.component.states.len();
            (0..count)
                .map(|state| {
                    let variable = collected.variable(Role::State { component, state });
                    let rate = collected.variable(Role::Derivative { component, state });
                    (variable, Sum(rate.0))
                })
                .collect()
        })
        .collect()
    }
}

/// Sets of ports that form one node.
struct Joints {
    /// The union-find parent of every port; ports are numbered through all components.
    parents: Vec<usize>,
    /// The number of the first port of each component.
    first: Vec<usize>,
    /// Whether a port is part of any connection (or sets a potential itself).
    used: Vec<bool>,
    /// For each root, the external input that feeds it.
    external: Vec<Option<usize>>,
}

fn root(parents: &[usize], mut i: usize) -> usize {
    while parents[i] != i {
        i = parents[i];
    }
    i
}

fn unite(parents: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root(parents, a), root(parents, b));
    // The smaller number stays the root, so that the order of connections does
    // not affect the result.
    parents[a.max(b)] = a.min(b);
}

impl Joints {
    fn new(network: &Network) -> Self {
        let mut first = Vec::new();
        let mut count = 0;
        for instance in &network.components {
            first.push(count);
            count += instance.component.ports.len();
        }
        Self {
            parents: (0..count).collect(),
            first,
            used: vec![false; count],
            external: vec![None; count],
        }
    }

    fn count(&self) -> usize {
        self.parents.len()
    }

    fn number(&self, port: PortOf) -> usize {
        self.first[port.component] + port.port
    }

    /// The node of a port; `None` for an open port.
    fn of(&self, port: PortOf) -> Option<usize> {
        let number = self.number(port);
        self.used[number].then(|| root(&self.parents, number))
    }

    /// Every port that belongs to a node.
    fn ports<'a>(&'a self, network: &'a Network) -> impl Iterator<Item = (PortOf, usize)> + 'a {
        let components = network.components.iter().enumerate();
        components
            .flat_map(|(component, instance)| {
                let count = instance.component.ports.len();
                (0..count).map(move |port| PortOf { component, port })
            })
            .filter_map(|port| self.of(port).map(|joint| (port, joint)))
    }

    fn connect(&mut self, network: &Network, mistakes: &mut Vec<Mistake>) {
        for (connection, ports) in network.connections.iter().enumerate() {
            let Some(&first) = ports.first() else {
                continue;
            };
            let number = self.number(first);
            self.used[number] = true;
            for &second in &ports[1..] {
                if network.kind(first).family() == network.kind(second).family() {
                    let (a, b) = (self.number(first), self.number(second));
                    self.used[b] = true;
                    unite(&mut self.parents, a, b);
                } else {
                    mistakes.push(Mistake::MixedKinds { connection, first, second });
                }
            }
        }
        // A port that sets its own potential has a node even when left open.
        for (component, instance) in network.components.iter().enumerate() {
            for (port, declared) in instance.component.ports.iter().enumerate() {
                if declared.kind.sets() && declared.optional {
                    let number = self.number(PortOf { component, port });
                    self.used[number] = true;
                }
            }
        }
        for (index, input) in network.inputs.iter().enumerate() {
            for &target in &input.targets {
                if !matches!(network.kind(target), PortKind::SignalIn { .. }) {
                    mistakes.push(Mistake::MixedUnits { from: None, to: target });
                    continue;
                }
                let number = self.number(target);
                self.used[number] = true;
                let joint = root(&self.parents, number);
                self.external[joint] = Some(index);
            }
        }
    }

    fn check_sources(&self, network: &Network, mistakes: &mut Vec<Mistake>) {
        let mut sources: Vec<Option<PortOf>> = vec![None; self.count()];
        for (port, joint) in self.ports(network) {
            if network.kind(port).sets() {
                match sources[joint] {
                    Some(first) => mistakes.push(Mistake::TwoSources { first, second: port }),
                    None => sources[joint] = Some(port),
                }
            }
        }
        let mut reported = vec![false; self.count()];
        for (component, instance) in network.components.iter().enumerate() {
            for (index, declared) in instance.component.ports.iter().enumerate() {
                let port = PortOf { component, port: index };
                let Some(joint) = self.of(port) else {
                    if !declared.optional {
                        mistakes.push(Mistake::OpenPort(port));
                    }
                    continue;
                };
                let external = self.external[joint];
                if sources[joint].is_none() && external.is_none() && !reported[joint] {
                    reported[joint] = true;
                    mistakes.push(Mistake::NoSource(port));
                }
                if let PortKind::SignalIn { unit, .. } = declared.kind {
                    let from = sources[joint];
                    let given = match (from.map(|p| network.kind(p)), external) {
                        (Some(PortKind::SignalOut { unit }), _) => Some(unit),
                        (_, Some(input)) => Some(network.inputs[input].unit),
                        _ => None,
                    };
                    if given.is_some_and(|given| given != unit) {
                        mistakes.push(Mistake::MixedUnits { from, to: port });
                    }
                }
            }
        }
    }

    fn allocate(&self, network: &Network, collected: &mut Collected) -> Vec<Node> {
        let mut nodes: Vec<Option<Node>> = vec![None; self.count()];
        for (_, joint) in self.ports(network) {
            nodes[joint].get_or_insert_with(|| Node {
                first: match self.external[joint] {
                    Some(input) => collected.variable(Role::External(input)),
                    None => collected.variable(Role::Unset),
                },
                second: collected.variable(Role::Unset),
                sum: Sum(collected.variable(Role::Sum).0),
            });
        }
        let unused = Node { first: Variable(0), second: Variable(0), sum: Sum(0) };
        nodes.into_iter().map(|n| n.unwrap_or(unused)).collect()
    }
}

#[cfg(test)]
mod tests;
