//! The raised action, the actuators that are off, and the rules that restrict what may be raised.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::decision::Hypotheses;
use super::outcome::{Places, Raised};
use super::tuning::Tuning;
use crate::hierarchy::Names;

/// The alarm state of a session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AlarmMemory {
    pub raised: Option<Raised>,
    /// First sample without evidence for the raised action.
    recovering_since: Option<u64>,
    /// Actuators that were switched off.
    pub is_off: Vec<bool>,
    /// Actuators whose shutdown was ever raised, until they are released.
    was_claimed_off: Vec<bool>,
    /// Actuators that are on but not judged.
    pub is_inhibited: Vec<bool>,
}

/// The rules of raising an action.
#[derive(Debug, Clone)]
pub(super) struct AlarmRules {
    hypotheses: Hypotheses,
    switches_off: Vec<bool>,
    least_on: usize,
    recover_samples: u64,
}

impl AlarmRules {
    pub fn new(tuning: &Tuning, names: &Names, recover_samples: u64) -> Self {
        AlarmRules {
            hypotheses: Hypotheses::of(names),
            switches_off: tuning.switches_off(names),
            least_on: tuning.least_on as usize,
            recover_samples,
        }
    }

    /// Whether an action switches an actuator off.
    pub fn switches_off(&self, action: u32) -> bool {
        self.switches_off[action as usize]
    }
}

impl AlarmMemory {
    pub fn new(actuators: usize) -> Self {
        AlarmMemory {
            raised: None,
            recovering_since: None,
            is_off: vec![false; actuators],
            was_claimed_off: vec![false; actuators],
            is_inhibited: vec![false; actuators],
        }
    }

    /// Clears everything.
    pub fn clear(&mut self) {
        self.drop_raised();
        for list in [&mut self.is_off, &mut self.was_claimed_off, &mut self.is_inhibited] {
            list.fill(false);
        }
    }

    /// Whether a stored memory fits the names, window lengths and samples so far.
    pub fn fits(&self, places: &Places, samples: u64) -> bool {
        let lists = [&self.is_off, &self.was_claimed_off, &self.is_inhibited];
        lists.iter().all(|list| list.len() == places.hypotheses.actuators)
            && self.raised.as_ref().is_none_or(|raised| raised.fits(places, samples))
            && self.recovering_since.is_none_or(|since| since <= samples)
    }

    /// Whether a hypothesis may be raised at all. Its actuator must be judged. For a shutdown, enough other actuators
    /// must be on and never have been claimed off, and no other actuator may have an alarm. Two failures within seconds
    /// are less likely than one failure that now looks different.
    pub fn allows(&self, rules: &AlarmRules, hypothesis: usize) -> bool {
        let Some((actuator, action)) = rules.hypotheses.split(hypothesis) else { return false };
        if self.is_masked(actuator) {
            return false;
        }
        let stays_on = |other: &usize| {
            *other != actuator && !self.is_off[*other] && !self.was_claimed_off[*other]
        };
        let others = (0..self.is_off.len()).filter(stays_on).count();
        let is_another_raised =
            self.raised.is_some_and(|raised| raised.actuator as usize != actuator);
        !rules.switches_off[action] || (others >= rules.least_on && !is_another_raised)
    }

    /// Whether the raised action is latched, because it switches off.
    pub fn is_latched(&self, rules: &AlarmRules) -> bool {
        self.raised.is_some_and(|raised| rules.switches_off(raised.action))
    }

    /// Whether the evidence for the raised action has ended.
    pub fn is_recovering(&self) -> bool {
        self.recovering_since.is_some()
    }

    /// The raised hypothesis.
    pub fn hypothesis(&self, rules: &AlarmRules) -> Option<usize> {
        self.raised.map(|r| rules.hypotheses.place(r.actuator as usize, r.action as usize))
    }

