//! The fourth value of a session: the raised action, the shutdowns that stand, the actuators that are off, and the rules
//! that restrict what may be raised.
//!
//! An action is *active* while it has evidence, and `recover_s` longer. A shutdown also *stands* until it is withdrawn:
//! neither a gap nor healthy residuals nor a switch take it back. While it stands, everything else is judged and may
//! become active, but no other actuator may be shut down.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Diagnoser;
use super::decision::Hypotheses;
use super::environment::Why;
use super::evidence::Evidence;
use super::guard::Guard;
use super::outcome::{Alarm, IndexedFinding, Places, Raised};
use super::tuning::Tuning;
use crate::error::{Error, require_sound};
use crate::hierarchy::Names;

/// What is raised, and the rules of raising.
#[derive(Debug, Clone)]
pub(super) struct Alarms {
    pub(crate) hypotheses: Hypotheses,
    switches_off: Vec<bool>,
    least_on: usize,
    recover_samples: u64,
    pub(crate) state: AlarmState,
}

/// What alarms remember.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AlarmState {
    /// The action whose evidence has not ended for long enough.
    pub(crate) active: Option<Raised>,
    /// First sample without evidence for the active action.
    recovering_since: Option<u64>,
    /// For each actuator, the shutdown that was raised and not withdrawn.
    pub(crate) stands: Vec<Option<Raised>>,
    /// Actuators that were switched off.
    pub(crate) is_off: Vec<bool>,
    /// Actuators that are on but not judged.
    is_inhibited: Vec<bool>,
}

/// What a decision is made from.
#[derive(Clone, Copy)]
pub(super) struct Basis<'b> {
    pub(crate) diagnoser: &'b Diagnoser,
    pub(crate) guard: &'b Guard,
    pub(crate) evidence: &'b Evidence,
}

impl Alarms {
    pub(super) fn new(tuning: &Tuning, names: &Names, recover_samples: u64) -> Self {
        let actuators = names.actuators.len();
        Alarms {
            hypotheses: Hypotheses::of(names),
            switches_off: tuning.switches_off(names),
            least_on: tuning.least_on as usize,
            recover_samples,
            state: AlarmState {
                active: None,
                recovering_since: None,
                stands: vec![None; actuators],
                is_off: vec![false; actuators],
                is_inhibited: vec![false; actuators],
            },
        }
    }

    /// Clears everything.
    pub(super) fn clear(&mut self) {
        self.withdraw_all();
        self.state.is_off.fill(false);
        self.state.is_inhibited.fill(false);
    }

    /// Raises, holds or drops an action by the newest evidence. Returns the finding, and the window length that found
    /// it.
    pub(super) fn decide(&mut self, basis: Basis, sample: u64) -> (IndexedFinding, usize) {
        let withheld = self.withheld(basis);
        let candidate = self.candidate(basis);
        let is_raised = candidate.is_some_and(|(length, claim)| {
            let (actuator, action) = self.hypotheses.split(claim).unwrap_or_default();
            let own = &basis.evidence.lengths[length];
            let (detail, share) = own.detail().unzip();
            let confidence = own.probability(claim) * share.unwrap_or(1.0);
            self.raise(Raised {
                actuator: actuator as u32,
                action: action as u32,
                detail,
                sample,
                length: length as u32,
                confidence,
                lead: share.map_or(0.0, |_| confidence),
            })
        });
        if !is_raised {
            let share = basis.diagnoser.tuning.pending_share;
            let has_evidence = self.state.active.is_some_and(|raised| {
                let claim = self.hypotheses.place(raised.actuator as usize, raised.action as usize);
                basis.evidence.lengths.iter().any(|length| length.margin(claim) >= share)
            });
            self.hold(has_evidence, sample);
        }
        match withheld {
            Some(input) if self.state.active.is_none() => {
                (IndexedFinding::EnvironmentInvalid { input, why: Why::Doubtful }, 0)
            }
            _ => self.found(basis),
        }
    }

