//! Gradient-boosted trees: each shallow tree corrects the sum of its predecessors for every class, and softmax turns
//! the sums into probabilities.
//!
//! The loss is `Σ weight · (−log p(label))`. For each class, its gradient is `g = weight · (p − [is label])` and the
//! diagonal of its second derivative is `h = weight · p · (1 − p)`. A leaf adds the Newton step `−rate · G / (H + λ)`
//! with G and H the sums over its rows. The gain of a split is its increase of `Σ G² / (H + λ)` over leaves and
//! classes. One tree serves all classes: its leaves hold a number for each, or one number for two classes. Each tree
//! draws its own features.
//!
//! Sources: Friedman, "Greedy Function Approximation: A Gradient Boosting Machine", Annals of
//! Statistics 29, 2001; Chen and Guestrin, "XGBoost: A Scalable Tree Boosting System", KDD 2016.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use serde::{Deserialize, Serialize};

use super::Fit;
use crate::samples::{PresentClasses, Samples};
use crate::tree::{Bins, divide_rows, separate};
use servotwin_diagnosis::classifiers::boosted_trees::{AddingTree, Model};
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::numeric::softmax;
use servotwin_diagnosis::random::Random;

/// Maximum number of trees, which keeps a model small enough for review and certification.
pub const MAX_TREES: usize = 64;

/// Maximum number of tests above a leaf.
pub const MAX_DEPTH: usize = 6;

/// A split must be better than another by this factor; smaller differences are rounding.
const BETTER: f64 = 1.0 + 1e-9;

/// Settings of gradient-boosted trees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Number of trees; at least 1, at most [`MAX_TREES`].
    pub trees: usize,
    /// Depth of each tree; at least 1, at most [`MAX_DEPTH`].
    pub max_depth: usize,
    /// Factor on the contribution of each tree; above 0, at most 1.
    pub learning_rate: f64,
    /// Penalty λ on the squares of the leaf values; above 0.
    pub lambda: f64,
    /// Minimum second derivative on both sides of a split, summed over rows and classes; not negative. A row of weight
    /// 1 contributes at most 1/4 a class, and less the more certain its class is.
    pub min_curvature_leaf: f64,
    /// Share of the features that each tree draws; above 0, at most 1.
    pub feature_share: f64,
    /// Maximum number of bins of a feature's values; thresholds lie between bins; 2 to 256.
    pub max_bins: usize,
    /// Seed of the drawn features.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            trees: 60,
            max_depth: 4,
            learning_rate: 0.15,
            lambda: 1.0,
            min_curvature_leaf: 0.1,
            feature_share: 0.3,
            max_bins: 64,
            seed: 0,
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), Error> {
        let (trees, depth, bins) = (self.trees, self.max_depth, self.max_bins);
        let (rate, share) = (self.learning_rate, self.feature_share);
        let (lambda, curvature) = (self.lambda, self.min_curvature_leaf);
        require((1..=MAX_TREES).contains(&trees), "trees", trees as f64, "1 to 64")?;
        require((1..=MAX_DEPTH).contains(&depth), "max_depth", depth as f64, "1 to 6")?;
        require(rate > 0.0 && rate <= 1.0, "learning_rate", rate, "> 0 and <= 1")?;
        require(lambda.is_finite() && lambda > 0.0, "lambda", lambda, "> 0")?;
        let is_curvature = curvature.is_finite() && curvature >= 0.0;
        require(is_curvature, "min_curvature_leaf", curvature, ">= 0")?;
        require(share > 0.0 && share <= 1.0, "feature_share", share, "> 0 and <= 1")?;
        require((2..=256).contains(&bins), "max_bins", bins as f64, "2 to 256")
    }
}

/// The model before its first tree.
fn without_trees(samples: &Samples, present: &PresentClasses) -> Model {
    let (fixed, whole) = match present.len() {
        0..=2 => (1, present.weights[0]),
        _ => (0, present.total_weight()),
    };
    let prior = |weight: &f64| libm::log(*weight) - libm::log(whole);
    Model {
        features: samples.features(),
        classes: samples.classes(),
        present: present.labels.clone(),
        priors: present.weights[fixed..].iter().map(prior).collect(),
        trees: vec![],
    }
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        self.check()?;
        samples.complete()?;
        let mut model = without_trees(samples, &PresentClasses::new(samples));
        let has_weight = |row: &u32| samples.weight(*row as usize) > 0.0;
        let rows: Vec<u32> = (0..samples.rows() as u32).filter(has_weight).collect();
        let bins = Bins::new(samples, &rows, self.max_bins);
        if bins.columns() == 0 || model.outputs().is_empty() {
            return Ok(model);
        }
        let mut random = Random::new(self.seed);
        let mut grower = Grower::new(self, samples, &bins, rows, &model);
        for _ in 0..self.trees {
            grower.derive(samples, &model);
            grower.draw(&mut random);
            let tree = grower.grow();
            model.trees.push(tree);
        }
        Ok(model)
    }
}

