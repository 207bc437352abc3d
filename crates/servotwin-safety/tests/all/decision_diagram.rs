//! Decision diagrams of fault trees against brute force and by hand.

use super::brute_force;
use servotwin_diagnosis::random::Random;
use servotwin_safety::tree::decision_diagram::DecisionDiagram;
use servotwin_safety::tree::structure::{EventLaw, FaultTree, GateKind, TreeInput};

/// A random coherent tree with shared events and gates.
fn random_tree(seed: u64) -> (FaultTree, TreeInput, Vec<f64>) {
    let mut random = Random::new(seed);
    let mut tree = FaultTree::default();
    let count = 4 + random.index(6);
    let mut inputs: Vec<TreeInput> = (0..count)
        .map(|n| tree.event(format!("e{n}"), String::new(), EventLaw::Constant(n)))
        .collect();
    let mut top = inputs[0];
    for gate in 0..3 + random.index(8) {
        let kind = if random.unit() < 0.5 { GateKind::And } else { GateKind::Or };
        let members = (0..2 + random.index(3)).map(|_| inputs[random.index(inputs.len())]);
        let members = members.collect();
        top = tree.named_gate(kind, &format!("g{gate}"), "", members);
        inputs.push(top);
    }
    let probabilities = (0..count).map(|_| random.unit()).collect();
    (tree, top, probabilities)
}

#[test]
fn probabilities_cut_sets_and_importances_are_those_of_brute_force() {
    let mut orders = 0;
    for seed in 0..300 {
        let (tree, top, probabilities) = random_tree(seed);
        let diagram = DecisionDiagram::new(&tree, top);
        let exact = brute_force::probability(&tree, top, &probabilities);
        assert!((diagram.probability(&probabilities) - exact).abs() < 1e-12, "seed {seed}");
        let cut_sets = diagram.cut_sets();
        let mut found: Vec<Vec<usize>> = cut_sets
            .most_probable(&probabilities, usize::MAX)
            .into_iter()
            .map(|set| set.1)
            .collect();
        found.sort();
        assert_eq!(found, brute_force::cut_sets(&tree, top), "seed {seed}");
        let counts = cut_sets.count_by_order();
        assert_eq!(counts.iter().sum::<u64>() as usize, found.len(), "seed {seed}");
        orders = orders.max(counts.len());
        for (event, birnbaum) in diagram.birnbaum(&probabilities).into_iter().enumerate() {
            let at = |value: f64| {
                let mut moved = probabilities.clone();
                moved[event] = value;
                brute_force::probability(&tree, top, &moved)
            };
            assert!((birnbaum - (at(1.0) - at(0.0))).abs() < 1e-12, "seed {seed}, event {event}");
        }
    }
    assert!(orders >= 4, "the random trees have cut sets of at most {orders} events");
}

#[test]
fn two_of_three_by_hand() {
    let mut tree = FaultTree::default();
    let events: Vec<TreeInput> =
        (0..3).map(|n| tree.event(format!("e{n}"), String::new(), EventLaw::Constant(n))).collect();
    let pairs = [(0, 1), (0, 2), (1, 2)].map(|(a, b)| {
        tree.named_gate(GateKind::And, &format!("p{a}{b}"), "", vec![events[a], events[b]])
    });
    let top = tree.named_gate(GateKind::Or, "top", "", pairs.to_vec());
    let diagram = DecisionDiagram::new(&tree, top);
    // 3 q² − 2 q³ at q = 0.1.
    assert!((diagram.probability(&[0.1; 3]) - 0.028).abs() < 1e-15);
    assert_eq!(diagram.cut_sets().count_by_order(), [0, 3]);
    // ∂P/∂q₁ = q₂ + q₃ − 2 q₂ q₃.
    assert!((diagram.birnbaum(&[0.1; 3])[0] - 0.18).abs() < 1e-15);
}
