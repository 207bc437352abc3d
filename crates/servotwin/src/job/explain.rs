//! Why the hierarchy says what it says about one variant.

use super::{Folder, JobError, Subject, hierarchy};
use crate::evaluation::EvaluationError;
use crate::study::campaign::data_features;
use crate::study::{Role, Study};
use crate::table::{self, Table, TableError};
use serde::Serialize;
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::features::Feature;
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage};
use std::path::Path;

/// What was simulated, and how the hierarchy came to its answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanation {
    /// The number of the variant.
    pub variant: u32,
    /// The operating case.
    pub case: String,
    /// The fault; `healthy` for none.
    pub fault: String,
    /// Its intensity.
    pub intensity: f64,
    /// Whether a residual left the band: otherwise nothing would have been asked.
    pub detectable: bool,
    /// The largest scaled residual.
    pub largest_residual: f64,
    /// Why the variant was not simulated to the end; empty where it was.
    pub failure: String,
    /// The stages in the order in which they were asked.
    pub stages: Vec<Answer>,
}

/// One stage's answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The stage.
    pub stage: String,
    /// What it decides.
    pub question: Question,
    /// What it said.
    pub said: String,
    /// What is true.
    pub truth: String,
    /// The questions asked; none if the classifier is no tree.
    pub steps: Vec<Step>,
    /// Share of the class said among the training rows of the leaf.
    pub purity: Option<f64>,
}

/// One question of a tree.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// The feature, as the stage sees it: a stage that both actuators share sees actuator 2 where
    /// actuator 1 stands.
    pub feature: String,
    /// What it means.
    pub meaning: String,
    /// Its unit.
    pub unit: String,
    /// Its value.
    pub value: f64,
    /// The threshold.
    pub threshold: f64,
    /// Whether the value is above it.
    pub above: bool,
}

/// Explains a variant of a subject's data set; `None` if there is no such variant.
///
/// # Errors
/// A file is missing or cannot be read.
pub fn explain(
    folder: &Folder,
    study: &Study,
    subject: Subject,
    variant: u32,
) -> Result<Option<Explanation>, JobError> {
    let hierarchy = hierarchy(folder, subject)?;
    let path = folder.data_set(subject.setting(), Role::Judged);
    let wrong = |error| JobError::DataSet { path: path.clone(), error };
    let found = read(&path, &hierarchy, variant);
    let Some((mut explanation, views)) = found.map_err(|error| wrong(error.into()))? else {
        return Ok(None);
    };
    let features: Vec<Feature> = data_features(study).into_iter().map(|f| f.feature).collect();
    let truth = truth(study, &explanation.fault);
    let rows: Vec<&[f64]> = views.iter().map(Vec::as_slice).collect();
    let asked = hierarchy.explain(&rows).map_err(EvaluationError::from)?;
    let mut said_actuator = 0;
    for (stage, nodes) in asked {
        let view = stage.place.view(said_actuator);
        let answer = answer(&hierarchy, stage, &nodes, &views[view], &features, &truth);
        if stage.place.question == Question::Actuator {
            let names = &hierarchy.names.actuators;
            said_actuator = names.iter().position(|name| *name == answer.said).unwrap_or(0) as u32;
        }
        explanation.stages.push(answer);
    }
    Ok(Some(explanation))
}

/// A variant, and its features in every view.
type Found = (Explanation, Vec<Vec<f64>>);

fn read(path: &Path, hierarchy: &Hierarchy, variant: u32) -> Result<Option<Found>, TableError> {
    let table = table::read(path)?;
    let row = table.u32("variant")?.iter().position(|own| *own == variant);
    let found = |row| Ok((facts(&table, row, variant)?, views(&table, hierarchy, row)?));
    row.map(found).transpose()
}

fn facts(table: &Table, row: usize, variant: u32) -> Result<Explanation, TableError> {
    Ok(Explanation {
        variant,
        case: table.text("case")?[row].clone(),
        fault: table.text("fault")?[row].clone(),
        intensity: table.f64("intensity")?[row],
        detectable: table.bool("detectable")?[row],
        largest_residual: table.f64("largest_residual")?[row],
        failure: table.text("failure")?[row].clone(),
        stages: vec![],
    })
}

/// The row's features in every view that the hierarchy needs.
fn views(table: &Table, hierarchy: &Hierarchy, row: usize) -> Result<Vec<Vec<f64>>, TableError> {
    let of_view = |prefix: &&str| {
        let names = hierarchy.names.features.iter();
        names.map(|name| Ok(table.f64(&format!("{prefix}:{name}"))?[row])).collect()
    };
    ["f", "m"].iter().take(hierarchy.views()).map(of_view).collect()
}

/// Actuator, command and detail of a fault.
fn truth(study: &Study, fault: &str) -> [String; 3] {
    let known = study.faults.iter().find(|known| known.id == fault);
    known.map_or(["healthy"; 3].map(Into::into), |known| {
        let class = &study.classes[known.class];
        [study.units[known.unit].clone(), class.command.clone(), class.detail.clone()]
    })
}

fn answer(
    hierarchy: &Hierarchy,
    stage: &Stage,
    nodes: &[usize],
    row: &[f64],
    features: &[Feature],
    truth: &[String; 3],
) -> Answer {
    let question = stage.place.question;
    let said = stage.answer(row, &mut hierarchy.scratch()).class;
    let truth = match question {
        Question::Actuator => &truth[0],
        Question::Command => &truth[1],
        Question::Detail => &truth[2],
    };
    let (mut steps, mut purity) = (vec![], None);
    if let Model::Cart(tree) = &stage.model {
        for (column, threshold) in nodes.iter().filter_map(|&node| tree.split(node)) {
            let place = stage.columns[column] as usize;
            let name = &hierarchy.names.features[place];
            let known = features.iter().find(|known| known.name == *name);
            steps.push(Step {
                feature: name.clone(),
                meaning: known.map_or(String::new(), |known| known.meaning.clone()),
                unit: known.map_or(String::new(), |known| known.unit.into()),
                value: row[place],
                threshold,
                above: row[place] > threshold,
            });
        }
        purity = nodes.last().map(|&leaf| tree.purity(leaf));
    }
    Answer {
        stage: stage.id.clone(),
        question,
        said: hierarchy.names.class_name(question, said).into(),
        truth: truth.clone(),
        steps,
        purity,
    }
}
