//! Multi-layer perceptron: one hidden layer of rectifiers, softmax output, trained by Adam.
//!
//! Minimizes the mean cross-entropy of mini-batches plus `α |w|² / (2 · rows of the batch)`. Defaults, initial weights
//! (Glorot, uniform) and the stopping rule are those of scikit-learn's `MLPClassifier`. The inputs are standardized.
//! Source of Adam: Kingma and Ba, ICLR 2015.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Fit;
use crate::numeric::{Standardiser, add_many};
use crate::samples::{PresentClasses, Samples};
use servotwin_diagnosis::classifiers::mlp::{Model, Shape};
use servotwin_diagnosis::error::{Error, require};
use servotwin_diagnosis::numeric::{add_scaled, dot, softmax};
use servotwin_diagnosis::random::Random;

/// Adam's decay of the mean gradient and of the mean squared gradient, and its guard against division by zero.
const MEAN_DECAY: f64 = 0.9;

const SQUARE_DECAY: f64 = 0.999;

const ADAM_GUARD: f64 = 1e-8;

/// Settings of the multi-layer perceptron.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Number of hidden units; at least 1.
    pub(crate) hidden_units: usize,
    /// Weight α of the penalty; 0 or more.
    pub(crate) penalty: f64,
    /// Adam's step size; above 0.
    pub learning_rate: f64,
    /// Maximum number of rows of a mini-batch; at least 1.
    pub(crate) batch_rows: usize,
    /// Maximum number of passes over the rows; at least 1.
    pub max_epochs: usize,
    /// Training stops when the loss has not fallen by this much …
    pub(crate) tolerance: f64,
    /// … in more than this many passes in a row.
    pub(crate) patience: usize,
    /// Seed of the initial weights and of the order of the rows.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            hidden_units: 100,
            penalty: 1e-4,
            learning_rate: 1e-3,
            batch_rows: 200,
            max_epochs: 200,
            tolerance: 1e-4,
            patience: 10,
            seed: 0,
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), Error> {
        let rate = self.learning_rate;
        require(self.hidden_units >= 1, "hidden_units", self.hidden_units as f64, ">= 1")?;
        require(self.penalty.is_finite() && self.penalty >= 0.0, "penalty", self.penalty, ">= 0")?;
        require(rate.is_finite() && rate > 0.0, "learning_rate", rate, "> 0")?;
        require(self.batch_rows >= 1, "batch_rows", self.batch_rows as f64, ">= 1")?;
        require(self.max_epochs >= 1, "max_epochs", self.max_epochs as f64, ">= 1")
    }
}

impl Fit for Settings {
    type Model = Model;

    fn fit(&self, samples: &Samples) -> Result<Model, Error> {
        samples.complete()?;
        self.check()?;
        let standardiser = Standardiser::new(samples);
        let mut random = Random::new(self.seed);
        let mut training = Training::new(samples, &standardiser, self, &mut random);
        let (mut best, mut without_progress) = (f64::INFINITY, 0);
        let (mut epochs, mut loss) = (0, 0.0);
        while epochs < self.max_epochs && without_progress <= self.patience {
            loss = training.epoch(&mut random);
            epochs += 1;
            without_progress = if loss > best - self.tolerance { without_progress + 1 } else { 0 };
            best = best.min(loss);
        }
        Ok(training.finish(&standardiser, epochs, loss))
    }
}

/// Start of the output weights. The weights before it are feature-major with the intercept last, one for each hidden
/// unit.
fn output_start(shape: Shape) -> usize {
    (shape.features + 1) * shape.hidden
}

/// Number of parameters. The output weights are hidden unit-major with the intercept last, one for each class.
fn parameters(shape: Shape) -> usize {
    output_start(shape) + (shape.hidden + 1) * shape.classes
}

