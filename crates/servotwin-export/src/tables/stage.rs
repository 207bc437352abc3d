//! The tables of one stage: flat arrays without leaves among the nodes.

use super::MOST_CLASSES;
use crate::error::ExportError;
use crate::notation::{record, write_array, write_numbers, write_private};
use servotwin_diagnosis::calibration;
use servotwin_diagnosis::classifiers::{Classifier, Model, boosted_trees, cart};
use servotwin_diagnosis::hierarchy::{Question, Stage};
use servotwin_diagnosis::tree::Branches;
use servotwin_model::c_source::hexadecimal;

/// Most nodes of a stage: children are 16-bit numbers with a sign.
const MOST_NODES: usize = i16::MAX as usize;

/// Most features: the highest bit of a node's feature is the side of missing values.
const MOST_FEATURES: usize = 1 << 15;

/// `SERVOTWIN_MISSING_LEFT` of the hand-written code.
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
        let places: Vec<i32> = (0..branches.node_count())
            .map(|node| match branches.split(node) {
                Some(_) => next(&mut inner),
                None => -1 - next(&mut leaves),
            })
            .collect();
        let mut depths = vec![0; branches.node_count()];
        for node in 0..branches.node_count() {
            let test = branches.split(node).zip(branches.children(node));
            let Some(((feature, threshold), (left, right))) = test else {
                self.leaves.push((tree, node));
                self.depth = self.depth.max(depths[node]);
                continue;
            };
            let missing = if branches.missing_left(node) { MISSING_LEFT } else { 0 };
            self.features.push(columns[feature] | missing);
            // A question whether there is a value has a threshold above all numbers.
            self.thresholds.push(threshold.clamp(f64::MIN, f64::MAX));
            for (side, child) in [(&mut self.left, left), (&mut self.right, right)] {
                side.push(places[child]);
                depths[child] = depths[node] + 1;
            }
        }
        places[0]
    }

    /// Writes the arrays, and returns the struct of them.
    fn write(&self, text: &mut String, prefix: &str) -> String {
        let name = |what: &str| format!("{prefix}_{what}");
        write_array(text, "int16_t", &name("roots"), &self.roots);
        let features = self.features.iter().map(|feature| format!("{feature}U"));
        write_array(text, "uint16_t", &name("features"), features);
        write_numbers(text, &name("thresholds"), self.thresholds.iter().copied());
        write_array(text, "int16_t", &name("left"), &self.left);
        write_array(text, "int16_t", &name("right"), &self.right);
        let counts = [self.roots.len(), self.depth].map(|count| count.to_string());
        let arrays = ["roots", "features", "thresholds", "left", "right"].map(name);
        record(&[&counts[..], &arrays[..]].concat())
    }
}

/// Writes the arrays of a stage, and returns its entry in the array of stages.
pub(crate) fn write(text: &mut String, prefix: &str, stage: &Stage) -> Result<String, ExportError> {
    let nodes = match &stage.model {
        Model::Cart(tree) => Nodes::of([tree.branches()], &stage.columns),
        Model::BoostedTrees(model) => {
            let branches = model.trees.iter().map(|tree| &tree.branches);
            Nodes::of(branches, &stage.columns)
        }
        other => {
            return Err(ExportError::Classifier {
                stage: stage.id.clone(),
                kind: other.kind().title(),
            });
        }
    };
    check(stage, &nodes)?;
    let branches = nodes.write(text, prefix);
    let names = format!("{prefix}_names");
    write_array(text, "uint8_t", &names, &stage.classes);
    let (mut cart, mut boosted) = (String::from("0"), String::from("0"));
    match &stage.model {
        Model::Cart(tree) => {
            cart = write_cart(text, prefix, tree, &nodes, stage.temperature);
        }
        Model::BoostedTrees(model) => {
            boosted = write_boosted(text, prefix, model, &nodes, stage.temperature);
        }
        _ => {}
    }
    let classes = stage.classes.len().to_string();
    let reads_own = stage.place.question != Question::Actuator && stage.place.actuator.is_none();
    let reads_own_view = u8::from(reads_own).to_string();
    Ok(record(&[branches, cart, boosted, classes, names, reads_own_view]))
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

/// Writes the rule of a single tree; returns its address. A leaf always gives the same answer, so its calibrated
/// probability is a number of the table.
fn write_cart(
    text: &mut String,
    prefix: &str,
    tree: &cart::Model,
    nodes: &Nodes,
    temperature: f64,
) -> String {
    let probability = |node: usize| {
        let weights = tree.weights(node);
        let total: f64 = weights.iter().sum();
        let mut shares: Vec<f64> = weights.iter().map(|weight| weight / total).collect();
        calibration::scale(&mut shares, temperature);
        shares[tree.decision(node) as usize]
    };
    let leaves = || nodes.leaves.iter().map(|(_, node)| *node);
    let [decisions, probabilities] =
        ["decisions", "probabilities"].map(|what| format!("{prefix}_{what}"));
    write_array(text, "uint8_t", &decisions, leaves().map(|node| tree.decision(node)));
    write_numbers(text, &probabilities, leaves().map(probability));
    let (name, record) = (format!("{prefix}_cart"), record(&[decisions, probabilities]));
    write_private(text, "servotwin_cart", &name, &record);
    format!("&{name}")
}

/// Writes the rule of boosted trees; returns its address.
fn write_boosted(
    text: &mut String,
    prefix: &str,
    model: &boosted_trees::Model,
    nodes: &Nodes,
    temperature: f64,
) -> String {
    let outputs = model.outputs();
    let mut start = vec![NO_SCORE; model.classes()];
    model.present.iter().for_each(|&class| start[class as usize] = 0.0);
    outputs.iter().zip(&model.priors).for_each(|(&class, prior)| start[class as usize] = *prior);
    let values = nodes.leaves.iter().flat_map(|&(tree, node)| {
        model.trees[tree].values[node * outputs.len()..(node + 1) * outputs.len()].iter().copied()
    });
    let [of_outputs, of_start, of_values] =
        ["output_classes", "start", "values"].map(|what| format!("{prefix}_{what}"));
    write_array(text, "uint8_t", &of_outputs, outputs);
    write_numbers(text, &of_start, start);
    write_numbers(text, &of_values, values);
    let inverse_temperature = hexadecimal(1.0 / temperature);
    let count = outputs.len().to_string();
    let record = record(&[count, of_outputs, of_start, of_values, inverse_temperature]);
    let name = format!("{prefix}_boosted");
    write_private(text, "servotwin_boosted", &name, &record);
    format!("&{name}")
}
