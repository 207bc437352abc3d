//! Exact evaluation of coherent fault trees by a binary decision diagram.
//!
//! A diagram answers one question per node: does the node's event happen? Every path from the root to the end *true* is a
//! set of disjoint cases, so the probability is a sum over nodes without any approximation:
//!
//! P(node) = q · P(high) + (1 − q) · P(low)   (1)
//!
//! The importance of an event is the derivative of the probability with respect to the event's own, which (1) gives
//! exactly, too. Minimal cut sets come from Rauzy's decomposition: those of `low`, and those of `high` that contain none
//! of them.
//!
//! Sources: Bryant, IEEE Transactions on Computers 35, 1986; Rauzy, Reliability Engineering and System Safety 40, 1993.

use super::structure::{FaultTree, GateKind, TreeInput};
use std::collections::HashMap;

/// A node, by its index. The first two are the ends *false* and *true*.
type NodeId = u32;

/// The end that never happens.
const FALSE: NodeId = 0;
/// The end that always happens.
const TRUE: NodeId = 1;
/// The event of the ends, behind all others.
const END: u32 = u32::MAX;

/// A question and its two continuations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Decision {
    event: u32,
    high: NodeId,
    low: NodeId,
}

/// The nodes of decision diagrams, or of families of sets, which share equal nodes.
#[derive(Debug, Clone)]
struct Nodes {
    list: Vec<Decision>,
    known: HashMap<Decision, NodeId>,
}

impl Nodes {
    fn new() -> Self {
        let end = Decision { event: END, high: FALSE, low: FALSE };
        Nodes { list: vec![end, end], known: HashMap::new() }
    }

    fn add(&mut self, decision: Decision) -> NodeId {
        let next = self.list.len() as NodeId;
        let id = *self.known.entry(decision).or_insert(next);
        if id == next {
            self.list.push(decision);
        }
        id
    }

    fn event(&self, node: NodeId) -> u32 {
        self.list[node as usize].event
    }

    /// The continuations of a node if the first question is about `event`.
    fn split(&self, node: NodeId, event: u32) -> (NodeId, NodeId) {
        let Decision { event: own, high, low } = self.list[node as usize];
        if own == event { (high, low) } else { (node, node) }
    }
}

/// The decision diagram of one event of a fault tree.
#[derive(Debug, Clone)]
pub struct DecisionDiagram {
    nodes: Nodes,
    root: NodeId,
    /// The number of basic events of the tree.
    events: usize,
}

/// Builds diagrams of gates, each gate once.
struct DiagramBuilder<'t> {
    tree: &'t FaultTree,
    nodes: Nodes,
    gates: HashMap<usize, NodeId>,
    joined: HashMap<(bool, NodeId, NodeId), NodeId>,
}

impl DiagramBuilder<'_> {
    fn decide(&mut self, event: u32, high: NodeId, low: NodeId) -> NodeId {
        if high == low { high } else { self.nodes.add(Decision { event, high, low }) }
    }

    fn input(&mut self, input: TreeInput) -> NodeId {
        match input {
            TreeInput::Event(event) => self.decide(event as u32, TRUE, FALSE),
            TreeInput::Gate(gate) => {
                if let Some(&known) = self.gates.get(&gate) {
                    return known;
                }
                let tree = self.tree;
                let is_and = tree.gates[gate].kind == GateKind::And;
                let mut node = if is_and { TRUE } else { FALSE };
                for &input in &tree.gates[gate].inputs {
                    let next = self.input(input);
                    node = self.join(is_and, node, next);
                }
                self.gates.insert(gate, node);
                node
            }
        }
    }

    fn join(&mut self, is_and: bool, a: NodeId, b: NodeId) -> NodeId {
        let (a, b) = (a.min(b), a.max(b));
        // The ends are the two smallest nodes.
        match (a, is_and) {
            _ if a == b => return a,
            (FALSE, true) | (TRUE, false) => return a,
            (FALSE, false) | (TRUE, true) => return b,
            _ => {}
        }
        if let Some(&known) = self.joined.get(&(is_and, a, b)) {
            return known;
        }
        let event = self.nodes.event(a).min(self.nodes.event(b));
        let ((a_high, a_low), (b_high, b_low)) =
            (self.nodes.split(a, event), self.nodes.split(b, event));
        let high = self.join(is_and, a_high, b_high);
        let low = self.join(is_and, a_low, b_low);
        let node = self.decide(event, high, low);
        self.joined.insert((is_and, a, b), node);
        node
    }
}

impl DecisionDiagram {
    /// The diagram of an input of a tree.
    pub fn new(tree: &FaultTree, top: TreeInput) -> Self {
        let mut builder = DiagramBuilder {
            tree,
            nodes: Nodes::new(),
            gates: HashMap::new(),
            joined: HashMap::new(),
        };
        let root = builder.input(top);
        DecisionDiagram { nodes: builder.nodes, root, events: tree.events.len() }
    }

    /// The number of nodes, those of intermediate gates included.
    pub(crate) fn size(&self) -> usize {
        self.nodes.list.len()
    }

    /// The probability of every node. A node's continuations precede it.
    fn probabilities(&self, of_events: &[f64]) -> Vec<f64> {
        let mut known = vec![0.0, 1.0];
        for decision in &self.nodes.list[2..] {
            let q = of_events[decision.event as usize];
            let (high, low) = (known[decision.high as usize], known[decision.low as usize]);
            known.push(q * high + (1.0 - q) * low);
        }
        known
    }

