//! Equation blocks in the order of their evaluation, grouped by kind so that a whole group runs without a
//! branch, and the operations on a group.
//!
//! Lists hold the offsets of a block's inputs and outputs in the array of variables. They are checked when a
//! block is added, and read unchecked.

use crate::components::{BlockKind, Visitor};
use crate::dual::{Dual, Partial};
use crate::equation::Equation;
use crate::lane_offset::{LaneOffset, Slot};
use crate::scalar::{Lanes, Scalar, Work};
use crate::symbol::Symbol;
use crate::wiring::{Block, Sum};
use alloc::vec::Vec;
use core::marker::PhantomData;

/// Blocks of one kind that can run in any order among each other.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub(crate) kind: BlockKind,
    /// Whether any output is subtracted. Most groups only add.
    pub(crate) subtracts: bool,
    /// Whether any output joins a sum that already has a term. Most sums have one term.
    pub(crate) joins: bool,
    pub(crate) count: usize,
    /// Index of the group's first entry in each list.
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    pub(crate) constants: usize,
}

/// The targets of a block's output. An unused target is the bin slot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target {
    /// The sum that the output is added to, and the offset of the sum so far. The sum so
    /// far is in the same slot, or for a sum's first block in the slot that holds −0, so
    /// that sums need not be cleared.
    pub(crate) add: LaneOffset,
    pub(crate) add_so_far: LaneOffset,
    /// The same for the sum that it is subtracted from.
    pub(crate) subtract: LaneOffset,
    pub(crate) subtract_so_far: LaneOffset,
}

/// Blocks in the order of their evaluation.
#[derive(Clone, Debug)]
pub(crate) struct Sequence {
    pub(crate) groups: Vec<Group>,
    pub(crate) inputs: Vec<LaneOffset>,
    pub(crate) outputs: Vec<Target>,
    /// The blocks in order, for the constants and the Jacobian.
    pub(crate) blocks: Vec<Block>,
    /// Required length of the variable array.
    memory: usize,
    /// Number of constants of its blocks and those of earlier sequences.
    constants: usize,
}

/// Length of the variable array for `slots` variables, the bin and the zero.
pub(crate) const fn memory(slots: usize) -> usize {
    slots + 2
}

impl Sequence {
    /// Lists blocks in this order over `slots` variables. `slot_of` maps the blocks'
    /// variables to slots, `written` marks the sums that earlier sequences have begun,
    /// and `constants` counts the constants.
    pub(crate) fn new(
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

    /// Checks the lengths and writes the zero, which is negative. Only then does a sum of one term equal that term,
    /// even a term of −0.
    #[inline(always)]
    fn prepare<V: Scalar<Base = V>>(&self, constants: &[V], variables: &mut [V]) {
        assert!(variables.len() >= self.memory && constants.len() >= self.constants);
        variables[self.memory - 1] = V::constant(-0.0);
    }

    /// Runs all blocks once.
    pub fn run<V: Lanes>(&self, constants: &[V], variables: &mut [V]) {
        self.prepare(constants, variables);
        for group in &self.groups {
            group.kind.visit(Evaluate { group, sequence: self, constants, variables });
        }
    }

    /// [`Sequence::run`] with symbols.
    pub(crate) fn trace<'g>(&self, constants: &[Symbol<'g>], variables: &mut [Symbol<'g>]) {
        self.prepare(constants, variables);
        for group in &self.groups {
            group.kind.visit(Trace(Evaluate { group, sequence: self, constants, variables }));
        }
    }

    /// [`Sequence::differentiate`] with symbols.
    pub(crate) fn trace_with_partials<'g>(
        &self,
        constants: &[Symbol<'g>],
        variables: &mut [Symbol<'g>],
        partials: &mut [Symbol<'g>],
    ) {
        self.prepare(constants, variables);
        for (group, partials) in self.groups_with(partials) {
            let variables = &mut *variables;
            let evaluate = Evaluate { group, sequence: self, constants, variables };
            group.kind.visit(TraceDuals(Differentiate { evaluate, partials }));
        }
    }

    /// Runs all blocks once and writes their partial derivatives: by block, then output, then input.
    pub(crate) fn differentiate<V: Lanes>(
        &self,
        constants: &[V],
        variables: &mut [V],
        partials: &mut [V],
    ) {
        self.prepare(constants, variables);
        for (group, partials) in self.groups_with(partials) {
            let variables = &mut *variables;
            let evaluate = Evaluate { group, sequence: self, constants, variables };
            group.kind.visit(Differentiate { evaluate, partials });
        }
    }

    /// The groups, each with the slice of its partial derivatives.
    #[inline(always)]
    fn groups_with<'a, V>(
        &'a self,
        mut partials: &'a mut [V],
    ) -> impl Iterator<Item = (&'a Group, &'a mut [V])> {
        self.groups.iter().map(move |group| {
            let count = group.count * group.kind.visit(Partials);
            let (own, later) = core::mem::take(&mut partials).split_at_mut(count);
            partials = later;
            (group, own)
        })
    }

    /// The blocks with the offsets of their inputs and outputs.
    pub(crate) fn wired(&self) -> impl Iterator<Item = (&Block, &[LaneOffset], &[Target])> {
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
        let kind = block.equation();
        let (inputs, outputs, held) = kind.visit(Dimensions);
        // `lists` relies on this and on the check of every variable's slot below.
        assert_eq!((block.inputs.len(), block.outputs.len()), (inputs, outputs));
        let subtracts = block.subtracts();
        let fits = |g: &Group| (g.kind, g.subtracts) == (kind, subtracts);
        let new_group = !self.groups.last().is_some_and(fits);
        if new_group {
            self.groups.push(Group {
                kind,
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
            self.inputs.push(LaneOffset::new(slot));
        }
        let mut place = |sum: Option<Sum>| {
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
                add: LaneOffset::new(add),
                add_so_far: LaneOffset::new(add_so_far),
                subtract: LaneOffset::new(subtract),
                subtract_so_far: LaneOffset::new(subtract_so_far),
            });
        }
        self.blocks.push(block);
    }
}

/// Returns the numbers of inputs, outputs and constants of a block.
struct Dimensions;

impl Visitor for Dimensions {
    type Output = (usize, usize, usize);
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> Self::Output
    where
        E: Equation<I, O, C>,
    {
        (I, O, C)
    }
}

/// Returns how the outputs of a block depend on its inputs for all values: by output,
/// then input. The numbers themselves are meaningless.
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

/// The inputs, outputs and constants of each block of a group.
///
/// # Safety
/// The group must belong to the sequence, `I`, `O` and `C` must be those of its kind,
/// and there must be as many constants as [`Sequence::run`] asserts.
#[inline(always)]
unsafe fn lists<'a, V, const I: usize, const O: usize, const C: usize>(
    group: &Group,
    sequence: &'a Sequence,
    constants: &'a [V],
) -> impl Iterator<Item = (&'a [LaneOffset; I], &'a [Target; O], &'a [V; C])> {
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
/// The slice must hold them. There is no check, because a step calls this some hundred times.
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
        V::with_target_features(OfKind::<_, E, I, O, C>(self, PhantomData));
    }
}

