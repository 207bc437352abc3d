//! A tree under construction, independent of the split search.

use alloc::vec;
use alloc::vec::Vec;

use super::criterion::Criterion;
use super::split::Candidate;
use crate::samples::Samples;
use servotwin_diagnosis::numeric::arg_max;
use servotwin_diagnosis::tree::{NewNode, Tree};

/// A node with a smaller impurity is not split; it covers the rounding of a pure node's impurity.
const PURE: f64 = f64::EPSILON;

/// Rules of splitting.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SplitRules {
    pub(crate) criterion: Criterion,
    pub(crate) max_depth: usize,
    pub(crate) min_rows_split: usize,
    pub(crate) min_rows_leaf: usize,
    pub(crate) min_impurity_decrease: f64,
    /// Number of features drawn for each split; all if there are no more.
    pub(crate) drawn_features: usize,
}

impl SplitRules {
    /// Whether a node with this many rows at this depth may be split.
    pub(crate) fn may_split(&self, rows: usize, depth: usize) -> bool {
        depth < self.max_depth && rows >= self.min_rows_split.max(2 * self.min_rows_leaf)
    }
}

/// The data and rules that a tree is grown from.
pub(crate) struct Growth<'a> {
    pub(crate) samples: &'a Samples,
    /// Weight of each row; rows of weight 0 are ignored.
    pub(crate) weights: &'a [f64],
    pub(crate) rules: &'a SplitRules,
}

impl Growth<'_> {
    /// The rows with a positive weight.
    pub(crate) fn rows(&self) -> Vec<u32> {
        let used = |row: &u32| self.weights[*row as usize] > 0.0;
        (0..self.samples.rows() as u32).filter(used).collect()
    }

    /// Whether counting suffices: each row has the weight one or zero.
    pub(crate) fn is_counted(&self) -> bool {
        self.weights.iter().all(|&weight| weight == 1.0 || weight == 0.0)
    }
}

/// The parent of a node and whether it is the right child; `None` for the root.
pub(super) type Parent = Option<(usize, bool)>;

/// A tree under construction. The current node is the last one added.
pub(super) struct Building<'a> {
    pub(crate) growth: &'a Growth<'a>,
    pub(crate) tree: Tree,
    total_weight: f64,
    /// Weights of the classes at the current node.
    pub(crate) node_weights: Vec<f64>,
}

impl<'a> Building<'a> {
    pub(crate) fn new(growth: &'a Growth<'a>, rows: &[u32]) -> Self {
        Building {
            tree: Tree::new(growth.samples.features(), growth.samples.classes()),
            total_weight: rows.iter().map(|&row| growth.weights[row as usize]).sum(),
            node_weights: vec![],
            growth,
        }
    }

    /// Adds a leaf with its counts; [`Building::settle`] may make it an inner node.
    pub(crate) fn add_node(&mut self, rows: &[u32], depth: usize, parent: Parent) -> usize {
        let growth = self.growth;
        let classes = self.tree.classes();
        let mut counts = vec![0; classes];
        self.node_weights.clear();
        self.node_weights.resize(classes, 0.0);
        for &row in rows {
            let row = row as usize;
            let class = growth.samples.labels()[row] as usize;
            counts[class] += 1;
            self.node_weights[class] += growth.weights[row];
        }
        let decision = arg_max(self.node_weights.iter().copied());
        let weights = self.node_weights.clone();
        let share = self.node_weights.iter().sum::<f64>() / self.total_weight;
        let impurity = growth.rules.criterion.impurity(&self.node_weights);
        let new = NewNode { decision: decision as u32, depth, counts, weights, impurity, share };
        let node = self.tree.add_leaf(new, growth.samples.has_missing());
        if let Some((parent, is_right)) = parent {
            self.tree.set_child(parent, is_right, node);
        }
        node
    }

    /// Whether to search a split of a node.
    pub(crate) fn may_split(&self, node: usize, rows: usize) -> bool {
        let depth = self.tree.node_depth(node);
        self.growth.rules.may_split(rows, depth) && self.tree.impurity(node) > PURE
    }

    /// Writes the split of a node into the tree; `None` leaves the node a leaf.
    pub(crate) fn settle(&mut self, node: usize, best: Option<Candidate>) -> Option<Candidate> {
        let best = best?;
        let total: f64 = self.node_weights.iter().sum();
        let children = self.growth.rules.criterion.of_children(best.score, total);
        let decrease = self.tree.share(node) * (self.tree.impurity(node) - children);
        if decrease + f64::EPSILON < self.growth.rules.min_impurity_decrease {
            return None;
        }
        // A useless split (needed for patterns such as exclusive-or) may round below zero.
        self.tree.ask(node, best.feature, best.threshold, decrease.max(0.0));
        Some(best)
    }
}
