//! An equation block: inputs and constants in, outputs out.
//!
//! Components are made of equation blocks. A block is small (a few inputs), so
//! that its dual numbers are small; it is pure, so that a program can order and
//! group blocks freely.

use crate::fluid::FluidState;
use crate::scalar::Scalar;

/// What an equation's constants are computed from.
pub struct Given<'a, S> {
    /// The component's parameters with the faults applied, in declared order.
    pub parameters: &'a [S],
    /// The fluid of the component's circuit at its temperature.
    pub fluid: &'a FluidState<S>,
    /// Which of several like blocks of the component this is (for example the
    /// edge of a valve): the number that the component gave when it wired it.
    pub which: usize,
}

impl<S> core::ops::Index<usize> for Given<'_, S> {
    type Output = S;
    fn index(&self, parameter: usize) -> &S {
        &self.parameters[parameter]
    }
}

/// A block of `I` inputs, `O` outputs and `C` constants.
pub trait Equation<const I: usize, const O: usize, const C: usize> {
    /// The numbers that do not change while a variant runs.
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; C];

    /// The outputs. `#[inline(always)]` in every implementation.
    fn evaluate<S: Scalar>(constants: &[S::Base; C], inputs: [S; I]) -> [S; O];
}
