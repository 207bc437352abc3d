//! The numbers that features are made of.
//!
//! Every formula is written once, for any [`Number`]. With `f64` it gives the value of a feature. With the expressions of
//! `servotwin-export` it gives the same operations as C.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A real number, or an expression that stands for one.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A number that is known.
    fn constant(value: f64) -> Self;

    /// The square root.
    fn sqrt(self) -> Self;

    /// The logarithm of base ten.
    fn log10(self) -> Self;

    /// The magnitude.
    fn abs(self) -> Self;

    /// `yes` if this number is less than `other`, else `no`.
    fn if_less(self, other: Self, yes: Self, no: Self) -> Self;

    /// The larger of two numbers; this one if they are equal.
    fn larger(self, other: Self) -> Self {
        self.if_less(other, other, self)
    }
}

impl Number for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    fn log10(self) -> Self {
        libm::log10(self)
    }

    fn abs(self) -> Self {
        libm::fabs(self)
    }

    fn if_less(self, other: Self, yes: Self, no: Self) -> Self {
        if self < other { yes } else { no }
    }
}

/// A sum; −0, which changes no number, for none.
pub(crate) fn sum<N: Number>(numbers: impl IntoIterator<Item = N>) -> N {
    numbers.into_iter().fold(N::constant(-0.0), |sum, number| sum + number)
}
