//! CART: what every grown tree promises.

use crate::tables::{golden_table, samples, select_columns};
use proptest::prelude::*;
use servotwin_diagnosis::classifiers::Classifier;
use servotwin_diagnosis::tree::Tree;
use servotwin_learning::Samples;
use servotwin_learning::classifiers::Fit;
use servotwin_learning::classifiers::cart::Settings;
use servotwin_learning::tree::Criterion;

fn grow(settings: Settings, samples: &Samples) -> Tree {
    settings.fit(samples).unwrap()
}

fn full(samples: &Samples) -> Tree {
    grow(Settings::default(), samples)
}

fn row_of(samples: &Samples, row: usize) -> Vec<f64> {
    let mut values = vec![0.0; samples.features()];
    samples.row_into(row, &mut values);
    values
}

/// The nodes that each row passes.
fn paths(tree: &Tree, samples: &Samples) -> Vec<Vec<usize>> {
    (0..samples.rows()).map(|row| tree.decision_path(&row_of(samples, row)).collect()).collect()
}

/// Few different values, so that ties and equal rows are common; weights may be zero.
fn any_samples() -> impl Strategy<Value = Samples> {
    (1usize..5, 1usize..40).prop_flat_map(|(features, rows)| {
        let value =
            prop_oneof![(-3i32..4).prop_map(f64::from), -1.0f64..1.0, Just(1e100), Just(5e-324)];
        let values = prop::collection::vec(value, features * rows);
        let labels = prop::collection::vec(0u32..3, rows);
        let weights = prop::collection::vec(0u32..4, rows);
        (values, labels, weights).prop_map(move |(values, labels, mut weights)| {
            weights[0] = weights[0].max(1);
            let rows: Vec<&[f64]> = values.chunks_exact(features).collect();
            let weights = weights.into_iter().map(|weight| f64::from(weight) / 2.0).collect();
            samples(&rows, &labels).with_weights(weights).unwrap()
        })
    })
}

fn any_settings() -> impl Strategy<Value = Settings> {
    let criterion = prop_oneof![Just(Criterion::Gini), Just(Criterion::Entropy)];
    let depth = prop::option::of(0usize..6);
    (criterion, depth, 2usize..8, 1usize..5, 0.0f64..0.05).prop_map(
        |(criterion, max_depth, min_samples_split, min_samples_leaf, min_impurity_decrease)| {
            Settings {
                criterion,
                max_depth,
                min_samples_split,
                min_samples_leaf,
                min_impurity_decrease,
                ..Default::default()
            }
        },
    )
}

/// Counts add up at every node and agree with where the rows really go.
fn check_counts(tree: &Tree, samples: &Samples) {
    let mut passed = vec![vec![0u32; samples.classes()]; tree.nodes()];
    for (row, path) in paths(tree, samples).into_iter().enumerate() {
        assert!(tree.split(*path.last().unwrap()).is_none(), "a path ends in a leaf");
        if samples.weight(row) > 0.0 {
            path.iter().for_each(|&node| passed[node][samples.labels()[row] as usize] += 1);
        }
    }
    for (node, passed) in passed.iter().enumerate() {
        assert_eq!(tree.counts(node), passed, "node {node}");
        if let Some((left, right)) = tree.children(node) {
            let sum = tree.weights(left).iter().zip(tree.weights(right)).map(|(l, r)| l + r);
            assert_eq!(tree.weights(node), sum.collect::<Vec<_>>(), "node {node}");
            assert_eq!(left, node + 1, "preorder");
        }
    }
}

fn check_settings_held(tree: &Tree, settings: &Settings) {
    assert!(settings.max_depth.is_none_or(|depth| tree.depth() <= depth));
    for node in 0..tree.nodes() {
        let rows: u32 = tree.counts(node).iter().sum();
        if node > 0 {
            assert!(rows as usize >= settings.min_samples_leaf);
        }
        if tree.split(node).is_some() {
            assert!(rows as usize >= settings.min_samples_split);
            assert!(tree.decrease(node) + 1e-12 >= settings.min_impurity_decrease);
        }
    }
}

proptest! {
    #[test]
    fn grown_trees_are_sound(samples in any_samples(), settings in any_settings()) {
        let tree = grow(settings.clone(), &samples);
        tree.check().unwrap();
        check_counts(&tree, &samples);
        check_settings_held(&tree, &settings);
        prop_assert_eq!(&tree, &grow(settings, &samples));
    }

    #[test]
    fn a_bin_for_every_value_changes_nothing(samples in any_samples(), settings in any_settings()) {
        let weights = (0..samples.rows()).map(|row| samples.weight(row).min(0.5) * 2.0).collect();
        let samples = samples.with_weights(weights).unwrap();
        let binned = Settings { max_bins: Some(64), ..settings.clone() };
        prop_assert_eq!(grow(binned, &samples), grow(settings, &samples));
    }

    #[test]
    fn binned_trees_are_sound(samples in any_samples(), settings in any_settings()) {
        let settings = Settings { max_bins: Some(3), ..settings };
        let tree = grow(settings.clone(), &samples);
        tree.check().unwrap();
        check_counts(&tree, &samples);
        check_settings_held(&tree, &settings);
    }

    #[test]
    fn full_trees_separate_all_that_differs(samples in any_samples()) {
        let tree = full(&samples);
        for leaf in tree.leaves().iter().filter(|leaf| leaf.purity < 1.0) {
            let in_leaf = |row: &usize| {
                samples.weight(*row) > 0.0
                    && tree.branches().leaf_of(&row_of(&samples, *row)) == leaf.node
            };
            let rows: Vec<usize> = (0..samples.rows()).filter(in_leaf).collect();
            let first = row_of(&samples, rows[0]);
            prop_assert!(rows.iter().all(|&row| row_of(&samples, row) == first));
        }
    }
}

