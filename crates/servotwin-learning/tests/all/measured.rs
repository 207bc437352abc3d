//! The learner on data that nobody simulated: the LiU engine bench and the ZeMA hydraulic rig.
//!
//! The data stands in `../shared/data` beside the repository, or where `SERVOTWIN_DATA` points.
//! Without the data the tests print a note and pass. The accuracies are those of scikit-learn with the same features,
//! less 0.03.

use crate::tables::splits_by_fold;
use servotwin_diagnosis::classifiers::{Classifier, ClassifierKind};
use servotwin_diagnosis::residual::Window;
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{Fit, Settings};
use servotwin_learning::splits::{Split, grouped_k_fold};
use std::collections::BTreeSet;
use std::io::BufReader;
use std::path::{Path, PathBuf};

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

/// A study's default settings of a classifier.
fn settings(kind: ClassifierKind) -> Settings {
    let mut settings = Settings::default_of(kind);
    if let Settings::Cart(cart) = &mut settings {
        cart.max_depth = Some(7);
    }
    settings
}

/// Samples from rows, with classes named by text.
fn samples(rows: &[Vec<f64>], classes: &[String]) -> Samples {
    let names: BTreeSet<&String> = classes.iter().collect();
    let names: Vec<String> = names.into_iter().cloned().collect();
    let label = |class: &String| names.iter().position(|name| name == class).unwrap() as u32;
    let labels = classes.iter().map(label).collect();
    let features = (0..rows[0].len()).map(|feature| format!("x{feature}")).collect();
    Samples::from_rows(features, names, &rows.concat(), labels).unwrap()
}

/// The share of held-out rows that are classified right.
fn accuracy(kind: ClassifierKind, samples: &Samples, splits: &[Split]) -> f64 {
    let (mut right, mut tested) = (0, 0);
    let mut row = vec![0.0; samples.features()];
    for split in splits {
        let model = settings(kind).fit(&samples.select_rows(&split.train).unwrap()).unwrap();
        for &test in &split.test {
            samples.row_into(test, &mut row);
            right += usize::from(model.predict_row(&row) == samples.labels()[test]);
            tested += 1;
        }
    }
    right as f64 / tested as f64
}

#[test]
fn val_sklearn_liu_engine_residuals() {
    let Some(folder) = data("liu_engine_residuals") else { return };
    let mut reader = csv::Reader::from_path(folder.join("residuals.csv")).unwrap();
    let (mut rows, mut modes) = (vec![], vec![]);
    for record in reader.records() {
        let record = record.unwrap();
        modes.push(record[0].to_owned());
        rows.push(record.iter().skip(1).map(|value| value.parse().unwrap()).collect());
    }
    let samples = samples(&rows, &modes);
    // The last third of each mode is held out.
    let mut folds = vec![1; samples.rows()];
    for class in 0..samples.classes() as u32 {
        let of_class = (0..samples.rows()).filter(|&row| samples.labels()[row] == class);
        let of_class: Vec<usize> = of_class.collect();
        let held_out = of_class.len() / 3;
        of_class[of_class.len() - held_out..].iter().for_each(|&row| folds[row] = 0);
    }
    let splits = splits_by_fold(&folds, 1);
    for (kind, sklearn) in [
        (ClassifierKind::Cart, 0.772),
        (ClassifierKind::RandomForest, 0.892),
        (ClassifierKind::Mlp, 0.846),
        (ClassifierKind::NaiveBayes, 0.708),
    ] {
        let ours = accuracy(kind, &samples, &splits);
        println!("LiU {}: {ours:.3}, scikit-learn {sklearn}", kind.id());
        assert!(ours >= sklearn - 0.03, "{kind:?}: {ours}");
    }
}

const SENSORS: [&str; 17] = [
    "CE", "CP", "EPS1", "FS1", "FS2", "PS1", "PS2", "PS3", "PS4", "PS5", "PS6", "SE", "TS1", "TS2",
    "TS3", "TS4", "VS1",
];
const CONDITIONS: [&str; 4] = ["cooler", "valve", "pump", "accumulator"];

/// Appends mean and variance of six ten-second segments of a sensor to every cycle's row.
fn add_sensor(folder: &Path, sensor: &str, rows: &mut Vec<Vec<f64>>) {
    let file = std::fs::File::open(folder.join(format!("{sensor}_1hz.csv.xz"))).unwrap();
    let mut text = vec![];
    lzma_rs::xz_decompress(&mut BufReader::new(file), &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    rows.resize(text.lines().count(), vec![]);
    for (line, row) in text.lines().zip(rows) {
        let cycle: Vec<f64> = line.split(',').map(|value| value.trim().parse().unwrap()).collect();
        for segment in cycle.chunks_exact(10).take(6) {
            let mut window = Window::new(1);
            segment.iter().for_each(|value| window.add(&[*value], &[0.0], &[1.0]));
            row.extend([window.mean(0), window.covariance(0, 0)]);
        }
    }
}

#[test]
fn val_sklearn_zema_hydraulic_rig() {
    let Some(folder) = data("zema_hydraulic") else { return };
    let mut rows = vec![];
    SENSORS.iter().for_each(|sensor| add_sensor(&folder, sensor, &mut rows));
    assert_eq!(rows.len(), 2205);
    let profile = std::fs::read_to_string(folder.join("profile.txt")).unwrap();
    let states: Vec<Vec<&str>> = profile.lines().map(|l| l.split_whitespace().collect()).collect();
    // Cycles of one state that follow one another stay together.
    let mut block = 0u32;
    let mut blocks = vec![0];
    for pair in states.windows(2) {
        block += u32::from(pair[0][..4] != pair[1][..4]);
        blocks.push(block);
    }
    let splits = grouped_k_fold(&blocks, 5, 1).unwrap();
    for (place, sklearn) in [0.994, 1.000, 0.992, 0.803].into_iter().enumerate() {
        let condition: Vec<String> = states.iter().map(|state| state[place].to_owned()).collect();
        let ours = accuracy(ClassifierKind::Cart, &samples(&rows, &condition), &splits);
        println!("ZeMA {}: {ours:.3}, scikit-learn {sklearn}", CONDITIONS[place]);
        assert!(ours >= sklearn - 0.03, "{}: {ours}", CONDITIONS[place]);
    }
}
