//! The hierarchy of trees: which actuator, then which command, then which detail.
//!
//! ```text
//! A               the actuator, from all sensors
//! B               the command for it
//! C, D, E …       the detail within each command
//! ```
//!
//! With two actuators and three commands these are the seed paper's nine trees (its figure 10): A
//! once, the others once for each actuator. Any classifier can stand at any place.
//!
//! **Views.** A system of like actuators looks the same from each of them. View `k` of a row of
//! features is the row with the actuators moved round until actuator `k` stands first and the next one second
//! (the window of [`crate::residual::Window::reordered`] by [`crate::features::Sensors::rotated`]), so view 0 is the row
//! itself, and of two actuators view 1 is the row with both exchanged. So all views of a row show its fault in each
//! actuator once. This is used twice:
//! - *mirror*: A also learns from every view, with the actuator in the label moved alike;
//! - *pool*: one B (and C, D, E) learns from all actuators, each through its own view, in which its
//!   sensors stand where those of actuator 0 stand; the nine trees are then five.
//!
//! Without pooling, a stage of actuator `k` reads its columns in view 0.
//!
//! **Healthy.** Where examples without a fault are given, A may answer that there is none; nothing
//! is asked after that. So an alarm that a tolerance raised need not become a fault.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::calibration;
use crate::classifiers::{self, Classifier, Fit, Model, Scores};
use crate::data::Samples;
use crate::error::{Error, same_length};
use crate::tree::Criterion;

/// The word that a stored hierarchy begins with.
pub const FORMAT: &str = "servotwin hierarchy 2";

/// The answer of A that there is no fault.
pub const HEALTHY: &str = "healthy";

/// What the only unit is called where it has no name and something is wrong.
pub const FAULTY: &str = "faulty";

/// What a stage decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Question {
    /// Which actuator the fault is in.
    Actuator,
    /// What is to be done with it.
    Command,
    /// What is broken there.
    Detail,
}

/// Where a stage stands in the hierarchy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// What it decides.
    pub question: Question,
    /// The actuator it is for; `None` for any.
    pub actuator: Option<u32>,
    /// The command whose details it tells apart; `None` for the stages above.
    pub command: Option<u32>,
}

impl Place {
    /// The paper's letter, and the number of the actuator from 1 where it has one: `A`, `B2`, `C`.
    pub fn id(&self) -> String {
        let letter = match self.question {
            Question::Actuator => 'A',
            Question::Command => 'B',
            Question::Detail => {
                let place = u32::from('C') + self.command.unwrap_or(0);
                char::from_u32(place).unwrap_or('?')
            }
        };
        match self.actuator {
            Some(actuator) => format!("{letter}{}", actuator + 1),
            None => letter.into(),
        }
    }

    /// Whether a fault with this truth is one that the stage is asked about.
    pub fn is_asked(&self, actuator: u32, command: u32) -> bool {
        self.actuator.is_none_or(|own| own == actuator)
            && self.command.is_none_or(|own| own == command)
    }

    /// The view that the stage reads for a fault in an actuator.
    pub fn view(&self, actuator: u32) -> usize {
        let own_view = self.question != Question::Actuator && self.actuator.is_none();
        if own_view { actuator as usize } else { 0 }
    }
}

/// The names of everything a hierarchy reads and decides.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Names {
    /// The features, in the order of a row.
    pub features: Vec<String>,
    /// The actuators; at least one.
    pub actuators: Vec<String>,
    /// The commands, most urgent first.
    pub commands: Vec<String>,
    /// The details.
    pub details: Vec<String>,
}

/// What is wrong with a row: places in [`Names`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Label {
    /// The actuator; the number of actuators where nothing is wrong ([`Names::healthy`]).
    pub actuator: u32,
    /// The command; means nothing where nothing is wrong.
    pub command: u32,
    /// The detail; likewise.
    pub detail: u32,
}

/// Rows to learn from or to test with: their features in every view, and their labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Examples {
    names: Names,
    /// For each actuator the columns that its stages may read.
    read: Vec<Vec<usize>>,
    /// The columns that no stage may read.
    hidden: Vec<usize>,
    /// Column-major features of all rows, one table per view.
    views: Arc<Vec<Vec<f64>>>,
    labels: Vec<Label>,
    /// For each command the details that occur with it, ascending.
    details: Vec<Vec<u32>>,
}

