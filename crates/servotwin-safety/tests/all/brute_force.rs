//! Results of brute force, for small trees: every set of events is tried.

use servotwin_safety::tree::structure::{FaultTree, TreeInput};

/// The probability of an input.
pub fn probability(tree: &FaultTree, input: TreeInput, of_events: &[f64]) -> f64 {
    let count = tree.events.len();
    let mut sum = 0.0;
    for set in 0..1u32 << count {
        let is_in = |event: usize| set >> event & 1 == 1;
        if tree.happens(input, &is_in) {
            let one = |event| if is_in(event) { of_events[event] } else { 1.0 - of_events[event] };
            sum += (0..count).map(one).product::<f64>();
        }
    }
    sum
}

/// The minimal cut sets of an input, as ascending lists of events, in ascending order.
pub fn cut_sets(tree: &FaultTree, input: TreeInput) -> Vec<Vec<usize>> {
    let count = tree.events.len();
    let happens = |set: u32| tree.happens(input, &|event| set >> event & 1 == 1);
    let is_minimal = |set: &u32| {
        happens(*set) && (0..count).all(|e| set >> e & 1 == 0 || !happens(set & !(1 << e)))
    };
    let events = |set: u32| (0..count).filter(|e| set >> e & 1 == 1).collect::<Vec<usize>>();
    let mut found: Vec<Vec<usize>> = (0..1u32 << count).filter(is_minimal).map(events).collect();
    found.sort();
    found
}
