//! Growing a tree on binned features: the rows are counted by bin and class, and the search tries only thresholds
//! between bins.
//!
//! A node's counts are those of its rows. Of two children, the smaller is counted; the other's counts are the
//! difference to the parent's. If no feature has more values than bins, the tree is that of
//! [`grow`](super::grow::grow). Otherwise thresholds still lie halfway between two values of the node's rows.

use alloc::vec;
use alloc::vec::Vec;

use super::building::{Building, Growth, Parent};
use super::criterion::{CountEntropyScan, Criterion, GiniScan, Scan};
use super::histogram::Bins;
use super::split::{Candidate, divide_rows, separate};
use servotwin_diagnosis::tree::Tree;

/// Number of columns counted at once: their counts are independent of each other.
const TOGETHER: usize = 4;

/// Grows a tree on rows of weight 1 without missing values.
pub(crate) fn grow_binned(growth: &Growth, bins: &Bins) -> Tree {
    match growth.rules.criterion {
        Criterion::Gini => Grower::<GiniScan>::new(growth, bins).run(),
        Criterion::Entropy => Grower::<CountEntropyScan>::new(growth, bins).run(),
    }
}

/// A node with known rows that is not yet in the tree.
struct Pending {
    /// Its rows are `start..end` of the list.
    start: usize,
    end: usize,
    depth: usize,
    parent: Parent,
    /// Its rows in each bin of each column by class, if already known.
    counts: Option<Vec<u32>>,
}

struct Grower<'a, S> {
    growth: &'a Growth<'a>,
    bins: &'a Bins,
    building: Building<'a>,
    scan: S,
    /// The rows in use, grouped by node.
    rows: Vec<u32>,
    moving: Vec<u32>,
    /// The class of each row of a node.
    classes_of_rows: Vec<u32>,
    /// Buffers for reuse.
    idle: Vec<Vec<u32>>,
}

impl<'a, S: Scan + Default> Grower<'a, S> {
    fn new(growth: &'a Growth<'a>, bins: &'a Bins) -> Self {
        let rows = growth.rows();
        Grower {
            building: Building::new(growth, &rows),
            scan: S::default(),
            rows,
            moving: vec![],
            classes_of_rows: vec![],
            idle: vec![],
            growth,
            bins,
        }
    }

    fn run(mut self) -> Tree {
        let end = self.rows.len();
        let mut stack = vec![Pending { start: 0, end, depth: 0, parent: None, counts: None }];
        while let Some(Pending { start, end, depth, parent, counts }) = stack.pop() {
            let node = self.building.add_node(&self.rows[start..end], depth, parent);
            if !self.building.may_split(node, end - start) {
                self.idle.extend(counts);
                continue;
            }
            let counts = counts.unwrap_or_else(|| self.count(start, end));
            let Some(best) = self.choose_split(node, &counts) else {
                self.idle.push(counts);
                continue;
            };
            let middle = self.divide(node, start, end, &best);
            let [left, right] = self.counts_of_children([start, middle, end], depth + 1, counts);
            let child = |start, end, is_right, counts| Pending {
                start,
                end,
                depth: depth + 1,
                parent: Some((node, is_right)),
                counts,
            };
            // The left child is on top of the stack, so that nodes come in preorder.
            stack.push(child(middle, end, true, right));
            stack.push(child(start, middle, false, left));
        }
        self.building.tree
    }

    /// Number of counts for each column.
    fn stride(&self) -> usize {
        self.bins.max_bins() * self.growth.samples.classes()
    }

    /// Counts a range of rows.
    fn count(&mut self, start: usize, end: usize) -> Vec<u32> {
        let (stride, classes) = (self.stride(), self.growth.samples.classes());
        let length = self.bins.columns() * stride;
        let mut counts = self.idle.pop().unwrap_or_else(|| vec![0; length]);
        counts.fill(0);
        let rows = &self.rows[start..end];
        let labels = self.growth.samples.labels();
        self.classes_of_rows.clear();
        self.classes_of_rows.extend(rows.iter().map(|&row| labels[row as usize]));
        let columns: Vec<usize> = (0..self.bins.columns()).collect();
        let groups = counts.chunks_mut(TOGETHER * stride).zip(columns.chunks(TOGETHER));
        for (counts, columns) in groups {
            match *columns {
                [a, b, c, d] => {
                    let columns = [a, b, c, d].map(|column| self.bins.column(column));
                    add(columns, rows, &self.classes_of_rows, classes, counts, stride);
                }
                _ => {
                    for (counts, &column) in counts.chunks_mut(stride).zip(columns) {
                        let columns = [self.bins.column(column)];
                        add(columns, rows, &self.classes_of_rows, classes, counts, stride);
                    }
                }
            }
        }
        counts
    }