    /// Raises an allowed action, or updates the raised one. A latched alarm gives way to no other.
    pub fn raise(&mut self, rules: &AlarmRules, new: Raised) {
        let same = |old: &Raised| (old.actuator, old.action) == (new.actuator, new.action);
        let hypothesis = rules.hypotheses.place(new.actuator as usize, new.action as usize);
        if let Some(old) = self.raised.filter(same) {
            self.raised =
                Some(Raised { detail: new.detail.or(old.detail), sample: old.sample, ..new });
        } else if !self.is_latched(rules) && self.allows(rules, hypothesis) {
            self.raised = Some(new);
            self.was_claimed_off[new.actuator as usize] |= rules.switches_off(new.action);
        }
        self.recovering_since = None;
    }

    /// Updates the recovery time: without evidence for long enough, an alarm that is not latched ends.
    pub fn hold(&mut self, rules: &AlarmRules, has_evidence: bool, sample: u64) {
        if has_evidence || self.raised.is_none() || self.is_latched(rules) {
            self.recovering_since = None;
            return;
        }
        let since = *self.recovering_since.get_or_insert(sample);
        if sample.saturating_sub(since) >= rules.recover_samples {
            self.drop_raised();
        }
    }

    fn drop_raised(&mut self) {
        (self.raised, self.recovering_since) = (None, None);
    }

    /// Whether an actuator is excluded from the answers.
    pub fn is_masked(&self, actuator: usize) -> bool {
        self.is_off[actuator] || self.is_inhibited[actuator]
    }

    /// Stops or resumes judging an actuator.
    pub fn inhibit(&mut self, actuator: usize, is_inhibited: bool) {
        self.is_inhibited[actuator] = is_inhibited;
        if is_inhibited {
            self.drop_raised_of(actuator);
        }
    }

    /// Records that an actuator was switched off.
    pub fn switch_off(&mut self, actuator: usize) {
        (self.is_off[actuator], self.was_claimed_off[actuator]) = (true, true);
        self.drop_raised_of(actuator);
    }

    /// Records that an actuator is on and may be switched off again.
    pub fn release(&mut self, actuator: usize) {
        (self.is_off[actuator], self.was_claimed_off[actuator]) = (false, false);
        self.drop_raised_of(actuator);
    }

