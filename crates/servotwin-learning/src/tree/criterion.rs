//! Impurity measures, and their running sums: a scan over a sorted feature needs constant time per row for any number
//! of classes.
//!
//! Gini `1 − Σ p²` and entropy `−Σ p log2 p`, with p the weight share of each class. For the weights L of the left and
//! R of the right side, the best split maximizes `Σ L_k²/L + Σ R_k²/R` (Gini) or `Σ L_k ln L_k − L ln L + Σ R_k ln R_k
//! − R ln R` (entropy).

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// Impurity measure of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// Gini impurity, 0 (pure) to 1 − 1/classes.
    #[default]
    Gini,
    /// Shannon entropy in bits, 0 (pure) to log2(classes).
    Entropy,
}

impl Criterion {
    /// Impurity of a node with these class weights.
    pub(crate) fn impurity(self, weights: &[f64]) -> f64 {
        let total: f64 = weights.iter().sum();
        let shares = weights.iter().filter(|&&weight| weight > 0.0).map(|weight| weight / total);
        match self {
            Criterion::Gini => 1.0 - shares.map(|share| share * share).sum::<f64>(),
            Criterion::Entropy => -shares.map(|share| share * libm::log2(share)).sum::<f64>(),
        }
    }

    /// Mean impurity of the two sides of a split with this score at a node of weight `total`.
    pub(crate) fn of_children(self, score: f64, total: f64) -> f64 {
        match self {
            Criterion::Gini => 1.0 - score / total,
            Criterion::Entropy => -score / total / core::f64::consts::LN_2,
        }
    }
}

/// Running sums of a scan that moves rows one by one from the right side to the left.
pub(crate) trait Scan {
    /// Starts with all rows on the right.
    fn restart(&mut self, totals: &[f64]);
    /// Moves a row of this class to the left.
    fn move_left(&mut self, class: usize, weight: f64);
    /// Moves this many rows of weight 1 and of one class.
    fn move_many(&mut self, class: usize, count: u32) {
        self.move_left(class, f64::from(count));
    }
    /// Score of the split between moved and remaining rows; larger is better.
    fn score(&self) -> f64;
}

/// The running sums for Gini.
#[derive(Default)]
pub(crate) struct GiniScan {
    left: Vec<f64>,
    right: Vec<f64>,
    left_squares: f64,
    right_squares: f64,
    left_total: f64,
    right_total: f64,
}

impl Scan for GiniScan {
    fn restart(&mut self, totals: &[f64]) {
        self.left.clear();
        self.left.resize(totals.len(), 0.0);
        self.right.clear();
        self.right.extend_from_slice(totals);
        self.left_squares = 0.0;
        self.right_squares = totals.iter().map(|total| total * total).sum();
        self.left_total = 0.0;
        self.right_total = totals.iter().sum();
    }

    #[inline]
    fn move_left(&mut self, class: usize, weight: f64) {
        let (left, right) = (&mut self.left[class], &mut self.right[class]);
        self.left_squares += weight * (2.0 * *left + weight);
        self.right_squares -= weight * (2.0 * *right - weight);
        *left += weight;
        *right -= weight;
        self.left_total += weight;
        self.right_total -= weight;
    }

    #[inline]
    fn score(&self) -> f64 {
        if self.left_total <= 0.0 || self.right_total <= 0.0 {
            return f64::NEG_INFINITY;
        }
        // Rounding may leave an impossibly large sum of squares on a nearly empty right side.
        let right_squares = self.right_squares.min(self.right_total * self.right_total);
        self.left_squares / self.left_total + right_squares / self.right_total
    }
}

/// The running sums for entropy.
#[derive(Default)]
pub(crate) struct EntropyScan {
    left: Vec<f64>,
    right: Vec<f64>,
    left_logs: f64,
    right_logs: f64,
    left_total: f64,
    right_total: f64,
}

/// `x ln x`, and 0 for x ≤ 0 (rounding may leave a class slightly negative).
fn x_log_x(x: f64) -> f64 {
    if x > 0.0 { x * libm::log(x) } else { 0.0 }
}

impl Scan for EntropyScan {
    fn restart(&mut self, totals: &[f64]) {
        self.left = vec![0.0; totals.len()];
        self.right = totals.to_vec();
        self.left_logs = 0.0;
        self.right_logs = totals.iter().copied().map(x_log_x).sum();
        self.left_total = 0.0;
        self.right_total = totals.iter().sum();
    }

