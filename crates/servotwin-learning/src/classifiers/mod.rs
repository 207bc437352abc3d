//! Training of the classifiers, one file each, behind one trait.
//!
//! A file holds `Settings` (serializable, with defaults) that implement [`Fit`]. To add a classifier, write and declare
//! its file, and add one line to the list below.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::samples::Samples;
use servotwin_diagnosis::classifiers::{Classifier, ClassifierKind, Model};
use servotwin_diagnosis::error::{Error, same_length};

pub mod adaboost;
pub mod boosted_trees;
pub mod cart;
pub(crate) mod linear_discriminant;
pub(crate) mod linear_svm;
pub(crate) mod logistic_regression;
pub(crate) mod mlp;
pub(crate) mod naive_bayes;
pub(crate) mod random_forest;

mod linear;

/// Settings from which a model is trained.
pub trait Fit {
    /// The trained model.
    type Model: Classifier;

    /// Trains a model. The same samples and settings give the same model bit for bit.
    ///
    /// # Errors
    /// [`Error::SettingOutOfRange`], [`Error::Missing`] unless the classifier is [`cart`], `random_forest` or
    /// `adaboost`, and errors of the classifier.
    fn fit(&self, samples: &Samples) -> Result<Self::Model, Error>;
}

macro_rules! classifiers {
    ($($file:ident $kind:ident,)*) => {
        /// Settings of any classifier; in a file, `kind` names it.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "snake_case")]
        #[expect(missing_docs, reason = "each variant is named like its `Kind`")]
        pub enum Settings {
            $($kind($file::Settings),)*
        }

        impl Settings {
            /// The default settings of a classifier in a study.
            pub fn default_of(kind: ClassifierKind) -> Self {
                match kind {
                    $(ClassifierKind::$kind => Settings::$kind(Default::default()),)*
                }
            }

            /// The kind of classifier.
            pub fn kind(&self) -> ClassifierKind {
                match self {
                    $(Settings::$kind(_) => ClassifierKind::$kind,)*
                }
            }
        }

        impl Fit for Settings {
            type Model = Model;

            fn fit(&self, samples: &Samples) -> Result<Model, Error> {
                match self {
                    $(Settings::$kind(settings) => settings.fit(samples).map(Model::$kind),)*
                }
            }
        }
    };
}

classifiers! {
    linear_svm LinearSvm,
    cart Cart,
    mlp Mlp,
    naive_bayes NaiveBayes,
    random_forest RandomForest,
    linear_discriminant LinearDiscriminant,
    adaboost Adaboost,
    logistic_regression LogisticRegression,
    boosted_trees BoostedTrees,
}

/// The predicted class for every row of a table.
///
/// # Errors
/// [`Error::LengthMismatch`] if the table has another number of features.
pub fn predict(model: &impl Classifier, samples: &Samples) -> Result<Vec<u32>, Error> {
    same_length("features", model.features(), samples.features())?;
    let mut row_values = vec![0.0; samples.features()];
    let mut scratch = vec![0.0; model.classes()];
    let predict_row = |row| {
        samples.row_into(row, &mut row_values);
        model.predict_with(&row_values, &mut scratch)
    };
    Ok((0..samples.rows()).map(predict_row).collect())
}
