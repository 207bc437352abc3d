//! Robustness: trained in one scenario, tested in another, usually harder one.

use super::data_set::DataSet;
use super::protocol::{self, Protocol, ProtocolResult};
use super::{EvaluationError, Trained, run};
use crate::study::Role;
use serde::{Deserialize, Serialize};

/// The result for a pair of scenarios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cross {
    /// The training scenario.
    pub trained: String,
    /// The test scenario.
    pub tested: String,
    /// The nine trees on new commands.
    pub trees: ProtocolResult,
    /// The committee on new commands.
    pub committee: ProtocolResult,
}

/// A scenario with its data and model.
pub struct Tested {
    /// The scenario's name.
    pub name: String,
    /// Its data set, with the band in use.
    pub data: DataSet,
    /// The model trained in it.
    pub trained: Trained,
}

/// Tests the model of each scenario on the judged rows of every scenario. Empty without training commands.
///
/// # Errors
/// [`servotwin_diagnosis::Error::LengthMismatch`] if the scenarios have different features.
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
            let wanted = |row: &super::data_set::DataRow| !row.is_healthy && row.is_detected();
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
