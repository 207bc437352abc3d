//! The operations of one step that depend on the system, interpreted or compiled.

use super::compiled_step::CompiledStep;
use super::tableau::Tableau;
use crate::program::Program;
use crate::scalar::{Lanes, Work};
use alloc::vec;
use alloc::vec::Vec;

/// The largest number of lanes of any level.
pub(super) const MAX_LANES: usize = 16;
/// The largest number of stages of any method.
pub(super) const MAX_STAGES: usize = 8;

/// A bit for all of a variant's numbers except its external inputs: constants and stand-ins.
pub(crate) const NUMBERS: u64 = 1 << 63;

/// The bit of an external input. Inputs from index 62 on share one bit, which costs some repeated computation.
pub(crate) fn input_bit(external: usize) -> u64 {
    1 << external.min(62)
}

/// The arrays of one step; the page of [`super`] draws them with their lengths.
pub(super) struct StepArrays<V> {
    /// The constants of all blocks.
    pub(crate) constants: Vec<V>,
    /// The variable array of the program.
    pub(crate) variables: Vec<V>,
    /// The gradients of all sums, and the partial derivatives of all blocks.
    pub(crate) gradients: Vec<V>,
    /// The factors of `I/(γh) − J`.
    pub(crate) factors: Vec<V>,
    /// The states at the beginning of the step.
    pub(crate) y: Vec<V>,
    /// The stage vectors `U_i`, one after the other. The last one of a method is the error of its step.
    pub(crate) stages: Vec<V>,
    /// Values that a compiled step keeps from one evaluation to the next.
    pub(crate) cached: Vec<V>,
    /// The sources that changed after `cached` was computed: [`NUMBERS`] and [`input_bit`].
    pub(crate) changed: u64,
}

impl<V: Lanes> StepArrays<V> {
    /// Arrays for a program; every lane is zero.
    pub(crate) fn new(program: &Program) -> Self {
        let n = program.states().len();
        let zeros = |count: usize| vec![V::constant(0.0); count];
        Self {
            constants: zeros(program.constants()),
            variables: zeros(program.memory()),
            gradients: zeros(program.jacobian().slots()),
            factors: zeros(program.lu().slots()),
            y: zeros(n),
            stages: zeros(n * MAX_STAGES),
            cached: Vec::new(),
            changed: u64::MAX,
        }
    }

    /// Allocates the cached values of another step. None of them is valid yet.
    fn resize_cached(&mut self, length: usize) {
        self.cached = vec![V::constant(0.0); length];
        self.changed = u64::MAX;
    }
}

/// The operations that a Rosenbrock step needs from the system. All implementations return the same bits.
pub(super) trait Step<V> {
    /// Evaluates all equations and their gradients at the beginning of the step.
    fn evaluate_with_jacobian(&self, arrays: &mut StepArrays<V>);

    /// Evaluates the derivatives of the states. Other results become invalid.
    fn evaluate_derivatives(&self, arrays: &mut StepArrays<V>);

    /// Factors `diagonal · I − J`.
    fn factor(&self, diagonal: V, arrays: &mut StepArrays<V>);

    /// Writes the argument of a stage, `y + Σ a_ij U_j`, to the states of the variable array, and `(Σ c_ij U_j)/h` to
    /// the memory of `U_i`. The first stage has no sums.
    fn sum_stages(
        &self,
        tableau: &Tableau,
        stage: usize,
        reciprocal: V,
        arrays: &mut StepArrays<V>,
    );

    /// Solves (R1) for `U_i`, which replaces its sum.
    fn solve_stage(&self, stage: usize, slope_factor: V, arrays: &mut StepArrays<V>);
}

