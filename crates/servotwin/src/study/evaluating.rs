//! How the diagnosis is trained and judged, as far as a study says so. What it does not say is as
//! `job::Subject` has it.
//!
//! ```toml
//! [evaluation]
//! seed = 1                              # of splits into training and test
//! random_thirds = 3                     # how often a random third is held out
//! folds = 5                             # in how many parts kinds and intensities are held out
//! learned_bands = ["realistic"]         # settings whose bands healthy specimens teach; elsewhere 3 %
//! classifiers = ["ideal"]               # settings in which classifiers are compared
//! comparison = { random_thirds = 1, folds = 3 }
//! ablation = ["realistic"]              # settings in which parts are taken away
//! committee = { trees = 60, depth = 4 }
//! trees.realistic = { criterion = "gini", depth = 9 }
//! ```

use super::Setting;
use super::reader::{Noted, Reader};
use crate::document::Place;
use serde::Deserialize;
use servotwin_learning::tree::Criterion;
use std::collections::BTreeMap;

/// The words for [`Criterion`].
const CRITERIA: [(&str, Criterion); 2] =
    [("gini", Criterion::Gini), ("entropy", Criterion::Entropy)];

/// The section of a study file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Text {
    seed: Option<u64>,
    random_thirds: Option<usize>,
    folds: Option<usize>,
    learned_bands: Option<Vec<String>>,
    classifiers: Option<Vec<String>>,
    comparison: Rounds,
    ablation: Option<Vec<String>>,
    committee: Boosting,
    trees: BTreeMap<String, TreesText>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct TreesText {
    criterion: Option<String>,
    depth: Option<usize>,
    leaf_rows: Option<usize>,
}

/// What a study says of training and judging; `None` is what is usual.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evaluating {
    /// The seed of splits into training and test.
    pub seed: Option<u64>,
    /// How often rows are held out.
    pub rounds: Rounds,
    /// The settings whose bands are learned from healthy specimens; in the others the paper's counts.
    pub learned_bands: Option<Vec<Setting>>,
    /// The settings in which classifiers are compared.
    pub classifiers: Option<Vec<Setting>>,
    /// How often rows are held out there.
    pub comparison: Rounds,
    /// The settings in which parts are taken away.
    pub ablation: Option<Vec<Setting>>,
    /// The committee.
    pub committee: Boosting,
    /// The nine trees of a setting.
    pub trees: BTreeMap<Setting, Growing>,
}

/// How often rows are held out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rounds {
    /// Number of random thirds.
    pub random_thirds: Option<usize>,
    /// Number of folds of groups.
    pub folds: Option<usize>,
}

/// How the committee's boosted trees are grown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Boosting {
    /// Number of trees at each place of the hierarchy.
    pub trees: Option<usize>,
    /// Questions on the longest way.
    pub depth: Option<usize>,
    /// Factor on what each tree adds.
    pub learning_rate: Option<f64>,
    /// Share of the features from which each tree may choose.
    pub feature_share: Option<f64>,
}

/// How the nine trees are grown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Growing {
    /// The measure of impurity.
    pub criterion: Option<Criterion>,
    /// Questions on the longest way.
    pub depth: Option<usize>,
    /// Rows on both sides of every question, at least.
    pub leaf_rows: Option<usize>,
}

/// The words for criteria.
pub(super) fn criteria() -> Vec<&'static str> {
    CRITERIA.iter().map(|(word, _)| *word).collect()
}

/// The words for settings.
pub(super) fn settings() -> Vec<&'static str> {
    Setting::ALL.iter().map(|setting| setting.name()).collect()
}

impl Evaluating {
    pub(super) fn new(text: &Text, reader: &Reader) -> Result<Self, Noted> {
        let listed = |key: &str, names: &Option<Vec<String>>| {
            let list = Place::of(&["evaluation", key]);
            let one = |(n, name): (usize, &String)| setting(reader, &list.element(n), name);
            let of = |names: &Vec<String>| all(names.iter().enumerate().map(one));
            names.as_ref().map(of).transpose()
        };
        let learned_bands = listed("learned_bands", &text.learned_bands);
        let classifiers = listed("classifiers", &text.classifiers);
        let ablation = listed("ablation", &text.ablation);
        let trees = all(text.trees.iter().map(|(name, text)| {
            let at = Place::of(&["evaluation", "trees", name]);
            Ok((setting(reader, &at.name(), name)?, text.growing(&at, reader)?))
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
            ablation: ablation?,
            committee: text.committee,
            trees: trees?.into_iter().collect(),
        })
    }
}

impl TreesText {
    fn growing(&self, at: &Place, reader: &Reader) -> Result<Growing, Noted> {
        let of = |word: &String| {
            let known = CRITERIA.iter().find(|(known, _)| known == word);
            let unknown = || reader.unknown(&at.key("criterion"), "criterion", word, criteria());
            known.map(|(_, criterion)| *criterion).ok_or_else(unknown)
        };
        let criterion = self.criterion.as_ref().map(of).transpose()?;
        Ok(Growing { criterion, depth: self.depth, leaf_rows: self.leaf_rows })
    }
}

/// A setting of the study.
fn setting(reader: &Reader, at: &Place, name: &str) -> Result<Setting, Noted> {
    let text = reader.text;
    let is_there = |setting: &Setting| match setting {
        Setting::Ideal => true,
        Setting::Noise | Setting::Realistic => text.realistic.is_some(),
        Setting::Fitted => text.realistic.is_some() && text.fitted.is_some(),
    };
    let known: Vec<Setting> = Setting::ALL.into_iter().filter(is_there).collect();
    let found = known.iter().find(|setting| setting.name() == name).copied();
    let names = known.iter().map(|setting| setting.name());
    found.ok_or_else(|| reader.unknown(at, "setting in this study", name, names))
}

/// Bands are learned from healthy specimens that fly training commands.
fn needs_healthy(reader: &Reader) -> Result<(), Noted> {
    match reader.text.training.as_ref().is_some_and(|training| training.has_healthy()) {
        true => Ok(()),
        false => {
            Err(reader.empty(&Place::of(&["evaluation", "learned_bands"]), "training.healthy"))
        }
    }
}

/// All results, each of them looked at.
fn all<T>(results: impl Iterator<Item = Result<T, Noted>>) -> Result<Vec<T>, Noted> {
    results.collect::<Vec<_>>().into_iter().collect()
}
