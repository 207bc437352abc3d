//! Boosted trees: a tree worked out by hand, and what must hold for all.

use crate::tables::{golden_table, log_loss, samples, select_rows};
use servotwin_diagnosis::classifiers::Classifier;
use servotwin_diagnosis::classifiers::boosted_trees::Model;
use servotwin_learning::Samples;
use servotwin_learning::classifiers::Fit;
use servotwin_learning::classifiers::boosted_trees::Settings;

fn shares(model: &Model, samples: &Samples) -> Vec<f64> {
    let mut values = vec![0.0; samples.features()];
    let mut shares = vec![0.0; samples.rows() * samples.classes()];
    for (row, shares) in shares.chunks_exact_mut(samples.classes()).enumerate() {
        samples.row_into(row, &mut values);
        model.scores_into(&values, shares);
    }
    shares
}

/// The same table with other columns and labels.
fn changed(samples: &Samples, value: impl Fn(f64) -> f64, label: impl Fn(u32) -> u32) -> Samples {
    let columns = (0..samples.features()).flat_map(|column| samples.column(column));
    Samples::from_columns(
        samples.feature_names().to_vec(),
        samples.class_names().to_vec(),
        columns.map(|&old| value(old)).collect(),
        samples.labels().iter().map(|&old| label(old)).collect(),
    )
    .unwrap()
}

fn all_near(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
}

#[test]
fn one_tree_worked_out_by_hand() {
    let table = samples(&[&[0.0], &[0.0], &[3.0], &[3.0]], &[0, 1, 1, 1]);
    let settings = Settings { trees: 1, learning_rate: 0.5, lambda: 2.0, ..Settings::default() };
    let model = settings.fit(&table).unwrap();
    // p = 3/4: on the left G = 3/4 − 1/4 and H = 2 · 3/16, on the right G = −1/2.
    let step = 0.5 * 0.5 / (0.375 + 2.0);
    let share = |sum: f64| 1.0 / (1.0 + (-sum).exp());
    for (value, sum) in [(1.4, 3f64.ln() - step), (1.6, 3f64.ln() + step)] {
        let mut scores = [0.0; 2];
        model.scores_into(&[value], &mut scores);
        assert!(all_near(&scores, &[1.0 - share(sum), share(sum)]), "{scores:?}");
    }
}

#[test]
fn every_tree_lowers_the_loss_of_the_training_rows() {
    let (table, _) = golden_table("wine");
    let loss = |trees| {
        let model = Settings { trees, ..Settings::default() }.fit(&table).unwrap();
        assert_eq!(model.trees.len(), trees);
        log_loss(&shares(&model, &table), table.labels())
    };
    let losses: Vec<f64> = (1..=8).map(|k| loss(8 * k)).collect();
    assert!(losses.windows(2).all(|pair| pair[1] < pair[0]), "{losses:?}");
}

#[test]
fn probabilities_are_the_shares_of_classes_that_nothing_tells_apart() {
    // The feature tells two groups apart; in one 70 % are of the first class, in the other 10 %.
    let rows: Vec<[f64; 1]> = (0..200).map(|row| [f64::from(row % 2)]).collect();
    let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
    for classes in [2, 3] {
        let label = |row: u32| match (row / 2 % 10, row % 2) {
            (0..7, 0) | (0, 1) => 0,
            (place, _) => 1 + place % (classes - 1),
        };
        let labels: Vec<u32> = (0..200).map(label).collect();
        let model = Settings::default().fit(&samples(&rows, &labels)).unwrap();
        for (value, share) in [(0.0, 0.7), (1.0, 0.1)] {
            let mut scores = vec![0.0; classes as usize];
            model.scores_into(&[value], &mut scores);
            assert!((scores[0] - share).abs() < 0.01, "{classes} classes: {scores:?}");
        }
    }
}

#[test]
fn only_the_order_of_values_counts() {
    let (table, _) = golden_table("wine");
    let cubed = changed(&table, |value| value * value * value, |label| label);
    let [plain, of_cubes] =
        [&table, &cubed].map(|t| shares(&Settings::default().fit(t).unwrap(), t));
    assert_eq!(plain, of_cubes);
}

#[test]
fn neither_order_of_rows_nor_numbers_of_classes_count() {
    let (table, _) = golden_table("wine");
    let plain = shares(&Settings::default().fit(&table).unwrap(), &table);
    let mixed: Vec<usize> = (0..table.rows()).map(|row| row * 67 % table.rows()).collect();
    let other_order = Settings::default().fit(&select_rows(&table, &mixed)).unwrap();
    assert!(all_near(&shares(&other_order, &table), &plain));
    let renamed = changed(&table, |value| value, |label| (label + 1) % 3);
    let of_renamed = shares(&Settings::default().fit(&renamed).unwrap(), &table);
    for (renamed, plain) in of_renamed.chunks_exact(3).zip(plain.chunks_exact(3)) {
        assert!(all_near(&[renamed[1], renamed[2], renamed[0]], plain));
    }
}
