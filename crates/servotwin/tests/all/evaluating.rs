//! What a study says of training and judging goes before what is usual.

use servotwin::job::Subject;
use servotwin::learn::EvaluationSettings;
use servotwin::study::{Scenario, Study};
use servotwin_learning::classifiers::Settings as Classifier;
use servotwin_learning::tree::Criterion;

/// The paper's study, which has every scenario, with a section.
fn study(section: &str) -> Study {
    let text = include_str!("../../../../studies/paper.toml");
    Study::parse(&format!("{text}\n[evaluation]\n{section}"), "paper.toml").unwrap()
}

fn settings(section: &str) -> Vec<(Subject, EvaluationSettings)> {
    let study = study(section);
    Subject::ALL.into_iter().map(|subject| (subject, subject.settings(&study))).collect()
}

#[test]
fn a_study_without_the_section_or_with_an_empty_one_has_what_is_usual() {
    let study = Study::default();
    let usual: Vec<(Subject, EvaluationSettings)> =
        Subject::ALL.into_iter().map(|subject| (subject, subject.settings(&study))).collect();
    assert_eq!(usual, settings(""));
    // What the book says is usual, said.
    let said = "seed = 1\nrandom_thirds = 3\nfolds = 5\nlearned_bands = [\"fitted\", \"realistic\"]\n\
        classifiers = [\"ideal\"]\ncomparison = { random_thirds = 1, folds = 3 }\n\
        committee = { trees = 60, depth = 4, learning_rate = 0.15, feature_share = 0.3 }\n\
        trees.ideal = { criterion = \"entropy\", depth = 7, leaf_rows = 1 }\n\
        trees.noise = { criterion = \"entropy\", depth = 7, leaf_rows = 1 }\n\
        trees.fitted = { criterion = \"entropy\", depth = 10, leaf_rows = 1 }\n\
        trees.realistic = { criterion = \"gini\", depth = 9, leaf_rows = 1 }\n";
    assert_eq!(usual, settings(said));
}

#[test]
fn what_is_said_changes_that_and_nothing_else() {
    let usual = settings("");
    let asked = settings(
        "seed = 7\nfolds = 4\nlearned_bands = [\"noise\"]\nclassifiers = [\"noise\", \"realistic\"]\n\
         comparison.random_thirds = 2\ncommittee.trees = 5\n\
         trees.noise = { criterion = \"gini\", depth = 3, leaf_rows = 4 }\n",
    );
    for ((subject, usual), (_, asked)) in usual.into_iter().zip(asked) {
        let mut expected = usual.clone();
        (expected.holding.seed, expected.holding.folds) = (7, 4);
        (expected.comparison_holding.seed, expected.comparison_holding.repeats) = (7, 2);
        let scenario = subject.scenario();
        expected.learned_bands = scenario == Scenario::Noise;
        // The third sensor is not what classifiers are compared on.
        let is_compared = matches!(subject, Subject::Noise | Subject::Realistic);
        assert_eq!(!asked.classifiers.is_empty(), is_compared, "{subject:?}");
        expected.classifiers = asked.classifiers.clone();
        let committee = &mut expected.committee;
        for stage in [&mut committee.actuator, &mut committee.action, &mut committee.detail] {
            let Classifier::BoostedTrees(boosted) = stage else { panic!("{stage:?}") };
            boosted.trees = 5;
        }
        let trees = &mut expected.training;
        for stage in [&mut trees.actuator, &mut trees.action, &mut trees.detail] {
            let Classifier::Cart(tree) = stage else { panic!("{stage:?}") };
            if scenario == Scenario::Noise {
                tree.criterion = Criterion::Gini;
                (tree.max_depth, tree.min_samples_leaf) = (Some(3), 4);
            }
        }
        assert_eq!(asked, expected, "{subject:?}");
    }
}
