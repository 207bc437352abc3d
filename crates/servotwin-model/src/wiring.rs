//! The interface through which a component wires its equations.
//!
//! A component does not know its neighbors. It requests the variables behind
//! its ports and states and adds equation blocks, which read variables and
//! add their outputs to sums.
//!
//! Sign convention: the *sum* of a node is what flows **into the component
//! that sets the node's potential** — flow into the volume that sets the
//! pressure, force on the mass that sets the motion (positive along its
//! coordinate), moment on the inertia that sets the angle. A block that moves
//! flow from port `a` to port `b` therefore subtracts it from the sum of `a`
//! and adds it to the sum of `b`.

use crate::equation::Equation;
use crate::hash::{Canonical, Fingerprint};
use crate::spec::{Parameter, Port, PortKind, State};
use alloc::vec::Vec;

/// A port of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PortOf {
    /// Index of the component.
    pub component: usize,
    /// Index of the port in the component's declaration.
    pub port: usize,
}

impl Canonical for PortOf {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.component).add(&self.port);
    }
}

/// The equation of a block, as its index in the catalogue's list, which holds the equation itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct EquationIndex(pub(crate) u8);

/// An equation block of the catalogue's list.
pub(crate) trait Listed {
    /// Its index in the list.
    const KIND: EquationIndex;
}

/// A variable that an equation can read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Variable(pub(crate) u32);

/// A sum that an equation can add to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Sum(pub(crate) u32);

impl Sum {
    /// The sum as a variable to read.
    pub(crate) fn variable(self) -> Variable {
        Variable(self.0)
    }
}

/// The target of an output: added to one sum, subtracted from another, or both.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Output {
    pub(crate) add: Option<Sum>,
    pub(crate) subtract: Option<Sum>,
}

impl Output {
    /// Adds to a sum.
    pub(crate) fn add(sum: Sum) -> Self {
        Self { add: Some(sum), subtract: None }
    }
    /// Subtracts from a sum.
    pub(crate) fn subtract(sum: Sum) -> Self {
        Self { add: None, subtract: Some(sum) }
    }
    /// Subtracts from one sum and adds to the other.
    pub(crate) fn transfer(from: Sum, to: Sum) -> Self {
        Self { add: Some(to), subtract: Some(from) }
    }
}

/// A wired equation block of a component.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) kind: EquationIndex,
    pub(crate) component: usize,
    pub(crate) which: usize,
    pub(crate) inputs: Vec<Variable>,
    pub(crate) outputs: Vec<Output>,
    /// Index of the clock that runs it; `None` for continuous equations.
    pub(crate) clock: Option<usize>,
    /// Whether it runs before all others ([`Wiring::opening_equation`]).
    pub(crate) is_opening: bool,
}

impl Block {
    /// Whether any output is subtracted from a sum.
    pub(crate) fn subtracts(&self) -> bool {
        self.outputs.iter().any(|o| o.subtract.is_some())
    }
}

/// The source of a variable's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    State {
        component: usize,
        state: usize,
    },
    /// An external input, by its index among the network's inputs.
    External(usize),
    /// A component's parameter, where no signal is connected.
    Parameter {
        component: usize,
        parameter: usize,
    },
    /// The fluid temperature of a component's circuit.
    Temperature {
        component: usize,
    },
    /// Held between the ticks of a clock.
    Held,
    /// The sum of the block outputs added to it.
    Sum,
    /// The time derivative of a state, itself a sum.
    Derivative {
        component: usize,
        state: usize,
    },
    /// Another name of a variable.
    Alias(Variable),
    /// A node's potential that no component has set yet.
    Unset,
}

/// The node behind a port.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Pressure; position; angle; or the signal.
    pub(crate) first: Variable,
    /// Velocity; rate.
    pub(crate) second: Variable,
    /// Flow; force; moment.
    pub(crate) sum: Sum,
}

/// A clock of sampled equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clock {
    pub(crate) component: usize,
    pub(crate) period_s: f64,
}

/// Everything that the components' wiring has added so far.
#[derive(Default)]
pub(crate) struct Collected {
    pub(crate) roles: Vec<Role>,
    pub(crate) blocks: Vec<Block>,
    pub(crate) clocks: Vec<Clock>,
    /// (clock, new value, held value).
    pub(crate) exchanges: Vec<(usize, Variable, Variable)>,
    /// The nodes of all connected ports, in the order of components.
    pub(crate) nodes: Vec<(PortOf, Node)>,
    /// (state, variable recorded in its place).
    pub(crate) shown: Vec<(Variable, Variable)>,
}

