//! A compiled system: a flat list of equation blocks over an array of
//! variables.
//!
//! The array holds, in this order: states, external inputs, constants that
//! stand in for signals (parameters, temperatures, held values), sums, and the
//! derivatives of the states. Blocks are sorted by what they need, then grouped
//! by kind, so that a whole group runs without a branch.

use crate::components::{BlockKind, Constants, Visitor};
use crate::dual::{Dual, Partial};
use crate::equation::{Equation, Given};
use crate::fluid::FluidState;
use crate::jacobian::Rows;
use crate::lu::Plan;
use crate::network::{Mistake, Network, PortOf};
use crate::place::Place;
use crate::scalar::{Lanes, Scalar, Work};
use crate::spec::{PortKind, Start, Unit};
use crate::symbol::Symbol;
use crate::wiring::{Block, Collected, Role, Variable};
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::marker::PhantomData;
use core::ops::Range;

/// A place in the variable array.
pub type Slot = u16;

/// Blocks of one kind that can run in any order among themselves.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub kind: BlockKind,
    /// Whether any output is subtracted somewhere. Most groups only add.
    pub subtracts: bool,
    /// Whether any output joins a sum that has been begun. Most sums have one
    /// term.
    pub joins: bool,
    pub count: usize,
    /// Where the group's lists begin.
    pub inputs: usize,
    pub outputs: usize,
    pub constants: usize,
}

/// Where an output of a block goes; what is not used is the bin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target {
    /// The sum that it is added to, and where the sum so far stands: in the same
    /// slot, or in the one that is always zero for the sum's first block. So
    /// sums need not be cleared.
    pub add: Place,
    pub add_so_far: Place,
    /// The sum that it is subtracted from, likewise.
    pub subtract: Place,
    pub subtract_so_far: Place,
}

/// Blocks in the order of their evaluation.
#[derive(Clone, Debug)]
pub(crate) struct Sequence {
    pub groups: Vec<Group>,
    pub inputs: Vec<Place>,
    pub outputs: Vec<Target>,
    /// The blocks themselves, in order: for constants and for the Jacobian.
    pub blocks: Vec<Block>,
    /// Length of the variable array.
    memory: usize,
    /// How many constants its blocks and those of earlier sequences hold.
    constants: usize,
}

/// Something a run can record.
#[derive(Clone, Debug, PartialEq)]
pub struct Observable {
    /// `component.state` or `component.port` (with the quantity for physical
    /// ports, e.g. `supply.port.flow_m3_s`).
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// Its place in the variable array.
    pub slot: Slot,
}

/// A state of the whole system.
#[derive(Clone, Debug, PartialEq)]
pub struct StateOf {
    /// `component.state`.
    pub name: String,
    /// The component.
    pub component: usize,
    /// The state in its declaration.
    pub state: usize,
    /// The size that errors are measured against.
    pub scale: f64,
    /// The search for the steady state does not go below.
    pub lowest: f64,
    /// The unit.
    pub unit: Unit,
}

/// A clock of sampled equations.
#[derive(Clone, Debug)]
pub(crate) struct Ticking {
    pub period_s: f64,
    pub sequence: Sequence,
    /// (slot of a new value, slot of the held value that it replaces).
    pub exchanges: Vec<(Slot, Slot)>,
}

/// A compiled system.
pub struct Program {
    network: Network,
    circuits: Vec<usize>,
    states: Vec<StateOf>,
    observables: Vec<Observable>,
    /// What stands in the slots of parameters, temperatures and held values.
    stand_ins: Vec<Role>,
    slots: usize,
    sums: Range<usize>,
    /// What the derivatives depend on.
    motion: Sequence,
    /// What only readers from outside want: measured values, flows through
    /// ports that set a pressure.
    readings: Sequence,
    clocks: Vec<Ticking>,
    constants: usize,
    rows: Rows,
    plan: Plan,
}

