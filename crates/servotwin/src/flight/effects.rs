//! Runs of a suite in closed loop: what every fault of the system does to a flight with a flight control computer
//! that reacts to the diagnosis, and to one without.
//!
//! All flights of an environment have the same specimen and the same noise, so they differ from its healthy flight by
//! the fault alone.

use super::watched::{SessionWatch, Truth};
use crate::live::closed_loop::{ClosedLoop, FlightRecord, fly_watched};
use crate::live::runtime::RuntimeError;
use crate::live::tracking::{Deviation, TrackedQuantities};
use crate::measure::outcome::{Needed, RunOutcome};
use crate::parallel::{self, Workers};
use crate::run::{Profile, Run, RunError};
use crate::study::faults::full_name;
use crate::study::flights::Environment;
use crate::study::{Scenario, Study, Suite};
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use servotwin_model::program::{FaultAt, Slot};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Flies runs in closed loop, with reactions and without. A run that cannot be simulated is unfinished.
///
/// # Errors
/// The diagnoser does not fit; a healthy flight cannot be simulated; or the work was cancelled.
pub(super) fn fly(
    (study, suite, scenario): (&Study, &Suite, Scenario),
    diagnoser: &Arc<Diagnoser>,
    runs: &[Run],
    workers: Workers,
) -> Result<Vec<RunOutcome>, RunError> {
    let tracked = TrackedQuantities::of(study);
    let pistons = pistons(study, tracked.slots.len());
    let slots = tracked.slots.iter().copied().chain(pistons.values().map(|(_, slot)| *slot));
    let flyer = EffectFlyer {
        study,
        suite,
        has_tolerances: scenario.has_tolerances(),
        diagnoser,
        faults: study.system.all_faults(),
        slots: slots.collect(),
        tracked,
        pistons,
    };
    let reference = |run: &Run| {
        let number = run.environment;
        let environment = study.environments(suite, number..number + 1)?.remove(0);
        let run = Run { fault: None, duration_s: suite.longest_s(), ..*run };
        let flown = flyer.fly(&environment, &run, false, |_, _| ());
        let record = flown.map_err(|error| RunError::Twin {
            case: environment.name.clone(),
            reason: error.to_string(),
        })?;
        Ok((number, (environment, record)))
    };
    let first_runs: BTreeMap<usize, &Run> = runs.iter().map(|run| (run.environment, run)).collect();
    let healthy: BTreeMap<usize, (Environment, FlightRecord)> =
        first_runs.into_values().map(reference).collect::<Result<_, RunError>>()?;
    let outcome = |run: &Run| flyer.outcome(run, &healthy[&run.environment]);
    parallel::map(runs, workers, outcome).map_err(|_| RunError::Cancelled)
}

/// For every actuator with a cylinder the place of its piston's position among the recorded variables, of which some
/// come first, and the slot.
fn pistons(study: &Study, first: usize) -> BTreeMap<usize, (usize, Slot)> {
    let of_actuator = |actuator: &String| {
        let own = full_name(actuator, "");
        let mut components = study.system.network().components.iter();
        let cylinder = components.find(|instance| {
            instance.id.starts_with(&own) && instance.component.kind.contains("cylinder")
        })?;
        let name = format!("{}.position_m", cylinder.id);
        Some(study.system.program.observable(&name)?.slot)
    };
    let found = study
        .actuators
        .iter()
        .enumerate()
        .filter_map(|(actuator, name)| Some((actuator, of_actuator(name)?)));
    found.enumerate().map(|(place, (actuator, slot))| (actuator, (first + place, slot))).collect()
}

struct EffectFlyer<'s> {
    study: &'s Study,
    suite: &'s Suite,
    has_tolerances: bool,
    diagnoser: &'s Arc<Diagnoser>,
    /// All faults of the system.
    faults: Vec<String>,
    tracked: TrackedQuantities,
    pistons: BTreeMap<usize, (usize, Slot)>,
    /// The variables that are recorded: those tracked, then the pistons.
    slots: Vec<Slot>,
}

