//! Uses a trained classifier: judges labeled rows, predicts others, explains one.

use super::columns::encode;
use super::error::TableModelError;
use super::precision::Undecided;
use super::{Coded, FORMAT, Groups, Input, Judged, Prepared, Selection, TableModel, labels, texts};
use crate::evaluation::EvaluationError;
use crate::table::{Column, Table};
use serde::Serialize;
use servotwin_diagnosis::classifiers::{Classifier, Model};
use servotwin_diagnosis::tree::Tree;
use servotwin_learning::Samples;
use std::collections::{BTreeMap, BTreeSet};

/// Judges a trained classifier on a table; with groups, the intervals are over groups.
///
/// # Errors
/// A column is missing or unsuitable, the model does not know a class, or the model needs a missing value.
pub fn evaluate_table(
    table: Table,
    model: &TableModel,
    group: Option<&str>,
) -> Result<Judged, EvaluationError> {
    judge_table(table, model, group).map(|(_, judged)| judged)
}

/// As [`evaluate_table`], and also returns the table as the classifier reads it.
///
/// # Errors
/// As [`evaluate_table`].
pub fn judge_table(
    table: Table,
    model: &TableModel,
    group: Option<&str>,
) -> Result<(Prepared, Judged), EvaluationError> {
    debug_assert_eq!(model.format, FORMAT);
    let column = &model.label;
    let codes = match model.label_limits.is_empty() {
        true => labels::known(
            &table,
            &labels::filled(&table, column, "class")?,
            column,
            &model.classes,
        )?,
        false => labels::limited(std::slice::from_ref(&table), column, &model.label_limits)?.codes,
    };
    let groups = match group {
        Some(column) => {
            let coded = Coded::of(&labels::filled(&table, column, "group")?);
            Some(Groups { column: column.into(), coded })
        }
        None => None,
    };
    let classes = Coded { names: model.classes.clone(), codes };
    let warnings = match &groups {
        Some(Groups { column, coded }) => labels::warnings(&classes, coded, column),
        None => vec![],
    };
    let origin = table.origin().clone();
    let samples = samples(table, model, classes.codes)?;
    if let Some((feature, row)) = first_gap(&samples, model) {
        let place = origin.place_in_file(row);
        return Err(missing(model, feature, place).into());
    }
    let prepared = Prepared {
        inputs: model.inputs.clone(),
        selection: Selection { label: column.clone(), ..Selection::default() },
        groups,
        sides: None,
        origins: vec![(0, origin)],
        unused: vec![],
        warnings,
        samples,
    };
    let rows: Vec<usize> = (0..prepared.samples.rows()).collect();
    let predictions = prepared.predictions(&model.model, &rows);
    let judged = prepared.judged(&[predictions], None);
    Ok((prepared, judged))
}

impl TableModel {
    /// The columns that can influence the model's answer.
    pub fn columns_read(&self) -> BTreeSet<&str> {
        let read = self.inputs.iter().enumerate().filter(|(feature, _)| self.model.reads(*feature));
        read.map(|(_, input)| input.column()).collect()
    }
}

/// The features of a table in the model's order. Columns that the model does not read may be missing.
fn samples(
    mut table: Table,
    model: &TableModel,
    codes: Vec<u32>,
) -> Result<Samples, EvaluationError> {
    let rows = table.row_count();
    let read = model.columns_read();
    for input in model.inputs.iter().filter(|input| !read.contains(input.column())) {
        if table.column(input.column()).is_err() {
            table.push(Column::new(input.column(), "", vec![f64::NAN; rows]))?;
        }
    }
    let values = encode(std::slice::from_mut(&mut table), &model.inputs)?;
    Ok(Samples::with_missing(model.features(), model.classes.clone(), values, codes)?)
}

/// The first missing value that the model needs, as (feature, row).
fn first_gap(samples: &Samples, model: &TableModel) -> Option<(usize, usize)> {
    let gap = |feature: usize| samples.column(feature).iter().position(|value| value.is_nan());
    let needed = |feature: &usize| !model.model.knows_missing() && model.model.reads(*feature);
    (0..samples.features()).filter(needed).find_map(|feature| Some((feature, gap(feature)?)))
}

fn missing(model: &TableModel, feature: usize, place: String) -> TableModelError {
    let reason = "the model was trained with a value in every row";
    TableModelError::Missing { column: model.inputs[feature].name(), place, reason }
}

