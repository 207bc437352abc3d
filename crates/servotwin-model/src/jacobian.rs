//! The sparse Jacobian by the chain rule over equation blocks.
//!
//! Every sum that matters for a derivative has a row: its gradient with respect
//! to the states it depends on, and to time through the external inputs. The
//! pattern of every row is found once. Evaluating a block with dual numbers
//! gives its small dense Jacobian; [`Rows::accumulate`] multiplies it with the
//! rows of its inputs by a flat list of slots.

use crate::lu::Plan;
use crate::program::Sequence;
use crate::scalar::Lanes;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// `gradient[target] += ± partial · gradient[source]`.
#[derive(Clone, Copy, Debug)]
struct Product {
    /// `output · inputs + input`.
    partial: u16,
    source: u16,
    target: u16,
}

/// The products of one block: those that add, then those that subtract.
#[derive(Clone, Copy, Debug)]
struct Range32 {
    begin: u32,
    middle: u32,
    end: u32,
}

/// Patterns and places of all gradients.
#[derive(Clone, Debug)]
pub struct Rows {
    states: usize,
    slots: usize,
    /// Where each external input's slope stands.
    first_slope: usize,
    /// Where the rows begin.
    first_row: usize,
    products: Vec<Product>,
    blocks: Vec<Range32>,
    /// (row, column, slot) of the Jacobian's entries.
    jacobian: Vec<(u16, u16, u16)>,
    /// For each entry its place in the factors.
    in_plan: Vec<u16>,
    /// (row, slot) of the time derivatives.
    time: Vec<(u16, u16)>,
}

/// The slot that always holds one: the derivative of a state with respect to
/// itself.
const ONE: u16 = 0;

impl Rows {
    pub(crate) fn new(
        sequence: &Sequence,
        states: usize,
        externals: usize,
        sums: Range<usize>,
    ) -> Self {
        let needed = needed(sequence, states, &sums);
        let patterns = patterns(sequence, states, externals, &sums, &needed);
        // Slot 0 is the one, then the slopes of the inputs, then the rows.
        let mut next = 1 + externals;
        let mut places: BTreeMap<(usize, usize), u16> = BTreeMap::new();
        for (row, pattern) in &patterns {
            for &column in pattern {
                let slot = u16::try_from(next).expect("at most 65,535 gradient entries");
                places.insert((*row, column), slot);
                next += 1;
            }
        }
        let mut rows = Self {
            states,
            slots: next,
            first_slope: 1,
            first_row: 1 + externals,
            products: Vec::new(),
            blocks: Vec::new(),
            jacobian: Vec::new(),
            in_plan: Vec::new(),
            time: Vec::new(),
        };
        rows.list_products(sequence, externals, &patterns, &places);
        let first = sums.end - states;
        for (&(row, column), &slot) in places.range((first, 0)..) {
            match column {
                c if c == states => rows.time.push(((row - first) as u16, slot)),
                c => rows.jacobian.push(((row - first) as u16, c as u16, slot)),
            }
        }
        rows
    }

    fn list_products(
        &mut self,
        sequence: &Sequence,
        externals: usize,
        patterns: &BTreeMap<usize, BTreeSet<usize>>,
        places: &BTreeMap<(usize, usize), u16>,
    ) {
        let states = self.states;
        let mut input_at = 0;
        let mut output_at = 0;
        for block in &sequence.blocks {
            let inputs = &sequence.inputs[input_at..][..block.inputs.len()];
            let outputs = &sequence.outputs[output_at..][..block.outputs.len()];
            input_at += inputs.len();
            output_at += outputs.len();
            let mut add = Vec::new();
            let mut subtract = Vec::new();
            for (o, &(to, from)) in outputs.iter().enumerate() {
                for (target, list) in [(to, &mut add), (from, &mut subtract)] {
                    let target = target as usize;
                    if !patterns.contains_key(&target) {
                        continue;
                    }
                    for (i, &input) in inputs.iter().enumerate() {
                        let partial = (o * inputs.len() + i) as u16;
                        let mut push = |column: usize, source: u16| {
                            let target = places[&(target, column)];
                            list.push(Product {
                                partial,
                                source,
                                target,
                            });
                        };
                        let input = input as usize;
                        if input < states {
                            push(input, ONE);
                        } else if input < states + externals {
                            push(states, (self.first_slope + input - states) as u16);
                        } else if let Some(pattern) = patterns.get(&input) {
                            for &column in pattern {
                                push(column, places[&(input, column)]);
                            }
                        }
                    }
                }
            }
            let begin = self.products.len() as u32;
            self.products.extend(add);
            let middle = self.products.len() as u32;
            self.products.extend(subtract);
            self.blocks.push(Range32 {
                begin,
                middle,
                end: self.products.len() as u32,
            });
        }
    }

    pub(crate) fn with_plan(mut self, plan: &Plan) -> Self {
        self.in_plan = self
            .jacobian
            .iter()
            .map(|&(i, j, _)| plan.slot(i, j))
            .collect();
        self
    }

