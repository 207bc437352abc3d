//! Specimens with known parameters, and what a fit makes of their records.

use super::record::smooth;
use super::*;
use crate::ensemble::{Ensemble, Variant};
use crate::signal::Signal;
use crate::signal::random::Random;
use crate::study::Lot;
use servotwin_model::program::{FaultAt, Slot};
use servotwin_model::signal::Piecewise;

/// What the calibration flies.
const COMMAND: &str = "noise:rms=4deg,bandwidth=1Hz,seed=77";

/// A record of a specimen, as a logger writes it: sensors with noise, commands as samples.
fn record(study: &Study, specimen: Option<usize>, faults: Vec<FaultAt>, duration_s: f64) -> Record {
    let system = &study.system;
    let network = system.network();
    let constant = |value| Piecewise::constant(value).unwrap();
    let mut inputs: Vec<Piecewise> = network.inputs.iter().map(|i| constant(i.default)).collect();
    let unit = network.inputs[study.command_input].unit;
    let signal: Signal = COMMAND.parse().unwrap();
    inputs[study.command_input] = signal.build(unit, duration_s).unwrap();
    let sensors = study.measured[..study.base_sensors()].to_vec();
    let slot = |&s: &usize| -> Slot { system.program.observable(&system.sensors[s].signal).unwrap().slot };
    let ensemble = Ensemble {
        record: sensors.iter().map(slot).collect(),
        duration_s,
        sample_period_s: study.sample_period_s,
        ..Ensemble::new(&system.program)
    };
    let realism = study.realism.as_ref().unwrap();
    let overrides = specimen.map(|n| realism.specimen(study, Lot::Training, n)).unwrap_or_default();
    let variant = Variant { overrides, faults, inputs: inputs.iter().collect(), ..Variant::default() };
    let (columns, _) = ensemble.run_one(&variant).unwrap();
    let mut noise: Random = realism.noise(Lot::Training, specimen.unwrap_or(0));
    let imperfections: Vec<Imperfection> = sensors.iter().map(|&s| Imperfection::of(system, s)).collect();
    let mut measured = Vec::new();
    for row in 0..columns[0].len() {
        for (column, imperfection) in columns.iter().zip(&imperfections) {
            measured.push(imperfection.apply(column[row], &mut noise));
        }
    }
    let samples = measured.len() / sensors.len();
    let logged: Vec<f64> = (0..samples)
        .map(|k| inputs[study.command_input].value(k as f64 * study.sample_period_s))
        .collect();
    inputs[study.command_input] = smooth(study.sample_period_s, &logged);
    Record { name: "record".into(), period_s: study.sample_period_s, inputs, sensors, measured }
}

/// The true unknowns of a specimen.
fn truth(study: &Study, unknowns: &[Unknown], specimen: usize) -> Vec<f64> {
    let values = study.realism.as_ref().unwrap().specimen(study, Lot::Training, specimen);
    let of = |unknown: &Unknown| {
        let unknown::Moved::Parameters { members, .. } = &unknown.moved else { panic!() };
        let (component, parameter, nominal) = members[0];
        let value = values.iter().find(|v| (v.0, v.1) == (component, parameter)).unwrap().2;
        (value - nominal) / unknown.per_sigma(nominal)
    };
    unknowns.iter().map(of).collect()
}

/// (inside of its 95 % interval, all) over specimens, and how many were refused.
fn coverage(study: &Study, specimens: std::ops::Range<usize>, duration_s: f64) -> (usize, usize, usize) {
    let (mut inside, mut all, mut refused) = (0, 0, 0);
    for specimen in specimens {
        let problem = Problem::of_study(study, vec![record(study, Some(specimen), vec![], duration_s)]);
        let begin = std::time::Instant::now();
        let fitted = problem.solve().unwrap();
        let truth = truth(study, &problem.unknowns, specimen);
        let own = (0..truth.len()).filter(|&k| (fitted.z[k] - truth[k]).abs() <= 1.96 * fitted.known.error(k)).count();
        println!(
            "{specimen}: {own} of {} inside, {} steps, {:.2} s, F {:.1}, {:?} {}",
            truth.len(), fitted.steps, begin.elapsed().as_secs_f64(), fitted.cost,
            fitted.findings.iter().map(|f| f.sentence(&problem)).collect::<Vec<_>>(),
            fitted.suspects[0]
        );
        inside += own;
        all += truth.len();
        refused += usize::from(!fitted.is_update());
    }
    (inside, all, refused)
}

#[test]
#[ignore = "a measurement: minutes"]
fn measure_coverage() {
    let study = Study::default();
    let begin = std::time::Instant::now();
    let specimens: usize = std::env::var("SPECIMENS").map_or(4, |n| n.parse().unwrap());
    let (inside, all, refused) = coverage(&study, 0..specimens, 60.0);
    println!("{inside} of {all} inside ({:.2} %), {refused} refused, {:.1} s", 100.0 * inside as f64 / all as f64, begin.elapsed().as_secs_f64());
}

#[test]
#[ignore = "a measurement: minutes"]
fn measure_knowledge() {
    let study = Study::default();
    let problem = Problem::of_study(&study, vec![record(&study, Some(0), vec![], 60.0)]);
    let fitted = problem.solve().unwrap();
    let truth = truth(&study, &problem.unknowns, 0);
    for (k, unknown) in problem.unknowns.iter().enumerate() {
        println!(
            "{:50} {:7.3} ± {:.3} (true {:7.3}) {}",
            unknown.name, fitted.z[k], fitted.known.error(k), truth[k], fitted.known.sentence(&problem.unknowns, k)
        );
    }
    for direction in &fitted.known.directions {
        print!("{:.3e} ", direction.information);
    }
    println!();
    for suspect in &fitted.suspects {
        println!("{suspect}");
    }
}