impl Program {
    /// The system it was compiled from.
    pub fn network(&self) -> &Network {
        &self.network
    }
    /// The states, in the order of the variable array.
    pub fn states(&self) -> &[StateOf] {
        &self.states
    }
    /// Everything that a run can record.
    pub fn observables(&self) -> &[Observable] {
        &self.observables
    }
    /// Something to record, by name.
    pub fn observable(&self, name: &str) -> Option<&Observable> {
        self.observables.iter().find(|o| o.name == name)
    }
    /// Number of variables.
    pub fn slots(&self) -> usize {
        self.slots
    }
    /// Length of the variable array: one more for outputs that go nowhere, and
    /// one that is always zero. To be filled with zeros at first.
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
    /// Where the external inputs stand.
    pub fn externals(&self) -> Range<usize> {
        let n = self.states.len();
        n..n + self.network.inputs.len()
    }
    /// Where parameters, temperatures and held values stand.
    pub(crate) fn stand_ins(&self) -> Range<usize> {
        self.externals().end..self.sums.start
    }
    /// Which of the stand-ins clocks hold: what they are is the run's, not the variant's.
    pub(crate) fn is_held(&self, stand_in: usize) -> bool {
        matches!(self.stand_ins[stand_in], Role::Held)
    }
    /// Where the derivatives of the states stand.
    pub fn derivatives(&self) -> Range<usize> {
        self.sums.end - self.states.len()..self.sums.end
    }
    /// The periods of the clocks, s.
    pub fn clock_periods_s(&self) -> impl Iterator<Item = f64> + '_ {
        self.clocks.iter().map(|c| c.period_s)
    }
    /// The elimination plan of `I/(γh) − J`.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }
    /// The sparsity of the Jacobian and where gradients are kept.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }
    pub(crate) fn clocks(&self) -> &[Ticking] {
        &self.clocks
    }
    /// Evaluates all continuous equations: fills the sums and the derivatives
    /// from the states, inputs and stand-ins in `variables`, which are
    /// [`Program::memory`] long.
    pub fn evaluate<V: Lanes>(&self, constants: &[V], variables: &mut [V]) {
        self.motion.run(constants, variables);
        self.readings.run(constants, variables);
    }

    /// As [`Program::evaluate`], with symbols.
    pub(crate) fn trace<'g>(&self, constants: &[Symbol<'g>], variables: &mut [Symbol<'g>]) {
        self.motion.trace(constants, variables);
        self.readings.trace(constants, variables);
    }

    /// The equations that the derivatives depend on.
    pub(crate) fn motion(&self) -> &Sequence {
        &self.motion
    }

    /// As [`Program::evaluate`], and the gradients of all sums: the Jacobian
    /// and the time derivatives stand in `gradients` where [`Program::rows`]
    /// says.
    pub fn evaluate_with_jacobian<V: Lanes>(
        &self,
        constants: &[V],
        variables: &mut [V],
        gradients: &mut [V],
    ) {
        assert!(variables.len() >= self.memory() && constants.len() >= self.motion.constants);
        let mut partials = self.rows.partials(gradients);
        for group in &self.motion.groups {
            let count = group.count * group.kind.visit(Partials);
            let (own, later) = partials.split_at_mut(count);
            partials = later;
            let (sequence, variables) = (&self.motion, &mut *variables);
            let evaluate = Evaluate { group, sequence, constants, variables };
            group.kind.visit(Differentiate { evaluate, partials: own });
        }
        self.rows.chain(gradients);
        self.readings.run(constants, variables);
    }

    /// The effective parameters of a variant, component by component: the
    /// declared values with the faults applied.
    pub fn parameters(&self, faults: &[FaultAt]) -> Vec<Vec<f64>> {
        self.parameters_with(&[], faults)
    }

    /// As [`Program::parameters`], with other values for some parameters before
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
            let instance = &components[fault.component];
            let spec = instance.component.spec();
            let declared = &spec.faults[fault.fault];
            let parameter = spec.parameter(declared.parameter).expect("checked by the contract");
            let value = &mut all[fault.component][parameter];
            *value = declared.law.apply(*value, fault.intensity, instance.fault_full[fault.fault]);
        }
        all
    }

    /// The fluid of every component's circuit.
    pub(crate) fn fluids<S: Scalar<Base = S>>(&self, parameters: &[Vec<S>]) -> Vec<FluidState<S>> {
        let ruled = self.circuits.iter().map(|&ruler| {
            let instance = &self.network.components[ruler];
            let temperature = instance.component.spec().parameter("temperature_k");
            let kelvin = temperature.map_or(S::constant(313.15), |t| parameters[ruler][t]);
            instance.fluid.at(kelvin)
        });
        ruled.collect()
    }

    /// The constants of all blocks, those of clocks last, for effective
    /// parameters.
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
                constants.extend(block.kind.visit(Constants(&given)));
            }
        }
        constants
    }

    /// The values of parameters and temperatures that stand in for signals, and
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

    /// The first guess of the states for the steady-state search.
    pub fn first_guess(&self, parameters: &[Vec<f64>]) -> Vec<f64> {
        let guess = |state: &StateOf| {
            let spec = self.network.components[state.component].component.spec();
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

    /// Finds a fault by `component.fault`.
    pub fn find_fault(&self, id: &str) -> Option<(usize, usize)> {
        let (component, fault) = id.rsplit_once('.')?;
        let index = self.network.components.iter().position(|c| c.id == component)?;
        let fault = self.network.components[index].component.spec().fault(fault)?;
        Some((index, fault))
    }
}

/// A fault with its intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultAt {
    /// The component.
    pub component: usize,
    /// The fault in its declaration.
    pub fault: usize,
    /// 0 healthy … 1.
    pub intensity: f64,
}

