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

/// A scenario with its model.
pub struct Tested {
    /// The scenario.
    pub name: String,
    /// Its data set, with the band in use.
    pub data: DataSet,
    /// The model that was trained in it.
    pub trained: Trained,
}

/// Tests the model of each scenario on the judged rows of every scenario. Nothing without training commands.
///
/// # Errors
/// [`servotwin_diagnosis::Error::LengthMismatch`] for scenarios of other features.
pub fn evaluate(
    scenarios: &[&Tested],
    shutdowns: &[String],
) -> Result<Vec<Cross>, EvaluationError> {
    let mut list = vec![];
    if scenarios.iter().any(|scenario| !scenario.data.has_training()) {
        return Ok(list);
    }
    for Tested { name: trained, trained: model, .. } in scenarios {
        for Tested { name: tested, data, .. } in scenarios {
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
