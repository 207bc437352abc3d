//! An equation block: inputs and constants in, outputs out.
//!
//! Components consist of equation blocks. A block is small (a few inputs), so
//! that its dual numbers are small. It is pure, so that a program can order and
//! group blocks freely.

use crate::fluid::FluidState;
use crate::scalar::Scalar;

/// The numbers from which an equation computes its constants.
pub(crate) struct Given<'a, S> {
    /// The component's parameters with the faults applied, in declared order.
    pub(crate) parameters: &'a [S],
    /// The fluid of the component's circuit at its temperature.
    pub(crate) fluid: &'a FluidState<S>,
    /// Which of several blocks with the same equation this is (for example the edge of
    /// a valve): the number that the component assigned when it wired the block.
    pub(crate) which: usize,
}

impl<S> core::ops::Index<usize> for Given<'_, S> {
    type Output = S;
    fn index(&self, parameter: usize) -> &S {
        &self.parameters[parameter]
    }
}

/// A block of `I` inputs, `O` outputs and `C` constants.
pub(crate) trait Equation<const I: usize, const O: usize, const C: usize> {
    /// The constants: numbers that do not change while a variant runs. An equation without any computes none.
    fn constants<S: Scalar<Base = S>>(_given: &Given<S>) -> [S; C] {
        const { assert!(C == 0, "an equation with constants computes them") };
        core::array::from_fn(|_| unreachable!("there are none"))
    }

    /// Computes the outputs. Every implementation is `#[inline(always)]`.
    fn evaluate<S: Scalar>(constants: &[S::Base; C], inputs: [S; I]) -> [S; O];
}
