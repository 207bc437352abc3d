//! The hierarchy of trees: first the actuator, then the action, then the detail.
//!
//! ```text
//! A               the actuator, from all sensors
//! B               the action for it
//! C, D, E …       the detail within each action
//! ```
//!
//! With two actuators and three actions these are the seed paper's nine trees (its figure 10): A once, the others once
//! for each actuator. Any classifier can take any place.
//!
//! **Views.** A system of identical actuators looks the same from each of them. View `k` of a feature row rotates the
//! actuators until actuator `k` comes first and the next one second. Its window is
//! [`crate::residual::Window::reordered`] by [`crate::features::Sensors::rotations`]. View 0 is the row itself; with two
//! actuators, view 1 is the row with both exchanged. So the views of a row together show its fault once in each
//! actuator. There are two uses:
//! - *mirror*: A also learns from every view, with the actuator in the label rotated alike;
//! - *pool*: one B (and C, D, E) learns from all actuators, each through its own view. There its sensors take the
//!   places of actuator 0's sensors, and the nine trees become five.
//!
//! Without pooling, a stage of actuator `k` reads its columns in view 0.
//!
//! **Healthy.** If the training data contain healthy examples, A may answer that there is no fault, and the later
//! stages do not run. An alarm caused by a tolerance then need not become a fault.

use crate::calibration;
use crate::classifiers::{Classifier, Model, Scores};
use crate::error::{Error, require_sound, same_length};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A's answer when there is no fault.
pub const HEALTHY: &str = "healthy";

/// Name of a single, unnamed actuator that has a fault.
pub const FAULTY: &str = "faulty";

/// What a stage decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Question {
    /// The faulty actuator.
    Actuator,
    /// The action for that actuator.
    Action,
    /// The fault class within that action.
    Detail,
}

/// Where a stage stands in the hierarchy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StagePlace {
    /// The question it answers.
    pub question: Question,
    /// The actuator that it serves; `None` for all.
    pub actuator: Option<u32>,
    /// The action whose details it separates; `None` for A and B.
    pub action: Option<u32>,
}

impl StagePlace {
    /// The paper's letter, followed by the actuator number from 1 for a stage of one actuator: `A`, `B2`, `C`.
    pub fn id(&self) -> String {
        let letter = match self.question {
            Question::Actuator => 'A',
            Question::Action => 'B',
            Question::Detail => {
                let place = u32::from('C') + self.action.unwrap_or(0);
                char::from_u32(place).unwrap_or('?')
            }
        };
        match self.actuator {
            Some(actuator) => format!("{letter}{}", actuator + 1),
            None => letter.into(),
        }
    }

    /// Whether the stage handles faults with this true actuator and action.
    pub fn is_asked(&self, actuator: u32, action: u32) -> bool {
        self.actuator.is_none_or(|own| own == actuator)
            && self.action.is_none_or(|own| own == action)
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
    /// Feature names, in the order of a row.
    pub features: Vec<String>,
    /// Actuator names; at least one.
    pub actuators: Vec<String>,
    /// Action names, most urgent first.
    pub actions: Vec<String>,
    /// Detail names.
    pub details: Vec<String>,
}

impl Names {
    /// The actuator number of healthy labels, and A's class for them.
    pub fn healthy(&self) -> u32 {
        self.actuators.len() as u32
    }

    /// The number of an actuator in a view; healthy is the same in all.
    pub fn seen_from(&self, view: u32, actuator: u32) -> u32 {
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
            Question::Action => &self.actions,
            Question::Detail => &self.details,
        };
        &names[class as usize]
    }
}

/// One trained stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// [`StagePlace::id`], for readers.
    pub id: String,
    /// The place in the hierarchy.
    pub place: StagePlace,
    /// The features that the model reads, in its order, as indices into [`Names::features`].
    pub columns: Vec<u32>,
    /// For each class of the model, its index in the question's names.
    pub classes: Vec<u32>,
    #[expect(missing_docs)]
    pub model: Model,
    /// The temperature of [`crate::calibration`] for its probabilities; 1 leaves them as they are.
    pub temperature: f64,
}

