//! Training of the hierarchy of trees ([`servotwin_diagnosis::hierarchy`]).
//!
//! Views have two uses:
//! - *mirror*: A also learns from every view, with the actuator in the label rotated alike;
//! - *pool*: one B (and C, D, E) learns from all actuators, each through its own view. There its sensors take the
//!   places of actuator 0's sensors, and the nine trees become five.
//!
//! Without pooling, a stage of actuator `k` reads its columns in view 0. If the examples contain healthy rows, A learns
//! to answer that there is no fault.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::classifiers::{self, Fit};
use crate::samples::Samples;
use crate::tree::Criterion;
use servotwin_diagnosis::error::{Error, same_length};
use servotwin_diagnosis::hierarchy::{Hierarchy, Names, Question, Stage, StagePlace};

/// The true class of a row, as indices into [`Names`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Label {
    /// The actuator; the number of actuators for healthy rows ([`Names::healthy`]).
    pub actuator: u32,
    /// The action; arbitrary for healthy rows.
    pub action: u32,
    /// The detail; arbitrary for healthy rows.
    pub detail: u32,
}

/// Rows for training or testing: their features in every view, and their labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Examples {
    names: Names,
    /// For each actuator, the columns that its stages may read.
    read: Vec<Vec<usize>>,
    /// The columns that no stage may read.
    hidden: Vec<usize>,
    /// Column-major features of all rows, one table per view.
    views: Arc<Vec<Vec<f64>>>,
    labels: Vec<Label>,
    /// For each action, the details that occur with it, ascending.
    details: Vec<Vec<u32>>,
}

impl Examples {
    /// Creates rows with column-major features in each view. `read` lists for each actuator the columns that its stages
    /// may read: its own sensors', or also other sensors' and comparisons. With one view, there is no mirroring or
    /// pooling.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::IndexOutOfRange`] for a column, [`Error::LabelOutOfRange`].
    pub fn new(
        names: Names,
        read: Vec<Vec<usize>>,
        views: Vec<Vec<f64>>,
        labels: Vec<Label>,
    ) -> Result<Self, Error> {
        same_length("columns to read", names.actuators.len(), read.len())?;
        if views.len() != 1 {
            same_length("views", names.actuators.len(), views.len())?;
        }
        let length = names.features.len();
        for view in &views {
            same_length("values", length * labels.len(), view.len())?;
        }
        check_columns(read.iter().flatten(), length)?;
        check_labels(&names, &labels)?;
        let details = details_of_actions(&names, &labels);
        Ok(Examples { names, read, hidden: vec![], views: Arc::new(views), labels, details })
    }

    /// The names that labels refer to.
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// The label of every row.
    pub fn labels(&self) -> &[Label] {
        &self.labels
    }

    /// Number of views: 1, or one per actuator.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// Copies the features of a row in a view.
    ///
    /// # Panics
    /// If there is no such view or row.
    pub fn row_into(&self, view: usize, row: usize, out: &mut [f64]) {
        let columns = self.views[view].chunks_exact(self.labels.len());
        for (slot, column) in out.iter_mut().zip(columns) {
            *slot = column[row];
        }
    }

