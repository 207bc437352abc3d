//! The sparse Jacobian by the chain rule over equation blocks.
//!
//! Every sum that a derivative depends on has a row: its gradient with respect
//! to the states, and to time through the external inputs. The pattern of each
//! row is determined once. Evaluating a block with dual numbers
//! gives its small dense Jacobian. `SparseJacobian::chain` multiplies these with the
//! rows of the inputs, entry by entry, in an order in which all sources are
//! complete.

use crate::dual::Partial;
use crate::equal_length_groups::{EqualLengthGroup, equal_length_groups, group_by_shape, unrolled};
use crate::lane_offset::{LaneOffset, Slot};
use crate::lu::SparseLu;
use crate::scalar::{Lanes, Scalar, Work};
use crate::sequence::{Dependence, Sequence, Target};
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// One term of an entry: `partial · source`.
#[derive(Clone, Copy, Debug)]
struct Term {
    partial: LaneOffset,
    source: LaneOffset,
}

/// Number of terms of an entry that are added, and of those then subtracted.
type Shape = (usize, usize);

/// The terms of one entry during collection: (added, subtracted).
type Terms = (Vec<Term>, Vec<Term>);

/// The sparsity pattern of all gradients and the products that form them.
#[derive(Clone, Debug)]
pub struct SparseJacobian {
    states: usize,
    slots: usize,
    /// Index of the first external input's slope.
    first_slope: usize,
    /// Index of the first partial derivative of a block, after the rows.
    first_partial: usize,
    /// The entries in the order of their computation, and their terms.
    groups: Vec<EqualLengthGroup<Shape>>,
    targets: Vec<LaneOffset>,
    terms: Vec<Term>,
    /// (row, column, offset) of the Jacobian's entries.
    jacobian: Vec<(u16, u16, LaneOffset)>,
    /// (row, offset) of the time derivatives.
    time: Vec<(u16, LaneOffset)>,
}

/// The offset that always holds one: the derivative of a state with respect to
/// itself, and every partial derivative that is one.
const ONE: LaneOffset = LaneOffset::new(0);
/// The offset that always holds zero: where the factors have an entry and the
/// Jacobian has none.
const ZERO: LaneOffset = LaneOffset::new(1);

/// The offset of an index, whose number is limited by [`MAX_SLOTS`].
fn place(index: usize) -> LaneOffset {
    LaneOffset::new(u16::try_from(index).expect("counted before"))
}

/// The largest number of gradient entries that have offsets.
const MAX_SLOTS: usize = Slot::MAX as usize + 1;

impl SparseJacobian {
    /// `needed` holds the sums that some derivative depends on, including the derivatives. Returns `None` if there are
    /// too many entries.
    pub(crate) fn new(
        sequence: &Sequence,
        states: usize,
        externals: usize,
        sums: Range<usize>,
        needed: &BTreeSet<usize>,
    ) -> Option<Self> {
        let patterns = patterns(sequence, states, externals, &sums, needed);
        // The layout: one and zero, the slopes of the inputs, then the rows.
        let first_slope = 2;
        let entries: usize = patterns.values().map(BTreeSet::len).sum();
        let partials: usize =
            sequence.wired().map(|(_, inputs, outputs)| inputs.len() * outputs.len()).sum();
        if first_slope + externals + entries + partials > MAX_SLOTS {
            return None;
        }
        let mut next = first_slope + externals;
        let mut places: BTreeMap<(usize, usize), LaneOffset> = BTreeMap::new();
        for (row, pattern) in &patterns {
            for &column in pattern {
                places.insert((*row, column), place(next));
                next += 1;
            }
        }
        let mut rows = Self {
            states,
            slots: next,
            first_slope,
            first_partial: next,
            groups: Vec::new(),
            targets: Vec::new(),
            terms: Vec::new(),
            jacobian: Vec::new(),
            time: Vec::new(),
        };
        let stands = rows.list_terms(sequence, externals, &patterns, &places);
        let first = sums.end - states;
        for (&(row, column), own) in places.range((first, 0)..) {
            let place = *stands.get(own).unwrap_or(own);
            match column {
                c if c == states => rows.time.push(((row - first) as u16, place)),
                c => rows.jacobian.push(((row - first) as u16, c as u16, place)),
            }
        }
        Some(rows)
    }

