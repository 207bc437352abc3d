//! Measured signals become windows of features.

use super::folder::Folder;
use servotwin::job::{self, JobError};
use servotwin::learn::metrics::Rate;
use servotwin::learn::model_file::read_diagnoser;
use servotwin::measure::{FALSE_ALARM, RIGHT_ANSWER};
use servotwin::parallel::Workers;
use servotwin::recordings::judged::JudgedRecordings;
use servotwin::recordings::{Answers, NominalSource, RecordingError, RecordingStudy, Windows};
use servotwin::simulate::Simulation;
use servotwin::system::System;
use servotwin::table::{Column, Table};
use servotwin_diagnosis::diagnoser::{Diagnoser, IndexedFinding, Session};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

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
    let study = RecordingStudy::parse(LEAK, "study.toml").unwrap();
    let features = windows(&study, &table).unwrap().table;
    assert_eq!(features.names().nth(1), Some("mean_y_part1"));
    let mean = features.f64("mean_y_part2").unwrap();
    assert!(mean[0].abs() < 1e-12 && (mean[3] + 0.5).abs() < 1e-12, "{mean:?}");
    let far = changed(&table, "y", |y| y[30] = 1e300);
    let error = windows(&study, &far).unwrap_err().to_string();
    assert!(error.starts_with("row 31, column 'y': 1e300 is too far"), "{error}");
    let apart =
        RecordingStudy::parse(&LEAK.replace("[healthy]\nmode = \"none\"\n", ""), "study.toml")
            .unwrap();
    assert!(matches!(windows(&apart, &table), Err(RecordingError::NoHealthyRows { .. })));
    let all: Vec<usize> = (0..40).collect();
    let of_all = apart.windows(&table, &apart.learn(&table, &all).unwrap()).unwrap();
    assert!(of_all.table.f64("mean_y_part2").unwrap()[3] < -0.1);
    let refused = |text: &str| RecordingStudy::parse(text, "study.toml").unwrap_err().to_string();
    assert!(refused(&LEAK.replace("segments = 2", "segments = 3")).contains("divide window_rows"));
    assert!(
        refused(&LEAK.replace("nominal_from = [\"u\"]\nscale = 1.0\n", ""))
            .contains("a scale is needed")
    );
}

#[test]
fn the_fit_of_a_nominal_is_reported() {
    let study = RecordingStudy::parse(LEAK, "study.toml").unwrap();
    let fits = |table: &Table| {
        let rows = study.healthy_rows(table).unwrap();
        study.fits(table, &study.learn(table, &rows).unwrap(), &rows).unwrap()
    };
    let [exact] = fits(&leaking()).try_into().unwrap();
    assert_eq!((exact.rows, &exact.source), (20, &NominalSource::Regression(vec!["u".into()], 1)));
    assert!(exact.r2.unwrap() > 1.0 - 1e-9 && exact.deviation < 1e-9, "{exact:?}");
    let noisy = changed(&leaking(), "y", |y| (0..20).for_each(|k| y[k] += f64::from(k as u8 % 2)));
    let [noisy] = fits(&noisy).try_into().unwrap();
    assert!(noisy.r2.unwrap() < 0.999 && (noisy.deviation - 0.5).abs() < 0.05, "{noisy:?}");
    let column = LEAK.replace("nominal_from = [\"u\"]", "nominal = \"u\"");
    let study = RecordingStudy::parse(&column, "study.toml").unwrap();
    let (table, rows) = (leaking(), [0, 1]);
    let [of_column] = study
        .fits(&table, &study.learn(&table, &rows).unwrap(), &rows)
        .unwrap()
        .try_into()
        .unwrap();
    // u = 0, 7 and y = 1, 15: residuals 1 and 8, of a variance of 49.
    assert_eq!(of_column.source, NominalSource::Column("u".into()));
    assert!((of_column.deviation - 32.5_f64.sqrt()).abs() < 1e-12, "{of_column:?}");
    assert!((of_column.r2.unwrap() - (1.0 - 32.5 / 49.0)).abs() < 1e-12, "{of_column:?}");
}

