//! Applies a trained classifier: testing on labeled rows, prediction, and explanation of a row.

use super::columns::encode;
use super::error::TableModelError;
use super::precision::Undecided;
use super::{
    Coded, FORMAT, FeatureSource, Groups, JudgedClassifier, PreparedTable, Selection, TableModel,
    labels, texts,
};
use crate::evaluation::EvaluationError;
use crate::table::{Column, Table};
use serde::Serialize;
use servotwin_diagnosis::classifiers::{Classifier, Model};
use servotwin_diagnosis::tree::Tree;
use servotwin_learning::Samples;
use std::collections::{BTreeMap, BTreeSet};

/// Tests a trained classifier on a table; intervals are over groups if there are any.
///
/// # Errors
/// A column is missing or invalid, the model does not know a class, or a value is missing that the model needs.
pub fn evaluate_table(
    table: Table,
    model: &TableModel,
    group: Option<&str>,
) -> Result<JudgedClassifier, EvaluationError> {
    judge_table(table, model, group).map(|(_, judged)| judged)
}

/// The same, and returns the prepared table.
///
/// # Errors
/// See [`evaluate_table`].
pub fn judge_table(
    table: Table,
    model: &TableModel,
    group: Option<&str>,
) -> Result<(PreparedTable, JudgedClassifier), EvaluationError> {
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
    let prepared = PreparedTable {
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
    /// The columns that the model's answers can depend on.
    pub fn columns_read(&self) -> BTreeSet<&str> {
        let read = self.inputs.iter().enumerate().filter(|(feature, _)| self.model.reads(*feature));
        read.map(|(_, input)| input.column()).collect()
    }
}

/// The features of a table as a model reads them; columns that it does not read may be absent.
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

/// The first missing value that a model needs, as (feature, row).
fn first_gap(samples: &Samples, model: &TableModel) -> Option<(usize, usize)> {
    let gap = |feature: usize| samples.column(feature).iter().position(|value| value.is_nan());
    let needed = |feature: &usize| !model.model.knows_missing() && model.model.reads(*feature);
    (0..samples.features()).filter(needed).find_map(|feature| Some((feature, gap(feature)?)))
}

fn missing(model: &TableModel, feature: usize, place: String) -> TableModelError {
    let reason = "the model was trained with a value in every row";
    TableModelError::Missing { column: model.inputs[feature].name(), place, reason }
}

/// Rows that a model cannot answer: a needed value is missing, and training had no rows without it. A tree needs only
/// the features on the row's path.
struct Gaps<'m> {
    model: &'m TableModel,
    needed: Vec<usize>,
    /// Number of rows without an answer, by the first missing feature.
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

    /// The first needed feature that a row lacks.
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

/// The predictions for a table.
#[derive(Debug, Clone)]
pub struct Predicted {
    /// One row for each row of the input.
    pub table: Table,
    /// Warnings about predictions with little evidence.
    pub doubts: Vec<String>,
}

/// Rows that give a model little evidence.
struct Doubts<'m> {
    /// The indices of numeric features.
    numbers: Vec<usize>,
    /// The features of each column with three or more texts. With two texts there is only one feature, so other texts
    /// cannot be detected.
    texts: BTreeMap<&'m str, Vec<usize>>,
    /// Number of rows without any known value.
    blank: usize,
    /// Number of other rows whose text was not in training, by column.
    unseen: BTreeMap<&'m str, usize>,
}

