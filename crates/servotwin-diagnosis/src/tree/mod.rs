//! The decision tree: flat arrays for prediction, and the statistics of every node.
//!
//! One tree serves CART, random forest and AdaBoost. `servotwin-learning` grows it node by node. [`Branches`] is all
//! that prediction needs. [`Tree`] adds the counts and impurities that explain it. Nodes are numbered
//! in preorder: a node comes before its children, and the left child follows its parent.
//!
//! A row goes left if its value does not exceed the threshold. A row without a value (NaN) goes to the side learned in
//! training. The split search tries such rows on either side of every threshold, and alone.
//!
//! Source: Breiman, Friedman, Olshen, Stone, "Classification and Regression Trees", 1984.

mod render;

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require_sound, same_length};

/// Replaces the feature index of a leaf.
const LEAF: u32 = u32::MAX;

/// The deciding part of a tree: flat arrays with one entry per node.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Branches {
    feature: Vec<u32>,
    threshold: Vec<f64>,
    left: Vec<u32>,
    right: Vec<u32>,
    /// Whether rows without a value go left; empty for a tree trained without such rows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    missing_left: Vec<bool>,
}

impl Branches {
    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        self.feature.len()
    }

    /// The test of a node as (feature, threshold); `None` for a leaf.
    pub fn split(&self, node: usize) -> Option<(usize, f64)> {
        let feature = self.feature[node];
        (feature != LEAF).then(|| (feature as usize, self.threshold[node]))
    }

    /// Left and right child of a node; `None` for a leaf.
    pub fn children(&self, node: usize) -> Option<(usize, usize)> {
        let inner = self.feature[node] != LEAF;
        inner.then(|| (self.left[node] as usize, self.right[node] as usize))
    }

    /// The leaf of a row of features. Does not allocate.
    ///
    /// For a NaN, [`Branches::missing_left`] decides.
    ///
    /// # Panics
    /// If the row has fewer features than the tree was trained with.
    pub fn leaf_of(&self, row: &[f64]) -> usize {
        let mut node = 0;
        while self.feature[node] != LEAF {
            let goes_left = self.goes_left(node, row[self.feature[node] as usize]);
            node = if goes_left { self.left[node] } else { self.right[node] } as usize;
        }
        node
    }

    /// The node numbers from the root to the leaf of a row. Does not allocate.
    ///
    /// # Panics
    /// While iterating, if the row has fewer features than the tree was trained with.
    pub(crate) fn path<'a>(&'a self, row: &'a [f64]) -> impl Iterator<Item = usize> + 'a {
        core::iter::successors(Some(0), move |&node| {
            let (feature, _) = self.split(node)?;
            let (left, right) = self.children(node)?;
            Some(if self.goes_left(node, row[feature]) { left } else { right })
        })
    }

    /// Whether a value goes left at an inner node.
    fn goes_left(&self, node: usize, value: f64) -> bool {
        value <= self.threshold[node] || (value.is_nan() && self.missing_left(node))
    }

    /// Whether rows without a value go left at an inner node. In a tree trained without such rows they go right, which
    /// is arbitrary.
    pub fn missing_left(&self, node: usize) -> bool {
        self.missing_left.get(node).copied().unwrap_or(false)
    }

    /// The tests of all inner nodes as (feature, threshold).
    pub fn splits(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..self.node_count()).filter_map(|node| self.split(node))
    }

    /// Whether the tree was trained with rows without a value.
    pub(crate) fn knows_missing(&self) -> bool {
        !self.missing_left.is_empty()
    }

    /// Checks equal lengths, and that children come after their parent, so that every walk ends.
    pub(crate) fn check(&self, features: usize) -> Result<(), Error> {
        let nodes = self.node_count();
        for length in [self.threshold.len(), self.left.len(), self.right.len()] {
            same_length("tree nodes", nodes, length)?;
        }
        if self.knows_missing() {
            same_length("tree nodes", nodes, self.missing_left.len())?;
        }
        let sound = |node: usize| {
            let behind = |child: u32| child as usize > node && (child as usize) < nodes;
            let feature = self.feature[node];
            feature == LEAF
                || ((feature as usize) < features
                    && behind(self.left[node])
                    && behind(self.right[node]))
        };
        let all_sound = nodes > 0 && (0..nodes).all(sound);
        require_sound(all_sound, "tree nodes must point to later nodes")
    }

    /// Adds a leaf and returns its number; `knows_missing` must be the same for all nodes.
    pub fn push_leaf(&mut self, knows_missing: bool) -> usize {
        if knows_missing {
            self.missing_left.push(false);
        }
        self.feature.push(LEAF);
        self.threshold.push(0.0);
        self.left.push(0);
        self.right.push(0);
        self.node_count() - 1
    }

    /// Turns a leaf into a test with these children.
    pub fn ask(&mut self, node: usize, feature: usize, threshold: f64, left: usize, right: usize) {
        self.feature[node] = feature as u32;
        self.threshold[node] = threshold;
        self.left[node] = left as u32;
        self.right[node] = right as u32;
    }
}