/// Length of the variable array for so many variables.
const fn memory(slots: usize) -> usize {
    slots + 2
}

impl Sequence {
    /// Lists blocks that run in this order over `slots` variables; `slot_of`
    /// places the blocks' variables, `written` knows the sums that earlier
    /// sequences have begun, `constants` counts.
    fn new(
        blocks: Vec<Block>,
        slots: usize,
        slot_of: &[Slot],
        written: &mut [bool],
        constants: &mut usize,
    ) -> Self {
        let mut sequence = Self {
            groups: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            blocks: Vec::new(),
            memory: memory(slots),
            constants: 0,
        };
        for block in blocks {
            sequence.push(block, slot_of, written, constants);
        }
        sequence.constants = *constants;
        sequence
    }

    /// Runs all blocks once.
    pub fn run<V: Lanes>(&self, constants: &[V], variables: &mut [V]) {
        assert!(variables.len() >= self.memory && constants.len() >= self.constants);
        for group in &self.groups {
            group.kind.visit(Evaluate { group, sequence: self, constants, variables });
        }
    }

    /// As [`Sequence::run`], with symbols.
    pub fn trace<'g>(&self, constants: &[Symbol<'g>], variables: &mut [Symbol<'g>]) {
        assert!(variables.len() >= self.memory && constants.len() >= self.constants);
        for group in &self.groups {
            group.kind.visit(Trace(Evaluate { group, sequence: self, constants, variables }));
        }
    }

    /// The blocks with the places of their inputs and outputs.
    pub fn wired(&self) -> impl Iterator<Item = (&Block, &[Place], &[Target])> {
        let (mut inputs, mut outputs) = (self.inputs.as_slice(), self.outputs.as_slice());
        self.blocks.iter().map(move |block| {
            let (own_inputs, later_inputs) = inputs.split_at(block.inputs.len());
            let (own_outputs, later_outputs) = outputs.split_at(block.outputs.len());
            (inputs, outputs) = (later_inputs, later_outputs);
            (block, own_inputs, own_outputs)
        })
    }

    fn push(
        &mut self,
        block: Block,
        slot_of: &[Slot],
        written: &mut [bool],
        constants: &mut usize,
    ) {
        let (inputs, outputs, held) = block.kind.visit(Dimensions);
        // What `lists` relies on, with the place of every variable below.
        assert_eq!((block.inputs.len(), block.outputs.len()), (inputs, outputs));
        let subtracts = block.subtracts();
        let fits = |g: &Group| (g.kind, g.subtracts) == (block.kind, subtracts);
        let new_group = !self.groups.last().is_some_and(fits);
        if new_group {
            self.groups.push(Group {
                kind: block.kind,
                subtracts,
                joins: false,
                count: 0,
                inputs: self.inputs.len(),
                outputs: self.outputs.len(),
                constants: *constants,
            });
        }
        let group = self.groups.last_mut().expect("just pushed");
        group.count += 1;
        *constants += held;
        let (bin, zero) = ((self.memory - 2) as Slot, (self.memory - 1) as Slot);
        for input in &block.inputs {
            let slot = slot_of[input.0 as usize];
            assert!(slot < bin, "a component has left a port unset");
            self.inputs.push(Place::new(slot));
        }
        let mut place = |sum: Option<crate::wiring::Sum>| {
            let Some(sum) = sum else { return (bin, zero) };
            let slot = slot_of[sum.0 as usize];
            let begun = core::mem::replace(&mut written[slot as usize], true);
            group.joins |= begun;
            (slot, if begun { slot } else { zero })
        };
        for output in &block.outputs {
            let (add, add_so_far) = place(output.add);
            let (subtract, subtract_so_far) = place(output.subtract);
            self.outputs.push(Target {
                add: Place::new(add),
                add_so_far: Place::new(add_so_far),
                subtract: Place::new(subtract),
                subtract_so_far: Place::new(subtract_so_far),
            });
        }
        self.blocks.push(block);
    }
}

