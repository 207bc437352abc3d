//! Trained on one setting, tested on another: what a diagnosis learned in a kinder world is worth in
//! a harder one.

use super::data_set::DataSet;
use super::protocol::{self, Protocol, ProtocolResult};
use super::{EvaluationError, Trained, run};
use crate::study::Role;
use serde::{Deserialize, Serialize};

/// One pair of settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cross {
    /// Where it was trained.
    pub trained: String,
    /// Where it was tested.
    pub tested: String,
    /// The nine trees on new commands.
    pub trees: ProtocolResult,
    /// The committee.
    pub committee: ProtocolResult,
}

/// Asks what was trained on the training commands of each setting about the judged rows of every
/// setting. Nothing without training commands.
///
/// # Errors
/// [`servotwin_diagnosis::Error::LengthMismatch`] for settings of other features.
pub fn evaluate(
    settings: &[(String, DataSet, Trained)],
    shutdowns: &[String],
) -> Result<Vec<Cross>, EvaluationError> {
    let mut list = vec![];
    if settings.iter().any(|(_, data, _)| !data.has_training()) {
        return Ok(list);
    }
    for (trained, _, model) in settings {
        for (tested, data, _) in settings {
            let wanted =
                |row: &super::data_set::Row| !row.is_healthy && row.is_detected() && !row.reflected;
            let rows = data.rows_where(Role::Judged, wanted);
            let of = |hierarchy| -> Result<ProtocolResult, EvaluationError> {
                let outcomes = [run::ask(data, hierarchy, &rows)?];
                Ok(protocol::summary(Protocol::NewCommand, data, &outcomes, shutdowns))
            };
            list.push(Cross {
                trained: trained.clone(),
                tested: tested.clone(),
                trees: of(&model.trees)?,
                committee: of(&model.committee.hierarchy)?,
            });
        }
    }
    Ok(list)
}
