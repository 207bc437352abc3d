//! The raised action, the shutdowns that stand, the actuators that are off, and the rules that restrict what may be
//! raised.
//!
//! An action is *active* while it has evidence, and `recover_s` longer. A shutdown also *stands* until it is withdrawn:
//! neither a gap nor healthy residuals nor a switch take it back. While it stands, everything else is judged and may
//! become active, but no other actuator may be shut down.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::decision::Hypotheses;
use super::outcome::{Alarm, Places, Raised};
use super::tuning::Tuning;
use crate::hierarchy::Names;

/// The alarm state of a session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AlarmMemory {
    /// The action whose evidence has not ended for long enough.
    pub active: Option<Raised>,
    /// First sample without evidence for the active action.
    recovering_since: Option<u64>,
    /// For each actuator, the shutdown that was raised and not withdrawn.
    pub stands: Vec<Option<Raised>>,
    /// Actuators that were switched off.
    pub is_off: Vec<bool>,
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
    pub(crate) fn new(tuning: &Tuning, names: &Names, recover_samples: u64) -> Self {
        AlarmRules {
            hypotheses: Hypotheses::of(names),
            switches_off: tuning.switches_off(names),
            least_on: tuning.least_on as usize,
            recover_samples,
        }
    }

    /// Whether an action switches an actuator off.
    pub(crate) fn switches_off(&self, action: u32) -> bool {
        self.switches_off[action as usize]
    }
}

impl AlarmMemory {
    pub(crate) fn new(actuators: usize) -> Self {
        AlarmMemory {
            active: None,
            recovering_since: None,
            stands: vec![None; actuators],
            is_off: vec![false; actuators],
            is_inhibited: vec![false; actuators],
        }
    }

    /// Clears everything.
    pub(crate) fn clear(&mut self) {
        self.withdraw_all();
        self.is_off.fill(false);
        self.is_inhibited.fill(false);
    }

    /// Whether a stored memory fits the names, window lengths and samples so far.
    pub(crate) fn fits(&self, places: &Places, samples: u64) -> bool {
        let actuators = places.hypotheses.actuators;
        let mut stands = (0_u32..).zip(&self.stands);
        [self.stands.len(), self.is_off.len(), self.is_inhibited.len()] == [actuators; 3]
            && stands.all(|(own, stands)| stands.is_none_or(|raised| raised.actuator == own))
            && self.stands.iter().chain([&self.active]).flatten().all(|r| r.fits(places, samples))
            && self.recovering_since.is_none_or(|since| since <= samples)
    }

    /// The action to carry out: a shutdown that stands for a judged actuator before the active action.
    pub(crate) fn raised(&self) -> Option<Raised> {
        self.shutdown().or(self.active)
    }

    fn shutdown(&self) -> Option<Raised> {
        let is_judged = |raised: &Raised| !self.is_masked(raised.actuator as usize);
        self.stands.iter().flatten().copied().find(is_judged)
    }

    /// The alarm of the raised action, or of none.
    pub(crate) fn state(&self, is_pending: bool) -> Alarm {
        match (self.shutdown(), self.active) {
            (None, Some(_)) if self.recovering_since.is_some() => Alarm::Recovering,
            (None, None) if is_pending => Alarm::Pending,
            (None, None) => Alarm::Normal,
            _ => Alarm::Raised,
        }
    }

    /// Whether a hypothesis may be raised at all. Its actuator must be judged. For a shutdown, enough other actuators
    /// must be on without a shutdown that stands, and no other actuator may have an alarm. Two failures within seconds
    /// are less likely than one failure that now looks different.
    pub(crate) fn allows(&self, rules: &AlarmRules, hypothesis: usize) -> bool {
        let Some((actuator, action)) = rules.hypotheses.split(hypothesis) else { return false };
        if self.is_masked(actuator) {
            return false;
        }
        let stays_on = |other: &usize| {
            *other != actuator && !self.is_off[*other] && self.stands[*other].is_none()
        };
        let others = (0..self.is_off.len()).filter(stays_on).count();
        let is_another = |raised: Raised| raised.actuator as usize != actuator;
        let is_another_raised =
            self.raised().is_some_and(is_another) || self.active.is_some_and(is_another);
        !rules.switches_off[action] || (others >= rules.least_on && !is_another_raised)
    }

