//! Fault trees as figures: a box for each gate with its symbol, and one box for a group of like events.

use super::decision_diagram::DecisionDiagram;
use super::lanes::LaneTrees;
use super::numbers::{BandEnd, ExposureHours, event_probabilities};
use super::structure::{GateKind, TreeGate, TreeInput};
use servotwin::text::three_digits;
use servotwin::view::Figure;
use servotwin::view::tree::{Branch, Node, TreeFigure, TreeSymbol};

/// A gate with more inputs than this is one box.
const MAX_BRANCHES: usize = 8;

/// Draws the tree of a top event.
pub fn draw(trees: &LaneTrees, hours: &ExposureHours, top: usize) -> Figure {
    let mut drawer = FaultTreeDrawer {
        trees,
        top,
        points: event_probabilities(trees, hours, BandEnd::Point),
        bounds: event_probabilities(trees, hours, BandEnd::High),
        drawn: vec![false; trees.tree.gates.len()],
    };
    let root = drawer.node(TreeInput::Gate(top));
    let title = format!(
        "{}: probability in the last flight before a check (flight {} h, repair {} h, check {} h)",
        trees.tree.gates[top].title, hours.flight_h, hours.repair_h, hours.check_h
    );
    TreeFigure { title, classes: vec![], looks: vec![], root }.draw()
}

struct FaultTreeDrawer<'t> {
    trees: &'t LaneTrees,
    /// The gate of the top event.
    top: usize,
    /// The estimates of all events, and the upper ends of their intervals.
    points: Vec<f64>,
    bounds: Vec<f64>,
    /// Gates that the figure shows already; a second time they are a reference.
    drawn: Vec<bool>,
}

impl FaultTreeDrawer<'_> {
    /// The probability of an input, and the upper end of its interval; that end alone if it was never seen.
    fn chance(&self, input: TreeInput) -> String {
        let of = |events: &[f64]| match input {
            TreeInput::Event(event) => events[event],
            gate => DecisionDiagram::new(&self.trees.tree, gate).probability(events),
        };
        match (of(&self.points), of(&self.bounds)) {
            (point, bound) if point > 0.0 && bound > point => {
                format!("P = {}, at most {}", three_digits(point), three_digits(bound))
            }
            (point, _) if point > 0.0 => format!("P = {}", three_digits(point)),
            (_, bound) => format!("never seen: P ≤ {}", three_digits(bound)),
        }
    }

    fn node(&mut self, input: TreeInput) -> Node {
        let chance = self.chance(input);
        match input {
            TreeInput::Event(event) => {
                let lines = vec![self.trees.tree.events[event].title.clone(), chance];
                Node { lines, symbol: Some(TreeSymbol::BasicEvent), ..Node::default() }
            }
            TreeInput::Gate(place) => self.gate(place, chance),
        }
    }

    fn gate(&mut self, place: usize, chance: String) -> Node {
        let trees = self.trees;
        let gate = &trees.tree.gates[place];
        let leaf = |lines: Vec<String>, symbol| Node {
            lines: [vec![gate.title.clone()], lines].concat(),
            symbol: Some(symbol),
            ..Node::default()
        };
        if std::mem::replace(&mut self.drawn[place], true) {
            return leaf(vec![format!("{chance}, shown above")], TreeSymbol::Transfer);
        }
        if place != self.top && self.is_one_box(gate) {
            let count = trees.tree.events_below(TreeInput::Gate(place)).len();
            return leaf(vec![format!("{count} events"), chance], TreeSymbol::Undeveloped);
        }
        let symbol = match gate.kind {
            GateKind::And => TreeSymbol::And,
            GateKind::Or => TreeSymbol::Or,
        };
        let branch = |&input: &TreeInput| Branch { label: String::new(), node: self.node(input) };
        Node { children: gate.inputs.iter().map(branch).collect(), ..leaf(vec![chance], symbol) }
    }

    /// Whether a gate is a list of like events, or of such lists.
    fn is_one_box(&self, gate: &TreeGate) -> bool {
        let is_list = |input: &TreeInput| matches!(input, TreeInput::Gate(of) if self.trees.tree.gates[*of].is_folded);
        gate.is_folded || gate.inputs.len() > MAX_BRANCHES || gate.inputs.iter().all(is_list)
    }
}
