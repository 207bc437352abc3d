//! The tables of one stage: flat arrays without leaves among the nodes, as `servotwin_models.h` reads them.

use super::super::MOST_CLASSES;
use super::super::literal::{array, numbers};
use crate::error::ExportError;
use servotwin_diagnosis::calibration;
use servotwin_diagnosis::classifiers::{Classifier, Model, boosted_trees, cart};
use servotwin_diagnosis::hierarchy::{Question, Stage};
use servotwin_diagnosis::tree::Branches;
use servotwin_model::c_source::hexadecimal;
use std::fmt::Write;

/// Most nodes of a stage: children are 16-bit numbers with a sign.
const MOST_NODES: usize = i16::MAX as usize;

/// Most features: the highest bit of a node's feature says where missing values go.
const MOST_FEATURES: usize = 1 << 15;

/// `SERVOTWIN_MISSING_LEFT`.
const MISSING_LEFT: u32 = 1 << 15;

/// Score of a class without training rows, far below all others: its share is 0.
const NO_SCORE: f64 = -1e300;

/// The nodes of all trees of a stage. Leaves are numbered through all trees.
#[derive(Default)]
struct Nodes {
    roots: Vec<i32>,
    features: Vec<u32>,
    thresholds: Vec<f64>,
    left: Vec<i32>,
    right: Vec<i32>,
    /// Most tests on the way to a leaf.
    depth: usize,
    /// The tree and node of each leaf.
    leaves: Vec<(usize, usize)>,
}

impl Nodes {
    /// The trees of a stage that reads these columns of a row.
    fn of<'b>(trees: impl IntoIterator<Item = &'b Branches>, columns: &[u32]) -> Self {
        let mut nodes = Nodes::default();
        for (tree, branches) in trees.into_iter().enumerate() {
            let root = nodes.add(tree, branches, columns);
            nodes.roots.push(root);
        }
        nodes
    }

    /// Adds a tree; returns its root. Children come after their parent, so their places are known beforehand.
    fn add(&mut self, tree: usize, branches: &Branches, columns: &[u32]) -> i32 {
        let (mut inner, mut leaves) = (self.features.len() as i32, self.leaves.len() as i32);
        let next = |counter: &mut i32| std::mem::replace(counter, *counter + 1);
        let places: Vec<i32> = (0..branches.len())
            .map(|node| match branches.split(node) {
                Some(_) => next(&mut inner),
                None => -1 - next(&mut leaves),
            })
            .collect();
        let mut depths = vec![0; branches.len()];
        for node in 0..branches.len() {
            let test = branches.split(node).zip(branches.children(node));
            let Some(((feature, threshold), (left, right))) = test else {
                self.leaves.push((tree, node));
                self.depth = self.depth.max(depths[node]);
                continue;
            };
            let missing = if branches.missing_left(node) { MISSING_LEFT } else { 0 };
            self.features.push(columns[feature] | missing);
            self.thresholds.push(threshold);
            for (side, child) in [(&mut self.left, left), (&mut self.right, right)] {
                side.push(places[child]);
                depths[child] = depths[node] + 1;
            }
        }
        places[0]
    }

    fn write(&self, c: &mut String, prefix: &str) {
        array(c, "int16_t", &format!("{prefix}_roots"), &self.roots);
        array(
            c,
            "uint16_t",
            &format!("{prefix}_features"),
            self.features.iter().map(|f| format!("{f}U")),
        );
        numbers(c, &format!("{prefix}_thresholds"), self.thresholds.iter().copied());
        array(c, "int16_t", &format!("{prefix}_left"), &self.left);
        array(c, "int16_t", &format!("{prefix}_right"), &self.right);
    }
}