/// The answer of a stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageAnswer {
    /// The class, an index into the question's names.
    pub class: u32,
    /// Its calibrated probability; 1 if the classifier gives none.
    pub probability: f64,
}

impl Stage {
    /// The class decided for a row of all features, with its probability. Does not allocate.
    ///
    /// # Panics
    /// If the row is shorter than the features.
    pub fn answer(&self, row: &[f64], scratch: &mut Scratch) -> StageAnswer {
        let (own, scores) = self.read(row, scratch);
        let class = self.model.predict_with(own, scores) as usize;
        // Margins are no shares and give no probability.
        let probability = if self.calibrated_into(own, scores) { scores[class] } else { 1.0 };
        StageAnswer { class: self.classes[class], probability }
    }

    /// The probability of each of the stage's classes for a row of all features. A classifier without probabilities
    /// gives 1 to the class that it chooses. Does not allocate.
    ///
    /// # Panics
    /// If the row is shorter than the features.
    pub fn probabilities<'s>(&self, row: &[f64], scratch: &'s mut Scratch) -> &'s [f64] {
        let (own, scores) = self.read(row, scratch);
        if !self.calibrated_into(own, scores) {
            let class = self.model.predict_with(own, scores) as usize;
            scores.fill(0.0);
            scores[class] = 1.0;
        }
        scores
    }

    /// The features that the model reads, and room for its scores.
    fn read<'s>(&self, row: &[f64], scratch: &'s mut Scratch) -> (&'s [f64], &'s mut [f64]) {
        for (slot, &column) in scratch.row.iter_mut().zip(&self.columns) {
            *slot = row[column as usize];
        }
        (&scratch.row[..self.columns.len()], &mut scratch.scores[..self.classes.len()])
    }

    /// Writes the calibrated probabilities; `false` for a classifier that has none.
    fn calibrated_into(&self, own: &[f64], scores: &mut [f64]) -> bool {
        let has_shares = self.model.scores() == Scores::Shares;
        if has_shares {
            self.model.scores_into(own, scores);
            calibration::scale(scores, self.temperature);
        }
        has_shares
    }

    /// The nodes from the root to the leaf for a row of all features; empty unless the model is a CART tree.
    pub(crate) fn path(&self, row: &[f64]) -> Vec<usize> {
        let Model::Cart(tree) = &self.model else {
            return vec![];
        };
        let own: Vec<f64> = self.columns.iter().map(|&c| row[c as usize]).collect();
        tree.decision_path(&own).collect()
    }
}

/// The working memory of a diagnosis, allocated by [`Hierarchy::scratch`].
#[derive(Debug, Clone, PartialEq)]
pub struct Scratch {
    row: Vec<f64>,
    scores: Vec<f64>,
}

/// A hierarchy's answer for a row, as indices into [`Names`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diagnosis {
    /// The actuator; `None` if healthy.
    pub actuator: Option<u32>,
    /// The action; `None` without an actuator or a trained stage.
    pub action: Option<u32>,
    /// The detail; `None` without an action or a trained stage.
    pub detail: Option<u32>,
    /// The probability that actuator and action are right: the product of both stages' probabilities.
    pub confidence: f64,
    /// The probability of the detail, given the action; 1 without a detail.
    pub detail_confidence: f64,
}

impl Diagnosis {
    /// The part that the flight control computer acts on.
    pub fn actuator_and_action(&self) -> (Option<u32>, Option<u32>) {
        (self.actuator, self.action)
    }
}

/// A trained hierarchy with its names, a part of a stored diagnoser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hierarchy {
    /// The names that its indices refer to.
    pub names: Names,
    /// The stages, A first.
    pub stages: Vec<Stage>,
}

