//! The promises that every classifier keeps.

use crate::tables::{clouds, from_rows, samples, select_columns, select_rows};
use servotwin_diagnosis::classifiers::{ALL, Classifier, ClassifierKind, Model, Scores};
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{Fit, Settings, predict};

/// Defaults, but quick.
fn settings(kind: ClassifierKind) -> Settings {
    let mut settings = Settings::default_of(kind);
    match &mut settings {
        Settings::RandomForest(forest) => forest.trees = 20,
        Settings::Adaboost(boost) => boost.max_depth = Some(2),
        Settings::Mlp(mlp) => mlp.learning_rate = 0.01,
        _ => {}
    }
    settings
}

fn fit(kind: ClassifierKind, samples: &Samples) -> Model {
    settings(kind).fit(samples).unwrap_or_else(|error| panic!("{kind:?}: {error}"))
}

fn json(model: &Model) -> String {
    serde_json::to_string(model).unwrap()
}

fn scores(model: &Model, row: &[f64]) -> Vec<f64> {
    let mut scores = vec![f64::NAN; model.classes()];
    model.scores_into(row, &mut scores);
    scores
}

fn rows(samples: &Samples) -> Vec<Vec<f64>> {
    let row = |row| {
        let mut values = vec![0.0; samples.features()];
        samples.row_into(row, &mut values);
        values
    };
    (0..samples.rows()).map(row).collect()
}

#[test]
fn kinds_have_ids_that_are_the_names_in_files() {
    for &kind in ALL {
        assert_eq!(serde_json::to_string(&kind).unwrap(), format!("\"{}\"", kind.id()));
        assert!(!kind.title().is_empty());
        assert_eq!(Settings::default_of(kind).kind(), kind);
        assert_eq!(fit(kind, &clouds(12, 0)).kind(), kind);
    }
}

#[test]
fn same_fit_twice_is_bit_identical() {
    let samples = clouds(60, 1);
    for &kind in ALL {
        assert_eq!(json(&fit(kind, &samples)), json(&fit(kind, &samples)), "{kind:?}");
    }
}

#[test]
fn separable_samples_are_learnt_without_error() {
    let (train, test) = (clouds(90, 2), clouds(60, 3));
    for &kind in ALL {
        let model = fit(kind, &train);
        assert_eq!(predict(&model, &train).unwrap(), train.labels(), "{kind:?} on its own rows");
        assert_eq!(predict(&model, &test).unwrap(), test.labels(), "{kind:?} on new rows");
    }
}

