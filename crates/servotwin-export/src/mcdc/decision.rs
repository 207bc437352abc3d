//! Decisions, their conditions, and the effect of a condition that masking MC/DC asks for.

/// The most conditions of a decision: the recorder has a bit for each.
pub(crate) const MOST_CONDITIONS: usize = 32;

/// How the conditions of a decision are connected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ConditionTree {
    Condition(usize),
    Not(Box<ConditionTree>),
    And(Box<[ConditionTree; 2]>),
    Or(Box<[ConditionTree; 2]>),
    /// The cases of a `switch`: exactly one of them is taken.
    Cases,
}

/// One evaluation of a decision: which conditions were evaluated, and with which values. A bit for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Vector {
    pub evaluated: u32,
    pub values: u32,
}

impl Vector {
    /// The value of a condition; `None` if it was not evaluated.
    pub fn value(&self, condition: usize) -> Option<bool> {
        let has = |bits: u32| bits >> condition & 1 == 1;
        has(self.evaluated).then(|| has(self.values))
    }

    /// Whether the two differ in nothing else, as far as it was evaluated in both: unique-cause MC/DC.
    pub fn differs_only_in(&self, other: &Vector, condition: usize) -> bool {
        let in_both = self.evaluated & other.evaluated & !(1 << condition);
        (self.values ^ other.values) & in_both == 0
    }
}

/// Whether a condition lies in a part of a decision, and whether its value passes to the top of that part.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Effect {
    Elsewhere,
    Masked,
    Passes,
}

impl ConditionTree {
    /// The value of the decision; `None` if it was not evaluated.
    pub fn value(&self, vector: &Vector) -> Option<bool> {
        match self {
            ConditionTree::Condition(condition) => vector.value(*condition),
            ConditionTree::Not(inner) => inner.value(vector).map(|value| !value),
            ConditionTree::And(sides) => Self::chain(sides, vector, false),
            ConditionTree::Or(sides) => Self::chain(sides, vector, true),
            ConditionTree::Cases => None,
        }
    }

    /// `decisive` is the value of the left side without which the right one is evaluated.
    fn chain([left, right]: &[ConditionTree; 2], vector: &Vector, decisive: bool) -> Option<bool> {
        match left.value(vector)? {
            value if value == decisive => Some(value),
            _ => right.value(vector),
        }
    }

    /// Whether the value of a condition decided this evaluation: no side beside its way to the top masks it.
    pub fn is_decided_by(&self, condition: usize, vector: &Vector) -> bool {
        match self {
            ConditionTree::Cases => vector.value(condition).is_some(),
            _ => self.effect(condition, vector) == Effect::Passes,
        }
    }

    fn effect(&self, condition: usize, vector: &Vector) -> Effect {
        match self {
            ConditionTree::Condition(own) if *own == condition => match vector.value(condition) {
                Some(_) => Effect::Passes,
                None => Effect::Masked,
            },
            ConditionTree::Condition(_) | ConditionTree::Cases => Effect::Elsewhere,
            ConditionTree::Not(inner) => inner.effect(condition, vector),
            ConditionTree::And(sides) => Self::effect_beside(sides, condition, vector, false),
            ConditionTree::Or(sides) => Self::effect_beside(sides, condition, vector, true),
        }
    }

    /// `masking` is the value of the other side that decides alone.
    fn effect_beside(
        [left, right]: &[ConditionTree; 2],
        condition: usize,
        vector: &Vector,
        masking: bool,
    ) -> Effect {
        let in_left = left.effect(condition, vector);
        let (own, other) = match in_left {
            Effect::Elsewhere => (right.effect(condition, vector), left),
            _ => (in_left, right),
        };
        let is_masked = other.value(vector) == Some(masking);
        if own == Effect::Passes && is_masked { Effect::Masked } else { own }
    }
}

/// Where a decision stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DecisionKind {
    If,
    While,
    For,
    Switch,
    /// The condition of `?:`.
    Choice,
    /// A truth value that is stored, passed or returned.
    Value,
}

impl DecisionKind {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            DecisionKind::If => "if",
            DecisionKind::While => "while",
            DecisionKind::For => "for",
            DecisionKind::Switch => "switch",
            DecisionKind::Choice => "?:",
            DecisionKind::Value => "value",
        }
    }
}

/// A decision in a C text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Decision {
    pub file: &'static str,
    pub function: String,
    /// Number of the line, from 1.
    pub line: usize,
    /// Its first byte in the line, from 1.
    pub column: usize,
    pub kind: DecisionKind,
    /// Its text in one line.
    pub text: String,
    /// The text of each condition, or of each case.
    pub conditions: Vec<String>,
    pub tree: ConditionTree,
}

/// The independent effect of a condition among some evaluations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shown {
    /// The places of two evaluations with another value of the condition and another result.
    Pair([usize; 2]),
    /// The place of an evaluation that took a case.
    Case(usize),
    /// There is no evaluation that the condition decided with this value, or with either of them.
    Missing { with_true: bool, with_false: bool },
}

impl Decision {
    /// Looks for the effect of a condition. Two evaluations that differ in nothing else are preferred, then earlier ones.
    pub fn find(&self, condition: usize, vectors: &[Vector]) -> Shown {
        let decided = |value| {
            let of_value = move |(_, vector): &(usize, &Vector)| {
                vector.value(condition) == Some(value) && self.tree.is_decided_by(condition, vector)
            };
            vectors.iter().enumerate().filter(of_value).map(|(place, _)| place).collect()
        };
        let (with_true, with_false): (Vec<usize>, Vec<usize>) = (decided(true), decided(false));
        match (with_true.first(), with_false.first()) {
            (Some(case), _) if self.kind == DecisionKind::Switch => Shown::Case(*case),
            (Some(one), Some(other)) => {
                let mut pairs =
                    with_true.iter().flat_map(|a| with_false.iter().map(move |b| (*a, *b)));
                let best =
                    pairs.find(|(a, b)| vectors[*a].differs_only_in(&vectors[*b], condition));
                let (a, b) = best.unwrap_or((*one, *other));
                Shown::Pair([a, b])
            }
            (one, other) => {
                let is_case = self.kind == DecisionKind::Switch;
                Shown::Missing { with_true: one.is_none(), with_false: other.is_none() && !is_case }
            }
        }
    }
}
