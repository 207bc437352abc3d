//! The study's settings of training and evaluation. Missing ones take the usual values in `job::Subject`.
//!
//! ```toml
//! [evaluation]
//! seed = 1                              # of the splits into training and test
//! random_thirds = 3                     # repeats with a random third held out
//! folds = 5                             # parts for holding out kinds and intensities
//! learned_bands = ["realistic"]         # scenarios with bands from healthy specimens; others use 3 %
//! classifiers = ["ideal"]               # scenarios in which classifiers are compared
//! comparison = { random_thirds = 1, folds = 3 }
//! committee = { trees = 60, depth = 4 }
//! trees.realistic = { criterion = "gini", depth = 9 }
//! ```

use super::Scenario;
use super::keys::{SCENARIOS, SEED, SOME_SPECIMENS};
use super::reader::{Noted, Reader};
use crate::document::KeyPath;
use crate::format::{Value, section};
use servotwin_learning::classifiers::boosted_trees::{MAX_DEPTH, MAX_TREES};
use servotwin_learning::tree::Criterion;
use std::collections::BTreeMap;

/// The words for [`Criterion`] in a study file.
const CRITERIA: [(&str, Criterion); 2] =
    [("gini", Criterion::Gini), ("entropy", Criterion::Entropy)];

section! {
    /// The section of a study file.
    #[derive(Default)]
    #[serde(default)]
    pub(super) struct Text {
        may seed: Option<u64> = SEED, "seed of the splits into training and test";
        may random_thirds: Option<usize> = ROUNDS, "number of repeats that hold out a random third";
        may folds: Option<usize> = FOLDS, "number of folds that hold out kinds and intensities";
        may learned_bands: Option<Vec<String>> = SCENARIOS,
            "scenarios with learned bands; the others use 3 %";
        may classifiers: Option<Vec<String>> = SCENARIOS,
            "scenarios in which classifiers are compared";
        may comparison: Rounds, "how the comparison of classifiers holds out rows";
        may committee: Boosting, "committee of boosted trees";
        may trees: BTreeMap<String, TreesText>, "the nine trees of each scenario";
    }
}

section! {
    #[derive(Default)]
    #[serde(default)]
    struct TreesText {
        may criterion: Option<String> = Value::Word(criteria), "measure of impurity";
        may depth: Option<usize> = Value::Whole(1.0, 100.0),
            "maximum number of questions on a path";
        may leaf_rows: Option<usize> = SOME_SPECIMENS, "minimum number of rows in a leaf";
    }
}

const ROUNDS: Value = Value::Whole(1.0, 1000.0);
const FOLDS: Value = Value::Whole(2.0, 1000.0);

/// A study's settings of training and evaluation; `None` means the usual value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evaluating {
    /// The seed of the splits into training and test.
    pub seed: Option<u64>,
    /// How often each protocol holds rows out.
    pub rounds: Rounds,
    /// The scenarios with bands learned from healthy specimens. The others use the seed paper's band.
    pub learned_bands: Option<Vec<Scenario>>,
    /// The scenarios in which classifiers are compared.
    pub classifiers: Option<Vec<Scenario>>,
    /// How often the comparison of classifiers holds rows out.
    pub comparison: Rounds,
    /// How the committee's boosted trees are grown.
    pub committee: Boosting,
    /// How the nine trees of a scenario are grown.
    pub trees: BTreeMap<Scenario, Growing>,
}

section! {
    /// How often rows are held out.
    #[derive(Copy, Default, PartialEq)]
    #[serde(default)]
    pub struct Rounds {
        may pub random_thirds: Option<usize> = ROUNDS,
            "number of repeats that hold out a random third";
        may pub folds: Option<usize> = FOLDS, "number of folds that hold out kinds and intensities";
    }
}

section! {
    /// How the committee's boosted trees are grown.
    #[derive(Copy, Default, PartialEq)]
    #[serde(default)]
    pub struct Boosting {
        may pub trees: Option<usize> = Value::Whole(1.0, MAX_TREES as f64),
            "number of trees at each stage of the hierarchy";
        may pub depth: Option<usize> = Value::Whole(1.0, MAX_DEPTH as f64),
            "maximum number of questions on a path";
        may pub learning_rate: Option<f64> = Value::Number(1e-3, 1.0, ""),
            "factor on the contribution of each tree";
        may pub feature_share: Option<f64> = Value::Number(1e-3, 1.0, ""),
            "share of the features that each tree may use";
    }
}

