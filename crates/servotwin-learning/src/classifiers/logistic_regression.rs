//! Logistic regression: softmax of one linear function per class, with an L2 penalty.
//!
//! Minimizes `Σ weight · (−log p(label | x)) / W + |w|² / (2 C W)` with W the sum of weights, by L-BFGS (Liu and
//! Nocedal 1989). Intercepts are not penalized. Two classes need only one function, as in scikit-learn's
//! `LogisticRegression`.

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use super::linear::{from_standardised, prepared};
use crate::numeric::Standardiser;
use crate::samples::{PresentClasses, Samples};
use servotwin_diagnosis::classifiers::logistic_regression::Model;
use servotwin_diagnosis::error::Error;
use servotwin_diagnosis::numeric::{add_scaled, dot, softmax};

/// Number of pairs of step and gradient change in the L-BFGS memory.
const MEMORY: usize = 10;

/// Settings of logistic regression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Weight C of the losses against the penalty; above 0.
    pub(crate) cost: f64,
    /// Tolerance of the largest gradient component at which training stops; above 0.
    pub(crate) tolerance: f64,
    /// Maximum number of steps; at least 1.
    pub(crate) max_steps: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { cost: 1.0, tolerance: 1e-4, max_steps: 200 }
    }
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        let most = ("max_steps", self.max_steps);
        let (present, standardiser) = prepared(samples, self.cost, self.tolerance, most)?;
        let objective = Objective::new(samples, &standardiser, &present, self.cost);
        let (point, converged) = minimise(&objective, self);
        let (weights, intercepts) = objective.unpack(&point);
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

/// The objective function. A point holds the feature weights and the intercept of each free class.
struct Objective {
    classes: usize,
    /// The first free class. Earlier ones have zero weights: the first of two, or the only one.
    first_free: usize,
    stride: usize,
    /// Row-major and standardized, with the constant 1 in the last column.
    table: Vec<f64>,
    class_of_row: Vec<usize>,
    /// Weight of each row; they sum to 1.
    shares: Vec<f64>,
    penalty: f64,
}

impl Objective {
    fn new(
        samples: &Samples,
        standardiser: &Standardiser,
        present: &PresentClasses,
        cost: f64,
    ) -> Self {
        let stride = samples.features() + 1;
        let mut table = standardiser.rows(samples, stride);
        table.chunks_exact_mut(stride).for_each(|row| row[stride - 1] = 1.0);
        let total = present.total_weight();
        Objective {
            classes: present.len(),
            first_free: usize::from(present.len() <= 2),
            stride,
            table,
            class_of_row: present.of_row.clone(),
            shares: (0..samples.rows()).map(|row| samples.weight(row) / total).collect(),
            penalty: 1.0 / (cost * total),
        }
    }

    fn dimensions(&self) -> usize {
        (self.classes - self.first_free) * self.stride
    }

    /// Returns the value at a point and writes the gradient.
    fn value(&self, point: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let mut value = 0.0;
        let mut shares = vec![0.0; self.classes];
        for (row, features) in self.table.chunks_exact(self.stride).enumerate() {
            shares.fill(0.0);
            let free = shares[self.first_free..].iter_mut();
            for (share, weights) in free.zip(point.chunks_exact(self.stride)) {
                *share = dot(weights, features);
            }
            let label = self.class_of_row[row];
            let of_label = shares[label];
            value += self.shares[row] * (softmax(&mut shares) - of_label);
            shares[label] -= 1.0;
            let free = shares[self.first_free..].iter();
            for (error, slope) in free.zip(gradient.chunks_exact_mut(self.stride)) {
                add_scaled(slope, self.shares[row] * error, features);
            }
        }
        value + self.add_penalty(point, gradient)
    }

    fn add_penalty(&self, point: &[f64], gradient: &mut [f64]) -> f64 {
        let mut squares = 0.0;
        let both = point.chunks_exact(self.stride).zip(gradient.chunks_exact_mut(self.stride));
        for (weights, slope) in both {
            let weights = &weights[..self.stride - 1];
            squares += dot(weights, weights);
            add_scaled(slope, self.penalty, weights);
        }
        0.5 * self.penalty * squares
    }

    /// Weights and intercepts of all classes.
    fn unpack(&self, point: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let features = self.stride - 1;
        let mut weights = vec![0.0; self.first_free * features];
        let mut intercepts = vec![0.0; self.first_free];
        for function in point.chunks_exact(self.stride) {
            weights.extend_from_slice(&function[..features]);
            intercepts.push(function[features]);
        }
        (weights, intercepts)
    }
}

