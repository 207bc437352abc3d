//! The report of any table: the training data, classifiers compared on held-out rows, results for
//! each class and group, and the tree in readable parts.

use super::looks;
use super::page::{Alignment, HtmlTable, Page};
use super::words::{NONE, number, percent, rate};
use servotwin::evaluation::table_model::{JudgedClassifier, PreparedTable, TableModel, question};
use servotwin_diagnosis::classifiers::{ClassifierKind, Model};
use servotwin_diagnosis::tree::Tree;
use servotwin_plot::bars::{Bar, Bars};
use servotwin_plot::heatmap::ConfusionMatrix;
use servotwin_plot::tree::{Branch, Node, TreeFigure as Drawing};

/// The maximum number of leaves and continuations in one drawing; more cannot be read side by side.
const LEAVES_IN_A_DRAWING: usize = 8;

/// The maximum number of features listed.
const FEATURES_LISTED: usize = 200;

/// The maximum number of groups listed, the worst first.
const GROUPS_LISTED: usize = 100;

/// Confusion matrices with more classes than this cannot be read side by side.
const CLASSES_IN_A_MATRIX: usize = 30;

/// Everything that the report of a table is made from.
pub struct TableMaterial<'a> {
    /// The table's name.
    pub name: &'a str,
    /// The table, prepared for training.
    pub prepared: &'a PreparedTable,
    /// A description of how rows were held out, with the seed.
    pub held_out: &'a str,
    /// A description of the class weights.
    pub class_weights: &'a str,
    /// The results of each classifier on held-out rows.
    pub results: &'a [(ClassifierKind, JudgedClassifier)],
    /// The classifiers that could not be trained on the table, with the reasons.
    pub refused: &'a [(ClassifierKind, String)],
    /// The tree trained with all training rows, or the model that was trained elsewhere.
    pub tree: &'a TableModel,
    /// The file of a model that was trained elsewhere and classified every row.
    pub model: Option<&'a str>,
}

impl TableMaterial<'_> {
    /// Selects a text: `learned` for classifiers trained on this table, `elsewhere` for a model trained elsewhere.
    fn either<'w>(&self, learned: &'w str, elsewhere: &'w str) -> &'w str {
        if self.model.is_some() { elsewhere } else { learned }
    }
}

/// Returns the report as HTML.
pub fn render(material: &TableMaterial) -> String {
    let mut page = Page::default();
    page.section("data", "The table", |page| data(material, page));
    let compared = if material.model.is_some() { "The model" } else { "Classifiers compared" };
    page.section("classifiers", compared, |page| classifiers(material, page));
    page.section("classes", "Every class", |page| classes(material, page));
    page.section("groups", "Every group", |page| groups(material, page));
    page.section("confusion", "Confusion matrices", |page| confusion(material, page));
    page.section("importances", "What the tree asks for", |page| importances(material, page));
    page.section("tree", "The tree", |page| tree(material, page));
    page.finish(&format!("{}: what separates {}", material.name, material.tree.label)).0
}

