//! Growing a tree depth first on unbinned feature values.
//!
//! If every feature is tried at each split, the presorted rows of all features are split in place. This costs O(rows ·
//! features) for each level. If features are drawn at random, only the drawn ones are sorted, node by node.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::building::{Building, Growth, Parent};
use super::criterion::{CountEntropyScan, Criterion, EntropyScan, GiniScan, Scan};
use super::presorted::Presorted;
use super::split::{Candidate, NodeRows, best_of_feature};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::tree::Tree;

/// Grows a tree. Uses `random` only to draw features.
pub(crate) fn grow(growth: &Growth, presorted: &Presorted, random: &mut Random) -> Tree {
    match growth.rules.criterion {
        Criterion::Entropy if growth.is_counted() => {
            Grower::<CountEntropyScan>::new(growth, presorted).run(random)
        }
        Criterion::Gini => Grower::<GiniScan>::new(growth, presorted).run(random),
        Criterion::Entropy => Grower::<EntropyScan>::new(growth, presorted).run(random),
    }
}

/// A node with known rows that is not yet in the tree.
struct Pending {
    /// Its rows are `start..end` of every row list.
    start: usize,
    end: usize,
    depth: usize,
    parent: Parent,
    /// Features not known to be constant here, ascending.
    features: Vec<u32>,
}

struct Grower<'a, S> {
    growth: &'a Growth<'a>,
    presorted: &'a Presorted,
    building: Building<'a>,
    scan: S,
    /// The rows in use, grouped by node.
    rows: Vec<u32>,
    /// The same rows in ascending order of each feature, grouped by node. With drawn features, only the current node's
    /// rows for one feature.
    sorted: Vec<u32>,
    goes_left: Vec<bool>,
    spare: Vec<u32>,
    keys: Vec<u64>,
    spare_keys: Vec<u64>,
}

impl<'a, S: Scan + Default> Grower<'a, S> {
    fn new(growth: &'a Growth<'a>, presorted: &'a Presorted) -> Self {
        let samples = growth.samples;
        let rows = growth.rows();
        let mut sorted = Vec::new();
        if !draws(growth) {
            let used = |row: &u32| growth.weights[*row as usize] > 0.0;
            sorted.reserve_exact(rows.len() * samples.features());
            for feature in 0..samples.features() {
                sorted.extend(presorted.order(feature).iter().copied().filter(used));
            }
        }
        Grower {
            building: Building::new(growth, &rows),
            scan: S::default(),
            sorted,
            goes_left: vec![false; samples.rows()],
            spare: vec![0; rows.len()],
            keys: Vec::new(),
            spare_keys: Vec::new(),
            rows,
            growth,
            presorted,
        }
    }

    fn run(mut self, random: &mut Random) -> Tree {
        let features = (0..self.growth.samples.features() as u32).collect();
        let root = Pending { start: 0, end: self.rows.len(), depth: 0, parent: None, features };
        let mut stack = vec![root];
        while let Some(mut pending) = stack.pop() {
            let rows = &self.rows[pending.start..pending.end];
            let node = self.building.add_node(rows, pending.depth, pending.parent);
            let Some(best) = self.choose_split(node, &mut pending, random) else {
                continue;
            };
            let middle = self.divide(&pending, &best);
            if self.growth.samples.has_missing() {
                // Rows without a value may still occur in prediction: they go with the majority.
                let larger = 2 * (middle - pending.start) >= pending.end - pending.start;
                self.building.tree.set_missing_left(node, best.missing_left.unwrap_or(larger));
            }
            let child = |start, end, is_right, features| Pending {
                start,
                end,
                depth: pending.depth + 1,
                parent: Some((node, is_right)),
                features,
            };
            // The left child is on top of the stack, so that nodes come in preorder.
            stack.push(child(middle, pending.end, true, pending.features.clone()));
            stack.push(child(pending.start, middle, false, pending.features));
        }
        self.building.tree
    }

    /// Finds the split of a node and writes it into the tree; `None` leaves the node a leaf.
    fn choose_split(
        &mut self,
        node: usize,
        pending: &mut Pending,
        random: &mut Random,
    ) -> Option<Candidate> {
        if !self.building.may_split(node, pending.end - pending.start) {
            return None;
        }
        let best = match draws(self.growth) {
            true => self.search_drawn(pending, random),
            false => self.search_all(pending),
        };
        self.building.settle(node, best)
    }

    /// Tries all features, and drops those that are constant at this node.
    fn search_all(&mut self, pending: &mut Pending) -> Option<Candidate> {
        let mut best = None;
        let mut features = core::mem::take(&mut pending.features);
        features.retain(|&feature| {
            let first = feature as usize * self.rows.len();
            self.search(first + pending.start..first + pending.end, feature as usize, &mut best)
        });
        pending.features = features;
        best
    }

    /// Tries randomly drawn features until enough of them vary.
    fn search_drawn(&mut self, pending: &mut Pending, random: &mut Random) -> Option<Candidate> {
        let mut best = None;
        let mut constant: Vec<u32> = Vec::new();
        let mut waiting = pending.features.clone();
        let mut tried = 0;
        while tried < self.growth.rules.drawn_features && !waiting.is_empty() {
            let feature = waiting.swap_remove(random.index(waiting.len()));
            self.sort_rows(pending, feature as usize);
            match self.search(0..self.sorted.len(), feature as usize, &mut best) {
                true => tried += 1,
                false => constant.push(feature),
            }
        }
        if !constant.is_empty() {
            pending.features.retain(|feature| !constant.contains(feature));
        }
        best
    }

