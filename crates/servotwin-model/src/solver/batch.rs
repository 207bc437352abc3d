//! The memory of a few variants side by side, and one step of them.

use super::kernels::Functions;
use super::kernels::{NUMBERS, input_bit};
use super::tableau::Tableau;
use crate::program::Program;
use crate::scalar::{Lanes, Work};
use alloc::vec;
use alloc::vec::Vec;

/// The variables of as many variants as there are lanes.
pub struct Batch<'p, V> {
    program: &'p Program,
    /// Constants of all blocks.
    constants: Vec<V>,
    /// The variable array of the program.
    variables: Vec<V>,
    gradients: Vec<V>,
    factors: Vec<V>,
    /// The states at the beginning of the step.
    y: Vec<V>,
    /// The states at its end.
    y_new: Vec<V>,
    /// Stage vectors, one after the other. The last of a method is the error of its step.
    stages: Vec<V>,
    /// Where that begins; zeros, where a method has none.
    first_error: usize,
    reciprocal_scales: Vec<f64>,
    /// The same for the errors of a step, with the states' leeway.
    reciprocal_allowances: Vec<f64>,
    /// What no state goes below on the way to rest.
    lowest: Vec<f64>,
    /// For every external input that changes in some lane: its place and its
    /// cubic from the beginning of the step.
    moving: Vec<(usize, [V; 4])>,
    /// What does the same as the lists, for lanes of this width.
    compiled: Option<&'p Functions>,
    /// What compiled functions keep from one evaluation to the next.
    quiet: Vec<V>,
    /// What of that is no longer true.
    changed: u64,
}

/// The largest number of lanes of any level.
pub(super) const MOST_LANES: usize = 16;
/// The largest number of stages of any method.
pub(super) const MOST_STAGES: usize = 8;

impl<'p, V: Lanes> Batch<'p, V> {
    /// Memory for a program; every lane is zero.
    pub fn new(program: &'p Program) -> Self {
        let n = program.states().len();
        let zeros = |count: usize| vec![V::constant(0.0); count];
        Self {
            program,
            constants: zeros(program.constants()),
            variables: zeros(program.memory()),
            gradients: zeros(program.rows().slots()),
            factors: zeros(program.plan().slots()),
            y: zeros(n),
            y_new: zeros(n),
            stages: zeros(n * MOST_STAGES),
            first_error: n * (MOST_STAGES - 1),
            reciprocal_scales: program.states().iter().map(|s| 1.0 / s.scale).collect(),
            reciprocal_allowances: (program.states().iter())
                .map(|s| 1.0 / (s.scale * s.leeway))
                .collect(),
            lowest: program.states().iter().map(|s| s.lowest).collect(),
            moving: Vec::new(),
            compiled: None,
            quiet: Vec::new(),
            changed: u64::MAX,
        }
    }

    /// Takes steps by functions that were compiled for the program, the method that is used and as many lanes, from
    /// now on; whether there are any.
    pub(super) fn use_compiled(&mut self, compiled: Option<&'p Functions>) -> bool {
        self.compiled = compiled;
        let places = compiled.map_or(0, Functions::quiet_places);
        self.quiet = vec![V::constant(0.0); places];
        self.changed = u64::MAX;
        compiled.is_some()
    }

    /// Puts a variant's constants into a lane.
    pub fn set_constants(&mut self, lane: usize, constants: &[f64]) {
        for (place, &value) in self.constants.iter_mut().zip(constants) {
            place.set_lane(lane, value);
        }
        self.changed |= NUMBERS;
    }

    /// Sets one variable (an input or a stand-in) of a lane.
    pub fn set_variable(&mut self, lane: usize, slot: usize, value: f64) {
        self.variables[slot].set_lane(lane, value);
        self.changed = u64::MAX;
    }

    /// One variable of a lane, as of the last evaluation.
    pub fn variable(&self, lane: usize, slot: usize) -> f64 {
        V::numbers(&self.variables)[slot * V::WIDTH + lane]
    }

    /// One variable of every lane.
    pub fn variables(&self, slot: usize) -> V {
        self.variables[slot]
    }

    /// Sets the states of a lane.
    pub fn set_states(&mut self, lane: usize, states: &[f64]) {
        for (place, &value) in self.y.iter_mut().zip(states) {
            place.set_lane(lane, value);
        }
    }

    /// The states of a lane.
    pub fn states(&self, lane: usize) -> Vec<f64> {
        self.y.iter().map(|state| state.lane(lane)).collect()
    }

    /// The gradients of the last evaluation with the Jacobian.
    pub fn gradients(&self) -> &[V] {
        &self.gradients
    }

    /// Forgets which inputs move. To be called before [`Batch::set_input`].
    pub fn clear_inputs(&mut self) {
        for (external, _) in self.moving.drain(..) {
            self.gradients[self.program.rows().slope(external)] = V::constant(0.0);
        }
    }