/// Finds rows that a model cannot answer: a needed value is missing, and training had no missing values. A tree needs
/// only the values on the row's path.
struct Gaps<'m> {
    model: &'m TableModel,
    needed: Vec<usize>,
    /// Number of rows without an answer, by the first feature that they lack.
    rows: BTreeMap<usize, usize>,
}

impl<'m> Gaps<'m> {
    fn new(model: &'m TableModel) -> Self {
        let needed = match model.model.knows_missing() {
            true => vec![],
            false => (0..model.inputs.len()).filter(|f| model.model.reads(*f)).collect(),
        };
        Self { model, needed, rows: BTreeMap::new() }
    }

    /// The first feature that the model needs and the row lacks.
    fn lacks(&self, values: &[f64]) -> Option<usize> {
        let first = self.needed.iter().copied().find(|&feature| values[feature].is_nan())?;
        match &self.model.model {
            Model::Cart(tree) => {
                let asked = tree.decision_path(values).filter_map(|node| tree.split(node));
                asked.map(|(feature, _)| feature).find(|&feature| values[feature].is_nan())
            }
            _ => Some(first),
        }
    }

    fn said(&self) -> Vec<String> {
        let said = |(&feature, &rows): (&usize, &usize)| {
            let (rows, get) = if rows == 1 {
                ("1 row has".to_owned(), "gets")
            } else {
                (format!("{rows} rows have"), "get")
            };
            let column = self.model.inputs[feature].name();
            format!(
                "{rows} no value in '{column}' and {get} no answer: the model was trained with a value in every row"
            )
        };
        self.rows.iter().map(said).collect()
    }
}

/// A model's predictions for a table.
#[derive(Debug, Clone)]
pub struct Predicted {
    /// One row for each input row.
    pub table: Table,
    /// Warnings about weakly supported predictions.
    pub doubts: Vec<String>,
}

/// Counts rows for which the model has little information.
struct Doubts<'m> {
    /// The features that hold numbers or have only two texts.
    numbers: Vec<usize>,
    /// Features of each column with three or more texts. A column with two texts has only one feature, which cannot
    /// reveal an unknown text.
    texts: BTreeMap<&'m str, Vec<usize>>,
    /// Number of rows without any known value.
    blank: usize,
    /// Number of other rows with an unknown text, by column.
    unseen: BTreeMap<&'m str, usize>,
}

impl<'m> Doubts<'m> {
    fn new(model: &'m TableModel) -> Self {
        let (mut numbers, mut texts) = (vec![], BTreeMap::<&str, Vec<usize>>::new());
        let read = model.columns_read();
        let inputs = model.inputs.iter().enumerate();
        for (feature, input) in inputs.filter(|(_, input)| read.contains(input.column())) {
            match input {
                Input::Category { column, .. } => texts.entry(column).or_default().push(feature),
                Input::Number { .. } | Input::Time { .. } => numbers.push(feature),
            }
        }
        // A column with two texts always counts as a value.
        numbers.extend(texts.values().filter(|features| features.len() == 1).flatten());
        texts.retain(|_, features| features.len() > 1);
        Self { numbers, texts, blank: 0, unseen: BTreeMap::new() }
    }

    /// Checks the features of a row.
    fn look(&mut self, values: &[f64]) {
        let has_number = self.numbers.iter().any(|&feature| !values[feature].is_nan());
        let is_unseen = |features: &Vec<usize>| features.iter().all(|&f| values[f] != 1.0);
        let unseen = self.texts.iter().filter(|(_, features)| is_unseen(features));
        let unseen: Vec<&str> = unseen.map(|(&column, _)| column).collect();
        if !has_number && unseen.len() == self.texts.len() {
            self.blank += 1;
            return;
        }
        for column in unseen {
            *self.unseen.entry(column).or_default() += 1;
        }
    }

    fn said(self) -> Vec<String> {
        let rows = |count: usize| match count {
            1 => "1 row has".to_string(),
            count => format!("{count} rows have"),
        };
        let blank = format!("{} nothing in any column that was learned from", rows(self.blank));
        let unseen = self.unseen.iter().map(|(column, &count)| {
            format!("{} in '{column}' none of the texts that were learned", rows(count))
        });
        (self.blank > 0).then_some(blank).into_iter().chain(unseen).collect()
    }
}

