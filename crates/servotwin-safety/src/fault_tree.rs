//! The artefact *fault tree*: Open-PSA documents, figures, cut sets, importance, probabilities in a flight, and rates per
//! flight hour.

use crate::error::SafetyError;
use crate::interval::{CONFIDENCE, CountedValue};
use crate::rated_flights::RatedFlights;
use crate::rates::rated_faults;
use crate::results::StudyResultsFolder;
use crate::tree::lanes::{LaneTrees, TreeParameter, lane_trees};
use crate::tree::numbers::{BandEnd, ExposureHours, TopNumbers, evaluate};
use crate::tree::{drawing, exchange};
use serde::Serialize;
use servotwin::table::{Column, Table};
use std::path::PathBuf;

/// The fault trees of a study and everything that is written of them.
#[derive(Debug, Clone)]
pub struct FaultTreeArtefact {
    trees: LaneTrees,
    study: String,
    hours: ExposureHours,
    /// The numbers of every top event.
    pub tops: Vec<TopNumbers>,
    /// What readers must know, such as a missing tree.
    pub notes: Vec<String>,
}

/// The numbers as they are written to `fault-tree.json`.
#[derive(Serialize)]
struct Written<'a> {
    format: &'static str,
    study: &'a str,
    basis: String,
    exposure: ExposureHours,
    joint_confidence: f64,
    parameters: Vec<WrittenParameter>,
    notes: &'a [String],
    tops: &'a [TopNumbers],
}

#[derive(Serialize)]
struct WrittenParameter {
    id: String,
    kind: &'static str,
    #[serde(flatten)]
    value: CountedValue,
    evidence: String,
}

impl FaultTreeArtefact {
    /// Builds and evaluates the trees of a study.
    ///
    /// # Errors
    /// The study has no action that switches an actuator off; a rate is missing.
    pub fn new(flights: &RatedFlights) -> Result<Self, SafetyError> {
        let RatedFlights { results, flights, rates, hours } = flights;
        let (study, hours) = (&results.study, *hours);
        let trees = lane_trees(study, flights, rates)?;
        let mut notes = trees.notes.clone();
        let listed = rated_faults(study).count();
        let all = study.system.all_faults().len();
        if listed < all {
            notes.push(format!(
                "the study lists {listed} of the system's {all} faults; the others are in no tree"
            ));
        }
        let tops = evaluate(&trees, &hours);
        Ok(FaultTreeArtefact { trees, study: study.name.clone(), hours, tops, notes })
    }

    /// Writes all files and returns their paths.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, results: &StudyResultsFolder) -> Result<Vec<PathBuf>, SafetyError> {
        let mut written = vec![];
        for end in BandEnd::ALL {
            let text = exchange::document(&self.study, &self.trees, &self.hours, end);
            written.push(results.write(&format!("fault-tree{}.xml", end.suffix()), &text)?);
        }
        written.push(results.write("fault-tree.json", &self.json(&results.basis.in_words()))?);
        for top in &self.trees.tree.tops {
            let id = &self.trees.tree.gates[top.gate].id;
            let figure = drawing::draw(&self.trees, &self.hours, top.gate);
            written.push(results.write(&format!("fault-tree-{id}.svg"), &figure.svg)?);
        }
        written.push(results.write_table("fault-tree-cutsets.csv", &self.cut_sets()?)?);
        written.push(results.write_table("fault-tree-importance.csv", &self.importance()?)?);
        Ok(written)
    }

    /// The numbers as JSON.
    pub(crate) fn json(&self, basis: &str) -> String {
        let parameter = |kind: &'static str| {
            move |own: &'_ TreeParameter| WrittenParameter {
                id: own.id.clone(),
                kind,
                value: own.value,
                evidence: own.evidence.clone(),
            }
        };
        let rates = self.trees.rates.iter().map(parameter("rate_per_h"));
        let parameters = rates.chain(self.trees.constants.iter().map(parameter("probability")));
        let written = Written {
            format: "servotwin fault tree 1",
            study: &self.study,
            basis: basis.into(),
            exposure: self.hours,
            joint_confidence: CONFIDENCE,
            parameters: parameters.collect(),
            notes: &self.notes,
            tops: &self.tops,
        };
        serde_json::to_string_pretty(&written).unwrap_or_default() + "\n"
    }

    /// The most probable minimal cut sets of all trees.
    fn cut_sets(&self) -> Result<Table, SafetyError> {
        let sets =
            || self.tops.iter().flat_map(|top| top.cut_sets.iter().map(move |set| (top, set)));
        Ok(Table::from_columns(vec![
            Column::of("top_event", "", sets(), |(top, _)| top.id.clone()),
            Column::of("probability", "1", sets(), |(_, set)| set.probability),
            Column::of("probability_upper", "1", sets(), |(_, set)| set.upper),
            Column::of("order", "1", sets(), |(_, set)| set.events.len() as u32),
            Column::of("events", "", sets(), |(_, set)| set.events.join(" and ")),
        ])?)
    }

    /// The importance of all events for all trees.
    fn importance(&self) -> Result<Table, SafetyError> {
        let events =
            || self.tops.iter().flat_map(|top| top.importances.iter().map(move |own| (top, own)));
        Ok(Table::from_columns(vec![
            Column::of("top_event", "", events(), |(top, _)| top.id.clone()),
            Column::of("event", "", events(), |(_, own)| own.event.clone()),
            Column::of("probability", "1", events(), |(_, own)| own.probability),
            Column::of("probability_upper", "1", events(), |(_, own)| own.upper),
            Column::of("birnbaum", "1", events(), |(_, own)| own.birnbaum),
            Column::of("fussell_vesely", "1", events(), |(_, own)| own.fussell_vesely),
            Column::of("title", "", events(), |(_, own)| own.title.clone()),
        ])?)
    }
}