/// Training rows, parameters and the state of Adam.
struct Training<'a> {
    settings: &'a Settings,
    shape: Shape,
    /// Row-major, standardized.
    table: Vec<f64>,
    labels: &'a [u32],
    /// Weight of each row; their mean is 1.
    weights: Vec<f64>,
    rows: Vec<u32>,
    parameters: Vec<f64>,
    gradient: Vec<f64>,
    mean_gradient: Vec<f64>,
    mean_square: Vec<f64>,
    /// Powers of Adam's decays after the current step.
    decays: (f64, f64),
    hidden: Vec<f64>,
    errors: Vec<f64>,
    /// The hidden errors of each row of the batch.
    hidden_errors: Vec<f64>,
    /// Values of one feature for the rows of the batch.
    feature: Vec<f64>,
}

impl<'a> Training<'a> {
    fn new(
        samples: &'a Samples,
        standardiser: &Standardiser,
        settings: &'a Settings,
        random: &mut Random,
    ) -> Self {
        let shape = Shape {
            features: samples.features(),
            hidden: settings.hidden_units,
            classes: samples.classes(),
        };
        let used = |row: &u32| samples.weight(*row as usize) > 0.0;
        let rows: Vec<u32> = (0..samples.rows() as u32).filter(used).collect();
        let mean_weight = PresentClasses::new(samples).total_weight() / rows.len() as f64;
        let size = parameters(shape);
        Training {
            settings,
            shape,
            table: standardiser.rows(samples, shape.features),
            labels: samples.labels(),
            weights: (0..samples.rows()).map(|row| samples.weight(row) / mean_weight).collect(),
            rows,
            parameters: starting_parameters(shape, random),
            gradient: vec![0.0; size],
            mean_gradient: vec![0.0; size],
            mean_square: vec![0.0; size],
            decays: (1.0, 1.0),
            hidden: vec![0.0; shape.hidden],
            errors: vec![0.0; shape.classes],
            hidden_errors: vec![],
            feature: vec![],
        }
    }

    /// One pass over the rows in random order; returns the mean loss.
    fn epoch(&mut self, random: &mut Random) -> f64 {
        let mut rows = core::mem::take(&mut self.rows);
        random.shuffle(&mut rows);
        let mut loss = 0.0;
        for batch in rows.chunks(self.settings.batch_rows) {
            loss += self.batch(batch);
        }
        let mean = loss / rows.len() as f64;
        self.rows = rows;
        mean
    }

    /// One step of Adam; returns the loss of the batch times its rows.
    fn batch(&mut self, batch: &[u32]) -> f64 {
        self.gradient.fill(0.0);
        let mut loss = 0.0;
        self.hidden_errors.clear();
        self.hidden_errors.resize(batch.len() * self.shape.hidden, 0.0);
        for (place, &row) in batch.iter().enumerate() {
            loss += self.forward(row as usize);
            self.output_backward(place);
        }
        self.hidden_backward(batch);
        let squares = self.add_penalty();
        let rows = batch.len() as f64;
        self.gradient.iter_mut().for_each(|slope| *slope /= rows);
        self.adam_step();
        loss + 0.5 * self.settings.penalty * squares
    }

    /// Fills the hidden values and the output errors of a row; returns its loss.
    fn forward(&mut self, row: usize) -> f64 {
        let Shape { features, hidden, classes } = self.shape;
        let (first, output) = self.parameters.split_at(output_start(self.shape));
        let (weights, intercepts) = first.split_at(features * hidden);
        self.hidden.copy_from_slice(intercepts);
        let values = &self.table[row * features..(row + 1) * features];
        add_many(&mut self.hidden, values, weights);
        let (weights, intercepts) = output.split_at(hidden * classes);
        self.errors.copy_from_slice(intercepts);
        self.hidden.iter_mut().for_each(|unit| *unit = unit.max(0.0));
        add_many(&mut self.errors, &self.hidden, weights);
        let label = self.labels[row] as usize;
        let of_label = self.errors[label];
        let loss = self.weights[row] * (softmax(&mut self.errors) - of_label);
        self.errors[label] -= 1.0;
        let weight = self.weights[row];
        self.errors.iter_mut().for_each(|error| *error *= weight);
        loss
    }

