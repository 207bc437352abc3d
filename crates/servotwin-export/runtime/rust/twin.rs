//! The virtual twin: the simulated actuators, stepped from sample to sample by a linearly implicit (Rosenbrock) method. It
//! needs no iteration; with error control it adapts its steps, and with a fixed step it always does the same work.

use crate::course::{Course, Knot};
use crate::equations;
use crate::following::Following;
use crate::twin_sizes::{
    CLOCKS, CONSTANTS, FACTORS, GRADIENTS, HELD, INPUTS, PARAMETERS, STAGES, STATES, SUMS_END,
    VARIABLES,
};
use crate::twin_tables::{
    ALLOWANCES, BETWEEN, CLOCK_PERIODS_S, CONTROL, GUESSES, LOWEST, SCALES, SLOPES,
};

const FIRST_INPUT: usize = STATES;
const FIRST_DERIVATIVE: usize = SUMS_END - STATES;
const LAST_STAGE: usize = (STAGES - 1) * STATES;

/// Events closer together than this count as one, s.
pub const SAME_TIME_S: f64 = 1e-9;
/// Shortest and first step, s.
const MIN_STEP_S: f64 = 1e-11;
const FIRST_STEP_S: f64 = 1e-4;
/// Rejections in a row after which the twin fails.
const MAX_REJECTIONS: u32 = 60;
/// The search for the steady state: its steps, the change over scale that it accepts and aims at, and its end.
const MAX_SETTLING_STEPS: u32 = 2000;
const MAX_SETTLING_CHANGE: f64 = 0.5;
const WANTED_SETTLING_CHANGE: f64 = 0.1;
const MAX_SETTLING_STEP_S: f64 = 1e4;
const MAX_SETTLING_S: f64 = 1e5;
/// At rest no state changes faster than this part of its scale, 1/s.
const AT_REST_PER_S: f64 = 1e-9;
/// Largest factor on the tolerance at a high rate of attempts.
const MAX_RELAXATION: f64 = 1024.0;
/// The error over scale while a system without a steady state is followed.
const FOLLOWING_TOLERANCE: f64 = 1e-5;

/// The control of the steps.
pub struct StepControl {
    /// Of samples.
    pub period_s: f64,
    pub is_fixed: bool,
    pub fixed_step_s: f64,
    /// Permitted error over scale.
    pub tolerance: f64,
    pub max_step_s: f64,
    /// Above it, a larger error is accepted.
    pub attempt_rate_limit_per_s: f64,
    pub reciprocal_gamma: f64,
    /// Of the error over the permitted one.
    pub growth_exponent: f64,
    pub alpha: [f64; STAGES],
    pub gamma_sum: [f64; STAGES],
}

/// The first guess of a state: a parameter, or without one the value.
pub struct Guess {
    pub parameter: Option<usize>,
    pub value: f64,
}

/// The reason why a twin does not go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TwinFailure {
    /// [`Twin::start`] was not called.
    NotStarted,
    /// The error stayed too large down to the smallest step.
    StepTooSmall,
    /// A value became infinite or not a number.
    BecameInfinite,
}

#[derive(Clone, Copy, PartialEq)]
enum Phase {
    /// Search for the steady state, with the inputs of time zero.
    Settling,
    /// The search has failed: the system itself is simulated, with the inputs of time zero.
    Following,
    Settled,
    Running,
    Failed(TwinFailure),
}

/// A virtual twin. A clone continues with the same bits.
#[derive(Clone)]
pub struct Twin {
    // The arrays of a step.
    constants: [f64; CONSTANTS],
    variables: [f64; VARIABLES],
    gradients: [f64; GRADIENTS],
    factors: [f64; FACTORS],
    stages: [f64; STAGES * STATES],
    /// At the beginning of the step.
    states: [f64; STATES],
    new_states: [f64; STATES],
    /// From this sample on.
    inputs: [Knot; INPUTS],
    /// The time since which inputs take their courses, s.
    from_s: f64,
    courses: [Course; INPUTS],
    /// The same from the beginning of the step on.
    moved: [Course; INPUTS],
    // The step.
    phase: Phase,
    time_s: f64,
    /// The step that the error control requests.
    wanted_s: f64,
    step_s: f64,
    end_s: f64,
    /// The time to be reached, and the one after it.
    target_s: f64,
    after_s: f64,
    next_sample: u64,
    next_tick: [u64; CLOCKS],
    /// Rejected attempts in a row.
    rejections: u32,
    settling_steps: u32,
    attempt_rate_per_s: f64,
    following: Following,
    /// Parameters that apply from the next sample on, if there are new ones.
    parameters: [f64; PARAMETERS],
    has_loaded: bool,
}