/// Writes the arrays of a stage, and returns its entry in the array of stages.
pub(super) fn write(c: &mut String, prefix: &str, stage: &Stage) -> Result<String, ExportError> {
    let (nodes, kind) = match &stage.model {
        Model::Cart(tree) => (Nodes::of([tree.branches()], &stage.columns), "cart"),
        Model::BoostedTrees(model) => {
            let branches = model.trees.iter().map(|tree| &tree.branches);
            (Nodes::of(branches, &stage.columns), "boosted")
        }
        other => {
            return Err(ExportError::Classifier {
                stage: stage.id.clone(),
                kind: other.kind().title(),
            });
        }
    };
    check(stage, &nodes)?;
    nodes.write(c, prefix);
    array(c, "uint8_t", &format!("{prefix}_names"), &stage.classes);
    match &stage.model {
        Model::Cart(tree) => write_cart(c, prefix, tree, &nodes, stage.temperature),
        Model::BoostedTrees(model) => write_boosted(c, prefix, model, &nodes, stage.temperature),
        _ => {}
    }
    let own = stage.place.question != Question::Actuator && stage.place.actuator.is_none();
    let [cart, boosted] =
        ["cart", "boosted"].map(|k| if k == kind { format!("&{prefix}_{k}") } else { "0".into() });
    Ok(format!(
        "    {{ {{ {}, {}, {prefix}_roots, {prefix}_features, {prefix}_thresholds, {prefix}_left, {prefix}_right }}, \
         {cart}, {boosted}, {}, {prefix}_names, {} }}, /* {} */",
        nodes.roots.len(),
        nodes.depth,
        stage.classes.len(),
        u8::from(own),
        stage.id,
    ))
}

fn check(stage: &Stage, nodes: &Nodes) -> Result<(), ExportError> {
    let fits = |what, count: usize, most: usize| match count <= most {
        true => Ok(()),
        false => Err(ExportError::TooMany { stage: stage.id.clone(), what, count, most }),
    };
    fits("nodes", nodes.features.len().max(nodes.leaves.len()), MOST_NODES)?;
    fits("classes", stage.classes.len(), MOST_CLASSES)?;
    let largest = stage.columns.iter().copied().max().unwrap_or(0);
    fits("features", largest as usize + 1, MOST_FEATURES)
}

/// A leaf of a single tree always gives the same answer, so its calibrated probability is a number of the table.
fn write_cart(c: &mut String, prefix: &str, tree: &cart::Model, nodes: &Nodes, temperature: f64) {
    let probability = |node: usize| {
        let weights = tree.weights(node);
        let total: f64 = weights.iter().sum();
        let mut shares: Vec<f64> = weights.iter().map(|weight| weight / total).collect();
        calibration::scale(&mut shares, temperature);
        shares[tree.decision(node) as usize]
    };
    let leaves = || nodes.leaves.iter().map(|(_, node)| *node);
    array(c, "uint8_t", &format!("{prefix}_decisions"), leaves().map(|node| tree.decision(node)));
    numbers(c, &format!("{prefix}_probabilities"), leaves().map(probability));
    let _ = writeln!(
        c,
        "static const servotwin_cart {prefix}_cart = {{ {prefix}_decisions, {prefix}_probabilities }};"
    );
}

fn write_boosted(
    c: &mut String,
    prefix: &str,
    model: &boosted_trees::Model,
    nodes: &Nodes,
    temperature: f64,
) {
    let outputs = model.outputs();
    let mut start = vec![NO_SCORE; model.classes()];
    model.present.iter().for_each(|&class| start[class as usize] = 0.0);
    outputs.iter().zip(&model.priors).for_each(|(&class, prior)| start[class as usize] = *prior);
    let values = nodes.leaves.iter().flat_map(|&(tree, node)| {
        model.trees[tree].values[node * outputs.len()..(node + 1) * outputs.len()].iter().copied()
    });
    array(c, "uint8_t", &format!("{prefix}_output_classes"), outputs);
    numbers(c, &format!("{prefix}_start"), start);
    numbers(c, &format!("{prefix}_values"), values);
    let _ = writeln!(
        c,
        "static const servotwin_boosted {prefix}_boosted = {{ {}, {prefix}_output_classes, {prefix}_start, \
         {prefix}_values, {} }};",
        outputs.len(),
        hexadecimal(1.0 / temperature),
    );
}
