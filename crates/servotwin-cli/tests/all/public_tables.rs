//! Public tables go through `servotwin train` as they are: the accuracies of all
//! classifiers against scikit-learn's on the same folds (golden files,
//! written by `peers/sklearn_classifiers.py`).

use crate::{Folder, json};

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../golden");

/// A golden file without its comments.
fn golden(name: &str) -> String {
    let text = std::fs::read_to_string(format!("{GOLDEN}/{name}")).expect("a golden file");
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.map(|line| format!("{line}\n")).collect()
}

/// The settings that the golden file's heading names beside the defaults.
fn depth(classifier: &str) -> &'static [&'static str] {
    match classifier {
        // No limit: deeper than any of these trees.
        "cart" => &["--depth", "99"],
        "adaboost" => &["--depth", "3"],
        _ => &[],
    }
}

fn check(table: &str) {
    let folder = Folder::new(&format!("table-{table}"));
    let csv = folder.file("table.csv");
    std::fs::write(&csv, golden(&format!("sklearn_{table}.csv"))).expect("a table");
    let accuracies = golden("sklearn_accuracy.csv");
    let mut compared = 0;
    for line in accuracies.lines().filter(|line| line.starts_with(&format!("{table},"))) {
        let [_, classifier, expected] = line.split(',').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let expected: f64 = expected.parse().expect("a number");
        let mut arguments = vec!["--json", "train", &csv, "--label", "class", "--group", "fold"];
        arguments.extend(["--classifier", classifier]);
        arguments.extend(depth(classifier));
        let result = json(&arguments);
        let accuracy = result["score"]["accuracy"]["share"].as_f64().expect("a share");
        let difference = accuracy - expected;
        assert!(difference > -0.02, "{table}, {classifier}: {accuracy:.4} against {expected:.4}");
        compared += 1;
    }
    assert_eq!(compared, servotwin_diagnosis::classifiers::ALL.len(), "{table}");
}

#[test]
fn val_sklearn_wine_through_the_command() {
    check("wine");
}

#[test]
fn val_sklearn_breast_cancer_through_the_command() {
    check("breast_cancer");
}

#[test]
fn val_sklearn_digits_through_the_command() {
    check("digits");
}