impl Default for Twin {
    fn default() -> Self {
        Twin::new()
    }
}

impl Twin {
    /// A twin before its start.
    pub const fn new() -> Self {
        Twin {
            constants: [0.0; CONSTANTS],
            variables: [0.0; VARIABLES],
            gradients: [0.0; GRADIENTS],
            factors: [0.0; FACTORS],
            stages: [0.0; STAGES * STATES],
            states: [0.0; STATES],
            new_states: [0.0; STATES],
            inputs: [Knot::ZERO; INPUTS],
            from_s: 0.0,
            courses: [Course::held(0.0); INPUTS],
            moved: [Course::held(0.0); INPUTS],
            phase: Phase::Failed(TwinFailure::NotStarted),
            time_s: 0.0,
            wanted_s: 0.0,
            step_s: 0.0,
            end_s: 0.0,
            target_s: 0.0,
            after_s: 0.0,
            next_sample: 0,
            next_tick: [0; CLOCKS],
            rejections: 0,
            settling_steps: 0,
            attempt_rate_per_s: 0.0,
            following: Following::NONE,
            parameters: [0.0; PARAMETERS],
            has_loaded: false,
        }
    }

    /// Searches for the steady state at constant inputs, and places the twin on sample 0.
    pub fn start(
        &mut self,
        parameters: &[f64; PARAMETERS],
        inputs: &[Knot; INPUTS],
    ) -> Result<(), TwinFailure> {
        *self = Twin::new();
        self.phase = Phase::Settling;
        self.start_step();
        (self.step_s, self.inputs) = (FIRST_STEP_S, *inputs);
        self.aim_at_sample();
        self.load(parameters);
        self.take_loaded();
        for (state, guess) in self.states.iter_mut().zip(&GUESSES) {
            *state = guess.parameter.map_or(guess.value, |place| parameters[place]);
        }
        for (input, knot) in inputs.iter().enumerate() {
            self.courses[input] = Course::held(knot.value);
            self.variables[FIRST_INPUT + input] = knot.value;
        }
        while self.seeks_rest() {
            self.begin();
            if self.seeks_rest() {
                self.try_step()?;
            }
        }
        self.stand();
        Ok(())
    }

    /// Simulates up to the next sample, at which the inputs are these. After a failure only [`Twin::start`] helps.
    pub fn step(&mut self, inputs: &[Knot; INPUTS]) -> Result<(), TwinFailure> {
        if let Phase::Failed(failure) = self.phase {
            return Err(failure);
        }
        self.lead_to(inputs);
        while !self.is_at_target() {
            self.try_step()?;
            if !self.is_at_target() {
                self.begin();
            }
        }
        self.inputs = *inputs;
        self.stand();
        Ok(())
    }

    /// Other parameters, from the next sample on.
    pub fn load(&mut self, parameters: &[f64; PARAMETERS]) {
        (self.parameters, self.has_loaded) = (*parameters, true);
    }

    /// States, inputs, held values and sums at the current sample, SI.
    pub fn variables(&self) -> &[f64; VARIABLES] {
        &self.variables
    }

    fn seeks_rest(&self) -> bool {
        matches!(self.phase, Phase::Settling | Phase::Following)
    }

    fn take_loaded(&mut self) {
        if self.has_loaded {
            equations::constants(&self.parameters, &mut self.constants);
            equations::stand_ins(&self.parameters, &mut self.variables);
            self.has_loaded = false;
        }
    }

    /// Evaluates at the sample just reached, with the known values and slopes of the inputs.
    fn stand(&mut self) {
        self.take_loaded();
        if self.phase == Phase::Settled {
            self.phase = Phase::Running;
            self.start_step();
            self.attempt_rate_per_s = 0.0;
        }
        self.from_s = self.target_s;
        for (course, (knot, between)) in
            self.courses.iter_mut().zip(self.inputs.iter().zip(&BETWEEN))
        {
            *course = Course::beginning_at(knot, *between);
        }
        self.begin();
        self.next_sample += 1;
        self.aim_at_sample();
    }

    /// Leads all inputs to the next sample. The last evaluation stays valid unless a slope was unknown then.
    fn lead_to(&mut self, next: &[Knot; INPUTS]) {
        let length_s = self.target_s - self.from_s;
        let mut is_surprised = false;
        for (input, course) in self.courses.iter_mut().enumerate() {
            let (value, slope) = (course.0[0], course.0[1]);
            *course = Course::between(BETWEEN[input], &self.inputs[input], &next[input], length_s);
            is_surprised = is_surprised || value != course.0[0] || slope != course.0[1];
        }
        if is_surprised {
            self.begin();
        } else {
            self.move_inputs();
        }
    }
}