impl Collected {
    pub(crate) fn variable(&mut self, role: Role) -> Variable {
        self.roles.push(role);
        Variable(self.roles.len() as u32 - 1)
    }

    /// Follows aliases to the variable behind them.
    ///
    /// # Panics
    /// If aliases form a circle, which no component's wiring creates.
    pub(crate) fn resolve(&self, mut variable: Variable) -> Variable {
        for _ in 0..=self.roles.len() {
            match self.roles[variable.0 as usize] {
                Role::Alias(next) => variable = next,
                _ => return variable,
            }
        }
        panic!("aliases run in a circle");
    }
}

/// One component's view of the network.
pub(crate) struct Wiring<'a> {
    pub(crate) collected: &'a mut Collected,
    pub(crate) component: usize,
    pub(crate) kind: &'static str,
    pub(crate) ports: &'static [Port],
    /// The nodes of the ports; `None` for an open port.
    pub(crate) nodes: &'a [Option<Node>],
    /// The states, and their variables and derivatives.
    pub(crate) states: (&'static [State], &'a [(Variable, Sum)]),
    /// The parameters, and their values without faults.
    pub(crate) parameters: (&'static [Parameter], &'a [f64]),
}

impl Wiring<'_> {
    fn index(&self, port: &str) -> usize {
        let index = self.ports.iter().position(|declared| declared.name == port);
        index.unwrap_or_else(|| panic!("{} declares no port '{port}'", self.kind))
    }

    fn node(&self, port: &str) -> Node {
        self.nodes[self.index(port)]
            .unwrap_or_else(|| panic!("port '{port}' of {} is open: ask `connected`", self.kind))
    }

    /// Whether something is connected to an optional port.
    pub(crate) fn connected(&self, port: &str) -> bool {
        self.nodes[self.index(port)].is_some()
    }

    /// A parameter of the component without faults. Use it for the structure (a count,
    /// a period), never for the numbers of an equation.
    pub(crate) fn structural(&self, parameter: &str) -> f64 {
        self.parameters.1[self.parameter_index(parameter)]
    }

    fn parameter_index(&self, name: &str) -> usize {
        let index = self.parameters.0.iter().position(|declared| declared.name == name);
        index.expect("a declared parameter")
    }

    /// A state by its declared name.
    pub(crate) fn state(&self, name: &str) -> Variable {
        self.states.1[self.state_index(name)].0
    }

    /// The time derivative of a state.
    pub(crate) fn derivative(&self, name: &str) -> Sum {
        self.states.1[self.state_index(name)].1
    }

    /// The output that adds to the time derivative of a state.
    pub(crate) fn rate(&self, state: &str) -> Output {
        Output::add(self.derivative(state))
    }

    fn state_index(&self, name: &str) -> usize {
        let found = self.states.0.iter().position(|s| s.name == name);
        found.unwrap_or_else(|| panic!("{} declares no state '{name}'", self.kind))
    }

    /// Pressure at a hydraulic port.
    pub(crate) fn pressure(&self, port: &str) -> Variable {
        self.node(port).first
    }

    /// Flow into the component that sets the pressure of a port's node.
    pub(crate) fn flow(&self, port: &str) -> Sum {
        self.node(port).sum
    }

    /// Position at a translational port, angle at a rotational one.
    pub(crate) fn position(&self, port: &str) -> Variable {
        self.node(port).first
    }

    /// Velocity at a translational port, rate at a rotational one.
    pub(crate) fn velocity(&self, port: &str) -> Variable {
        self.node(port).second
    }

    /// Force on the component that moves a port's node; moment for rotation.
    pub(crate) fn force(&self, port: &str) -> Sum {
        self.node(port).sum
    }

    /// The signal at an input port: the connected one, or that of the default parameter.
    pub(crate) fn signal(&mut self, port: &str) -> Variable {
        let index = self.index(port);
        if let Some(node) = self.nodes[index] {
            return node.first;
        }
        match self.ports[index].kind {
            PortKind::SignalIn { default: Some(name), .. } => self.parameter(name),
            _ => panic!("port '{port}' of {} is open: ask `connected`", self.kind),
        }
    }

    /// A parameter as a variable.
    pub(crate) fn parameter(&mut self, name: &str) -> Variable {
        let parameter = self.parameter_index(name);
        self.collected.variable(Role::Parameter { component: self.component, parameter })
    }

    /// The fluid temperature of the component's circuit.
    pub(crate) fn fluid_temperature(&mut self) -> Variable {
        self.collected.variable(Role::Temperature { component: self.component })
    }

    /// Creates a sum inside the component.
    pub(crate) fn internal(&mut self) -> Sum {
        let variable = self.collected.variable(Role::Sum);
        Sum(variable.0)
    }

    /// Sets the pressure of a port's node, or a signal output, to a variable. An open port ignores it.
    pub(crate) fn set(&mut self, port: &str, variable: Variable) {
        if let Some(node) = self.nodes[self.index(port)] {
            self.collected.roles[node.first.0 as usize] = Role::Alias(variable);
        }
    }

    /// Sets position and velocity (or angle and rate) of a port's node. An open port ignores it.
    pub(crate) fn set_motion(&mut self, port: &str, position: Variable, velocity: Variable) {
        if let Some(node) = self.nodes[self.index(port)] {
            self.collected.roles[node.first.0 as usize] = Role::Alias(position);
            self.collected.roles[node.second.0 as usize] = Role::Alias(velocity);
        }
    }

    /// Adds an equation block.
    pub(crate) fn equation<E, const I: usize, const O: usize, const C: usize>(
        &mut self,
        equation: E,
        inputs: [Variable; I],
        outputs: [Output; O],
    ) where
        E: Equation<I, O, C> + Listed,
    {
        self.equation_of(0, equation, inputs, outputs);
    }

    /// Adds one of several equation blocks of a kind. Its constants receive `which`.
    pub(crate) fn equation_of<E, const I: usize, const O: usize, const C: usize>(
        &mut self,
        which: usize,
        _: E,
        inputs: [Variable; I],
        outputs: [Output; O],
    ) where
        E: Equation<I, O, C> + Listed,
    {
        self.block::<E, I, O, C>(which, inputs, outputs, None);
    }

    /// Adds an equation block with one output and sets a signal output to it. Returns the signal.
    pub(crate) fn output<E, const I: usize, const C: usize>(
        &mut self,
        port: &str,
        equation: E,
        inputs: [Variable; I],
    ) -> Variable
    where
        E: Equation<I, 1, C> + Listed,
    {
        let signal = self.internal();
        self.equation(equation, inputs, [Output::add(signal)]);
        self.set(port, signal.variable());
        signal.variable()
    }

    /// Adds an equation block that reads only states and runs before all other blocks. The order of the others then
    /// does not depend on whether they read the states or the block's outputs.
    pub(crate) fn opening_equation<E, const I: usize, const O: usize, const C: usize>(
        &mut self,
        equation: E,
        inputs: [Variable; I],
        outputs: [Output; O],
    ) where
        E: Equation<I, O, C> + Listed,
    {
        self.equation(equation, inputs, outputs);
        self.collected.blocks.last_mut().expect("the block just added").is_opening = true;
    }

    /// Makes runs record `variable` when the user selects the state.
    pub(crate) fn show_state(&mut self, state: &str, variable: Variable) {
        self.collected.shown.push((self.state(state), variable));
    }

    /// Adds an equation block that runs once per period, given by the named parameter,
    /// and holds its outputs in between.
    ///
    /// `inputs` receives the held outputs, so that a block can read its own outputs of
    /// the previous tick (a filter, an integrator).
    pub(crate) fn sampled<E, const I: usize, const O: usize, const C: usize>(
        &mut self,
        _: E,
        period: &str,
        inputs: impl FnOnce(&mut Self, [Variable; O]) -> [Variable; I],
    ) -> [Variable; O]
    where
        E: Equation<I, O, C> + Listed,
    {
        let clock = Clock { component: self.component, period_s: self.structural(period) };
        let clocks = &mut self.collected.clocks;
        let index = clocks.iter().position(|c| c.period_s == clock.period_s).unwrap_or_else(|| {
            clocks.push(clock);
            clocks.len() - 1
        });
        let held = core::array::from_fn(|_| self.collected.variable(Role::Held));
        let inputs = inputs(self, held);
        // Blocks add to separate sums. These replace the held values after all
        // blocks of the tick have run.
        let outputs = held.map(|held| {
            let next = self.internal();
            self.collected.exchanges.push((index, next.variable(), held));
            Output::add(next)
        });
        self.block::<E, I, O, C>(0, inputs, outputs, Some(index));
        held
    }

    fn block<E, const I: usize, const O: usize, const C: usize>(
        &mut self,
        which: usize,
        inputs: [Variable; I],
        outputs: [Output; O],
        clock: Option<usize>,
    ) where
        E: Equation<I, O, C> + Listed,
    {
        self.collected.blocks.push(Block {
            kind: E::KIND,
            component: self.component,
            which,
            inputs: inputs.to_vec(),
            outputs: outputs.to_vec(),
            clock,
            is_opening: false,
        });
    }
}