    /// The probability of the top event, for the probabilities of all basic events. Equation 1.
    pub fn probability(&self, of_events: &[f64]) -> f64 {
        self.probabilities(of_events)[self.root as usize]
    }

    /// The importance of every basic event by Birnbaum: the derivative of the top event's probability.
    pub fn birnbaum(&self, of_events: &[f64]) -> Vec<f64> {
        let known = self.probabilities(of_events);
        let mut reached = vec![0.0; known.len()];
        reached[self.root as usize] = 1.0;
        let mut importance = vec![0.0; self.events];
        for (node, decision) in self.nodes.list.iter().enumerate().skip(2).rev() {
            let share = reached[node];
            let Decision { event, high, low } = *decision;
            let q = of_events[event as usize];
            importance[event as usize] += share * (known[high as usize] - known[low as usize]);
            reached[high as usize] += share * q;
            reached[low as usize] += share * (1.0 - q);
        }
        importance
    }

    /// The minimal cut sets.
    pub fn cut_sets(&self) -> CutSets {
        let mut finder = CutFinder {
            diagram: &self.nodes,
            sets: Nodes::new(),
            minimal: HashMap::new(),
            without: HashMap::new(),
        };
        let root = finder.minimal(self.root);
        CutSets { nodes: finder.sets, root }
    }
}

/// A family of minimal cut sets. A node is an event with the sets that have it (`high`) and those that have not (`low`);
/// the end *true* is the empty set.
#[derive(Debug, Clone)]
pub struct CutSets {
    nodes: Nodes,
    root: NodeId,
}

struct CutFinder<'d> {
    diagram: &'d Nodes,
    sets: Nodes,
    minimal: HashMap<NodeId, NodeId>,
    without: HashMap<(NodeId, NodeId), NodeId>,
}

impl CutFinder<'_> {
    fn family(&mut self, event: u32, high: NodeId, low: NodeId) -> NodeId {
        if high == FALSE { low } else { self.sets.add(Decision { event, high, low }) }
    }

    /// The minimal cut sets of a node of the diagram.
    fn minimal(&mut self, node: NodeId) -> NodeId {
        if node <= TRUE {
            return node;
        }
        if let Some(&known) = self.minimal.get(&node) {
            return known;
        }
        let Decision { event, high, low } = self.diagram.list[node as usize];
        let (high, low) = (self.minimal(high), self.minimal(low));
        let high = self.without(high, low);
        let family = self.family(event, high, low);
        self.minimal.insert(node, family);
        family
    }

    /// The sets of `family` that contain no set of `other`.
    fn without(&mut self, family: NodeId, other: NodeId) -> NodeId {
        match (family, other) {
            (FALSE, _) | (_, TRUE) => return FALSE,
            (_, FALSE) => return family,
            _ if family == other => return FALSE,
            _ => {}
        }
        if let Some(&known) = self.without.get(&(family, other)) {
            return known;
        }
        let event = self.sets.event(family);
        let other_event = self.sets.event(other);
        let found = if event > other_event {
            // No set of the family has the other's event, so sets with it cannot be contained.
            let low = self.sets.list[other as usize].low;
            self.without(family, low)
        } else {
            let Decision { high, low, .. } = self.sets.list[family as usize];
            let (mut high_left, other_low) = (high, self.sets.split_family(other, event).1);
            if event == other_event {
                let other_high = self.sets.list[other as usize].high;
                high_left = self.without(high_left, other_high);
            }
            let high_left = self.without(high_left, other_low);
            let low_left = self.without(low, other_low);
            self.family(event, high_left, low_left)
        };
        self.without.insert((family, other), found);
        found
    }
}

impl Nodes {
    /// The sets of a family with and without an event.
    fn split_family(&self, node: NodeId, event: u32) -> (NodeId, NodeId) {
        let Decision { event: own, high, low } = self.list[node as usize];
        if own == event { (high, low) } else { (FALSE, node) }
    }
}

impl CutSets {
    /// The number of cut sets, by their number of events: entry 0 counts those of one event.
    pub fn count_by_order(&self) -> Vec<u64> {
        let mut known: Vec<Vec<u64>> = vec![vec![], vec![1]];
        for decision in &self.nodes.list[2..] {
            let (high, low) = (&known[decision.high as usize], &known[decision.low as usize]);
            let mut counts = vec![0; low.len().max(high.len() + 1)];
            low.iter().enumerate().for_each(|(order, count)| counts[order] += count);
            high.iter().enumerate().for_each(|(order, count)| counts[order + 1] += count);
            known.push(counts);
        }
        let counts = &known[self.root as usize];
        counts.get(1..).unwrap_or_default().to_vec()
    }

    /// The most probable cut sets, the most probable first, each with the product of its events' probabilities. Sets of
    /// equal probability stay in the order of their events.
    pub fn most_probable(&self, of_events: &[f64], count: usize) -> Vec<(f64, Vec<usize>)> {
        let mut found = vec![];
        self.collect(self.root, &mut vec![], &mut |set: &[usize]| {
            found.push((set.iter().map(|&event| of_events[event]).product::<f64>(), set.to_vec()));
        });
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        found.truncate(count);
        found
    }

    fn collect(&self, node: NodeId, path: &mut Vec<usize>, take: &mut dyn FnMut(&[usize])) {
        match node {
            FALSE => {}
            TRUE => take(path),
            node => {
                let Decision { event, high, low } = self.nodes.list[node as usize];
                path.push(event as usize);
                self.collect(high, path, take);
                path.pop();
                self.collect(low, path, take);
            }
        }
    }
}
