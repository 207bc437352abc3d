//! The memory of a few variants side by side, and one step over them.

use super::compiled_step::CompiledStep;
use super::step::{AnyStep, MAX_LANES, NUMBERS, Step, StepArrays, input_bit};
use super::tableau::Tableau;
use crate::program::Program;
use crate::scalar::Lanes;
use alloc::vec::Vec;

/// The arrays of as many variants as there are lanes.
pub struct StepMemory<'p, V> {
    program: &'p Program,
    step: AnyStep<'p>,
    arrays: StepArrays<V>,
    /// The states at the end of the step.
    y_new: Vec<V>,
    /// Index of the step's error in the stage vectors. These are zeros if a method has no error estimate.
    first_error: usize,
    reciprocal_scales: Vec<f64>,
    /// The same for the errors of a step, including the states' error weights.
    reciprocal_allowances: Vec<f64>,
    /// The lowest value of each state in the search for the steady state.
    lowest: Vec<f64>,
    /// For each external input that changes in some lane: its index and its cubic in the time since the step began.
    moving: Vec<(usize, [V; 4])>,
}

impl<'p, V: Lanes> StepMemory<'p, V> {
    /// Memory for a program; every lane is zero.
    pub fn new(program: &'p Program) -> Self {
        let states = program.states();
        let mut arrays = StepArrays::new(program);
        Self {
            program,
            step: AnyStep::choose(program, None, &mut arrays),
            y_new: arrays.y.clone(),
            first_error: arrays.stages.len() - states.len(),
            arrays,
            reciprocal_scales: states.iter().map(|s| 1.0 / s.scale).collect(),
            reciprocal_allowances: (states.iter())
                .map(|s| 1.0 / (s.scale * s.error_weight))
                .collect(),
            lowest: states.iter().map(|s| s.lowest).collect(),
            moving: Vec::new(),
        }
    }

    /// Uses a compiled step from now on, or the interpreted one if there is none. Returns whether a compiled step is in
    /// use.
    ///
    /// The step must belong to this program and method, and have the same number of lanes.
    pub(super) fn use_compiled(&mut self, compiled: Option<&'p CompiledStep>) -> bool {
        self.step = AnyStep::choose(self.program, compiled, &mut self.arrays);
        self.step.is_compiled()
    }

    /// Stores a variant's constants in a lane.
    pub fn set_constants(&mut self, lane: usize, constants: &[f64]) {
        for (place, &value) in self.arrays.constants.iter_mut().zip(constants) {
            place.set_lane(lane, value);
        }
        self.arrays.changed |= NUMBERS;
    }

    /// Sets one variable (an input or a stand-in) of a lane.
    pub fn set_variable(&mut self, lane: usize, slot: usize, value: f64) {
        self.arrays.variables[slot].set_lane(lane, value);
        self.arrays.changed = u64::MAX;
    }

    /// One variable of a lane, as of the last evaluation.
    pub fn variable(&self, lane: usize, slot: usize) -> f64 {
        V::numbers(&self.arrays.variables)[slot * V::WIDTH + lane]
    }

    /// One variable of every lane.
    pub(crate) fn variables(&self, slot: usize) -> V {
        self.arrays.variables[slot]
    }

    /// Sets the states of a lane.
    pub fn set_states(&mut self, lane: usize, states: &[f64]) {
        for (place, &value) in self.arrays.y.iter_mut().zip(states) {
            place.set_lane(lane, value);
        }
    }

    /// The states of a lane.
    pub(crate) fn states(&self, lane: usize) -> Vec<f64> {
        self.arrays.y.iter().map(|state| state.lane(lane)).collect()
    }

    /// The gradients of the last evaluation with the Jacobian.
    pub fn gradients(&self) -> &[V] {
        &self.arrays.gradients
    }

    /// Removes all moving inputs. Call it before [`StepMemory::set_input`].
    pub(crate) fn clear_inputs(&mut self) {
        for (external, _) in self.moving.drain(..) {
            self.arrays.gradients[self.program.jacobian().slope(external)] = V::constant(0.0);
        }
    }

    /// Sets an input to a cubic in the time since the beginning of the
    /// step, with one polynomial per lane, `cubic(lane)`.
    #[inline(always)]
    pub fn set_input(&mut self, external: usize, cubic: impl Fn(usize) -> [f64; 4]) {
        let mut cubics = [[0.0; 4]; MAX_LANES];
        for (lane, place) in cubics[..V::WIDTH].iter_mut().enumerate() {
            *place = cubic(lane);
        }
        let coefficients = core::array::from_fn(|power| V::from_fn(|lane| cubics[lane][power]));
        self.moving.push((external, coefficients));
    }

    /// Writes the inputs at `offset` after the beginning of the step to the
    /// variable array.
    #[inline(always)]
    fn load_inputs(&mut self, offset: V) {
        let first = self.program.externals().start;
        for &(external, [a, b, c, d]) in &self.moving {
            self.arrays.variables[first + external] = a + offset * (b + offset * (c + offset * d));
            self.arrays.changed |= input_bit(external);
        }
    }

