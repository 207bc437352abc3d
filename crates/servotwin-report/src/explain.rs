//! Explains the hierarchy's answer for one variant.

use crate::vocabulary::Vocabulary;
use serde::Serialize;
use servotwin::job::{self, Folder, JobError, Subject};
use servotwin::learn::EvaluationError;
use servotwin::records::columns::view_column;
use servotwin::records::{data_features, largest_column};
use servotwin::study::{Purpose, Study};
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::features::Feature;
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage};
use servotwin_diagnosis::panel::{self, Panel};
use servotwin_io::table::{Table, TableError};
use std::path::Path;

/// The simulated variant, and the hierarchy's answer stage by stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanation {
    /// The number of the variant.
    pub variant: u32,
    /// The operating case.
    pub case: String,
    /// The name of the fault, or `healthy`.
    pub fault: String,
    /// The intensity of the fault.
    pub intensity: f64,
    /// Whether a residual left its band. The diagnosis asks no stage otherwise.
    pub detectable: bool,
    /// The combined answer of trees and committee.
    pub verdict: ExplainedVerdict,
    /// The largest scaled residual.
    pub largest_residual: f64,
    /// Why the simulation stopped early; empty if it did not.
    pub failure: String,
    /// The stages in the order in which the hierarchy asks them.
    pub stages: Vec<ExplainedAnswer>,
}

/// The combined answer of trees and committee.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExplainedVerdict {
    /// `healthy`, `not_isolated` or `isolated`.
    pub outcome: &'static str,
    /// The actuator that the committee names; `None` if the only actuator has no name.
    pub actuator: Option<String>,
    /// The action that the committee asks for.
    pub action: Option<String>,
    /// The probability that both are right; `None` if no stage was asked.
    pub confidence: Option<f64>,
}

/// One stage's answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExplainedAnswer {
    /// The name of the stage.
    pub stage: String,
    /// What it decides.
    pub question: Question,
    /// The predicted class. With a single actuator it is `faulty` or `healthy`.
    pub said: String,
    /// The true class.
    pub truth: String,
    /// The questions on the tree's path; empty if the classifier is not a tree.
    pub steps: Vec<TreeStep>,
    /// Share of the predicted class among the training rows in the leaf.
    pub purity: Option<f64>,
}

/// One question of a tree.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TreeStep {
    /// The feature as the stage sees it. Actuators that share a stage all appear to it in the place of actuator 1.
    pub feature: String,
    /// The meaning of the feature.
    pub meaning: String,
    /// The unit of the feature.
    pub unit: String,
    /// The value of the feature.
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
    let panel = job::panel(folder, subject)?;
    let hierarchy = &panel.trees;
    let path = folder.data_set(subject.scenario(), Purpose::Test);
    let wrong = |error| JobError::DataSet { path: path.clone(), error };
    let found = read(&path, &panel, variant);
    let Some((mut explanation, views)) = found.map_err(wrong)? else {
        return Ok(None);
    };
    let features: Vec<Feature> = data_features(study).into_iter().map(|f| f.feature).collect();
    let words = Vocabulary::of(study);
    let truth = truth(study, &words, &explanation.fault);
    let rows: Vec<&[f64]> = views.iter().map(Vec::as_slice).collect();
    let asked = hierarchy.explain((rows[0], &rows)).map_err(EvaluationError::from)?;
    let mut said_actuator = 0;
    for (stage, nodes) in asked {
        let view = stage.place.view(said_actuator);
        let answer = answer(hierarchy, stage, &nodes, &views[view], &features, &words, &truth);
        if stage.place.question == Question::Actuator {
            let names = &hierarchy.names.actuators;
            said_actuator = names.iter().position(|name| *name == answer.said).unwrap_or(0) as u32;
        }
        explanation.stages.push(answer);
    }
    Ok(Some(explanation))
}

/// Counts the variants of a subject's data set. They are numbered from 0.
///
/// # Errors
/// The data set is missing or cannot be read.
pub fn variants(folder: &Folder, subject: Subject) -> Result<usize, JobError> {
    let path = folder.data_set(subject.scenario(), Purpose::Test);
    match Table::read(&path) {
        Ok(table) => Ok(table.row_count()),
        Err(error) => Err(JobError::DataSet { path, error: error.into() }),
    }
}

/// A variant, and its features in each view.
type Found = (Explanation, Vec<Vec<f64>>);