    /// Adds the output-layer gradient of the current row, and fills its hidden errors in the batch.
    fn output_backward(&mut self, place: usize) {
        let Shape { hidden, classes, .. } = self.shape;
        let output = &mut self.gradient[output_start(self.shape)..];
        let (slopes, intercepts) = output.split_at_mut(hidden * classes);
        add_scaled(intercepts, 1.0, &self.errors);
        let weights = &self.parameters[output_start(self.shape)..];
        let hidden_errors = &mut self.hidden_errors[place * hidden..(place + 1) * hidden];
        // Inactive units pass nothing back.
        let units = self.hidden.iter().zip(hidden_errors);
        let weights = weights.chunks_exact(classes);
        for (((&unit, error), slopes), weights) in
            units.zip(slopes.chunks_exact_mut(classes)).zip(weights)
        {
            if unit > 0.0 {
                add_scaled(slopes, unit, &self.errors);
                *error = dot(weights, &self.errors);
            }
        }
    }

    /// Adds the hidden layer's gradient of a whole batch, feature by feature.
    fn hidden_backward(&mut self, batch: &[u32]) {
        let Shape { features, hidden, .. } = self.shape;
        let (slopes, intercepts) = self.gradient.split_at_mut(features * hidden);
        for errors in self.hidden_errors.chunks_exact(hidden) {
            add_scaled(&mut intercepts[..hidden], 1.0, errors);
        }
        for (feature, slopes) in slopes.chunks_exact_mut(hidden).enumerate() {
            self.feature.clear();
            let values = batch.iter().map(|&row| self.table[row as usize * features + feature]);
            self.feature.extend(values);
            add_many(slopes, &self.feature, &self.hidden_errors);
        }
    }

    /// Adds the gradient of the penalty on all weights but the intercepts; returns the sum of
    /// their squares.
    fn add_penalty(&mut self) -> f64 {
        let Shape { features, hidden, classes } = self.shape;
        let output = output_start(self.shape);
        let mut squares = 0.0;
        for range in [0..features * hidden, output..output + hidden * classes] {
            let weights = &self.parameters[range.clone()];
            squares += dot(weights, weights);
            add_scaled(&mut self.gradient[range], self.settings.penalty, weights);
        }
        squares
    }

    fn adam_step(&mut self) {
        self.decays.0 *= MEAN_DECAY;
        self.decays.1 *= SQUARE_DECAY;
        let rate =
            self.settings.learning_rate * libm::sqrt(1.0 - self.decays.1) / (1.0 - self.decays.0);
        let moments = self.mean_gradient.iter_mut().zip(&mut self.mean_square);
        let all = self.parameters.iter_mut().zip(&self.gradient).zip(moments);
        for ((parameter, slope), (mean, square)) in all {
            *mean = MEAN_DECAY * *mean + (1.0 - MEAN_DECAY) * slope;
            *square = SQUARE_DECAY * *square + (1.0 - SQUARE_DECAY) * slope * slope;
            *parameter -= rate * *mean / (libm::sqrt(*square) + ADAM_GUARD);
        }
    }

    /// The model for unscaled features.
    fn finish(self, standardiser: &Standardiser, epochs: usize, loss: f64) -> Model {
        let Shape { features, hidden, .. } = self.shape;
        let (first, output) = self.parameters.split_at(output_start(self.shape));
        let mut hidden_weights = vec![0.0; features * hidden];
        let mut hidden_intercepts = first[features * hidden..].to_vec();
        for unit in 0..hidden {
            let weights = &mut hidden_weights[unit * features..(unit + 1) * features];
            for (feature, weight) in weights.iter_mut().enumerate() {
                *weight = first[feature * hidden + unit] * standardiser.scales[feature];
            }
            hidden_intercepts[unit] -= dot(weights, &standardiser.means);
        }
        let output_weights = output.to_vec();
        Model { shape: self.shape, hidden_weights, hidden_intercepts, output_weights, epochs, loss }
    }
}

/// Glorot's uniform initial values, for weights and intercepts alike.
fn starting_parameters(shape: Shape, random: &mut Random) -> Vec<f64> {
    let bound = |from: usize, to: usize| libm::sqrt(6.0 / (from + to) as f64);
    let hidden = bound(shape.features, shape.hidden);
    let output = bound(shape.hidden, shape.classes);
    (0..parameters(shape))
        .map(|place| if place < output_start(shape) { hidden } else { output })
        .map(|bound| random.between(-bound, bound))
        .collect()
}