/// A possible split of a node.
struct Candidate {
    column: usize,
    /// The last bin on the left.
    bin: usize,
}

/// A node that has been split.
struct Divided {
    feature: usize,
    threshold: f64,
    /// Start of the rows on the right.
    middle: usize,
}

/// Grows one tree after another.
struct Grower<'a> {
    settings: &'a Settings,
    samples: &'a Samples,
    bins: &'a Bins,
    outputs: usize,
    /// Row-major: the sum of all previous trees for each output.
    scores: Vec<f64>,
    /// Row-major: the gradients of all outputs, then their second derivatives.
    parts: Vec<f64>,
    /// The drawn columns, ascending.
    columns: Vec<usize>,
    /// The training rows, grouped by node.
    rows: Vec<u32>,
    tree: AddingTree,
    /// Rows on their way to the right child.
    moving: Vec<u32>,
    /// Contiguous copy of the parts of a node's rows.
    gathered: Vec<f64>,
    /// Histogram buffers for reuse.
    idle: Vec<Vec<f64>>,
}

impl<'a> Grower<'a> {
    fn new(
        settings: &'a Settings,
        samples: &'a Samples,
        bins: &'a Bins,
        rows: Vec<u32>,
        model: &Model,
    ) -> Self {
        let outputs = model.outputs().len();
        Grower {
            settings,
            samples,
            bins,
            outputs,
            scores: model.priors.repeat(samples.rows()),
            parts: vec![0.0; samples.rows() * 2 * outputs],
            columns: vec![],
            rows,
            tree: AddingTree::default(),
            moving: vec![],
            gathered: vec![],
            idle: vec![],
        }
    }

    /// Numbers for each row and bin.
    fn width(&self) -> usize {
        2 * self.outputs
    }

    /// Computes the derivatives of the loss.
    fn derive(&mut self, samples: &Samples, model: &Model) {
        let outputs = self.outputs;
        let fixed = model.present.len() - outputs;
        let mut shares = vec![0.0; model.present.len()];
        for &row in &self.rows {
            let row = row as usize;
            shares[0] = 0.0;
            shares[fixed..].copy_from_slice(&self.scores[row * outputs..][..outputs]);
            softmax(&mut shares);
            let (weight, label) = (samples.weight(row), samples.labels()[row]);
            let (gradients, curvatures) =
                self.parts[row * 2 * outputs..][..2 * outputs].split_at_mut(outputs);
            for (output, share) in shares[fixed..].iter().enumerate() {
                let is_label = f64::from(model.present[fixed + output] == label);
                gradients[output] = weight * (share - is_label);
                curvatures[output] = weight * share * (1.0 - share);
            }
        }
    }

    /// Draws the columns of the next tree.
    fn draw(&mut self, random: &mut Random) {
        let all = self.bins.columns();
        let count = libm::ceil(self.settings.feature_share * all as f64) as usize;
        self.columns = (0..all).collect();
        random.shuffle(&mut self.columns);
        self.columns.truncate(count);
        self.columns.sort_unstable();
    }

    /// Grows the next tree and adds it to the scores.
    fn grow(&mut self) -> AddingTree {
        let all = 0..self.rows.len();
        let sums = self.sums_of(all.clone());
        self.grow_node(all, 0, Some(sums));
        core::mem::take(&mut self.tree)
    }

    /// Adds the node of a range of rows and its subtree; a node without a histogram is a leaf.
    fn grow_node(&mut self, range: Range<usize>, depth: usize, sums: Option<Vec<f64>>) -> usize {
        let node = self.tree.branches.push_leaf(false);
        self.tree.values.resize((node + 1) * self.outputs, 0.0);
        let totals = self.totals_of(range.clone());
        let Some(sums) = sums else {
            self.make_leaf(node, range, &totals);
            return node;
        };
        let best = self.best_split(&totals, &sums);
        let divided = best.and_then(|best| self.divide(range.clone(), best));
        let Some(Divided { feature, threshold, middle }) = divided else {
            self.idle.push(sums);
            self.make_leaf(node, range, &totals);
            return node;
        };
        let [of_left, of_right] = self.sums_of_children(&range, middle, depth + 1, sums);
        let left = self.grow_node(range.start..middle, depth + 1, of_left);
        let right = self.grow_node(middle..range.end, depth + 1, of_right);
        self.tree.branches.ask(node, feature, threshold, left, right);
        node
    }

    /// Writes the Newton step of a leaf and adds it to the scores of the rows there.
    fn make_leaf(&mut self, node: usize, range: Range<usize>, totals: &[f64]) {
        let values = &mut self.tree.values[node * self.outputs..];
        let (gradients, curvatures) = totals.split_at(self.outputs);
        for ((value, gradient), curvature) in values.iter_mut().zip(gradients).zip(curvatures) {
            *value = -self.settings.learning_rate * gradient / (curvature + self.settings.lambda);
        }
        for &row in &self.rows[range] {
            let scores = &mut self.scores[row as usize * self.outputs..];
            for (score, value) in scores.iter_mut().zip(&*values) {
                *score += value;
            }
        }
    }