    /// Makes an input move as a cubic in the time since the beginning of the
    /// step: one polynomial per lane, `cubic(lane)`.
    #[inline(always)]
    pub fn set_input(&mut self, external: usize, cubic: impl Fn(usize) -> [f64; 4]) {
        let mut cubics = [[0.0; 4]; MOST_LANES];
        for (lane, place) in cubics[..V::WIDTH].iter_mut().enumerate() {
            *place = cubic(lane);
        }
        let coefficients = core::array::from_fn(|power| V::from_fn(|lane| cubics[lane][power]));
        self.moving.push((external, coefficients));
    }

    /// Loads the inputs at `offset` after the beginning of the step into the
    /// variable array.
    #[inline(always)]
    fn load_inputs(&mut self, offset: V) {
        let first = self.program.externals().start;
        for &(external, [a, b, c, d]) in &self.moving {
            self.variables[first + external] = a + offset * (b + offset * (c + offset * d));
            self.changed |= input_bit(external);
        }
    }

    /// Evaluates everything at the beginning of the step, with the Jacobian.
    #[inline(always)]
    pub fn begin(&mut self) {
        let n = self.y.len();
        self.variables[..n].copy_from_slice(&self.y);
        self.load_inputs(V::constant(0.0));
        let rows = self.program.rows();
        for &(external, [_, slope, _, _]) in &self.moving {
            self.gradients[rows.slope(external)] = slope;
        }
        self.update_quiet();
        let Self { program, constants, variables, gradients, compiled, quiet, .. } = self;
        if let Some(compiled) = compiled {
            return compiled.begin(constants, quiet, variables, gradients);
        }
        program.evaluate_with_jacobian(constants, variables, gradients);
    }

    /// Evaluates everything at the beginning of the step, without the Jacobian.
    #[inline(always)]
    pub fn evaluate(&mut self) {
        let n = self.y.len();
        self.variables[..n].copy_from_slice(&self.y);
        self.load_inputs(V::constant(0.0));
        self.program.evaluate(&self.constants, &mut self.variables);
    }

    /// Runs the sampled equations of a clock in the lanes of the mask; needs
    /// an evaluation first.
    #[inline(always)]
    pub fn tick(&mut self, clock: usize, lanes: V::Mask) {
        let clock = &self.program.clocks()[clock];
        clock.sequence.run(&self.constants, &mut self.variables);
        for &(from, to) in &clock.exchanges {
            let (from, to) = (from as usize, to as usize);
            self.variables[to] = V::select(lanes, self.variables[from], self.variables[to]);
        }
    }

    /// One Rosenbrock step (R1), (R2) from the last [`Batch::begin`]. Gives the
    /// largest error of any state over its scale and leeway.
    #[inline(always)]
    pub fn rosenbrock(&mut self, method: &Tableau, h: V) -> V {
        let reciprocal = V::constant(1.0) / h;
        self.factorise(method, reciprocal);
        for stage in 0..method.stages() {
            // The first one has no sum: its argument is where the step begins.
            if stage > 0 {
                self.stage_sums(method, stage, reciprocal);
                // The last two stages of the stiffly accurate methods stand at the same time.
                if method.alpha[stage] != method.alpha[stage - 1] {
                    self.load_inputs(h * V::constant(method.alpha[stage]));
                }
                self.evaluate_motion();
            }
            self.solve_stage(h * V::constant(method.gamma_sum[stage]), stage);
        }
        self.combine(method)
    }

    /// Tells compiled functions what has changed since their last evaluation.
    #[inline(always)]
    fn update_quiet(&mut self) {
        let changed = core::mem::take(&mut self.changed);
        let Self { constants, variables, compiled: Some(compiled), quiet, .. } = self else {
            return;
        };
        if changed != 0 {
            compiled.update(constants, variables, quiet, changed);
        }
    }

    /// What the derivatives depend on; nothing else is known after it.
    #[inline(always)]
    fn evaluate_motion(&mut self) {
        self.update_quiet();
        let Self { program, constants, variables, compiled, quiet, .. } = self;
        match compiled {
            Some(compiled) => compiled.motion(constants, quiet, variables),
            None => program.motion().run(constants, variables),
        }
    }

    #[inline(always)]
    fn factorise(&mut self, method: &Tableau, reciprocal: V) {
        let diagonal = reciprocal * V::constant(1.0 / method.gamma);
        if let Some(compiled) = self.compiled {
            return compiled.factor(diagonal, &self.gradients, &mut self.factors);
        }
        factorise(self.program, diagonal, &self.gradients, &mut self.factors);
    }