/// A step and the change of the gradient along it.
struct Curvature {
    step: Vec<f64>,
    change: Vec<f64>,
    /// 1 / (step · change), positive.
    inverse: f64,
}

/// Minimizes by L-BFGS from zero; returns the point and whether it reached the tolerance.
fn minimise(objective: &Objective, settings: &Settings) -> (Vec<f64>, bool) {
    let mut point = vec![0.0; objective.dimensions()];
    let mut gradient = point.clone();
    let mut value = objective.value(&point, &mut gradient);
    let mut memory: VecDeque<Curvature> = VecDeque::with_capacity(MEMORY);
    for _ in 0..settings.max_steps {
        if gradient.iter().all(|slope| libm::fabs(*slope) <= settings.tolerance) {
            return (point, true);
        }
        let direction = descent_direction(&gradient, &memory);
        let first_length =
            if memory.is_empty() { 1.0 / dot(&gradient, &gradient).max(1.0) } else { 1.0 };
        let Some(found) =
            line_search(objective, &point, value, &gradient, &direction, first_length)
        else {
            // Rounding leaves no further descent.
            return (point, false);
        };
        remember(&mut memory, &point, &gradient, &found);
        Place { point, gradient, value } = found;
    }
    (point, false)
}

/// A point with its value and gradient.
struct Place {
    point: Vec<f64>,
    gradient: Vec<f64>,
    value: f64,
}

fn remember(memory: &mut VecDeque<Curvature>, point: &[f64], gradient: &[f64], found: &Place) {
    let mut step = found.point.clone();
    add_scaled(&mut step, -1.0, point);
    let mut change = found.gradient.clone();
    add_scaled(&mut change, -1.0, gradient);
    let curvature = dot(&step, &change);
    if curvature > f64::EPSILON * dot(&change, &change) {
        if memory.len() == MEMORY {
            memory.pop_front();
        }
        memory.push_back(Curvature { step, change, inverse: 1.0 / curvature });
    }
}

/// Minus the gradient, times the inverse curvature from memory (two-loop recursion).
fn descent_direction(gradient: &[f64], memory: &VecDeque<Curvature>) -> Vec<f64> {
    let mut direction: Vec<f64> = gradient.iter().map(|slope| -slope).collect();
    let mut factors = Vec::with_capacity(memory.len());
    for pair in memory.iter().rev() {
        let factor = pair.inverse * dot(&pair.step, &direction);
        add_scaled(&mut direction, -factor, &pair.change);
        factors.push(factor);
    }
    if let Some(pair) = memory.back() {
        let scale = 1.0 / (pair.inverse * dot(&pair.change, &pair.change));
        direction.iter_mut().for_each(|part| *part *= scale);
    }
    for (pair, factor) in memory.iter().zip(factors.iter().rev()) {
        let correction = factor - pair.inverse * dot(&pair.change, &direction);
        add_scaled(&mut direction, correction, &pair.step);
    }
    direction
}

/// Finds a step that meets the weak Wolfe conditions by doubling and bisection; `None` if rounding leaves no descent.
fn line_search(
    objective: &Objective,
    point: &[f64],
    value: f64,
    gradient: &[f64],
    direction: &[f64],
    first_length: f64,
) -> Option<Place> {
    const ENOUGH_DESCENT: f64 = 1e-4;
    const ENOUGH_FLATTENING: f64 = 0.9;
    const MOST_TRIALS: usize = 40;
    let slope = dot(gradient, direction);
    let (mut shortest, mut longest) = (0.0, f64::INFINITY);
    let mut length = first_length;
    let mut found = None;
    for _ in 0..MOST_TRIALS {
        let mut place = Place { point: point.to_vec(), gradient: vec![0.0; point.len()], value };
        add_scaled(&mut place.point, length, direction);
        place.value = objective.value(&place.point, &mut place.gradient);
        if place.value > value + ENOUGH_DESCENT * length * slope {
            longest = length;
        } else if dot(&place.gradient, direction) < ENOUGH_FLATTENING * slope {
            shortest = length;
            found = Some(place);
        } else {
            return Some(place);
        }
        length = if longest.is_finite() { 0.5 * (shortest + longest) } else { 2.0 * length };
    }
    found
}