    /// Row and column of every entry of the Jacobian.
    pub fn entries(&self) -> Vec<(u16, u16)> {
        self.jacobian.iter().map(|&(i, j, _)| (i, j)).collect()
    }

    /// Number of values that gradients need.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Number of multiply-add operations of one Jacobian, without the blocks.
    pub fn products(&self) -> usize {
        self.products.len()
    }

    /// Where the slope of an external input must be put before an evaluation.
    pub fn slope(&self, external: usize) -> usize {
        self.first_slope + external
    }

    #[inline(always)]
    pub(crate) fn clear<V: Lanes>(&self, gradients: &mut [V]) {
        gradients[ONE as usize] = V::constant(1.0);
        for g in &mut gradients[self.first_row..self.slots] {
            *g = V::constant(0.0);
        }
    }

    /// Adds one block's partial derivatives to the rows of its outputs.
    #[inline(always)]
    pub(crate) fn accumulate<V: Lanes, const I: usize, const O: usize>(
        &self,
        block: usize,
        partials: &[[V; I]; O],
        gradients: &mut [V],
    ) {
        let range = self.blocks[block];
        let partials = partials.as_flattened();
        for p in &self.products[range.begin as usize..range.middle as usize] {
            let product = partials[p.partial as usize] * gradients[p.source as usize];
            let target = &mut gradients[p.target as usize];
            *target = *target + product;
        }
        for p in &self.products[range.middle as usize..range.end as usize] {
            let product = partials[p.partial as usize] * gradients[p.source as usize];
            let target = &mut gradients[p.target as usize];
            *target = *target - product;
        }
    }

    /// `(row, column, value)` of the Jacobian.
    pub fn jacobian<'a, V: Lanes>(
        &'a self,
        gradients: &'a [V],
    ) -> impl Iterator<Item = (usize, usize, V)> + 'a {
        self.jacobian
            .iter()
            .map(|&(i, j, slot)| (i as usize, j as usize, gradients[slot as usize]))
    }

    /// Writes `diagonal · I − J` into the factors' place.
    #[inline(always)]
    pub fn shifted<V: Lanes>(&self, plan: &Plan, diagonal: V, gradients: &[V], values: &mut [V]) {
        for v in values.iter_mut() {
            *v = V::constant(0.0);
        }
        for i in 0..self.states {
            values[plan.diagonal(i)] = diagonal;
        }
        for (&(_, _, slot), &place) in self.jacobian.iter().zip(&self.in_plan) {
            values[place as usize] = values[place as usize] - gradients[slot as usize];
        }
    }

    /// Adds `factor · ∂f/∂t` to a vector over the states.
    #[inline(always)]
    pub fn add_time_derivative<V: Lanes>(&self, factor: V, gradients: &[V], x: &mut [V]) {
        for &(row, slot) in &self.time {
            x[row as usize] = x[row as usize] + factor * gradients[slot as usize];
        }
    }
}

/// The sums that some derivative depends on.
fn needed(sequence: &Sequence, states: usize, sums: &Range<usize>) -> BTreeSet<usize> {
    let mut needed: BTreeSet<usize> = (sums.end - states..sums.end).collect();
    let mut input_end = sequence.inputs.len();
    let mut output_end = sequence.outputs.len();
    for block in sequence.blocks.iter().rev() {
        let inputs = &sequence.inputs[input_end - block.inputs.len()..input_end];
        let outputs = &sequence.outputs[output_end - block.outputs.len()..output_end];
        input_end -= inputs.len();
        output_end -= outputs.len();
        let matters = outputs
            .iter()
            .any(|o| needed.contains(&(o.0 as usize)) || needed.contains(&(o.1 as usize)));
        if matters {
            needed.extend(
                inputs
                    .iter()
                    .map(|&i| i as usize)
                    .filter(|i| sums.contains(i)),
            );
        }
    }
    needed
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
    let mut input_at = 0;
    let mut output_at = 0;
    for block in &sequence.blocks {
        let inputs = &sequence.inputs[input_at..][..block.inputs.len()];
        let outputs = &sequence.outputs[output_at..][..block.outputs.len()];
        input_at += inputs.len();
        output_at += outputs.len();
        let mut columns = BTreeSet::new();
        for &input in inputs {
            match input as usize {
                i if i < states => drop(columns.insert(i)),
                i if i < states + externals => drop(columns.insert(states)),
                i if sums.contains(&i) => {
                    columns.extend(patterns.get(&i).into_iter().flatten().copied());
                }
                _ => {}
            }
        }
        for &(add, subtract) in outputs {
            for target in [add, subtract] {
                if let Some(pattern) = patterns.get_mut(&(target as usize)) {
                    pattern.extend(columns.iter().copied());
                }
            }
        }
    }
    patterns
}

/// A dense copy of a Jacobian, row by row, for one lane.
pub fn dense<V: Lanes>(rows: &Rows, gradients: &[V], lane: usize) -> Vec<Vec<f64>> {
    let mut matrix = vec![vec![0.0; rows.states]; rows.states];
    for (i, j, value) in rows.jacobian(gradients) {
        matrix[i][j] = value.lane(lane);
    }
    matrix
}
