//! Trained models: decision trees (CART), boosted trees, and the hierarchy that asks first for the actuator, then for the
//! action, then for the detail.
//!
//! A row is an array of features. View k of a window shows the actuators rotated: actuator k is in the first place.

use crate::sizes::{ACTIONS, ACTUATORS, FEATURES, HYPOTHESES};
use libm::{exp, log};

/// Most classes of a stage.
pub const MOST_CLASSES: usize = 32;

/// Set in the feature of a node where a row without a value (NaN) goes left.
const MISSING_LEFT: u16 = 1 << 15;

/// Lower limit of a probability before its logarithm is taken.
const LEAST_PROBABILITY: f64 = 1e-15;

/// The features of a window in every view.
pub type Views = [[f64; FEATURES]];

/// The trees of a stage. A child is another node, or the leaf -1 - child.
pub struct Branches {
    /// Most tests on the way to a leaf.
    pub depth: usize,
    pub roots: &'static [i16],
    pub features: &'static [u16],
    /// A value goes left unless it is larger.
    pub thresholds: &'static [f64],
    pub left: &'static [i16],
    pub right: &'static [i16],
}

/// One tree that decides: for each leaf its class and the probability of that class.
pub struct Cart {
    pub decisions: &'static [u8],
    pub probabilities: &'static [f64],
}

/// Trees whose leaves add to the scores of the classes.
pub struct Boosted {
    /// The class of each output.
    pub output_classes: &'static [u8],
    /// Score of each class before the first tree.
    pub start: &'static [f64],
    /// Of each leaf, for each output.
    pub values: &'static [f64],
    pub inverse_temperature: f64,
}

/// How the leaves of a stage decide.
pub enum Rule {
    Cart(&'static Cart),
    Boosted(&'static Boosted),
}

/// One question.
pub struct Stage {
    pub branches: Branches,
    pub rule: Rule,
    /// The actuator, action or detail of each class.
    pub names: &'static [u8],
    /// Whether it reads the view of the accused actuator, and not the first one.
    pub reads_own_view: bool,
}

/// The stages, and where each question has its own.
pub struct Hierarchy {
    pub stages: &'static [Stage],
    pub actuator_stage: Option<u8>,
    /// Of each actuator.
    pub action_stages: &'static [Option<u8>],
    /// Of each actuator and action.
    pub detail_stages: &'static [Option<u8>],
}

/// The answer to a question; nothing is decided where nothing was asked.
#[derive(Clone, Copy)]
pub struct Answer {
    pub decided: Option<usize>,
    pub probability: f64,
}

/// Indices of names. Healthy is no actuator.
pub struct Diagnosis {
    pub actuator: Option<usize>,
    pub action: Option<usize>,
    pub detail: Option<usize>,
    /// Probability that actuator and action are right.
    pub confidence: f64,
    /// Probability of the detail, given the action.
    pub detail_confidence: f64,
}

/// Index of the largest value; the first of a tie.
pub fn largest(values: &[f64]) -> usize {
    (1..values.len()).fold(0, |best, place| if values[place] > values[best] { place } else { best })
}

/// Divides values by their sum.
fn normalize(values: &mut [f64]) {
    let sum = values.iter().fold(0.0, |sum, value| sum + value);
    values.iter_mut().for_each(|value| *value /= sum);
}

/// Makes probabilities more or less certain: p^(1/T), normalized.
fn scale(shares: &mut [f64], inverse_temperature: f64) {
    let most = shares[largest(shares)].max(LEAST_PROBABILITY);
    for share in shares.iter_mut() {
        *share = exp(log(share.max(LEAST_PROBABILITY) / most) * inverse_temperature);
    }
    normalize(shares);
}

impl Branches {
    /// The leaf that a row reaches in a tree.
    pub fn leaf(&self, tree: usize, row: &[f64]) -> usize {
        let mut place = self.roots[tree];
        for _ in 0..self.depth {
            let Ok(node) = usize::try_from(place) else { break };
            let side = if self.goes_left(node, row) { self.left } else { self.right };
            place = side[node];
        }
        usize::from((-1 - place).unsigned_abs())
    }

    fn goes_left(&self, node: usize, row: &[f64]) -> bool {
        let feature = self.features[node];
        let value = row[usize::from(feature & !MISSING_LEFT)];
        match value.is_nan() {
            true => feature & MISSING_LEFT != 0,
            false => value <= self.thresholds[node],
        }
    }
}

impl Boosted {
    /// Writes the shares of the classes as the trees give them.
    fn boost(&self, branches: &Branches, row: &[f64], shares: &mut [f64]) {
        shares.copy_from_slice(self.start);
        let outputs = self.output_classes.len();
        for tree in 0..branches.roots.len() {
            let values = &self.values[branches.leaf(tree, row) * outputs..];
            for (class, value) in self.output_classes.iter().zip(values) {
                shares[usize::from(*class)] += value;
            }
        }
        let most = shares[largest(shares)];
        shares.iter_mut().for_each(|share| *share = exp(*share - most));
        normalize(shares);
    }
}

impl Stage {
    /// Writes the probability of each class by boosted trees.
    pub fn shares<'s>(&self, row: &[f64], memory: &'s mut [f64; MOST_CLASSES]) -> &'s [f64] {
        let shares = &mut memory[..self.names.len()];
        if let Rule::Boosted(boosted) = self.rule {
            boosted.boost(&self.branches, row, shares);
            scale(shares, boosted.inverse_temperature);
        }
        shares
    }

