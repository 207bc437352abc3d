//! Steps as many variants as there are lanes, each with its own time.
//!
//! A step has three parts. [`LaneStepper::begin`] evaluates every lane at its current time, with
//! the Jacobian; samples can then be read. [`LaneStepper::attempt`] tries a step, and [`LaneStepper::conclude`]
//! accepts it in the lanes whose error is small enough. One lane of `f64` is a twin that runs
//! beside an actuator ([`super::Twin`]). Many lanes that a [`super::JobSource`] refills are an ensemble
//! ([`super::ensemble`]).

use super::compiled_step::CompiledSteps;
use super::follow::{Following, Progress};
use super::lane_state::{LaneState, Phase};
use super::step::MAX_LANES;
use super::step_memory::StepMemory;
use super::tableau::Tableau;
use super::{Cause, MIN_STEP_S, SolverFailure, SolverSettings};
use crate::math;
use crate::program::{Program, Slot};
use crate::scalar::Lanes;
use alloc::vec::Vec;

/// Consecutive rejections after which a variant fails.
const MAX_REJECTIONS: u32 = 60;
/// Largest number of steps of the steady-state search.
const MAX_SETTLING_STEPS: u64 = 2000;
/// Largest accepted change over scale in one step of the steady-state search.
const MAX_SETTLING_CHANGE: f64 = 0.5;
/// The system is in steady state when no state changes faster than this fraction of its
/// scale, 1/s.
const AT_REST_PER_S: f64 = 1e-9;
/// Simulated time after which the steady-state search ends, s: a limit cycle
/// has no steady state.
const MAX_SETTLING_S: f64 = 1e5;

pub(super) struct LaneStepper<'p, V> {
    pub(crate) program: &'p Program,
    pub(crate) settings: SolverSettings,
    memory: StepMemory<'p, V>,
    /// One for each lane.
    pub(crate) lane_states: Vec<LaneState>,
    /// The external inputs that change with time in any lane.
    moving: Vec<usize>,
    periods_s: Vec<f64>,
}

/// The numbers of a variant, besides its inputs.
pub(super) struct Numbers<'n> {
    /// [`Program::block_constants`].
    pub(crate) constants: &'n [f64],
    /// [`Program::stand_in_values`].
    pub(crate) stand_ins: &'n [f64],
}

impl<'p, V: Lanes> LaneStepper<'p, V> {
    /// Number of clocks.
    pub(crate) fn clocks(&self) -> usize {
        self.periods_s.len()
    }

    /// The period of each clock, s.
    pub(crate) fn periods_s(&self) -> &[f64] {
        &self.periods_s
    }

    /// A stepper with idle lanes.
    pub(crate) fn new(
        program: &'p Program,
        settings: SolverSettings,
        compiled: Option<&'p CompiledSteps>,
    ) -> Self {
        let periods_s: Vec<f64> = program.clock_periods_s().collect();
        let mut stepper = Self {
            program,
            settings,
            memory: StepMemory::new(program),
            lane_states: (0..V::WIDTH).map(|_| LaneState::idle(periods_s.len())).collect(),
            moving: Vec::with_capacity(program.externals().len()),
            periods_s,
        };
        if let Some(compiled) = compiled {
            stepper.use_compiled(compiled);
        }
        stepper
    }

    /// Uses compiled functions from now on if they exist for this number of lanes. Returns whether they do.
    pub(crate) fn use_compiled(&mut self, compiled: &'p CompiledSteps) -> bool {
        self.memory.use_compiled(compiled.find(self.program, self.settings.method, V::WIDTH))
    }

    /// Sets a lane's variant during a run: states and values held by clocks stay.
    pub(crate) fn set_numbers(&mut self, lane: usize, numbers: Numbers) {
        self.memory.set_constants(lane, numbers.constants);
        let first = self.program.externals().end;
        for (index, &value) in numbers.stand_ins.iter().enumerate() {
            if !self.program.is_held(index) {
                self.memory.set_variable(lane, first + index, value);
            }
        }
    }

    /// Resets the values held by clocks to zero, as before their first tick.
    pub(crate) fn reset_held(&mut self, lane: usize) {
        let program = self.program;
        let first = program.externals().end;
        for index in (0..program.stand_ins().len()).filter(|&index| program.is_held(index)) {
            self.memory.set_variable(lane, first + index, 0.0);
        }
    }

    pub(crate) fn set_states(&mut self, lane: usize, states: &[f64]) {
        self.memory.set_states(lane, states);
    }

    /// Sets the value of a constant input in a lane.
    pub(crate) fn set_input(&mut self, lane: usize, external: usize, value: f64) {
        self.memory.set_variable(lane, self.program.externals().start + external, value);
    }