impl Examples {
    /// Rows with column-major features in each view. `read` lists for each actuator the columns that
    /// its stages may read: its own sensors', or also the others' and what compares them;
    /// without views beyond the first nothing can be mirrored or pooled.
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
        let details = details_of_commands(&names, &labels);
        Ok(Examples { names, read, hidden: vec![], views: Arc::new(views), labels, details })
    }

    /// The names.
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

    /// The same rows with some of the feature columns only, in the order given.
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
            labels: self.labels.clone(),
            details: self.details.clone(),
        })
    }

    /// The same rows and behind them more, whose features `values` gives for each new row and view.
    /// A new row has the label of the one that it is from.
    ///
    /// # Panics
    /// If a row is not there, or has too few values.
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
            names: self.names.clone(),
            read: self.read.clone(),
            hidden: self.hidden.clone(),
            details: self.details.clone(),
        }
    }

    /// Some of the rows, in the order given.
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
            names: self.names.clone(),
            read: self.read.clone(),
            hidden: self.hidden.clone(),
            views: Arc::new(self.views.iter().map(of_view).collect()),
            details: details_of_commands(&self.names, &labels),
            labels,
        }
    }

    /// The same examples with other columns for the stages of each actuator.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] and [`Error::IndexOutOfRange`].
    pub fn reading(&self, read: Vec<Vec<usize>>) -> Result<Self, Error> {
        same_length("columns to read", self.names.actuators.len(), read.len())?;
        check_columns(read.iter().flatten(), self.names.features.len())?;
        Ok(Examples { read, ..self.clone() })
    }

    /// The same examples with columns that no stage may read.
    ///
    /// # Errors
    /// [`Error::IndexOutOfRange`].
    pub fn hiding(&self, hidden: Vec<usize>) -> Result<Self, Error> {
        check_columns(hidden.iter(), self.names.features.len())?;
        Ok(Examples { hidden, ..self.clone() })
    }

    /// The classes a stage chooses from: places in the names that its question is about.
    pub fn classes(&self, place: &Place) -> Vec<u32> {
        match place.question {
            Question::Actuator => {
                let healthy = self.names.healthy();
                let known = self.labels.iter().any(|label| label.actuator == healthy);
                (0..healthy + u32::from(known)).collect()
            }
            Question::Command => (0..self.names.commands.len() as u32).collect(),
            Question::Detail => self.details[place.command.unwrap_or(0) as usize].clone(),
        }
    }

    /// The name of a class of a question.
    ///
    /// # Panics
    /// If there is no such class.
    pub fn class_name(&self, question: Question, class: u32) -> &str {
        self.names.class_name(question, class)
    }

    /// The columns a stage may read.
    pub fn columns(&self, place: &Place) -> Vec<usize> {
        let mut columns: Vec<usize> = match place.question {
            Question::Actuator => (0..self.names.features.len()).collect(),
            _ => self.read[place.actuator.unwrap_or(0) as usize].clone(),
        };
        columns.retain(|column| !self.hidden.contains(column));
        columns
    }

    /// Samples of a stage from those of the rows that it is asked about, each in its view, and with
    /// `mirror` also in all others; `None` if there are none or nothing may be read. Beside each
    /// sample stands the row it is from.
    ///
    /// # Errors
    /// [`Error::NotFinite`] naming the column.
    pub fn samples(
        &self,
        place: &Place,
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
            classes.iter().map(|&class| self.class_name(place.question, class).into());
        let labels = asked.iter().map(|&(_, _, label)| label).collect();
        let samples =
            Samples::from_columns(names.collect(), class_names.collect(), values, labels)?;
        let origins = asked.iter().map(|&(row, _, _)| row).collect();
        Ok(Some((samples, origins)))
    }

    /// Row, view and class (its place in [`Examples::classes`]) of every sample of a stage.
    fn asked(&self, place: &Place, rows: &[usize], mirror: bool) -> Vec<(usize, usize, u32)> {
        let classes = self.classes(place);
        let mut asked = Vec::new();
        for &row in rows {
            let label = self.labels[row];
            let is_healthy = label.actuator == self.names.healthy();
            let asks_on = place.question != Question::Actuator;
            if (is_healthy && asks_on) || !place.is_asked(label.actuator, label.command) {
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
                _ => label.command,
            };
            let local = classes.iter().position(|&known| known == class);
            asked.extend(local.map(|class| (row, place.view(label.actuator), class as u32)));
        }
        asked
    }

    /// The stages of a hierarchy over these rows, A first.
    pub fn places(&self, pool: bool) -> Vec<Place> {
        let actuators = self.names.actuators.len() as u32;
        let commands = self.names.commands.len() as u32;
        let pooled = pool || actuators == 1;
        let owners: Vec<Option<u32>> =
            if pooled { vec![None] } else { (0..actuators).map(Some).collect() };
        let place = |question, actuator, command| Place { question, actuator, command };
        let mut places = Vec::new();
        let first = place(Question::Actuator, None, None);
        if self.classes(&first).len() > 1 {
            places.push(first);
        }
        places.extend(owners.iter().map(|&k| place(Question::Command, k, None)));
        for command in 0..commands {
            places.extend(owners.iter().map(|&k| place(Question::Detail, k, Some(command))));
        }
        places
    }
}

