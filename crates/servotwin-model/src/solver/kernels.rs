//! Compiled functions that do what a step's lists say.

use super::Method;
use super::batch::MOST_STAGES;
use crate::program::Program;
use crate::scalar::Lanes;
use alloc::format;
use alloc::vec::Vec;
use core::ffi::c_ulong;

type Places = unsafe extern "C" fn() -> c_ulong;
type Update = unsafe extern "C" fn(*const f64, *const f64, *mut f64, u64);
type Begin = unsafe extern "C" fn(*const f64, *const f64, *mut f64, *mut f64);
type Motion = unsafe extern "C" fn(*const f64, *const f64, *mut f64);
type Factor = unsafe extern "C" fn(*const f64, *const f64, *mut f64);
type Solve = unsafe extern "C" fn(*const f64, *const f64, *const f64, *const f64, *mut f64);
type Sums = unsafe extern "C" fn(*const f64, *const f64, *const f64, *mut f64, *mut f64);

/// What changes where a variant's constants or parameters do.
pub(crate) const NUMBERS: u64 = 1 << 63;

/// What changes where an external input does.
pub(crate) fn input_bit(external: usize) -> u64 {
    // Some share the last bit where there are very many: what is done too often does no harm.
    1 << external.min(62)
}

/// The functions of [`crate::c_source`] for arrays of so many lanes.
#[derive(Debug)]
pub struct Functions {
    /// Number of lanes in the arrays.
    stride: usize,
    /// How much of what is quiet is kept.
    quiet_places: usize,
    update: Update,
    begin: Begin,
    motion: Motion,
    factor: Factor,
    solve_first: Solve,
    solve: Solve,
    /// From the second stage on.
    sums: Vec<Sums>,
}

/// What stands at an address that is a function.
///
/// # Safety
/// It must be one of this type.
unsafe fn function<F: Copy>(address: *const ()) -> F {
    assert_eq!(size_of::<F>(), size_of::<*const ()>());
    // SAFETY: promised by the caller.
    unsafe { core::mem::transmute_copy(&address) }
}

impl Functions {
    /// Takes the functions by their names; `None` where one is missing.
    ///
    /// # Safety
    /// `find` must give the functions of a text of [`crate::c_source::write_step`], compiled with this stride for an
    /// instruction set that the processor has, and they must stay where they are.
    pub unsafe fn find(
        method: Method,
        stride: usize,
        find: impl Fn(&str) -> Option<*const ()>,
    ) -> Option<Self> {
        let stages = method.tableau()?.stages();
        assert!(stages <= MOST_STAGES);
        // SAFETY: promised by the caller.
        unsafe {
            let quiet_places = function::<Places>(find("quiet_places")?)() as usize;
            let sums = (1..stages).map(|stage| Some(function(find(&format!("sums_{stage}"))?)));
            Some(Self {
                stride,
                quiet_places,
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
}

/// Where the numbers of lanes begin.
fn first<V: Lanes>(lanes: &[V]) -> *const f64 {
    lanes.as_ptr().cast()
}

fn first_mut<V: Lanes>(lanes: &mut [V]) -> *mut f64 {
    lanes.as_mut_ptr().cast()
}

// SAFETY of all: [`Kernels::new`] promises that the functions fit the program, and `Kernels::of` that they fit the
// lanes; the arrays are those of a batch of the program, as long as its lists need them.
impl Functions {
    /// How many numbers of what is quiet are kept.
    pub(super) fn quiet_places(&self) -> usize {
        self.quiet_places
    }

    /// Does anew what is quiet and has changed ([`crate::c_source`]). To be called before the other evaluations.
    #[inline(always)]
    pub(super) fn update<V: Lanes>(
        &self,
        constants: &[V],
        variables: &[V],
        quiet: &mut [V],
        changed: u64,
    ) {
        // SAFETY: see above.
        unsafe { (self.update)(first(constants), first(variables), first_mut(quiet), changed) }
    }

    /// [`Program::evaluate_with_jacobian`]; of the gradients only what a step reads.
    #[inline(always)]
    pub(super) fn begin<V: Lanes>(
        &self,
        constants: &[V],
        quiet: &[V],
        variables: &mut [V],
        gradients: &mut [V],
    ) {
        let (variables, gradients) = (first_mut(variables), first_mut(gradients));
        // SAFETY: see above.
        unsafe { (self.begin)(first(constants), first(quiet), variables, gradients) }
    }

    /// The derivatives, and nothing else.
    #[inline(always)]
    pub(super) fn motion<V: Lanes>(&self, constants: &[V], quiet: &[V], variables: &mut [V]) {
        // SAFETY: see above.
        unsafe { (self.motion)(first(constants), first(quiet), first_mut(variables)) }
    }

    /// [`Plan::factor`](crate::lu::Plan::factor).
    #[inline(always)]
    pub(super) fn factor<V: Lanes>(&self, diagonal: V, gradients: &[V], factors: &mut [V]) {
        // SAFETY: see above.
        unsafe { (self.factor)(first(&[diagonal]), first(gradients), first_mut(factors)) }
    }

    /// [`Program::solve_stage`]; in the first stage the right side counts as zero, whatever it holds.
    #[inline(always)]
    pub(super) fn solve<V: Lanes>(
        &self,
        stage: usize,
        variables: &[V],
        slope_factor: V,
        gradients: &[V],
        factors: &[V],
        right: &mut [V],
    ) {
        let (variables, gradients) = (first(variables), first(gradients));
        let (factors, right) = (first(factors), first_mut(right));
        let solve = if stage == 0 { self.solve_first } else { self.solve };
        // SAFETY: see above.
        unsafe { solve(variables, first(&[slope_factor]), gradients, factors, right) }
    }

    /// [`Tableau::stage_sums`](super::tableau::Tableau::stage_sums).
    #[inline(always)]
    pub(super) fn sums<V: Lanes>(
        &self,
        stage: usize,
        reciprocal: V,
        y: &[V],
        stages: &[V],
        states: &mut [V],
        right: &mut [V],
    ) {
        let (states, right) = (first_mut(states), first_mut(right));
        let (y, stages) = (first(y), first(stages));
        // SAFETY: see above.
        unsafe { (self.sums[stage - 1])(first(&[reciprocal]), y, stages, states, right) }
    }
}

/// The compiled functions of a program and a method, for lanes of several numbers.
#[derive(Debug)]
pub struct Kernels {
    method: Method,
    /// The lengths of the program's arrays, which the functions rely on.
    lengths: [usize; 5],
    functions: Vec<Functions>,
}

fn lengths(program: &Program) -> [usize; 5] {
    let (states, memory) = (program.states().len(), program.memory());
    let (gradients, factors) = (program.rows().slots(), program.plan().slots());
    [program.constants(), states, memory, gradients, factors]
}

impl Kernels {
    /// # Safety
    /// They must be made of this program and method.
    pub unsafe fn new(program: &Program, method: Method, functions: Vec<Functions>) -> Self {
        Self { method, lengths: lengths(program), functions }
    }

    /// Those for arrays of as many lanes.
    ///
    /// # Panics
    /// Where they were made of another program, as far as can be seen.
    pub(super) fn of(
        &self,
        program: &Program,
        method: Method,
        stride: usize,
    ) -> Option<&Functions> {
        assert_eq!(self.lengths, lengths(program), "compiled from another program");
        let fits = |functions: &&Functions| method == self.method && functions.stride == stride;
        self.functions.iter().find(fits)
    }
}