#[test]
fn prediction_ways_agree_and_scores_are_what_they_say() {
    let samples = clouds(60, 4);
    for &kind in ALL {
        let model = fit(kind, &samples);
        for row in rows(&samples) {
            let scores = scores(&model, &row);
            let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let predicted = model.predict_row(&row);
            assert_eq!(scores[predicted as usize], best, "{kind:?}");
            assert_eq!(model.predict_with(&row, &mut [0.0; 3]), predicted, "{kind:?}");
            if model.scores() == Scores::Shares {
                assert!((scores.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{kind:?} {scores:?}");
                assert!(scores.iter().all(|&share| share >= 0.0), "{kind:?} {scores:?}");
            }
        }
    }
}

#[test]
fn stored_and_loaded_model_predicts_the_same() {
    let samples = clouds(60, 5);
    for &kind in ALL {
        let model = fit(kind, &samples);
        let loaded: Model = serde_json::from_str(&json(&model)).unwrap();
        loaded.check().unwrap();
        assert_eq!(loaded, model, "{kind:?}");
        for row in rows(&samples) {
            assert_eq!(scores(&loaded, &row), scores(&model, &row), "{kind:?}");
        }
    }
}

#[test]
fn settings_are_stored_with_their_kind_and_refuse_unknown_names() {
    for &kind in ALL {
        let text = serde_json::to_string(&settings(kind)).unwrap();
        assert!(text.contains(&format!("\"kind\":\"{}\"", kind.id())), "{text}");
        assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings(kind));
        let short = format!("{{\"kind\":\"{}\"}}", kind.id());
        assert_eq!(serde_json::from_str::<Settings>(&short).unwrap(), Settings::default_of(kind));
        let wrong = format!("{{\"kind\":\"{}\",\"no_such_setting\":1}}", kind.id());
        assert!(serde_json::from_str::<Settings>(&wrong).is_err(), "{kind:?}");
    }
}

/// All scores must be numbers (a class without rows may have minus infinity as margin), and a
/// stored model must keep every one of its numbers.
fn check_sound(kind: ClassifierKind, samples: &Samples) -> Model {
    let model = fit(kind, samples);
    assert!(!json(&model).contains("null"), "{kind:?} holds a number that is not finite");
    for row in rows(samples) {
        assert!(scores(&model, &row).iter().all(|score| !score.is_nan()), "{kind:?}");
        assert!((model.predict_row(&row) as usize) < samples.classes(), "{kind:?}");
    }
    model
}

#[test]
fn constant_features_do_no_harm() {
    let rows: [&[f64]; 6] = [
        &[0.0, 7.3, 0.1],
        &[0.1, 7.3, 0.1],
        &[0.2, 7.3, 0.1],
        &[1.0, 7.3, 0.1],
        &[1.1, 7.3, 0.1],
        &[1.2, 7.3, 0.1],
    ];
    let samples = samples(&rows, &[0, 0, 0, 1, 1, 1]);
    for &kind in ALL {
        let model = check_sound(kind, &samples);
        assert_eq!(predict(&model, &samples).unwrap(), samples.labels(), "{kind:?}");
    }
}

#[test]
fn only_constant_features_predict_the_commonest_class() {
    let samples = samples(&[&[1.0, 2.0], &[1.0, 2.0], &[1.0, 2.0]], &[0, 1, 1]);
    for &kind in ALL {
        let model = check_sound(kind, &samples);
        // The margins of an SVM do not know how common a class is beyond its intercept.
        assert_eq!(model.predict_row(&[1.0, 2.0]), 1, "{kind:?}");
    }
}

#[test]
fn a_perfect_indicator_is_used() {
    // Within each class the feature is constant: its variance there is 0.
    let samples = samples(&[&[0.0], &[0.0], &[0.0], &[1.0], &[1.0], &[1.0]], &[0, 0, 0, 1, 1, 1]);
    for &kind in ALL {
        let model = check_sound(kind, &samples);
        assert_eq!(predict(&model, &samples).unwrap(), samples.labels(), "{kind:?}");
    }
}

#[test]
fn a_single_class_is_always_predicted() {
    for rows in [&[&[1.0, 2.0][..], &[2.0, 1.0], &[0.0, 0.0]][..], &[&[3.0, 4.0]]] {
        let samples = samples(rows, &vec![2; rows.len()]);
        for &kind in ALL {
            let model = check_sound(kind, &samples);
            assert_eq!(model.predict_row(&[-50.0, 50.0]), 2, "{kind:?}");
        }
    }
}

#[test]
fn one_row_per_class_is_enough() {
    let samples = samples(&[&[0.0, 0.0], &[10.0, 0.0], &[0.0, 10.0]], &[0, 1, 2]);
    for &kind in ALL {
        let model = check_sound(kind, &samples);
        // A forest's trees see a part of the rows only, a stump has two leaves.
        if !matches!(kind, ClassifierKind::RandomForest) {
            assert_eq!(predict(&model, &samples).unwrap(), [0, 1, 2], "{kind:?}");
        }
    }
}

#[test]
fn a_class_without_rows_is_never_predicted() {
    let all = clouds(60, 6);
    let keep: Vec<usize> = (0..60).filter(|&row| all.labels()[row] != 1).collect();
    let part = select_rows(&all, &keep);
    for &kind in ALL {
        let model = check_sound(kind, &part);
        assert_eq!(model.classes(), 3);
        assert!(predict(&model, &all).unwrap().iter().all(|&class| class != 1), "{kind:?}");
    }
}

#[test]
fn rows_without_weight_are_not_learnt_from() {
    let samples = clouds(60, 7);
    let mut wrong = samples.labels().to_vec();
    wrong[..20].iter_mut().for_each(|label| *label = (*label + 1) % 3);
    let values = rows(&samples).concat();
    let (features, classes) = (samples.feature_names().to_vec(), samples.class_names().to_vec());
    let weights = (0..60).map(|row| if row < 20 { 0.0 } else { 1.0 }).collect();
    let weighted = from_rows(features, classes, &values, wrong);
    let weighted = weighted.with_weights(weights).unwrap();
    for &kind in ALL {
        let model = check_sound(kind, &weighted);
        assert_eq!(predict(&model, &samples).unwrap(), samples.labels(), "{kind:?}");
    }
}

#[test]
fn weight_two_is_two_rows() {
    let samples = clouds(30, 8);
    let doubled: Vec<usize> = (0..30).chain((0..30).filter(|row| row % 4 == 0)).collect();
    let twice = select_rows(&samples, &doubled);
    let weights = (0..30).map(|row| if row % 4 == 0 { 2.0 } else { 1.0 }).collect();
    let weighted = samples.with_weights(weights).unwrap();
    let tested = [
        ClassifierKind::Cart,
        ClassifierKind::NaiveBayes,
        ClassifierKind::LogisticRegression,
        ClassifierKind::Adaboost,
        ClassifierKind::BoostedTrees,
    ];
    for kind in tested {
        let (a, b) = (fit(kind, &twice), fit(kind, &weighted));
        for row in rows(&twice) {
            let pairs = scores(&a, &row).into_iter().zip(scores(&b, &row));
            pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-9, "{kind:?}: {a} {b}"));
        }
    }
}

