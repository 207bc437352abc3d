//! Calibration: numbers worked out by hand, and what must hold for all forecasts.

use servotwin_diagnosis::Error;
use servotwin_diagnosis::calibration::scale;
use servotwin_diagnosis::random::Random;
use servotwin_learning::calibration::{Forecasts, calibration_error};

fn forecasts<'a>(shares: &'a [f64], labels: &'a [u32]) -> Forecasts<'a> {
    Forecasts::new(shares.len() / labels.len(), shares, labels).unwrap()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12
}

/// Rows whose labels are drawn from the probabilities, which are then sharpened.
fn drawn(rows: usize, sharpened: f64) -> (Vec<f64>, Vec<u32>) {
    let mut random = Random::new(1);
    let (mut shares, mut labels) = (vec![], vec![]);
    for _ in 0..rows {
        let mut row: Vec<f64> = (0..3).map(|_| random.between(0.02, 1.0)).collect();
        scale(&mut row, 1.0);
        let u = random.unit();
        labels.push(u32::from(u > row[0]) + u32::from(u > row[0] + row[1]));
        scale(&mut row, 1.0 / sharpened);
        shares.extend(row);
    }
    (shares, labels)
}

#[test]
fn scores_worked_out_by_hand() {
    let shares = [0.7, 0.2, 0.1, 0.5, 0.25, 0.25];
    let two = forecasts(&shares, &[0, 1]);
    assert!(near(two.log_loss(), -(0.7f64.ln() + 0.25f64.ln()) / 2.0));
    let weighted = two.with_weights(&[3.0, 1.0]).unwrap();
    assert!(near(weighted.log_loss(), -(3.0 * 0.7f64.ln() + 0.25f64.ln()) / 4.0));
    // A perfect forecast costs nothing, a sure wrong one very much.
    assert_eq!(forecasts(&[1.0, 0.0], &[0]).log_loss(), 0.0);
    assert!(forecasts(&[1.0, 0.0], &[1]).log_loss() > 30.0);
}

#[test]
fn reliability_worked_out_by_hand() {
    let shares = [0.9, 0.1, 0.94, 0.06, 0.98, 0.02, 0.45, 0.55, 0.0, 1.0];
    let table = forecasts(&shares, &[0, 0, 1, 1, 1]).reliability(10);
    assert_eq!(table.iter().map(|bin| bin.rows).collect::<Vec<_>>(), [1, 4]);
    assert!(near(table[0].predicted, 0.55) && near(table[0].right, 1.0));
    assert!(near(table[1].predicted, (0.9 + 0.94 + 0.98 + 1.0) / 4.0));
    assert!(near(table[1].right, 0.75) && near(table[1].share, 0.8));
    assert!(near(calibration_error(&table), 0.2 * 0.45 + 0.8 * (0.955 - 0.75)));
}

#[test]
fn weight_two_is_two_rows() {
    let once = [0.9, 0.1, 0.6, 0.4, 0.3, 0.7];
    let twice = [0.9, 0.1, 0.6, 0.4, 0.6, 0.4, 0.3, 0.7];
    let weighted = forecasts(&once, &[0, 1, 1]).with_weights(&[1.0, 2.0, 1.0]).unwrap();
    let plain = forecasts(&twice, &[0, 1, 1, 1]);
    assert!(near(weighted.log_loss(), plain.log_loss()));
    assert!(near(weighted.temperature(), plain.temperature()));
    let errors = [weighted, plain].map(|some| calibration_error(&some.reliability(10)));
    assert!(near(errors[0], errors[1]));
}

#[test]
fn temperature_worked_out_by_hand() {
    // Always 80 %, right in 3 of 4: the best is 75 %, so T = ln 4 / ln 3.
    let shares = [0.8, 0.2].repeat(4);
    let temperature = forecasts(&shares, &[0, 0, 1, 0]).temperature();
    assert!((temperature - 4f64.ln() / 3f64.ln()).abs() < 1e-9, "{temperature}");
    let mut row = [0.8, 0.2];
    scale(&mut row, temperature);
    assert!((row[0] - 0.75).abs() < 1e-9);
}

#[test]
fn temperature_undoes_what_sharpened_the_probabilities() {
    for sharpened in [0.5, 1.0, 3.0] {
        let (shares, labels) = drawn(20_000, sharpened);
        let all = forecasts(&shares, &labels);
        let found = all.temperature();
        assert!((found / sharpened - 1.0).abs() < 0.05, "{sharpened}: {found}");
        let mut scaled = shares.clone();
        scaled.chunks_exact_mut(3).for_each(|row| scale(row, found));
        let better = forecasts(&scaled, &labels);
        assert!(better.log_loss() <= all.log_loss());
        assert!(calibration_error(&better.reliability(10)) < 0.02);
        // The least loss of all: no other temperature is better.
        for factor in [0.9, 1.1] {
            let mut other = shares.clone();
            other.chunks_exact_mut(3).for_each(|row| scale(row, factor * found));
            assert!(forecasts(&other, &labels).log_loss() > better.log_loss());
        }
    }
}

#[test]
fn forecasts_that_are_always_right_or_certain_stay_finite() {
    let right = forecasts(&[0.6, 0.4, 0.3, 0.7], &[0, 1]).temperature();
    assert!((right - 1.0 / 20.0).abs() < 1e-9, "{right}");
    for labels in [[0, 1], [1, 0]] {
        let temperature = forecasts(&[1.0, 0.0, 0.0, 1.0], &labels).temperature();
        assert!((0.049..=20.1).contains(&temperature), "{temperature}");
    }
}

#[test]
fn scaling_keeps_the_order_and_the_sum() {
    let (shares, _) = drawn(200, 1.0);
    for temperature in [0.05, 0.5, 1.0, 2.0, 20.0] {
        for row in shares.chunks_exact(3) {
            let mut scaled = row.to_vec();
            scale(&mut scaled, temperature);
            assert!(near(scaled.iter().sum(), 1.0));
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                assert!(row[a] < row[b] || scaled[a] >= scaled[b]);
            }
        }
    }
    let mut certain = [1.0, 0.0, 0.0];
    scale(&mut certain, 0.05);
    assert_eq!(certain[0], 1.0);
}

#[test]
fn what_is_no_forecast_is_refused() {
    let refused = |shares: &[f64], labels: &[u32]| Forecasts::new(2, shares, labels).unwrap_err();
    assert_eq!(refused(&[], &[]), Error::NoSamples);
    assert!(matches!(refused(&[1.0], &[0]), Error::LengthMismatch { .. }));
    assert!(matches!(refused(&[0.5, 0.5], &[2]), Error::LabelOutOfRange { row: 0, .. }));
    for wrong in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(refused(&[wrong, 0.5], &[0]), Error::SettingOutOfRange { .. }));
    }
    let one = forecasts(&[0.5, 0.5], &[0]);
    assert!(matches!(one.with_weights(&[-1.0]).unwrap_err(), Error::WeightOutOfRange { .. }));
    assert_eq!(one.with_weights(&[0.0]).unwrap_err(), Error::NoSamples);
}