#[test]
fn permuted_columns_permute_importances() {
    let (digits, _) = golden_table("digits");
    let order: Vec<usize> = (0..digits.features()).rev().collect();
    let reversed = select_columns(&digits, &order);
    // Where val_sklearn has checked that no tie decides.
    let settings = Settings { max_depth: Some(3), ..Default::default() };
    let forward = grow(settings.clone(), &digits).importances();
    let mut backward = grow(settings, &reversed).importances();
    backward.reverse();
    assert_eq!(forward, backward);
}

#[test]
fn equal_features_and_thresholds_go_to_the_lowest() {
    let samples = samples(&[&[0.0, 0.0], &[1.0, 1.0], &[2.0, 2.0], &[3.0, 3.0]], &[0, 1, 0, 1]);
    let tree = full(&samples);
    // Thresholds 0.5 and 2.5 are equally good, as are the two features.
    assert_eq!(tree.split(0), Some((0, 0.5)));
}

#[test]
fn exclusive_or_is_learnt_though_its_first_split_gains_nothing() {
    let samples = samples(&[&[0.0, 0.0], &[0.0, 1.0], &[1.0, 0.0], &[1.0, 1.0]], &[0, 1, 1, 0]);
    let tree = full(&samples);
    assert_eq!((tree.depth(), tree.decrease(0)), (2, 0.0));
    assert!((0..4).all(|row| tree.predict_row(&row_of(&samples, row)) == samples.labels()[row]));
}

#[test]
fn neighbouring_floats_are_separated() {
    let upper = 1.0_f64.next_up();
    let samples = samples(&[&[1.0], &[upper]], &[0, 1]);
    let tree = full(&samples);
    assert_eq!((tree.predict_row(&[1.0]), tree.predict_row(&[upper])), (0, 1));
}

#[test]
fn leaves_come_worst_first() {
    let (table, _) = golden_table("breast_cancer");
    let tree = grow(Settings { max_depth: Some(3), ..Default::default() }, &table);
    let leaves = tree.leaves();
    assert!(leaves.windows(2).all(|pair| pair[0].purity <= pair[1].purity));
    assert_eq!(leaves.iter().map(|leaf| leaf.rows).sum::<u32>(), 569);
    assert!(leaves.iter().all(|leaf| leaf.depth <= 3));
}

#[test]
fn text_to_read() {
    let samples = samples(&[&[0.0, 5.0], &[0.0, 6.0], &[1.0, 5.0], &[1.0, 6.0]], &[0, 0, 1, 0]);
    let text = full(&samples).text(samples.feature_names(), samples.class_names());
    let expected = "\
|- x0 <= 0.5
|  => c0 (rows 2, purity 1.000)
|- x0 > 0.5
|  |- x1 <= 5.5
|  |  => c1 (rows 1, purity 1.000)
|  |- x1 > 5.5
|  |  => c0 (rows 1, purity 1.000)
";
    assert_eq!(text, expected);
    assert!(full(&samples).text(&[], &[]).contains("feature 0 <= 0.5"));
}

/// The definition, without any cleverness: tries every split and computes both impurities anew.
fn best_decrease(samples: &Samples, criterion: Criterion) -> f64 {
    let impurity = |rows: &[usize]| {
        let mut weights = [0.0; 3];
        rows.iter().for_each(|&row| weights[samples.labels()[row] as usize] += samples.weight(row));
        let total: f64 = weights.iter().sum();
        let shares = weights.iter().map(|weight| weight / total).filter(|&share| share > 0.0);
        let value = match criterion {
            Criterion::Gini => 1.0 - shares.map(|p| p * p).sum::<f64>(),
            Criterion::Entropy => -shares.map(|p| p * p.log2()).sum::<f64>(),
        };
        (total, value)
    };
    let rows: Vec<usize> = (0..samples.rows()).filter(|&row| samples.weight(row) > 0.0).collect();
    let (total, whole) = impurity(&rows);
    let mut best = 0.0_f64;
    for feature in 0..samples.features() {
        for &border in &rows {
            let column = samples.column(feature);
            let (left, right): (Vec<usize>, Vec<usize>) =
                rows.iter().partition(|&&row| column[row] <= column[border]);
            if !right.is_empty() {
                let ((wl, il), (wr, ir)) = (impurity(&left), impurity(&right));
                best = best.max(whole - (wl * il + wr * ir) / total);
            }
        }
    }
    best
}

proptest! {
    #[test]
    fn the_first_split_is_the_best_of_all(samples in any_samples()) {
        for criterion in [Criterion::Gini, Criterion::Entropy] {
            let tree = grow(Settings { criterion, max_depth: Some(1), ..Default::default() }, &samples);
            prop_assert!((tree.decrease(0) - best_decrease(&samples, criterion)).abs() < 1e-12);
        }
    }
}
