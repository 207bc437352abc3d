//! Measured signals become windows of features.

use super::folder::Folder;
use servotwin::recordings::{RecordingError, RecordingStudy, Windows};
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

/// The windows of records, with nominal values of their own healthy rows.
fn windows(study: &RecordingStudy, records: &Table) -> Result<Windows, RecordingError> {
    let nominals = study.learn(records, &study.healthy_rows(records)?)?;
    study.windows(records, &nominals)
}

/// A column with other values.
fn changed(table: &Table, name: &str, change: impl Fn(&mut Vec<f64>)) -> Table {
    let mut table = table.clone();
    let mut values = table.take(name).unwrap().numbers().unwrap().into_owned();
    change(&mut values);
    table.push(Column::new(name, "", values)).unwrap();
    table
}

/// y = 2 u + 1 while healthy; the leak takes 0.5 off.
fn leaking() -> Table {
    let u: Vec<f64> = (0..40).map(|k| f64::from(k * 7 % 11)).collect();
    let y: Vec<f64> =
        u.iter().zip(0..).map(|(u, k)| 2.0 * u + if k < 20 { 1.0 } else { 0.5 }).collect();
    let mode = |k: u32| if k < 20 { "none" } else { "leak" }.to_owned();
    Table::from_columns(vec![
        Column::new("u", "", u),
        Column::new("y", "", y),
        Column::new("mode", "", (0..40).map(mode).collect::<Vec<_>>()),
    ])
    .unwrap()
}

const LEAK: &str = "format = 1\nwindow_rows = 10\nsegments = 2\nkeep = [\"mode\"]\nfamilies = [\"moments\"]\n\
    [healthy]\nmode = \"none\"\n\
    [[sensors]]\nname = \"y\"\nmeasured = \"y\"\nnominal_from = [\"u\"]\nscale = 1.0\n";

#[test]
fn the_nominal_is_learned_from_healthy_rows() {
    let table = leaking();
    let study = RecordingStudy::parse(LEAK).unwrap();
    let features = windows(&study, &table).unwrap().table;
    assert_eq!(features.names().nth(1), Some("mean_y_part1"));
    let mean = features.f64("mean_y_part2").unwrap();
    assert!(mean[0].abs() < 1e-12 && (mean[3] + 0.5).abs() < 1e-12, "{mean:?}");
    let far = changed(&table, "y", |y| y[30] = 1e300);
    let error = windows(&study, &far).unwrap_err().to_string();
    assert!(error.starts_with("row 31, column 'y': 1e300 is too far"), "{error}");
    let apart = RecordingStudy::parse(&LEAK.replace("[healthy]\nmode = \"none\"\n", "")).unwrap();
    assert!(matches!(windows(&apart, &table), Err(RecordingError::NoHealthyRows { .. })));
    let all: Vec<usize> = (0..40).collect();
    let of_all = apart.windows(&table, &apart.learn(&table, &all).unwrap()).unwrap();
    assert!(of_all.table.f64("mean_y_part2").unwrap()[3] < -0.1);
    let refused = |text: &str| RecordingStudy::parse(text).unwrap_err().to_string();
    assert!(refused(&LEAK.replace("segments = 2", "segments = 3")).contains("divide window_rows"));
    assert!(
        refused(&LEAK.replace("nominal_from = [\"u\"]\nscale = 1.0\n", ""))
            .contains("a scale is needed")
    );
}

#[test]
fn the_fit_of_a_nominal_is_reported() {
    let study = RecordingStudy::parse(LEAK).unwrap();
    let fits = |table: &Table| {
        let rows = study.healthy_rows(table).unwrap();
        study.fits(&study.learn(table, &rows).unwrap())
    };
    let [exact] = fits(&leaking()).try_into().unwrap();
    assert_eq!((exact.rows, exact.inputs.len(), exact.regressions), (20, 1, 1));
    assert!(exact.r2.unwrap() > 1.0 - 1e-9 && exact.deviation < 1e-9, "{exact:?}");
    let noisy = changed(&leaking(), "y", |y| (0..20).for_each(|k| y[k] += f64::from(k as u8 % 2)));
    let [noisy] = fits(&noisy).try_into().unwrap();
    assert!(noisy.r2.unwrap() < 0.999 && (noisy.deviation - 0.5).abs() < 0.05, "{noisy:?}");
}

#[test]
fn each_condition_has_a_nominal_of_its_own() {
    let text = LEAK
        .replace("keep = [\"mode\"]", "conditions = [\"load\"]")
        .replace("nominal_from = [\"u\"]", "nominal_from = []");
    let study = RecordingStudy::parse(&text).unwrap();
    let load = |k: u32| if k < 10 { "low" } else { "high" }.to_owned();
    let mut table = leaking();
    let y: Vec<f64> = (0..40).map(|k| if k < 10 { 1.0 } else { 5.0 }).collect();
    table.take("y").unwrap();
    table.push(Column::new("y", "", y)).unwrap();
    table.push(Column::new("load", "", (0..40).map(load).collect::<Vec<_>>())).unwrap();
    let found = windows(&study, &table).unwrap().table;
    assert!(found.f64("mean_y_part1").unwrap().iter().all(|mean| mean.abs() < 1e-12));
    let low: Vec<usize> = (0..10).collect();
    let found = study.windows(&table, &study.learn(&table, &low).unwrap()).unwrap().table;
    let mean = found.f64("mean_y_part1").unwrap();
    assert!(mean[0] == 0.0 && mean[1].is_nan(), "no healthy row knows the other load: {mean:?}");
}