/// The numbers of inputs, outputs and constants of a block.
pub(crate) struct Dimensions;

impl Visitor for Dimensions {
    type Output = (usize, usize, usize);
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> Self::Output
    where
        E: Equation<I, O, C>,
    {
        (I, O, C)
    }
}

/// How the outputs of a block depend on its inputs, whatever their values are (the
/// numbers mean nothing): by output, then input.
pub(crate) struct Dependence;

impl Visitor for Dependence {
    type Output = Vec<Partial<f64>>;
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> Self::Output
    where
        E: Equation<I, O, C>,
    {
        let inputs = core::array::from_fn(|i| Dual::<f64, I>::input(1.0, i));
        let outputs = E::evaluate(&[1.0; C], inputs);
        outputs.iter().flat_map(|o| o.partials).collect()
    }
}

/// Runs a group of blocks.
struct Evaluate<'a, V> {
    group: &'a Group,
    sequence: &'a Sequence,
    constants: &'a [V],
    variables: &'a mut [V],
}

/// The lists of a group: what each of its blocks reads, writes and holds.
///
/// # Safety
/// The group must be one of the sequence's, `I`, `O` and `C` those of its kind, and
/// there must be as many constants as [`Sequence::run`] asserts.
#[inline(always)]
unsafe fn lists<'a, V, const I: usize, const O: usize, const C: usize>(
    group: &Group,
    sequence: &'a Sequence,
    constants: &'a [V],
) -> impl Iterator<Item = (&'a [Place; I], &'a [Target; O], &'a [V; C])> {
    // SAFETY: `Sequence::push` extends the lists with every block of a group.
    let (inputs, outputs, constants) = unsafe {
        (
            arrays(&sequence.inputs, group.inputs, group.count),
            arrays(&sequence.outputs, group.outputs, group.count),
            arrays(constants, group.constants, group.count),
        )
    };
    let blocks = inputs.iter().zip(outputs).zip(constants);
    blocks.map(|((inputs, outputs), constants)| (inputs, outputs, constants))
}

/// `count` arrays of a slice, from `first` on.
///
/// # Safety
/// The slice must have them. It is not checked: a step asks some hundred times.
#[inline(always)]
unsafe fn arrays<T, const N: usize>(slice: &[T], first: usize, count: usize) -> &[[T; N]] {
    debug_assert!(first + count * N <= slice.len());
    // SAFETY: promised by the caller.
    unsafe { core::slice::from_raw_parts(slice.as_ptr().add(first).cast(), count) }
}

impl<V: Lanes> Visitor for Evaluate<'_, V> {
    type Output = ();
    fn visit<E, const I: usize, const O: usize, const C: usize>(self)
    where
        E: Equation<I, O, C>,
    {
        V::outline(OfKind::<_, E, I, O, C>(self, PhantomData));
    }
}

/// The same with symbols.
struct Trace<'a, 'g>(Evaluate<'a, Symbol<'g>>);

