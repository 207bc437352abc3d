//! Flips: answers that change when every feature varies within its uncertainty.
//!
//! A window is uncertain due to the noise and quantization of its sensors and the solver's error
//! ([`augmentation::disturbed`]). The judged windows are perturbed accordingly, their features recomputed, and the
//! answers compared. A tree that asks for details below the sensors' uncertainty flips; a robust one does not.
//!
//! A flip compares two answers, right or wrong, and no answer with the truth. So flips are no measures of outcomes.

use super::data_set::DataSet;
use super::error::EvaluationError;
use super::protocol::trial;
use crate::parallel::{self, Workers};
use crate::signal::random::NormalDeviates;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::features::{self, Sensors};
use servotwin_diagnosis::hierarchy::{Diagnosis, Hierarchy};
use servotwin_diagnosis::random::Random as Choices;
use servotwin_diagnosis::residual::Window;
use servotwin_learning::augmentation;
use servotwin_learning::metrics::Rate;

/// The smallest factor by which a fault is scaled for training. Factors are distributed evenly in their logarithm.
const WEAKEST: f64 = 0.2;

/// Each round has the unchanged fault and a weaker one.
const ROUND: usize = 2;

/// The windows of a data set's rows, and how they are perturbed.
pub struct Moving<'w> {
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
pub(crate) struct Moved {
    /// The window after the perturbation.
    pub(crate) window: Window,
    /// The factor by which its fault was scaled.
    pub(crate) factor: f64,
}

/// Flips of a hierarchy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Flips {
    /// Perturbations per window.
    pub draws: usize,
    /// The share of perturbations that change the actuator.
    pub actuator: Rate,
    /// The share that changes actuator or action.
    pub action: Rate,
    /// The share that changes any part of the answer.
    pub answer: Rate,
}

impl Moving<'_> {
    /// The features of a window in every view.
    pub(crate) fn views(&self, window: &Window, views: usize) -> Vec<Vec<f64>> {
        let of = |view: usize| {
            let order = self.sensors.rotated(views, view).filter(|_| view > 0);
            let seen = order.map(|order| window.reordered(&order));
            let all = features::values(&self.sensors, seen.as_ref().unwrap_or(window));
            self.columns.iter().map(|&column| all[column]).collect()
        };
        (0..views).map(of).collect()
    }

    /// The perturbed windows of a row, with its fault unchanged.
    pub(crate) fn moved(&self, row: usize) -> Vec<Window> {
        let mut errors = NormalDeviates::new(self.seed_of(row));
        let window = &self.windows[row];
        (0..self.draws).map(|draw| self.disturbed(window, draw, &mut errors)).collect()
    }

    /// The perturbed windows of a row. Every second draw has a weaker fault, in one of the `specimens`: rows without a
    /// fault.
    pub(crate) fn spread(&self, row: usize, specimens: &[usize]) -> Vec<Moved> {
        let mut errors = NormalDeviates::new(self.seed_of(row));
        let mut choices = Choices::stream(self.seed_of(row), 1);
        let window = &self.windows[row];
        let mut one = |draw: usize| {
            if draw.is_multiple_of(ROUND) {
                return Moved { window: self.disturbed(window, draw, &mut errors), factor: 1.0 };
            }
            let factor = WEAKEST.powf(choices.unit());
            let specimen = match specimens.is_empty() {
                true => None,
                false => Some(&self.windows[specimens[choices.index(specimens.len())]]),
            };
            let scaled = augmentation::scaled(window, factor, specimen, &self.noise);
            Moved { window: self.disturbed(&scaled, draw, &mut errors), factor }
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

/// The result for one row.
struct Seen {
    row: usize,
    /// For each perturbation, whether the actuator, actuator or action, and any part of the answer changed.
    changes: Vec<[bool; 3]>,
}

/// Perturbs the windows of the given rows and compares the answers.
///
/// # Errors
/// [`EvaluationError::Cancelled`], or the hierarchy has other features.
pub(crate) fn evaluate(
    data: &DataSet,
    hierarchy: &Hierarchy,
    moving: &Moving,
    rows: &[usize],
    workers: Workers,
) -> Result<Flips, EvaluationError> {
    let views = data.examples.views();
    let one = |&row: &usize| seen(hierarchy, moving, views, row);
    let seen: Result<Vec<Seen>, EvaluationError> =
        parallel::map(rows, workers, one)?.into_iter().collect();
    let seen = seen?;
    let share = |part: usize| {
        let trials = seen.iter().flat_map(|seen| {
            seen.changes.iter().map(move |changes| trial(data, seen.row, changes[part]))
        });
        Rate::clustered(&trials.collect::<Vec<_>>())
    };
    Ok(Flips { draws: moving.draws, actuator: share(0), action: share(1), answer: share(2) })
}

fn seen(
    hierarchy: &Hierarchy,
    moving: &Moving,
    views: usize,
    row: usize,
) -> Result<Seen, EvaluationError> {
    let mut scratch = hierarchy.scratch();
    let mut ask = |rows: &[Vec<f64>]| -> Result<Diagnosis, EvaluationError> {
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        Ok(hierarchy.diagnose(&rows, &mut scratch)?)
    };
    let said = ask(&moving.views(&moving.windows[row], views))?;
    let mut seen = Seen { row, changes: vec![] };
    for window in moving.moved(row) {
        let again = ask(&moving.views(&window, views))?;
        let is_other_action = again.actuator_and_action() != said.actuator_and_action();
        let is_other_answer = is_other_action || again.detail != said.detail;
        seen.changes.push([again.actuator != said.actuator, is_other_action, is_other_answer]);
    }
    Ok(seen)
}
