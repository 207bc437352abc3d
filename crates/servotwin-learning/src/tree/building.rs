//! A tree under construction, independent of the split search.

use alloc::vec;
use alloc::vec::Vec;

use super::criterion::Criterion;
use super::split::{Candidate, SplitLimits};
use crate::samples::Samples;
use servotwin_diagnosis::numeric::arg_max;
use servotwin_diagnosis::tree::{NewNode, RejectedSplit, Tree};

/// Maximum number of rejected splits kept for a node.
const REJECTED_PER_NODE: usize = 3;

/// A node with a smaller impurity is not split; it covers the rounding of a pure node's impurity.
const PURE: f64 = f64::EPSILON;

/// Costs of wrong decisions: `costs[true class][decided class]`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SplitCosts(pub Vec<Vec<f64>>);

impl SplitCosts {
    /// The class with the smallest expected cost for these class weights, the lowest in a tie.
    fn decide(&self, weights: &[f64]) -> usize {
        let cost_of = |class: usize| -> f64 {
            weights.iter().zip(&self.0).map(|(weight, row)| weight * row[class]).sum()
        };
        arg_max((0..weights.len()).map(|class| -cost_of(class)))
    }

    /// The costs of each true class, summed: the factors of the altered priors (Breiman et al. 1984, section 4.4.3).
    pub(crate) fn prior_factors(&self) -> Vec<f64> {
        self.0.iter().map(|row| row.iter().sum()).collect()
    }
}

/// Rules of splitting.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SplitRules {
    pub criterion: Criterion,
    pub max_depth: usize,
    pub min_rows_split: usize,
    pub min_rows_leaf: usize,
    pub min_impurity_decrease: f64,
    /// The features that splits may use, ascending, not empty.
    pub features: Vec<usize>,
    /// Number of features drawn for each split; all if not less than `features.len()`.
    pub drawn_features: usize,
    /// Limits for every feature of the samples, or empty for none.
    pub limits: Vec<SplitLimits>,
    pub costs: Option<SplitCosts>,
}

impl SplitRules {
    /// The limits of a feature.
    pub(crate) fn limits_of(&self, feature: usize) -> SplitLimits {
        self.limits.get(feature).copied().unwrap_or_default()
    }

    /// Whether a node with this many rows at this depth may be split.
    pub(crate) fn may_split(&self, rows: usize, depth: usize) -> bool {
        depth < self.max_depth && rows >= self.min_rows_split.max(2 * self.min_rows_leaf)
    }
}

/// The data and rules that a tree is grown from.
pub(crate) struct Growth<'a> {
    pub samples: &'a Samples,
    /// Weight of each row in counts and decisions; rows of weight 0 are ignored.
    pub weights: &'a [f64],
    /// Weight of each row in the impurity.
    pub impurity_weights: &'a [f64],
    pub rules: &'a SplitRules,
}

impl Growth<'_> {
    /// The rows with a positive weight.
    pub(crate) fn rows(&self) -> Vec<u32> {
        let used = |row: &u32| self.weights[*row as usize] > 0.0;
        (0..self.samples.rows() as u32).filter(used).collect()
    }

    /// Whether counting suffices: each row has the impurity weight one or zero.
    pub(crate) fn is_counted(&self) -> bool {
        self.impurity_weights.iter().all(|&weight| weight == 1.0 || weight == 0.0)
    }
}

/// The parent of a node and whether it is the right child; `None` for the root.
pub(super) type Parent = Option<(usize, bool)>;

/// A tree under construction. The current node is the last one added.
pub(super) struct Building<'a> {
    pub growth: &'a Growth<'a>,
    pub tree: Tree,
    total_weight: f64,
    /// Impurity weights of the classes at the current node.
    pub node_weights: Vec<f64>,
}

impl<'a> Building<'a> {
    pub(crate) fn new(growth: &'a Growth<'a>, rows: &[u32]) -> Self {
        Building {
            tree: Tree::new(growth.samples.features(), growth.samples.classes()),
            total_weight: rows.iter().map(|&row| growth.impurity_weights[row as usize]).sum(),
            node_weights: vec![],
            growth,
        }
    }

    /// Adds a leaf with its counts; [`Building::settle`] may make it an inner node.
    pub(crate) fn add_node(&mut self, rows: &[u32], depth: usize, parent: Parent) -> usize {
        let growth = self.growth;
        let classes = self.tree.classes();
        let mut counts = vec![0; classes];
        let mut weights = vec![0.0; classes];
        self.node_weights.clear();
        self.node_weights.resize(classes, 0.0);
        for &row in rows {
            let row = row as usize;
            let class = growth.samples.labels()[row] as usize;
            counts[class] += 1;
            weights[class] += growth.weights[row];
            self.node_weights[class] += growth.impurity_weights[row];
        }
        let decision = match &growth.rules.costs {
            Some(costs) => costs.decide(&weights),
            None => arg_max(weights.iter().copied()),
        };
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

    /// Writes the search result of a node into the tree; `None` leaves the node a leaf.
    pub(crate) fn settle(
        &mut self,
        node: usize,
        best: Option<Candidate>,
        forbidden: Vec<Candidate>,
    ) -> Option<Candidate> {
        self.keep_rejected(node, &best, forbidden);
        let best = best?;
        let decrease = self.decrease_of(node, &best);
        if decrease + f64::EPSILON < self.growth.rules.min_impurity_decrease {
            return None;
        }
        // A useless split (needed for patterns such as exclusive-or) may round below zero.
        self.tree.ask(node, best.feature, best.threshold, decrease.max(0.0));
        Some(best)
    }

    fn decrease_of(&self, node: usize, candidate: &Candidate) -> f64 {
        let total: f64 = self.node_weights.iter().sum();
        let children = self.growth.rules.criterion.of_children(candidate.score, total);
        self.tree.share(node) * (self.tree.impurity(node) - children)
    }

    fn keep_rejected(
        &mut self,
        node: usize,
        best: &Option<Candidate>,
        mut forbidden: Vec<Candidate>,
    ) {
        forbidden.retain(|candidate| best.is_none_or(|best| candidate.score > best.score));
        forbidden.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.feature.cmp(&b.feature)));
        for candidate in forbidden.into_iter().take(REJECTED_PER_NODE) {
            let decrease = self.decrease_of(node, &candidate);
            let Candidate { feature, threshold, gap, .. } = candidate;
            self.tree.reject(RejectedSplit { node, feature, threshold, gap, decrease });
        }
    }
}