impl Visitor for Trace<'_, '_> {
    type Output = ();
    #[inline(never)]
    fn visit<E, const I: usize, const O: usize, const C: usize>(self)
    where
        E: Equation<I, O, C>,
    {
        OfKind::<_, E, I, O, C>(self.0, PhantomData).evaluate();
    }
}

/// What is done with a group whose blocks are of one kind, in a function of its own:
/// all kinds in one would take the compiler minutes.
struct OfKind<T, E, const I: usize, const O: usize, const C: usize>(T, PhantomData<E>);

impl<V: Lanes, E: Equation<I, O, C>, const I: usize, const O: usize, const C: usize> Work<V>
    for OfKind<Evaluate<'_, V>, E, I, O, C>
{
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.evaluate();
    }
}

impl<V, E, const I: usize, const O: usize, const C: usize> OfKind<Evaluate<'_, V>, E, I, O, C>
where
    V: Scalar<Base = V>,
    E: Equation<I, O, C>,
{
    #[inline(always)]
    fn evaluate(self) {
        let Evaluate { group, sequence, constants, variables } = self.0;
        // SAFETY: `Sequence::run` asserts the constants.
        let blocks = unsafe { lists::<V, I, O, C>(group, sequence, constants) };
        for (inputs, outputs, constants) in blocks {
            let mut values = [V::constant(0.0); I];
            for (value, &input) in values.iter_mut().zip(inputs) {
                // SAFETY: all slots of a sequence are below the length that its
                // caller asserts.
                *value = unsafe { input.read(variables) };
            }
            let results = E::evaluate::<V>(constants, values);
            let first = variables.as_mut_ptr();
            // SAFETY: as above.
            let at = |place: Place| unsafe { place.among(first) };
            // SAFETY: as above.
            unsafe { scatter(group, outputs, &results, at) };
        }
    }
}

/// Adds a block's outputs to their sums, which stand `at(place)`.
///
/// # Safety
/// There must be a number at all places.
#[inline(always)]
unsafe fn scatter<V: Scalar<Base = V>, const O: usize>(
    group: &Group,
    outputs: &[Target; O],
    results: &[V; O],
    at: impl Fn(Place) -> *mut V,
) {
    for (target, &result) in outputs.iter().zip(results) {
        // SAFETY: promised by the caller.
        unsafe {
            if group.subtracts {
                *at(target.add) = *at(target.add_so_far) + result;
                *at(target.subtract) = *at(target.subtract_so_far) - result;
            } else if group.joins {
                *at(target.add) = *at(target.add_so_far) + result;
            } else {
                *at(target.add) = result;
            }
        }
    }
}

/// As [`Evaluate`], with the partial derivatives.
struct Differentiate<'a, V> {
    evaluate: Evaluate<'a, V>,
    /// Places for the group's partial derivatives.
    partials: &'a mut [V],
}

/// How many partial derivatives a block has.
struct Partials;

impl Visitor for Partials {
    type Output = usize;
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> usize
    where
        E: Equation<I, O, C>,
    {
        I * O
    }
}

impl<V: Lanes> Visitor for Differentiate<'_, V> {
    type Output = ();
    fn visit<E, const I: usize, const O: usize, const C: usize>(self)
    where
        E: Equation<I, O, C>,
    {
        V::outline(OfKind::<_, E, I, O, C>(self, PhantomData));
    }
}