/// Predicts every row of a table, which needs no class column. The result has the columns `row` (from 1), those to
/// `keep`, `predicted`, and one for each class: `p:CLASS` with its probability, or `score:CLASS` if the classifier
/// gives none. For a tree it also has `leaf` and `path`.
///
/// `predicted` is empty if the probability of the decided class is below `abstain_below`, or if a needed value is
/// missing. In the latter case the probabilities are NaN, and a tree's path ends at the question without a value.
///
/// # Errors
/// As [`evaluate_table`]; [`TableModelError::NoProbabilities`].
pub fn predict(
    table: Table,
    model: &TableModel,
    keep: &[String],
    abstain_below: Option<f64>,
) -> Result<Predicted, EvaluationError> {
    let shares = model.gives_probabilities();
    if abstain_below.is_some() && !shares {
        let classifier = model.model.kind().title();
        return Err(TableModelError::NoProbabilities { classifier }.into());
    }
    let rows = table.row_count();
    let kept =
        keep.iter().map(|name| table.column(name).cloned()).collect::<Result<Vec<_>, _>>()?;
    let samples = samples(table, model, vec![0; rows])?;
    let mut values = vec![0.0; samples.features()];
    let mut scratch = vec![0.0; model.classes.len()];
    let mut scores: Vec<Vec<f64>> = vec![Vec::with_capacity(rows); model.classes.len()];
    let mut said: Vec<String> = Vec::with_capacity(rows);
    let (mut leaves, mut paths): (Vec<u32>, Vec<String>) = (vec![], vec![]);
    let (mut doubts, mut gaps) = (Doubts::new(model), Gaps::new(model));
    let mut undecided = Undecided::new(&samples);
    for row in 0..rows {
        samples.row_into(row, &mut values);
        doubts.look(&values);
        let lacking = gaps.lacks(&values);
        let answer = match lacking {
            Some(feature) => {
                *gaps.rows.entry(feature).or_default() += 1;
                scratch.fill(f64::NAN);
                None
            }
            None => {
                let class = model.model.predict_row(&values) as usize;
                model.scores_into(&values, &mut scratch);
                let unsure = abstain_below.is_some_and(|limit| scratch[class] < limit);
                Some(class).filter(|_| !unsure)
            }
        };
        scores.iter_mut().zip(&scratch).for_each(|(column, score)| column.push(*score));
        said.push(answer.map_or_else(String::new, |class| model.classes[class].clone()));
        if let Model::Cart(tree) = &model.model {
            undecided.look(tree, &values);
            let (leaf, path) = way(model, tree, &values, lacking);
            leaves.push(leaf);
            paths.push(path);
        }
    }
    let mut result = Table::new();
    result.push(Column::new("row", "", (1..=rows as u32).collect::<Vec<u32>>()))?;
    kept.into_iter().try_for_each(|column| result.push(column))?;
    result.push(Column::new("predicted", "", said))?;
    let prefix = if shares { "p" } else { "score" };
    for (class, scores) in model.classes.iter().zip(scores) {
        result.push(Column::new(format!("{prefix}:{class}"), "", scores))?;
    }
    if matches!(model.model, Model::Cart(_)) {
        result.push(Column::new("leaf", "", leaves))?;
        result.push(Column::new("path", "", paths))?;
    }
    let doubts =
        gaps.said().into_iter().chain(undecided.said(model)).chain(doubts.said()).collect();
    Ok(Predicted { table: result, doubts })
}

/// The last node on a row's path through a tree, and the path as text. If a needed value is missing, the path ends at
/// the node that compares it.
fn way(model: &TableModel, tree: &Tree, values: &[f64], lacking: Option<usize>) -> (u32, String) {
    let is_asked = |node: usize| tree.split(node).is_some_and(|(asked, _)| Some(asked) == lacking);
    let mut path = tree.decision_path(values);
    let last = path.find(|&node| tree.split(node).is_none() || is_asked(node));
    let mut steps = steps(model, tree, values);
    if let Some(feature) = lacking {
        let column = model.inputs[feature].column();
        let end = steps.iter().position(|step| step.column == column && step.value.is_none());
        steps.truncate(end.map_or(steps.len(), |end| end + 1));
    }
    let said: Vec<String> = steps.iter().map(Step::said).collect();
    (last.unwrap_or(0) as u32, said.join(" and "))
}

/// One question of a tree with its answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Name of the compared column.
    pub column: String,
    /// The text compared with; `None` for a number.
    pub is: Option<String>,
    /// The row's value; `None` if missing.
    pub value: Option<f64>,
    /// Threshold in the unit of the column.
    pub threshold: f64,
    /// Whether the row goes right: its value is above the threshold, or it is missing and missing values go right.
    pub right: bool,
}

impl Step {
    /// Whether the question only checks that a value exists.
    pub fn asks_for_any(&self) -> bool {
        is_any_value(self.threshold)
    }