#[test]
fn each_condition_has_a_nominal_of_its_own() {
    let text = LEAK
        .replace("keep = [\"mode\"]", "conditions = [\"load\"]")
        .replace("nominal_from = [\"u\"]", "nominal_from = []");
    let study = RecordingStudy::parse(&text, "study.toml").unwrap();
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
    let features =
        windows(&RecordingStudy::parse(study, "study.toml").unwrap(), &small()).unwrap().table;
    assert_eq!(features.row_count(), 8);
    assert_eq!(features.names().collect::<Vec<_>>(), ["class", "mean_s", "var_s", "no_dev_s"]);
    // (0 + 1 + 2 + 3 + 4)/5 = 2; less 3; over 2.
    assert!((features.f64("mean_s").unwrap()[0] + 0.5).abs() < 1e-12);
    let refused = |text: &str| RecordingStudy::parse(text, "study.toml").unwrap_err().to_string();
    assert!(refused(&study.replace("moments", "moment")).contains("nearest: 'moments'"));
    assert!(refused(&study.replace("2.0", "0.0")).contains("out of range"));
    assert!(refused("format = 1\nwindow_rows = 5").contains("nothing to measure"));
    let long = RecordingStudy::parse(&study.replace("= 5", "= 21"), "study.toml").unwrap();
    assert!(matches!(windows(&long, &small()), Err(RecordingError::NoWindow { longest: 20, .. })));
    let rest = RecordingStudy::parse(&study.replace("= 5", "= 6"), "study.toml").unwrap();
    assert_eq!(windows(&rest, &small()).unwrap().left_over, 4, "3 windows in each run of 20 rows");
}

#[test]
fn a_missing_number_does_not_stop_a_study() {
    let study = "format = 1\nwindow_rows = 5\nkeep = [\"class\"]\nresiduals = [\"x\", \"always\"]\n\
        families = [\"moments\", \"deviation\"]\n";
    let study = RecordingStudy::parse(study, "study.toml").unwrap();
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
    write("logs/a.csv", "x\n0.5\nNA\n");
    write("logs/notes.txt", "no log");
    write("labels.csv", "run,state,tank\na,leak,7\nb,none,8\nc,none,8\n");
    let text = "format = 1\nrecords = \"logs\"\nrecord = \"run\"\nlabels = \"labels.csv\"\nwindow_rows = 2\n\
        groups = [\"tank\"]\nresiduals = [\"x\"]\nfamilies = [\"moments\"]\n[[targets]]\ncolumn = \"state\"\n";
    let read = |text: &str| RecordingStudy::parse(text, "study.toml").unwrap().read(&folder.0);
    let records = read(text).unwrap();
    assert_eq!(records.text("run").unwrap(), ["a", "a", "b", "b", "b"]);
    assert_eq!(records.text("state").unwrap(), ["leak", "leak", "none", "none", "none"]);
    let found = windows(&RecordingStudy::parse(text, "study.toml").unwrap(), &records).unwrap();
    assert_eq!(found.table.names().take(3).collect::<Vec<_>>(), ["run", "tank", "state"]);
    assert_eq!(found.table.f64("mean_x").unwrap().as_ref(), [0.5, 1.5]);
    assert_eq!((found.left_over, found.incomplete), (1, 1));
    write("logs/run_10.csv", "x\n7\n");
    write("logs/run_9.csv", "x\n8\n");
    let unlabeled = read(
        &text
            .replace("labels = \"labels.csv\"\n", "")
            .replace("\"tank\"", "\"run\"")
            .replace("\"state\"", "\"run\""),
    );
    assert_eq!(unlabeled.unwrap().text("run").unwrap()[5..], ["run_9", "run_10"]);
    write("labels.csv", "run,state,tank\nb,none,8\n");
    let error = read(text).unwrap_err().to_string();
    assert_eq!(error, "the labels have 0 rows for the record 'a'");
    let error = read(&text.replace("\"logs\"", "\"log\"")).unwrap_err().to_string();
    assert!(error.contains("log"), "{error}");
    let error =
        RecordingStudy::parse(&text.replace("record = \"run\"\n", ""), "study.toml").unwrap_err();
    assert!(error.to_string().contains("labels need 'record'"), "{error}");
}

/// A study of two tanks in six runs each: a leak lowers y by 1, and each run has an offset of its own.
const RUNS: &str = "format = 1\nwindow_rows = 4\ngroups = [\"run\"]\nfamilies = [\"moments\", \"deviation\"]\n\
    residuals = [\"y\", \"z\"]\n[[targets]]\ncolumn = \"state\"\nhealthy = \"none\"\n";