    /// Lists the terms of all entries. Returns those entries that equal an existing
    /// number and need no terms: (own offset, offset of the number).
    fn list_terms(
        &mut self,
        sequence: &Sequence,
        externals: usize,
        patterns: &BTreeMap<usize, BTreeSet<usize>>,
        places: &BTreeMap<(usize, usize), LaneOffset>,
    ) -> BTreeMap<LaneOffset, LaneOffset> {
        let mut terms: BTreeMap<LaneOffset, Terms> = BTreeMap::new();
        // A row is complete after its last writer, which runs before all readers.
        let mut last_writer: BTreeMap<usize, usize> = BTreeMap::new();
        for (index, (block, inputs, outputs)) in sequence.wired().enumerate() {
            let mut dependence = block.equation().visit(Dependence).into_iter();
            for &Target { add: to, subtract: from, .. } in outputs {
                for &input in inputs {
                    let own = place(self.slots);
                    self.slots += 1;
                    let partial = match dependence.next().expect("one for each") {
                        Partial::Zero => continue,
                        Partial::One => ONE,
                        Partial::Number(_) => own,
                    };
                    for (column, source) in self.sources(input, externals, patterns, places) {
                        let term = Term { partial, source };
                        if let Some(&place) = places.get(&(to.index(), column)) {
                            terms.entry(place).or_default().0.push(term);
                        }
                        if let Some(&place) = places.get(&(from.index(), column)) {
                            terms.entry(place).or_default().1.push(term);
                        }
                    }
                }
                last_writer.insert(to.index(), index);
                last_writer.insert(from.index(), index);
            }
        }
        let mut order: Vec<(Option<&usize>, LaneOffset)> =
            (places.iter()).map(|(&(row, _), &place)| (last_writer.get(&row), place)).collect();
        order.sort_unstable();
        // Offsets of the entries that equal one existing number.
        let mut stands = BTreeMap::new();
        let mut entries = Vec::new();
        for (_, target) in order {
            let (mut add, mut subtract) = terms.remove(&target).expect("a pattern is of terms");
            for term in add.iter_mut().chain(&mut subtract) {
                term.source = *stands.get(&term.source).unwrap_or(&term.source);
            }
            if let Some(place) = one_number(&add, &subtract) {
                stands.insert(target, place);
                continue;
            }
            entries.push((target, add, subtract));
        }
        self.list_entries(&entries);
        stands
    }

    /// Lists the entries (target, added terms, subtracted terms) in groups.
    fn list_entries(&mut self, entries: &[(LaneOffset, Vec<Term>, Vec<Term>)]) {
        let index: BTreeMap<LaneOffset, usize> =
            entries.iter().enumerate().map(|(index, entry)| (entry.0, index)).collect();
        let shape = |entry: &usize| (entries[*entry].1.len(), entries[*entry].2.len());
        let shapes: Vec<Shape> = (0..entries.len()).map(|entry| shape(&entry)).collect();
        let needs = |(_, add, subtract): &(LaneOffset, Vec<Term>, Vec<Term>)| {
            let terms = add.iter().chain(subtract);
            terms.filter_map(|term| index.get(&term.source).copied()).collect()
        };
        let needs: Vec<Vec<usize>> = entries.iter().map(needs).collect();
        let order = group_by_shape(&shapes, &needs);
        self.groups = equal_length_groups(order.iter().map(shape));
        for entry in order {
            let (target, add, subtract) = &entries[entry];
            self.targets.push(*target);
            self.terms.extend(add.iter().chain(subtract));
        }
    }

    /// The gradient of a block's input: (column, offset of the entry).
    fn sources(
        &self,
        input: LaneOffset,
        externals: usize,
        patterns: &BTreeMap<usize, BTreeSet<usize>>,
        places: &BTreeMap<(usize, usize), LaneOffset>,
    ) -> Vec<(usize, LaneOffset)> {
        let states = self.states;
        match input.index() {
            i if i < states => vec![(i, ONE)],
            i if i < states + externals => {
                vec![(states, place(self.first_slope + i - states))]
            }
            i => (patterns.get(&i).into_iter().flatten())
                .map(|&column| (column, places[&(i, column)]))
                .collect(),
        }
    }