impl EffectFlyer<'_> {
    fn fly(
        &self,
        environment: &Environment,
        run: &Run,
        reacts: bool,
        watch: impl FnMut(u64, &Session),
    ) -> Result<FlightRecord, RuntimeError> {
        let at = |fault: usize| {
            let (component, fault) = self.study.system.program.find_fault(&self.faults[fault])?;
            Some((run.onset_s, FaultAt { component, fault, intensity: run.intensity }))
        };
        let flight = ClosedLoop {
            study: self.study,
            inputs: environment.inputs.clone(),
            faults: run.fault.and_then(at).into_iter().collect(),
            duration_s: run.duration_s,
            specimen: self.has_tolerances.then_some(run.environment),
            reacts,
        };
        fly_watched(&flight, self.diagnoser, &self.slots, watch)
    }

    /// The truth of a run. Of a fault that no class of the study lists no action is right.
    fn truth(&self, run: &Run) -> Truth {
        let Some(id) = run.fault.map(|fault| &self.faults[fault]) else {
            return Truth::planned(self.study, run);
        };
        let listed = self.study.faults.iter().position(|case| case.id == *id);
        let truth = Truth::planned(self.study, &Run { fault: listed, ..*run });
        if listed.is_some() {
            return truth;
        }
        let actuator = self.study.actuator_of(id);
        let name = actuator.map_or("", |actuator| &self.study.actuators[actuator]);
        let run = RunOutcome {
            event: id.clone(),
            kind: self.study.kind_of(id).into(),
            profile: Profile::Step.name().into(),
            onset_s: Some(run.onset_s),
            at_fault: name.into(),
            needed: Needed::Nothing,
            ..truth.run
        };
        Truth { run, at_fault: actuator.into_iter().collect(), ..Truth::default() }
    }

    fn outcome(&self, run: &Run, healthy: &(Environment, FlightRecord)) -> RunOutcome {
        let truth = self.truth(run);
        let known = truth.run_watched_by(self.diagnoser);
        let (environment, healthy) = healthy;
        let onset = truth.first_sample(self.diagnoser.period_s);
        let mut watch = SessionWatch::new(self.diagnoser, &truth, onset);
        let take = |index: u64, session: &Session| watch.take(index, session, &truth);
        let Ok(reacting) = self.fly(environment, run, true, take) else { return known };
        let outcome = watch.outcome(known.clone(), self.diagnoser, &truth);
        let actuator = truth.at_fault.first().copied();
        // Without an action both flights are the same to the bit.
        if reacting.actions.is_empty() {
            return self.with_effects(outcome, actuator, [&reacting, &reacting, healthy]);
        }
        match self.fly(environment, run, false, |_, _| ()) {
            Ok(alone) => self.with_effects(outcome, actuator, [&reacting, &alone, healthy]),
            Err(_) => known,
        }
    }

    fn with_effects(
        &self,
        outcome: RunOutcome,
        actuator: Option<usize>,
        [reacting, alone, healthy]: [&FlightRecord; 3],
    ) -> RunOutcome {
        let onset_s = self.suite.onset_s.map_or(0.0, |[middle, _]| middle);
        let since = alone.time_s.partition_point(|time_s| *time_s < onset_s);
        let error = |record| {
            Some(Deviation::since(since, &self.tracked.tracking_error(self.study, record)?))
        };
        let fight = |record| {
            Some(Deviation::since(since, &self.tracked.force_fight(self.study, record)?).rms)
        };
        let command = &reacting.inputs[self.study.command_input];
        let (error_alone, error_reacting) = (error(alone), error(reacting));
        let rod = |record| self.tracked.rod_force(&self.study.actuators[actuator?], record);
        let piston =
            |record: &'_ FlightRecord| record.plant.get(self.pistons.get(&actuator?)?.0).cloned();
        let farthest = |with: &[f64], without: &[f64]| {
            let pairs = with.iter().zip(without).skip(since);
            pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
        };
        let reactions = || reacting.actions.iter().map(|action| &action.reaction);
        RunOutcome {
            switched_off: self.switched_off(reacting),
            changes_mode: reactions().any(|reaction| reaction.changes_mode()),
            command_rms: Some(Deviation::since(since, command).rms),
            error_rms: error_alone.map(|error| error.rms),
            error_max: error_alone.map(|error| error.largest),
            reacting_error_rms: error_reacting.map(|error| error.rms),
            reacting_error_max: error_reacting.map(|error| error.largest),
            force_fight_rms_n: fight(alone),
            reacting_force_fight_rms_n: fight(reacting),
            force_difference_n: rod(alone).zip(rod(healthy)).map(|(a, b)| farthest(a, b)),
            travel_difference_m: piston(alone).zip(piston(healthy)).map(|(a, b)| farthest(&a, &b)),
            ..outcome
        }
    }

    /// The actuators that were switched off, in the order of their actions.
    fn switched_off(&self, record: &FlightRecord) -> String {
        let mut off: Vec<&str> = vec![];
        for action in record.actions.iter().filter(|action| action.reaction.switches_off) {
            let name = &self.diagnoser.names().actuators[action.raised.actuator as usize];
            let name = if name.is_empty() { "all" } else { name };
            if !off.contains(&name) {
                off.push(name);
            }
        }
        off.join(",")
    }
}