/// The step of a run: interpreted for any system, or compiled for this one.
///
/// This is an enum and not a trait object, because lane code must be inlined into functions of its instruction set.
pub(super) enum AnyStep<'p> {
    Interpreted(InterpretedStep<'p>),
    Compiled(&'p CompiledStep),
}

impl<'p> AnyStep<'p> {
    /// Returns the compiled step if there is one, and allocates its cached values.
    pub(crate) fn choose<V: Lanes>(
        program: &'p Program,
        compiled: Option<&'p CompiledStep>,
        arrays: &mut StepArrays<V>,
    ) -> Self {
        arrays.resize_cached(compiled.map_or(0, CompiledStep::cached_length));
        compiled.map_or(Self::Interpreted(InterpretedStep { program }), Self::Compiled)
    }

    pub(crate) fn is_compiled(&self) -> bool {
        matches!(self, Self::Compiled(_))
    }
}

/// Calls a method of the step in use.
macro_rules! forward {
    ($self:ident.$method:ident($($argument:expr),*)) => {
        match $self {
            AnyStep::Interpreted(step) => step.$method($($argument),*),
            AnyStep::Compiled(step) => step.$method($($argument),*),
        }
    };
}

impl<V: Lanes> Step<V> for AnyStep<'_> {
    #[inline(always)]
    fn evaluate_with_jacobian(&self, arrays: &mut StepArrays<V>) {
        forward!(self.evaluate_with_jacobian(arrays));
    }

    #[inline(always)]
    fn evaluate_derivatives(&self, arrays: &mut StepArrays<V>) {
        forward!(self.evaluate_derivatives(arrays));
    }

    #[inline(always)]
    fn factor(&self, diagonal: V, arrays: &mut StepArrays<V>) {
        forward!(self.factor(diagonal, arrays));
    }

    #[inline(always)]
    fn sum_stages(
        &self,
        tableau: &Tableau,
        stage: usize,
        reciprocal: V,
        arrays: &mut StepArrays<V>,
    ) {
        forward!(self.sum_stages(tableau, stage, reciprocal, arrays));
    }

    #[inline(always)]
    fn solve_stage(&self, stage: usize, slope_factor: V, arrays: &mut StepArrays<V>) {
        forward!(self.solve_stage(stage, slope_factor, arrays));
    }
}

/// The step that walks the lists of a program.
pub(super) struct InterpretedStep<'p> {
    program: &'p Program,
}

impl<V: Lanes> Step<V> for InterpretedStep<'_> {
    #[inline(always)]
    fn evaluate_with_jacobian(&self, arrays: &mut StepArrays<V>) {
        let StepArrays { constants, variables, gradients, .. } = arrays;
        self.program.evaluate_with_jacobian(constants, variables, gradients);
    }

    #[inline(always)]
    fn evaluate_derivatives(&self, arrays: &mut StepArrays<V>) {
        self.program.motion().run(&arrays.constants, &mut arrays.variables);
    }

    #[inline(always)]
    fn factor(&self, diagonal: V, arrays: &mut StepArrays<V>) {
        factor(self.program, diagonal, &arrays.gradients, &mut arrays.factors);
    }

    #[inline(always)]
    fn sum_stages(
        &self,
        tableau: &Tableau,
        stage: usize,
        reciprocal: V,
        arrays: &mut StepArrays<V>,
    ) {
        let StepArrays { variables, y, stages, .. } = arrays;
        let n = y.len();
        let (before, right) = stages.split_at_mut(stage * n);
        sum_stages(tableau, stage, &mut variables[..n], y, &mut right[..n], reciprocal, before);
    }

    #[inline(always)]
    fn solve_stage(&self, stage: usize, slope_factor: V, arrays: &mut StepArrays<V>) {
        let StepArrays { variables, gradients, factors, y, stages, .. } = arrays;
        let n = y.len();
        let right = &mut stages[stage * n..][..n];
        if stage == 0 {
            right.fill(V::constant(0.0));
        }
        let derivatives = &variables[self.program.derivatives()];
        solve(self.program, derivatives, slope_factor, gradients, factors, right);
    }
}

/// Declares functions that are each compiled separately for the instruction set
/// (see [`Lanes::with_target_features`]). A fully inlined step would take minutes to compile.
macro_rules! with_target_features {
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
            V::with_target_features(Call { lanes: core::marker::PhantomData, $($argument),* });
        })*
    };
}

with_target_features! {
    fn factor<'a, V>(
        program: &'a Program,
        diagonal: V,
        gradients: &'a [V],
        factors: &'a mut [V],
    ) {
        program.lu().factor(diagonal, gradients, factors);
    }

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

    fn sum_stages<'a, V>(
        tableau: &'a Tableau,
        stage: usize,
        states: &'a mut [V],
        y: &'a [V],
        right: &'a mut [V],
        reciprocal: V,
        stages: &'a [V],
    ) {
        tableau.sum_stages(stage, states, y, right, reciprocal, stages);
    }
}
