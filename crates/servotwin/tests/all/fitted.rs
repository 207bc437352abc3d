//! The fitted scenario: specimens beside twins that were fitted to them in a calibration flight.

use crate::folder::Folder;
use servotwin::parallel::Workers;
use servotwin::records::{PartRow, Records, RunError, calibration_file};
use servotwin::run::plan;
use servotwin::study::{Purpose, Scenario, Study};
use servotwin::table::{Column, Table};
use std::collections::BTreeSet;

/// The spring actuator with two kinds of fault, short flights, and a section [fitted].
fn text(fitted: &str) -> String {
    let text = include_str!("../../../../studies/spring_actuator.toml");
    let (head, rest) = text.split_once("[[classes]]").unwrap();
    let (_, realistic) = rest.split_once("[realistic]").unwrap();
    let classes = "[[classes]]\ndetail = \"leak\"\naction = \"shut_down\"\n\
                   faults = [\"leakage_a.leakage\", \"servo_valve.gain_low\"]\n";
    let head = head.replace("duration_s = 30", "duration_s = 6");
    format!("{head}{classes}\n[realistic]{realistic}\n{fitted}")
}

const FITTED: &str = "[fitted]\ncommand = \"noise:rms=5deg,bandwidth=1Hz,seed=9\"\nduration_s = 12\n\
                      judge = 20\nlearn = 6\nin_each_case = 5\n";

fn study(fitted: &str) -> Study {
    Study::parse(&text(fitted), "spring.toml").unwrap()
}

fn records<'s>(
    study: &'s Study,
    scenario: Scenario,
    folder: &Folder,
    threads: usize,
) -> Records<'s> {
    let suite = (Purpose::Test, vec![scenario]);
    Records::new(&folder.0, study, suite, Workers::new(threads)).unwrap()
}

fn rows(records: &Records) -> Vec<PartRow> {
    let outcome = records.run(&|_, _| ()).unwrap();
    assert!(outcome.failed.is_empty());
    records.windows().unwrap().remove(0)
}

/// For each healthy specimen the largest of the means of its scaled residuals: what no noise hides.
fn means(records: &Records) -> Vec<f64> {
    let Records { study, suite, .. } = records;
    let is_healthy = |number| plan::run(study, suite, number).fault.is_none();
    let healthy = rows(records).into_iter().zip(0..).filter(|(_, number)| is_healthy(*number));
    let largest = |row: PartRow| {
        let sensors = 0..row.window.sensors();
        sensors.map(|sensor| row.window.mean(sensor).abs()).fold(0.0, f64::max)
    };
    healthy.map(|(row, _)| largest(row)).collect()
}

#[test]
fn beside_a_fitted_twin_a_healthy_specimen_leaves_little() {
    let study = study(FITTED);
    let worst = |scenario: Scenario| {
        let folder = Folder::new(&format!("left-{}", scenario.name()));
        let means = means(&records(&study, scenario, &folder, 2));
        assert_eq!(means.len(), 80);
        means.into_iter().fold(0.0, f64::max)
    };
    let (fitted, realistic) = (worst(Scenario::Fitted), worst(Scenario::Realistic));
    assert!(fitted < 0.25 * realistic, "{fitted} {realistic}");
}

#[test]
fn the_pool_is_fitted_and_told_with_its_true_values() {
    let study = study(FITTED);
    let folder = Folder::new("pool");
    records(&study, Scenario::Fitted, &folder, 2).run(&|_, _| ()).unwrap();
    let table = Table::read(calibration_file(&folder.0, Purpose::Test)).unwrap();
    // Twenty specimens with two tolerances.
    assert_eq!(table.row_count(), 40);
    let specimens: BTreeSet<u32> = table.u32("specimen").unwrap().iter().copied().collect();
    assert_eq!(specimens.len(), 20);
    let column = |name: &str| table.f64(name).unwrap().into_owned();
    let (truth, fitted, error) =
        (column("true_sigma"), column("fitted_sigma"), column("error_sigma"));
    let off = |k: usize| ((truth[k] - fitted[k]) / error[k]).abs();
    // Forty draws with 95 %: fewer than 34 have a probability below 1 in 1000.
    assert!((0..40).filter(|&k| off(k) <= 1.96).count() >= 34);
    assert!((0..40).all(|k| error[k] < 0.3));
    let spread = truth.iter().map(|z| z * z).sum::<f64>() / 40.0;
    assert!((0.4..2.0).contains(&spread), "{spread}");
}