#[test]
fn extreme_values_and_weights_do_no_harm() {
    for size in [1e100, 1e-160, 5e-324] {
        let samples = samples(&[&[0.0, size], &[size, 0.0], &[-size, 1.0]], &[0, 1, 2]);
        for weights in [vec![1.0; 3], vec![1e100, 1.0, 0.0], vec![1e-100; 3]] {
            let weighted = samples.clone().with_weights(weights).unwrap();
            for &kind in ALL {
                check_sound(kind, &weighted);
            }
        }
    }
}

#[test]
fn rows_far_away_or_not_finite_do_not_panic() {
    let samples = clouds(30, 10);
    for &kind in ALL {
        let model = fit(kind, &samples);
        for value in [1e200, -1e308, f64::NAN, f64::INFINITY] {
            assert!(model.predict_row(&[value; 4]) < 3, "{kind:?}");
        }
    }
}

#[test]
fn another_table_is_refused() {
    let samples = clouds(12, 9);
    let narrow = select_columns(&samples, &[0, 1]);
    for &kind in ALL {
        assert!(predict(&fit(kind, &samples), &narrow).is_err(), "{kind:?}");
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let samples = clouds(12, 9);
    for text in [
        r#"{"kind":"linear_svm","cost":0}"#,
        r#"{"kind":"cart","min_samples_split":1}"#,
        r#"{"kind":"cart","min_samples_leaf":0}"#,
        r#"{"kind":"cart","min_impurity_decrease":-1}"#,
        r#"{"kind":"cart","max_bins":1}"#,
        r#"{"kind":"mlp","hidden_units":0}"#,
        r#"{"kind":"mlp","batch_rows":0}"#,
        r#"{"kind":"naive_bayes","variance_smoothing":0}"#,
        r#"{"kind":"random_forest","trees":0}"#,
        r#"{"kind":"random_forest","drawn_features":{"count":0}}"#,
        r#"{"kind":"linear_discriminant","ridge":-1}"#,
        r#"{"kind":"adaboost","learning_rate":0}"#,
        r#"{"kind":"logistic_regression","max_steps":0}"#,
        r#"{"kind":"boosted_trees","trees":0}"#,
        r#"{"kind":"boosted_trees","trees":65}"#,
        r#"{"kind":"boosted_trees","max_depth":7}"#,
        r#"{"kind":"boosted_trees","learning_rate":0}"#,
        r#"{"kind":"boosted_trees","lambda":0}"#,
        r#"{"kind":"boosted_trees","min_curvature_leaf":-1}"#,
        r#"{"kind":"boosted_trees","feature_share":0}"#,
        r#"{"kind":"boosted_trees","max_bins":257}"#,
    ] {
        let settings: Settings = serde_json::from_str(text).unwrap();
        assert!(settings.fit(&samples).is_err(), "{text}");
    }
}

#[test]
fn a_corrupt_model_is_noticed() {
    let samples = clouds(12, 9);
    for &kind in ALL {
        let text = json(&fit(kind, &samples));
        // Labels, decisions or shapes now point past the classes.
        let broken = text.replacen("\"classes\":3", "\"classes\":1", 1);
        let model: Model = serde_json::from_str(&broken).unwrap();
        assert!(model.check().is_err(), "{kind:?}: {broken}");
    }
}
