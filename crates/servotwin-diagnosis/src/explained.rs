//! Explained actions: which actions have a training row that resembles a new row.
//!
//! A classifier that never saw a kind of fault still answers with one of its classes. The rows of the training set
//! answer a second question: does a known fault with this action lie that far from them?
//!
//! ```text
//! d_a = min over training rows r of action a of |L⁻¹ (x − r)|                (1)
//! action a explains x where d_a ≤ limit                                      (2)
//! ```
//!
//! L is the Cholesky factor of the scatter of the features within one kind of fault at one intensity. Specimens,
//! commands and noise cause that scatter, which is the unit of (1). The limit is a
//! quantile of d_a of held-out rows with their own action (split conformal prediction: Vovk, Gammerman, Shafer,
//! "Algorithmic Learning in a Random World", 2005; folds instead of one split: Vovk, "Cross-conformal predictors",
//! Annals of Mathematics and Artificial Intelligence 74, 2015). For exchangeable rows, a known fault is not
//! explained by its own action with a probability of about the level α. No limit is tuned.
//!
//! The actions that explain a row are its *conformal set*. An empty set means an unknown kind of fault. A set of several
//! actions means that the features do not separate them. A fault is *isolated* where the trees, the committee and the
//! set name the same single action; otherwise it is not isolated, and nothing is shut down because of it.

use alloc::vec;
use alloc::vec::Vec;

use crate::error::{Error, require, require_sound, same_length};
use crate::numeric::dot;

/// The training rows of every action, in the metric of (1).
#[derive(Debug, Clone, PartialEq)]
pub struct ExplainedActions {
    /// The features in use, as columns of a row.
    pub columns: Vec<u32>,
    /// Row-major lower triangle of L, square.
    pub factor: Vec<f64>,
    /// For each action, its training rows multiplied by L⁻¹, row after row.
    pub rows: Vec<Vec<f64>>,
    /// The largest distance at which an action explains a row; infinite if there were too few held-out rows.
    pub limit: f64,
}

/// The verdict of the conformal set on an action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Explanation {
    /// The action explains the row, and no other does.
    Only,
    /// The action and at least one other explain the row.
    OneOfSeveral,
    /// The action does not explain the row.
    No,
}

impl ExplainedActions {
    /// Allocates the memory for [`ExplainedActions::distances_into`].
    pub fn scratch(&self) -> Vec<f64> {
        vec![0.0; self.columns.len()]
    }

    /// Writes the distance (1) to the nearest training row of each action; infinite for an action without rows. The
    /// row holds all features in the actuator's view. Does not allocate.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] if `into` or the scratch has another length.
    ///
    /// # Panics
    /// If the row lacks a column.
    pub fn distances_into(
        &self,
        row: &[f64],
        scratch: &mut [f64],
        into: &mut [f64],
    ) -> Result<(), Error> {
        same_length("distances", self.rows.len(), into.len())?;
        same_length("scratch", self.columns.len(), scratch.len())?;
        for (slot, &column) in scratch.iter_mut().zip(&self.columns) {
            *slot = row[column as usize];
        }
        whiten(&self.factor, scratch);
        for (slot, rows) in into.iter_mut().zip(&self.rows) {
            *slot = nearest(scratch, rows);
        }
        Ok(())
    }

    /// What the distances say about an action.
    pub fn explanation(&self, distances: &[f64], action: usize) -> Explanation {
        // NaN explains nothing.
        let explains = |distance: &f64| *distance <= self.limit;
        if !distances.get(action).is_some_and(explains) {
            return Explanation::No;
        }
        match distances.iter().filter(|distance| explains(distance)).count() {
            1 => Explanation::Only,
            _ => Explanation::OneOfSeveral,
        }
    }

    /// Checks that the parts fit together.
    ///
    /// # Errors
    /// [`Error::CorruptModel`], [`Error::LengthMismatch`], [`Error::SettingOutOfRange`].
    pub fn check(&self) -> Result<(), Error> {
        let size = self.columns.len();
        same_length("factor", size * size, self.factor.len())?;
        require(self.limit >= 0.0, "limit", self.limit, ">= 0")?;
        let has_pivots = (0..size).all(|place| self.factor[place * size + place] > 0.0);
        require_sound(has_pivots, "a pivot of the scatter is not above zero")?;
        let whole = self.rows.iter().all(|rows| rows.len().is_multiple_of(size.max(1)));
        require_sound(whole, "a training row is incomplete")
    }
}

/// Replaces x by L⁻¹ x, with the row-major lower triangle of L.
pub fn whiten(factor: &[f64], x: &mut [f64]) {
    let size = x.len();
    for place in 0..size {
        let row = &factor[place * size..];
        x[place] = (x[place] - dot(&row[..place], &x[..place])) / row[place];
    }
}

/// The distance to the nearest of several rows, which follow one another; infinite without rows.
pub fn nearest(x: &[f64], rows: &[f64]) -> f64 {
    let mut least = f64::INFINITY;
    for row in rows.chunks_exact(x.len().max(1)) {
        let mut squared = 0.0;
        for (x, row) in x.chunks(FEATURES_AT_ONCE).zip(row.chunks(FEATURES_AT_ONCE)) {
            x.iter().zip(row).for_each(|(a, b)| squared += (a - b) * (a - b));
            // The sum only grows, so this row is not the nearest.
            if squared >= least {
                break;
            }
        }
        if squared < least {
            least = squared;
        }
    }
    libm::sqrt(least)
}

/// The features that [`nearest`] adds between two comparisons.
const FEATURES_AT_ONCE: usize = 4;

#[cfg(test)]
mod tests {
    use super::*;

    /// Two actions in two features: a leak lowers both pressures, a sensor's bias lowers one.
    fn leak_and_bias() -> ExplainedActions {
        ExplainedActions {
            columns: vec![2, 0],
            factor: vec![0.5, 0.0, 0.0, 0.5],
            rows: vec![vec![-2.0, -2.0, -4.0, -4.0], vec![-2.0, 0.0]],
            limit: 1.0,
        }
    }

    #[test]
    fn a_row_between_two_actions_is_explained_by_both() {
        let known = leak_and_bias();
        known.check().unwrap();
        let explain = |row: [f64; 3]| {
            let mut distances = [0.0; 2];
            known.distances_into(&row, &mut known.scratch(), &mut distances).unwrap();
            [0, 1].map(|action| known.explanation(&distances, action))
        };
        assert_eq!(explain([-1.0, 9.0, -1.0]), [Explanation::Only, Explanation::No]);
        assert_eq!(explain([-0.5, 9.0, -1.0]), [Explanation::OneOfSeveral; 2]);
        assert_eq!(explain([3.0, 9.0, 3.0]), [Explanation::No; 2], "both pressures rise");
        assert_eq!(explain([f64::NAN, 9.0, -1.0]), [Explanation::No; 2]);
    }

    #[test]
    fn an_infinite_limit_isolates_nothing() {
        let known = ExplainedActions { limit: f64::INFINITY, ..leak_and_bias() };
        assert_eq!(known.explanation(&[0.0, 5.0], 0), Explanation::OneOfSeveral);
    }

    #[test]
    fn broken_parts_are_rejected() {
        let broken: [fn(&mut ExplainedActions); 4] = [
            |known| known.factor[3] = 0.0,
            |known| known.limit = f64::NAN,
            |known| known.rows[0].truncate(3),
            |known| known.columns.truncate(1),
        ];
        for change in broken {
            let mut known = leak_and_bias();
            change(&mut known);
            assert!(known.check().is_err());
        }
    }
}
