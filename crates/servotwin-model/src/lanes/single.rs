//! `f64`: one lane.

use super::{base_scalar, bits};
use crate::scalar::{Lanes, Primitive, Scalar, Work};

impl Scalar for f64 {
    base_scalar!();
    type Mask = bool;

    #[inline(always)]
    fn constant(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::from_bits(self.to_bits() & !(1 << 63))
    }
    #[inline(always)]
    fn less(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

impl Primitive for f64 {
    #[inline(always)]
    fn round(self) -> Self {
        (self + bits::ROUNDING) - bits::ROUNDING
    }
    #[inline(always)]
    fn scale_by_power_of_two(self, exponent: Self) -> Self {
        let shifted = (exponent + bits::ROUNDING).to_bits() << 52;
        self * f64::from_bits(shifted.wrapping_add(bits::ONE))
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        let moved = self.to_bits().wrapping_add(bits::ONE - bits::ROOT_HALF);
        let mantissa = f64::from_bits((moved & bits::MANTISSA).wrapping_add(bits::ROOT_HALF));
        let exponent = f64::from_bits((moved >> 52) | bits::INTEGER) - bits::INTEGER_AND_BIAS;
        (mantissa, exponent)
    }
}

// SAFETY: one number.
unsafe impl Lanes for f64 {
    const WIDTH: usize = 1;

    #[inline(always)]
    fn from_fn(mut f: impl FnMut(usize) -> f64) -> Self {
        f(0)
    }
    #[inline(always)]
    fn lane(self, _lane: usize) -> f64 {
        self
    }
    #[inline(always)]
    fn set_lane(&mut self, _lane: usize, value: f64) {
        *self = value;
    }

    #[inline(never)]
    fn with_target_features<W: Work<Self>>(work: W) -> W::Output {
        work.run()
    }
}