    /// The hypothesis that a new window raises, and its length: the longest window first, then the largest margin.
    fn candidate(&self, basis: Basis) -> Option<(usize, usize)> {
        let mut best: Option<(u64, f64, usize, usize)> = None;
        for (length, own) in basis.evidence.lengths.iter().enumerate().filter(|(_, l)| l.is_new) {
            for claim in 1..self.hypotheses.count() {
                let margin = own.margin(claim);
                let is_better = best.is_none_or(|(s, m, _, _)| (own.samples, margin) > (s, m));
                if margin >= 1.0 && is_better && self.may_raise(basis, length, claim) {
                    best = Some((own.samples, margin, length, claim));
                }
            }
        }
        best.map(|(_, _, length, claim)| (length, claim))
    }

    fn may_raise(&self, basis: Basis, length: usize, claim: usize) -> bool {
        let own = &basis.evidence.lengths[length];
        let least = basis.diagnoser.lengths[length].panel.least_confidence;
        let accused = self.hypotheses.split(claim).map(|(actuator, _)| actuator);
        self.allows(claim)
            && accused.is_none_or(|actuator| self.is_comparable(basis, actuator))
            && own.agrees_on(claim, least)
            && own.of_unknown() < 1.0
            && !self.is_contradicted(basis, length, claim)
            && self.doubtful_input(basis, claim).is_none()
    }

    fn is_comparable(&self, basis: Basis, actuator: usize) -> bool {
        let is_masked = |actuator| self.is_masked(actuator);
        basis.guard.is_comparable(basis.diagnoser, actuator, is_masked)
    }

    /// Whether another length claims another actuator, or a longer one another action.
    fn is_contradicted(&self, basis: Basis, length: usize, claim: usize) -> bool {
        let actuator_of = |claim| self.hypotheses.split(claim).map(|(actuator, _)| actuator);
        let samples = basis.evidence.lengths[length].samples;
        let others = basis.evidence.lengths.iter().enumerate();
        others.filter(|(other, _)| *other != length).any(|(_, other)| {
            let contradicts = |hypothesis: usize| {
                let is_elsewhere = actuator_of(hypothesis) != actuator_of(claim);
                (is_elsewhere || other.samples > samples) && other.margin(hypothesis) >= 1.0
            };
            (1..self.hypotheses.count()).any(|other| other != claim && contradicts(other))
        })
    }

    /// The input that a shutdown waits for: a wrong reading of it would explain all that its actuator shows.
    fn doubtful_input(&self, basis: Basis, claim: usize) -> Option<u32> {
        let (actuator, _) =
            self.hypotheses.split(claim).filter(|(_, action)| self.switches_off[*action])?;
        basis.evidence.doubtful_input(basis.diagnoser, actuator)
    }

    /// The doubtful input of a shutdown for which there would be enough evidence.
    fn withheld(&self, basis: Basis) -> Option<u32> {
        let is_claimed = |claim: &usize| {
            basis.evidence.lengths.iter().any(|length| length.margin(*claim) >= 1.0)
        };
        let mut claims = (1..self.hypotheses.count()).filter(is_claimed);
        claims.find_map(|claim| self.doubtful_input(basis, claim))
    }

    /// The current finding, and the length that found it.
    fn found(&self, basis: Basis) -> (IndexedFinding, usize) {
        if let Some(raised) = self.state.active {
            let (actuator, action) = (raised.actuator, raised.action);
            let finding = match raised.detail {
                Some(detail) => IndexedFinding::Detail { actuator, action, detail },
                None => IndexedFinding::Action { actuator, action },
            };
            return (finding, raised.length as usize);
        }
        let lengths = &basis.evidence.lengths;
        if let Some(length) = lengths.iter().position(|length| length.of_unknown() >= 1.0) {
            return (IndexedFinding::Unknown, length);
        }
        if let Some(found) = self.found_actuator(basis) {
            return found;
        }
        if let Some(length) = lengths.iter().position(|length| length.of_change() >= 1.0) {
            return (IndexedFinding::Detected, length);
        }
        let first = lengths.iter().position(|length| length.last().is_some());
        (IndexedFinding::Healthy, first.unwrap_or(0))
    }