#[test]
fn traces_become_windows_of_features() {
    let study = "format = 1\nwindow_rows = 5\nkeep = [\"class\"]\nfamilies = [\"moments\"]\n\
        [[sensors]]\nname = \"s\"\nmeasured = \"x\"\nnominal = \"always\"\nscale = 2.0\n";
    let features = windows(&RecordingStudy::parse(study).unwrap(), &small()).unwrap().table;
    assert_eq!(features.row_count(), 8);
    assert_eq!(features.names().collect::<Vec<_>>(), ["class", "mean_s", "var_s", "no_dev_s"]);
    // (0 + 1 + 2 + 3 + 4)/5 = 2; less 3; over 2.
    assert!((features.f64("mean_s").unwrap()[0] + 0.5).abs() < 1e-12);
    let refused = |text: &str| RecordingStudy::parse(text).unwrap_err().to_string();
    assert!(refused(&study.replace("moments", "moment")).contains("did you mean 'moments'"));
    assert!(refused(&study.replace("2.0", "0.0")).contains("above 0"));
    assert!(refused("format = 1\nwindow_rows = 5").contains("nothing to measure"));
    let long = RecordingStudy::parse(&study.replace("= 5", "= 21")).unwrap();
    assert!(matches!(windows(&long, &small()), Err(RecordingError::NoWindow { longest: 20, .. })));
    let rest = RecordingStudy::parse(&study.replace("= 5", "= 6")).unwrap();
    assert_eq!(windows(&rest, &small()).unwrap().left_over, 4, "3 windows in each run of 20 rows");
}

#[test]
fn a_missing_number_does_not_stop_a_study() {
    let study = "format = 1\nwindow_rows = 5\nkeep = [\"class\"]\nresiduals = [\"x\", \"always\"]\n\
        families = [\"moments\", \"deviation\"]\n";
    let study = RecordingStudy::parse(study).unwrap();
    let one = windows(&study, &changed(&small(), "x", |x| x[4] = f64::NAN)).unwrap();
    assert_eq!((one.incomplete, one.table.f64("mean_x").unwrap()[0]), (1, 1.5));
    assert_eq!(one.table.f64("mean_x").unwrap()[1], 7.0);
    // Without any number of a sensor in a window, the features of the others stay.
    let none = windows(&study, &changed(&small(), "x", |x| x[5..10].fill(f64::NAN))).unwrap();
    assert_eq!(none.incomplete, 5);
    for name in ["mean_x", "var_x", "no_dev_x", "log_dev_x", "largest_x"] {
        let values = none.table.f64(name).unwrap();
        assert!(values[1].is_nan() && values[0].is_finite(), "{name}: {values:?}");
    }
    for name in ["mean_always", "var_always", "no_dev_always", "largest_always"] {
        assert!(none.table.f64(name).unwrap().iter().all(|value| value.is_finite()), "{name}");
    }
}

#[test]
fn logs_of_a_folder_take_the_labels_of_their_record() {
    let folder = Folder::new("recordings");
    let write = |name: &str, text: &str| std::fs::write(folder.file(name), text).unwrap();
    std::fs::create_dir(folder.file("logs")).unwrap();
    write("logs/b.csv", "x,unused\n1,2\n2,3\n3,4\n");
    write("logs/a.jsonl", "{\"x\": 0.5}\n{\"x\": null}\n");
    write("logs/notes.txt", "no log");
    write("labels.csv", "run,state,tank\na,leak,7\nb,none,8\nc,none,8\n");
    let text = "format = 1\nrecords = \"logs\"\nrecord = \"run\"\nlabels = \"labels.csv\"\nwindow_rows = 2\n\
        groups = [\"tank\"]\nresiduals = [\"x\"]\nfamilies = [\"moments\"]\n[[targets]]\ncolumn = \"state\"\n";
    let read = |text: &str| RecordingStudy::parse(text).unwrap().read(&folder.0);
    let records = read(text).unwrap();
    assert_eq!(records.text("run").unwrap(), ["a", "a", "b", "b", "b"]);
    assert_eq!(records.text("state").unwrap(), ["leak", "leak", "none", "none", "none"]);
    let found = windows(&RecordingStudy::parse(text).unwrap(), &records).unwrap();
    assert_eq!(found.table.names().take(3).collect::<Vec<_>>(), ["run", "tank", "state"]);
    assert_eq!(found.table.f64("mean_x").unwrap().as_ref(), [0.5, 1.5]);
    assert_eq!((found.left_over, found.incomplete), (1, 1));
    write("labels.csv", "run,state,tank\nb,none,8\n");
    let error = read(text).unwrap_err().to_string();
    assert_eq!(error, "the labels have 0 rows for the record 'a'");
    let error = read(&text.replace("\"logs\"", "\"log\"")).unwrap_err().to_string();
    assert!(error.contains("log"), "{error}");
    let error = RecordingStudy::parse(&text.replace("record = \"run\"\n", "")).unwrap_err();
    assert!(error.to_string().starts_with("the study needs 'record'"), "{error}");
}