    fn drop_raised_of(&mut self, actuator: usize) {
        if self.raised.is_some_and(|raised| raised.actuator as usize == actuator) {
            self.drop_raised();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use alloc::format;

    fn rules(actuators: usize) -> AlarmRules {
        rules_that_keep(None, actuators)
    }

    fn rules_that_keep(least_on: Option<usize>, actuators: usize) -> AlarmRules {
        let list = |count: usize| (0..count).map(|i| format!("{i}")).collect();
        let names = Names {
            features: vec![],
            actuators: list(actuators),
            actions: list(3),
            details: list(2),
        };
        let usual = Tuning::usual(&names, &["0"]);
        let least_on = least_on.map_or(usual.least_on, |least| least as u32);
        AlarmRules::new(&Tuning { least_on, ..usual }, &names, 500)
    }

    fn raised(actuator: usize, action: usize, sample: u64) -> Raised {
        let (actuator, action) = (actuator as u32, action as u32);
        Raised { actuator, action, detail: Some(1), sample, length: 0, confidence: 0.9 }
    }

    /// Random events in random order; only a release allows another shutdown of an actuator. The minimum number of
    /// actuators is never commanded to switch off, and all others can be.
    #[test]
    fn the_last_actuators_are_never_switched_off() {
        let counts = (2..=5).flat_map(|all| (1..=all).map(move |kept| (all, kept)));
        for (actuators, least_on) in counts {
            let rules = rules_that_keep(Some(least_on), actuators);
            let mut fewest = actuators;
            for seed in 0..100 {
                let mut random = Random::new(seed);
                let mut memory = AlarmMemory::new(actuators);
                let mut claimed = vec![false; actuators];
                for sample in 0..400 {
                    let actuator = random.index(actuators);
                    match random.index(8) {
                        // Now and then an actuator is switched off from outside or released.
                        0 if memory.raised.is_some_and(|r| r.action == 0) => {
                            memory.switch_off(memory.raised.unwrap().actuator as usize);
                        }
                        1 if random.unit() < 0.02 => {
                            memory.release(actuator);
                            claimed[actuator] = false;
                        }
                        2 => memory.hold(&rules, false, sample * 300),
                        3 => memory.inhibit(actuator, random.unit() < 0.5),
                        _ => {
                            let any = random.index(rules.hypotheses.count());
                            if let Some((actuator, action)) = rules.hypotheses.split(any) {
                                memory.raise(&rules, raised(actuator, action, sample));
                            }
                        }
                    }
                    if let Some(raised) = memory.raised.filter(|raised| raised.action == 0) {
                        claimed[raised.actuator as usize] = true;
                    }
                    let kept = claimed.iter().filter(|claimed| !**claimed).count();
                    assert!(kept >= least_on, "{actuators} actuators, seed {seed}");
                    fewest = fewest.min(kept);
                }
            }
            assert_eq!(fewest, least_on, "of {actuators}");
        }
    }

    /// An apparent second failure soon after the first is the first one, seen differently.
    #[test]
    fn nothing_is_switched_off_while_another_actuator_has_an_alarm() {
        let rules = rules(2);
        let mut memory = AlarmMemory::new(2);
        memory.raise(&rules, raised(0, 1, 10));
        memory.raise(&rules, raised(1, 0, 20));
        assert_eq!(memory.raised, Some(raised(0, 1, 10)));
        // A milder action for the other actuator may be raised, then this one's shutdown.
        memory.raise(&rules, raised(1, 2, 30));
        assert_eq!(memory.raised, Some(raised(1, 2, 30)));
        memory.raise(&rules, raised(1, 0, 40));
        assert_eq!(memory.raised, Some(raised(1, 0, 40)));
        // The other's shutdown may be raised once the alarm is over.
        let mut memory = AlarmMemory::new(2);
        memory.raise(&rules, raised(0, 1, 10));
        (10..=10 + rules.recover_samples + 1).for_each(|sample| memory.hold(&rules, false, sample));
        memory.raise(&rules, raised(1, 0, 2000));
        assert_eq!(memory.raised, Some(raised(1, 0, 2000)));
    }

    /// No other actuator could take over, and none must be kept for it.
    #[test]
    fn a_single_actuator_may_be_stopped_unless_it_must_stay_on() {
        for (least_on, stops) in [(None, true), (Some(0), true), (Some(1), false)] {
            let rules = rules_that_keep(least_on, 1);
            let mut memory = AlarmMemory::new(1);
            memory.raise(&rules, raised(0, 0, 10));
            assert_eq!(memory.raised.is_some(), stops, "{least_on:?}");
        }
    }

    #[test]
    fn what_recovers_is_over_after_its_time_but_not_what_switches_off() {
        let rules = rules(2);
        let mut memory = AlarmMemory::new(2);
        memory.raise(&rules, raised(0, 1, 10));
        memory.raise(&rules, Raised { detail: None, confidence: 0.8, ..raised(0, 1, 20) });
        assert_eq!(memory.raised, Some(Raised { confidence: 0.8, ..raised(0, 1, 10) }));
        memory.hold(&rules, false, 100);
        assert!(memory.is_recovering());
        memory.hold(&rules, true, 300);
        memory.hold(&rules, false, 400);
        memory.hold(&rules, false, 899);
        assert!(memory.is_recovering() && memory.raised.is_some());
        memory.hold(&rules, false, 900);
        assert!(!memory.is_recovering() && memory.raised.is_none());
        memory.raise(&rules, raised(1, 0, 1000));
        for sample in 1000..10_000 {
            memory.hold(&rules, false, sample);
        }
        assert!(memory.is_latched(&rules) && !memory.is_recovering());
        memory.raise(&rules, raised(0, 0, 10_000));
        assert_eq!(memory.raised.unwrap().actuator, 1);
        memory.switch_off(1);
        assert!(memory.raised.is_none() && !memory.allows(&rules, 4) && !memory.allows(&rules, 1));
        assert!(memory.allows(&rules, 2));
        memory.release(1);
        assert!(memory.allows(&rules, 1));
    }
}