impl Names {
    /// The actuator of a label that says that nothing is wrong, and the class of A for it.
    pub fn healthy(&self) -> u32 {
        self.actuators.len() as u32
    }

    /// The place of an actuator in a view; health is the same in all.
    fn seen_from(&self, view: u32, actuator: u32) -> u32 {
        let actuators = self.healthy();
        if actuator == actuators { actuator } else { (actuator + actuators - view) % actuators }
    }

    /// The name of a class of a question.
    ///
    /// # Panics
    /// If there is no such class.
    pub fn class_name(&self, question: Question, class: u32) -> &str {
        if question == Question::Actuator && class == self.healthy() {
            return HEALTHY;
        }
        let names = match question {
            Question::Actuator => &self.actuators,
            Question::Command => &self.commands,
            Question::Detail => &self.details,
        };
        &names[class as usize]
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
    let sizes = [&names.actuators, &names.commands, &names.details].map(Vec::len);
    for (row, label) in labels.iter().enumerate().filter(|(_, l)| l.actuator != names.healthy()) {
        let parts = [label.actuator, label.command, label.detail];
        for (&label, &classes) in parts.iter().zip(&sizes) {
            if label as usize >= classes {
                return Err(Error::LabelOutOfRange { row, label, classes });
            }
        }
    }
    Ok(())
}

fn details_of_commands(names: &Names, labels: &[Label]) -> Vec<Vec<u32>> {
    let of_command = |command| {
        let mut details: Vec<u32> = labels
            .iter()
            .filter(|label| label.command == command && label.actuator != names.healthy())
            .map(|label| label.detail)
            .collect();
        details.sort_unstable();
        details.dedup();
        details
    };
    (0..names.commands.len() as u32).map(of_command).collect()
}

/// How a hierarchy is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The classifier that finds the actuator.
    pub actuator: classifiers::Settings,
    /// The classifier that finds the command.
    pub command: classifiers::Settings,
    /// The classifier that finds the detail.
    pub detail: classifiers::Settings,
    /// Whether A also learns from the mirror images.
    pub mirror: bool,
    /// Whether the actuators share the stages below A.
    pub pool: bool,
}

impl Default for Settings {
    /// CART of depth 7 everywhere, mirrored and pooled.
    fn default() -> Self {
        let cart = classifiers::Settings::Cart(classifiers::cart::Settings {
            criterion: Criterion::Gini,
            max_depth: Some(7),
            ..Default::default()
        });
        Settings {
            actuator: cart.clone(),
            command: cart.clone(),
            detail: cart,
            mirror: true,
            pool: true,
        }
    }
}

impl Settings {
    /// The same settings for every stage.
    pub fn all(classifier: classifiers::Settings) -> Self {
        Settings {
            actuator: classifier.clone(),
            command: classifier.clone(),
            detail: classifier,
            ..Default::default()
        }
    }