    /// The same rows with only these feature columns, in this order.
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`].
    pub fn select_columns(&self, columns: &[usize]) -> Result<Self, Error> {
        check_columns(columns.iter(), self.names.features.len())?;
        let rows = self.labels.len();
        let of_view = |view: &Vec<f64>| {
            let mut values = Vec::with_capacity(columns.len() * rows);
            for &column in columns {
                values.extend_from_slice(&view[column * rows..(column + 1) * rows]);
            }
            values
        };
        let kept = |read: &Vec<usize>| -> Vec<usize> {
            let place = |column: &usize| columns.iter().position(|kept| kept == column);
            read.iter().filter_map(place).collect()
        };
        let features = columns.iter().map(|&c| self.names.features[c].clone());
        let names = Names { features: features.collect(), ..self.names.clone() };
        Ok(Examples {
            names,
            read: self.read.iter().map(kept).collect(),
            hidden: kept(&self.hidden),
            views: Arc::new(self.views.iter().map(of_view).collect()),
            ..self.clone()
        })
    }

    /// Appends rows whose features `values` returns for each new row and view. A new row has the label of its origin.
    ///
    /// # Panics
    /// If an origin does not exist, or a row has too few values.
    pub fn extended<'v>(
        &self,
        origins: &[usize],
        values: impl Fn(usize, usize) -> &'v [f64],
    ) -> Self {
        let rows = self.labels.len();
        let of_view = |(view, old): (usize, &Vec<f64>)| {
            let mut new = Vec::with_capacity(old.len() / rows * (rows + origins.len()));
            for (column, old) in old.chunks_exact(rows).enumerate() {
                new.extend_from_slice(old);
                new.extend((0..origins.len()).map(|row| values(row, view)[column]));
            }
            new
        };
        let more = origins.iter().map(|&row| self.labels[row]);
        Examples {
            views: Arc::new(self.views.iter().enumerate().map(of_view).collect()),
            labels: self.labels.iter().copied().chain(more).collect(),
            ..self.clone()
        }
    }

    /// Only these rows, in this order.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn select_rows(&self, rows: &[usize]) -> Self {
        let of_view = |view: &Vec<f64>| {
            let columns = view.chunks_exact(self.labels.len().max(1));
            columns.flat_map(|column| rows.iter().map(|&row| column[row])).collect()
        };
        let labels: Vec<Label> = rows.iter().map(|&row| self.labels[row]).collect();
        Examples {
            views: Arc::new(self.views.iter().map(of_view).collect()),
            details: details_of_actions(&self.names, &labels),
            labels,
            ..self.clone()
        }
    }

    /// The same examples with columns that no stage may read.
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`].
    pub fn hiding(&self, hidden: Vec<usize>) -> Result<Self, Error> {
        check_columns(hidden.iter(), self.names.features.len())?;
        Ok(Examples { hidden, ..self.clone() })
    }

    /// The classes of a stage, as indices into the names of its question.
    pub fn classes(&self, place: &StagePlace) -> Vec<u32> {
        match place.question {
            Question::Actuator => {
                let healthy = self.names.healthy();
                let known = self.labels.iter().any(|label| label.actuator == healthy);
                (0..healthy + u32::from(known)).collect()
            }
            Question::Action => (0..self.names.actions.len() as u32).collect(),
            Question::Detail => self.details[place.action.unwrap_or(0) as usize].clone(),
        }
    }

    /// The columns that a stage may read.
    pub(crate) fn columns(&self, place: &StagePlace) -> Vec<usize> {
        let mut columns: Vec<usize> = match place.question {
            Question::Actuator => (0..self.names.features.len()).collect(),
            _ => self.read[place.actuator.unwrap_or(0) as usize].clone(),
        };
        columns.retain(|column| !self.hidden.contains(column));
        columns
    }

    /// Samples of a stage from the rows that it handles, each in its view, and with `mirror` also in all others. `None`
    /// if there are no rows or no columns. Each sample comes with its original row.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for an infinity, with the name of the column. NaN is a missing value.
    pub fn samples(
        &self,
        place: &StagePlace,
        rows: &[usize],
        mirror: bool,
    ) -> Result<Option<(Samples, Vec<usize>)>, Error> {
        let columns = self.columns(place);
        let asked = self.asked(place, rows, mirror);
        if columns.is_empty() || asked.is_empty() {
            return Ok(None);
        }
        let count = self.labels.len();
        let mut values = Vec::with_capacity(columns.len() * asked.len());
        for column in &columns {
            let start = column * count;
            values.extend(asked.iter().map(|&(row, view, _)| self.views[view][start + row]));
        }
        let names = columns.iter().map(|&c| self.names.features[c].clone());
        let classes = self.classes(place);
        let class_names =
            classes.iter().map(|&class| self.names.class_name(place.question, class).into());
        let labels = asked.iter().map(|&(_, _, label)| label).collect();
        let samples =
            Samples::with_missing(names.collect(), class_names.collect(), values, labels)?;
        let origins = asked.iter().map(|&(row, _, _)| row).collect();
        Ok(Some((samples, origins)))
    }

    /// Row, view and class (index in [`Examples::classes`]) of every sample of a stage.
    fn asked(&self, place: &StagePlace, rows: &[usize], mirror: bool) -> Vec<(usize, usize, u32)> {
        let classes = self.classes(place);
        let mut asked = Vec::new();
        for &row in rows {
            let label = self.labels[row];
            let is_healthy = label.actuator == self.names.healthy();
            let asks_on = place.question != Question::Actuator;
            if (is_healthy && asks_on) || !place.is_asked(label.actuator, label.action) {
                continue;
            }
            if place.question == Question::Actuator {
                let views = if mirror { self.views.len() } else { 1 };
                let seen = |view| (row, view, self.names.seen_from(view as u32, label.actuator));
                asked.extend((0..views).map(seen));
                continue;
            }
            let class = match place.question {
                Question::Detail => label.detail,
                _ => label.action,
            };
            let local = classes.iter().position(|&known| known == class);
            asked.extend(local.map(|class| (row, place.view(label.actuator), class as u32)));
        }
        asked
    }

    /// The stages of a hierarchy over these examples, A first.
    pub fn places(&self, pool: bool) -> Vec<StagePlace> {
        let actuators = self.names.actuators.len() as u32;
        let actions = self.names.actions.len() as u32;
        let pooled = pool || actuators == 1;
        let owners: Vec<Option<u32>> =
            if pooled { vec![None] } else { (0..actuators).map(Some).collect() };
        let place = |question, actuator, action| StagePlace { question, actuator, action };
        let mut places = Vec::new();
        let first = place(Question::Actuator, None, None);
        if self.classes(&first).len() > 1 {
            places.push(first);
        }
        places.extend(owners.iter().map(|&k| place(Question::Action, k, None)));
        for action in 0..actions {
            places.extend(owners.iter().map(|&k| place(Question::Detail, k, Some(action))));
        }
        places
    }
}

