//! Rows without a value: a branch that is learnt, in every classifier made of trees.

use crate::tables::select_rows;
use proptest::prelude::*;
use servotwin_diagnosis::Error;
use servotwin_diagnosis::classifiers::{ALL, Classifier, ClassifierKind};
use servotwin_diagnosis::tree::Tree;
use servotwin_learning::Samples;
use servotwin_learning::classifiers::cart::Settings;
use servotwin_learning::classifiers::{self, Fit, predict};
use servotwin_learning::tree::Criterion;

/// Samples from columns, NaN where there is no value.
fn with_missing(columns: &[Vec<f64>], labels: &[u32]) -> Samples {
    let names = (0..columns.len()).map(|column| format!("x{column}")).collect();
    let classes = (0..=*labels.iter().max().unwrap()).map(|class| format!("c{class}")).collect();
    Samples::with_missing(names, classes, columns.concat(), labels.to_vec()).unwrap()
}

/// Few different values, a third of them missing.
fn any_samples() -> impl Strategy<Value = Samples> {
    (1usize..4, 2usize..40).prop_flat_map(|(features, rows)| {
        let value = prop_oneof![Just(f64::NAN), (-3i32..4).prop_map(f64::from), -1.0f64..1.0];
        let column = prop::collection::vec(value, rows);
        let columns = prop::collection::vec(column, features);
        (columns, prop::collection::vec(0u32..3, rows))
            .prop_map(|(columns, labels)| with_missing(&columns, &labels))
    })
}

fn row_of(samples: &Samples, row: usize) -> Vec<f64> {
    let mut values = vec![0.0; samples.features()];
    samples.row_into(row, &mut values);
    values
}

fn impurity(criterion: Criterion, counts: &[f64]) -> f64 {
    let total: f64 = counts.iter().sum();
    let shares = counts.iter().filter(|count| **count > 0.0).map(|count| count / total);
    match criterion {
        Criterion::Gini => 1.0 - shares.map(|share| share * share).sum::<f64>(),
        Criterion::Entropy => -shares.map(|share| share * share.log2()).sum::<f64>(),
    }
}

/// The largest decrease that any threshold of any feature buys, with rows without a value on either
/// side or alone: every way is tried by counting.
fn best_decrease(samples: &Samples, criterion: Criterion, min_rows: usize) -> f64 {
    let rows = samples.rows();
    let of_split = |goes_left: &dyn Fn(usize) -> bool| {
        let mut sides = [vec![0.0; samples.classes()], vec![0.0; samples.classes()]];
        (0..rows).for_each(|row| {
            sides[usize::from(goes_left(row))][samples.labels()[row] as usize] += 1.0;
        });
        let totals = [&sides[0], &sides[1]].map(|side| side.iter().sum::<f64>());
        let enough = totals.iter().all(|total| *total >= min_rows.max(1) as f64);
        let parts = sides.iter().zip(totals).map(|(side, total)| total * impurity(criterion, side));
        let node: Vec<f64> = sides[0].iter().zip(&sides[1]).map(|(a, b)| a + b).collect();
        enough.then(|| impurity(criterion, &node) - parts.sum::<f64>() / rows as f64)
    };
    let mut best: f64 = 0.0;
    for feature in 0..samples.features() {
        let column = samples.column(feature);
        for &threshold in column.iter().filter(|value| !value.is_nan()) {
            for missing_left in [false, true] {
                let left = |row: usize| match column[row].is_nan() {
                    true => missing_left,
                    false => column[row] <= threshold,
                };
                best = best.max(of_split(&left).unwrap_or(0.0));
            }
        }
    }
    best
}