fn runs(offset: impl Fn(usize) -> f64) -> Table {
    let rows = 0..12 * 40;
    let is_leak = |row: usize| row / 20 % 2 == 1;
    let noise = |row: usize, k: usize| ((row * k % 17) as f64 - 8.0) / 100.0;
    let y = |row: usize| offset(row / 40) + noise(row, 5) - if is_leak(row) { 1.0 } else { 0.0 };
    let text = |of: &dyn Fn(usize) -> String| rows.clone().map(of).collect::<Vec<_>>();
    Table::from_columns(vec![
        Column::new("y", "", rows.clone().map(y).collect::<Vec<f64>>()),
        Column::new("z", "", rows.clone().map(|row| noise(row, 3)).collect::<Vec<f64>>()),
        Column::new("run", "", text(&|row| (row / 40).to_string())),
        Column::new("state", "", text(&|row| if is_leak(row) { "leak" } else { "none" }.into())),
    ])
    .unwrap()
}

fn answer(diagnoser: &Diagnoser, record: &Table) -> Result<Answers, RecordingError> {
    Answers::of(diagnoser, diagnoser.recorded.as_ref().unwrap(), record)
}

fn judged(text: &str, records: &Table) -> JudgedRecordings {
    RecordingStudy::parse(text, "study.toml")
        .unwrap()
        .judge(text, records, Workers::new(2))
        .unwrap()
}

#[test]
fn windows_are_judged_by_what_other_groups_teach() {
    let judged = judged(RUNS, &runs(|run| 0.01 * run as f64));
    let [cart, forest] = judged.results.targets.as_slice() else { panic!("two classifiers") };
    for target in [cart, forest] {
        let right = target.rates.of(&RIGHT_ANSWER);
        assert_eq!((right.count, right.of), (120, 120));
        let of_class = |(name, right): &(String, Rate)| (name.clone(), right.count, right.of);
        let classes: Vec<_> = target.classes.iter().map(of_class).collect();
        assert_eq!(classes, [("leak".into(), 60, 60), ("none".into(), 60, 60)]);
        assert_eq!(target.rates.of(&FALSE_ALARM).of, 60);
    }
    let outcomes = &judged.outcomes;
    assert_eq!(outcomes.row_count(), 240, "a row for each window and classifier");
    let (groups, folds) = (outcomes.text("group").unwrap(), outcomes.u32("fold").unwrap());
    for (group, fold) in groups.iter().zip(folds.iter()) {
        let first = groups.iter().position(|known| known == group).unwrap();
        assert_eq!(*fold, folds[first], "group {group} is in two folds");
    }
    // What only identifies the run teaches nothing about another one.
    let by_run = runs(|run| 10.0 * run as f64 + if run % 2 == 0 { 0.0 } else { 0.5 });
    let lost = self::judged(RUNS, &by_run);
    let lost = &lost.results.targets[0];
    let right = lost.rates.of(&RIGHT_ANSWER);
    assert!(right.share.unwrap() < 0.8);
    assert_eq!(lost.classes.iter().map(|(_, own)| own.count).sum::<u64>(), right.count);
}

#[test]
fn a_sensor_that_is_silent_for_some_windows_is_learned_around() {
    let records = changed(&runs(|_| 0.0), "z", |z| {
        z[8..24].fill(f64::NAN);
        z[100] = f64::NAN;
    });
    let judged = judged(RUNS, &records);
    assert_eq!(judged.results.incomplete_rows, 17);
    for target in &judged.results.targets {
        assert_eq!(target.rates.of(&RIGHT_ANSWER).count, 120, "{:?}", target.classifier);
    }
}

#[test]
fn without_groups_consecutive_windows_are_held_out_together() {
    let text = RUNS.replace("groups = [\"run\"]\n", "");
    let judged = judged(&text, &runs(|_| 0.0));
    let folds = judged.windows.u32("fold").unwrap();
    assert_eq!(folds[..5], [0, 1, 2, 3, 4], "a run of 20 rows has 5 windows: {folds:?}");
    let long = self::judged(&text.replace("window_rows = 4", "window_rows = 2"), &runs(|_| 0.0));
    assert_eq!(long.windows.u32("fold").unwrap()[..10], [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]);
}