    /// The sum of the parts of a range of rows.
    fn totals_of(&self, range: Range<usize>) -> Vec<f64> {
        let mut totals = vec![0.0; self.width()];
        for &row in &self.rows[range] {
            let parts = &self.parts[row as usize * self.width()..];
            for (total, part) in totals.iter_mut().zip(parts) {
                *total += part;
            }
        }
        totals
    }

    /// The histogram of a range of rows.
    fn sums_of(&mut self, range: Range<usize>) -> Vec<f64> {
        let (rows, width) = (&self.rows[range], self.width());
        self.gathered.clear();
        for &row in rows {
            self.gathered.extend_from_slice(&self.parts[row as usize * width..][..width]);
        }
        let length = self.columns.len() * self.settings.max_bins * width;
        let mut sums = self.idle.pop().unwrap_or_else(|| vec![0.0; length]);
        self.bins.sum_into(&self.columns, rows, &self.gathered, width, &mut sums);
        sums
    }

    /// The histograms of both children, none at the last depth. The smaller child's is summed, and the other's is the
    /// difference to the parent's.
    fn sums_of_children(
        &mut self,
        range: &Range<usize>,
        middle: usize,
        depth: usize,
        mut sums: Vec<f64>,
    ) -> [Option<Vec<f64>>; 2] {
        if depth == self.settings.max_depth {
            self.idle.push(sums);
            return [None, None];
        }
        let left_is_smaller = middle - range.start <= range.end - middle;
        let smaller = if left_is_smaller { range.start..middle } else { middle..range.end };
        let of_smaller = self.sums_of(smaller);
        for (sum, part) in sums.iter_mut().zip(&of_smaller) {
            *sum -= part;
        }
        if left_is_smaller {
            [Some(of_smaller), Some(sums)]
        } else {
            [Some(sums), Some(of_smaller)]
        }
    }

    /// `Σ G² / (H + λ)` over outputs.
    #[inline(always)]
    fn score(&self, parts: &[f64]) -> f64 {
        let (gradients, curvatures) = parts.split_at(parts.len() / 2);
        let both = gradients.iter().zip(curvatures);
        both.map(|(g, h)| g * g / (h + self.settings.lambda)).sum()
    }

    #[inline(always)]
    fn has_curvature(&self, parts: &[f64]) -> bool {
        parts[parts.len() / 2..].iter().sum::<f64>() >= self.settings.min_curvature_leaf
    }

    /// The split with the largest gain, the first in a tie; `None` without a gain.
    fn best_split(&self, totals: &[f64], sums: &[f64]) -> Option<Candidate> {
        match self.width() {
            // As in [`Bins::sum_into`].
            2 => self.best_split_in([[0.0; 2]; 2], totals, sums),
            6 => self.best_split_in([[0.0; 6]; 2], totals, sums),
            8 => self.best_split_in([[0.0; 8]; 2], totals, sums),
            width => self.best_split_in([vec![0.0; width], vec![0.0; width]], totals, sums),
        }
    }

    /// Does the work with buffers for both sides, whose length the compiler may know.
    #[inline(always)]
    fn best_split_in(
        &self,
        [mut left, mut right]: [impl AsMut<[f64]>; 2],
        totals: &[f64],
        sums: &[f64],
    ) -> Option<Candidate> {
        let (left, right) = (left.as_mut(), right.as_mut());
        let width = left.len();
        let totals = &totals[..width];
        let mut best = None;
        let mut to_beat = self.score(totals) * BETTER;
        let of_columns = sums.chunks_exact(self.settings.max_bins * width);
        for (&column, sums) in self.columns.iter().zip(of_columns) {
            left.fill(0.0);
            let bins = sums.chunks_exact(width).take(self.bins.count(column) - 1);
            for (bin, parts) in bins.enumerate() {
                for place in 0..width {
                    left[place] += parts[place];
                    right[place] = totals[place] - left[place];
                }
                let score = self.score(left) + self.score(right);
                if score > to_beat && self.has_curvature(left) && self.has_curvature(right) {
                    to_beat = score * BETTER;
                    best = Some(Candidate { column, bin });
                }
            }
        }
        best
    }

    /// Moves the rows of a node to their sides; the threshold lies halfway in the gap between them. `None` if a side
    /// has no rows, because its sums were only rounding.
    fn divide(&mut self, range: Range<usize>, split: Candidate) -> Option<Divided> {
        let feature = self.bins.feature(split.column);
        let values = self.samples.column(feature);
        let bins = self.bins.column(split.column);
        let rows = &mut self.rows[range.clone()];
        let (left, low, high) = divide_rows(rows, &mut self.moving, values, |row, _| {
            usize::from(bins[row]) <= split.bin
        });
        let middle = range.start + left;
        let both = left > 0 && middle < range.end;
        both.then(|| Divided { feature, threshold: separate(low, high), middle })
    }
}
