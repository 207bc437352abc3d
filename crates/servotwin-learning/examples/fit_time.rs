//! How long each classifier takes to train, on a made-up table of the study's size.
//!
//! `cargo run --release -p servotwin-diagnosis --example fit_time [table.csv]`
//!
//! 3280 rows to train with and 1640 to test with, 66 features, 18 classes. With a path the table is
//! written there, and `peers/sklearn_classifiers.py --time table.csv` times scikit-learn on it.

use std::fmt::Write;
use std::time::Instant;

use servotwin_diagnosis::classifiers::ALL;
use servotwin_diagnosis::random::Random;
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{Fit, Settings, cart, predict};

const TRAINING_ROWS: usize = 3280;
const TESTING_ROWS: usize = 1640;
const FEATURES: usize = 66;
const CLASSES: usize = 18;

/// Clouds that overlap; every third feature is an indicator of 0 and 1, as in the study.
fn made_up(rows: usize, centres: &[f64], random: &mut Random) -> Samples {
    let mut values = Vec::with_capacity(rows * FEATURES);
    let mut labels = Vec::with_capacity(rows);
    for _ in 0..rows {
        let class = random.index(CLASSES);
        labels.push(class as u32);
        for feature in 0..FEATURES {
            let noise: f64 = (0..4).map(|_| random.between(-1.0, 1.0)).sum();
            let value = centres[class * FEATURES + feature] + noise;
            values.push(if feature % 3 == 2 { f64::from(value > 0.0) } else { value });
        }
    }
    let names = |prefix: &str, count| (0..count).map(|n| format!("{prefix}{n}")).collect();
    let column = |column: usize| values.iter().skip(column).step_by(FEATURES).copied();
    let columns = (0..FEATURES).flat_map(column).collect();
    Samples::from_columns(names("x", FEATURES), names("c", CLASSES), columns, labels)
        .expect("made-up samples are sound")
}

fn as_csv(parts: [&Samples; 2]) -> String {
    let mut text = format!("split,class,{}\n", parts[0].feature_names().join(","));
    let mut values = vec![0.0; FEATURES];
    for (split, samples) in parts.iter().enumerate() {
        for row in 0..samples.rows() {
            samples.row_into(row, &mut values);
            write!(text, "{split},{}", samples.labels()[row]).expect("a string takes all");
            values.iter().for_each(|v| write!(text, ",{v}").expect("a string takes all"));
            text.push('\n');
        }
    }
    text
}

fn time_fit(name: &str, settings: &Settings, train: &Samples, test: &Samples) {
    let mut best = f64::INFINITY;
    let mut right = 0;
    for _ in 0..3 {
        let start = Instant::now();
        let model = settings.fit(train).expect("default settings fit");
        best = best.min(start.elapsed().as_secs_f64());
        let predicted = predict(&model, test).expect("same features");
        right = predicted.iter().zip(test.labels()).filter(|(said, truth)| said == truth).count();
    }
    println!("{name:20} {best:8.4} s  {:.4}", right as f64 / TESTING_ROWS as f64);
}

fn main() -> std::io::Result<()> {
    let mut random = Random::new(1);
    let centres: Vec<f64> = (0..CLASSES * FEATURES).map(|_| random.between(-0.6, 0.6)).collect();
    let train = made_up(TRAINING_ROWS, &centres, &mut random);
    let test = made_up(TESTING_ROWS, &centres, &mut random);
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(path, as_csv([&train, &test]))?;
    }
    for &kind in ALL {
        time_fit(kind.id(), &Settings::default_of(kind), &train, &test);
    }
    let limited = cart::Settings { max_depth: Some(7), ..Default::default() };
    time_fit("cart depth 7", &Settings::Cart(limited), &train, &test);
    Ok(())
}
