//! The sparse Jacobian by the chain rule over equation blocks.
//!
//! Every sum that matters for a derivative has a row: its gradient with respect
//! to the states it depends on, and to time through the external inputs. The
//! pattern of every row is found once. Evaluating a block with dual numbers
//! gives its small dense Jacobian; [`SparseJacobian::chain`] multiplies these with the
//! rows of the inputs, entry by entry of the rows in an order in which all
//! sources are complete.

use crate::dual::Partial;
use crate::equal_length_groups::{Group, equal_length_groups, group_by_shape, unrolled};
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

/// How many terms of an entry add, and how many then subtract.
type Shape = (usize, usize);

/// The terms of one entry while they are collected: (adding, subtracting).
type Terms = (Vec<Term>, Vec<Term>);

/// The places of all gradients, and how they are made.
#[derive(Clone, Debug)]
pub struct SparseJacobian {
    states: usize,
    slots: usize,
    /// Where each external input's slope stands.
    first_slope: usize,
    /// Where the blocks' partial derivatives begin, after the rows.
    first_partial: usize,
    /// The entries in the order of their making, and their terms.
    groups: Vec<Group<Shape>>,
    targets: Vec<LaneOffset>,
    terms: Vec<Term>,
    /// (row, column, place) of the Jacobian's entries.
    jacobian: Vec<(u16, u16, LaneOffset)>,
    /// (row, place) of the time derivatives.
    time: Vec<(u16, LaneOffset)>,
}

/// The place that always holds one: the derivative of a state with respect to
/// itself, and every partial derivative that is one.
const ONE: LaneOffset = LaneOffset::new(0);
/// The place that is always zero: where the factors have an entry and the
/// Jacobian has none.
const ZERO: LaneOffset = LaneOffset::new(1);

/// The place of an index, of which there are not too many ([`MAX_SLOTS`]).
fn place(index: usize) -> LaneOffset {
    LaneOffset::new(u16::try_from(index).expect("counted before"))
}

/// So many gradient entries have places.
const MAX_SLOTS: usize = Slot::MAX as usize + 1;

impl SparseJacobian {
    /// `needed` are the sums that some derivative depends on, derivatives included. `None` where there are too many
    /// entries.
    pub(crate) fn new(
        sequence: &Sequence,
        states: usize,
        externals: usize,
        sums: Range<usize>,
        needed: &BTreeSet<usize>,
    ) -> Option<Self> {
        let patterns = patterns(sequence, states, externals, &sums, needed);
        // The one and the zero, then the slopes of the inputs, then the rows.
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

    /// Lists the terms of all entries. Gives the places of those entries that need
    /// none: (own place, where the number stands).
    fn list_terms(
        &mut self,
        sequence: &Sequence,
        externals: usize,
        patterns: &BTreeMap<usize, BTreeSet<usize>>,
        places: &BTreeMap<(usize, usize), LaneOffset>,
    ) -> BTreeMap<LaneOffset, LaneOffset> {
        let mut terms: BTreeMap<LaneOffset, Terms> = BTreeMap::new();
        // A row is complete after its last writer, which groups before all readers.
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
        // Where an entry already stands that is one number and no sum.
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

    /// Lists the entries (target, terms that add, that subtract) in groups.
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

    /// The gradient of a block's input: (column, where the entry stands).
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

    /// The plan of the factorisation of `diagonal · I − J`.
    pub(crate) fn lu(&self) -> Option<SparseLu> {
        let entries = self.jacobian.iter();
        let entries: Vec<_> = entries.map(|&(i, j, place)| (i, j, place.index() as u16)).collect();
        SparseLu::new(self.states, &entries, ZERO.index() as u16)
    }

    /// Row and column of every entry of the Jacobian.
    pub fn entries(&self) -> Vec<(u16, u16)> {
        self.jacobian.iter().map(|&(i, j, _)| (i, j)).collect()
    }

    /// The places of the rows that a step reads: those of the Jacobian and of the time derivatives.
    pub(crate) fn read_places(&self) -> BTreeSet<usize> {
        let entries = self.jacobian.iter().map(|entry| entry.2);
        entries.chain(self.time.iter().map(|entry| entry.1)).map(LaneOffset::index).collect()
    }

    /// Number of values that gradients need, with the blocks' partial derivatives.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Number of multiply-add operations of one Jacobian, without the blocks.
    pub fn products(&self) -> usize {
        self.terms.len()
    }

    /// Where the slope of an external input must be put before an evaluation.
    pub fn slope(&self, external: usize) -> usize {
        self.first_slope + external
    }

    /// Where the partial derivatives of all blocks are put, block by block in
    /// the order of evaluation, before [`SparseJacobian::chain`]: by output, then input. The
    /// places of those that are always zero or one stay as they are.
    #[inline(always)]
    pub(crate) fn partials<'g, V>(&self, gradients: &'g mut [V]) -> &'g mut [V] {
        &mut gradients[self.partial_range()]
    }

    /// The range of the blocks' partial derivatives among the gradients.
    #[inline(always)]
    pub fn partial_range(&self) -> Range<usize> {
        self.first_partial..self.slots
    }

    /// The rows from the blocks' partial derivatives.
    pub(crate) fn chain<V: Lanes>(&self, gradients: &mut [V]) {
        V::with_target_features(Chain { rows: self, gradients });
    }

    /// The one and the zero.
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
        for &Group { shape: (add, subtract), count } in &self.groups {
            // SAFETY: a target and its terms are listed for everything in the groups, and
            // all places are below `slots`.
            unsafe {
                match subtract {
                    0 => unrolled!(add, |n| lists.multiply(n, 0, count)),
                    1 => unrolled!(add, |n| lists.multiply(n, 1, count)),
                    _ => lists.multiply(add, subtract, count),
                }
            }
        }
    }

    /// `(row, column, value)` of the Jacobian.
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

/// [`SparseJacobian::chain`].
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

/// Where the making of the rows stands in its lists.
struct Multiplying<V> {
    gradients: *mut V,
    targets: *const LaneOffset,
    terms: *const Term,
}

impl<V: Scalar<Base = V>> Multiplying<V> {
    /// Makes a run of entries.
    ///
    /// # Safety
    /// The lists must go on for as many entries, with places that there are.
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
    /// The list must go on.
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
    /// There must be a number at both places.
    #[inline(always)]
    unsafe fn value<V: Scalar<Base = V>>(self, gradients: *mut V) -> V {
        // SAFETY: promised by the caller.
        unsafe { *self.partial.among(gradients) * *self.source.among(gradients) }
    }
}

/// Where the sum of an entry's terms stands already: a number times one is that
/// number.
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
