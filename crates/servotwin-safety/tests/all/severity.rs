//! The rule of severity.

use servotwin_safety::fmea::severity::{SeverityInputs, level};

#[test]
fn the_worst_clause_decides_and_is_named() {
    let two = SeverityInputs { lanes: 2, growth: Some(1e-7), ..Default::default() };
    assert_eq!(level(two), ("S1", "no clause of S2 to S4 holds".into()));
    let mode = SeverityInputs { changes_mode: true, ..two };
    assert_eq!(level(mode), ("S2", "an action changes the mode".into()));
    assert_eq!(level(SeverityInputs { growth: Some(0.02), ..two }).1, "g = 0.02 ≥ 0.01");
    assert_eq!(level(SeverityInputs { growth: Some(0.1), ..mode }).0, "S3");
    let off = SeverityInputs { lanes_off: 1, growth: Some(0.2), ..two };
    assert_eq!(level(off), ("S3", "1 of 2 lanes switched off, g = 0.2 ≥ 0.1".into()));
    let none = SeverityInputs { lanes_off: 2, ..two };
    assert_eq!(level(none), ("S4", "no lane is left".into()));
    assert_eq!(level(SeverityInputs { growth: Some(0.7), ..off }).1, "g = 0.7 ≥ 0.5");
    // The only lane of a machine is its function.
    let one = SeverityInputs { lanes: 1, lanes_off: 1, ..Default::default() };
    assert_eq!(level(one).0, "S4");
}
