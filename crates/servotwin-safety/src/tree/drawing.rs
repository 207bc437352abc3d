//! Fault trees as figures: a box per gate, and one box for a group of like events.

use super::decision_diagram::DecisionDiagram;
use super::lanes::LaneTrees;
use super::numbers::{BandEnd, ExposureHours, event_probabilities};
use super::structure::{GateKind, TreeInput};
use servotwin::figure::Figure;
use servotwin::figure::tree::{Branch, Node, TreeFigure};
use servotwin::text::number;

/// A gate with more inputs than this is a list in one box.
const MAX_BRANCHES: usize = 8;

/// Draws the tree of a top event.
pub fn draw(trees: &LaneTrees, hours: &ExposureHours, top: usize) -> Figure {
    let mut drawer = FaultTreeDrawer {
        trees,
        probabilities: event_probabilities(trees, hours, BandEnd::Point),
        drawn: vec![false; trees.tree.gates.len()],
    };
    let root = drawer.node(TreeInput::Gate(top));
    let title = format!(
        "{}: probability in the last flight before a check (flight {} h, repair {} h, check {} h)",
        trees.tree.gates[top].title, hours.flight_h, hours.repair_h, hours.check_h
    );
    TreeFigure { title, classes: vec![], looks: vec![], root, sideways: true }.draw()
}

struct FaultTreeDrawer<'t> {
    trees: &'t LaneTrees,
    probabilities: Vec<f64>,
    /// Gates that the figure shows already; a second time they are a reference.
    drawn: Vec<bool>,
}

impl FaultTreeDrawer<'_> {
    fn probability(&self, input: TreeInput) -> f64 {
        match input {
            TreeInput::Event(event) => self.probabilities[event],
            gate => DecisionDiagram::new(&self.trees.tree, gate).probability(&self.probabilities),
        }
    }

    fn node(&mut self, input: TreeInput) -> Node {
        let chance = format!("P = {}", number(self.probability(input)));
        match input {
            TreeInput::Event(event) => {
                Node::leaf(vec![self.trees.tree.events[event].title.clone(), chance], vec![])
            }
            TreeInput::Gate(place) => self.gate(place, chance),
        }
    }

    fn gate(&mut self, place: usize, chance: String) -> Node {
        let gate = &self.trees.tree.gates[place];
        let kind = if gate.kind == GateKind::And { "AND" } else { "OR" };
        if std::mem::replace(&mut self.drawn[place], true) {
            return Node::leaf(vec![gate.title.clone(), format!("{chance}, shown above")], vec![]);
        }
        if gate.is_folded || gate.inputs.len() > MAX_BRANCHES {
            let inputs = match gate.inputs.len() {
                1 => "one fault".to_owned(),
                count => format!("{kind} of {count}"),
            };
            return Node::leaf(vec![gate.title.clone(), inputs, chance], vec![]);
        }
        let lines = vec![gate.title.clone(), format!("{kind}, {chance}")];
        let inputs = gate.inputs.clone();
        let branch = |input| Branch { label: String::new(), node: self.node(input) };
        Node { lines, shares: vec![], children: inputs.into_iter().map(branch).collect() }
    }
}