impl<V: Lanes, E: Equation<I, O, C>, const I: usize, const O: usize, const C: usize> Work<V>
    for OfKind<Differentiate<'_, V>, E, I, O, C>
{
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Differentiate { evaluate, partials } = self.0;
        let Evaluate { group, sequence, constants, variables } = evaluate;
        assert!(partials.len() >= group.count * I * O);
        let mut own = partials.as_mut_ptr().cast::<V::Register>();
        // SAFETY: `Program::evaluate_with_jacobian` asserts the constants.
        let blocks = unsafe { lists::<V, I, O, C>(group, sequence, constants) };
        for (inputs, outputs, constants) in blocks {
            let all_held = constants.as_ptr().cast::<V::Register>();
            let first = variables.as_mut_ptr();
            for register in 0..V::REGISTERS {
                // SAFETY: a slot's registers stand one after the other, and all slots
                // of a sequence are below the length that its caller asserts.
                let at = |place: Place| unsafe {
                    place.among(first).cast::<V::Register>().add(register)
                };
                let place = |index: usize| index * V::REGISTERS + register;
                let mut held = [V::Register::constant(0.0); C];
                for (c, held) in held.iter_mut().enumerate() {
                    // SAFETY: there are `C` constants.
                    *held = unsafe { *all_held.add(place(c)) };
                }
                let mut values = [Dual::from_base(V::Register::constant(0.0)); I];
                for (i, (value, &input)) in values.iter_mut().zip(inputs).enumerate() {
                    // SAFETY: as above.
                    *value = Dual::input(unsafe { *at(input) }, i);
                }
                let results = E::evaluate::<Dual<V::Register, I>>(&held, values);
                let mut plain = [V::Register::constant(0.0); O];
                for (o, result) in results.iter().enumerate() {
                    plain[o] = result.value;
                    for (i, &partial) in result.partials.iter().enumerate() {
                        // No term reads the place of a zero or a one (`Rows::list_terms`).
                        if let Partial::Number(number) = partial {
                            // SAFETY: `own` has `I · O` slots for every block.
                            unsafe { *own.add(place(o * I + i)) = number };
                        }
                    }
                }
                // SAFETY: as above.
                unsafe { scatter(group, outputs, &plain, at) };
            }
            // SAFETY: as above.
            own = unsafe { own.add(I * O * V::REGISTERS) };
        }
    }
}

/// Orders the blocks and lays out the variables.
pub(crate) fn schedule(
    network: &Network,
    mut collected: Collected,
    circuits: Vec<usize>,
) -> Result<Program, Vec<Mistake>> {
    resolve_aliases(&mut collected);
    let layout = Layout::new(network, &collected);
    if layout.states == 0 {
        return Err(vec![Mistake::Empty]);
    }
    if layout.slots >= Slot::MAX as usize {
        return Err(vec![Mistake::TooLarge]);
    }
    let blocks = core::mem::take(&mut collected.blocks);
    let (sampled, continuous): (Vec<Block>, Vec<Block>) =
        blocks.into_iter().partition(|b| b.clock.is_some());
    let continuous = in_order(continuous, &collected)?;
    let (motion, readings, needed) = parted(continuous, &layout);
    let mut constants = 0;
    let mut written = vec![false; layout.slots];
    let mut sequence = |blocks, written: &mut [bool]| {
        Sequence::new(blocks, layout.slots, &layout.slot_of, written, &mut constants)
    };
    let motion = sequence(motion, &mut written);
    let readings = sequence(readings, &mut written);
    let mut clocks = Vec::with_capacity(collected.clocks.len());
    for (clock, declared) in collected.clocks.iter().enumerate() {
        let own = |block: &&Block| block.clock == Some(clock);
        let blocks = sampled.iter().filter(own).cloned().collect();
        clocks.push(Ticking {
            period_s: declared.period_s,
            sequence: sequence(blocks, &mut vec![false; layout.slots]),
            exchanges: Vec::new(),
        });
    }
    for &(clock, from, to) in &collected.exchanges {
        let slot = |v: Variable| layout.slot_of[v.0 as usize];
        clocks[clock].exchanges.push((slot(from), slot(to)));
    }
    let sums = layout.sums.clone();
    let inputs = network.inputs.len();
    let rows = Rows::new(&motion, layout.states, inputs, sums.clone(), &needed);
    let plan = rows.plan().ok_or_else(|| vec![Mistake::TooLarge])?;
    Ok(Program {
        states: layout.list_states(network, &collected),
        observables: observables(network, &collected, &layout),
        stand_ins: layout.stand_ins,
        slots: layout.slots,
        sums,
        motion,
        readings,
        clocks,
        constants,
        rows,
        plan,
        circuits,
        network: network.clone(),
    })
}

