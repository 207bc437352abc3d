//! Trained trees as figures.

use super::looks::Looks;
use super::vocabulary::Vocabulary;
use super::words::{distinct, of_unit, spoken, three_digits};
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::features::Feature;
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage};
use servotwin_diagnosis::tree::Tree;
use servotwin_view::tree::{Node, TreeFigure as Drawing};

/// Draws the tree of a stage; `None` if its classifier is not a tree.
pub(crate) fn drawing(
    hierarchy: &Hierarchy,
    stage: &Stage,
    features: &[Feature],
    words: &Vocabulary,
    looks: &Looks,
) -> Option<Drawing> {
    let question = stage.place.question;
    let Model::Cart(tree) = &stage.model else {
        return None;
    };
    let class = |&class: &u32| hierarchy.names.class_name(question, class);
    let looks = stage.classes.iter().map(class).map(|name| looks.class(question, name)).collect();
    let classes = stage.classes.iter().map(class).map(|name| spoken(words.class(question, name)));
    let names: Vec<String> =
        stage.columns.iter().map(|&c| hierarchy.names.features[c as usize].clone()).collect();
    let classes: Vec<String> = classes.collect();
    let root = nodes(tree, &names, &classes, features);
    Some(Drawing { title: String::new(), classes, looks, root })
}

/// Whether a stage decides between classes. The actuator stage does not if its tree was trained with one class only,
/// e.g. because no healthy variant left the bands.
pub(crate) fn decides(stage: &Stage) -> bool {
    match &stage.model {
        Model::Cart(tree) if stage.place.question == Question::Actuator => {
            tree.weights(0).iter().filter(|&&weight| weight > 0.0).count() > 1
        }
        _ => true,
    }
}

/// The features that a stage uses, each once, in the order of the nodes.
pub(crate) fn asked<'h>(hierarchy: &'h Hierarchy, stage: &Stage) -> Vec<&'h str> {
    let Model::Cart(tree) = &stage.model else {
        return vec![];
    };
    let splits = (0..tree.nodes()).filter_map(|node| tree.split(node));
    distinct(
        splits.map(|(column, _)| hierarchy.names.features[stage.columns[column] as usize].as_str()),
    )
}

/// The nodes of a tree, with names for its features and classes.
pub fn nodes(tree: &Tree, names: &[String], classes: &[String], features: &[Feature]) -> Node {
    Drawer { tree, names, classes, features }.node(0)
}

struct Drawer<'a> {
    tree: &'a Tree,
    names: &'a [String],
    classes: &'a [String],
    features: &'a [Feature],
}

impl Drawer<'_> {
    fn node(&self, node: usize) -> Node {
        let tree = self.tree;
        let rows: u32 = tree.counts(node).iter().sum();
        let purity = three_digits(100.0 * tree.purity(node));
        let size = [format!("n = {rows}"), format!("purity {purity} %")];
        let with_size = |first: String| std::iter::once(first).chain(size).collect();
        let shares = tree.weights(node).to_vec();
        match tree.split(node).zip(tree.children(node)) {
            Some(((feature, threshold), (left, right))) => {
                let name = &self.names[feature];
                let known = self.features.iter().find(|known| known.name == *name);
                let threshold = of_unit(threshold, known.map_or("", |known| known.unit));
                let question = format!("{name} ≤ {threshold}");
                Node::split(with_size(question), shares, self.node(left), self.node(right))
            }
            None => {
                let class = self.classes[tree.decision(node) as usize].clone();
                Node::leaf(with_size(class), shares)
            }
        }
    }
}