impl Hierarchy {
    /// Finds the stage that answers a question for an actuator and an action.
    pub fn stage(&self, question: Question, actuator: u32, action: u32) -> Option<&Stage> {
        self.stages.iter().find(|stage| {
            stage.place.question == question && stage.place.is_asked(actuator, action)
        })
    }

    /// Number of views of a row that a diagnosis needs.
    pub fn views(&self) -> usize {
        let pooled = |stage: &Stage| {
            stage.place.question != Question::Actuator && stage.place.actuator.is_none()
        };
        if self.stages.iter().any(pooled) { self.names.actuators.len() } else { 1 }
    }

    /// Allocates the memory for [`Hierarchy::diagnose`].
    pub fn scratch(&self) -> Scratch {
        let largest = |size: fn(&Stage) -> usize| self.stages.iter().map(size).max().unwrap_or(0);
        Scratch {
            row: vec![0.0; largest(|stage| stage.columns.len())],
            scores: vec![0.0; largest(|stage| stage.classes.len())],
        }
    }

    /// Diagnoses a row, given in every view. Does not allocate.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] for fewer than [`Hierarchy::views`] views, or a view with another number of features.
    pub fn diagnose<V: AsRef<[f64]>>(
        &self,
        views: &[V],
        scratch: &mut Scratch,
    ) -> Result<Diagnosis, Error> {
        self.check_views(views)?;
        Ok(self.answer(views[0].as_ref(), views, scratch))
    }

    /// As [`Hierarchy::diagnose`], with a row of its own for the question which actuator failed: it reads of no actuator
    /// what another one lacks.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`].
    pub(crate) fn diagnose_paired<V: AsRef<[f64]>>(
        &self,
        (paired, views): (&[f64], &[V]),
        scratch: &mut Scratch,
    ) -> Result<Diagnosis, Error> {
        self.check_rows(paired, views)?;
        Ok(self.answer(paired, views, scratch))
    }

    fn answer<V: AsRef<[f64]>>(
        &self,
        paired: &[f64],
        views: &[V],
        scratch: &mut Scratch,
    ) -> Diagnosis {
        let sure = StageAnswer { class: 0, probability: 1.0 };
        let of_actuators = self.stage(Question::Actuator, 0, 0);
        let first = of_actuators.map_or(sure, |stage| stage.answer(paired, scratch));
        let mut ask = |question, actuator, action| {
            let stage = self.stage(question, actuator, action)?;
            Some(stage.answer(views[stage.place.view(actuator)].as_ref(), scratch))
        };
        let mut said = Diagnosis {
            actuator: None,
            action: None,
            detail: None,
            confidence: first.probability,
            detail_confidence: 1.0,
        };
        if first.class == self.names.healthy() {
            return said;
        }
        said.actuator = Some(first.class);
        if let Some(action) = ask(Question::Action, first.class, 0) {
            said.action = Some(action.class);
            said.confidence *= action.probability;
            if let Some(detail) = ask(Question::Detail, first.class, action.class) {
                said.detail = Some(detail.class);
                said.detail_confidence = detail.probability;
            }
        }
        said
    }

    fn check_rows<V: AsRef<[f64]>>(&self, paired: &[f64], views: &[V]) -> Result<(), Error> {
        same_length("features", self.names.features.len(), paired.len())?;
        self.check_views(views)
    }

    fn check_views<V: AsRef<[f64]>>(&self, views: &[V]) -> Result<(), Error> {
        if views.len() < self.views() {
            same_length("views", self.views(), views.len())?;
        }
        let of_view =
            |view: &V| same_length("features", self.names.features.len(), view.as_ref().len());
        views.iter().try_for_each(of_view)
    }

