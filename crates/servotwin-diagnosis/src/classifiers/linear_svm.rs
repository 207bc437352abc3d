//! A linear support vector machine, trained: one linear function for each class.

use serde::{Deserialize, Serialize};

use super::linear::LinearFunctions;
use super::{Classifier, Scores, sizes};
use crate::error::Error;

/// A trained linear SVM.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// The linear function of each class.
    pub functions: LinearFunctions,
    /// Whether every class reached the tolerance before the last pass.
    pub converged: bool,
}

impl Classifier for Model {
    sizes!(functions);

    fn scores(&self) -> Scores {
        Scores::Margins
    }

    /// Writes the margins; a class without training rows gets minus infinity.
    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        self.functions.values_into(row, scores);
    }

    fn predict_with(&self, row: &[f64], _scratch: &mut [f64]) -> u32 {
        self.functions.predict(row)
    }

    fn check(&self) -> Result<(), Error> {
        self.functions.check()
    }
}