/// Parts ordered blocks into those that the derivatives depend on and the rest;
/// with the sums that the derivatives depend on, themselves included.
fn parted(blocks: Vec<Block>, layout: &Layout) -> (Vec<Block>, Vec<Block>, BTreeSet<usize>) {
    let sums = &layout.sums;
    let mut needed: BTreeSet<usize> = (sums.end - layout.states..sums.end).collect();
    let slot = |variable: u32| layout.slot_of[variable as usize] as usize;
    let (mut motion, mut readings) = (Vec::new(), Vec::new());
    for block in blocks.into_iter().rev() {
        let mut ends = block.outputs.iter().flat_map(|o| [o.add, o.subtract]).flatten();
        if ends.any(|sum| needed.contains(&slot(sum.0))) {
            let inputs = block.inputs.iter().map(|input| slot(input.0));
            needed.extend(inputs.filter(|input| sums.contains(input)));
            motion.push(block);
        } else {
            readings.push(block);
        }
    }
    motion.reverse();
    readings.reverse();
    (motion, readings, needed)
}

/// Replaces aliases in all blocks.
fn resolve_aliases(collected: &mut Collected) {
    let mut blocks = core::mem::take(&mut collected.blocks);
    for block in &mut blocks {
        for input in &mut block.inputs {
            *input = collected.resolve(*input);
        }
    }
    collected.blocks = blocks;
}

/// Where each variable stands.
struct Layout {
    states: usize,
    slots: usize,
    sums: Range<usize>,
    stand_ins: Vec<Role>,
    /// By variable.
    slot_of: Vec<Slot>,
}

impl Layout {
    fn new(network: &Network, collected: &Collected) -> Self {
        let roles = &collected.roles;
        let states = roles.iter().filter(|r| matches!(r, Role::State { .. })).count();
        let mut slot_of = vec![Slot::MAX; roles.len()];
        let mut stand_ins = Vec::new();
        let externals = network.inputs.len();
        let mut next = states + externals;
        let mut assign = |wanted: &dyn Fn(Role) -> bool, next: &mut usize| {
            for (variable, &role) in roles.iter().enumerate() {
                if wanted(role) {
                    slot_of[variable] = (*next).min(Slot::MAX as usize) as Slot;
                    *next += 1;
                }
            }
        };
        assign(&|r| matches!(r, Role::State { .. }), &mut 0);
        let stands_in =
            |r| matches!(r, Role::Parameter { .. } | Role::Temperature { .. } | Role::Held);
        assign(&stands_in, &mut next);
        stand_ins.extend(roles.iter().copied().filter(|&r| stands_in(r)));
        let first_sum = next;
        assign(&|r| matches!(r, Role::Sum), &mut next);
        assign(&|r| matches!(r, Role::Derivative { .. }), &mut next);
        for (variable, &role) in roles.iter().enumerate() {
            if let Role::External(input) = role {
                slot_of[variable] = (states + input) as Slot;
            }
        }
        for variable in 0..roles.len() {
            if let Role::Alias(_) = roles[variable] {
                let target = collected.resolve(Variable(variable as u32));
                slot_of[variable] = slot_of[target.0 as usize];
            }
        }
        Self { states, slots: next, sums: first_sum..next, stand_ins, slot_of }
    }

    fn list_states(&self, network: &Network, collected: &Collected) -> Vec<StateOf> {
        let mut states = Vec::with_capacity(self.states);
        for &role in &collected.roles {
            if let Role::State { component, state } = role {
                let instance = &network.components[component];
                let declared = &instance.component.spec().states[state];
                states.push(StateOf {
                    name: format!("{}.{}", instance.id, declared.name),
                    component,
                    state,
                    scale: declared.scale,
                    lowest: declared.lowest,
                    unit: declared.unit,
                });
            }
        }
        states
    }
}