    /// The classifier settings of a stage, with the resolutions and exclusions of those features
    /// only that its samples have.
    pub fn of_stage(&self, question: Question, samples: &Samples) -> classifiers::Settings {
        let mut settings = match question {
            Question::Actuator => &self.actuator,
            Question::Command => &self.command,
            Question::Detail => &self.detail,
        }
        .clone();
        if let classifiers::Settings::Cart(cart) = &mut settings {
            let known = |name: &String| samples.feature_names().contains(name);
            cart.resolutions.retain(|limit| known(&limit.feature));
            cart.excluded_features.retain(known);
        }
        settings
    }

    /// Trains every stage for which there are rows.
    ///
    /// # Errors
    /// [`Error::NoSamples`] if there are no rows at all; what a classifier says;
    /// [`Error::LengthMismatch`] if mirror or pool is asked for without views.
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
        Ok(Hierarchy { format: FORMAT.into(), names: examples.names.clone(), stages })
    }

    /// Trains one stage; `None` if there is no row for it.
    ///
    /// # Errors
    /// As [`Settings::fit`].
    pub fn fit_stage(
        &self,
        examples: &Examples,
        rows: &[usize],
        place: &Place,
    ) -> Result<Option<Stage>, Error> {
        let Some((samples, _)) = examples.samples(place, rows, self.mirror)? else {
            return Ok(None);
        };
        let model = self.of_stage(place.question, &samples).fit(&samples)?;
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

/// One trained stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// [`Place::id`], for people.
    pub id: String,
    /// Where it stands.
    pub place: Place,
    /// The features it reads, by place in [`Names::features`], in the order of the model.
    pub columns: Vec<u32>,
    /// The class of each class of the model, by place in the names that the question is about.
    pub classes: Vec<u32>,
    /// The classifier.
    pub model: Model,
    /// What calibrates its probabilities ([`crate::calibration`]); 1 leaves them as they are.
    pub temperature: f64,
}

/// What a stage answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// The class, a place in the names that the question is about.
    pub class: u32,
    /// Its probability, as far as the classifier knows it.
    pub probability: f64,
}

impl Stage {
    /// The class decided for a row of all features, with its probability. Does not allocate.
    ///
    /// # Panics
    /// If the row is shorter than the features.
    pub fn answer(&self, row: &[f64], scratch: &mut Scratch) -> Answer {
        for (slot, &column) in scratch.row.iter_mut().zip(&self.columns) {
            *slot = row[column as usize];
        }
        let own = &scratch.row[..self.columns.len()];
        let scores = &mut scratch.scores[..self.classes.len()];
        let class = self.model.predict_with(own, scores) as usize;
        let mut probability = 1.0;
        // Margins are no shares, and give no probability.
        if self.model.scores() == Scores::Shares {
            self.model.scores_into(own, scores);
            calibration::scale(scores, self.temperature);
            probability = scores[class];
        }
        Answer { class: self.classes[class], probability }
    }

    /// The probability of each of the stage's classes for a row of all features; where the
    /// classifier knows none, 1 for the class decided. Does not allocate.
    ///
    /// # Panics
    /// If the row is shorter than the features.
    pub fn probabilities<'s>(&self, row: &[f64], scratch: &'s mut Scratch) -> &'s [f64] {
        for (slot, &column) in scratch.row.iter_mut().zip(&self.columns) {
            *slot = row[column as usize];
        }
        let own = &scratch.row[..self.columns.len()];
        let scores = &mut scratch.scores[..self.classes.len()];
        if self.model.scores() == Scores::Shares {
            self.model.scores_into(own, scores);
            calibration::scale(scores, self.temperature);
        } else {
            let class = self.model.predict_with(own, scores) as usize;
            scores.fill(0.0);
            scores[class] = 1.0;
        }
        scores
    }

    /// The nodes from the root to the leaf of a row of all features; empty unless the model is a
    /// CART tree.
    pub fn path(&self, row: &[f64]) -> Vec<usize> {
        let Model::Cart(tree) = &self.model else {
            return vec![];
        };
        let own: Vec<f64> = self.columns.iter().map(|&c| row[c as usize]).collect();
        tree.decision_path(&own).collect()
    }
}

/// The memory that a diagnosis needs, made once by [`Hierarchy::scratch`].
#[derive(Debug, Clone, PartialEq)]
pub struct Scratch {
    row: Vec<f64>,
    scores: Vec<f64>,
}