    /// The counts of both children if that is faster: few rows are counted faster than subtracted.
    fn counts_of_children(
        &mut self,
        [start, middle, end]: [usize; 3],
        depth: usize,
        mut counts: Vec<u32>,
    ) -> [Option<Vec<u32>>; 2] {
        let larger = (middle - start).max(end - middle);
        if !self.growth.rules.may_split(larger, depth) || larger < self.bins.max_bins() {
            self.idle.push(counts);
            return [None, None];
        }
        let left_is_smaller = middle - start <= end - middle;
        let of_smaller = match left_is_smaller {
            true => self.count(start, middle),
            false => self.count(middle, end),
        };
        for (count, part) in counts.iter_mut().zip(&of_smaller) {
            *count -= part;
        }
        match left_is_smaller {
            true => [Some(of_smaller), Some(counts)],
            false => [Some(counts), Some(of_smaller)],
        }
    }

    /// Finds the split of a node and writes it into the tree; `None` leaves the node a leaf.
    fn choose_split(&mut self, node: usize, counts: &[u32]) -> Option<Candidate> {
        let mut best = None;
        for (column, counts) in counts.chunks_exact(self.stride()).enumerate() {
            self.search(column, counts, &mut best);
        }
        self.building.settle(node, best)
    }

    /// Tries the thresholds between nonempty bins of a column.
    fn search(&mut self, column: usize, counts: &[u32], best: &mut Option<Candidate>) {
        let feature = self.bins.feature(column);
        let rules = self.growth.rules;
        let classes = self.growth.samples.classes();
        let in_bin = |counts: &[u32]| counts.iter().sum::<u32>();
        let bins = self.bins.bounds(column).iter().zip(counts.chunks_exact(classes));
        let mut bins = bins.filter(|(_, counts)| in_bin(counts) > 0).peekable();
        let last = bins.clone().last();
        let (Some((first, _)), Some((last, _))) = (bins.peek(), last) else { return };
        let range = last.1 - first.0;
        let total: f64 = self.building.node_weights.iter().sum();
        let (mut left, rows) = (0, total as usize);
        self.scan.restart(&self.building.node_weights);
        while let Some(((_, lower), counts)) = bins.next() {
            let Some(((upper, _), _)) = bins.peek() else { break };
            for (class, &count) in counts.iter().enumerate() {
                self.scan.move_many(class, count);
            }
            left += in_bin(counts) as usize;
            if left < rules.min_rows_leaf || rows - left < rules.min_rows_leaf {
                continue;
            }
            let score = self.scan.score();
            // First the comparison that nearly all thresholds fail.
            if best.is_some_and(|best| score < best.worth()) {
                continue;
            }
            let (threshold, margin) = (separate(*lower, *upper), (upper - lower) / range);
            let candidate = Candidate { feature, threshold, margin, score, missing_left: None };
            if candidate.beats(best) {
                *best = Some(candidate);
            }
        }
    }

    /// Moves the rows of a node to their sides and the threshold halfway between them. Returns the start of the right
    /// rows.
    fn divide(&mut self, node: usize, start: usize, end: usize, best: &Candidate) -> usize {
        let column = self.growth.samples.column(best.feature);
        let rows = &mut self.rows[start..end];
        let (left, low, high) =
            divide_rows(rows, &mut self.moving, column, |_, value| value <= best.threshold);
        self.building.tree.set_threshold(node, separate(low, high));
        start + left
    }
}

/// Counts rows in the bins of columns; the counts of two columns are `stride` entries apart.
fn add<const COLUMNS: usize>(
    columns: [&[u8]; COLUMNS],
    rows: &[u32],
    classes_of_rows: &[u32],
    classes: usize,
    counts: &mut [u32],
    stride: usize,
) {
    for (&row, &class) in rows.iter().zip(classes_of_rows) {
        for (place, column) in columns.iter().enumerate() {
            let bin = usize::from(column[row as usize]);
            counts[place * stride + bin * classes + class as usize] += 1;
        }
    }
}
