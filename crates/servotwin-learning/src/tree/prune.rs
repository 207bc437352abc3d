//! Minimal cost-complexity pruning: the weakest link is cut first.
//!
//! Source: Breiman et al. 1984, chapter 3. The risk of a node is its impurity times its share of the samples, as in
//! scikit-learn. The strength of a link is `g(t) = (R(t) − R(leaves below t)) / (number of leaves below t − 1)`.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::{Ordering, Reverse};

use servotwin_diagnosis::tree::{NewNode, RejectedSplit, Tree};

/// One tree of the pruning path.
#[derive(Debug, Clone, PartialEq)]
pub struct PruningStep {
    /// The smallest complexity cost for which this tree is optimal.
    pub alpha: f64,
    /// Its number of leaves.
    pub leaves: usize,
    /// Total impurity of its leaves, weighted by their share of samples.
    pub impurity: f64,
}

/// A link that may be cut; ordered by strength, then node.
#[derive(PartialEq)]
struct Link {
    strength: f64,
    node: usize,
    /// Leaves below at the time of the strength; an entry with another number is outdated.
    leaves: usize,
}

impl Eq for Link {}

impl PartialOrd for Link {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Link {
    fn cmp(&self, other: &Self) -> Ordering {
        self.strength.total_cmp(&other.strength).then(self.node.cmp(&other.node))
    }
}

/// The state of a tree during pruning.
struct Pruning<'a> {
    tree: &'a Tree,
    parent: Vec<Option<usize>>,
    /// Leaves below each node, 1 for a leaf; 0 after the node is cut off.
    leaves: Vec<usize>,
    /// Risk of those leaves.
    risk: Vec<f64>,
    links: BinaryHeap<Reverse<Link>>,
    alpha: f64,
}

impl<'a> Pruning<'a> {
    fn new(tree: &'a Tree) -> Self {
        let nodes = tree.nodes();
        let mut pruning = Pruning {
            tree,
            parent: vec![None; nodes],
            leaves: vec![1; nodes],
            risk: (0..nodes).map(|node| tree.impurity(node) * tree.share(node)).collect(),
            links: BinaryHeap::new(),
            alpha: 0.0,
        };
        for node in (0..nodes).rev() {
            if let Some((left, right)) = tree.children(node) {
                pruning.parent[left] = Some(node);
                pruning.parent[right] = Some(node);
                pruning.leaves[node] = pruning.leaves[left] + pruning.leaves[right];
                pruning.risk[node] = pruning.risk[left] + pruning.risk[right];
                pruning.push_link(node);
            }
        }
        pruning
    }

    fn own_risk(&self, node: usize) -> f64 {
        self.tree.impurity(node) * self.tree.share(node)
    }

    fn push_link(&mut self, node: usize) {
        let leaves = self.leaves[node];
        let strength = (self.own_risk(node) - self.risk[node]) / (leaves - 1) as f64;
        self.links.push(Reverse(Link { strength: strength.max(0.0), node, leaves }));
    }

    /// Cuts the weakest link unless it is stronger than `limit`; returns whether it did.
    fn cut_weakest(&mut self, limit: f64) -> bool {
        while let Some(Reverse(link)) = self.links.pop() {
            if self.leaves[link.node] != link.leaves {
                continue;
            }
            if link.strength > limit {
                return false;
            }
            self.alpha = self.alpha.max(link.strength);
            self.cut(link.node);
            return true;
        }
        false
    }

    /// Makes a node a leaf.
    fn cut(&mut self, node: usize) {
        let lost_leaves = self.leaves[node] - 1;
        let more_risk = self.own_risk(node) - self.risk[node];
        self.forget_below(node);
        self.leaves[node] = 1;
        self.risk[node] = self.own_risk(node);
        let mut above = self.parent[node];
        while let Some(ancestor) = above {
            self.leaves[ancestor] -= lost_leaves;
            self.risk[ancestor] += more_risk;
            self.push_link(ancestor);
            above = self.parent[ancestor];
        }
    }

    fn forget_below(&mut self, node: usize) {
        let mut stack = vec![node];
        while let Some(node) = stack.pop() {
            if let Some((left, right)) = self.tree.children(node) {
                // Nodes below a leaf of the pruned tree are already marked.
                if self.leaves[node] > 1 {
                    stack.extend([left, right]);
                }
            }
            self.leaves[node] = 0;
        }
    }

    fn step(&self) -> PruningStep {
        PruningStep { alpha: self.alpha, leaves: self.leaves[0], impurity: self.risk[0] }
    }
}

/// All trees of minimal cost-complexity pruning, from the whole tree (alpha 0) to the root alone. There is one step for
/// each link cut, and alpha never falls.
pub fn pruning_path(tree: &Tree) -> Vec<PruningStep> {
    let mut pruning = Pruning::new(tree);
    let mut path = vec![pruning.step()];
    while pruning.cut_weakest(f64::INFINITY) {
        path.push(pruning.step());
    }
    path
}

/// Cuts every link with a strength of at most `alpha`. The result is a subtree with the same root, renumbered in
/// preorder.
pub fn prune(tree: &Tree, alpha: f64) -> Tree {
    let mut pruning = Pruning::new(tree);
    while pruning.cut_weakest(alpha) {}
    copy_kept(tree, &pruning.leaves)
}

/// Copies the nodes with remaining leaves.
fn copy_kept(tree: &Tree, leaves: &[usize]) -> Tree {
    let mut place = vec![0; tree.nodes()];
    let kept: Vec<usize> = (0..tree.nodes()).filter(|&node| leaves[node] > 0).collect();
    for (new, &old) in kept.iter().enumerate() {
        place[old] = new;
    }
    let branches = tree.branches();
    let mut pruned = Tree::new(tree.features(), tree.classes());
    for &old in &kept {
        let new = NewNode {
            decision: tree.decision(old),
            depth: tree.node_depth(old),
            counts: tree.counts(old).to_vec(),
            weights: tree.weights(old).to_vec(),
            impurity: tree.impurity(old),
            share: tree.share(old),
        };
        let node = pruned.add_leaf(new, branches.knows_missing());
        let question = tree.split(old).zip(tree.children(old)).filter(|_| leaves[old] > 1);
        if let Some(((feature, threshold), (left, right))) = question {
            pruned.ask(node, feature, threshold, tree.decrease(old));
            pruned.set_child(node, false, place[left]);
            pruned.set_child(node, true, place[right]);
            if branches.knows_missing() {
                pruned.set_missing_left(node, branches.missing_left(old));
            }
        }
    }
    for split in tree.rejected().iter().filter(|split| leaves[split.node] > 0) {
        pruned.reject(RejectedSplit { node: place[split.node], ..split.clone() });
    }
    pruned
}
