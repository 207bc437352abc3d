//! The study's settings of training and evaluation. Missing ones take the usual values in `job::Subject`.

use super::Scenario;
use super::keys::{SEED, SOME_SPECIMENS};
use super::reader::{Noted, Reader};
use crate::format::{At, Names, Value, section, words};
use servotwin_learning::classifiers::boosted_trees::{MAX_DEPTH, MAX_TREES};
use servotwin_learning::tree::Criterion;

words!(Criterion, [("gini", Criterion::Gini), ("entropy", Criterion::Entropy)].into_iter());

section! {
    /// A study's settings of training and evaluation; `None` means the usual value.
    #[derive(Default)]
    pub(crate) struct Evaluating {
        may pub(crate) seed: Option<u64> = SEED, "seed of the splits into training and test";
        may pub(crate) random_thirds: Option<usize> = ROUNDS,
            "number of repeats that hold out a random third";
        may pub(crate) folds: Option<usize> = FOLDS, "number of folds that hold out kinds and intensities";
        may pub(crate) learned_bands: Option<At<Vec<At<Scenario>>>>,
            "scenarios with learned bands; the others use 3 %";
        may pub(crate) classifiers: Option<At<Vec<At<Scenario>>>>,
            "scenarios in which classifiers are compared";
        may pub(crate) comparison: Rounds, "how the comparison of classifiers holds out rows";
        may pub(crate) committee: Boosting, "committee of boosted trees";
        may pub(crate) trees: Names<Growing>, "the nine trees of each scenario";
    }
}

section! {
    /// How the nine trees are grown.
    #[derive(Copy, Default)]
    pub struct Growing {
        may pub(crate) criterion: Option<Criterion>, "measure of impurity";
        may pub(crate) depth: Option<usize> = Value::Whole(1.0, 100.0),
            "maximum number of questions on a path";
        may pub(crate) leaf_rows: Option<usize> = SOME_SPECIMENS, "minimum number of rows in a leaf";
    }
}

const ROUNDS: Value = Value::Whole(1.0, 1000.0);
const FOLDS: Value = Value::Whole(2.0, 1000.0);

section! {
    /// How often rows are held out.
    #[derive(Copy, Default)]
    pub(crate) struct Rounds {
        may pub(crate) random_thirds: Option<usize> = ROUNDS,
            "number of repeats that hold out a random third";
        may pub(crate) folds: Option<usize> = FOLDS, "number of folds that hold out kinds and intensities";
    }
}

section! {
    /// How the committee's boosted trees are grown.
    #[derive(Copy, Default)]
    pub(crate) struct Boosting {
        may pub(crate) trees: Option<usize> = Value::Whole(1.0, MAX_TREES as f64),
            "number of trees at each stage of the hierarchy";
        may pub(crate) depth: Option<usize> = Value::Whole(1.0, MAX_DEPTH as f64),
            "maximum number of questions on a path";
        may pub(crate) learning_rate: Option<f64> = Value::Number(1e-3, 1.0, ""),
            "factor on the contribution of each tree";
        may pub(crate) feature_share: Option<f64> = Value::Number(1e-3, 1.0, ""),
            "share of the features that each tree may use";
    }
}

impl Evaluating {
    /// Checks that the study can have the scenarios, and healthy specimens in training where bands are learned.
    pub(super) fn check(&self, reader: &Reader) -> Result<(), Noted> {
        let text = reader.text;
        let is_there = |scenario: &Scenario| match scenario {
            Scenario::Ideal => true,
            Scenario::Noise | Scenario::Realistic => text.realistic.is_some(),
            Scenario::Fitted => text.realistic.is_some() && text.fitted.is_some(),
        };
        let known = || Scenario::ALL.into_iter().filter(is_there).map(Scenario::name);
        let lists = [&self.learned_bands, &self.classifiers].into_iter().flatten();
        let listed = lists.flat_map(|list| &list.value);
        let listed = listed.map(|scenario| (scenario.name(), &scenario.at));
        let is_known = |name: &str| known().any(|known| known == name);
        let mut result = Ok(());
        for (name, at) in listed.chain(self.trees.keys().map(|name| (name.as_str(), &name.at))) {
            if !is_known(name) {
                let what = ("scenario in this study", name);
                result = Err(reader.unknown(at, what, known()));
            }
        }
        let is_learned = |bands: &&At<Vec<At<Scenario>>>| {
            !bands.is_empty() && bands.iter().all(|band| is_known(band.name()))
        };
        if let Some(bands) = self.learned_bands.as_ref().filter(is_learned)
            && text.training.as_ref().is_none_or(|training| training.healthy == 0)
        {
            result = Err(reader.empty(&bands.at, "training.healthy"));
        }
        result
    }
}
