//! Samples refuse what no classifier could use.

use crate::tables::samples;
use servotwin_diagnosis::Error;
use servotwin_learning::Samples;

fn names(prefix: &str, count: usize) -> Vec<String> {
    (0..count).map(|place| format!("{prefix}{place}")).collect()
}

#[test]
fn not_a_number_is_named_by_column_and_row() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.1e100] {
        let values = vec![1.0, 3.0, 5.0, 2.0, 4.0, bad];
        let error = Samples::from_columns(names("x", 2), names("c", 1), values, vec![0; 3]);
        let error = error.unwrap_err();
        assert_eq!(error, Error::NotFinite { column: "x1".into(), row: 2 });
        assert_eq!(error.to_string(), "feature `x1`, row 2: value is not finite or too large");
    }
}

#[test]
fn sizes_must_agree() {
    let make = |features, classes, values: &[f64], labels: &[u32]| {
        Samples::from_columns(
            names("x", features),
            names("c", classes),
            values.to_vec(),
            labels.to_vec(),
        )
        .unwrap_err()
    };
    assert_eq!(make(1, 1, &[], &[]), Error::NoSamples);
    assert_eq!(make(0, 1, &[], &[0]), Error::NoFeatures);
    let mismatch = Error::LengthMismatch { what: "values", expected: 4, found: 3 };
    assert_eq!(make(2, 1, &[1.0; 3], &[0, 0]), mismatch);
    let label = Error::LabelOutOfRange { row: 1, label: 2, classes: 2 };
    assert_eq!(make(1, 2, &[1.0, 2.0], &[0, 2]), label);
}

#[test]
fn weights_are_checked() {
    let table = samples(&[&[1.0], &[2.0]], &[0, 1]);
    let weighted = |weights: &[f64]| table.clone().with_weights(weights.to_vec());
    assert_eq!(weighted(&[0.0, 0.0]).unwrap_err(), Error::NoSamples);
    let error = Error::WeightOutOfRange { row: 1, weight: -1.0 };
    assert_eq!(weighted(&[1.0, -1.0]).unwrap_err(), error);
    assert!(weighted(&[1.0, f64::NAN]).is_err());
    assert!(weighted(&[1.0]).is_err());
    assert_eq!(weighted(&[1.0, 0.5]).unwrap().weights(), Some(&[1.0, 0.5][..]));
}
