//! Linear support vector machine: one class against the rest, squared hinge loss, L2 penalty.
//!
//! For each class, with y = ±1 and the intercept as the weight of a constant feature 1, it minimizes `½ |w|² + C Σ
//! max(0, 1 − y w·x)²`. Coordinate descent on the dual changes one multiplier at a time in random order and leaves out
//! multipliers that stay at zero. Source: Hsieh, Chang, Lin, Keerthi, Sundararajan, "A dual coordinate descent method
//! for large-scale linear SVM", ICML 2008, algorithm 3.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use super::linear::{from_standardised, mirrored, prepared};
use crate::numeric::Standardiser;
use crate::samples::Samples;
use servotwin_diagnosis::classifiers::linear_svm::Model;
use servotwin_diagnosis::error::Error;
use servotwin_diagnosis::numeric::{add_scaled, dot};
use servotwin_diagnosis::random::Random;

/// Settings of the linear SVM.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Weight C of the losses against the penalty; above 0.
    pub(crate) cost: f64,
    /// Tolerance of the spread of the projected gradients at which training stops; above 0.
    pub(crate) tolerance: f64,
    /// Maximum number of passes over the rows; at least 1.
    pub(crate) max_passes: usize,
    /// Seed of the order of the rows.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { cost: 1.0, tolerance: 1e-4, max_passes: 1000, seed: 0 }
    }
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        let most = ("max_passes", self.max_passes);
        let (present, standardiser) = prepared(samples, self.cost, self.tolerance, most)?;
        let mut dual = Dual::new(samples, &standardiser, self);
        let features = samples.features();
        let mut converged = true;
        let (mut weights, mut intercepts) = (vec![], vec![]);
        // Two classes are a single problem.
        let first = if present.len() == 2 { 1 } else { 0 };
        for class in first..present.len() {
            converged &= dual.solve(|row| present.of_row[row] == class, self, class);
            weights.extend_from_slice(&dual.weights[..features]);
            intercepts.push(dual.weights[features]);
        }
        if present.len() == 2 {
            (weights, intercepts) = mirrored(weights, intercepts[0]);
        }
        let functions = from_standardised(
            samples.classes(),
            present.labels,
            &standardiser,
            weights,
            intercepts,
        );
        Ok(Model { functions, converged })
    }
}

/// The dual problem of one class against the rest.
struct Dual {
    /// Number of features plus the constant 1.
    stride: usize,
    /// Row-major and standardized, with the constant 1 in the last column.
    table: Vec<f64>,
    /// Diagonal of the regularized kernel: |x|² + 1 / (2 C weight).
    diagonal: Vec<f64>,
    /// 1 / (2 C weight) of each row.
    softness: Vec<f64>,
    /// Rows of positive weight; the active ones come first.
    rows: Vec<u32>,
    signs: Vec<f64>,
    multipliers: Vec<f64>,
    weights: Vec<f64>,
}

/// The largest and smallest projected gradient of a pass.
struct Extremes {
    largest: f64,
    smallest: f64,
}

impl Dual {
    fn new(samples: &Samples, standardiser: &Standardiser, settings: &Settings) -> Self {
        let stride = samples.features() + 1;
        let mut table = standardiser.rows(samples, stride);
        table.chunks_exact_mut(stride).for_each(|row| row[stride - 1] = 1.0);
        let used = |row: &u32| samples.weight(*row as usize) > 0.0;
        let rows = (0..samples.rows() as u32).filter(used).collect();
        let softness: Vec<f64> =
            (0..samples.rows()).map(|row| 0.5 / (settings.cost * samples.weight(row))).collect();
        let diagonal =
            table.chunks_exact(stride).zip(&softness).map(|(x, soft)| dot(x, x) + soft).collect();
        Dual {
            stride,
            diagonal,
            softness,
            rows,
            signs: vec![0.0; samples.rows()],
            multipliers: vec![],
            weights: vec![],
            table,
        }
    }

    /// Solves for one class; returns whether the tolerance was reached.
    fn solve(
        &mut self,
        is_class: impl Fn(usize) -> bool,
        settings: &Settings,
        class: usize,
    ) -> bool {
        for (row, sign) in self.signs.iter_mut().enumerate() {
            *sign = if is_class(row) { 1.0 } else { -1.0 };
        }
        self.multipliers = vec![0.0; self.signs.len()];
        self.weights = vec![0.0; self.stride];
        self.rows.sort_unstable();
        let mut random = Random::stream(settings.seed, class as u64);
        let mut active = self.rows.len();
        let mut shrink_above = f64::INFINITY;
        for _ in 0..settings.max_passes {
            let extremes = self.pass(&mut active, shrink_above, &mut random);
            if extremes.largest - extremes.smallest > settings.tolerance {
                let largest = extremes.largest;
                shrink_above = if largest > 0.0 { largest } else { f64::INFINITY };
            } else if active == self.rows.len() {
                return true;
            } else {
                // The active rows are solved: check all rows again.
                active = self.rows.len();
                shrink_above = f64::INFINITY;
            }
        }
        false
    }

    /// One pass over the active rows in random order.
    fn pass(&mut self, active: &mut usize, shrink_above: f64, random: &mut Random) -> Extremes {
        random.shuffle(&mut self.rows[..*active]);
        let mut extremes = Extremes { largest: f64::NEG_INFINITY, smallest: f64::INFINITY };
        let mut place = 0;
        while place < *active {
            let row = self.rows[place] as usize;
            let features = &self.table[row * self.stride..(row + 1) * self.stride];
            let (sign, multiplier) = (self.signs[row], self.multipliers[row]);
            let margin = sign * dot(&self.weights, features);
            let gradient = margin - 1.0 + self.softness[row] * multiplier;
            if multiplier == 0.0 && gradient > shrink_above {
                *active -= 1;
                self.rows.swap(place, *active);
                continue;
            }
            place += 1;
            let projected = if multiplier == 0.0 { gradient.min(0.0) } else { gradient };
            extremes.largest = extremes.largest.max(projected);
            extremes.smallest = extremes.smallest.min(projected);
            if projected != 0.0 {
                let moved = (multiplier - gradient / self.diagonal[row]).max(0.0);
                self.multipliers[row] = moved;
                add_scaled(&mut self.weights, (moved - multiplier) * sign, features);
            }
        }
        extremes
    }
}
