//! A compiled system: sequences of equation blocks over an array of variables, with the information that a run
//! needs about them.
//!
//! The array holds, in this order: states, external inputs, constants that
//! replace signals (parameters, temperatures, held values), sums, and the
//! derivatives of the states. The module `schedule` builds it from a network.

mod schedule;

pub use crate::lane_offset::Slot;

use crate::components::Constants;
use crate::equation::Given;
use crate::fluid::FluidState;
use crate::jacobian::SparseJacobian;
use crate::lu::SparseLu;
use crate::network::Network;
use crate::scalar::{Lanes, Scalar};
use crate::sequence::{Sequence, memory};
use crate::spec::{Start, Unit};
use crate::symbol::{Graph, Symbol, tangent};
use crate::wiring::Role;
use alloc::collections::BTreeSet;
use alloc::string::String;
use alloc::vec::Vec;
use core::ops::Range;

/// A quantity that a run can record.
#[derive(Clone, Debug, PartialEq)]
pub struct Observable {
    /// `component.state` or `component.port` (with the quantity for physical
    /// ports, e.g. `supply.port.flow_m3_s`).
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// Its slot in the variable array.
    pub slot: Slot,
}

/// A state of the whole system.
#[derive(Clone, Debug, PartialEq)]
pub struct StateOf {
    /// `component.state`.
    pub name: String,
    /// Index of the component.
    pub component: usize,
    /// Index of the state in the component's declaration.
    pub state: usize,
    /// The magnitude that errors are measured against.
    pub scale: f64,
    /// Permitted error per `scale` in a step, as a multiple of that of other states.
    pub error_weight: f64,
    /// Lower bound in the steady-state search.
    pub lowest: f64,
    /// The unit.
    pub unit: Unit,
}

/// A clock of sampled equations.
#[derive(Clone, Debug)]
pub(crate) struct Ticking {
    pub(crate) period_s: f64,
    pub(crate) sequence: Sequence,
    /// (slot of a new value, slot of the held value that it replaces).
    pub(crate) exchanges: Vec<(Slot, Slot)>,
}

/// A compiled system.
pub struct Program {
    network: Network,
    identity: u64,
    circuits: Vec<usize>,
    states: Vec<StateOf>,
    observables: Vec<Observable>,
    /// The roles of the stand-in slots: parameters, temperatures and held values.
    stand_ins: Vec<Role>,
    slots: usize,
    sums: Range<usize>,
    /// The equations that the derivatives depend on.
    motion: Sequence,
    /// The equations that only observables depend on: measured values, flows through
    /// ports that set a pressure.
    readings: Sequence,
    clocks: Vec<Ticking>,
    constants: usize,
    jacobian: SparseJacobian,
    lu: SparseLu,
}