fn read(path: &Path, panel: &Panel, variant: u32) -> Result<Option<Found>, EvaluationError> {
    let table = Table::read(path)?;
    let row = table.u32("variant")?.iter().position(|own| *own == variant);
    let found = |row| {
        let views = views(&table, &panel.trees, row)?;
        let mut facts = facts(&table, row, variant)?;
        let largest = panel.bands.iter().map(|band| largest(&table, &band.sensor, row));
        let largest = largest.collect::<Result<Vec<f64>, _>>()?;
        facts.detectable = panel.is_detected(&largest);
        facts.verdict = verdict(panel, &largest, &views)?;
        Ok((facts, views))
    };
    row.map(found).transpose()
}

fn largest(table: &Table, sensor: &str, row: usize) -> Result<f64, TableError> {
    Ok(table.f64(&largest_column(sensor))?[row])
}

fn verdict(
    panel: &Panel,
    largest: &[f64],
    views: &[Vec<f64>],
) -> Result<ExplainedVerdict, EvaluationError> {
    let rows: Vec<&[f64]> = views.iter().map(Vec::as_slice).collect();
    let (outcome, said) = match panel.diagnose(largest, &rows, &mut panel.scratch())? {
        panel::PanelVerdict::Healthy => ("healthy", None),
        panel::PanelVerdict::NotIsolated(said) => ("not_isolated", Some(said)),
        panel::PanelVerdict::Isolated(said) => ("isolated", Some(said)),
    };
    let names = &panel.trees.names;
    let actuator = said.and_then(|said| said.actuator);
    let action = said.and_then(|said| said.action);
    Ok(ExplainedVerdict {
        outcome,
        actuator: actuator
            .map(|actuator| names.actuators[actuator as usize].clone())
            .filter(|name| !name.is_empty()),
        action: action.map(|action| names.actions[action as usize].clone()),
        confidence: said.map(|said| said.confidence),
    })
}

fn facts(table: &Table, row: usize, variant: u32) -> Result<Explanation, TableError> {
    Ok(Explanation {
        variant,
        case: table.text("case")?[row].clone(),
        fault: table.text("fault")?[row].clone(),
        intensity: table.f64("intensity")?[row],
        detectable: false,
        verdict: ExplainedVerdict {
            outcome: "healthy",
            actuator: None,
            action: None,
            confidence: None,
        },
        largest_residual: table.f64("largest_residual")?[row],
        failure: table.text("failure")?[row].clone(),
        stages: vec![],
    })
}

/// Returns the row's features in every view that the hierarchy needs.
fn views(table: &Table, hierarchy: &Hierarchy, row: usize) -> Result<Vec<Vec<f64>>, TableError> {
    let of_view = |view: usize| {
        let names = hierarchy.names.features.iter();
        names.map(|name| Ok(table.f64(&view_column(view, name))?[row])).collect()
    };
    (0..hierarchy.views()).map(of_view).collect()
}

/// The true actuator, action and fault class of a fault.
fn truth(study: &Study, words: &Vocabulary, fault: &str) -> [String; 3] {
    let known = study.faults.iter().find(|known| known.id == fault);
    known.map_or(["healthy"; 3].map(Into::into), |known| {
        let class = &study.classes[known.class];
        let actuator = words.class(Question::Actuator, &study.actuators[known.actuator]);
        [actuator.to_owned(), class.action.clone(), class.detail.clone()]
    })
}

fn answer(
    hierarchy: &Hierarchy,
    stage: &Stage,
    nodes: &[usize],
    row: &[f64],
    features: &[Feature],
    words: &Vocabulary,
    truth: &[String; 3],
) -> ExplainedAnswer {
    let question = stage.place.question;
    let said = stage.answer(row, &mut hierarchy.scratch()).class;
    let truth = match question {
        Question::Actuator => &truth[0],
        Question::Action => &truth[1],
        Question::Detail => &truth[2],
    };
    let (mut steps, mut purity) = (vec![], None);
    if let Model::Cart(tree) = &stage.model {
        for (column, threshold) in nodes.iter().filter_map(|&node| tree.split(node)) {
            let place = stage.columns[column] as usize;
            let name = &hierarchy.names.features[place];
            let known = features.iter().find(|known| known.name == *name);
            steps.push(TreeStep {
                feature: name.clone(),
                meaning: known.map_or(String::new(), |known| words.adapted(&known.meaning)),
                unit: known.map_or(String::new(), |known| known.unit.into()),
                value: row[place],
                threshold,
                above: row[place] > threshold,
            });
        }
        purity = nodes.last().map(|&leaf| tree.purity(leaf));
    }
    ExplainedAnswer {
        stage: stage.id.clone(),
        question,
        said: words.class(question, hierarchy.names.class_name(question, said)).into(),
        truth: truth.clone(),
        steps,
        purity,
    }
}