    /// Writes the probability of healthy, then of each action actuator by actuator, for the row that tells actuators apart
    /// and the row in every view. Without a stage for the actions they share evenly. Does not allocate.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`], and [`Error::LengthMismatch`] if `into` has another length.
    pub fn probabilities_into<V: AsRef<[f64]>>(
        &self,
        (paired, views): (&[f64], &[V]),
        scratch: &mut Scratch,
        into: &mut [f64],
    ) -> Result<(), Error> {
        self.check_rows(paired, views)?;
        let (actuators, actions) = (self.names.actuators.len(), self.names.actions.len());
        same_length("probabilities", 1 + actuators * actions, into.len())?;
        into.fill(0.0);
        let place = |actuator: usize| 1 + actuator * actions;
        match self.stage(Question::Actuator, 0, 0) {
            None => into.iter_mut().skip(1).take(actions).for_each(|share| *share = 1.0),
            Some(stage) => {
                let shares = stage.probabilities(paired, scratch);
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
            let Some(stage) = self.stage(Question::Action, actuator as u32, 0) else {
                own.iter_mut().for_each(|share| *share /= actions as f64);
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

    /// The detail of a fault with known actuator and action, for a row given in every view. Does not allocate.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`].
    pub(crate) fn detail<V: AsRef<[f64]>>(
        &self,
        views: &[V],
        (actuator, action): (u32, u32),
        scratch: &mut Scratch,
    ) -> Result<Option<StageAnswer>, Error> {
        self.check_views(views)?;
        let stage = self.stage(Question::Detail, actuator, action);
        let answer =
            |stage: &Stage| stage.answer(views[stage.place.view(actuator)].as_ref(), scratch);
        Ok(stage.map(answer))
    }

    /// The stages that a diagnosis passes through, each with its nodes from root to leaf, for the row that tells actuators
    /// apart and the row in every view.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`].
    pub fn explain<V: AsRef<[f64]>>(
        &self,
        (paired, views): (&[f64], &[V]),
    ) -> Result<Vec<(&Stage, Vec<usize>)>, Error> {
        let diagnosis = self.diagnose_paired((paired, views), &mut self.scratch())?;
        let Diagnosis { actuator, action, .. } = diagnosis;
        let below = |question, action| self.stage(question, actuator?, action);
        let asked = [
            self.stage(Question::Actuator, 0, 0),
            below(Question::Action, 0),
            action.and_then(|action| below(Question::Detail, action)),
        ];
        let row = |stage: &Stage| match stage.place.question {
            Question::Actuator => paired,
            _ => views[stage.place.view(actuator.unwrap_or(0))].as_ref(),
        };
        let with_path = |stage: &'_ Stage| stage.path(row(stage));
        let asked = asked.into_iter().flatten();
        Ok(asked.map(|stage| (stage, with_path(stage))).collect())
    }

    /// Checks that the parts of a loaded hierarchy fit together.
    ///
    /// # Errors
    /// [`Error::CorruptModel`], [`Error::LengthMismatch`], [`Error::IndexOutOfRange`], and the errors of
    /// [`Classifier::check`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        require_sound(!self.names.actuators.is_empty(), "there is no actuator")?;
        for stage in &self.stages {
            stage.model.check()?;
            same_length("columns of a stage", stage.model.features(), stage.columns.len())?;
            same_length("classes of a stage", stage.model.classes(), stage.classes.len())?;
            let features = self.names.features.len() as u32;
            let known = stage.columns.iter().all(|&column| column < features);
            require_sound(known, "a stage reads a feature that is not there")?;
            let names = match stage.place.question {
                Question::Actuator => &self.names.actuators,
                Question::Action => &self.names.actions,
                Question::Detail => &self.names.details,
            };
            // A has the additional class healthy.
            let count = names.len() + usize::from(stage.place.question == Question::Actuator);
            let known = stage.classes.iter().all(|&class| (class as usize) < count);
            require_sound(known, "a stage decides a class that is not there")?;
            require_sound(stage.temperature > 0.0, "a stage's temperature is not above zero")?;
        }
        Ok(())
    }
}
