//! Data that nobody simulated: the LiU engine bench and the ZeMA hydraulic rig.
//!
//! The data stands beside the repository, in `../shared/data`, or where `SERVOTWIN_DATA` says; where
//! it is not there, the tests say so and pass. The accuracies are those of scikit-learn with the same
//! features, less 0.03.

use servotwin::evaluation::foreign::{HoldOut, Selection, validate_table};
use servotwin::evaluation::foreign::{evaluate_table, train_table};
use servotwin::evaluation::parallel::Workers;
use servotwin::evaluation::traces::{TraceError, TraceStudy};
use servotwin::evaluation::{EvaluationError, comparison, model_file};
use servotwin::table::{self, Column, Table};
use servotwin_diagnosis::classifiers::{Kind, Settings};
use servotwin_diagnosis::residual::Window;
use std::io::BufReader;
use std::path::PathBuf;

fn data(folder: &str) -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = std::env::var_os("SERVOTWIN_DATA").map_or_else(|| beside.into(), PathBuf::from);
    let path = root.join(folder);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("{} is not there: nothing tested", path.display());
    None
}

fn classifier(kind: Kind) -> Settings {
    let list = comparison::default_classifiers();
    list.into_iter().find(|settings| settings.kind() == kind).unwrap()
}

fn accuracy(table: &Table, label: &str, group: Option<&str>, kind: Kind, how: HoldOut) -> f64 {
    let selection =
        Selection { label: label.into(), group: group.map(str::to_owned), features: vec![] };
    let score = validate_table(table, &selection, &classifier(kind), how, Workers::new(2)).unwrap();
    score.accuracy.share.unwrap()
}

#[test]
fn val_sklearn_liu_engine_residuals() {
    let Some(folder) = data("liu_engine_residuals") else {
        return;
    };
    let table = table::read(folder.join("residuals.csv")).unwrap();
    let last_third = HoldOut::Last { share: 1.0 / 3.0 };
    for (kind, sklearn) in [
        (Kind::Cart, 0.772),
        (Kind::RandomForest, 0.892),
        (Kind::Mlp, 0.846),
        (Kind::NaiveBayes, 0.708),
    ] {
        let ours = accuracy(&table, "mode", None, kind, last_third);
        println!("LiU {}: {ours:.3}, scikit-learn {sklearn}", kind.id());
        assert!(ours >= sklearn - 0.03, "{kind:?}: {ours}");
    }
}

#[test]
fn liu_windows_say_more_than_single_samples() {
    let Some(folder) = data("liu_engine_residuals") else {
        return;
    };
    let traces = table::read(folder.join("residuals.csv")).unwrap();
    let study = include_str!("../../../../studies/liu_engine.toml");
    let table = TraceStudy::parse(study).unwrap().features(&traces).unwrap();
    let last_third = HoldOut::Last { share: 1.0 / 3.0 };
    let single = accuracy(&traces, "mode", None, Kind::RandomForest, last_third);
    let window = accuracy(&table, "mode", None, Kind::RandomForest, last_third);
    println!("LiU forest: {single:.3} from samples, {window:.3} from windows");
    assert!(window > single, "{window} against {single}");
}

const SENSORS: [&str; 17] = [
    "CE", "CP", "EPS1", "FS1", "FS2", "PS1", "PS2", "PS3", "PS4", "PS5", "PS6", "SE", "TS1", "TS2",
    "TS3", "TS4", "VS1",
];
const CONDITIONS: [&str; 4] = ["cooler", "valve", "pump", "accumulator"];