/// What a hierarchy says about a row: places in [`Names`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diagnosis {
    /// The actuator; `None` where nothing is wrong.
    pub actuator: Option<u32>,
    /// The command; `None` without an actuator, or if no stage was ever trained for it.
    pub command: Option<u32>,
    /// The detail; `None` likewise.
    pub detail: Option<u32>,
    /// The probability that actuator and command are right: the product of the stages'.
    pub confidence: f64,
    /// The probability of the detail, given the command; 1 without one.
    pub detail_confidence: f64,
}

impl Diagnosis {
    /// What the flight control computer acts on.
    pub fn action(&self) -> (Option<u32>, Option<u32>) {
        (self.actuator, self.command)
    }
}

/// A trained hierarchy; stored as JSON with the names that its numbers stand for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hierarchy {
    /// [`FORMAT`].
    pub format: String,
    /// The names.
    pub names: Names,
    /// The stages, A first.
    pub stages: Vec<Stage>,
}

impl Hierarchy {
    /// The stage asked a question about an actuator and a command.
    pub fn stage(&self, question: Question, actuator: u32, command: u32) -> Option<&Stage> {
        self.stages.iter().find(|stage| {
            stage.place.question == question && stage.place.is_asked(actuator, command)
        })
    }

    /// How many views of a row a diagnosis needs.
    pub fn views(&self) -> usize {
        let pooled = |stage: &Stage| {
            stage.place.question != Question::Actuator && stage.place.actuator.is_none()
        };
        if self.stages.iter().any(pooled) { self.names.actuators.len() } else { 1 }
    }

    /// Memory for [`Hierarchy::diagnose`].
    pub fn scratch(&self) -> Scratch {
        let largest = |size: fn(&Stage) -> usize| self.stages.iter().map(size).max().unwrap_or(0);
        Scratch {
            row: vec![0.0; largest(|stage| stage.columns.len())],
            scores: vec![0.0; largest(|stage| stage.classes.len())],
        }
    }

    /// What the hierarchy says about a row, given in every view. Does not allocate.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] if there are fewer than [`Hierarchy::views`] views, or a view has
    /// another number of features.
    pub fn diagnose<V: AsRef<[f64]>>(
        &self,
        views: &[V],
        scratch: &mut Scratch,
    ) -> Result<Diagnosis, Error> {
        self.check_views(views)?;
        let mut ask = |question, actuator, command| {
            let stage = self.stage(question, actuator, command)?;
            Some(stage.answer(views[stage.place.view(actuator)].as_ref(), scratch))
        };
        let sure = Answer { class: 0, probability: 1.0 };
        let first = ask(Question::Actuator, 0, 0).unwrap_or(sure);
        let mut said = Diagnosis {
            actuator: None,
            command: None,
            detail: None,
            confidence: first.probability,
            detail_confidence: 1.0,
        };
        if first.class == self.names.healthy() {
            return Ok(said);
        }
        said.actuator = Some(first.class);
        if let Some(command) = ask(Question::Command, first.class, 0) {
            said.command = Some(command.class);
            said.confidence *= command.probability;
            if let Some(detail) = ask(Question::Detail, first.class, command.class) {
                said.detail = Some(detail.class);
                said.detail_confidence = detail.probability;
            }
        }
        Ok(said)
    }

    fn check_views<V: AsRef<[f64]>>(&self, views: &[V]) -> Result<(), Error> {
        if views.len() < self.views() {
            same_length("views", self.views(), views.len())?;
        }
        let of_view =
            |view: &V| same_length("features", self.names.features.len(), view.as_ref().len());
        views.iter().try_for_each(of_view)
    }

