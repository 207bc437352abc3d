//! The export of a small trained diagnoser, compiled and compared.

#[path = "../../servotwin-diagnosis/tests/toy/mod.rs"]
#[allow(dead_code)]
mod toy;

use servotwin_export::c;
use servotwin_export::prove::{Build, prove};

#[test]
fn the_export_of_a_trained_diagnoser_decides_the_same_in_every_build() {
    let diagnoser = toy::diagnoser();
    let files = c::files(&diagnoser).unwrap();
    let builds = Build::available();
    assert!(builds.iter().any(|build| build.compiler == "gcc"), "the tests need gcc");
    for build in &builds {
        let evidence = prove(&diagnoser, &files, build).unwrap();
        assert!(evidence.holds(), "{evidence:#?}");
        assert!(
            evidence.thresholds > 20 && evidence.rows > 3 * evidence.thresholds,
            "{evidence:#?}"
        );
    }
}