    fn move_left(&mut self, class: usize, weight: f64) {
        let (left, right) = (&mut self.left[class], &mut self.right[class]);
        self.left_logs += x_log_x(*left + weight) - x_log_x(*left);
        self.right_logs += x_log_x(*right - weight) - x_log_x(*right);
        *left += weight;
        *right -= weight;
        self.left_total += weight;
        self.right_total -= weight;
    }

    fn score(&self) -> f64 {
        if self.left_total <= 0.0 || self.right_total <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let left = (self.left_logs - x_log_x(self.left_total)).min(0.0);
        let right = (self.right_logs - x_log_x(self.right_total)).min(0.0);
        left + right
    }
}

/// The running counts for entropy when every row has weight 1, with cached logarithms of whole numbers.
#[derive(Default)]
pub(crate) struct CountEntropyScan {
    left: Vec<u32>,
    totals: Vec<u32>,
    total: u32,
    /// `n ln n` for n = 0, 1, ….
    logs: Vec<f64>,
}

impl Scan for CountEntropyScan {
    fn restart(&mut self, totals: &[f64]) {
        self.left.clear();
        self.left.resize(totals.len(), 0);
        self.totals.clear();
        self.totals.extend(totals.iter().map(|&total| total as u32));
        self.total = self.totals.iter().sum();
        let known = self.logs.len() as u32;
        self.logs.extend((known..=self.total).map(|count| x_log_x(f64::from(count))));
    }

    #[inline]
    fn move_left(&mut self, class: usize, _weight: f64) {
        self.left[class] += 1;
    }

    #[inline]
    fn move_many(&mut self, class: usize, count: u32) {
        self.left[class] += count;
    }

    fn score(&self) -> f64 {
        let log = |count: u32| self.logs[count as usize];
        let (mut left_total, mut left, mut right) = (0, 0.0, 0.0);
        for (&count, &total) in self.left.iter().zip(&self.totals) {
            left_total += count;
            left += log(count);
            right += log(total - count);
        }
        (left - log(left_total)).min(0.0) + (right - log(self.total - left_total)).min(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_scan(criterion: Criterion, scan: &mut dyn Scan) {
        let rows = [(0, 1.0), (2, 0.5), (1, 2.0), (0, 1.5), (2, 3.0), (1, 0.25)];
        let mut right = [2.5, 2.25, 3.5];
        let total: f64 = right.iter().sum();
        let mut left = [0.0; 3];
        scan.restart(&right);
        for &(class, weight) in &rows[..5] {
            scan.move_left(class, weight);
            left[class] += weight;
            right[class] -= weight;
            let (left_total, right_total) = (left.iter().sum::<f64>(), right.iter().sum::<f64>());
            let direct = (left_total * criterion.impurity(&left)
                + right_total * criterion.impurity(&right))
                / total;
            assert!((criterion.of_children(scan.score(), total) - direct).abs() < 1e-12);
        }
    }

    #[test]
    fn running_sums_agree_with_the_definition() {
        check_scan(Criterion::Gini, &mut GiniScan::default());
        check_scan(Criterion::Entropy, &mut EntropyScan::default());
    }

    #[test]
    fn counted_logarithms_give_the_same_entropy() {
        let (mut counts, mut sums) = (CountEntropyScan::default(), EntropyScan::default());
        counts.restart(&[3.0, 2.0, 4.0]);
        sums.restart(&[3.0, 2.0, 4.0]);
        for (class, count) in [(2, 1), (0, 2), (2, 2), (1, 1), (0, 1), (1, 1)] {
            counts.move_many(class, count);
            sums.move_many(class, count);
            assert!((counts.score() - sums.score()).abs() < 1e-12);
        }
    }

    #[test]
    fn impurity_of_known_nodes() {
        assert_eq!(Criterion::Gini.impurity(&[5.0, 5.0]), 0.5);
        assert_eq!(Criterion::Entropy.impurity(&[1.0, 1.0, 1.0, 1.0]), 2.0);
        assert_eq!(Criterion::Gini.impurity(&[0.0, 3.0]), 0.0);
        assert_eq!(Criterion::Entropy.impurity(&[0.0, 3.0]), 0.0);
    }
}
