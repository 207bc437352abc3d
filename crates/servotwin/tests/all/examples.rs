//! The example programs run: `cargo test` compiles them, and these tests call them.

use servotwin::prelude::*;
use servotwin_watch::whole_table::watch_table;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

#[path = "../../../../examples/fit_record.rs"]
#[allow(dead_code)]
mod fit_record;
#[path = "../../../../examples/monitor_csv.rs"]
#[allow(dead_code)]
mod monitor_csv;
#[path = "../../../../examples/own_system.rs"]
#[allow(dead_code)]
mod own_system;
#[path = "../../../../examples/simulate_fault.rs"]
#[allow(dead_code)]
mod simulate_fault;
#[path = "../../../../examples/train_and_diagnose.rs"]
#[allow(dead_code)]
mod train_and_diagnose;

fn folder(name: &str) -> PathBuf {
    let name = format!("servotwin-example-{name}-{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn a_fault_is_simulated_and_drawn() {
    let folder = folder("fault");
    let figure = folder.join("leak.svg");
    simulate_fault::simulate_fault(figure.to_str().unwrap(), 0.2).unwrap();
    assert!(std::fs::read_to_string(&figure).unwrap().contains("</svg>"));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_own_system_is_swept() {
    own_system::own_system().unwrap();
}

#[test]
fn a_record_is_fitted() {
    fit_record::fit_record().unwrap();
}

#[test]
fn a_study_is_run_and_its_diagnosis_monitors_a_fault_and_a_log() {
    let folder = folder("study");
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let head = include_str!("../tiny.toml").replace("[0.4, 0.6, 0.8, 1.0]", "[1.0]");
    let text = head + include_str!("../tiny_flights.toml");
    let study = Study::parse(&text, "tiny.toml").unwrap();
    let (out, fault) = (path("out"), "actuator_1.servo_valve.bias_positive");
    train_and_diagnose::train_and_diagnose(&study, &out, fault).unwrap();

    let diagnoser = read_diagnoser(path("out/diagnoser-noise.json")).unwrap();
    let log = path("flight.csv");
    let record = Simulation::new(&study.system)
        .input("command", "noise:rms=3deg,bandwidth=1Hz,seed=99")
        .fault(fault, 1.0)
        .noise(1)
        .sample_period_s(diagnoser.period_s)
        .run()
        .unwrap();
    record.table().unwrap().write(&log).unwrap();
    monitor_csv::monitor_csv(&study, diagnoser.clone(), &log).unwrap();

    let mut monitor = Monitor::new(&study, diagnoser.clone()).unwrap();
    assert_eq!(monitor.set("p_a_11", 0.0).unwrap_err().nearest(), Some("p_a_1"));
    let (table, stop) = (Table::read(&log).unwrap(), AtomicBool::new(false));
    let found = watch_table(&study, &Arc::new(diagnoser), &table, &stop).unwrap();
    let raised = found.changes.iter().find(|(_, finding)| finding.action == "shut_down");
    let (time_s, finding) = raised.expect("a valve with full bias is shut down");
    assert!(*time_s <= 5.0 && finding.actuator_number == Some(1), "{time_s}: {finding}");
    std::fs::remove_dir_all(folder).unwrap();
}
