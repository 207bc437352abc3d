//! How long one live sample takes, twin and diagnosis included: `cargo bench -p servotwin --bench live`.
//!
//! Learns a small diagnoser, flies a healthy and a faulty flight at 100 Hz with the runtime beside the
//! plant, and prints median, p99.9 and largest time of [`Runtime::push`], as ratios to the time there
//! is, and how many such actuators one core can watch; by lists and, where there is a C compiler, by the compiled step.

use servotwin::job::Folder;
use servotwin::job::Job;
use servotwin::live::closed_loop::{self, ClosedLoop, FlightRecord};
use servotwin::live::runtime::Runtime;
use servotwin::study::{Scenario, Study};
use servotwin_model::lanes::Level;
use servotwin_model::program::FaultAt;
use servotwin_model::signal::Piecewise;
use std::sync::Arc;
use std::time::Instant;

/// Length of the flights, s.
const DURATION_S: f64 = 120.0;

fn main() {
    let study = Study::default();
    let folder = std::env::temp_dir().join("servotwin-bench-live");
    std::fs::create_dir_all(&folder).expect("a folder");
    let diagnoser = Job::new(&study, &Folder::new(&folder)).learn(Scenario::Realistic);
    let diagnoser = Arc::new(diagnoser.expect("a diagnoser"));
    let network = study.system.network();
    let mut inputs: Vec<Piecewise> = network
        .inputs
        .iter()
        .map(|input| Piecewise::constant(input.default).expect("a default"))
        .collect();
    let command: servotwin::signal::Signal =
        "noise:rms=3deg,bandwidth=1Hz,seed=5".parse().expect("a signal");
    let unit = network.inputs[study.command_input].unit;
    inputs[study.command_input] = command.build(unit, DURATION_S).expect("a signal");
    let (component, fault) =
        study.system.program.find_fault("actuator_1.leakage_a.leakage").expect("a fault");
    let leak = FaultAt { component, fault, intensity: 0.5 };
    let flown = [("healthy", vec![]), ("leaking", vec![(5.0, leak)])].map(|(name, faults)| {
        let scenario = ClosedLoop {
            study: &study,
            inputs: inputs.clone(),
            faults,
            duration_s: DURATION_S,
            specimen: Some(1),
            reacts: false,
        };
        (name, closed_loop::fly(&scenario, &diagnoser, &[]).expect("a flight"))
    });
    let time = |step: &str| {
        for (name, record) in &flown {
            let runtime = Runtime::new(&study, diagnoser.clone(), vec![]).expect("a runtime");
            print_times(
                &format!("{name}, {step}"),
                study.sample_period_s,
                times_us(runtime, record),
            );
        }
    };
    time("by lists");
    let compiled = study.system.compiled.steps(&study.system.program, Level::Single);
    if compiled.is_some() {
        time("compiled");
    }
}

/// How long every sample but the first takes, us.
fn times_us(mut runtime: Runtime, record: &FlightRecord) -> Vec<f64> {
    let sample = |columns: &[Vec<f64>], k: usize| -> Vec<f64> {
        columns.iter().map(|column| column[k]).collect()
    };
    let mut times_us = vec![];
    for k in 0..record.time_s.len() {
        let (inputs, measured) = (sample(&record.inputs, k), sample(&record.measured, k));
        let begin = Instant::now();
        runtime.push(&inputs, &measured).expect("a sample");
        if k > 0 {
            times_us.push(1e6 * begin.elapsed().as_secs_f64());
        }
    }
    times_us
}

fn print_times(name: &str, period_s: f64, mut times_us: Vec<f64>) {
    times_us.sort_by(f64::total_cmp);
    let at = |share: f64| times_us[((times_us.len() - 1) as f64 * share) as usize];
    let mean = times_us.iter().sum::<f64>() / times_us.len() as f64;
    let period_us = 1e6 * period_s;
    println!(
        "{name}: median {:.1} us, mean {mean:.1} us, p99.9 {:.1} us, largest {:.1} us; of the \
         period {:.4} in the median, {:.4} at p99.9; one core watches {:.0} of them",
        at(0.5),
        at(0.999),
        at(1.0),
        at(0.5) / period_us,
        at(0.999) / period_us,
        period_us / mean
    );
}
