//! Calibration: numbers worked out by hand, and what must hold for all forecasts.

use crate::tables::log_loss;
use servotwin_diagnosis::Error;
use servotwin_diagnosis::calibration::scale;
use servotwin_diagnosis::random::Random;
use servotwin_learning::calibration;

fn temperature(shares: &[f64], labels: &[u32]) -> f64 {
    calibration::temperature(shares.len() / labels.len(), shares, labels).unwrap()
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
fn temperature_worked_out_by_hand() {
    // Always 80 %, right in 3 of 4: the best is 75 %, so T = ln 4 / ln 3.
    let found = temperature(&[0.8, 0.2].repeat(4), &[0, 0, 1, 0]);
    assert!((found - 4f64.ln() / 3f64.ln()).abs() < 1e-9, "{found}");
    let mut row = [0.8, 0.2];
    scale(&mut row, found);
    assert!((row[0] - 0.75).abs() < 1e-9);
}

#[test]
fn temperature_undoes_what_sharpened_the_probabilities() {
    for sharpened in [0.5, 1.0, 3.0] {
        let (shares, labels) = drawn(20_000, sharpened);
        let found = temperature(&shares, &labels);
        assert!((found / sharpened - 1.0).abs() < 0.05, "{sharpened}: {found}");
        // The least loss of all: no other temperature is better.
        let loss = |temperature: f64| {
            let mut scaled = shares.clone();
            scaled.chunks_exact_mut(3).for_each(|row| scale(row, temperature));
            log_loss(&scaled, &labels)
        };
        assert!([1.0, 0.9 * found, 1.1 * found].iter().all(|&other| loss(other) >= loss(found)));
    }
}

#[test]
fn forecasts_that_are_always_right_or_certain_stay_finite() {
    let right = temperature(&[0.6, 0.4, 0.3, 0.7], &[0, 1]);
    assert!((right - 1.0 / 20.0).abs() < 1e-9, "{right}");
    for labels in [[0, 1], [1, 0]] {
        let found = temperature(&[1.0, 0.0, 0.0, 1.0], &labels);
        assert!((0.049..=20.1).contains(&found), "{found}");
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
    let refused =
        |shares: &[f64], labels: &[u32]| calibration::temperature(2, shares, labels).unwrap_err();
    assert_eq!(refused(&[], &[]), Error::NoSamples);
    assert!(matches!(refused(&[1.0], &[0]), Error::LengthMismatch { .. }));
    assert!(matches!(refused(&[0.5, 0.5], &[2]), Error::LabelOutOfRange { row: 0, .. }));
    for wrong in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(refused(&[wrong, 0.5], &[0]), Error::SettingOutOfRange { .. }));
    }
}
