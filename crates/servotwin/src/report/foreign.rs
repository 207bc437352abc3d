//! The report of any table: classifiers compared on rows held out, confusion, and the tree.

use super::page::{Grid, Page, Side};
use super::words::{number, percent, rate};
use crate::evaluation::foreign::TableModel;
use crate::evaluation::score::Score;
use crate::figure::bars::{Bar, Bars};
use crate::figure::heatmap::ConfusionMatrix;
use crate::figure::tree::{Node, Tree as Drawing};
use servotwin_diagnosis::classifiers::{Kind, Model};
use servotwin_diagnosis::tree::Tree;

/// What the report of a table is made of.
pub struct TableMaterial<'a> {
    /// The table's name.
    pub name: &'a str,
    /// How rows were held out, in words.
    pub held_out: &'a str,
    /// Every classifier's score.
    pub scores: &'a [(Kind, Score)],
    /// The tree, trained with all rows.
    pub tree: &'a TableModel,
}

/// The report as HTML.
pub fn render(material: &TableMaterial) -> String {
    let mut page = Page::default();
    page.section("classifiers", "Classifiers compared", |page| classifiers(material, page));
    page.section("confusion", "Confusion matrices", |page| confusion(material, page));
    page.section("tree", "The tree", |page| tree(material, page));
    page.finish(&format!("{}: what tells {} apart", material.name, material.tree.label)).0
}

fn classifiers(material: &TableMaterial, page: &mut Page) {
    let mut bars = Bars::new("", "accuracy (%)", &["accuracy"]);
    let mut grid = Grid::new([
        ("classifier", Side::Left),
        ("accuracy", Side::Right),
        ("balanced accuracy", Side::Right),
    ]);
    for (kind, score) in material.scores {
        let accuracy = score.accuracy;
        let bar = accuracy.share.map(|share| {
            Bar::with_interval(100.0 * share, 100.0 * accuracy.low, 100.0 * accuracy.high)
        });
        bars = bars.with(kind.title(), vec![bar]);
        let balanced = percent(score.balanced_accuracy);
        grid.push(vec![kind.title().into(), rate(Some(accuracy)), balanced]);
    }
    bars.range = Some((0.0, 100.0));
    let caption = format!("Accuracy with 95 % intervals, {}.", material.held_out);
    page.figure("classifiers", bars.draw(), &caption);
    page.table(&grid, &caption);
}

fn confusion(material: &TableMaterial, page: &mut Page) {
    page.beside(|page| {
        for (kind, score) in material.scores {
            let (classes, counts) = (score.classes.clone(), score.confusion.clone());
            page.figure(
                &format!("confusion_{}", kind.id()),
                ConfusionMatrix::new("", classes, counts).draw(),
                &format!("{}: rows are the truth, columns what was said.", kind.title()),
            );
        }
    });
}

fn tree(material: &TableMaterial, page: &mut Page) {
    let Model::Cart(tree) = &material.tree.model else {
        return;
    };
    let drawing = Drawing {
        title: String::new(),
        classes: material.tree.classes.clone(),
        root: node(material.tree, tree, 0),
    };
    page.figure(
        "tree",
        drawing.draw(),
        "The tree trained with all rows: a row goes left where the \
         answer is yes; n counts rows, purity is the share of the most frequent class.",
    );
}

fn node(model: &TableModel, tree: &Tree, at: usize) -> Node {
    let rows: u32 = tree.counts(at).iter().sum();
    let size = format!("n = {rows}, purity {} %", number(100.0 * tree.purity(at)));
    let shares = tree.weights(at).to_vec();
    match tree.split(at).zip(tree.children(at)) {
        Some(((feature, threshold), (left, right))) => {
            let question = format!("{} ≤ {}", model.features[feature], number(threshold));
            let (yes, no) = (node(model, tree, left), node(model, tree, right));
            Node::split(vec![question, size], shares, yes, no)
        }
        None => Node::leaf(vec![model.classes[tree.decision(at) as usize].clone(), size], shares),
    }
}
