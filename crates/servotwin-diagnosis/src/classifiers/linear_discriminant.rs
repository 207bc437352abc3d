//! Linear discriminant analysis, trained: one linear function for each class.

use serde::{Deserialize, Serialize};

use super::linear::LinearFunctions;
use super::{Classifier, sizes};
use crate::error::Error;

/// A trained linear discriminant model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// The linear function of each class.
    pub functions: LinearFunctions,
    /// The ridge on the within-class correlations: the given one, or the first that made them regular.
    pub ridge: f64,
}

impl Classifier for Model {
    sizes!(functions);

    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        self.functions.shares_into(row, scores);
    }

    fn predict_with(&self, row: &[f64], _scratch: &mut [f64]) -> u32 {
        self.functions.predict(row)
    }

    fn check(&self) -> Result<(), Error> {
        self.functions.check()
    }
}