    /// The actuator that at least one length is sure of, unless two lengths disagree.
    fn found_actuator(&self, basis: Basis) -> Option<(IndexedFinding, usize)> {
        let mut found: Option<(usize, usize)> = None;
        for (place, length) in basis.evidence.lengths.iter().enumerate() {
            for actuator in 0..self.hypotheses.actuators {
                if length.margin_of_actuator(actuator) < 1.0 || !self.is_comparable(basis, actuator)
                {
                    continue;
                }
                if found.is_some_and(|(known, _)| known != actuator) {
                    return None;
                }
                found = found.or(Some((actuator, place)));
            }
        }
        found.map(|(actuator, length)| {
            (IndexedFinding::Actuator { actuator: actuator as u32 }, length)
        })
    }

    /// The action to carry out: a shutdown that stands for a judged actuator before the active action.
    pub(super) fn raised(&self) -> Option<Raised> {
        self.shutdown().or(self.state.active)
    }

    fn shutdown(&self) -> Option<Raised> {
        let is_judged = |raised: &Raised| !self.is_masked(raised.actuator);
        self.state.stands.iter().flatten().copied().find(is_judged)
    }

    /// The alarm of the raised action, or of none.
    pub(super) fn alarm(&self, is_pending: bool) -> Alarm {
        match (self.shutdown(), self.state.active) {
            (None, Some(_)) if self.state.recovering_since.is_some() => Alarm::Recovering,
            (None, None) if is_pending => Alarm::Pending,
            (None, None) => Alarm::Normal,
            _ => Alarm::Raised,
        }
    }

    /// Whether a hypothesis may be raised at all. Its actuator must be judged. For a shutdown, enough other actuators
    /// must be on without a shutdown that stands, and no other actuator may have an alarm. Two failures within seconds
    /// are less likely than one failure that now looks different.
    fn allows(&self, hypothesis: usize) -> bool {
        let Some((actuator, action)) = self.hypotheses.split(hypothesis) else { return false };
        if self.is_masked(actuator as u32) {
            return false;
        }
        let AlarmState { is_off, stands, active, .. } = &self.state;
        let stays_on =
            |other: &usize| *other != actuator && !is_off[*other] && stands[*other].is_none();
        let others = (0..is_off.len()).filter(stays_on).count();
        let is_another = |raised: Raised| raised.actuator as usize != actuator;
        let is_another_raised =
            self.raised().is_some_and(is_another) || active.is_some_and(is_another);
        !self.switches_off[action] || (others >= self.least_on && !is_another_raised)
    }

    /// Raises an allowed action, or updates the active one; a shutdown with evidence gives way to no other. Returns
    /// whether the action is active.
    fn raise(&mut self, new: Raised) -> bool {
        let (actuator, action) = (new.actuator as usize, new.action as usize);
        let is_shutdown = |raised: &Raised| self.switches_off[raised.action as usize];
        let same = |old: &Raised| (old.actuator, old.action) == (new.actuator, new.action);
        let active = self.state.active;
        let known = active.filter(same).or(self.state.stands[actuator].filter(same));
        let is_held = self.state.recovering_since.is_none()
            && active.is_some_and(|old| !same(&old) && is_shutdown(&old));
        let is_allowed = known.is_some() || self.allows(self.hypotheses.place(actuator, action));
        if is_held || !is_allowed || self.is_masked(new.actuator) {
            return false;
        }
        let raised = Some(known.map_or(new, |old| old.confirmed(new)));
        if is_shutdown(&new) {
            self.state.stands[actuator] = raised;
        }
        (self.state.active, self.state.recovering_since) = (raised, None);
        true
    }

    /// Updates the recovery time: without evidence for long enough, an action is active no more.
    fn hold(&mut self, has_evidence: bool, sample: u64) {
        if has_evidence || self.state.active.is_none() {
            self.state.recovering_since = None;
            return;
        }
        let since = *self.state.recovering_since.get_or_insert(sample);
        if sample.saturating_sub(since) >= self.recover_samples {
            self.drop_active();
        }
    }

    fn drop_active(&mut self) {
        (self.state.active, self.state.recovering_since) = (None, None);
    }

    /// Whether an actuator is excluded from the answers.
    pub(super) fn is_masked(&self, actuator: u32) -> bool {
        self.state.is_off[actuator as usize] || self.state.is_inhibited[actuator as usize]
    }

