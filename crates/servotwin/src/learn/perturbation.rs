//! Perturbed copies of windows for training: trees do not learn details below the sensors' uncertainty.
//!
//! A window is uncertain due to the noise and quantization of its sensors and the solver's error
//! ([`augmentation::disturbed`]). The training windows are perturbed accordingly, and their features recomputed.

use crate::records::columns::seen;
use crate::signal::random::NormalDeviates;
use servotwin_diagnosis::features::Sensors;
use servotwin_diagnosis::random::Random as Choices;
use servotwin_diagnosis::residual::Window;
use servotwin_learning::augmentation;

/// The smallest factor by which a fault is scaled for training. Factors are distributed evenly in their logarithm.
const WEAKEST: f64 = 0.2;

/// Each round has the unchanged fault and a weaker one.
const ROUND: usize = 2;

/// The windows of a data set's rows, and how they are perturbed.
pub(crate) struct Perturbation<'w> {
    /// The sensors, in the order of the windows.
    pub(crate) sensors: Sensors,
    /// The window of every row.
    pub(crate) windows: &'w [Window],
    /// Noise and quantization of a sample of each sensor, as a fraction of its scale.
    pub(crate) noise: Vec<f64>,
    /// The solver's error, as a fraction of the scale.
    pub(crate) lasting: f64,
    /// For each feature of the data set, its index among all features.
    pub(crate) columns: Vec<usize>,
    /// Sizes of the perturbations relative to the uncertainty, for each round of two draws; the last applies to all
    /// later rounds.
    pub(crate) reaches: &'static [f64],
    /// Number of perturbations per window.
    pub(crate) draws: usize,
    /// Seed of the perturbations.
    pub(crate) seed: u64,
}

/// A perturbed window.
pub(crate) struct PerturbedWindow {
    /// The window after the perturbation.
    pub(crate) window: Window,
    /// The factor by which its fault was scaled.
    pub(crate) factor: f64,
}

impl Perturbation<'_> {
    /// The features of a window in every view.
    pub(crate) fn views(&self, window: &Window, views: usize) -> Vec<Vec<f64>> {
        let orders = self.sensors.rotations(views).unwrap_or_default();
        let all = seen(&self.sensors, &orders, window).into_iter();
        all.map(|values| self.columns.iter().map(|&column| values[column]).collect()).collect()
    }

    /// The perturbed windows of a row, with its fault unchanged.
    pub(crate) fn perturbed(&self, row: usize) -> Vec<Window> {
        let mut errors = NormalDeviates::new(self.seed_of(row));
        let window = &self.windows[row];
        (0..self.draws).map(|draw| self.disturbed(window, draw, &mut errors)).collect()
    }

    /// The perturbed windows of a row. Every second draw has a weaker fault, in one of the `specimens`: rows without a
    /// fault.
    pub(crate) fn of_fault(&self, row: usize, specimens: &[usize]) -> Vec<PerturbedWindow> {
        let mut errors = NormalDeviates::new(self.seed_of(row));
        let mut choices = Choices::stream(self.seed_of(row), 1);
        let window = &self.windows[row];
        let mut one = |draw: usize| {
            if draw.is_multiple_of(ROUND) {
                return PerturbedWindow {
                    window: self.disturbed(window, draw, &mut errors),
                    factor: 1.0,
                };
            }
            let factor = WEAKEST.powf(choices.unit());
            let specimen = match specimens.is_empty() {
                true => None,
                false => Some(&self.windows[specimens[choices.index(specimens.len())]]),
            };
            let scaled = augmentation::scaled(window, factor, specimen, &self.noise);
            PerturbedWindow { window: self.disturbed(&scaled, draw, &mut errors), factor }
        };
        (0..self.draws).map(&mut one).collect()
    }

    fn seed_of(&self, row: usize) -> u64 {
        self.seed ^ (row as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    }

    fn disturbed(&self, window: &Window, draw: usize, errors: &mut NormalDeviates) -> Window {
        let reach = self.reaches[(draw / ROUND).min(self.reaches.len() - 1)];
        let noise: Vec<f64> = self.noise.iter().map(|noise| noise * reach).collect();
        augmentation::disturbed(window, &noise, self.lasting * reach, &mut || errors.normal())
    }
}