/// Sorts blocks so that each runs after those that add to what it reads, and
/// groups blocks of one kind within a level.
fn in_order(blocks: Vec<Block>, collected: &Collected) -> Result<Vec<Block>, Vec<Mistake>> {
    let sums_of = |block: &Block| -> Vec<u32> {
        let ends = block.outputs.iter().flat_map(|o| [o.add, o.subtract]);
        ends.flatten().map(|s| collected.resolve(Variable(s.0)).0).collect()
    };
    let mut writers: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, block) in blocks.iter().enumerate() {
        for sum in sums_of(block) {
            writers.entry(sum).or_default().push(index);
        }
    }
    let mut level: Vec<Option<usize>> = vec![None; blocks.len()];
    let mut found = 0;
    while found < blocks.len() {
        let before = found;
        for index in 0..blocks.len() {
            if level[index].is_some() {
                continue;
            }
            let needed = blocks[index].inputs.iter().filter_map(|v| writers.get(&v.0)).flatten();
            let levels: Option<Vec<usize>> = needed.map(|&w| level[w]).collect();
            if let Some(levels) = levels {
                level[index] = Some(levels.iter().map(|l| l + 1).max().unwrap_or(0));
                found += 1;
            }
        }
        if found == before {
            return Err(vec![loop_among(&blocks, &level, &writers)]);
        }
    }
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|&i| (level[i], blocks[i].kind, blocks[i].subtracts(), i));
    let mut blocks: Vec<Option<Block>> = blocks.into_iter().map(Some).collect();
    Ok(order.into_iter().map(|i| blocks[i].take().expect("each once")).collect())
}

/// Follows what an unplaced block waits for until a block comes again.
fn loop_among(
    blocks: &[Block],
    level: &[Option<usize>],
    writers: &BTreeMap<u32, Vec<usize>>,
) -> Mistake {
    let waits_for = |index: usize| {
        let needed = blocks[index].inputs.iter().filter_map(|v| writers.get(&v.0)).flatten();
        needed.copied().find(|&w| level[w].is_none()).expect("an unplaced block waits")
    };
    let mut seen = vec![false; blocks.len()];
    let mut index = (0..blocks.len()).find(|&i| level[i].is_none()).expect("one is unplaced");
    while !seen[index] {
        seen[index] = true;
        index = waits_for(index);
    }
    let mut components = vec![blocks[index].component];
    let mut next = waits_for(index);
    while next != index {
        components.push(blocks[next].component);
        next = waits_for(next);
    }
    components.sort_unstable();
    components.dedup();
    Mistake::AlgebraicLoop { components }
}

fn observables(network: &Network, collected: &Collected, layout: &Layout) -> Vec<Observable> {
    let mut list = Vec::new();
    let mut push = |name: String, unit: Unit, variable: Variable| {
        let slot = layout.slot_of[collected.resolve(variable).0 as usize];
        if slot != Slot::MAX {
            list.push(Observable { name, unit, slot });
        }
    };
    for (variable, &role) in collected.roles.iter().enumerate() {
        if let Role::State { component, state } = role {
            let instance = &network.components[component];
            let declared = &instance.component.spec().states[state];
            let name = format!("{}.{}", instance.id, declared.name);
            push(name, declared.unit, Variable(variable as u32));
        }
    }
    for &(port, node) in &collected.nodes {
        let PortOf { component, port } = port;
        let instance = &network.components[component];
        let declared = &instance.component.spec().ports[port];
        let name = format!("{}.{}", instance.id, declared.name);
        let sum = node.sum.variable();
        match declared.kind {
            PortKind::Hydraulic { sets: true } => {
                push(format!("{name}.pressure_pa"), Unit::Pascal, node.first);
                push(format!("{name}.flow_m3_s"), Unit::CubicMetrePerSecond, sum);
            }
            PortKind::Translational { sets: true } => {
                push(format!("{name}.position_m"), Unit::Metre, node.first);
                push(format!("{name}.velocity_m_s"), Unit::MetrePerSecond, node.second);
                push(format!("{name}.force_n"), Unit::Newton, sum);
            }
            PortKind::Rotational { sets: true } => {
                push(format!("{name}.angle_rad"), Unit::Radian, node.first);
                push(format!("{name}.rate_rad_s"), Unit::RadianPerSecond, node.second);
                push(format!("{name}.moment_nm"), Unit::NewtonMetre, sum);
            }
            PortKind::SignalOut { unit } => push(name, unit, node.first),
            _ => {}
        }
    }
    for (index, input) in network.inputs.iter().enumerate() {
        let slot = (layout.states + index) as Slot;
        list.push(Observable { name: input.id.clone(), unit: input.unit, slot });
    }
    list
}