proptest! {
    #[test]
    fn the_first_split_is_the_best_of_all(samples in any_samples(), min_rows in 1usize..4) {
        for criterion in [Criterion::Gini, Criterion::Entropy] {
            let settings = Settings {
                criterion,
                max_depth: Some(1),
                min_samples_leaf: min_rows,
                ..Default::default()
            };
            let tree = settings.fit(&samples).unwrap();
            let best = best_decrease(&samples, criterion, min_rows);
            prop_assert!((tree.decrease(0) - best).abs() < 1e-12, "{} {best}", tree.decrease(0));
        }
    }

    #[test]
    fn counts_agree_with_where_rows_go(samples in any_samples()) {
        let tree = Settings::default().fit(&samples).unwrap();
        tree.check().unwrap();
        let mut passed = vec![0u32; tree.nodes()];
        for row in 0..samples.rows() {
            let values = row_of(&samples, row);
            let path: Vec<usize> = tree.decision_path(&values).collect();
            prop_assert_eq!(*path.last().unwrap(), tree.branches().leaf_of(&values));
            path.iter().for_each(|&node| passed[node] += 1);
        }
        for (node, passed) in passed.iter().enumerate() {
            prop_assert_eq!(tree.counts(node).iter().sum::<u32>(), *passed, "node {}", node);
        }
        let json = serde_json::to_string(&tree).unwrap();
        prop_assert_eq!(serde_json::from_str::<Tree>(&json).unwrap(), tree);
    }

    #[test]
    fn full_trees_tell_missing_from_given(samples in any_samples()) {
        let tree = Settings::default().fit(&samples).unwrap();
        for leaf in tree.leaves().iter().filter(|leaf| leaf.purity < 1.0) {
            let in_leaf =
                |row: &usize| tree.branches().leaf_of(&row_of(&samples, *row)) == leaf.node;
            let bits = |row: usize| -> Vec<u64> {
                row_of(&samples, row).iter().map(|value| (value + 0.0).to_bits()).collect()
            };
            let rows: Vec<usize> = (0..samples.rows()).filter(in_leaf).collect();
            prop_assert!(rows.iter().all(|&row| bits(row) == bits(rows[0])), "{:?}", rows);
        }
    }
}

#[test]
fn trees_learn_what_is_missing_and_the_others_refuse() {
    // The value is missing where the class is 1, but for few rows; x1 says nothing.
    let x0: Vec<f64> =
        (0..60).map(|k| if k % 3 == 0 { f64::NAN } else { f64::from(k % 5) }).collect();
    let x1: Vec<f64> = (0..60).map(|k| f64::from(k * 7 % 13)).collect();
    let labels: Vec<u32> = (0..60).map(|k| u32::from(k % 3 == 0)).collect();
    let samples = with_missing(&[x0, x1], &labels);
    use ClassifierKind::{Adaboost, Cart, RandomForest};
    for &kind in ALL {
        let fitted = classifiers::Settings::default_of(kind).fit(&samples);
        if matches!(kind, Cart | RandomForest | Adaboost) {
            assert_eq!(predict(&fitted.unwrap(), &samples).unwrap(), labels, "{kind:?}");
        } else {
            assert_eq!(fitted.unwrap_err(), Error::Missing { column: "x0".into(), row: 0 });
        }
    }
    let tree = Settings::default().fit(&samples).unwrap();
    assert_eq!(tree.nodes(), 3);
    let text = tree.text(&["a".into(), "b".into()], &["good".into(), "bad".into()]);
    assert!(text.contains("or missing"), "{text}");
}

#[test]
fn what_was_never_missing_in_training_goes_with_most_rows() {
    let samples = with_missing(
        &[vec![1.0, 2.0, 3.0, 4.0, 5.0], vec![0.0, 0.0, f64::NAN, 0.0, 0.0]],
        &[0, 1, 1, 1, 1],
    );
    let tree = Settings::default().fit(&samples).unwrap();
    assert_eq!(tree.split(0), Some((0, 1.5)));
    assert_eq!(tree.predict_row(&[f64::NAN, 0.0]), 1);
}

#[test]
fn rows_without_weight_are_as_if_they_were_not_there() {
    let columns = [
        (0..80).map(|k| f64::from(k * 37 % 41)).collect::<Vec<f64>>(),
        (0..80).map(|k| if k % 7 == 0 { f64::NAN } else { f64::from(k * 11 % 17) }).collect(),
    ];
    let labels: Vec<u32> = (0..80).map(|k| (k * 37 % 41) / 14).collect();
    let samples = with_missing(&columns, &labels);
    let kept: Vec<usize> = (0..80).filter(|row| row % 5 != 2).collect();
    let mut weights = vec![0.0; 80];
    kept.iter().for_each(|&row| weights[row] = 1.0);
    let weighted = samples.clone().with_weights(weights).unwrap();
    let selected = select_rows(&samples, &kept);
    for kind in [ClassifierKind::Cart, ClassifierKind::RandomForest, ClassifierKind::Adaboost] {
        let settings = classifiers::Settings::default_of(kind);
        assert_eq!(settings.fit(&weighted).unwrap(), settings.fit(&selected).unwrap(), "{kind:?}");
    }
}