impl Program {
    /// The system it was compiled from.
    pub fn network(&self) -> &Network {
        &self.network
    }
    /// `Network::identity` of the network it was compiled from.
    pub fn identity(&self) -> u64 {
        self.identity
    }
    /// The states, in the order of the variable array.
    pub fn states(&self) -> &[StateOf] {
        &self.states
    }
    /// Everything that a run can record.
    pub fn observables(&self) -> &[Observable] {
        &self.observables
    }
    /// Finds an observable by name.
    pub fn observable(&self, name: &str) -> Option<&Observable> {
        self.observables.iter().find(|o| o.name == name)
    }
    /// The component that determines the fluid of a component's circuit: the first source or tank of the circuit, or
    /// the component itself if it has no fluid.
    pub fn fluid_source(&self, component: usize) -> usize {
        self.circuits[component]
    }
    /// Number of variables.
    pub fn slots(&self) -> usize {
        self.slots
    }
    /// Length of the variable array: the variables, one slot for outputs without a target,
    /// and one for the zero that sums begin with. Fill it with zeros before the first use.
    pub fn memory(&self) -> usize {
        memory(self.slots)
    }
    /// Number of constants.
    pub fn constants(&self) -> usize {
        self.constants
    }
    /// Number of equation blocks that run continuously.
    pub fn blocks(&self) -> usize {
        self.motion.blocks.len() + self.readings.blocks.len()
    }
    /// The slots of the external inputs.
    pub fn externals(&self) -> Range<usize> {
        let n = self.states.len();
        n..n + self.network.inputs.len()
    }
    /// The slots of parameters, temperatures and held values.
    pub fn stand_ins(&self) -> Range<usize> {
        self.externals().end..self.sums.start
    }
    /// Whether a clock holds this stand-in, which then depends on the run and not on the variant.
    pub fn is_held(&self, stand_in: usize) -> bool {
        matches!(self.stand_ins[stand_in], Role::Held)
    }
    /// The slots that an evaluation fills.
    pub(crate) fn sums(&self) -> Range<usize> {
        self.sums.clone()
    }
    /// The slots of the derivatives of the states.
    pub fn derivatives(&self) -> Range<usize> {
        self.sums.end - self.states.len()..self.sums.end
    }
    /// The periods of the clocks, s.
    pub fn clock_periods_s(&self) -> impl Iterator<Item = f64> + '_ {
        self.clocks.iter().map(|c| c.period_s)
    }
    /// The factorization of `I/(γh) − J`.
    pub fn lu(&self) -> &SparseLu {
        &self.lu
    }
    /// The sparsity of the Jacobian and the layout of the gradients.
    pub fn jacobian(&self) -> &SparseJacobian {
        &self.jacobian
    }
    pub(crate) fn clocks(&self) -> &[Ticking] {
        &self.clocks
    }
    /// Evaluates all continuous equations: computes the sums and the derivatives
    /// from the states, inputs and stand-ins in `variables`, which has the length
    /// [`Program::memory`].
    pub fn evaluate<V: Lanes>(&self, constants: &[V], variables: &mut [V]) {
        self.motion.run(constants, variables);
        self.readings.run(constants, variables);
    }

    /// [`Program::evaluate`] with symbols.
    pub(crate) fn trace<'g>(&self, constants: &[Symbol<'g>], variables: &mut [Symbol<'g>]) {
        self.motion.trace(constants, variables);
        self.readings.trace(constants, variables);
    }

    /// For each slot, the states and inputs that it depends on, by their slots. Values held by clocks are none of them.
    pub fn dependencies(&self) -> Vec<BTreeSet<usize>> {
        let graph = Graph::new();
        let constants: Vec<Symbol> =
            (0..self.constants).map(|place| graph.variable("constants", place)).collect();
        let given = self.stand_ins().end;
        let known = |place| graph.variable("variables", place);
        let mut variables: Vec<Symbol> = (0..given).map(known).collect();
        variables.resize(self.memory(), Symbol::Constant(0.0));
        self.trace(&constants, &mut variables);
        tangent::dependencies(&graph, &variables[..self.slots], |array, place| {
            let is_known = array == "variables" && (place as usize) < self.externals().end;
            is_known.then_some(place as usize)
        })
    }

    /// The equations that the derivatives depend on.
    pub(crate) fn motion(&self) -> &Sequence {
        &self.motion
    }

    /// [`Program::evaluate`] with the gradients of all sums. [`Program::jacobian`]
    /// describes the layout of the Jacobian and the time derivatives in `gradients`.
    pub fn evaluate_with_jacobian<V: Lanes>(
        &self,
        constants: &[V],
        variables: &mut [V],
        gradients: &mut [V],
    ) {
        let partials = self.jacobian.partials(gradients);
        self.motion.differentiate(constants, variables, partials);
        self.jacobian.chain(gradients);
        self.readings.run(constants, variables);
    }

    /// [`Program::evaluate_with_jacobian`] with symbols.
    pub(crate) fn trace_with_jacobian<'g>(
        &self,
        constants: &[Symbol<'g>],
        variables: &mut [Symbol<'g>],
        gradients: &mut [Symbol<'g>],
    ) {
        let partials = self.jacobian.partials(gradients);
        self.motion.trace_with_partials(constants, variables, partials);
        self.jacobian.multiply(gradients);
        self.readings.trace(constants, variables);
    }

    /// Adds the derivatives and `slope_factor · ∂f/∂t` to the right-hand side of a stage, then solves in place.
    #[inline(always)]
    pub(crate) fn solve_stage<V: Scalar<Base = V>>(
        &self,
        derivatives: &[V],
        slope_factor: V,
        gradients: &[V],
        factors: &[V],
        right: &mut [V],
    ) {
        for (r, &derivative) in right.iter_mut().zip(derivatives) {
            *r = *r + derivative;
        }
        self.jacobian.add_time_derivative(slope_factor, gradients, right);
        self.lu.solve(factors, right);
    }

    /// The effective parameters of a variant by component: the
    /// declared values with the faults applied.
    pub fn parameters(&self, faults: &[FaultAt]) -> Vec<Vec<f64>> {
        self.parameters_with(&[], faults)
    }

    /// [`Program::parameters`] with other values for some parameters before
    /// the faults act: (component, parameter, value).
    pub fn parameters_with(
        &self,
        overrides: &[(usize, usize, f64)],
        faults: &[FaultAt],
    ) -> Vec<Vec<f64>> {
        let components = &self.network.components;
        let mut all: Vec<Vec<f64>> = components.iter().map(|c| c.parameters.clone()).collect();
        for &(component, parameter, value) in overrides {
            all[component][parameter] = value;
        }
        for fault in faults {
            self.apply_fault(&mut all, (fault.component, fault.fault), fault.intensity);
        }
        all
    }

    /// Applies a fault (component, fault) to parameters by component.
    fn apply_fault<S: Scalar<Base = S>>(
        &self,
        parameters: &mut [Vec<S>],
        (component, fault): (usize, usize),
        intensity: S,
    ) {
        let instance = &self.network.components[component];
        let spec = instance.component;
        let declared = &spec.faults[fault];
        let parameter = spec.parameter(declared.parameter).expect("checked by the contract");
        let value = &mut parameters[component][parameter];
        *value = declared.law.apply(*value, intensity, instance.fault_full[fault]);
    }

    /// Every fault of every component, in the order of the components: (component, fault).
    pub fn faults(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let components = self.network.components.iter().enumerate();
        components.flat_map(|(index, instance)| {
            (0..instance.component.faults.len()).map(move |fault| (index, fault))
        })
    }

    /// Applies all of [`Program::faults`] to parameters by component.
    pub(crate) fn apply_faults<S: Scalar<Base = S>>(
        &self,
        parameters: &mut [Vec<S>],
        mut intensity: impl FnMut((usize, usize)) -> S,
    ) {
        for fault in self.faults() {
            self.apply_fault(parameters, fault, intensity(fault));
        }
    }

    /// The fluid of every component's circuit.
    pub(crate) fn fluids<S: Scalar<Base = S>>(&self, parameters: &[Vec<S>]) -> Vec<FluidState<S>> {
        let ruled = self.circuits.iter().map(|&ruler| {
            let instance = &self.network.components[ruler];
            let value = |name: &str, otherwise: f64| {
                let place = instance.component.parameter(name);
                place.map_or(S::constant(otherwise), |place| parameters[ruler][place])
            };
            let fluid = instance.fluid.at(value("temperature_k", 313.15));
            fluid.deviating([value("bulk_modulus_factor", 1.0), value("air_factor", 1.0)])
        });
        ruled.collect()
    }

    /// The constants of all blocks for effective parameters; those of clocks are last.
    pub fn block_constants<S: Scalar<Base = S>>(&self, parameters: &[Vec<S>]) -> Vec<S> {
        let fluids = self.fluids(parameters);
        let mut constants = Vec::with_capacity(self.constants);
        let sampled = self.clocks.iter().map(|c| &c.sequence);
        for sequence in [&self.motion, &self.readings].into_iter().chain(sampled) {
            for block in &sequence.blocks {
                let given = Given {
                    parameters: &parameters[block.component],
                    fluid: &fluids[block.component],
                    which: block.which,
                };
                constants.extend(block.equation().visit(Constants(&given)));
            }
        }
        constants
    }

    /// The values of parameters and temperatures that replace signals, and
    /// zero for held values.
    pub fn stand_in_values<S: Scalar<Base = S>>(&self, parameters: &[Vec<S>]) -> Vec<S> {
        let fluids = self.fluids(parameters);
        let value = |role: &Role| match *role {
            Role::Parameter { component, parameter } => parameters[component][parameter],
            Role::Temperature { component } => fluids[component].temperature_k,
            _ => S::constant(0.0),
        };
        self.stand_ins.iter().map(value).collect()
    }

    /// The initial guess of the states for the steady-state search.
    pub fn first_guess(&self, parameters: &[Vec<f64>]) -> Vec<f64> {
        let guess = |state: &StateOf| {
            let spec = self.network.components[state.component].component;
            match spec.states[state.state].start {
                Start::Value(value) => value,
                Start::Parameter(name) => {
                    let index = spec.parameter(name).expect("checked by the contract");
                    parameters[state.component][index]
                }
            }
        };
        self.states.iter().map(guess).collect()
    }

    /// Finds a fault by `component.fault`; returns the indices of both.
    pub fn find_fault(&self, id: &str) -> Option<(usize, usize)> {
        let (component, fault) = id.rsplit_once('.')?;
        let index = self.network.components.iter().position(|c| c.id == component)?;
        let fault = self.network.components[index].component.fault(fault)?;
        Some((index, fault))
    }
}

/// A fault with its intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultAt {
    /// Index of the component.
    pub component: usize,
    /// Index of the fault in the component's declaration.
    pub fault: usize,
    /// From 0 (healthy) to 1.
    pub intensity: f64,
}