fn data(material: &TableMaterial, page: &mut Page) {
    let samples = material.prepared.samples();
    let mut grid = HtmlTable::new([("", Alignment::Left), ("", Alignment::Left)]);
    let mut line = |name: &str, value: String| grid.push(vec![name.into(), value]);
    line("rows", samples.rows().to_string());
    line("classes", format!("{} of column {}", samples.classes(), material.tree.label));
    line("features", samples.features().to_string());
    let missing =
        if samples.has_missing() { "yes, a branch of their own in trees" } else { "none" };
    line("missing values", missing.into());
    if let Some(groups) = material.prepared.groups() {
        line("groups", format!("{} of column {}", groups.coded.names.len(), groups.column));
    }
    match material.model {
        Some(model) => line("judged by", model.into()),
        None => {
            line("held out", material.held_out.into());
            line("weights of classes", material.class_weights.into());
        }
    }
    if let Model::Cart(tree) = &material.tree.model {
        let leaves = tree.leaves().len();
        line("tree", format!("{} questions deep, {leaves} leaves", tree.depth()));
    }
    page.table(
        &grid,
        material.either("What was learnt from, and how.", "What was judged, and by what."),
    );
    let warnings = material.results.first().map_or(&material.prepared.warnings, |r| &r.1.warnings);
    for warning in warnings {
        page.text(&format!("Warning: {warning}."));
    }
    let names = samples.feature_names();
    let more = match names.len().saturating_sub(FEATURES_LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let listed = &names[..names.len().min(FEATURES_LISTED)];
    page.note(&format!("Features: {}{more}.", listed.join(", ")));
    let mut grid =
        HtmlTable::new([("column", Alignment::Left), ("not used because it", Alignment::Left)]);
    for unused in &material.prepared.unused {
        grid.push(vec![unused.column.clone(), unused.reason.clone()]);
    }
    if !grid.is_empty() {
        page.table(&grid, "Columns that are not used.");
    }
}

fn classifiers(material: &TableMaterial, page: &mut Page) {
    let mut bars = Bars::new("", "accuracy (%)", &["accuracy"]);
    bars.looks = looks::plain();
    let mut grid = HtmlTable::new([
        ("classifier", Alignment::Left),
        ("accuracy", Alignment::Right),
        ("balanced accuracy", Alignment::Right),
    ]);
    for (kind, judged) in material.results {
        let accuracy = judged.score.accuracy;
        let bar = accuracy.share.map(|share| {
            Bar::with_interval(100.0 * share, 100.0 * accuracy.low, 100.0 * accuracy.high)
        });
        bars = bars.with(kind.title(), vec![bar]);
        let balanced = percent(judged.score.balanced_accuracy);
        grid.push(vec![kind.title().into(), rate(Some(accuracy)), balanced]);
    }
    let baseline = material.results.first().and_then(|(_, judged)| judged.baseline.as_ref());
    if let Some(baseline) = baseline {
        let name = format!("always '{}'", baseline.class);
        let bar = baseline
            .accuracy
            .map(|share| Bar::with_interval(100.0 * share, 100.0 * share, 100.0 * share));
        bars = bars.with(&name, vec![bar]);
        grid.push(vec![name, percent(baseline.accuracy), NONE.into()]);
    }
    bars.range = Some((0.0, 100.0));
    bars.digits = 2;
    let over = match material.results.first().is_some_and(|(_, j)| j.intervals_over_groups) {
        true => "intervals over groups (bootstrap)",
        false => "intervals as if rows were independent (Wilson)",
    };
    let caption = match material.model {
        Some(model) => format!("Accuracy with 95 % {over}; every row, judged by {model}."),
        None => format!("Accuracy with 95 % {over}; held out: {}.", material.held_out),
    };
    page.figure("classifiers", bars.draw(), &caption);
    page.table(&grid, &caption);
    for note in refusals(material.refused) {
        page.note(&note);
    }
}

/// Why classifiers could not be trained on the table. Classifiers with the same reason share a sentence.
fn refusals(refused: &[(ClassifierKind, String)]) -> Vec<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = vec![];
    for (kind, reason) in refused {
        match reasons.iter_mut().find(|known| known.0 == reason) {
            Some((_, kinds)) => kinds.push(kind.title()),
            None => reasons.push((reason, vec![kind.title()])),
        }
    }
    reasons.iter().map(|(reason, kinds)| format!("{}: {reason}.", kinds.join(", "))).collect()
}

/// The result for which classes and groups are shown: the most accurate, and the first among equals.
fn best<'a>(material: &TableMaterial<'a>) -> Option<&'a (ClassifierKind, JudgedClassifier)> {
    let share = |judged: &JudgedClassifier| judged.score.accuracy.share.unwrap_or(0.0);
    let results = material.results.iter().rev();
    results.max_by(|a, b| share(&a.1).total_cmp(&share(&b.1)))
}

fn classes(material: &TableMaterial, page: &mut Page) {
    let Some((kind, judged)) = best(material) else {
        return;
    };
    let mut grid = HtmlTable::new([
        ("class", Alignment::Left),
        ("rows", Alignment::Right),
        ("found", Alignment::Right),
        ("of those said right", Alignment::Right),
    ]);
    for class in &judged.classes {
        grid.push(vec![
            class.class.clone(),
            class.recall.of.to_string(),
            rate(Some(class.recall)),
            percent(class.precision),
        ]);
    }
    let on = material.either("on rows held out", "on all rows of the table");
    page.table(&grid, &format!("{}: each class {on}.", kind.title()));
}

fn groups(material: &TableMaterial, page: &mut Page) {
    let Some((kind, judged)) = best(material).filter(|(_, judged)| !judged.groups.is_empty())
    else {
        return;
    };
    let mut worst: Vec<_> = judged.groups.iter().collect();
    let share = |right: u64, rows: u64| right as f64 / rows as f64;
    worst.sort_by(|a, b| share(a.right, a.rows).total_cmp(&share(b.right, b.rows)));
    let mut grid = HtmlTable::new([
        ("group", Alignment::Left),
        ("rows", Alignment::Right),
        ("right", Alignment::Right),
        ("classes", Alignment::Left),
    ]);
    for group in worst.iter().take(GROUPS_LISTED) {
        let right = percent(Some(share(group.right, group.rows)));
        let classes = group.classes.join(", ");
        grid.push(vec![group.group.clone(), group.rows.to_string(), right, classes]);
    }
    let caption = format!(
        "{}: {} of {} groups{}, the worst first.",
        kind.title(),
        worst.len().min(GROUPS_LISTED),
        worst.len(),
        material.either(", each while it was held out", "")
    );
    page.table(&grid, &caption);
}

fn confusion(material: &TableMaterial, page: &mut Page) {
    let many = material.prepared.samples().classes() > CLASSES_IN_A_MATRIX;
    let best = best(material).map(|(kind, _)| *kind);
    let shown = material.results.iter().filter(|(kind, _)| !many || Some(*kind) == best);
    page.beside(|page| {
        for (kind, judged) in shown {
            let score = &judged.score;
            let (classes, counts) = (score.classes.clone(), score.confusion.clone());
            page.figure(
                &format!("confusion_{}", kind.id()),
                ConfusionMatrix::new("", classes, counts).draw(),
                &format!("{}: rows are the truth, columns what was said.", kind.title()),
            );
        }
    });
}