/// Inputs and evaluations.
impl Twin {
    /// The courses of the inputs from the beginning of the step on.
    fn move_inputs(&mut self) {
        let t = self.time_s - self.from_s;
        let has_begun = self.phase == Phase::Running && t >= -SAME_TIME_S;
        for (input, course) in self.courses.iter().enumerate() {
            self.gradients[SLOPES[input]] = 0.0;
            self.moved[input] =
                if has_begun { course.moved(t) } else { Course::held(course.0[0]) };
        }
    }

    /// Writes the inputs at a time after the beginning of the step to the variables.
    fn write_inputs(&mut self, offset_s: f64) {
        for (input, course) in self.moved.iter().enumerate() {
            self.variables[FIRST_INPUT + input] = course.value(offset_s);
        }
    }

    fn write_beginning(&mut self) {
        self.variables[..STATES].copy_from_slice(&self.states);
        self.write_inputs(0.0);
    }

    fn evaluate_with_jacobian(&mut self) {
        self.write_beginning();
        for (course, slope) in self.moved.iter().zip(&SLOPES) {
            self.gradients[*slope] = course.0[1];
        }
        equations::begin(&self.constants, &mut self.variables, &mut self.gradients);
    }

    /// The derivatives of the states.
    fn derivatives(&self) -> &[f64] {
        &self.variables[FIRST_DERIVATIVE..SUMS_END]
    }

    /// The largest rate of a state over its scale, 1/s.
    fn largest_rate_per_s(&self) -> f64 {
        self.derivatives().iter().zip(&SCALES).fold(0.0, |largest, (derivative, scale)| {
            let rate = (derivative * scale).abs();
            if rate < largest { largest } else { rate }
        })
    }

    /// The largest error of the last step over these scales; NaN if any is NaN.
    fn largest_error(&self, reciprocal_scales: &[f64; STATES]) -> f64 {
        let (mut largest, mut poison) = (0.0, 0.0);
        for (error, scale) in self.stages[LAST_STAGE..].iter().zip(reciprocal_scales) {
            let relative = error.abs() * scale;
            largest = if largest < relative { relative } else { largest };
            poison += relative * 0.0;
        }
        largest + poison
    }

    /// Tries the step; returns its error over scale.
    fn rosenbrock(&mut self) -> f64 {
        let reciprocal = [1.0 / self.step_s];
        let diagonal = [reciprocal[0] * CONTROL.reciprocal_gamma];
        equations::factor(&diagonal, &self.gradients, &mut self.factors);
        for stage in 0..STAGES {
            let mut right = [0.0; STATES];
            let slope_factor = [self.step_s * CONTROL.gamma_sum[stage]];
            if stage == 0 {
                equations::solve_first(
                    &self.variables,
                    &slope_factor,
                    &self.gradients,
                    &self.factors,
                    &mut right,
                );
            } else {
                self.evaluate_stage(stage, &reciprocal, &mut right);
                equations::solve(
                    &self.variables,
                    &slope_factor,
                    &self.gradients,
                    &self.factors,
                    &mut right,
                );
            }
            self.stages[stage * STATES..][..STATES].copy_from_slice(&right);
        }
        for (state, new_state) in self.new_states.iter_mut().enumerate() {
            *new_state = self.variables[state] + self.stages[LAST_STAGE + state];
        }
        self.largest_error(&ALLOWANCES)
    }

    /// Computes the derivatives and the right-hand side of a stage from the second (1) on.
    fn evaluate_stage(&mut self, stage: usize, reciprocal: &[f64; 1], right: &mut [f64; STATES]) {
        let (states, stages) = (&self.states, &self.stages);
        equations::sums(stage, reciprocal, states, stages, &mut self.variables, right);
        // The last two stages have the same time.
        if CONTROL.alpha[stage] != CONTROL.alpha[stage - 1] {
            self.write_inputs(self.step_s * CONTROL.alpha[stage]);
        }
        equations::motion(&self.constants, &mut self.variables);
    }

    /// Reduces the step to its first stage: a step of the implicit Euler method. In the search for the steady state
    /// accuracy does not matter, and this method also converges where the system itself would oscillate.
    fn keep_first_stage(&mut self) -> f64 {
        for state in 0..STATES {
            let change = self.stages[state];
            let new_state = self.states[state] + change;
            let lowest = LOWEST[state];
            self.new_states[state] = if lowest < new_state { new_state } else { lowest };
            self.stages[LAST_STAGE + state] = change;
        }
        self.largest_error(&SCALES)
    }

