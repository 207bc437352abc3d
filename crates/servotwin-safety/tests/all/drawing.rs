//! Fault trees as figures.

use servotwin_safety::interval::clopper_pearson;
use servotwin_safety::tree::drawing::draw;
use servotwin_safety::tree::lanes::{LaneTrees, TreeParameter};
use servotwin_safety::tree::numbers::ExposureHours;
use servotwin_safety::tree::structure::{EventLaw, FaultTree, GateKind};

#[test]
fn an_event_that_was_never_seen_shows_its_bound() {
    let mut tree = FaultTree::default();
    let seen = tree.event("seen".into(), "seen".into(), EventLaw::Constant(0));
    let unseen = tree.event("unseen".into(), "unseen".into(), EventLaw::Constant(1));
    tree.named_gate(GateKind::And, "both", "both", vec![seen, unseen]);
    let constant = |id: &str, count: u64| TreeParameter {
        id: id.into(),
        value: clopper_pearson(count, 100, 0.95),
        evidence: String::new(),
    };
    let constants = vec![constant("seen", 5), constant("unseen", 0)];
    let trees = LaneTrees { tree, rates: vec![], constants, notes: vec![] };
    let hours = ExposureHours { flight_h: 1.0, repair_h: 0.0, check_h: 1.0, test_h: None };
    let svg = draw(&trees, &hours, 0).svg;
    // Tooltips have the lines of a box without breaks.
    assert!(svg.contains(">seen, P = 0.0500, at most 0.11"), "{svg}");
    assert!(svg.contains(">unseen, never seen: P ≤ 0.036"), "{svg}");
    assert!(!svg.contains("P = 0<"), "{svg}");
}