impl<'m> Doubts<'m> {
    fn new(model: &'m TableModel) -> Self {
        let (mut numbers, mut texts) = (vec![], BTreeMap::<&str, Vec<usize>>::new());
        let read = model.columns_read();
        let inputs = model.inputs.iter().enumerate();
        for (feature, input) in inputs.filter(|(_, input)| read.contains(input.column())) {
            match input {
                FeatureSource::Category { column, .. } => {
                    texts.entry(column).or_default().push(feature)
                }
                FeatureSource::Number { .. } | FeatureSource::Time { .. } => numbers.push(feature),
            }
        }
        // A column with two texts always has one of them, whatever the row contains.
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

/// Predicts every row of a table, which needs no class column. The result has a column `row` (from 1), the columns to
/// `keep`, and `predicted`. Each class has a column with its probability (`p:CLASS`, or `score:CLASS` if the classifier
/// has none). Trees add `leaf` and `path`.
///
/// `predicted` is empty if the probability of the decided class is below `abstain_below`, or if a value is missing that
/// the model needs. In the latter case the probabilities are NaN, and a tree's path ends at the question.
///
/// # Errors
/// See [`evaluate_table`]; [`TableModelError::NoProbabilities`].
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

/// The last node of a row's path through a tree, and the path in words. If a needed value is missing, the path ends at
/// the node that asks for it.
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
    let said: Vec<String> = steps.iter().map(AnsweredQuestion::said).collect();
    (last.unwrap_or(0) as u32, said.join(" and "))
}

/// A question of a tree with the row's answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnsweredQuestion {
    /// The column in the question.
    pub column: String,
    /// The text that the column is compared with; `None` for a number.
    pub is: Option<String>,
    /// The value of the row; `None` if missing.
    pub value: Option<f64>,
    /// The threshold of the question.
    pub threshold: f64,
    /// Whether the row went right: the value is above the threshold, or it is missing and missing values go right.
    pub right: bool,
}

impl AnsweredQuestion {
    /// Whether the question only tests whether a value is present.
    pub fn asks_for_any(&self) -> bool {
        is_any_value(self.threshold)
    }

    /// The answer as a statement: `pressure_pa > 2.1e7`.
    pub fn said(&self) -> String {
        let AnsweredQuestion { column, is, value, threshold, right } = self;
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

/// Whether a threshold only tests whether a value is present.
fn is_any_value(threshold: f64) -> bool {
    threshold >= servotwin_diagnosis::numeric::MAX_VALUE
}

/// The question of an inner node; rows that go left answer yes.
pub fn question(input: &FeatureSource, threshold: f64, missing_left: bool, shown: &str) -> String {
    let missing = if missing_left { " or missing" } else { "" };
    match input {
        FeatureSource::Category { column, value } => format!("{column} is not '{value}'"),
        _ if is_any_value(threshold) => format!("{} is given", input.name()),
        _ => format!("{} ≤ {shown}{missing}", input.name()),
    }
}

/// The path of a row through a tree.
fn steps(model: &TableModel, tree: &Tree, values: &[f64]) -> Vec<AnsweredQuestion> {
    let path: Vec<usize> = tree.decision_path(values).collect();
    let step = |pair: &[usize]| {
        let (feature, threshold) = tree.split(pair[0])?;
        let (_, right) = tree.children(pair[0])?;
        let is = match &model.inputs[feature] {
            FeatureSource::Category { value, .. } => Some(value.clone()),
            _ => None,
        };
        Some(AnsweredQuestion {
            column: model.inputs[feature].column().into(),
            is,
            value: Some(values[feature]).filter(|value| !value.is_nan()),
            threshold,
            right: pair[1] == right,
        })
    };
    path.windows(2).filter_map(step).collect()
}

/// An explanation of a prediction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanation {
    /// The row, from 1.
    pub row: usize,
    /// The place in the file.
    pub place: String,
    /// The class in the table, if it has the column.
    pub truth: Option<String>,
    /// The predicted class.
    pub said: String,
    /// Every class with its probability, or its score if the classifier has no probabilities; the best first.
    pub scores: Vec<(String, f64)>,
    /// Whether the scores are probabilities.
    pub probabilities: bool,
    /// For a tree, the questions on the path.
    pub steps: Vec<AnsweredQuestion>,
    /// For a tree, the number of training rows of each class in the leaf.
    pub leaf: Vec<(String, u32)>,
}

/// Removes rounding errors from the last digits of a threshold, which lies between two values of a table.
fn without_rounding(threshold: f64) -> f64 {
    format!("{threshold:.11e}").parse().unwrap_or(threshold)
}

/// Explains one row, counted from 1.
///
/// # Errors
/// See [`evaluate_table`]; [`TableModelError::NoRow`].
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