fn check_columns<'c>(
    mut columns: impl Iterator<Item = &'c usize>,
    length: usize,
) -> Result<(), Error> {
    match columns.find(|&&column| column >= length) {
        Some(&index) => Err(Error::IndexOutOfRange { what: "column", index, length }),
        None => Ok(()),
    }
}

fn check_labels(names: &Names, labels: &[Label]) -> Result<(), Error> {
    let sizes = [&names.actuators, &names.actions, &names.details].map(Vec::len);
    for (row, label) in labels.iter().enumerate().filter(|(_, l)| l.actuator != names.healthy()) {
        let parts = [label.actuator, label.action, label.detail];
        for (&label, &classes) in parts.iter().zip(&sizes) {
            if label as usize >= classes {
                return Err(Error::LabelOutOfRange { row, label, classes });
            }
        }
    }
    Ok(())
}

fn details_of_actions(names: &Names, labels: &[Label]) -> Vec<Vec<u32>> {
    let of_action = |action| {
        let mut details: Vec<u32> = labels
            .iter()
            .filter(|label| label.action == action && label.actuator != names.healthy())
            .map(|label| label.detail)
            .collect();
        details.sort_unstable();
        details.dedup();
        details
    };
    (0..names.actions.len() as u32).map(of_action).collect()
}

/// Training settings of a hierarchy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HierarchySettings {
    /// The classifier for the actuator.
    pub actuator: classifiers::Settings,
    /// The classifier for the action.
    pub action: classifiers::Settings,
    /// The classifier for the detail.
    pub detail: classifiers::Settings,
    /// Whether A also learns from the other views.
    pub mirror: bool,
    /// Whether the actuators share the stages below A.
    pub pool: bool,
}

impl Default for HierarchySettings {
    /// CART of depth 7 everywhere, mirrored and pooled.
    fn default() -> Self {
        let cart = classifiers::Settings::Cart(classifiers::cart::Settings {
            criterion: Criterion::Gini,
            max_depth: Some(7),
            ..Default::default()
        });
        HierarchySettings {
            actuator: cart.clone(),
            action: cart.clone(),
            detail: cart,
            mirror: true,
            pool: true,
        }
    }
}

impl HierarchySettings {
    /// The same classifier for every stage.
    pub fn all(classifier: classifiers::Settings) -> Self {
        HierarchySettings {
            actuator: classifier.clone(),
            action: classifier.clone(),
            detail: classifier,
            ..Default::default()
        }
    }

    /// The classifier settings of a stage.
    fn of_stage(&self, question: Question) -> &classifiers::Settings {
        match question {
            Question::Actuator => &self.actuator,
            Question::Action => &self.action,
            Question::Detail => &self.detail,
        }
    }

    /// Trains every stage that has rows.
    ///
    /// # Errors
    /// [`Error::NoSamples`] without any rows; the classifier's errors; [`Error::LengthMismatch`] for mirroring or
    /// pooling without views.
    pub fn fit(&self, examples: &Examples, rows: &[usize]) -> Result<Hierarchy, Error> {
        if self.mirror || self.pool {
            same_length("views", examples.names.actuators.len(), examples.views())?;
        }
        let mut stages = Vec::new();
        for place in examples.places(self.pool) {
            stages.extend(self.fit_stage(examples, rows, &place)?);
        }
        if stages.is_empty() {
            return Err(Error::NoSamples);
        }
        Ok(Hierarchy { names: examples.names.clone(), stages })
    }

    /// Trains one stage; `None` without rows for it.
    ///
    /// # Errors
    /// As [`HierarchySettings::fit`].
    pub fn fit_stage(
        &self,
        examples: &Examples,
        rows: &[usize],
        place: &StagePlace,
    ) -> Result<Option<Stage>, Error> {
        let Some((samples, _)) = examples.samples(place, rows, self.mirror)? else {
            return Ok(None);
        };
        let model = self.of_stage(place.question).fit(&samples)?;
        let columns = examples.columns(place);
        Ok(Some(Stage {
            id: place.id(),
            place: *place,
            columns: columns.into_iter().map(|column| column as u32).collect(),
            classes: examples.classes(place),
            model,
            temperature: 1.0,
        }))
    }
}