    /// The probability that nothing is wrong, and behind it that of each command for each actuator,
    /// actuator by actuator, for a row given in every view. Where no stage tells commands apart they
    /// share evenly. Does not allocate.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`], and [`Error::LengthMismatch`] if `into` has no room for each.
    pub fn probabilities_into<V: AsRef<[f64]>>(
        &self,
        views: &[V],
        scratch: &mut Scratch,
        into: &mut [f64],
    ) -> Result<(), Error> {
        self.check_views(views)?;
        let (actuators, commands) = (self.names.actuators.len(), self.names.commands.len());
        same_length("probabilities", 1 + actuators * commands, into.len())?;
        into.fill(0.0);
        let place = |actuator: usize| 1 + actuator * commands;
        match self.stage(Question::Actuator, 0, 0) {
            None => into.iter_mut().skip(1).take(commands).for_each(|share| *share = 1.0),
            Some(stage) => {
                let shares = stage.probabilities(views[0].as_ref(), scratch);
                for (&class, &share) in stage.classes.iter().zip(shares) {
                    let is_fault = class != self.names.healthy();
                    let own = if is_fault {
                        place(class as usize)..place(class as usize + 1)
                    } else {
                        0..1
                    };
                    into[own].fill(share);
                }
            }
        }
        for actuator in 0..actuators {
            let own = &mut into[place(actuator)..place(actuator + 1)];
            let Some(stage) = self.stage(Question::Command, actuator as u32, 0) else {
                own.iter_mut().for_each(|share| *share /= commands as f64);
                continue;
            };
            let of_actuator = own.first().copied().unwrap_or(0.0);
            own.fill(0.0);
            let view = stage.place.view(actuator as u32);
            let shares = stage.probabilities(views[view].as_ref(), scratch);
            for (&class, &share) in stage.classes.iter().zip(shares) {
                own[class as usize] = of_actuator * share;
            }
        }
        Ok(())
    }

    /// The detail of a fault whose actuator and command are known, for a row given in every view.
    /// Does not allocate.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`].
    pub fn detail<V: AsRef<[f64]>>(
        &self,
        views: &[V],
        (actuator, command): (u32, u32),
        scratch: &mut Scratch,
    ) -> Result<Option<Answer>, Error> {
        self.check_views(views)?;
        let stage = self.stage(Question::Detail, actuator, command);
        let answer =
            |stage: &Stage| stage.answer(views[stage.place.view(actuator)].as_ref(), scratch);
        Ok(stage.map(answer))
    }

    /// The stages that a diagnosis went through, each with the nodes from its root to the leaf.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`].
    pub fn explain<V: AsRef<[f64]>>(
        &self,
        views: &[V],
    ) -> Result<Vec<(&Stage, Vec<usize>)>, Error> {
        let diagnosis = self.diagnose(views, &mut self.scratch())?;
        let Diagnosis { actuator, command, .. } = diagnosis;
        let below = |question, command| self.stage(question, actuator?, command);
        let asked = [
            self.stage(Question::Actuator, 0, 0),
            below(Question::Command, 0),
            command.and_then(|command| below(Question::Detail, command)),
        ];
        let view = |stage: &Stage| views[stage.place.view(actuator.unwrap_or(0))].as_ref();
        let with_path = |stage: &'_ Stage| stage.path(view(stage));
        let asked = asked.into_iter().flatten();
        Ok(asked.map(|stage| (stage, with_path(stage))).collect())
    }

    /// Checks that the parts fit each other; for hierarchies that come from outside.
    ///
    /// # Errors
    /// [`Error::CorruptModel`], [`Error::LengthMismatch`], [`Error::IndexOutOfRange`], and what
    /// [`Classifier::check`] says.
    pub fn check(&self) -> Result<(), Error> {
        let holds = |holds, broken| {
            if holds { Ok(()) } else { Err(Error::CorruptModel { broken }) }
        };
        holds(self.format == FORMAT, "the format is another one")?;
        holds(!self.names.actuators.is_empty(), "there is no actuator")?;
        for stage in &self.stages {
            stage.model.check()?;
            same_length("columns of a stage", stage.model.features(), stage.columns.len())?;
            same_length("classes of a stage", stage.model.classes(), stage.classes.len())?;
            let features = self.names.features.len() as u32;
            let known = stage.columns.iter().all(|&column| column < features);
            holds(known, "a stage reads a feature that is not there")?;
            let names = match stage.place.question {
                Question::Actuator => &self.names.actuators,
                Question::Command => &self.names.commands,
                Question::Detail => &self.names.details,
            };
            // A has one class more: healthy.
            let count = names.len() + usize::from(stage.place.question == Question::Actuator);
            let known = stage.classes.iter().all(|&class| (class as usize) < count);
            holds(known, "a stage decides a class that is not there")?;
            holds(stage.temperature > 0.0, "a stage's temperature is not above zero")?;
        }
        Ok(())
    }
}