    /// `y + Σ a_ij U_j` into the variable array, and `(Σ c_ij U_j)/h` where `U_i` will
    /// stand.
    #[inline(always)]
    fn stage_sums(&mut self, method: &Tableau, stage: usize, reciprocal: V) {
        let n = self.y.len();
        let (before, right) = self.stages.split_at_mut(stage * n);
        let (states, right) = (&mut self.variables[..n], &mut right[..n]);
        match self.compiled {
            Some(compiled) => compiled.sums(stage, reciprocal, &self.y, before, states, right),
            None => stage_sums(method, stage, states, &self.y, right, reciprocal, before),
        }
    }

    /// The solution of (R1) in the place of its sum.
    #[inline(always)]
    fn solve_stage(&mut self, slope_factor: V, stage: usize) {
        let n = self.y.len();
        let Self { program, variables, gradients, factors, stages, compiled, .. } = self;
        let right = &mut stages[stage * n..][..n];
        if let Some(compiled) = compiled {
            return compiled.solve(stage, variables, slope_factor, gradients, factors, right);
        }
        if stage == 0 {
            right.fill(V::constant(0.0));
        }
        let derivatives = &variables[program.derivatives()];
        solve(program, derivatives, slope_factor, gradients, factors, right);
    }

    /// (R2): the variable array still holds the argument of the last stage.
    #[inline(always)]
    fn combine(&mut self, method: &Tableau) -> V {
        let n = self.y.len();
        self.first_error = (method.stages() - 1) * n;
        let last = &self.stages[self.first_error..][..n];
        let numbers = self.variables[..n].iter().zip(last).zip(&self.reciprocal_allowances);
        let mut largest = Largest::default();
        for (((&argument, &last), &scale), new) in numbers.zip(&mut self.y_new) {
            *new = argument + last;
            largest.consider(last, scale);
        }
        largest.value()
    }

    /// Makes the last step one of the linearly implicit Euler method over `γ h`
    /// in the lanes of the mask, which is its first stage, ending at no state's lowest value. Gives the largest
    /// change there, and `error` elsewhere.
    #[inline(always)]
    pub fn keep_first_stage(&mut self, lanes: V::Mask, error: V) -> V {
        for (k, &y) in self.y.iter().enumerate() {
            let change = self.stages[k];
            let new = (y + change).max(V::constant(self.lowest[k]));
            self.y_new[k] = V::select(lanes, new, self.y_new[k]);
            let error = &mut self.stages[self.first_error + k];
            *error = V::select(lanes, change, *error);
        }
        V::select(lanes, self.largest_change(), error)
    }

    /// The errors of the last step.
    fn errors(&self) -> &[V] {
        &self.stages[self.first_error..][..self.y.len()]
    }

    /// What stands as the errors, the largest over its scale; NaN where any is NaN.
    #[inline(always)]
    fn largest_change(&self) -> V {
        let mut largest = Largest::default();
        for (&error, &scale) in self.errors().iter().zip(&self.reciprocal_scales) {
            largest.consider(error, scale);
        }
        largest.value()
    }

    /// One step of the classical Runge–Kutta method from the last evaluation.
    #[inline(always)]
    pub fn runge_kutta(&mut self, h: V) {
        let n = self.y.len();
        let half = h * V::constant(0.5);
        for (stage, offset) in [V::constant(0.0), half, half, h].into_iter().enumerate() {
            if stage > 0 {
                for k in 0..n {
                    self.variables[k] = self.y[k] + self.stages[(stage - 1) * n + k] * offset;
                }
                self.load_inputs(offset);
                self.evaluate_motion();
            }
            let derivatives = &self.variables[self.program.derivatives()];
            self.stages[stage * n..][..n].copy_from_slice(derivatives);
        }
        let sixth = h * V::constant(1.0 / 6.0);
        for k in 0..n {
            let [a, b, c, d] = core::array::from_fn(|j| self.stages[j * n + k]);
            self.y_new[k] = self.y[k] + (a + (b + c) * V::constant(2.0) + d) * sixth;
        }
    }

    /// Takes the step in the lanes of the mask.
    #[inline(always)]
    pub fn accept(&mut self, lanes: V::Mask) {
        for (y, &new) in self.y.iter_mut().zip(&self.y_new) {
            *y = V::select(lanes, new, *y);
        }
    }

    /// Whether the new states of a lane are finite numbers.
    pub fn finite(&self, lane: usize) -> bool {
        self.y_new.iter().all(|v| v.lane(lane).is_finite())
    }

    /// The state to blame for a step that failed in a lane: the first whose rate
    /// is not finite where the step began, else the one with the largest error.
    ///
    /// One such rate spoils all states of the step, so the errors do not tell.
    /// Evaluates everything again.
    pub fn worst_state(&mut self, lane: usize) -> usize {
        self.evaluate();
        let rates = &self.variables[self.program.derivatives()];
        let broken = rates.iter().position(|rate| !rate.lane(lane).is_finite());
        broken.unwrap_or_else(|| self.state_with_largest_error(lane))
    }

