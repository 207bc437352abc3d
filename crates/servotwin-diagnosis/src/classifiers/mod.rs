//! The classifiers, one file each, behind one trait.
//!
//! A classifier file holds its trained `Model`, plain data that implements [`Classifier`]. The crate
//! `servotwin-learning` trains it. To add one, write and declare both files, and add one line to the list below and to
//! the one there. The contract tests then cover it.

use alloc::vec;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::numeric::arg_max;

pub mod adaboost;
pub mod boosted_trees;
pub mod cart;
pub mod linear_discriminant;
pub mod linear_svm;
pub mod logistic_regression;
pub mod mlp;
pub mod naive_bayes;
pub mod random_forest;

pub mod linear;

/// What the scores of a classifier mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scores {
    /// Nonnegative, with sum one: probabilities or shares of votes, not calibrated.
    Shares,
    /// Signed distances from each class's border, without a common scale.
    Margins,
}

/// A trained model.
///
/// Rows must be finite, or NaN for a missing value if the model was trained with such rows. Any
/// other NaN never panics, but the prediction is then arbitrary.
pub trait Classifier {
    /// Number of features in a row.
    fn features(&self) -> usize;

    /// Number of classes, including those without training rows.
    fn classes(&self) -> usize;

    /// What the scores mean.
    fn scores(&self) -> Scores {
        Scores::Shares
    }

    /// Writes one score per class; the predicted class has the largest. Does not allocate.
    ///
    /// # Panics
    /// If `row` is shorter than [`Classifier::features`] or `scores` is not as long as
    /// [`Classifier::classes`]. `servotwin_learning::classifiers::predict` checks first.
    fn scores_into(&self, row: &[f64], scores: &mut [f64]);

    /// The predicted class, the lowest in a tie. Does not allocate; `scratch` has one entry per class and may hold the
    /// scores afterwards.
    ///
    /// # Panics
    /// As [`Classifier::scores_into`].
    fn predict_with(&self, row: &[f64], scratch: &mut [f64]) -> u32 {
        self.scores_into(row, scratch);
        arg_max(scratch.iter().copied()) as u32
    }

    /// The predicted class. Allocates a scratch row; use [`Classifier::predict_with`] in a loop.
    ///
    /// # Panics
    /// As [`Classifier::scores_into`].
    fn predict_row(&self, row: &[f64]) -> u32 {
        self.predict_with(row, &mut vec![0.0; self.classes()])
    }

    /// Checks that the parts of a loaded model fit together.
    ///
    /// # Errors
    /// [`Error::CorruptModel`] or [`Error::LengthMismatch`].
    fn check(&self) -> Result<(), Error>;
}

/// The sizes of a model that are fields of it, or of one of its fields.
macro_rules! sizes {
    ($($part:ident)?) => {
        fn features(&self) -> usize {
            self.$($part.)?features
        }

        fn classes(&self) -> usize {
            self.$($part.)?classes
        }
    };
}
use sizes;

macro_rules! classifiers {
    ($($file:ident $kind:ident $title:literal,)*) => {
        /// The kinds of classifier.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ClassifierKind {
            $(#[doc = $title] $kind,)*
        }

        /// Every kind of classifier, in the order of the reports.
        pub const ALL: &[ClassifierKind] = &[$(ClassifierKind::$kind,)*];

        impl ClassifierKind {
            /// The stable name of the kind in files: that of its source file.
            pub fn id(self) -> &'static str {
                match self {
                    $(ClassifierKind::$kind => stringify!($file),)*
                }
            }

            /// The name to show.
            pub fn title(self) -> &'static str {
                match self {
                    $(ClassifierKind::$kind => $title,)*
                }
            }
        }

        /// A trained model of any kind.
        // A hierarchy holds few models, and a boxed tree costs another indirection per answer.
        #[allow(clippy::large_enum_variant)]
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Model {
            $(#[doc = $title] $kind($file::Model),)*
        }

        impl Model {
            /// Which classifier it is.
            pub fn kind(&self) -> ClassifierKind {
                match self {
                    $(Model::$kind(_) => ClassifierKind::$kind,)*
                }
            }

            fn inner(&self) -> &dyn Classifier {
                match self {
                    $(Model::$kind(model) => model,)*
                }
            }
        }
    };
}

// The one list: source file, kind, title.
classifiers! {
    linear_svm LinearSvm "Linear support vector",
    cart Cart "Decision tree (CART)",
    mlp Mlp "Multi-layer perceptron",
    naive_bayes NaiveBayes "Gaussian naive Bayes",
    random_forest RandomForest "Random forest",
    linear_discriminant LinearDiscriminant "Linear discriminant analysis",
    adaboost Adaboost "AdaBoost",
    logistic_regression LogisticRegression "Logistic regression",
    boosted_trees BoostedTrees "Gradient-boosted trees",
}

impl Classifier for Model {
    fn features(&self) -> usize {
        self.inner().features()
    }

    fn classes(&self) -> usize {
        self.inner().classes()
    }

    fn scores(&self) -> Scores {
        self.inner().scores()
    }

    fn scores_into(&self, row: &[f64], scores: &mut [f64]) {
        self.inner().scores_into(row, scores);
    }

    fn predict_with(&self, row: &[f64], scratch: &mut [f64]) -> u32 {
        self.inner().predict_with(row, scratch)
    }

    fn check(&self) -> Result<(), Error> {
        self.inner().check()
    }
}
