//! The classifiers against scikit-learn, on its public tables and the same folds.
//!
//! The golden files are written by peers/sklearn_classifiers.py.

use crate::tables::{golden, golden_table, log_loss, select_columns, select_rows, splits_by_fold};
use servotwin_diagnosis::classifiers::{ALL, Classifier, ClassifierKind};
use servotwin_diagnosis::tree::Tree;
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{Fit, Settings, cart, predict};
use servotwin_learning::splits::Split;
use servotwin_learning::tree::Criterion;

/// Largest difference of mean accuracies.
const TWO_POINTS: f64 = 0.02;

/// The settings of the peer script.
fn settings(kind: ClassifierKind) -> Settings {
    let mut settings = Settings::default_of(kind);
    match &mut settings {
        Settings::Mlp(mlp) => mlp.max_epochs = 50,
        Settings::Adaboost(boost) => boost.max_depth = Some(3),
        _ => {}
    }
    settings
}

fn mean_accuracy(kind: ClassifierKind, samples: &Samples, splits: &[Split]) -> f64 {
    let accuracy = |split: &Split| {
        let model = settings(kind).fit(&select_rows(samples, &split.train)).unwrap();
        let test = select_rows(samples, &split.test);
        let said = predict(&model, &test).unwrap();
        let right = said.iter().zip(test.labels()).filter(|(said, label)| said == label).count();
        right as f64 / said.len() as f64
    };
    splits.iter().map(accuracy).sum::<f64>() / splits.len() as f64
}

fn compare_accuracies(table: &str) {
    let (samples, folds) = golden_table(table);
    let splits = splits_by_fold(&folds, 5);
    let (_, records) = golden("sklearn_accuracy.csv");
    let mut worse = vec![];
    for &kind in ALL {
        let record = records.iter().find(|r| r[0] == table && r[1] == kind.id()).unwrap();
        let theirs: f64 = record[2].parse().unwrap();
        let ours = mean_accuracy(kind, &samples, &splits);
        println!("{table:15} {:20} sklearn {theirs:.4} ours {ours:.4}", kind.id());
        if (ours - theirs).abs() > TWO_POINTS {
            worse.push(format!("{}: sklearn {theirs:.4}, ours {ours:.4}", kind.id()));
        }
    }
    assert!(worse.is_empty(), "{table}: {worse:?}");
}

/// Mean log loss of the probabilities of rows held out.
fn mean_log_loss(kind: ClassifierKind, samples: &Samples, splits: &[Split]) -> f64 {
    let of_split = |split: &Split| {
        let model = settings(kind).fit(&select_rows(samples, &split.train)).unwrap();
        let mut shares = vec![0.0; split.test.len() * samples.classes()];
        let mut values = vec![0.0; samples.features()];
        for (&row, scores) in split.test.iter().zip(shares.chunks_exact_mut(samples.classes())) {
            samples.row_into(row, &mut values);
            model.scores_into(&values, scores);
        }
        let labels: Vec<u32> = split.test.iter().map(|&row| samples.labels()[row]).collect();
        log_loss(&shares, &labels)
    };
    splits.iter().map(of_split).sum::<f64>() / splits.len() as f64
}

/// Boosted trees may lose a tenth more than scikit-learn's, which have a tree for every class in
/// each round: up to ten times as many.
#[test]
fn val_sklearn_log_loss_of_boosted_trees() {
    for record in golden("sklearn_log_loss.csv").1 {
        let (samples, folds) = golden_table(&record[0]);
        let theirs: f64 = record[2].parse().unwrap();
        let ours =
            mean_log_loss(ClassifierKind::BoostedTrees, &samples, &splits_by_fold(&folds, 5));
        println!("{:15} sklearn {theirs:.4} ours {ours:.4}", &record[0]);
        assert!(ours < 1.1 * theirs, "{}: sklearn {theirs:.4}, ours {ours:.4}", record[0]);
    }
}

#[test]
fn val_sklearn_accuracy_breast_cancer() {
    compare_accuracies("breast_cancer");
}

#[test]
fn val_sklearn_accuracy_wine() {
    compare_accuracies("wine");
}

#[test]
fn val_sklearn_accuracy_digits() {
    compare_accuracies("digits");
}

/// Trains the tree of a case `table/first features/criterion/max_depth/min_samples_leaf`.
fn tree_of(case: &str) -> Tree {
    let parts: Vec<&str> = case.split('/').collect();
    let number = |place: usize| parts[place].parse::<usize>().unwrap();
    let (samples, _) = golden_table(parts[0]);
    let columns: Vec<usize> = (0..number(1)).collect();
    let criterion = if parts[2] == "gini" { Criterion::Gini } else { Criterion::Entropy };
    let settings = cart::Settings {
        criterion,
        max_depth: Some(number(3)),
        min_samples_leaf: number(4),
        ..Default::default()
    };
    settings.fit(&select_columns(&samples, &columns)).unwrap()
}

/// The records of each case, in the order of the file.
fn cases(file: &str) -> Vec<(String, Vec<Vec<String>>)> {
    let mut cases: Vec<(String, Vec<Vec<String>>)> = vec![];
    for record in golden(file).1 {
        match cases.last_mut().filter(|(case, _)| *case == record[0]) {
            Some((_, records)) => records.push(record),
            None => cases.push((record[0].clone(), vec![record])),
        }
    }
    cases
}

#[test]
fn val_sklearn_cart_trees_are_identical() {
    for (case, records) in cases("sklearn_cart_trees.csv") {
        let tree = tree_of(&case);
        assert_eq!(tree.nodes(), records.len(), "{case}");
        for (node, record) in records.iter().enumerate() {
            let counts: Vec<u32> = record[6].split(' ').map(|c| c.parse().unwrap()).collect();
            assert_eq!(tree.counts(node), counts, "{case}, node {node}");
            let impurity: f64 = record[5].parse().unwrap();
            assert!((tree.impurity(node) - impurity).abs() < 1e-12, "{case}, node {node}");
            let feature: i64 = record[1].parse().unwrap();
            let Some((our_feature, our_threshold)) = tree.split(node) else {
                assert!(feature < 0, "{case}, node {node}");
                continue;
            };
            assert_eq!(our_feature as i64, feature, "{case}, node {node}");
            // scikit-learn rounds features to single precision.
            let threshold: f64 = record[2].parse().unwrap();
            assert!((our_threshold - threshold).abs() <= 1e-6 * threshold.abs(), "{case} {node}");
            let children = (record[3].parse().unwrap(), record[4].parse().unwrap());
            assert_eq!(tree.children(node), Some(children), "{case}, node {node}");
        }
    }
}