/// The statistics of a leaf, for reports.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafReport {
    /// Number of the node.
    pub node: usize,
    /// The class that it decides.
    pub(crate) class: u32,
    /// Share of the decided class among the weights of the leaf.
    pub purity: f64,
    /// Training rows in the leaf.
    pub rows: u32,
    /// Weight of these rows.
    pub(crate) weight: f64,
    /// Number of tests on the way to the leaf.
    pub depth: usize,
}

/// A grown decision tree with the statistics of its nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tree {
    features: usize,
    classes: usize,
    branches: Branches,
    decision: Vec<u32>,
    depth: Vec<u32>,
    /// Training rows per node and class, node-major.
    counts: Vec<u32>,
    /// Their weights per node and class, node-major.
    weights: Vec<f64>,
    impurity: Vec<f64>,
    decrease: Vec<f64>,
    /// Share of all training weight at the node.
    share: Vec<f64>,
}

/// The statistics of a new node.
#[derive(Debug, Clone, PartialEq)]
pub struct NewNode {
    /// The class that it decides.
    pub decision: u32,
    /// Number of tests above it.
    pub depth: usize,
    /// Training rows of each class.
    pub counts: Vec<u32>,
    /// Training weight of each class.
    pub weights: Vec<f64>,
    /// Impurity of the training rows at the node.
    pub impurity: f64,
    /// Share of all training weight.
    pub share: f64,
}

impl Tree {
    /// A tree without nodes.
    pub fn new(features: usize, classes: usize) -> Self {
        Tree {
            features,
            classes,
            branches: Branches::default(),
            decision: vec![],
            depth: vec![],
            counts: vec![],
            weights: vec![],
            impurity: vec![],
            decrease: vec![],
            share: vec![],
        }
    }

    /// Adds a leaf and returns its number; `knows_missing` must be the same for all nodes.
    pub fn add_leaf(&mut self, node: NewNode, knows_missing: bool) -> usize {
        self.decision.push(node.decision);
        self.depth.push(node.depth as u32);
        self.counts.extend(node.counts);
        self.weights.extend(node.weights);
        self.impurity.push(node.impurity);
        self.decrease.push(0.0);
        self.share.push(node.share);
        self.branches.push_leaf(knows_missing)
    }

    /// Turns a leaf into a test with this impurity decrease. [`Tree::set_child`] sets its children.
    pub fn ask(&mut self, node: usize, feature: usize, threshold: f64, decrease: f64) {
        self.branches.feature[node] = feature as u32;
        self.branches.threshold[node] = threshold;
        self.decrease[node] = decrease;
    }

    /// Sets the left or right child of an inner node.
    pub fn set_child(&mut self, node: usize, is_right: bool, child: usize) {
        let children = if is_right { &mut self.branches.right } else { &mut self.branches.left };
        children[node] = child as u32;
    }

    /// Sets whether rows without a value go left at a node; for trees trained with missing values.
    pub fn set_missing_left(&mut self, node: usize, goes_left: bool) {
        self.branches.missing_left[node] = goes_left;
    }

    /// Sets the threshold of an inner node.
    pub fn set_threshold(&mut self, node: usize, threshold: f64) {
        self.branches.threshold[node] = threshold;
    }

