//! Four lanes as a plain array, for every processor.

use super::base_scalar;
use crate::scalar::{Lanes, Primitive, Scalar, Work};

const WIDTH: usize = 4;

/// Four lanes without any particular instruction set.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Portable([f64; WIDTH]);

impl Portable {
    #[inline(always)]
    fn map(self, mut f: impl FnMut(f64) -> f64) -> Self {
        Self(core::array::from_fn(|i| f(self.0[i])))
    }
    #[inline(always)]
    fn zip(self, other: Self, mut f: impl FnMut(f64, f64) -> f64) -> Self {
        Self(core::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

macro_rules! portable_operator {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl core::ops::$trait for Portable {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $operator b)
            }
        }
    };
}
portable_operator!(Add, add, +);
portable_operator!(Sub, sub, -);
portable_operator!(Mul, mul, *);
portable_operator!(Div, div, /);

impl core::ops::Neg for Portable {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl Scalar for Portable {
    base_scalar!();
    type Mask = [bool; WIDTH];

    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self([value; WIDTH])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(<f64 as Scalar>::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(<f64 as Scalar>::abs)
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        core::array::from_fn(|i| self.0[i] < other.0[i])
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(core::array::from_fn(|i| if mask[i] { yes.0[i] } else { no.0[i] }))
    }
}

impl Primitive for Portable {
    #[inline(always)]
    fn round(self) -> Self {
        self.map(Primitive::round)
    }
    #[inline(always)]
    fn scale_by_power_of_two(self, exponent: Self) -> Self {
        self.zip(exponent, Primitive::scale_by_power_of_two)
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        (self.map(|x| x.split_exponent().0), self.map(|x| x.split_exponent().1))
    }
}

// SAFETY: `repr(C)`, four numbers.
unsafe impl Lanes for Portable {
    const WIDTH: usize = WIDTH;

    #[inline(always)]
    fn from_fn(f: impl FnMut(usize) -> f64) -> Self {
        Self(core::array::from_fn(f))
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        self.0[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        self.0[lane] = value;
    }

    #[inline(never)]
    fn with_target_features<W: Work<Self>>(work: W) -> W::Output {
        work.run()
    }
}