/// Mean and variance of six ten-second segments of each sensor, and the four conditions.
fn zema(folder: &std::path::Path) -> Table {
    let mut table = Table::new();
    for sensor in SENSORS {
        let file = std::fs::File::open(folder.join(format!("{sensor}_1hz.csv.xz"))).unwrap();
        let mut text = vec![];
        lzma_rs::xz_decompress(&mut BufReader::new(file), &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let cycles: Vec<Vec<f64>> = text
            .lines()
            .map(|l| l.split(',').map(|v| v.trim().parse().unwrap()).collect())
            .collect();
        for segment in 0..6 {
            let window = |cycle: &Vec<f64>| {
                let mut window = Window::new(1);
                let values = &cycle[segment * 10..segment * 10 + 10];
                values.iter().for_each(|value| window.add(&[*value], &[0.0], &[1.0]));
                window
            };
            let windows: Vec<Window> = cycles.iter().map(window).collect();
            let means: Vec<f64> = windows.iter().map(|w| w.mean(0)).collect();
            let variances: Vec<f64> = windows.iter().map(|w| w.covariance(0, 0)).collect();
            table.push(Column::new(format!("mean_{sensor}_{segment}"), "", means)).unwrap();
            table.push(Column::new(format!("var_{sensor}_{segment}"), "", variances)).unwrap();
        }
    }
    let profile = std::fs::read_to_string(folder.join("profile.txt")).unwrap();
    let rows: Vec<Vec<&str>> = profile.lines().map(|l| l.split_whitespace().collect()).collect();
    for (place, name) in CONDITIONS.iter().enumerate() {
        let texts: Vec<String> = rows.iter().map(|row| row[place].to_owned()).collect();
        table.push(Column::new(*name, "", texts)).unwrap();
    }
    let mut block = 0u32;
    let mut blocks = vec![0];
    for pair in rows.windows(2) {
        block += u32::from(pair[0][..4] != pair[1][..4]);
        blocks.push(block);
    }
    table.push(Column::new("block", "", blocks)).unwrap();
    table
}

#[test]
fn val_sklearn_zema_hydraulic_rig() {
    let Some(folder) = data("zema_hydraulic") else {
        return;
    };
    let table = zema(&folder);
    assert_eq!(table.row_count(), 2205);
    let folds = HoldOut::Folds { folds: 5, seed: 1 };
    for (condition, sklearn) in CONDITIONS.into_iter().zip([0.994, 1.000, 0.992, 0.803]) {
        let ours = accuracy(&table, condition, Some("block"), Kind::Cart, folds);
        println!("ZeMA {condition}: {ours:.3}, scikit-learn {sklearn}");
        assert!(ours >= sklearn - 0.03, "{condition}: {ours}");
    }
}

fn small() -> Table {
    let x: Vec<f64> = (0..40).map(f64::from).collect();
    let class = |k: i32| if k < 20 { "low" } else { "high" }.to_owned();
    Table::from_columns(vec![
        Column::new("x", "", x),
        Column::new("always", "", vec![3.0; 40]),
        Column::new("class", "", (0..40).map(class).collect::<Vec<String>>()),
        Column::new("batch", "", (0..40u32).map(|k| k % 4).collect::<Vec<u32>>()),
    ])
    .unwrap()
}

fn selection(label: &str) -> Selection {
    Selection { label: label.into(), group: Some("batch".into()), features: vec![] }
}

#[test]
fn every_classifier_learns_a_small_table_with_a_constant_feature() {
    for settings in comparison::default_classifiers() {
        let model = train_table(&small(), &selection("class"), &settings).unwrap();
        assert_eq!(model.features, ["x", "always"], "the group is no feature");
        let score = evaluate_table(&small(), &model).unwrap();
        assert!(score.accuracy.share.unwrap() > 0.9, "{:?}", settings.kind());
        let text = serde_json::to_string(&model).unwrap();
        assert_eq!(
            serde_json::from_str::<servotwin::evaluation::foreign::TableModel>(&text).unwrap(),
            model
        );
    }
    let path = std::env::temp_dir().join(format!("servotwin-table-{}.json", std::process::id()));
    let model = train_table(&small(), &selection("class"), &classifier(Kind::Cart)).unwrap();
    model_file::write(&path, &model).unwrap();
    assert_eq!(model_file::read_table_model(&path).unwrap(), model);
    std::fs::remove_file(path).unwrap();
}

#[test]
fn unfit_tables_are_refused_in_words() {
    let cart = classifier(Kind::Cart);
    let error = |table: &Table, selection: &Selection| {
        train_table(table, selection, &cart).unwrap_err().to_string()
    };
    assert!(error(&small(), &selection("clas")).contains("did you mean 'class'"));
    let mut one = small();
    one.push(Column::new("same", "", vec!["a".to_owned(); 40])).unwrap();
    assert!(error(&one, &selection("same")).contains("at least two classes"));
    let mut broken = small();
    broken.push(Column::new("y", "", vec![f64::NAN; 40])).unwrap();
    assert!(error(&broken, &selection("class")).contains("'y'"));
    let text_only = Selection { features: vec!["class".into()], ..selection("class") };
    assert!(error(&small(), &text_only).contains("needed are numbers"));
    let many = HoldOut::Folds { folds: 9, seed: 1 };
    assert!(matches!(
        validate_table(&small(), &selection("class"), &cart, many, Workers::new(1)),
        Err(EvaluationError::TooFewGroups { found: 4, needed: 9, .. })
    ));
}

#[test]
fn traces_become_windows_of_features() {
    let study = "format = 1\nwindow_rows = 5\nkeep = [\"class\"]\nfamilies = [\"moments\"]\n\
        [[sensors]]\nname = \"s\"\nmeasured = \"x\"\nnominal = \"always\"\nscale = 2.0\n";
    let features = TraceStudy::parse(study).unwrap().features(&small()).unwrap();
    assert_eq!(features.row_count(), 8);
    assert_eq!(features.names().collect::<Vec<_>>(), ["class", "mean_s", "var_s", "no_dev_s"]);
    // (0 + 1 + 2 + 3 + 4)/5 = 2; less 3; over 2.
    assert!((features.f64("mean_s").unwrap()[0] + 0.5).abs() < 1e-12);
    let refused = |text: &str| TraceStudy::parse(text).unwrap_err().to_string();
    assert!(refused(&study.replace("moments", "moment")).contains("did you mean 'moments'"));
    assert!(refused(&study.replace("2.0", "0.0")).contains("above 0"));
    assert!(refused("format = 1\nwindow_rows = 5").contains("nothing to measure"));
    let long = TraceStudy::parse(&study.replace("= 5", "= 21")).unwrap();
    assert!(matches!(long.features(&small()), Err(TraceError::NoWindow { longest: 20, .. })));
}
