//! The least pure leaves of the trees.

use super::data_set::{DataSet, TrainingFilter};
use super::error::EvaluationError;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::hierarchy::{Hierarchy, Stage};
use servotwin_diagnosis::tree::Tree;
use servotwin_learning::hierarchy::HierarchySettings;
use std::collections::BTreeMap;

/// A leaf with more than one class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorstLeaf {
    /// The stage's id.
    pub stage: String,
    /// The index of the node.
    pub node: usize,
    /// The class that the leaf decides.
    pub class: String,
    /// Share of that class, from 0 to 1.
    pub purity: f64,
    /// Number of training rows in the leaf, including symmetric copies.
    pub rows: u32,
    /// The questions on the path to it.
    pub conditions: Vec<Condition>,
    /// The kinds of fault in the leaf with their class, the most frequent first.
    pub contents: Vec<Content>,
}

/// A question on the path to a leaf, with its answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// The feature in the question.
    pub feature: String,
    /// Whether the path continues above the threshold.
    pub above: bool,
    /// The threshold of the question.
    pub threshold: f64,
}

/// The rows of one kind in a leaf.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Content {
    /// The kind of fault.
    pub kind: String,
    /// The class of these rows.
    pub class: String,
    /// Number of rows.
    pub rows: u32,
}

/// The least pure leaves of every tree, at most `count` for each stage.
///
/// # Errors
/// [`EvaluationError::NothingDetectable`], and errors of the samples.
pub fn worst(
    data: &DataSet,
    settings: &HierarchySettings,
    hierarchy: &Hierarchy,
    lessons: TrainingFilter,
    count: usize,
) -> Result<Vec<WorstLeaf>, EvaluationError> {
    let rows = &data.learnt_from(lessons)?;
    let mut worst = vec![];
    for stage in &hierarchy.stages {
        let Model::Cart(tree) = &stage.model else {
            continue;
        };
        let contents = contents(data, settings, stage, tree, rows)?;
        let mixed = tree.leaves().into_iter().filter(|leaf| leaf.purity < 1.0);
        worst.extend(mixed.take(count).map(|leaf| WorstLeaf {
            stage: stage.id.clone(),
            node: leaf.node,
            class: class_name(hierarchy, stage, leaf.class),
            purity: leaf.purity,
            rows: leaf.rows,
            conditions: conditions(hierarchy, stage, tree, leaf.node),
            contents: contents.get(&leaf.node).cloned().unwrap_or_default(),
        }));
    }
    Ok(worst)
}

fn class_name(hierarchy: &Hierarchy, stage: &Stage, class: u32) -> String {
    let class = stage.classes[class as usize];
    hierarchy.names.class_name(stage.place.question, class).to_owned()
}

fn feature_name(hierarchy: &Hierarchy, stage: &Stage, feature: usize) -> String {
    hierarchy.names.features[stage.columns[feature] as usize].clone()
}

/// The questions from the root to a node.
fn conditions(hierarchy: &Hierarchy, stage: &Stage, tree: &Tree, node: usize) -> Vec<Condition> {
    let mut conditions = vec![];
    let mut at = 0;
    while at != node {
        let (Some((feature, threshold)), Some((left, right))) = (tree.split(at), tree.children(at))
        else {
            break;
        };
        // Nodes are in preorder: everything below the right child comes after it.
        let above = node >= right;
        let feature = feature_name(hierarchy, stage, feature);
        conditions.push(Condition { feature, above, threshold });
        at = if above { right } else { left };
    }
    conditions
}

/// The kinds of fault in every leaf of a tree.
fn contents(
    data: &DataSet,
    settings: &HierarchySettings,
    stage: &Stage,
    tree: &Tree,
    rows: &[usize],
) -> Result<BTreeMap<usize, Vec<Content>>, EvaluationError> {
    let mut leaves = BTreeMap::new();
    let Some((samples, origins)) = data.examples.samples(&stage.place, rows, settings.mirror)?
    else {
        return Ok(leaves);
    };
    let mut counts: BTreeMap<(usize, u32, u32), u32> = BTreeMap::new();
    let mut values = vec![0.0; samples.features()];
    for (sample, &origin) in origins.iter().enumerate() {
        samples.row_into(sample, &mut values);
        let leaf = tree.branches().leaf_of(&values);
        let key = (leaf, data.rows[origin].kind, samples.labels()[sample]);
        *counts.entry(key).or_default() += 1;
    }
    for ((leaf, kind, class), rows) in counts {
        let class = samples.class_names()[class as usize].clone();
        let kind = data.kinds[kind as usize].clone();
        leaves.entry(leaf).or_insert_with(Vec::new).push(Content { kind, class, rows });
    }
    for contents in leaves.values_mut() {
        contents.sort_by_key(|content| std::cmp::Reverse(content.rows));
    }
    Ok(leaves)
}