    /// The active hypothesis.
    pub(crate) fn hypothesis(&self, rules: &AlarmRules) -> Option<usize> {
        self.active.map(|r| rules.hypotheses.place(r.actuator as usize, r.action as usize))
    }

    /// Raises an allowed action, or updates the active one; a shutdown with evidence gives way to no other. Returns
    /// whether the action is active.
    pub(crate) fn raise(&mut self, rules: &AlarmRules, new: Raised) -> bool {
        let (actuator, is_shutdown) = (new.actuator as usize, rules.switches_off(new.action));
        let same = |old: &Raised| (old.actuator, old.action) == (new.actuator, new.action);
        let known = self.active.filter(same).or(self.stands[actuator].filter(same));
        let is_held = self.recovering_since.is_none()
            && self.active.is_some_and(|old| !same(&old) && rules.switches_off(old.action));
        let hypothesis = rules.hypotheses.place(actuator, new.action as usize);
        let is_allowed = known.is_some() || self.allows(rules, hypothesis);
        if is_held || !is_allowed || self.is_masked(actuator) {
            return false;
        }
        let detail = new.detail.or(known.and_then(|old| old.detail));
        let sample = known.map_or(new.sample, |old| old.sample);
        self.active = Some(Raised { detail, sample, ..new });
        if is_shutdown {
            self.stands[actuator] = self.active;
        }
        self.recovering_since = None;
        true
    }

    /// Updates the recovery time: without evidence for long enough, an action is active no more.
    pub(crate) fn hold(&mut self, rules: &AlarmRules, has_evidence: bool, sample: u64) {
        if has_evidence || self.active.is_none() {
            self.recovering_since = None;
            return;
        }
        let since = *self.recovering_since.get_or_insert(sample);
        if sample.saturating_sub(since) >= rules.recover_samples {
            self.drop_active();
        }
    }

    fn drop_active(&mut self) {
        (self.active, self.recovering_since) = (None, None);
    }

    /// Whether an actuator is excluded from the answers.
    pub(crate) fn is_masked(&self, actuator: usize) -> bool {
        self.is_off[actuator] || self.is_inhibited[actuator]
    }

    /// Stops or resumes judging an actuator.
    pub(crate) fn inhibit(&mut self, actuator: usize, is_inhibited: bool) {
        self.is_inhibited[actuator] = is_inhibited;
        if is_inhibited {
            self.drop_active_of(actuator);
        }
    }

    /// Records that an actuator was switched off or on. A shutdown that was raised for it stands.
    pub(crate) fn switch(&mut self, actuator: usize, is_off: bool) {
        self.is_off[actuator] = is_off;
        self.drop_active_of(actuator);
    }

    /// Withdraws what was raised for an actuator.
    pub(crate) fn withdraw(&mut self, actuator: usize) {
        self.stands[actuator] = None;
        self.drop_active_of(actuator);
    }

    /// Withdraws everything that was raised.
    pub(crate) fn withdraw_all(&mut self) {
        self.stands.fill(None);
        self.drop_active();
    }