/// How the nine trees are grown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Growing {
    /// The measure of impurity.
    pub criterion: Option<Criterion>,
    /// The maximum number of questions on a path.
    pub depth: Option<usize>,
    /// The minimum number of rows on each side of a question.
    pub leaf_rows: Option<usize>,
}

/// Lists the words for criteria.
pub(super) fn criteria() -> Vec<&'static str> {
    CRITERIA.iter().map(|(word, _)| *word).collect()
}

/// Lists the words for scenarios.
pub(super) fn scenarios() -> Vec<&'static str> {
    Scenario::ALL.iter().map(|scenario| scenario.name()).collect()
}

impl Evaluating {
    pub(super) fn new(text: &Text, reader: &Reader) -> Result<Self, Noted> {
        let listed = |key: &str, names: &Option<Vec<String>>| {
            let list = KeyPath::of(&["evaluation", key]);
            let one = |(n, name): (usize, &String)| scenario(reader, &list.element(n), name);
            let of = |names: &Vec<String>| all(names.iter().enumerate().map(one));
            names.as_ref().map(of).transpose()
        };
        let learned_bands = listed("learned_bands", &text.learned_bands);
        let classifiers = listed("classifiers", &text.classifiers);
        let trees = all(text.trees.iter().map(|(name, text)| {
            let at = KeyPath::of(&["evaluation", "trees", name]);
            Ok((scenario(reader, &at.name(), name)?, text.growing(&at, reader)?))
        }));
        let learned_bands = learned_bands?;
        if learned_bands.as_ref().is_some_and(|bands| !bands.is_empty()) {
            needs_healthy(reader)?;
        }
        Ok(Evaluating {
            seed: text.seed,
            rounds: Rounds { random_thirds: text.random_thirds, folds: text.folds },
            learned_bands,
            classifiers: classifiers?,
            comparison: text.comparison,
            committee: text.committee,
            trees: trees?.into_iter().collect(),
        })
    }
}

impl TreesText {
    fn growing(&self, at: &KeyPath, reader: &Reader) -> Result<Growing, Noted> {
        let of = |word: &String| {
            let known = CRITERIA.iter().find(|(known, _)| known == word);
            let unknown = || reader.unknown(&at.key("criterion"), "criterion", word, criteria());
            known.map(|(_, criterion)| *criterion).ok_or_else(unknown)
        };
        let criterion = self.criterion.as_ref().map(of).transpose()?;
        Ok(Growing { criterion, depth: self.depth, leaf_rows: self.leaf_rows })
    }
}

/// Finds a scenario by name among those that the study can have.
fn scenario(reader: &Reader, at: &KeyPath, name: &str) -> Result<Scenario, Noted> {
    let text = reader.text;
    let is_there = |scenario: &Scenario| match scenario {
        Scenario::Ideal => true,
        Scenario::Noise | Scenario::Realistic => text.realistic.is_some(),
        Scenario::Fitted => text.realistic.is_some() && text.fitted.is_some(),
    };
    let known: Vec<Scenario> = Scenario::ALL.into_iter().filter(is_there).collect();
    let found = known.iter().find(|scenario| scenario.name() == name).copied();
    let names = known.iter().map(|scenario| scenario.name());
    found.ok_or_else(|| reader.unknown(at, "scenario in this study", name, names))
}

/// Reports learned bands without healthy specimens in training, from which they are learned.
fn needs_healthy(reader: &Reader) -> Result<(), Noted> {
    match reader.text.training.as_ref().is_some_and(|training| training.has_healthy()) {
        true => Ok(()),
        false => {
            Err(reader.empty(&KeyPath::of(&["evaluation", "learned_bands"]), "training.healthy"))
        }
    }
}

/// Evaluates all results, so that every mistake is noted, and then collects them.
fn all<T>(results: impl Iterator<Item = Result<T, Noted>>) -> Result<Vec<T>, Noted> {
    results.collect::<Vec<_>>().into_iter().collect()
}
