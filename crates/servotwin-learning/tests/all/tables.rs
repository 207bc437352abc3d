//! Samples for the tests: golden tables, and small made-up ones.

use servotwin_diagnosis::calibration::MIN_PROBABILITY;
use servotwin_diagnosis::random::Random;
use servotwin_learning::Samples;
use servotwin_learning::splits::Split;

/// Records of a golden file after its `#` header, with the names of the columns.
pub fn golden(file: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let path = format!("{}/../../golden/{file}", env!("CARGO_MANIFEST_DIR"));
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).unwrap();
    let names = reader.headers().unwrap().iter().map(String::from).collect();
    let records = reader.records().map(|r| r.unwrap().iter().map(String::from).collect());
    (names, records.collect())
}

/// A golden table and the fold of each row.
pub fn golden_table(name: &str) -> (Samples, Vec<usize>) {
    let (mut names, records) = golden(&format!("sklearn_{name}.csv"));
    let features = names.len() - 2;
    names.truncate(features);
    let values: Vec<f64> = records
        .iter()
        .flat_map(|r| r[..features].iter().map(|v| v.parse::<f64>().unwrap()))
        .collect();
    let labels: Vec<u32> = records.iter().map(|r| r[features].parse().unwrap()).collect();
    let folds = records.iter().map(|r| r[features + 1].parse().unwrap()).collect();
    let classes = labels.iter().max().unwrap() + 1;
    let class_names = (0..classes).map(|class| class.to_string()).collect();
    (from_rows(names, class_names, &values, labels), folds)
}

/// The splits that test each of the first folds once.
pub fn splits_by_fold(folds: &[usize], tested: usize) -> Vec<Split> {
    let split = |fold| {
        let (test, train) = (0..folds.len()).partition(|&row| folds[row] == fold);
        Split { train, test }
    };
    (0..tested).map(split).collect()
}

/// Samples from row-major values.
pub fn from_rows(
    names: Vec<String>,
    class_names: Vec<String>,
    values: &[f64],
    labels: Vec<u32>,
) -> Samples {
    let column = |column: usize| values.iter().skip(column).step_by(names.len()).copied();
    let columns = (0..names.len()).flat_map(column).collect();
    Samples::from_columns(names, class_names, columns, labels).unwrap()
}

/// Only these rows and columns, in this order, with their weights.
fn select(samples: &Samples, rows: &[usize], columns: &[usize]) -> Samples {
    let column = |&column: &usize| rows.iter().map(move |&row| samples.column(column)[row]);
    let names = columns.iter().map(|&column| samples.feature_names()[column].clone());
    let labels = rows.iter().map(|&row| samples.labels()[row]).collect();
    let values = columns.iter().flat_map(column).collect();
    let classes = samples.class_names().to_vec();
    let selected = Samples::with_missing(names.collect(), classes, values, labels).unwrap();
    selected.with_weights(rows.iter().map(|&row| samples.weight(row)).collect()).unwrap()
}

pub fn select_rows(samples: &Samples, rows: &[usize]) -> Samples {
    select(samples, rows, &(0..samples.features()).collect::<Vec<_>>())
}

pub fn select_columns(samples: &Samples, columns: &[usize]) -> Samples {
    select(samples, &(0..samples.rows()).collect::<Vec<_>>(), columns)
}

/// Samples from rows, with numbered features and classes.
pub fn samples(rows: &[&[f64]], labels: &[u32]) -> Samples {
    let names = (0..rows[0].len()).map(|feature| format!("x{feature}")).collect();
    let classes = labels.iter().max().unwrap() + 1;
    let class_names = (0..classes).map(|class| format!("c{class}")).collect();
    from_rows(names, class_names, &rows.concat(), labels.to_vec())
}

/// Three well separated clouds in four features; the features have different scales.
pub fn clouds(rows: usize, seed: u64) -> Samples {
    let mut random = Random::new(seed);
    let centres = [[0.0, 0.0, 5.0, 1.0], [60.0, 0.4, -5.0, 1.2], [-60.0, 0.9, 5.5, -3.0]];
    let labels: Vec<u32> = (0..rows as u32).map(|row| row % 3).collect();
    let scales = [10.0, 0.1, 1.0, 0.5];
    let values: Vec<Vec<f64>> = labels
        .iter()
        .map(|&label| {
            let centre = centres[label as usize].iter().zip(scales);
            centre.map(|(middle, scale)| middle + scale * random.between(-1.0, 1.0)).collect()
        })
        .collect();
    samples(&values.iter().map(Vec::as_slice).collect::<Vec<_>>(), &labels)
}

/// Mean log loss of row-major probabilities, in nats.
pub fn log_loss(shares: &[f64], labels: &[u32]) -> f64 {
    let rows = shares.chunks_exact(shares.len() / labels.len()).zip(labels);
    rows.map(|(row, &label)| -row[label as usize].max(MIN_PROBABILITY).ln()).sum::<f64>()
        / labels.len() as f64
}