    /// The factorization of `diagonal · I − J`; `None` if it needs too many slots.
    pub(crate) fn lu(&self) -> Option<SparseLu> {
        let entries = self.jacobian.iter();
        let entries: Vec<_> = entries.map(|&(i, j, place)| (i, j, place.index() as u16)).collect();
        SparseLu::new(self.states, &entries, ZERO.index() as u16)
    }

    /// Row and column of every entry of the Jacobian.
    pub fn entries(&self) -> Vec<(u16, u16)> {
        self.jacobian.iter().map(|&(i, j, _)| (i, j)).collect()
    }

    /// The indices that a step reads: those of the Jacobian and of the time derivatives.
    pub(crate) fn read_places(&self) -> BTreeSet<usize> {
        let entries = self.jacobian.iter().map(|entry| entry.2);
        entries.chain(self.time.iter().map(|entry| entry.1)).map(LaneOffset::index).collect()
    }

    /// Number of gradient values, including the blocks' partial derivatives.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Number of multiply-add operations of one Jacobian, excluding the blocks.
    pub fn products(&self) -> usize {
        self.terms.len()
    }

    /// The index at which the caller stores the slope of an external input before an evaluation.
    pub fn slope(&self, external: usize) -> usize {
        self.first_slope + external
    }

    /// The partial derivatives of all blocks, which the caller stores before [`SparseJacobian::chain`]:
    /// by block in the order of evaluation, then output, then input.
    /// Slots of derivatives that are always zero or one are not used.
    #[inline(always)]
    pub(crate) fn partials<'g, V>(&self, gradients: &'g mut [V]) -> &'g mut [V] {
        &mut gradients[self.partial_range()]
    }

    /// The range of the blocks' partial derivatives among the gradients.
    #[inline(always)]
    pub fn partial_range(&self) -> Range<usize> {
        self.first_partial..self.slots
    }

    /// Computes the rows from the blocks' partial derivatives.
    pub(crate) fn chain<V: Lanes>(&self, gradients: &mut [V]) {
        V::with_target_features(Chain { rows: self, gradients });
    }

    /// Writes the constants one and zero.
    #[inline(always)]
    pub(crate) fn set_fixed<V: Scalar<Base = V>>(&self, gradients: &mut [V]) {
        gradients[ONE.index()] = V::constant(1.0);
        gradients[ZERO.index()] = V::constant(0.0);
    }

    /// [`SparseJacobian::chain`], inlined.
    #[inline(always)]
    pub(crate) fn multiply<V: Scalar<Base = V>>(&self, gradients: &mut [V]) {
        assert!(gradients.len() >= self.slots);
        self.set_fixed(gradients);
        let mut lists = Multiplying {
            gradients: gradients.as_mut_ptr(),
            targets: self.targets.as_ptr(),
            terms: self.terms.as_ptr(),
        };
        for &EqualLengthGroup { shape: (add, subtract), count } in &self.groups {
            // SAFETY: the lists hold a target and its terms for every entry of the groups, and
            // all offsets are below `slots`.
            unsafe {
                match subtract {
                    0 => unrolled!(add, |n| lists.multiply(n, 0, count)),
                    1 => unrolled!(add, |n| lists.multiply(n, 1, count)),
                    _ => lists.multiply(add, subtract, count),
                }
            }
        }
    }

    /// The Jacobian's entries as `(row, column, value)`.
    pub fn values<'a, V: Lanes>(
        &'a self,
        gradients: &'a [V],
    ) -> impl Iterator<Item = (usize, usize, V)> + 'a {
        let entries = self.jacobian.iter();
        entries.map(|&(i, j, place)| (i as usize, j as usize, gradients[place.index()]))
    }

    /// Adds `factor · ∂f/∂t` to a vector over the states.
    #[inline(always)]
    pub fn add_time_derivative<V: Scalar<Base = V>>(
        &self,
        factor: V,
        gradients: &[V],
        x: &mut [V],
    ) {
        for &(row, place) in &self.time {
            x[row as usize] = x[row as usize] + factor * gradients[place.index()];
        }
    }
}