/// [`Evaluate`] with symbols.
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

/// [`Differentiate`] with symbols.
struct TraceDuals<'a, 'g>(Differentiate<'a, Symbol<'g>>);

impl Visitor for TraceDuals<'_, '_> {
    type Output = ();
    #[inline(never)]
    fn visit<E, const I: usize, const O: usize, const C: usize>(self)
    where
        E: Equation<I, O, C>,
    {
        let Differentiate { evaluate, partials } = self.0;
        let Evaluate { group, sequence, constants, variables } = evaluate;
        // SAFETY: `Sequence::trace_with_partials` asserts the constants.
        let blocks = unsafe { lists::<Symbol, I, O, C>(group, sequence, constants) };
        for ((inputs, outputs, constants), own) in blocks.zip(partials.chunks_mut(I * O)) {
            let values = core::array::from_fn(|i| Dual::input(variables[inputs[i].index()], i));
            let results = E::evaluate::<Dual<Symbol, I>>(constants, values);
            let all = results.iter().flat_map(|result| result.partials);
            for (place, partial) in own.iter_mut().zip(all) {
                *place = partial.number();
            }
            let first = variables.as_mut_ptr();
            // SAFETY: all slots of a sequence are below the asserted length.
            let at = |place: LaneOffset| unsafe { place.among(first) };
            // SAFETY: as above.
            unsafe { scatter(group, outputs, &results.map(|result| result.value), at) };
        }
    }
}

/// An operation on a group of one kind, in a separate function: with all kinds in one
/// function, compilation would take minutes.
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
                // SAFETY: all slots of a sequence are below the length that the caller
                // asserts.
                *value = unsafe { input.read(variables) };
            }
            let results = E::evaluate::<V>(constants, values);
            let first = variables.as_mut_ptr();
            // SAFETY: as above.
            let at = |place: LaneOffset| unsafe { place.among(first) };
            // SAFETY: as above.
            unsafe { scatter(group, outputs, &results, at) };
        }
    }
}

/// Adds a block's outputs to their sums; `at` returns the pointer to an offset.
///
/// # Safety
/// Every offset must point to a number.
#[inline(always)]
unsafe fn scatter<V: Scalar<Base = V>, const O: usize>(
    group: &Group,
    outputs: &[Target; O],
    results: &[V; O],
    at: impl Fn(LaneOffset) -> *mut V,
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

/// [`Evaluate`] with the partial derivatives.
struct Differentiate<'a, V> {
    evaluate: Evaluate<'a, V>,
    /// Receives the group's partial derivatives.
    partials: &'a mut [V],
}

/// Returns the number of partial derivatives of a block.
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
        V::with_target_features(OfKind::<_, E, I, O, C>(self, PhantomData));
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
        let mut own = partials.as_mut_ptr();
        // SAFETY: `Sequence::differentiate` asserts the constants.
        let blocks = unsafe { lists::<V, I, O, C>(group, sequence, constants) };
        for (inputs, outputs, held) in blocks {
            let first = variables.as_mut_ptr();
            // SAFETY: all slots of a sequence are below the length that the caller asserts.
            let at = |place: LaneOffset| unsafe { place.among(first) };
            let mut values = [Dual::from_base(V::constant(0.0)); I];
            for (i, (value, &input)) in values.iter_mut().zip(inputs).enumerate() {
                // SAFETY: as above.
                *value = Dual::input(unsafe { *at(input) }, i);
            }
            let results = E::evaluate::<Dual<V, I>>(held, values);
            let mut plain = [V::constant(0.0); O];
            for (o, result) in results.iter().enumerate() {
                plain[o] = result.value;
                for (i, &partial) in result.partials.iter().enumerate() {
                    // No term reads the slot of a zero or a one (`SparseJacobian::list_terms`).
                    if let Partial::Number(number) = partial {
                        // SAFETY: `own` has `I · O` slots for every block.
                        unsafe { *own.add(o * I + i) = number };
                    }
                }
            }
            // SAFETY: as above.
            unsafe { scatter(group, outputs, &plain, at) };
            // SAFETY: as above.
            own = unsafe { own.add(I * O) };
        }
    }
}