#[test]
fn a_group_unlike_the_first_healthy_ones_is_found_and_false_alarms_are_counted() {
    let text = RUNS.replace("[[targets]]\ncolumn = \"state\"\nhealthy = \"none\"\n", "")
        + "[healthy]\ncondition = \"good\"\n[novelty]\nhealthy_groups = 3\n";
    let good = |run: usize| if run < 8 { "good" } else { "worn" }.to_owned();
    let records = |offset: &dyn Fn(usize) -> f64| {
        let mut records = runs(offset);
        let condition: Vec<String> = (0..480).map(|row| good(row / 40)).collect();
        records.push(Column::new("condition", "", condition)).unwrap();
        records
    };
    let worn = judged(&text, &records(&|run| if run < 8 { 0.0 } else { run as f64 }));
    let novelty = worn.results.novelty.unwrap();
    assert_eq!((novelty.false_alarms.count, novelty.false_alarms.of), (0, 50), "5 later groups");
    assert_eq!((novelty.alarms.count, novelty.alarms.of), (40, 40));
    let distances: Vec<f64> = novelty.groups.iter().map(|group| group.mean_distance).collect();
    assert!(distances[8] > 1.0 && distances[7] < 0.5, "{distances:?}");
    // A later healthy group that differs is a false alarm, and so is one of the first among the others.
    let odd = judged(&text, &records(&|run| if run == 1 || run == 6 { 5.0 } else { 0.0 }));
    let novelty = odd.results.novelty.unwrap();
    assert_eq!(novelty.groups[1].unknown.count, 10, "it is judged by what the others teach");
    assert_eq!(novelty.false_alarms.count, 0, "it taught that 5 is healthy");
    let late = judged(&text, &records(&|run| if run == 6 { 5.0 } else { 0.0 }));
    assert_eq!(late.results.novelty.unwrap().false_alarms.count, 10);
    let study = RecordingStudy::parse(&text.replace("= 3", "= 9"), "study.toml").unwrap();
    let error = study.judge("", &records(&|_| 0.0), Workers::new(1)).unwrap_err().to_string();
    assert!(error.starts_with("healthy_groups (8 are healthy) must be"), "{error}");
}

#[test]
fn results_are_written_beside_each_other_but_not_over_those_of_a_simulated_study() {
    let folder = Folder::new("recordings-written");
    let judged = judged(RUNS, &runs(|_| 0.0));
    let out = job::Folder::new(&folder.0);
    judged.write(&out).unwrap();
    let names = [
        "diagnoser-of-state.json",
        "outcomes.parquet",
        "recordings.json",
        "study.toml",
        "windows.parquet",
    ];
    assert!(names.iter().all(|name| folder.file(name).exists()), "{:?}", folder.names());
    let read = read_diagnoser(folder.file("diagnoser-of-state.json")).unwrap();
    assert_eq!(read, judged.diagnosers[0].1);
    judged.write(&out).unwrap();
    folder.write("evaluation.json", "{}");
    assert!(matches!(judged.write(&out), Err(JobError::OtherResults { count: 1, .. })));
}

#[test]
fn a_model_answers_for_a_record_without_labels() {
    let records = runs(|_| 0.0);
    let (_, mut diagnoser) = judged(RUNS, &records).diagnosers.remove(0);
    let mut new = records.rows(0..42);
    for column in ["run", "state"] {
        new.take(column).unwrap();
    }
    let answers = answer(&diagnoser, &new).unwrap();
    let said = answers.findings.iter().map(|finding| diagnoser.describe(*finding));
    assert_eq!(said.collect::<Vec<_>>(), [["healthy"; 5], ["leak"; 5]].concat());
    assert!(answers.distances.iter().all(|distance| *distance == 0.0));
    assert_eq!(answers.windows.left_over, 2);
    let mut session = Session::new(Arc::new(diagnoser.clone())).unwrap().at_rest();
    for row in 20..24 {
        let measured = ["y", "z"].map(|name| new.f64(name).unwrap()[row]);
        session.push(&[], &measured, &[0.0; 2]);
    }
    let finding = session.outcome().finding;
    assert_eq!(diagnoser.describe(finding), "leak", "a session judges a window alike");
    let recorded = diagnoser.recorded.as_mut().unwrap();
    recorded.study = RUNS.replace("\"y\", \"z\"", "\"z\", \"y\"");
    let error = answer(&diagnoser, &new).unwrap_err().to_string();
    assert!(error.contains("features"), "exchanged sensors: {error}");
}

