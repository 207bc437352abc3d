//! The largest evidence that a session gathers for some claims, in parts of the limit at which they may be raised.

use servotwin_diagnosis::diagnoser::{Diagnoser, Session};

/// The largest evidence of any window length for any of some claims.
pub(super) struct EvidencePeak {
    /// Actuators with their actions.
    pub(crate) claims: Vec<(usize, usize)>,
    /// The largest evidence so far.
    pub(crate) largest: f64,
    /// The largest probability that the committee gave any of the claims.
    pub(crate) probability: f64,
}

impl EvidencePeak {
    /// Follows the chosen actions of actuators.
    pub(crate) fn new(diagnoser: &Diagnoser, is_chosen: impl Fn(usize, usize) -> bool) -> Self {
        let names = diagnoser.names();
        let actions = 0..names.actions.len();
        let all = (0..names.actuators.len())
            .flat_map(|actuator| actions.clone().map(move |action| (actuator, action)));
        let claims = all.filter(|&(actuator, action)| is_chosen(actuator, action)).collect();
        EvidencePeak { claims, largest: 0.0, probability: 0.0 }
    }

    /// Takes the evidence of the windows that end at the session's last sample.
    pub(crate) fn take(&mut self, session: &Session) {
        for length in 0..session.diagnoser().lengths.len() {
            if !session.has_new_window(length) {
                continue;
            }
            for &(actuator, action) in &self.claims {
                self.largest = self.largest.max(session.evidence(length, actuator, action));
                let probability = session.probability(length, Some((actuator, action)));
                self.probability = self.probability.max(probability);
            }
        }
    }
}