    /// Lists the inputs that change with time. Call it when the lanes' inputs have changed.
    pub(crate) fn find_moving(&mut self) {
        let Self { lane_states, moving, .. } = self;
        moving.clear();
        for external in 0..self.program.externals().len() {
            let moves =
                |lane_state: &LaneState| lane_state.moving.iter().any(|m| m.external == external);
            if lane_states.iter().any(moves) {
                moving.push(external);
            }
        }
    }

    /// The external inputs, the stand-ins and the values held by clocks.
    pub(crate) fn held(&self, lane: usize) -> impl Iterator<Item = f64> + '_ {
        let slots = self.program.externals().start..self.program.stand_ins().end;
        slots.map(move |slot| self.memory.variable(lane, slot))
    }

    /// Restores the values of [`LaneStepper::held`].
    pub(crate) fn set_held(&mut self, lane: usize, held: &[f64]) {
        let first = self.program.externals().start;
        for (offset, &value) in held.iter().enumerate() {
            self.memory.set_variable(lane, first + offset, value);
        }
    }

    /// The states at the lane's current time.
    pub(crate) fn states(&self, lane: usize) -> Vec<f64> {
        self.memory.states(lane)
    }

    /// A variable as of the last evaluation.
    pub(crate) fn variable(&self, lane: usize, slot: Slot) -> f64 {
        self.memory.variable(lane, slot as usize)
    }

    /// Ticks clocks that are due, chooses every lane's step and evaluates all equations.
    #[inline(always)]
    pub(crate) fn begin(&mut self) {
        for lane_state in self.lane_states.iter_mut() {
            if lane_state.phase == Phase::Settled {
                lane_state.begin_running();
            }
        }
        self.load_inputs();
        if !self.periods_s.is_empty() {
            self.tick_due_clocks();
        }
        for lane_state in self.lane_states.iter_mut() {
            lane_state.choose_step(&self.settings, &self.periods_s);
        }
        if self.settings.method.tableau().is_some() {
            self.memory.begin();
        } else {
            self.memory.evaluate();
        }
        self.end_settling();
    }

    /// Loads the current pieces of the inputs.
    #[inline(always)]
    pub(crate) fn load_inputs(&mut self) {
        self.memory.clear_inputs();
        let lane_states = &self.lane_states;
        let first = self.program.externals().start;
        for &external in &self.moving {
            let held = self.memory.variables(first + external);
            self.memory
                .set_input(external, |lane| lane_states[lane].cubic(external, held.lane(lane)));
        }
    }

    fn tick_due_clocks(&mut self) {
        for clock in 0..self.periods_s.len() {
            let period = self.periods_s[clock];
            if !self.lane_states.iter().any(|lane_state| lane_state.is_due(clock, period)) {
                continue;
            }
            self.memory.evaluate();
            let due = |i: usize| if self.lane_states[i].is_due(clock, period) { 1.0 } else { 0.0 };
            let mask = V::constant(0.0).less(V::from_fn(due));
            self.memory.tick(clock, mask);
            for lane_state in
                self.lane_states.iter_mut().filter(|lane_state| lane_state.is_due(clock, period))
            {
                lane_state.statistics.evaluations += 1;
                if lane_state.phase != Phase::Settling {
                    lane_state.next_tick[clock] += 1;
                }
            }
        }
    }

    /// Updates the lanes that search for the steady state, from the evaluation that began the step.
    #[inline(always)]
    fn end_settling(&mut self) {
        for index in 0..V::WIDTH {
            if self.lane_states[index].seeks_rest() {
                self.look_for_rest(index);
            }
        }
    }

    fn look_for_rest(&mut self, index: usize) {
        let is_at_rest = self.memory.largest_rate_per_s(index) < AT_REST_PER_S;
        let lane_state = &mut self.lane_states[index];
        if is_at_rest {
            lane_state.end_following();
        } else if lane_state.phase == Phase::Following {
            self.follow(index);
        } else if lane_state.statistics.settling >= MAX_SETTLING_STEPS
            || lane_state.time_s > MAX_SETTLING_S
        {
            let following = Following::new(self.states(index), self.held(index).collect());
            self.lane_states[index].begin_following(following);
        }
    }

    /// Observes a system that moves on its own; gives up if it finds no steady state.
    fn follow(&mut self, index: usize) {
        let Self { memory, lane_states, .. } = self;
        let lane_state = &mut lane_states[index];
        let time_s = lane_state.time_s;
        let following = lane_state.following.as_mut().expect("a lane in this phase has one");
        let progress = following.observe(time_s, memory.motion_over_scale(index));
        if progress == Progress::Moving {
            return;
        }
        lane_state.statistics.limit_cycles += u64::from(progress == Progress::LimitCycle);
        self.begin_on_the_move(index);
    }

    /// Ends the search without a steady state: the run begins where the search ended.
    fn begin_on_the_move(&mut self, index: usize) {
        let lane_state = &mut self.lane_states[index];
        lane_state.statistics.unsettled += 1;
        if let Some(following) = lane_state.end_following() {
            let (states, held) = following.search_end;
            self.set_states(index, &states);
            self.set_held(index, &held);
        }
    }

    /// Tries every lane's step; returns its length, s, and its error over scale.
    #[inline(always)]
    pub(crate) fn attempt(&mut self) -> (V, V) {
        let h = V::from_fn(|lane| self.lane_states[lane].step_s);
        let Some(tableau) = self.settings.method.tableau() else {
            self.memory.runge_kutta(h);
            return (h, V::constant(0.0));
        };
        let mut error = self.memory.rosenbrock(tableau, h);
        if self.lane_states.iter().any(|lane_state| lane_state.phase == Phase::Settling) {
            // Accuracy does not matter in the steady-state search. The most stable method
            // also converges where the system itself would oscillate forever.
            let settling =
                |i: usize| if self.lane_states[i].phase == Phase::Settling { 1.0 } else { 0.0 };
            let settling = V::constant(0.0).less(V::from_fn(settling));
            error = self.memory.keep_first_stage(settling, error);
        }
        (h, error)
    }

    /// Evaluates every lane at a fraction of the attempted step.
    #[inline(always)]
    pub(crate) fn interpolate(&mut self, tableau: &Tableau, h: V, fraction: V) {
        self.memory.interpolate(tableau, h, fraction);
    }

    #[inline(always)]
    pub(crate) fn accepts(&self, lane: usize, error: f64) -> bool {
        match self.lane_states[lane].allowed(&self.settings) {
            Some((allowed, _)) => error <= allowed,
            None => error.is_finite(),
        }
    }

    /// The factor by which each lane's step could grow for its error;
    /// meaningless if the error is not finite.
    #[inline(always)]
    fn growth(&self, error: V) -> V {
        let order = self.settings.method.tableau().map_or(4, |t| t.order);
        let allowed = |lane_state: &LaneState| {
            lane_state.allowed(&self.settings).map_or(1.0, |(error, _)| error)
        };
        let tolerance = V::from_fn(|i| allowed(&self.lane_states[i]));
        let ratio = (error / tolerance).max(V::constant(1e-6));
        math::power(ratio, V::constant(-1.0 / order as f64)) * V::constant(0.9)
    }

    /// Accepts or rejects the attempted step in every lane, and plans the next. A lane that
    /// cannot continue becomes idle and stores its failure.
    #[inline(always)]
    pub(crate) fn conclude(&mut self, error: V) {
        let implicit = self.settings.method.tableau();
        let (evaluations, jacobians) =
            implicit.map_or((3, 0), |tableau| (tableau.stages() as u64 - 1, 1));
        let mut accepted = [false; MAX_LANES];
        let growth = self.growth(error);
        for (index, accepted) in accepted.iter_mut().enumerate().take(V::WIDTH) {
            let (error, growth) = (error.lane(index), growth.lane(index));
            // A value that is not finite shows in the error, except for methods without an estimate.
            let good = self.accepts(index, error) && (jacobians > 0 || self.memory.finite(index));
            let lane_state = &mut self.lane_states[index];
            lane_state.statistics.evaluations += evaluations;
            lane_state.statistics.jacobians += jacobians;
            lane_state.attempt_rate_per_s += 1.0;
            if matches!(lane_state.phase, Phase::Idle | Phase::Settled) {
                continue;
            }
            let was_rejected = lane_state.rejections > 0;
            *accepted = match lane_state.phase {
                Phase::Settling => error <= MAX_SETTLING_CHANGE,
                _ => good,
            };
            if *accepted {
                lane_state.accept();
            } else {
                lane_state.statistics.rejected += 1;
                lane_state.rejections += 1;
            }
            let growth = if error.is_finite() { growth } else { 0.1 };
            lane_state.adapt(&self.settings, growth, was_rejected);
            self.give_up_if_stuck(index, error);
        }
        let zero = V::constant(0.0);
        let mask = zero.less(V::from_fn(|i| if accepted[i] { 1.0 } else { 0.0 }));
        self.memory.accept(mask);
    }

    #[inline(always)]
    fn give_up_if_stuck(&mut self, index: usize, error: f64) {
        let lane_state = &mut self.lane_states[index];
        let fixed = lane_state.fixed_step_s(&self.settings).is_some();
        let stuck = lane_state.rejections > 0
            && (fixed
                || lane_state.rejections > MAX_REJECTIONS
                || lane_state.wanted_s < MIN_STEP_S);
        if stuck && lane_state.phase == Phase::Following {
            self.begin_on_the_move(index);
        } else if stuck {
            // No error control shortens a fixed step.
            let is_too_small = error.is_finite() && !fixed;
            let cause = if is_too_small { Cause::StepTooSmall } else { Cause::NotFinite };
            let state = self.memory.worst_state(index);
            lane_state.failure = Some(SolverFailure { time_s: lane_state.time_s, state, cause });
            lane_state.phase = Phase::Idle;
        }
    }
}