#[test]
fn a_damaged_model_is_refused() {
    let folder = Folder::new("recordings-damaged");
    let text = RUNS.replace("residuals = [\"y\", \"z\"]\n", "")
        + "[[sensors]]\nname = \"y\"\nmeasured = \"y\"\nnominal_from = []\n";
    judged(&text, &runs(|_| 0.0)).write(&job::Folder::new(&folder.0)).unwrap();
    let model = std::fs::read_to_string(folder.file("diagnoser-of-state.json")).unwrap();
    let rest = model.split_once("\",\n").unwrap().1;
    let cases = [
        ("servotwin diagnoser 1", "servotwin diagnoser 2"),
        ("window_rows = 4", "window_rows = 0"),
        ("nominal_from = []", "scale = 1.0"),
        ("\"features\": [", "\"features\": [ \"more\","),
    ];
    for (known, other) in cases {
        assert!(rest.contains(known), "{known}");
        let path = folder.write("damaged.json", format!("{{\n{}", rest.replacen(known, other, 1)));
        let answered = read_diagnoser(&path).map(|own| answer(&own, &runs(|_| 0.0)).is_ok());
        assert!(!answered.unwrap_or(false), "{other}");
    }
}

#[test]
fn nominal_values_come_from_a_twin_of_every_record() {
    let folder = Folder::new("recordings-twin");
    std::fs::create_dir(folder.file("logs")).unwrap();
    let system = System::read("press_axis").unwrap();
    let mut labels = String::from("run,state\n");
    let logged = |run: usize, intensity: f64| {
        let command = format!("noise:rms=25mm,bandwidth=0.7Hz,limit=100mm,seed={}", 1 + run);
        let simulation = Simulation::new(&system).input("command", command).duration_s(3.99);
        simulation
            .fault("valve.gain_low", intensity)
            .noise(run as u64)
            .run()
            .unwrap()
            .table()
            .unwrap()
    };
    for run in 0..8 {
        let is_low = run % 2 == 1;
        let path = folder.file(&format!("logs/{run}.csv"));
        logged(run, if is_low { 0.5 } else { 0.0 }).write(path).unwrap();
        labels += &format!("{run},{}\n", if is_low { "low" } else { "none" });
    }
    folder.write("labels.csv", labels);
    let sensor = |id: &str, column: &str, scale: &str| {
        format!(
            "[[sensors]]\nname = \"{id}\"\nmeasured = \"{column}\"\nnominal = \"twin.{id}\"\nscale = {scale}\n"
        )
    };
    let text = "format = 1\nrecords = \"logs\"\nrecord = \"run\"\nlabels = \"labels.csv\"\ngroups = [\"run\"]\n\
        window_rows = 100\n[twin]\nsystem = \"press_axis\"\nperiod_s = 0.01\ninputs = { command = \"command_m\" }\n\
        [[targets]]\ncolumn = \"state\"\nhealthy = \"none\"\n"
        .to_owned()
        + &sensor("x_p", "x_p_m", "0.15")
        + &sensor("x_v", "x_v_m", "1e-3");
    let study = RecordingStudy::parse(&text, "study.toml").unwrap();
    let records = study.read(&folder.0).unwrap();
    let judged = study.judge(&text, &records, Workers::new(2)).unwrap();
    for fit in &judged.results.nominals {
        assert_eq!(fit.source, NominalSource::Column(format!("twin.{}", fit.sensor)));
        assert!(fit.rows == 1600 && fit.r2.unwrap() > 0.99, "the twin is the plant: {fit:?}");
    }
    let accuracy = judged.results.targets[1].rates.of(&RIGHT_ANSWER);
    assert!(accuracy.of == 32 && accuracy.count >= 30, "{accuracy:?}");
    let mut new = logged(9, 0.5);
    new.push(Column::new("twin.x_p", "", vec![0.0; 400])).unwrap();
    let diagnoser = &judged.diagnosers[0].1;
    let findings = answer(diagnoser, &new).unwrap().findings;
    let is_low = |own: &IndexedFinding| diagnoser.describe(*own) == "low";
    assert!(findings.len() == 4 && findings.iter().all(is_low), "its own twin runs beside it");
    let unknown =
        RecordingStudy::parse(&text.replace("twin.x_v", "twin.x_y"), "study.toml").unwrap();
    let error = unknown.read(&folder.0).unwrap_err().to_string();
    assert!(error.starts_with("the twin of the record '0':"), "{error}");
}