    /// Evaluates all equations at the beginning of the step, with the Jacobian.
    #[inline(always)]
    pub fn begin(&mut self) {
        let n = self.arrays.y.len();
        self.arrays.variables[..n].copy_from_slice(&self.arrays.y);
        self.load_inputs(V::constant(0.0));
        let rows = self.program.jacobian();
        for &(external, [_, slope, _, _]) in &self.moving {
            self.arrays.gradients[rows.slope(external)] = slope;
        }
        self.step.evaluate_with_jacobian(&mut self.arrays);
    }

    /// Evaluates all equations at the beginning of the step, without the Jacobian.
    #[inline(always)]
    pub fn evaluate(&mut self) {
        let n = self.arrays.y.len();
        self.arrays.variables[..n].copy_from_slice(&self.arrays.y);
        self.load_inputs(V::constant(0.0));
        self.program.evaluate(&self.arrays.constants, &mut self.arrays.variables);
    }

    /// Runs the sampled equations of a clock in the lanes of the mask. An evaluation
    /// must precede it.
    #[inline(always)]
    pub fn tick(&mut self, clock: usize, lanes: V::Mask) {
        let clock = &self.program.clocks()[clock];
        clock.sequence.run(&self.arrays.constants, &mut self.arrays.variables);
        for &(from, to) in &clock.exchanges {
            let (from, to) = (from as usize, to as usize);
            self.arrays.variables[to] =
                V::select(lanes, self.arrays.variables[from], self.arrays.variables[to]);
        }
    }

    /// Takes one Rosenbrock step (R1), (R2) from the last [`StepMemory::begin`]. Returns the
    /// largest error of any state, relative to its scale and `error_weight`.
    #[inline(always)]
    pub(crate) fn rosenbrock(&mut self, method: &Tableau, h: V) -> V {
        let reciprocal = V::constant(1.0) / h;
        let diagonal = reciprocal * V::constant(1.0 / method.gamma);
        self.step.factor(diagonal, &mut self.arrays);
        for stage in 0..method.stages() {
            // The first stage has no sum: its argument is the state at the beginning of the step.
            if stage > 0 {
                self.step.sum_stages(method, stage, reciprocal, &mut self.arrays);
                // The last two stages of the stiffly accurate methods have the same time.
                if method.alpha[stage] != method.alpha[stage - 1] {
                    self.load_inputs(h * V::constant(method.alpha[stage]));
                }
                self.step.evaluate_derivatives(&mut self.arrays);
            }
            let slope_factor = h * V::constant(method.gamma_sum[stage]);
            self.step.solve_stage(stage, slope_factor, &mut self.arrays);
        }
        self.combine(method)
    }

    /// (R2). The variable array still holds the argument of the last stage.
    #[inline(always)]
    fn combine(&mut self, method: &Tableau) -> V {
        let n = self.arrays.y.len();
        self.first_error = (method.stages() - 1) * n;
        let last = &self.arrays.stages[self.first_error..][..n];
        let numbers = self.arrays.variables[..n].iter().zip(last).zip(&self.reciprocal_allowances);
        let mut largest = Largest::default();
        for (((&argument, &last), &scale), new) in numbers.zip(&mut self.y_new) {
            *new = argument + last;
            largest.consider(last, scale);
        }
        largest.value()
    }

    /// Reduces the last step to its first stage in the lanes of the mask, which makes it a step of the linearly
    /// implicit Euler method over `γ h`. No state ends below its lowest value. Returns the largest change in these
    /// lanes, and `error` in the others.
    #[inline(always)]
    pub(crate) fn keep_first_stage(&mut self, lanes: V::Mask, error: V) -> V {
        for (k, &y) in self.arrays.y.iter().enumerate() {
            let change = self.arrays.stages[k];
            let new = (y + change).max(V::constant(self.lowest[k]));
            self.y_new[k] = V::select(lanes, new, self.y_new[k]);
            let error = &mut self.arrays.stages[self.first_error + k];
            *error = V::select(lanes, change, *error);
        }
        V::select(lanes, self.largest_change(), error)
    }

    /// The errors of the last step.
    fn errors(&self) -> &[V] {
        &self.arrays.stages[self.first_error..][..self.arrays.y.len()]
    }

    /// The largest error of the last step over its scale; NaN if any is NaN.
    #[inline(always)]
    fn largest_change(&self) -> V {
        let mut largest = Largest::default();
        for (&error, &scale) in self.errors().iter().zip(&self.reciprocal_scales) {
            largest.consider(error, scale);
        }
        largest.value()
    }