    /// NaN counts as largest.
    fn state_with_largest_error(&self, lane: usize) -> usize {
        let relative = |k: usize| {
            let e = self.errors()[k].lane(lane) * self.reciprocal_allowances[k];
            let bad = !e.is_finite() || !self.y_new[k].lane(lane).is_finite();
            if bad { f64::INFINITY } else { crate::scalar::Scalar::abs(e) }
        };
        let mut worst = 0;
        for k in 1..self.y.len() {
            if relative(k) > relative(worst) {
                worst = k;
            }
        }
        worst
    }

    /// The states of a lane over their scales, and how fast they move, 1/s, as of the last evaluation.
    pub fn motion_over_scale(&self, lane: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        let derivatives = &self.variables[self.program.derivatives()];
        let both = self.y.iter().zip(derivatives).zip(&self.reciprocal_scales);
        both.map(move |((y, rate), scale)| (y.lane(lane) * scale, rate.lane(lane) * scale))
    }

    /// The largest rate of change of any state over its scale in a lane, 1/s,
    /// as of the last evaluation.
    pub fn largest_rate_per_s(&self, lane: usize) -> f64 {
        let derivatives = &self.variables[self.program.derivatives()];
        let rates = derivatives.iter().zip(&self.reciprocal_scales);
        rates.fold(0.0, |largest, (d, scale)| {
            let rate = crate::scalar::Scalar::abs(d.lane(lane) * scale);
            if rate < largest { largest } else { rate }
        })
    }

    /// Puts the states at a fraction of the last step (R3) into the variable
    /// array and evaluates everything there; the beginning of the step stays.
    ///
    /// `fraction` is per lane. To be called before [`Batch::accept`].
    #[inline(always)]
    pub fn interpolate(&mut self, method: &Tableau, h: V, fraction: V) {
        let n = self.y.len();
        let rest = V::constant(1.0) - fraction;
        for k in 0..n {
            let mut bend = V::constant(0.0);
            for row in method.dense.iter().rev() {
                let mut sum = V::constant(0.0);
                for (j, &weight) in row.iter().enumerate() {
                    sum = sum + self.stages[j * n + k] * V::constant(weight);
                }
                bend = bend * fraction + sum;
            }
            self.variables[k] = rest * self.y[k] + fraction * (self.y_new[k] + rest * bend);
        }
        self.load_inputs(h * fraction);
        self.program.evaluate(&self.constants, &mut self.variables);
    }
}

/// The largest error over scale so far.
struct Largest<V> {
    largest: V,
    /// Zero, unless some error is not finite: comparisons would lose a NaN.
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

/// Declares functions that are compiled for the instruction set each on its own
/// (see [`Lanes::outline`]): a step made of one inlined whole takes the compiler
/// minutes.
macro_rules! outlined {
    ($($(#[$note:meta])* fn $name:ident<'a, V>($($argument:ident: $type:ty),* $(,)?) $body:block)*) => {
        $($(#[$note])*
        fn $name<'a, V: Lanes>($($argument: $type),*) {
            struct Call<'a, V> {
                lanes: core::marker::PhantomData<&'a V>,
                $($argument: $type),*
            }
            impl<'a, V: Lanes> Work<V> for Call<'a, V> {
                type Output = ();
                #[inline(always)]
                fn run(self) {
                    let Call { lanes: _, $($argument),* } = self;
                    $body
                }
            }
            V::outline(Call { lanes: core::marker::PhantomData, $($argument),* });
        })*
    };
}

outlined! {
    /// The factors of `diagonal · I − J`.
    fn factorise<'a, V>(
        program: &'a Program,
        diagonal: V,
        gradients: &'a [V],
        factors: &'a mut [V],
    ) {
        program.plan().factor(diagonal, gradients, factors);
    }

    /// Adds the derivatives and `slope_factor · ∂f/∂t`, then solves in place.
    fn solve<'a, V>(
        program: &'a Program,
        derivatives: &'a [V],
        slope_factor: V,
        gradients: &'a [V],
        factors: &'a [V],
        right: &'a mut [V],
    ) {
        program.solve_stage(derivatives, slope_factor, gradients, factors, right);
    }

    /// [`Tableau::stage_sums`].
    fn stage_sums<'a, V>(
        method: &'a Tableau,
        stage: usize,
        states: &'a mut [V],
        y: &'a [V],
        right: &'a mut [V],
        reciprocal: V,
        stages: &'a [V],
    ) {
        method.stage_sums(stage, states, y, right, reciprocal, stages);
    }
}