    fn attempt(&mut self) -> f64 {
        let error = self.rosenbrock();
        if self.phase == Phase::Settling { self.keep_first_stage() } else { error }
    }
}

/// Time and step.
impl Twin {
    fn start_step(&mut self) {
        (self.time_s, self.wanted_s, self.rejections) = (0.0, FIRST_STEP_S, 0);
    }

    fn aim_at_sample(&mut self) {
        self.target_s = self.next_sample as f64 * CONTROL.period_s;
        self.after_s = (self.next_sample + 1) as f64 * CONTROL.period_s;
    }

    fn is_at_target(&self) -> bool {
        self.phase == Phase::Running && self.target_s <= self.time_s + SAME_TIME_S
    }

    fn tick_time_s(&self, clock: usize) -> f64 {
        self.next_tick[clock] as f64 * CLOCK_PERIODS_S[clock]
    }

    /// Ticks the clocks that are due. During the search for the steady state each ticks at every step.
    fn tick_due_clocks(&mut self) {
        let is_settling = self.phase == Phase::Settling;
        for clock in 0..CLOCKS {
            if is_settling || self.tick_time_s(clock) <= self.time_s + SAME_TIME_S {
                self.write_beginning();
                equations::evaluate(&self.constants, &mut self.variables);
                equations::tick(clock, &self.constants, &mut self.variables);
                if !is_settling {
                    self.next_tick[clock] += 1;
                }
            }
        }
    }

    fn earlier(&self, event_s: f64, time_s: f64) -> f64 {
        if time_s > self.time_s + SAME_TIME_S && time_s < event_s { time_s } else { event_s }
    }

    /// The next time that no step may cross, s.
    fn next_event_s(&self) -> f64 {
        let mut event_s = f64::INFINITY;
        if self.phase == Phase::Running {
            event_s = self.earlier(event_s, self.target_s);
            event_s = self.earlier(event_s, self.after_s);
        }
        (0..CLOCKS).fold(event_s, |event_s, clock| self.earlier(event_s, self.tick_time_s(clock)))
    }

    /// Whether the step is fixed; the search for the steady state always has error control.
    fn has_fixed_step(&self) -> bool {
        CONTROL.is_fixed && !self.seeks_rest()
    }

    /// In the search, sampled controllers act once a step, so the step is at most one period.
    fn choose_settling_step(&mut self) {
        let shorter = |longest_s, &period_s: &f64| if period_s < longest_s { period_s } else { longest_s };
        let longest_s = CLOCK_PERIODS_S.iter().fold(f64::INFINITY, shorter);
        self.step_s = if self.wanted_s < longest_s { self.wanted_s } else { longest_s };
        self.end_s = self.time_s + self.step_s;
    }

    /// Chooses the step that the error control requests, but ends it on the next event and avoids a tiny one before it.
    fn choose_running_step(&mut self) {
        let is_fixed = self.has_fixed_step();
        let wanted_s = if is_fixed { CONTROL.fixed_step_s } else { self.wanted_s };
        let event_s = self.next_event_s();
        let left_s = event_s - self.time_s;
        (self.step_s, self.end_s) = if wanted_s >= left_s * 0.999 {
            (left_s, event_s)
        } else if wanted_s * 2.0 > left_s && !is_fixed {
            (left_s * 0.5, self.time_s + left_s * 0.5)
        } else {
            (wanted_s, self.time_s + wanted_s)
        };
    }

    /// The permitted error at this rate of attempts: at order four it brings the rate back to its limit.
    fn relaxed_tolerance(&self) -> f64 {
        let busy = self.attempt_rate_per_s / CONTROL.attempt_rate_limit_per_s;
        let squared = busy * busy;
        let wanted = squared * squared;
        let at_least = if wanted < 1.0 { 1.0 } else { wanted };
        let factor = if at_least > MAX_RELAXATION { MAX_RELAXATION } else { at_least };
        CONTROL.tolerance * factor
    }

    /// The permitted error over scale; 1 for a fixed step.
    fn allowed_error(&self) -> f64 {
        match self.phase {
            Phase::Settling => WANTED_SETTLING_CHANGE,
            Phase::Following => FOLLOWING_TOLERANCE,
            _ if CONTROL.is_fixed => 1.0,
            _ => self.relaxed_tolerance(),
        }
    }

    /// The factor by which the step could grow for its error.
    fn growth_of(&self, error: f64) -> f64 {
        let relative = error / self.allowed_error();
        let ratio = if 1e-6 < relative { relative } else { 1e-6 };
        equations::power(ratio, CONTROL.growth_exponent) * 0.9
    }

