//! The raised action, the actuators that are off, and the rules that restrict what may be raised.

use crate::judge::{hypothesis_of, parts_of};
use crate::session::{Alarm, Raised};
use crate::sizes::ACTUATORS;
use crate::tables::{SWITCHES_OFF, TUNING};

/// The alarm state of a session.
#[derive(Clone)]
pub struct Memory {
    pub raised: Option<Raised>,
    /// First sample without evidence for the raised action.
    recovering_since: Option<u64>,
    pub is_off: [bool; ACTUATORS],
    /// Actuators whose shutdown was ever raised, until they are released.
    pub was_claimed_off: [bool; ACTUATORS],
    /// Actuators that are on but not judged.
    pub is_inhibited: [bool; ACTUATORS],
}

impl Memory {
    pub const NONE: Memory = Memory {
        raised: None,
        recovering_since: None,
        is_off: [false; ACTUATORS],
        was_claimed_off: [false; ACTUATORS],
        is_inhibited: [false; ACTUATORS],
    };

    /// Whether an actuator is not judged.
    pub fn is_masked(&self, actuator: usize) -> bool {
        self.is_off[actuator] || self.is_inhibited[actuator]
    }

    /// Whether the raised action is latched, because it switches off.
    fn is_latched(&self) -> bool {
        self.raised.is_some_and(|raised| SWITCHES_OFF[raised.action])
    }

    fn drop_raised(&mut self) {
        (self.raised, self.recovering_since) = (None, None);
    }

    /// Withdraws the raised action of an actuator.
    pub fn drop_raised_of(&mut self, actuator: usize) {
        if self.raised.is_some_and(|raised| raised.actuator == actuator) {
            self.drop_raised();
        }
    }

    /// Whether a hypothesis may be raised at all. For a shutdown, enough other actuators must be on and never have been
    /// claimed off, and no other actuator may have an alarm.
    pub fn allows(&self, claim: usize) -> bool {
        let Some((actuator, action)) = parts_of(claim) else { return false };
        let stays_on = |other: &usize| {
            *other != actuator && !self.is_off[*other] && !self.was_claimed_off[*other]
        };
        let others = (0..ACTUATORS).filter(stays_on).count();
        let is_another_raised = self.raised.is_some_and(|raised| raised.actuator != actuator);
        let may_switch_off = others >= TUNING.least_on && !is_another_raised;
        !self.is_masked(actuator) && (!SWITCHES_OFF[action] || may_switch_off)
    }

    /// Raises an allowed action, or updates the raised one. A latched alarm gives way to no other.
    pub fn raise(&mut self, new: Raised) {
        let is_same = |old: &Raised| (old.actuator, old.action) == (new.actuator, new.action);
        if let Some(old) = self.raised.filter(is_same) {
            let detail = new.detail.or(old.detail);
            self.raised = Some(Raised { detail, sample: old.sample, ..new });
        } else if !self.is_latched() && self.allows(hypothesis_of(new.actuator, new.action)) {
            self.raised = Some(new);
            self.was_claimed_off[new.actuator] |= SWITCHES_OFF[new.action];
        }
        self.recovering_since = None;
    }

    /// Without evidence for long enough, an alarm that is not latched ends.
    pub fn hold(&mut self, has_evidence: bool, sample: u64) {
        if has_evidence || self.raised.is_none() || self.is_latched() {
            self.recovering_since = None;
            return;
        }
        let since = *self.recovering_since.get_or_insert(sample);
        if sample.saturating_sub(since) >= TUNING.recover_samples {
            self.drop_raised();
        }
    }

    /// The state of the alarm.
    pub fn state(&self, is_pending: bool) -> Alarm {
        match (self.raised, self.recovering_since) {
            (Some(_), None) => Alarm::Raised,
            (Some(_), Some(_)) => Alarm::Recovering,
            (None, _) if is_pending => Alarm::Pending,
            (None, _) => Alarm::Normal,
        }
    }
}