/// The work of [`SparseJacobian::chain`].
struct Chain<'a, V> {
    rows: &'a SparseJacobian,
    gradients: &'a mut [V],
}

impl<V: Lanes> Work<V> for Chain<'_, V> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.rows.multiply(self.gradients);
    }
}

/// The current position in the lists while the rows are computed.
struct Multiplying<V> {
    gradients: *mut V,
    targets: *const LaneOffset,
    terms: *const Term,
}

impl<V: Scalar<Base = V>> Multiplying<V> {
    /// Computes `count` entries of one shape.
    ///
    /// # Safety
    /// The lists must hold that many more entries, with valid offsets.
    #[inline(always)]
    unsafe fn multiply(&mut self, add: usize, subtract: usize, count: usize) {
        // SAFETY: promised by the caller.
        unsafe {
            for _ in 0..count {
                let mut sum = V::constant(-0.0);
                for _ in 0..add {
                    sum = sum + self.next_term();
                }
                for _ in 0..subtract {
                    sum = sum - self.next_term();
                }
                *(*self.targets).among(self.gradients) = sum;
                self.targets = self.targets.add(1);
            }
        }
    }

    /// # Safety
    /// The list must hold another term.
    #[inline(always)]
    unsafe fn next_term(&mut self) -> V {
        // SAFETY: promised by the caller.
        unsafe {
            let term = *self.terms;
            self.terms = self.terms.add(1);
            term.value(self.gradients)
        }
    }
}

impl Term {
    /// # Safety
    /// Both offsets must point to numbers.
    #[inline(always)]
    unsafe fn value<V: Scalar<Base = V>>(self, gradients: *mut V) -> V {
        // SAFETY: promised by the caller.
        unsafe { *self.partial.among(gradients) * *self.source.among(gradients) }
    }
}

/// The offset of the existing number that an entry equals, if its only term is a number
/// times one.
fn one_number(add: &[Term], subtract: &[Term]) -> Option<LaneOffset> {
    match (add, subtract) {
        (&[Term { partial: ONE, source }], []) => Some(source),
        (&[Term { partial, source: ONE }], []) => Some(partial),
        _ => None,
    }
}

/// The columns of every needed row; column `states` is time.
fn patterns(
    sequence: &Sequence,
    states: usize,
    externals: usize,
    sums: &Range<usize>,
    needed: &BTreeSet<usize>,
) -> BTreeMap<usize, BTreeSet<usize>> {
    let mut patterns: BTreeMap<usize, BTreeSet<usize>> =
        needed.iter().map(|&sum| (sum, BTreeSet::new())).collect();
    for (block, inputs, outputs) in sequence.wired() {
        let mut dependence = block.equation().visit(Dependence).into_iter();
        for &Target { add, subtract, .. } in outputs {
            let mut columns = BTreeSet::new();
            for &input in inputs {
                if dependence.next() == Some(Partial::Zero) {
                    continue;
                }
                match input.index() {
                    i if i < states => drop(columns.insert(i)),
                    i if i < states + externals => drop(columns.insert(states)),
                    i if sums.contains(&i) => {
                        columns.extend(patterns.get(&i).into_iter().flatten().copied());
                    }
                    _ => {}
                }
            }
            for target in [add, subtract] {
                if let Some(pattern) = patterns.get_mut(&target.index()) {
                    pattern.extend(columns.iter().copied());
                }
            }
        }
    }
    patterns
}

/// A dense copy of a Jacobian, row by row, for one lane.
pub fn dense<V: Lanes>(jacobian: &SparseJacobian, gradients: &[V], lane: usize) -> Vec<Vec<f64>> {
    let mut matrix = vec![vec![0.0; jacobian.states]; jacobian.states];
    for (i, j, value) in jacobian.values(gradients) {
        matrix[i][j] = value.lane(lane);
    }
    matrix
}
