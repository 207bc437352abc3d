//! The export of a small trained diagnoser, compiled and compared.

#[path = "../../servotwin-diagnosis/tests/toy/mod.rs"]
#[allow(dead_code)]
mod toy;

use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_export::c;
use servotwin_export::prove::{Build, prove};
use std::sync::Arc;

/// Five minutes of samples.
const SAMPLES: u64 = 30_000;

fn assert_proven(diagnoser: &Arc<Diagnoser>) {
    let files = c::files(diagnoser).unwrap();
    let builds = Build::available();
    assert!(builds.iter().any(|build| build.compiler == "gcc"), "the tests need gcc");
    for evidence in prove(diagnoser, &files, &builds, SAMPLES, &mut |_| ()).unwrap() {
        assert!(evidence.holds(), "{evidence:#?}");
        assert!(evidence.thresholds > 20 && evidence.rows > 3 * evidence.thresholds);
        assert!(evidence.samples == SAMPLES && evidence.raised.len() > 1, "{evidence:#?}");
    }
}

#[test]
fn the_export_of_a_trained_diagnoser_decides_the_same_in_every_build() {
    assert_proven(&toy::diagnoser());
}

#[test]
fn so_does_one_with_windows_beyond_a_baseline() {
    assert_proven(&Arc::new(toy::with_baseline()));
}