fn importances(material: &TableMaterial, page: &mut Page) {
    let Model::Cart(tree) = &material.tree.model else {
        return;
    };
    let names = material.tree.features();
    let mut shares: Vec<(&String, f64)> = names.iter().zip(tree.importances()).collect();
    shares.retain(|(_, share)| *share > 0.0);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut grid = HtmlTable::new([("feature", Alignment::Left), ("importance", Alignment::Right)]);
    for (name, share) in shares.iter().take(FEATURES_LISTED) {
        grid.push(vec![(*name).clone(), percent(Some(*share))]);
    }
    if !grid.is_empty() {
        page.table(&grid, "Share of the decrease of impurity that each feature buys in the tree.");
    }
}

fn tree(material: &TableMaterial, page: &mut Page) {
    let Model::Cart(tree) = &material.tree.model else {
        return;
    };
    let parts = parts(tree);
    page.text(&format!(
        "{}: a row goes left where the answer is yes; n counts rows, purity is the share of the class \
         decided.",
        material.either(
            "The tree trained with all rows that train",
            "The tree of the model, with the rows that it was trained with"
        )
    ));
    for (place, root) in parts.iter().enumerate() {
        let drawing = Drawing {
            title: String::new(),
            classes: material.tree.classes.clone(),
            looks: vec![],
            root: node(material.tree, tree, *root, &parts, place),
            sideways: false,
        };
        let (name, caption) = match place {
            0 if parts.len() == 1 => ("tree".to_owned(), "The whole tree.".to_owned()),
            0 => (
                "tree_1".to_owned(),
                format!(
                    "Part 1 of {}: the top; the others continue at the marked nodes.",
                    parts.len()
                ),
            ),
            _ => (format!("tree_{}", place + 1), format!("Part {}.", place + 1)),
        };
        page.figure(&name, drawing.draw(), &caption);
    }
}

/// The roots of the parts in which a tree is drawn, each after the part that refers to it. A part
/// is filled level by level until no more leaves fit side by side.
fn parts(tree: &Tree) -> Vec<usize> {
    let mut parts = vec![0];
    let mut part = 0;
    while part < parts.len() {
        parts.extend(ends(tree, parts[part]).into_iter().filter(|&end| tree.split(end).is_some()));
        part += 1;
    }
    parts
}

/// The nodes at which a part ends, from left to right: leaves and continuations.
fn ends(tree: &Tree, root: usize) -> Vec<usize> {
    let mut ends = vec![root];
    loop {
        // Split the highest inner node, and the leftmost among equals.
        let inner = ends.iter().enumerate().filter(|(_, node)| tree.split(**node).is_some());
        let next = inner.min_by_key(|(_, node)| tree.node_depth(**node)).map(|(place, _)| place);
        let full = ends.len() >= LEAVES_IN_A_DRAWING;
        let Some((place, (left, right))) =
            next.and_then(|place| Some((place, tree.children(ends[place])?))).filter(|_| !full)
        else {
            return ends;
        };
        ends.splice(place..=place, [left, right]);
    }
}

fn node(model: &TableModel, tree: &Tree, at: usize, parts: &[usize], own: usize) -> Node {
    let rows: u32 = tree.counts(at).iter().sum();
    // Row counts without class weights; the weights affect only the decision.
    let shares: Vec<f64> = tree.counts(at).iter().map(|count| f64::from(*count)).collect();
    let purity = shares[tree.decision(at) as usize] / f64::from(rows);
    let size = format!("n = {rows}, purity {} %", number(100.0 * purity));
    let Some(((feature, threshold), (left, right))) = tree.split(at).zip(tree.children(at)) else {
        return Node::leaf(vec![model.classes[tree.decision(at) as usize].clone(), size], shares);
    };
    if let Some(part) = parts.iter().position(|&root| root == at).filter(|&part| part != own) {
        return Node::leaf(vec![format!("→ part {}", part + 1), size], shares);
    }
    let input = &model.inputs[feature];
    let missing_left = tree.branches().missing_left(at);
    let question = question(input, threshold, missing_left, &number(threshold));
    let branch = |label: &str, child| Branch {
        label: label.into(),
        node: node(model, tree, child, parts, own),
    };
    Node {
        lines: vec![question, size],
        shares,
        children: vec![branch("yes", left), branch("no", right)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classifiers_of_one_reason_share_its_sentence() {
        let [a, b, c] = [0, 1, 2].map(|place| servotwin_diagnosis::classifiers::ALL[place]);
        let refused = [
            (a, "no missing values".to_owned()),
            (b, "too slow".into()),
            (c, "no missing values".into()),
        ];
        let [a, b, c] = [a, b, c].map(ClassifierKind::title);
        assert_eq!(
            refusals(&refused),
            [format!("{a}, {c}: no missing values."), format!("{b}: too slow.")]
        );
    }
}