    /// Stops or resumes judging an actuator.
    pub(super) fn inhibit(&mut self, actuator: usize, is_inhibited: bool) {
        self.state.is_inhibited[actuator] = is_inhibited;
        if is_inhibited {
            self.drop_active_of(actuator);
        }
    }

    /// Records that an actuator was switched off or on. A shutdown that was raised for it stands.
    pub(super) fn switch(&mut self, actuator: usize, is_off: bool) {
        self.state.is_off[actuator] = is_off;
        self.drop_active_of(actuator);
    }

    /// Withdraws what was raised for an actuator.
    pub(super) fn withdraw(&mut self, actuator: usize) {
        self.state.stands[actuator] = None;
        self.drop_active_of(actuator);
    }

    /// Withdraws everything that was raised.
    pub(super) fn withdraw_all(&mut self) {
        self.state.stands.fill(None);
        self.drop_active();
    }

    fn drop_active_of(&mut self, actuator: usize) {
        if self.state.active.is_some_and(|raised| raised.actuator as usize == actuator) {
            self.drop_active();
        }
    }

    /// Restores a state.
    ///
    /// # Errors
    /// [`Error::CorruptModel`] for one that a session of this diagnoser cannot have after so many samples.
    pub(super) fn restore(
        &mut self,
        state: &AlarmState,
        places: &Places,
        samples: u64,
    ) -> Result<(), Error> {
        let actuators = places.hypotheses.actuators;
        let mut stands = (0_u32..).zip(&state.stands);
        let fits = [state.stands.len(), state.is_off.len(), state.is_inhibited.len()]
            == [actuators; 3]
            && stands.all(|(own, stands)| stands.is_none_or(|raised| raised.actuator == own))
            && state
                .stands
                .iter()
                .chain([&state.active])
                .flatten()
                .all(|r| r.fits(places, samples))
            && state.recovering_since.is_none_or(|since| since <= samples);
        require_sound(fits, "the stored alarm is another diagnoser's")?;
        self.state.clone_from(state);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use alloc::format;

    fn alarms_that_keep(least_on: Option<usize>, actuators: usize) -> Alarms {
        let list = |count: usize| (0..count).map(|i| format!("{i}")).collect();
        let names = Names {
            features: vec![],
            actuators: list(actuators),
            actions: list(3),
            details: list(2),
        };
        let usual = Tuning::usual(&names, &["0"]);
        let least_on = least_on.map_or(usual.least_on, |least| least as u32);
        Alarms::new(&Tuning { least_on, ..usual }, &names, 500)
    }

    fn raised(actuator: usize, action: usize, sample: u64) -> Raised {
        let (actuator, action) = (actuator as u32, action as u32);
        Raised { actuator, action, detail: Some(1), sample, length: 0, confidence: 0.9, lead: 0.9 }
    }

    /// A single window with another class does not change what is named.
    #[test]
    fn the_class_is_the_one_that_most_windows_named() {
        let mut memory = alarms_that_keep(None, 2);
        let named = |detail: Option<u32>, confidence, sample| {
            let lead = if detail.is_some() { confidence } else { 0.0 };
            Raised { detail, confidence, lead, ..raised(0, 1, sample) }
        };
        let said = |memory: &Alarms| memory.raised().map(|own| (own.detail, own.confidence));
        memory.raise(named(None, 0.7, 10));
        assert_eq!(said(&memory), Some((None, 0.7)));
        memory.raise(named(Some(1), 0.6, 20));
        memory.raise(named(Some(1), 0.5, 30));
        memory.raise(named(Some(0), 0.99, 40));
        assert_eq!(said(&memory), Some((Some(1), 0.5)), "one of three");
        memory.raise(named(None, 0.9, 50));
        assert_eq!(said(&memory), Some((Some(1), 0.5)), "the class was not asked again");
        memory.raise(named(Some(0), 0.8, 60));
        assert_eq!(said(&memory), Some((Some(0), 0.8)), "0.99 + 0.8 over 0.6 + 0.5");
        assert_eq!(memory.raised().unwrap().sample, 10);
    }

    /// Random events in random order: a shutdown stands until it is withdrawn, the minimum number of actuators is never
    /// commanded to switch off, and all others can be.
    #[test]
    fn a_shutdown_stands_until_it_is_withdrawn_and_the_last_actuators_stay_on() {
        let counts = (2..=5).flat_map(|all| (1..=all).map(move |kept| (all, kept)));
        for (actuators, least_on) in counts {
            let mut fewest = actuators;
            for seed in 0..100 {
                let mut random = Random::new(seed);
                let mut memory = alarms_that_keep(Some(least_on), actuators);
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
                        2 => memory.hold(false, sample * 300),
                        3 => memory.inhibit(actuator, random.unit() < 0.5),
                        _ => {
                            let any = random.index(memory.hypotheses.count());
                            if let Some((actuator, action)) = memory.hypotheses.split(any) {
                                memory.raise(raised(actuator, action, sample));
                            }
                        }
                    }
                    for (actuator, stands) in stands.iter_mut().enumerate() {
                        let now = memory.state.stands[actuator];
                        assert!(now.is_some() || !*stands, "{actuators} actuators, seed {seed}");
                        *stands = now.is_some();
                        let is_judged = !memory.is_masked(actuator as u32);
                        let is_off = memory.raised().is_some_and(|raised| raised.action == 0);
                        assert!(is_off || !(*stands && is_judged), "what stands is raised");
                    }
                    let on = stands.iter().zip(&memory.state.is_off);
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
        let mut memory = alarms_that_keep(None, 2);
        memory.raise(raised(0, 1, 10));
        memory.raise(raised(1, 0, 20));
        assert_eq!(memory.raised(), Some(raised(0, 1, 10)));
        // A milder action for the other actuator may be raised, then this one's shutdown.
        memory.raise(raised(1, 2, 30));
        assert_eq!(memory.raised(), Some(raised(1, 2, 30)));
        memory.raise(raised(1, 0, 40));
        assert_eq!(memory.raised(), Some(raised(1, 0, 40)));
        // The other's shutdown may be raised once the alarm is over.
        let mut memory = alarms_that_keep(None, 2);
        memory.raise(raised(0, 1, 10));
        (10..=10 + memory.recover_samples + 1).for_each(|sample| memory.hold(false, sample));
        memory.raise(raised(1, 0, 2000));
        assert_eq!(memory.raised(), Some(raised(1, 0, 2000)));
    }

    /// No other actuator could take over, and none must be kept for it.
    #[test]
    fn a_single_actuator_may_be_stopped_unless_it_must_stay_on() {
        for (least_on, stops) in [(None, true), (Some(0), true), (Some(1), false)] {
            let mut memory = alarms_that_keep(least_on, 1);
            memory.raise(raised(0, 0, 10));
            assert_eq!(memory.raised().is_some(), stops, "{least_on:?}");
        }
    }

    #[test]
    fn what_recovers_is_over_after_its_time_but_a_shutdown_stands() {
        let mut memory = alarms_that_keep(None, 2);
        memory.raise(raised(0, 1, 10));
        memory.raise(Raised { detail: None, confidence: 0.8, lead: 0.0, ..raised(0, 1, 20) });
        assert_eq!(memory.raised(), Some(raised(0, 1, 10)));
        memory.hold(false, 100);
        assert_eq!(memory.alarm(false), Alarm::Recovering);
        memory.hold(true, 300);
        memory.hold(false, 400);
        memory.hold(false, 899);
        assert!(memory.alarm(false) == Alarm::Recovering && memory.raised().is_some());
        memory.hold(false, 900);
        assert!(memory.alarm(false) == Alarm::Normal && memory.raised().is_none());
        memory.raise(raised(1, 0, 1000));
        (1000..10_000).for_each(|sample| memory.hold(false, sample));
        assert_eq!((memory.alarm(true), memory.state.active), (Alarm::Raised, None));
        memory.raise(raised(0, 0, 10_000));
        assert_eq!(memory.raised(), Some(raised(1, 0, 1000)));
        // Carried out, it needs no action; switched on again, it does.
        memory.switch(1, true);
        assert!(memory.raised().is_none() && !memory.allows(4) && !memory.allows(1));
        assert!(memory.allows(2));
        memory.switch(1, false);
        assert!(memory.raised() == Some(raised(1, 0, 1000)) && !memory.allows(1));
        memory.withdraw(1);
        assert!(memory.raised().is_none() && memory.allows(1));
    }
}
