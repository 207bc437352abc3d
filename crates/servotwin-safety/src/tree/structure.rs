//! Fault trees: gates, basic events and what their probabilities depend on.
//!
//! All trees are *coherent*: AND and OR only, so a top event's probability grows with every basic event's.

/// How an event enters a gate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum TreeInput {
    /// A gate, by its index.
    Gate(usize),
    /// A basic event, by its index.
    Event(usize),
}

/// The kind of a gate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GateKind {
    /// All inputs.
    And,
    /// At least one input.
    Or,
}

/// A gate.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeGate {
    /// An identifier of letters, digits, `_` and `-`.
    pub id: String,
    /// The event in words.
    pub(crate) title: String,
    /// Its kind.
    pub(crate) kind: GateKind,
    /// Its inputs, at least one.
    pub(crate) inputs: Vec<TreeInput>,
    /// Whether figures show its inputs as a list in one box.
    pub(crate) is_folded: bool,
}

/// How long a failure may have been there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exposure {
    /// It begins in this flight.
    Flight,
    /// It is known and waits for its repair.
    Repair,
    /// It is hidden until the next test on the ground.
    Test,
    /// It is hidden until the next check.
    Check,
}

/// What the probability of a basic event is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EventLaw {
    /// 1 − exp(−rate · exposure), with a rate by its index.
    Exponential(usize, Exposure),
    /// A probability by its index.
    Constant(usize),
}

/// A basic event.
#[derive(Debug, Clone, PartialEq)]
pub struct BasicEvent {
    /// An identifier of letters, digits, `_` and `-`.
    pub(crate) id: String,
    /// The event in words.
    pub(crate) title: String,
    /// Its probability.
    pub(crate) law: EventLaw,
}

/// A top event.
#[derive(Debug, Clone, PartialEq)]
pub struct TopEvent {
    /// The index of its gate.
    pub gate: usize,
    /// Whether it begins in the flight; otherwise it may be there since before.
    pub(crate) begins: bool,
}

/// A fault tree with one or more top events.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FaultTree {
    /// The basic events. Their order is that of the decision diagram, so related events should be neighbors.
    pub events: Vec<BasicEvent>,
    /// The gates; inputs precede their gates.
    pub gates: Vec<TreeGate>,
    /// The top events.
    pub tops: Vec<TopEvent>,
}

impl FaultTree {
    /// Adds a basic event.
    pub fn event(&mut self, id: String, title: String, law: EventLaw) -> TreeInput {
        self.events.push(BasicEvent { id, title, law });
        TreeInput::Event(self.events.len() - 1)
    }

    /// Adds a gate. A gate of one input is that input; one of none never happens and is `None`.
    pub(crate) fn gate(
        &mut self,
        kind: GateKind,
        id: &str,
        title: &str,
        inputs: Vec<TreeInput>,
    ) -> Option<TreeInput> {
        match inputs[..] {
            [] => None,
            [only] => Some(only),
            _ => Some(self.named_gate(kind, id, title, inputs)),
        }
    }

    /// Adds a gate, however few inputs it has.
    pub fn named_gate(
        &mut self,
        kind: GateKind,
        id: &str,
        title: &str,
        inputs: Vec<TreeInput>,
    ) -> TreeInput {
        let gate = TreeGate { id: id.into(), title: title.into(), kind, inputs, is_folded: false };
        self.gates.push(gate);
        TreeInput::Gate(self.gates.len() - 1)
    }

    /// Whether an input happens for a set of events that happen.
    pub fn happens(&self, input: TreeInput, events: &dyn Fn(usize) -> bool) -> bool {
        match input {
            TreeInput::Event(event) => events(event),
            TreeInput::Gate(gate) => {
                let gate = &self.gates[gate];
                let mut inputs = gate.inputs.iter();
                match gate.kind {
                    GateKind::And => inputs.all(|&input| self.happens(input, events)),
                    GateKind::Or => inputs.any(|&input| self.happens(input, events)),
                }
            }
        }
    }

    /// The gates and the basic events below some inputs, with these, ascending.
    pub(crate) fn below(&self, inputs: impl Iterator<Item = TreeInput>) -> [Vec<usize>; 2] {
        let (mut events, mut gates) =
            (vec![false; self.events.len()], vec![false; self.gates.len()]);
        let mut open: Vec<TreeInput> = inputs.collect();
        while let Some(next) = open.pop() {
            match next {
                TreeInput::Event(event) => events[event] = true,
                TreeInput::Gate(gate) if !gates[gate] => {
                    gates[gate] = true;
                    open.extend(&self.gates[gate].inputs);
                }
                TreeInput::Gate(_) => {}
            }
        }
        [gates, events].map(|of| (0..of.len()).filter(|&at| of[at]).collect())
    }

    /// The basic events below an input, ascending.
    pub(crate) fn events_below(&self, input: TreeInput) -> Vec<usize> {
        let [_, events] = self.below(std::iter::once(input));
        events
    }
}