/// The public records, which stand in `../shared/data` beside the repository, or where `SERVOTWIN_DATA` points. Without
/// them, nothing is tested.
fn data() -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = std::env::var_os("SERVOTWIN_DATA").map_or_else(|| beside.into(), PathBuf::from);
    let is_there = root.is_dir();
    if !is_there {
        eprintln!("{} is not there: nothing tested", root.display());
    }
    is_there.then_some(root)
}

/// Runs the study of public records in a folder that holds them.
fn public(name: &str, folder: &Path) -> JudgedRecordings {
    let path = format!("{}/../../studies/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let study = RecordingStudy::parse(&text, "study.toml").unwrap();
    study.judge(&text, &study.read(folder).unwrap(), Workers::all()).unwrap()
}

/// The shares of right answers, with those of scikit-learn 1.9.1 on the same windows and folds, and what is asked.
fn compare(judged: &JudgedRecordings, peers: &[(&str, f64, f64)]) {
    let forests = judged.results.targets.iter().filter(|t| t.classifier.id() == "random_forest");
    for (target, (name, sklearn, least)) in forests.zip(peers) {
        assert_eq!(target.column, *name);
        let ours = target.rates.of(&RIGHT_ANSWER).share.unwrap();
        println!("{name}: {ours:.4}, scikit-learn {sklearn}");
        assert!(ours >= *least && ours >= sklearn - 0.01, "{name}: {ours}");
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn val_sklearn_zema_hydraulic_rig() {
    let Some(data) = data() else { return };
    let folder = Folder::new("zema");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../peers/recordings.py");
    let status = Command::new("python3").args([script, "zema"]).args([&data, &folder.0]).status();
    assert!(status.expect("python3 runs").success());
    let judged = public("zema_hydraulic", &folder.0);
    assert_eq!((judged.results.windows, judged.results.left_over_rows), (2205, 0));
    let peers = [
        ("cooler", 0.9950, 0.99),
        ("valve", 0.9982, 0.99),
        ("pump", 0.9986, 0.99),
        ("accumulator", 0.9710, 0.94),
    ];
    compare(&judged, &peers);
}

/// Issue 59 asks for 0.90. Rows in random folds give 0.91, but a row is like its neighbors in time, and consecutive
/// folds, in which the first part of every mode is unlike the rest, give less to both programs.
#[test]
#[ignore = "slow: ./check --all"]
fn val_sklearn_liu_engine_residuals() {
    let Some(data) = data() else { return };
    let judged = public("liu_engine", &data.join("liu_engine_residuals"));
    assert_eq!((judged.results.windows, judged.results.left_over_rows), (408, 8));
    compare(&judged, &[("mode", 0.8088, 0.80)]);
}

#[test]
#[ignore = "slow: ./check --all"]
fn the_last_sessions_of_an_actuator_run_to_failure_are_unlike_the_first() {
    let Some(data) = data() else { return };
    let novelty = public("reprise", &data.join("reprise")).results.novelty.unwrap();
    let alarms = novelty.false_alarms;
    println!("false alarms: {} of {} windows of later healthy sessions", alarms.count, alarms.of);
    assert!(alarms.of > 500 && alarms.share.unwrap() <= 0.01, "{alarms:?}");
    let [.., ninth, eleventh, twelfth] = novelty.groups.as_slice() else { panic!("16 sessions") };
    let last = [ninth, eleventh, twelfth].map(|group| group.mean_distance);
    assert!(last.is_sorted() && last[0] > 0.5, "the way to failure in October 2017: {last:?}");
    let before = &novelty.groups[..novelty.groups.len() - 3];
    assert!(before.iter().all(|group| group.mean_distance < 0.2), "{before:?}");
}