#[test]
fn threads_and_interruptions_change_no_bit() {
    let study = study(FITTED);
    let files = |folder: &Folder| {
        let name = |name: &str| std::fs::read(folder.file(name)).unwrap();
        (name("dataset-fitted.parquet"), name("calibration-fitted.parquet"))
    };
    let (calm, broken) = (Folder::new("calm"), Folder::new("broken"));
    rows(&records(&study, Scenario::Fitted, &calm, 1));
    rows(&records(&study, Scenario::Fitted, &broken, 2));
    assert!(files(&calm) == files(&broken));
    // What is lost is made again, and only that.
    let parts = std::fs::read_dir(broken.file("parts")).unwrap();
    std::fs::remove_file(parts.into_iter().next().unwrap().unwrap().path()).unwrap();
    std::fs::remove_file(broken.file("calibration-fitted.parquet")).unwrap();
    rows(&records(&study, Scenario::Fitted, &broken, 2));
    assert!(files(&calm) == files(&broken));
}

#[test]
fn what_the_setting_needs_is_told() {
    let none = study("");
    let folder = Folder::new("none");
    let suite = (Purpose::Test, vec![Scenario::Fitted]);
    let error = Records::new(&folder.0, &none, suite, Workers::new(1)).err().unwrap();
    assert!(matches!(error, RunError::NoSection { scenario: Scenario::Fitted, .. }));
    assert!(error.to_string().contains("[fitted]"), "{error}");
    assert!(Scenario::groups(&none, |_| true).iter().flatten().all(|s| *s != Scenario::Fitted));
    assert!(Scenario::groups(&study(FITTED), |_| true).contains(&vec![Scenario::Fitted]));
    let wrong = |from: &str, to: &str| {
        let text = text(&FITTED.replace(from, to));
        Study::parse(&text, "spring.toml").map(drop).unwrap_err().to_string()
    };
    let each = wrong("in_each_case = 5", "in_each_case = 7");
    assert!(each.contains("in_each_case") && each.contains("at most judge"), "{each}");
    let short = wrong("duration_s = 12", "duration_s = 1");
    assert!(short.contains("duration_s") && short.contains("5 … 10000 s"), "{short}");
    let signal = wrong("noise:rms=5deg,bandwidth=1Hz,seed=9", "noise:rms=5deg");
    assert!(signal.contains("bandwidth"), "{signal}");
}

#[test]
fn parts_take_the_pool_over_and_give_the_bytes_of_one_machine() {
    let study = study(FITTED);
    let (whole, parts) = (Folder::new("whole"), Folder::new("parts"));
    let file = |folder: &Folder, name: &str| std::fs::read(folder.file(name)).unwrap();
    let (data_set, pool) = ("dataset-fitted.parquet", "calibration-fitted.parquet");
    let one = records(&study, Scenario::Fitted, &whole, 2);
    rows(&one);
    // By another number of threads.
    let other = records(&study, Scenario::Fitted, &parts, 1);
    other.calibrate().unwrap();
    assert!(file(&parts, pool) == file(&whole, pool));
    for part in (0..other.part_count()).rev() {
        other.run_parts(&[part], &|_, _| ()).unwrap();
    }
    assert!(!parts.file(data_set).exists());
    // Only the parts may have been copied together.
    std::fs::remove_file(parts.file(pool)).unwrap();
    other.run(&|_, _| ()).unwrap();
    assert!(file(&parts, pool) == file(&whole, pool));
    assert!(file(&parts, data_set) == file(&whole, data_set));

    // The file is what is flown with, unless it is of something else.
    let bent = Folder::new("bent");
    let third = records(&study, Scenario::Fitted, &bent, 2);
    let known = Table::read(whole.file(pool)).unwrap();
    let rows = known.row_count();
    let mut columns = known.columns().to_vec();
    let place = columns.iter().position(|column| column.name == "fitted_sigma").unwrap();
    columns[place] = Column::new("fitted_sigma", "", vec![0.0; rows]);
    let mut bare = Table::from_columns(columns).unwrap();
    bare.metadata = known.metadata.clone();
    bare.write(bent.file(pool)).unwrap();
    third.run(&|_, _| ()).unwrap();
    assert!(file(&bent, data_set) != file(&whole, data_set));
    bare.metadata.clear();
    std::fs::remove_dir_all(bent.file("parts")).unwrap();
    bare.write(bent.file(pool)).unwrap();
    third.run(&|_, _| ()).unwrap();
    assert!(file(&bent, data_set) == file(&whole, data_set));
}