    /// Takes one step of the classical Runge–Kutta method from the last evaluation.
    #[inline(always)]
    pub(crate) fn runge_kutta(&mut self, h: V) {
        let n = self.arrays.y.len();
        let half = h * V::constant(0.5);
        for (stage, offset) in [V::constant(0.0), half, half, h].into_iter().enumerate() {
            if stage > 0 {
                for k in 0..n {
                    self.arrays.variables[k] =
                        self.arrays.y[k] + self.arrays.stages[(stage - 1) * n + k] * offset;
                }
                self.load_inputs(offset);
                self.step.evaluate_derivatives(&mut self.arrays);
            }
            let derivatives = &self.arrays.variables[self.program.derivatives()];
            self.arrays.stages[stage * n..][..n].copy_from_slice(derivatives);
        }
        let sixth = h * V::constant(1.0 / 6.0);
        for k in 0..n {
            let [a, b, c, d] = core::array::from_fn(|j| self.arrays.stages[j * n + k]);
            self.y_new[k] = self.arrays.y[k] + (a + (b + c) * V::constant(2.0) + d) * sixth;
        }
    }

    /// Accepts the step in the lanes of the mask.
    #[inline(always)]
    pub(crate) fn accept(&mut self, lanes: V::Mask) {
        for (y, &new) in self.arrays.y.iter_mut().zip(&self.y_new) {
            *y = V::select(lanes, new, *y);
        }
    }

    /// Whether the new states of a lane are finite numbers.
    pub(crate) fn finite(&self, lane: usize) -> bool {
        self.y_new.iter().all(|v| v.lane(lane).is_finite())
    }

    /// The state responsible for a failed step in a lane: the first whose rate is
    /// not finite at the beginning of the step, else the one with the largest error.
    ///
    /// One such rate makes all states of the step not finite, so their errors do not
    /// identify it. Evaluates all equations again.
    pub(crate) fn worst_state(&mut self, lane: usize) -> usize {
        self.evaluate();
        let rates = &self.arrays.variables[self.program.derivatives()];
        let broken = rates.iter().position(|rate| !rate.lane(lane).is_finite());
        broken.unwrap_or_else(|| self.state_with_largest_error(lane))
    }

    /// A NaN counts as the largest error.
    fn state_with_largest_error(&self, lane: usize) -> usize {
        let relative = |k: usize| {
            let e = self.errors()[k].lane(lane) * self.reciprocal_allowances[k];
            let bad = !e.is_finite() || !self.y_new[k].lane(lane).is_finite();
            if bad { f64::INFINITY } else { crate::scalar::Scalar::abs(e) }
        };
        let mut worst = 0;
        for k in 1..self.arrays.y.len() {
            if relative(k) > relative(worst) {
                worst = k;
            }
        }
        worst
    }

    /// For each state of a lane: its value and its rate, 1/s, both over its scale, as of the last evaluation.
    pub(crate) fn motion_over_scale(&self, lane: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        let derivatives = &self.arrays.variables[self.program.derivatives()];
        let both = self.arrays.y.iter().zip(derivatives).zip(&self.reciprocal_scales);
        both.map(move |((y, rate), scale)| (y.lane(lane) * scale, rate.lane(lane) * scale))
    }

    /// The largest rate of any state over its scale in a lane, 1/s,
    /// as of the last evaluation.
    pub(crate) fn largest_rate_per_s(&self, lane: usize) -> f64 {
        let derivatives = &self.arrays.variables[self.program.derivatives()];
        let rates = derivatives.iter().zip(&self.reciprocal_scales);
        rates.fold(0.0, |largest, (d, scale)| {
            let rate = crate::scalar::Scalar::abs(d.lane(lane) * scale);
            if rate < largest { largest } else { rate }
        })
    }

    /// Writes the states at a fraction of the last step (R3) to the variable
    /// array and evaluates all equations there. The beginning of the step is unchanged.
    ///
    /// `fraction` is per lane. Call it before [`StepMemory::accept`].
    #[inline(always)]
    pub(crate) fn interpolate(&mut self, method: &Tableau, h: V, fraction: V) {
        let n = self.arrays.y.len();
        let rest = V::constant(1.0) - fraction;
        for k in 0..n {
            let mut bend = V::constant(0.0);
            for row in method.dense.iter().rev() {
                let mut sum = V::constant(0.0);
                for (j, &weight) in row.iter().enumerate() {
                    sum = sum + self.arrays.stages[j * n + k] * V::constant(weight);
                }
                bend = bend * fraction + sum;
            }
            self.arrays.variables[k] =
                rest * self.arrays.y[k] + fraction * (self.y_new[k] + rest * bend);
        }
        self.load_inputs(h * fraction);
        self.program.evaluate(&self.arrays.constants, &mut self.arrays.variables);
    }
}

/// The largest error over scale so far.
struct Largest<V> {
    largest: V,
    /// Zero unless some error is not finite, because comparisons would lose a NaN.
    poison: V,
}

impl<V: Lanes> Default for Largest<V> {
    #[inline(always)]
    fn default() -> Self {
        Self { largest: V::constant(0.0), poison: V::constant(0.0) }
    }
}

impl<V: Lanes> Largest<V> {
    #[inline(always)]
    fn consider(&mut self, error: V, reciprocal_scale: f64) {
        let relative = error.abs() * V::constant(reciprocal_scale);
        self.largest = relative.max(self.largest);
        self.poison = self.poison + relative * V::constant(0.0);
    }

    #[inline(always)]
    fn value(self) -> V {
        self.largest + self.poison
    }
}