    /// The class that a row gets.
    pub fn decide(&self, row: &[f64]) -> Answer {
        let (class, probability) = match self.rule {
            Rule::Cart(cart) => {
                let leaf = self.branches.leaf(0, row);
                (usize::from(cart.decisions[leaf]), cart.probabilities[leaf])
            }
            Rule::Boosted(boosted) => {
                let shares = &mut [0.0; MOST_CLASSES][..self.names.len()];
                boosted.boost(&self.branches, row, shares);
                let likeliest = largest(shares);
                scale(shares, boosted.inverse_temperature);
                (likeliest, shares[likeliest])
            }
        };
        Answer { decided: Some(usize::from(self.names[class])), probability }
    }

    /// The row that it reads for an accused actuator.
    fn row<'v>(&self, views: &'v Views, actuator: usize) -> &'v [f64] {
        &views[if self.reads_own_view { actuator } else { 0 }]
    }
}

impl Hierarchy {
    fn stage(&self, place: Option<u8>) -> Option<&'static Stage> {
        place.map(|place| &self.stages[usize::from(place)])
    }

    /// Asks a stage for an actuator; without the stage, the answer is `otherwise`, and certain.
    fn ask(
        &self,
        place: Option<u8>,
        actuator: usize,
        views: &Views,
        otherwise: Option<usize>,
    ) -> Answer {
        let certain = Answer { decided: otherwise, probability: 1.0 };
        self.stage(place).map_or(certain, |stage| stage.decide(stage.row(views, actuator)))
    }

    /// The detail of a fault with known actuator and action.
    pub fn detail(&self, views: &Views, actuator: usize, action: usize) -> Answer {
        self.ask(self.detail_stages[actuator * ACTIONS + action], actuator, views, None)
    }

    /// Asks for actuator, action and detail.
    pub fn diagnose(&self, views: &Views) -> Diagnosis {
        let first = self.ask(self.actuator_stage, 0, views, Some(0));
        let mut found = Diagnosis {
            actuator: first.decided.filter(|actuator| *actuator < ACTUATORS),
            action: None,
            detail: None,
            confidence: first.probability,
            detail_confidence: 1.0,
        };
        if let Some(actuator) = found.actuator {
            let answer = self.ask(self.action_stages[actuator], actuator, views, None);
            found.action = answer.decided;
            found.confidence *= answer.probability;
            if let Some(action) = answer.decided {
                let answer = self.detail(views, actuator, action);
                (found.detail, found.detail_confidence) = (answer.decided, answer.probability);
            }
        }
        found
    }

    /// The probability of healthy, then of each action actuator by actuator, by boosted trees.
    pub fn probabilities(&self, views: &Views) -> [f64; HYPOTHESES] {
        let mut all = [0.0; HYPOTHESES];
        let of_actuators = self.share_among_actuators(views, &mut all[0]);
        let actions = all[1..].chunks_exact_mut(ACTIONS);
        for (actuator, (own, share)) in actions.zip(of_actuators).enumerate() {
            self.share_among_actions(views, actuator, share, own);
        }
        all
    }

    /// The probability of each actuator; writes that of healthy.
    fn share_among_actuators(&self, views: &Views, healthy: &mut f64) -> [f64; ACTUATORS] {
        let mut of_actuators = [0.0; ACTUATORS];
        let Some(stage) = self.stage(self.actuator_stage) else {
            of_actuators[0] = 1.0;
            return of_actuators;
        };
        let mut memory = [0.0; MOST_CLASSES];
        for (name, share) in stage.names.iter().zip(stage.shares(&views[0], &mut memory)) {
            *of_actuators.get_mut(usize::from(*name)).unwrap_or(healthy) = *share;
        }
        of_actuators
    }

    /// Divides the probability of an actuator among its actions.
    fn share_among_actions(&self, views: &Views, actuator: usize, share: f64, own: &mut [f64]) {
        let Some(stage) = self.stage(self.action_stages[actuator]) else {
            own.fill(share / ACTIONS as f64);
            return;
        };
        let mut memory = [0.0; MOST_CLASSES];
        let shares = stage.shares(stage.row(views, actuator), &mut memory);
        for (name, part) in stage.names.iter().zip(shares) {
            own[usize::from(*name)] = share * part;
        }
    }
}