    /// The answer as a statement: `pressure_pa > 2.1e7`.
    pub fn said(&self) -> String {
        let Step { column, is, value, threshold, right } = self;
        let threshold = without_rounding(*threshold);
        match (is, value) {
            (Some(text), _) if *right => format!("{column} is '{text}'"),
            (Some(text), _) => format!("{column} is not '{text}'"),
            (None, None) => format!("{column} is missing"),
            (None, Some(_)) if self.asks_for_any() => format!("{column} is given"),
            (None, Some(_)) if *right => format!("{column} > {threshold}"),
            (None, Some(_)) => format!("{column} <= {threshold}"),
        }
    }
}

/// Whether a threshold only checks that a value exists.
fn is_any_value(threshold: f64) -> bool {
    threshold >= servotwin_diagnosis::numeric::MAX_VALUE
}

/// The question of an inner node; rows that go left answer yes.
pub fn question(input: &Input, threshold: f64, missing_left: bool, shown: &str) -> String {
    let missing = if missing_left { " or missing" } else { "" };
    match input {
        Input::Category { column, value } => format!("{column} is not '{value}'"),
        _ if is_any_value(threshold) => format!("{} is given", input.name()),
        _ => format!("{} ≤ {shown}{missing}", input.name()),
    }
}

/// The questions and answers on a row's path through a tree.
fn steps(model: &TableModel, tree: &Tree, values: &[f64]) -> Vec<Step> {
    let path: Vec<usize> = tree.decision_path(values).collect();
    let step = |pair: &[usize]| {
        let (feature, threshold) = tree.split(pair[0])?;
        let (_, right) = tree.children(pair[0])?;
        let is = match &model.inputs[feature] {
            Input::Category { value, .. } => Some(value.clone()),
            _ => None,
        };
        Some(Step {
            column: model.inputs[feature].column().into(),
            is,
            value: Some(values[feature]).filter(|value| !value.is_nan()),
            threshold,
            right: pair[1] == right,
        })
    };
    path.windows(2).filter_map(step).collect()
}

/// The explanation of one prediction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanation {
    /// The row, from 1.
    pub row: usize,
    /// The place in the file.
    pub place: String,
    /// The class in the table, if given.
    pub truth: Option<String>,
    /// The predicted class.
    pub said: String,
    /// Every class with its probability, or with its score if the classifier gives none; the highest first.
    pub scores: Vec<(String, f64)>,
    /// Whether the scores are probabilities.
    pub probabilities: bool,
    /// For a tree, the questions on the path.
    pub steps: Vec<Step>,
    /// For a tree, the training rows of each class in the leaf.
    pub leaf: Vec<(String, u32)>,
}

/// Rounds a threshold to 12 significant digits, which removes the rounding error of the midpoint.
fn without_rounding(threshold: f64) -> f64 {
    format!("{threshold:.11e}").parse().unwrap_or(threshold)
}

/// Explains one row, counted from 1.
///
/// # Errors
/// As [`evaluate_table`]; [`TableModelError::NoRow`].
pub fn explain(
    table: Table,
    model: &TableModel,
    row: usize,
) -> Result<Explanation, EvaluationError> {
    let rows = table.row_count();
    if row == 0 || row > rows {
        return Err(TableModelError::NoRow { row, rows }.into());
    }
    let place = table.origin().place(row - 1);
    let truth = table.column(&model.label).ok().map(|column| texts(column)[row - 1].clone());
    let samples = samples(table, model, vec![0; rows])?;
    let mut values = vec![0.0; samples.features()];
    samples.row_into(row - 1, &mut values);
    if let Some(feature) = Gaps::new(model).lacks(&values) {
        return Err(missing(model, feature, place).into());
    }
    let mut scores = vec![0.0; model.classes.len()];
    let said = model.classes[model.model.predict_row(&values) as usize].clone();
    model.scores_into(&values, &mut scores);
    let mut scores: Vec<(String, f64)> = model.classes.iter().cloned().zip(scores).collect();
    scores.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (steps, leaf) = match &model.model {
        Model::Cart(tree) => {
            let counts = tree.counts(tree.branches().leaf_of(&values)).iter().copied();
            let counts = model.classes.iter().cloned().zip(counts).filter(|(_, n)| *n > 0);
            (steps(model, tree, &values), counts.collect())
        }
        _ => (vec![], vec![]),
    };
    let probabilities = model.gives_probabilities();
    let truth = truth.filter(|truth| !truth.is_empty());
    Ok(Explanation { row, place, truth, said, scores, probabilities, steps, leaf })
}