    fn drop_active_of(&mut self, actuator: usize) {
        if self.active.is_some_and(|raised| raised.actuator as usize == actuator) {
            self.drop_active();
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

    /// Random events in random order: a shutdown stands until it is withdrawn, the minimum number of actuators is never
    /// commanded to switch off, and all others can be.
    #[test]
    fn a_shutdown_stands_until_it_is_withdrawn_and_the_last_actuators_stay_on() {
        let counts = (2..=5).flat_map(|all| (1..=all).map(move |kept| (all, kept)));
        for (actuators, least_on) in counts {
            let rules = rules_that_keep(Some(least_on), actuators);
            let mut fewest = actuators;
            for seed in 0..100 {
                let mut random = Random::new(seed);
                let mut memory = AlarmMemory::new(actuators);
                let mut stands = vec![false; actuators];
                for sample in 0..400 {
                    let actuator = random.index(actuators);
                    match random.index(8) {
                        // Now and then an actuator is switched off or on, or its alarm is reset.
                        0 if memory.raised().is_some_and(|r| r.action == 0) => {
                            memory.switch(memory.raised().unwrap().actuator as usize, true);
                        }
                        1 if random.unit() < 0.02 => memory.switch(actuator, false),
                        1 if random.unit() < 0.02 => {
                            memory.withdraw(actuator);
                            stands[actuator] = false;
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
                    for (actuator, stands) in stands.iter_mut().enumerate() {
                        let now = memory.stands[actuator];
                        assert!(now.is_some() || !*stands, "{actuators} actuators, seed {seed}");
                        *stands = now.is_some();
                        let is_judged = !memory.is_masked(actuator);
                        let is_off = memory.raised().is_some_and(|raised| raised.action == 0);
                        assert!(is_off || !(*stands && is_judged), "what stands is raised");
                    }
                    let on = stands.iter().zip(&memory.is_off);
                    let kept = on.filter(|(stands, is_off)| !**stands && !**is_off).count();
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
        assert_eq!(memory.raised(), Some(raised(0, 1, 10)));
        // A milder action for the other actuator may be raised, then this one's shutdown.
        memory.raise(&rules, raised(1, 2, 30));
        assert_eq!(memory.raised(), Some(raised(1, 2, 30)));
        memory.raise(&rules, raised(1, 0, 40));
        assert_eq!(memory.raised(), Some(raised(1, 0, 40)));
        // The other's shutdown may be raised once the alarm is over.
        let mut memory = AlarmMemory::new(2);
        memory.raise(&rules, raised(0, 1, 10));
        (10..=10 + rules.recover_samples + 1).for_each(|sample| memory.hold(&rules, false, sample));
        memory.raise(&rules, raised(1, 0, 2000));
        assert_eq!(memory.raised(), Some(raised(1, 0, 2000)));
    }

    /// No other actuator could take over, and none must be kept for it.
    #[test]
    fn a_single_actuator_may_be_stopped_unless_it_must_stay_on() {
        for (least_on, stops) in [(None, true), (Some(0), true), (Some(1), false)] {
            let rules = rules_that_keep(least_on, 1);
            let mut memory = AlarmMemory::new(1);
            memory.raise(&rules, raised(0, 0, 10));
            assert_eq!(memory.raised().is_some(), stops, "{least_on:?}");
        }
    }

    #[test]
    fn what_recovers_is_over_after_its_time_but_a_shutdown_stands() {
        let rules = rules(2);
        let mut memory = AlarmMemory::new(2);
        memory.raise(&rules, raised(0, 1, 10));
        memory.raise(&rules, Raised { detail: None, confidence: 0.8, ..raised(0, 1, 20) });
        assert_eq!(memory.raised(), Some(Raised { confidence: 0.8, ..raised(0, 1, 10) }));
        memory.hold(&rules, false, 100);
        assert_eq!(memory.state(false), Alarm::Recovering);
        memory.hold(&rules, true, 300);
        memory.hold(&rules, false, 400);
        memory.hold(&rules, false, 899);
        assert!(memory.state(false) == Alarm::Recovering && memory.raised().is_some());
        memory.hold(&rules, false, 900);
        assert!(memory.state(false) == Alarm::Normal && memory.raised().is_none());
        memory.raise(&rules, raised(1, 0, 1000));
        (1000..10_000).for_each(|sample| memory.hold(&rules, false, sample));
        assert_eq!((memory.state(true), memory.active), (Alarm::Raised, None));
        memory.raise(&rules, raised(0, 0, 10_000));
        assert_eq!(memory.raised(), Some(raised(1, 0, 1000)));
        // Carried out, it needs no action; switched on again, it does.
        memory.switch(1, true);
        assert!(
            memory.raised().is_none() && !memory.allows(&rules, 4) && !memory.allows(&rules, 1)
        );
        assert!(memory.allows(&rules, 2));
        memory.switch(1, false);
        assert!(memory.raised() == Some(raised(1, 0, 1000)) && !memory.allows(&rules, 1));
        memory.withdraw(1);
        assert!(memory.raised().is_none() && memory.allows(&rules, 1));
    }
}
