//! The aileron against independent integrators (`peers/`, results in `golden/`).

use crate::aileron::{Samples, Test, program, test};
use crate::peer_cases::{CASES, DURATION_S, PERIOD_S};
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::SolverSettings;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

/// A golden table: the names of the columns behind `case` and `time_s`, and the
/// rows of each case.
struct Golden {
    names: Vec<String>,
    rows: BTreeMap<String, Vec<Vec<f64>>>,
}

fn golden_text(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../golden").join(file);
    std::fs::read_to_string(path).unwrap()
}

/// The command that CVODE had, whatever the signals have become since.
fn cvode_command() -> Piecewise {
    let text = golden_text("cvode_command.csv");
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let (mut breaks_s, mut pieces) = (Vec::new(), Vec::new());
    for line in lines {
        let numbers: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
        breaks_s.push(numbers[0]);
        pieces.push([numbers[1], numbers[2], numbers[3], numbers[4]]);
    }
    Piecewise::new(breaks_s, pieces).unwrap()
}

fn golden(file: &str) -> Golden {
    let text = golden_text(file);
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names = lines.next().unwrap().split(',').skip(2).map(String::from).collect();
    let mut rows: BTreeMap<String, Vec<Vec<f64>>> = BTreeMap::new();
    for line in lines {
        let (case, numbers) = line.split_once(',').unwrap();
        let numbers = numbers.split(',').skip(1).map(|n| n.parse().unwrap()).collect();
        rows.entry(case.into()).or_default().push(numbers);
    }
    Golden { names, rows }
}

/// The largest difference over the state's scale, and where.
fn largest_error(run: &Samples, golden: &Golden, case: &str) -> (f64, String) {
    let mut worst = (0.0, String::new());
    for (column, name) in golden.names.iter().enumerate() {
        let states = program().states();
        let scale = states.iter().find(|s| s.name == *name).expect("a state").scale;
        let rows = &golden.rows[case];
        let every = (run.of(name).len() - 1) / (rows.len() - 1);
        let ours = run.of(name).iter().enumerate().step_by(every);
        assert_eq!(rows.len(), ours.len());
        for (row, (k, ours)) in rows.iter().zip(ours) {
            let error = (row[column] - ours).abs() / scale;
            if error > worst.0 {
                worst = (error, format!("{name} at {:.1} s", run.time_s[k]));
            }
        }
    }
    worst
}

/// `period_s` is the time between samples, of which those of the peer count.
fn against_cvode(settings: SolverSettings, period_s: f64, allowed: f64) {
    let golden = golden("cvode_aileron.csv");
    let names: Vec<&str> = golden.names.iter().map(String::as_str).collect();
    assert_eq!(names.len(), program().states().len());
    let mut too_large = Vec::new();
    for (case, fault) in CASES {
        let test: Test =
            test().command(cvode_command()).settings(settings).lasting(DURATION_S, period_s);
        let test = match fault {
            Some((id, intensity)) => test.fault(id, intensity),
            None => test,
        };
        let run = test.run(&names);
        let (error, place) = largest_error(&run, &golden, case);
        println!("{case}: {error:.1e} of scale, {place}; {:?}", run.statistics);
        if error > allowed {
            too_large.push(format!("{case}: {error:.1e} {place}"));
        }
    }
    assert!(too_large.is_empty(), "{}", too_large.join("\n"));
}

#[test]
fn val_cvode_aileron_at_the_reference_setting() {
    against_cvode(SolverSettings::reference(), PERIOD_S, 1e-5);
}

#[test]
fn val_cvode_aileron_at_the_settings_of_runs() {
    against_cvode(SolverSettings::of_runs(), 0.01, 1e-4);
}

/// The command of `peers/radau_aileron.py`: its value and slope.
fn smooth_command(time_s: f64) -> (f64, f64) {
    let waves = [(3.0_f64, 0.4), (-2.5, 1.1), (1.0, 2.3)];
    waves.iter().fold((0.0, 0.0), |(value, slope), (amplitude_deg, frequency_hz)| {
        let (amplitude, omega) = (amplitude_deg.to_radians(), TAU * frequency_hz);
        let (sin, cos) = (omega * time_s).sin_cos();
        (value + amplitude * (1.0 - cos), slope + amplitude * omega * sin)
    })
}

#[test]
fn val_scipy_radau_aileron() {
    // Equations written by hand in Python, in another order and another form.
    let golden = golden("scipy_radau_aileron.csv");
    let times: Vec<f64> = (0..=5000).map(|k| f64::from(k) * 2e-3).collect();
    let (values, slopes): (Vec<f64>, Vec<f64>) = times.iter().map(|t| smooth_command(*t)).unzip();
    // Cubics of 2 ms err by 1e-11 rad.
    let command = Piecewise::hermite(&times, &values, &slopes).unwrap();
    let names: Vec<&str> = golden.names.iter().map(String::as_str).collect();
    let run = test()
        .command(command)
        .settings(SolverSettings::reference())
        .lasting(DURATION_S, PERIOD_S)
        .run(&names);
    let (error, place) = largest_error(&run, &golden, "healthy");
    println!("{error:.1e} of scale, {place}");
    assert!(error < 1e-5, "{error:.1e} {place}");
}