    /// Number of features in a row.
    pub(crate) fn features(&self) -> usize {
        self.features
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// Number of nodes, leaves included.
    pub fn nodes(&self) -> usize {
        self.branches.node_count()
    }

    /// The arrays for prediction.
    pub fn branches(&self) -> &Branches {
        &self.branches
    }

    /// The test of a node as (feature, threshold); `None` for a leaf.
    pub fn split(&self, node: usize) -> Option<(usize, f64)> {
        self.branches.split(node)
    }

    /// Left and right child of a node; `None` for a leaf.
    pub fn children(&self, node: usize) -> Option<(usize, usize)> {
        self.branches.children(node)
    }

    /// The class that a node decides, or would decide after pruning there.
    pub fn decision(&self, node: usize) -> u32 {
        self.decision[node]
    }

    /// Training rows of each class at a node.
    pub fn counts(&self, node: usize) -> &[u32] {
        &self.counts[node * self.classes..(node + 1) * self.classes]
    }

    /// Training weight of each class at a node.
    pub fn weights(&self, node: usize) -> &[f64] {
        &self.weights[node * self.classes..(node + 1) * self.classes]
    }

    /// Impurity of a node, with altered priors if costs enter the impurity.
    pub fn impurity(&self, node: usize) -> f64 {
        self.impurity[node]
    }

    /// Impurity decrease by the split of a node, weighted by the share of samples there; 0 for a leaf.
    pub fn decrease(&self, node: usize) -> f64 {
        self.decrease[node]
    }

    /// Share of all training weight at a node, with altered priors if costs enter the impurity.
    pub fn share(&self, node: usize) -> f64 {
        self.share[node]
    }

    /// Share of the decided class among the weights at a node, in 0..=1.
    pub fn purity(&self, node: usize) -> f64 {
        let weights = self.weights(node);
        weights[self.decision[node] as usize] / weights.iter().sum::<f64>()
    }

    /// Number of tests above a node.
    pub fn node_depth(&self, node: usize) -> usize {
        self.depth[node] as usize
    }

    /// Largest number of tests on the way to a leaf.
    pub fn depth(&self) -> usize {
        self.depth.iter().copied().max().unwrap_or(0) as usize
    }

    /// The node numbers from the root to the leaf of a row. Does not allocate.
    ///
    /// # Panics
    /// While iterating, if the row has fewer features than the tree was trained with.
    pub fn decision_path<'a>(&'a self, row: &'a [f64]) -> impl Iterator<Item = usize> + 'a {
        self.branches.path(row)
    }

    /// Share of each feature in the total impurity decrease; sums to 1, or all 0 for a tree without splits.
    pub fn importances(&self) -> Vec<f64> {
        let mut importances = vec![0.0; self.features];
        for node in 0..self.nodes() {
            if let Some((feature, _)) = self.split(node) {
                importances[feature] += self.decrease[node];
            }
        }
        let total: f64 = importances.iter().sum();
        if total > 0.0 {
            importances.iter_mut().for_each(|importance| *importance /= total);
        }
        importances
    }

    /// All leaves, the least pure first; of equally pure ones the heavier, then the lower number.
    pub fn leaves(&self) -> Vec<LeafReport> {
        let is_leaf = |node: &usize| self.split(*node).is_none();
        let mut leaves: Vec<_> =
            (0..self.nodes()).filter(is_leaf).map(|node| self.report(node)).collect();
        leaves.sort_by(|a, b| a.purity.total_cmp(&b.purity).then(b.weight.total_cmp(&a.weight)));
        leaves
    }

    fn report(&self, node: usize) -> LeafReport {
        LeafReport {
            node,
            class: self.decision[node],
            purity: self.purity(node),
            rows: self.counts(node).iter().sum(),
            weight: self.weights(node).iter().sum(),
            depth: self.node_depth(node),
        }
    }

    /// Writes the share of each class in the leaf of a row into `scores`.
    pub(crate) fn shares_into(&self, row: &[f64], scores: &mut [f64]) {
        let weights = self.weights(self.branches.leaf_of(row));
        let total: f64 = weights.iter().sum();
        for (score, weight) in scores.iter_mut().zip(weights) {
            *score = weight / total;
        }
    }

    /// Checks a loaded tree.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.branches.check(self.features)?;
        let nodes = self.nodes();
        let (decision, depth) = (self.decision.len(), self.depth.len());
        let statistics = [&self.impurity, &self.decrease, &self.share].map(Vec::len);
        for length in [decision, depth].into_iter().chain(statistics) {
            same_length("tree nodes", nodes, length)?;
        }
        same_length("tree counts", nodes * self.classes, self.counts.len())?;
        same_length("tree weights", nodes * self.classes, self.weights.len())?;
        let known = self.decision.iter().all(|&class| (class as usize) < self.classes);
        require_sound(known, "tree leaves must decide known classes")
    }
}
