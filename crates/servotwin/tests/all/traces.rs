//! Traces of measured and nominal signals become windows of features.

use servotwin::evaluation::traces::{TraceError, TraceStudy};
use servotwin::table::{Column, Table};

fn small() -> Table {
    let x: Vec<f64> = (0..40).map(f64::from).collect();
    let class = |k: i32| if k < 20 { "low" } else { "high" }.to_owned();
    Table::from_columns(vec![
        Column::new("x", "", x),
        Column::new("always", "", vec![3.0; 40]),
        Column::new("class", "", (0..40).map(class).collect::<Vec<String>>()),
    ])
    .unwrap()
}

#[test]
fn the_nominal_is_learnt_from_healthy_rows() {
    // y = 2 u + 1 while healthy; the leak takes 0.5 off.
    let u: Vec<f64> = (0..40).map(|k| f64::from(k * 7 % 11)).collect();
    let y: Vec<f64> =
        u.iter().zip(0..).map(|(u, k)| 2.0 * u + if k < 20 { 1.0 } else { 0.5 }).collect();
    let mode = |k: u32| if k < 20 { "none" } else { "leak" }.to_owned();
    let table = Table::from_columns(vec![
        Column::new("u", "", u),
        Column::new("y", "", y),
        Column::new("mode", "", (0..40).map(mode).collect::<Vec<_>>()),
    ])
    .unwrap();
    let text = "format = 1\nwindow_rows = 10\nsegments = 2\nkeep = [\"mode\"]\nfamilies = [\"moments\"]\n\
        [healthy]\nmode = \"none\"\n\
        [[sensors]]\nname = \"y\"\nmeasured = \"y\"\nnominal_from = [\"u\"]\nscale = 1.0\n";
    let features = TraceStudy::parse(text).unwrap().features(&table, None).unwrap();
    assert_eq!(features.names().nth(1), Some("mean_y_part1"));
    let mean = features.f64("mean_y_part2").unwrap();
    assert!(mean[0].abs() < 1e-12 && (mean[3] + 0.5).abs() < 1e-12, "{mean:?}");
    let mut far = table.clone();
    let mut measured = far.take("y").unwrap().numbers().unwrap().into_owned();
    measured[30] = 1e300;
    far.push(Column::new("y", "", measured)).unwrap();
    let error = TraceStudy::parse(text).unwrap().features(&far, None).unwrap_err().to_string();
    assert!(error.starts_with("row 31, column 'y': 1e300 is too far"), "{error}");
    let mut healthy = table.clone();
    healthy.take("mode").unwrap();
    let apart = TraceStudy::parse(&text.replace("[healthy]\nmode = \"none\"\n", "")).unwrap();
    assert!(matches!(apart.features(&table, None), Err(TraceError::NoHealthyRows { .. })));
    assert!(apart.features(&table, Some(&healthy)).unwrap().f64("mean_y_part2").unwrap()[3] < -0.1);
    let refused = |text: &str| TraceStudy::parse(text).unwrap_err().to_string();
    assert!(refused(&text.replace("segments = 2", "segments = 3")).contains("divide window_rows"));
    assert!(
        refused(&text.replace("nominal_from = [\"u\"]\nscale = 1.0\n", ""))
            .contains("a scale is needed")
    );
}

#[test]
fn traces_become_windows_of_features() {
    let study = "format = 1\nwindow_rows = 5\nkeep = [\"class\"]\nfamilies = [\"moments\"]\n\
        [[sensors]]\nname = \"s\"\nmeasured = \"x\"\nnominal = \"always\"\nscale = 2.0\n";
    let features = TraceStudy::parse(study).unwrap().features(&small(), None).unwrap();
    assert_eq!(features.row_count(), 8);
    assert_eq!(features.names().collect::<Vec<_>>(), ["class", "mean_s", "var_s", "no_dev_s"]);
    // (0 + 1 + 2 + 3 + 4)/5 = 2; less 3; over 2.
    assert!((features.f64("mean_s").unwrap()[0] + 0.5).abs() < 1e-12);
    let refused = |text: &str| TraceStudy::parse(text).unwrap_err().to_string();
    assert!(refused(&study.replace("moments", "moment")).contains("did you mean 'moments'"));
    assert!(refused(&study.replace("2.0", "0.0")).contains("above 0"));
    assert!(refused("format = 1\nwindow_rows = 5").contains("nothing to measure"));
    let long = TraceStudy::parse(&study.replace("= 5", "= 21")).unwrap();
    assert!(matches!(long.features(&small(), None), Err(TraceError::NoWindow { longest: 20, .. })));
}
