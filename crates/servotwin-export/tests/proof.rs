//! The export of a small trained diagnoser, compiled and compared.

#[path = "../../servotwin-diagnosis/tests/toy/mod.rs"]
#[allow(dead_code)]
mod toy;

use servotwin_diagnosis::diagnoser::{Boundary, Diagnoser};
use servotwin_export::c;
use servotwin_export::prove::{Build, Mutant, Plan, mutants, prove};
use std::sync::Arc;

/// Five minutes of samples.
const SAMPLES: u64 = 30_000;

fn assert_proven(diagnoser: &Arc<Diagnoser>) {
    let files = c::files(diagnoser).unwrap();
    let builds = Build::available();
    assert!(builds.iter().any(|build| build.compiler == "gcc"), "the tests need gcc");
    let plan = Plan { diagnoser, twin: None, files: &files, samples: SAMPLES, variants: 0 };
    for evidence in prove(&plan, &builds, &mut |_, _| ()).unwrap() {
        assert!(evidence.holds(), "{evidence:#?}");
        assert!(evidence.thresholds > 20 && evidence.rows > 3 * evidence.thresholds);
        assert!(evidence.samples == SAMPLES && !evidence.raised.is_empty(), "{evidence:#?}");
    }
}

#[test]
fn the_export_of_a_trained_diagnoser_decides_the_same_in_every_build() {
    assert_proven(&toy::diagnoser());
}

/// A diagnoser that uses everything: windows beyond a baseline, a boundary, scales, and a temperature.
fn demanding() -> Arc<Diagnoser> {
    let mut diagnoser = toy::with_baseline();
    for (place, sensor) in diagnoser.sensors.iter_mut().enumerate() {
        sensor.scale = 0.7 + 0.2 * place as f64;
    }
    diagnoser.boundaries =
        vec![Boundary { input: 0, sensor: 2, effects: vec![(2, 1e-7), (3, 6e-8)] }];
    // Narrow, so that the sum of two inputs is not plausible in place of their difference.
    let difference = &mut diagnoser.environment.differences[0];
    (difference.least, difference.largest) = (1.9e7, 2.1e7);
    for length in &mut diagnoser.lengths {
        length.panel.committee.stages.iter_mut().for_each(|stage| stage.temperature = 1.3);
    }
    Arc::new(diagnoser)
}

#[test]
fn so_does_one_that_uses_everything() {
    assert_proven(&demanding());
}

/// Makes mistakes of a seed, all of which a proof must find.
fn assert_finds_mistakes(seed: u64) {
    let diagnoser = demanding();
    let files = c::files(&diagnoser).unwrap();
    let build = Build { compiler: "gcc".into(), level: "-O0" };
    let mutants = mutants(&diagnoser, &files, &build, (110, seed), &mut |_| ()).unwrap();
    let survivors: Vec<&Mutant> = mutants.iter().filter(|mutant| !mutant.is_found).collect();
    assert!(mutants.len() == 110 && survivors.is_empty(), "{survivors:#?}");
}

// Two tests, because tests run side by side.
#[test]
fn a_proof_finds_every_mistake_of_a_hundred() {
    assert_finds_mistakes(1);
}

#[test]
fn and_of_another_hundred() {
    assert_finds_mistakes(2);
}
