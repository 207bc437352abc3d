//! A step compiled from C for one system.

use super::Method;
use super::step::{MAX_STAGES, Step, StepArrays};
use super::tableau::Tableau;
use crate::program::Program;
use crate::scalar::Lanes;
use alloc::format;
use alloc::vec::Vec;
use core::ffi::c_ulong;

type Length = unsafe extern "C" fn() -> c_ulong;
type Identity = unsafe extern "C" fn() -> u64;
type Update = unsafe extern "C" fn(*const f64, *const f64, *mut f64, u64);
type Begin = unsafe extern "C" fn(*const f64, *const f64, *mut f64, *mut f64);
type Motion = unsafe extern "C" fn(*const f64, *const f64, *mut f64);
type Factor = unsafe extern "C" fn(*const f64, *const f64, *mut f64);
type Solve = unsafe extern "C" fn(*const f64, *const f64, *const f64, *const f64, *mut f64);
type Sums = unsafe extern "C" fn(*const f64, *const f64, *const f64, *mut f64, *mut f64);

/// The functions of [`crate::c_source::write_step`] for one number of lanes.
#[derive(Debug)]
pub struct CompiledStep {
    /// Number of lanes in the arrays.
    stride: usize,
    /// [`Program::identity`] of the program that the text came from.
    identity: u64,
    cached_length: usize,
    update: Update,
    begin: Begin,
    motion: Motion,
    factor: Factor,
    solve_first: Solve,
    solve: Solve,
    /// One function per stage, from the second on.
    sums: Vec<Sums>,
}

/// Converts an address to a function.
///
/// # Safety
/// The address must be that of a function of this type.
unsafe fn function<F: Copy>(address: *const ()) -> F {
    assert_eq!(size_of::<F>(), size_of::<*const ()>());
    // SAFETY: promised by the caller.
    unsafe { core::mem::transmute_copy(&address) }
}

impl CompiledStep {
    /// Looks up the functions by name; returns `None` if one is missing.
    ///
    /// # Safety
    /// `find` must return the functions that [`crate::c_source::write_step`] writes, compiled with this stride for an
    /// instruction set of this processor. They must stay loaded as long as this value lives.
    pub unsafe fn find(
        method: Method,
        stride: usize,
        find: impl Fn(&str) -> Option<*const ()>,
    ) -> Option<Self> {
        let stages = method.tableau()?.stages();
        assert!(stages <= MAX_STAGES);
        // SAFETY: promised by the caller.
        unsafe {
            let cached_length = function::<Length>(find("cached_length")?)() as usize;
            let sums = (1..stages).map(|stage| Some(function(find(&format!("sums_{stage}"))?)));
            Some(Self {
                stride,
                identity: function::<Identity>(find("program_identity")?)(),
                cached_length,
                update: function(find("update")?),
                begin: function(find("begin")?),
                motion: function(find("motion")?),
                factor: function(find("factor")?),
                solve_first: function(find("solve_first")?),
                solve: function(find("solve")?),
                sums: sums.collect::<Option<_>>()?,
            })
        }
    }

    /// Length of [`StepArrays::cached`].
    pub(super) fn cached_length(&self) -> usize {
        self.cached_length
    }

    /// Recomputes the cached values whose sources have changed.
    #[inline(always)]
    fn update_cached<V: Lanes>(&self, arrays: &mut StepArrays<V>) {
        let changed = core::mem::take(&mut arrays.changed);
        if changed != 0 {
            let StepArrays { constants, variables, cached, .. } = arrays;
            // SAFETY: see `impl Step`.
            unsafe { (self.update)(first(constants), first(variables), first_mut(cached), changed) }
        }
    }
}

/// Pointer to the number in the first lane.
fn first<V: Lanes>(lanes: &[V]) -> *const f64 {
    lanes.as_ptr().cast()
}

fn first_mut<V: Lanes>(lanes: &mut [V]) -> *mut f64 {
    lanes.as_mut_ptr().cast()
}

// SAFETY of all calls: `CompiledSteps::new` promises that the functions fit the program, and `CompiledSteps::find` that
// they fit the lanes. The arrays belong to the program, so they are as long as the functions need.
impl<V: Lanes> Step<V> for CompiledStep {
    #[inline(always)]
    fn evaluate_with_jacobian(&self, arrays: &mut StepArrays<V>) {
        self.update_cached(arrays);
        let StepArrays { constants, variables, gradients, cached, .. } = arrays;
        let (variables, gradients) = (first_mut(variables), first_mut(gradients));
        // SAFETY: see above.
        unsafe { (self.begin)(first(constants), first(cached), variables, gradients) }
    }

    #[inline(always)]
    fn evaluate_derivatives(&self, arrays: &mut StepArrays<V>) {
        self.update_cached(arrays);
        let StepArrays { constants, variables, cached, .. } = arrays;
        // SAFETY: see above.
        unsafe { (self.motion)(first(constants), first(cached), first_mut(variables)) }
    }

    #[inline(always)]
    fn factor(&self, diagonal: V, arrays: &mut StepArrays<V>) {
        let StepArrays { gradients, factors, .. } = arrays;
        // SAFETY: see above.
        unsafe { (self.factor)(first(&[diagonal]), first(gradients), first_mut(factors)) }
    }

    #[inline(always)]
    fn sum_stages(&self, _: &Tableau, stage: usize, reciprocal: V, arrays: &mut StepArrays<V>) {
        let StepArrays { variables, y, stages, .. } = arrays;
        let n = y.len();
        let (before, right) = stages.split_at_mut(stage * n);
        let (states, right) = (first_mut(&mut variables[..n]), first_mut(&mut right[..n]));
        let (y, before) = (first(y), first(before));
        // SAFETY: see above.
        unsafe { (self.sums[stage - 1])(first(&[reciprocal]), y, before, states, right) }
    }

    /// In the first stage the right-hand side counts as zero, whatever it holds.
    #[inline(always)]
    fn solve_stage(&self, stage: usize, slope_factor: V, arrays: &mut StepArrays<V>) {
        let StepArrays { variables, gradients, factors, y, stages, .. } = arrays;
        let n = y.len();
        let right = first_mut(&mut stages[stage * n..][..n]);
        let (variables, gradients, factors) = (first(variables), first(gradients), first(factors));
        let solve = if stage == 0 { self.solve_first } else { self.solve };
        // SAFETY: see above.
        unsafe { solve(variables, first(&[slope_factor]), gradients, factors, right) }
    }
}

/// The compiled steps of a program and a method, one for each number of lanes.
#[derive(Debug)]
pub struct CompiledSteps {
    method: Method,
    /// [`Program::identity`] of the program that all steps came from.
    identity: u64,
    steps: Vec<CompiledStep>,
}

impl CompiledSteps {
    /// `None` if a step comes from another program.
    ///
    /// # Safety
    /// The steps must come from this method.
    pub unsafe fn new(program: &Program, method: Method, steps: Vec<CompiledStep>) -> Option<Self> {
        let identity = program.identity();
        let is_own = steps.iter().all(|step| step.identity == identity);
        is_own.then_some(Self { method, identity, steps })
    }

    /// The step for arrays with `stride` lanes.
    ///
    /// # Panics
    /// If the steps come from another program.
    pub(super) fn find(
        &self,
        program: &Program,
        method: Method,
        stride: usize,
    ) -> Option<&CompiledStep> {
        assert_eq!(self.identity, program.identity(), "compiled from another program");
        let fits = |step: &&CompiledStep| method == self.method && step.stride == stride;
        self.steps.iter().find(fits)
    }
}