    /// Tries a feature on the rows in a range of `sorted` and keeps its best split. Whether the feature varies there.
    fn search(
        &mut self,
        range: Range<usize>,
        feature: usize,
        best: &mut Option<Candidate>,
    ) -> bool {
        let Growth { samples, weights, rules } = *self.growth;
        let (sorted, column) = (&self.sorted[range], samples.column(feature));
        if is_constant(sorted, column) {
            return false;
        }
        let rows = NodeRows { sorted, column, labels: samples.labels(), weights };
        let totals = &self.building.node_weights;
        best_of_feature(&rows, feature, rules.min_rows_leaf, totals, &mut self.scan, best);
        true
    }

    /// Sorts the rows of a node by a feature into `sorted`.
    fn sort_rows(&mut self, pending: &Pending, feature: usize) {
        let ranks = self.presorted.rank(feature);
        let rows = &self.rows[pending.start..pending.end];
        self.keys.clear();
        let key = |&row: &u32| u64::from(ranks[row as usize]) << 32 | u64::from(row);
        self.keys.extend(rows.iter().map(key));
        sort_by_rank(&mut self.keys, &mut self.spare_keys);
        self.sorted.clear();
        self.sorted.extend(self.keys.iter().map(|&key| key as u32));
    }

    /// Divides the rows of a node between its children; returns the start of the right ones.
    fn divide(&mut self, pending: &Pending, best: &Candidate) -> usize {
        let rules = self.growth.rules;
        let column = self.growth.samples.column(best.feature);
        let missing_left = best.missing_left == Some(true);
        for &row in &self.rows[pending.start..pending.end] {
            let value = column[row as usize];
            self.goes_left[row as usize] =
                value <= best.threshold || (missing_left && value.is_nan());
        }
        let stride = self.rows.len();
        let (goes_left, spare) = (&self.goes_left, &mut self.spare);
        let left = partition(&mut self.rows[pending.start..pending.end], goes_left, spare);
        let largest = left.max(pending.end - pending.start - left);
        if rules.may_split(largest, pending.depth + 1) && !draws(self.growth) {
            for &feature in &pending.features {
                let feature = feature as usize;
                // The rows sorted by the split's own feature are already divided, except for rows without a value,
                // which come last.
                if feature != best.feature || missing_left {
                    let first = feature * stride;
                    let sorted = &mut self.sorted[first + pending.start..first + pending.end];
                    partition(sorted, goes_left, spare);
                }
            }
        }
        pending.start + left
    }
}

/// Sorts keys by their upper halves; the lower halves already ascend. With enough keys it is a counting sort of two
/// bytes.
fn sort_by_rank(keys: &mut Vec<u64>, spare: &mut Vec<u64>) {
    const FEW: usize = 128;
    let largest = keys.iter().max().map_or(0, |key| key >> 32);
    if keys.len() < FEW || largest > u64::from(u16::MAX) {
        keys.sort_unstable();
        return;
    }
    spare.resize(keys.len(), 0);
    for shift in [32, 40] {
        let digit = |key: u64| (key >> shift) as usize & 0xFF;
        let mut next = [0; 256];
        keys.iter().for_each(|&key| next[digit(key)] += 1);
        let mut sum = 0;
        for place in &mut next {
            sum += core::mem::replace(place, sum);
        }
        for &key in keys.iter() {
            let place = &mut next[digit(key)];
            spare[*place] = key;
            *place += 1;
        }
        core::mem::swap(keys, spare);
    }
}

/// Whether features are drawn at random for each split.
fn draws(growth: &Growth) -> bool {
    growth.rules.drawn_features < growth.samples.features()
}

/// Whether a feature separates no rows: all have the same value, or all have none.
fn is_constant(sorted: &[u32], column: &[f64]) -> bool {
    let first = column[sorted[0] as usize];
    first == column[sorted[sorted.len() - 1] as usize] || first.is_nan()
}

/// Moves the rows that go left to the front and keeps the order on both sides. Returns the number of left rows.
fn partition(rows: &mut [u32], goes_left: &[bool], spare: &mut [u32]) -> usize {
    let (mut left, mut right) = (0, 0);
    for place in 0..rows.len() {
        // Writes both and keeps one, to avoid a branch misprediction.
        let row = rows[place];
        let is_left = goes_left[row as usize];
        rows[left] = row;
        spare[right] = row;
        left += usize::from(is_left);
        right += usize::from(!is_left);
    }
    rows[left..].copy_from_slice(&spare[..right]);
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_keys_are_sorted_as_few_are() {
        let mut random = Random::new(3);
        for (count, ranks) in [(1000, 7), (1000, 5000), (300, 70_000), (5, 3)] {
            let key = |row: u64, rank: usize| (rank as u64) << 32 | row;
            let mut keys: Vec<u64> = (0..count).map(|row| key(row, random.index(ranks))).collect();
            let mut expected = keys.clone();
            expected.sort_unstable();
            sort_by_rank(&mut keys, &mut Vec::new());
            assert_eq!(keys, expected, "{count} rows, {ranks} ranks");
        }
    }
}