    fn accepts(&self, error: f64) -> bool {
        if self.phase == Phase::Settling {
            error <= MAX_SETTLING_CHANGE
        } else if self.has_fixed_step() {
            error.is_finite()
        } else {
            error <= self.allowed_error()
        }
    }

    /// Chooses the next step from this step's growth factor.
    fn adapt(&mut self, factor: f64, was_rejected: bool) {
        let longest_s = if self.seeks_rest() { MAX_SETTLING_STEP_S } else { CONTROL.max_step_s };
        let most = if self.rejections > 0 || was_rejected { 1.0 } else { 6.0 };
        let at_least = if factor < 0.1 { 0.1 } else { factor };
        let clamped = if at_least > most { most } else { at_least };
        let mut next_s = self.step_s * clamped;
        // A step that an event cut short allows no conclusion about longer ones.
        if self.rejections == 0 && next_s < self.wanted_s && factor >= 1.0 {
            next_s = self.wanted_s;
        }
        self.wanted_s = if next_s < longest_s { next_s } else { longest_s };
    }

    fn accept(&mut self) {
        let left = 1.0 - self.step_s;
        self.attempt_rate_per_s *= if left > 0.0 { left } else { 0.0 };
        (self.time_s, self.rejections) = (self.end_s, 0);
        if self.seeks_rest() {
            self.settling_steps += 1;
        }
        self.states = self.new_states;
    }

    /// Ticks clocks that are due, chooses the step and evaluates all equations.
    fn begin(&mut self) {
        self.move_inputs();
        self.tick_due_clocks();
        if self.phase == Phase::Settling {
            self.choose_settling_step();
        } else {
            self.choose_running_step();
        }
        self.evaluate_with_jacobian();
        if self.seeks_rest() {
            self.look_for_rest();
        }
    }

    /// Tries the step, accepts or rejects it, and plans the next.
    fn try_step(&mut self) -> Result<(), TwinFailure> {
        let error = self.attempt();
        let growth = if error.is_finite() { self.growth_of(error) } else { 0.1 };
        let is_accepted = self.accepts(error);
        let was_rejected = self.rejections > 0;
        self.attempt_rate_per_s += 1.0;
        if is_accepted {
            self.accept();
        } else {
            self.rejections += 1;
        }
        if !self.has_fixed_step() {
            self.adapt(growth, was_rejected);
        }
        self.give_up_if_stuck(error)
    }

    fn give_up_if_stuck(&mut self, error: f64) -> Result<(), TwinFailure> {
        let is_fixed = self.has_fixed_step();
        let is_out = self.rejections > MAX_REJECTIONS || self.wanted_s < MIN_STEP_S;
        if self.rejections == 0 || !(is_fixed || is_out) {
            return Ok(());
        }
        if self.phase == Phase::Following {
            self.begin_on_the_move();
            return Ok(());
        }
        let is_too_small = error.is_finite() && !is_fixed;
        let failure =
            if is_too_small { TwinFailure::StepTooSmall } else { TwinFailure::BecameInfinite };
        self.phase = Phase::Failed(failure);
        Err(failure)
    }
}

/// Search for the steady state.
impl Twin {
    fn look_for_rest(&mut self) {
        if self.largest_rate_per_s() < AT_REST_PER_S {
            self.end_search();
        } else if self.phase == Phase::Following {
            let derivatives = &self.variables[FIRST_DERIVATIVE..SUMS_END];
            if self.following.observe(self.time_s, &self.states, derivatives) {
                self.begin_on_the_move();
            }
        } else if self.settling_steps >= MAX_SETTLING_STEPS || self.time_s > MAX_SETTLING_S {
            self.begin_following();
        }
    }

    fn begin_following(&mut self) {
        self.following = Following::NONE;
        self.following.states = self.states;
        self.following.held.copy_from_slice(&self.variables[FIRST_INPUT..][..HELD]);
        self.phase = Phase::Following;
        self.next_tick = [0; CLOCKS];
        self.start_step();
        (self.step_s, self.end_s) = (FIRST_STEP_S, FIRST_STEP_S);
    }

    fn end_search(&mut self) {
        (self.phase, self.next_tick) = (Phase::Settled, [0; CLOCKS]);
    }

    /// Ends the search without a steady state: the run begins where the search ended.
    fn begin_on_the_move(&mut self) {
        self.end_search();
        self.states = self.following.states;
        self.variables[FIRST_INPUT..][..HELD].copy_from_slice(&self.following.held);
    }
}
