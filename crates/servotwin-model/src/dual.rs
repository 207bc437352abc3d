//! Numbers that carry their derivatives.
//!
//! `Dual<V, N>` is a value and its partial derivatives with respect to the `N`
//! inputs of one equation. Evaluating an equation with dual numbers gives its
//! exact Jacobian beside its value, in every lane.
//!
//! Most intermediate results of an equation depend on one or two of its inputs.
//! A [`Partial`] records whether it is zero or one for all values. In an inlined
//! equation the compiler knows this too and removes products with zero or one.
//! The outputs also show which inputs they do not depend on at all.

use crate::scalar::{Scalar, lit};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A partial derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Partial<V> {
    /// Zero, whatever the inputs are.
    Zero,
    /// One, whatever the inputs are.
    One,
    /// Any number.
    Number(V),
}

use Partial::{Number, One, Zero};

impl<V: Scalar<Base = V>> Partial<V> {
    /// The derivative as a number.
    #[inline(always)]
    pub(crate) fn number(self) -> V {
        match self {
            Zero => V::constant(0.0),
            One => V::constant(1.0),
            Number(number) => number,
        }
    }

    #[inline(always)]
    fn times(self, factor: V) -> Self {
        match self {
            Zero => Zero,
            One => Number(factor),
            Number(number) => Number(number * factor),
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        match (self, other) {
            (Zero, other) => other,
            (_, Zero) => self,
            _ => Number(self.number() + other.number()),
        }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        match (self, other) {
            (Zero, other) => other.negative(),
            (_, Zero) => self,
            _ => Number(self.number() - other.number()),
        }
    }

    #[inline(always)]
    fn negative(self) -> Self {
        match self {
            Zero => Zero,
            _ => Number(-self.number()),
        }
    }

    #[inline(always)]
    fn select(mask: V::Mask, yes: Self, no: Self) -> Self {
        match (yes, no) {
            (Zero, Zero) => Zero,
            (One, One) => One,
            _ => Number(V::select(mask, yes.number(), no.number())),
        }
    }
}

/// A value with `N` partial derivatives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dual<V, const N: usize> {
    /// The value.
    pub(crate) value: V,
    /// The partial derivatives with respect to the `N` inputs.
    pub(crate) partials: [Partial<V>; N],
}

/// Combines the partial derivatives of two numbers into those of the result. This is a macro because
/// a closure that the compiler does not inline is compiled without the lanes' instruction set.
macro_rules! combined {
    ($first:expr, $second:expr, |$a:ident, $b:ident| $result:expr) => {{
        let mut partials = $first.partials;
        for i in 0..N {
            let ($a, $b) = ($first.partials[i], $second.partials[i]);
            partials[i] = $result;
        }
        partials
    }};
}

impl<V: Scalar<Base = V>, const N: usize> Dual<V, N> {
    /// The `index`-th input: its derivative with respect to itself is one.
    #[inline(always)]
    pub(crate) fn input(value: V, index: usize) -> Self {
        let mut partials = [Zero; N];
        partials[index] = One;
        Self { value, partials }
    }

    /// The chain rule, for a function's value and its derivative at this number.
    #[inline(always)]
    fn chain(self, value: V, derivative: V) -> Self {
        Self { value, partials: combined!(self, self, |a, _b| a.times(derivative)) }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Add for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, partials: combined!(self, other, |a, b| a.plus(b)) }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Sub for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            partials: combined!(self, other, |a, b| a.minus(b)),
        }
    }
}

// The product rule adds, the quotient rule multiplies by a reciprocal.
#[allow(clippy::suspicious_arithmetic_impl)]
impl<V: Scalar<Base = V>, const N: usize> Mul for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            partials: combined!(self, other, |a, b| {
                a.times(other.value).plus(b.times(self.value))
            }),
        }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Div for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        let reciprocal = V::constant(1.0) / other.value;
        Self {
            value: quotient,
            partials: combined!(self, other, |a, b| {
                a.minus(b.times(quotient)).times(reciprocal)
            }),
        }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Neg for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, partials: combined!(self, self, |a, _b| a.negative()) }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Add<V> for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: V) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Sub<V> for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: V) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Mul<V> for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: V) -> Self {
        self.chain(self.value * other, other)
    }
}

impl<V: Scalar<Base = V>, const N: usize> Div<V> for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: V) -> Self {
        self.chain(self.value / other, V::constant(1.0) / other)
    }
}

impl<V: Scalar<Base = V>, const N: usize> Scalar for Dual<V, N> {
    type Base = V;
    type Mask = V::Mask;

    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::from_base(V::constant(value))
    }
    #[inline(always)]
    fn from_base(value: V) -> Self {
        Self { value, partials: [Zero; N] }
    }
    #[inline(always)]
    fn base(self) -> V {
        self.value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, lit::<V>(0.5) / root)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.chain(self.value.abs(), self.sign())
    }
    #[inline(always)]
    fn less(self, other: Self) -> V::Mask {
        self.value.less(other.value)
    }
    #[inline(always)]
    fn select(mask: V::Mask, yes: Self, no: Self) -> Self {
        Self {
            value: V::select(mask, yes.value, no.value),
            partials: combined!(yes, no, |a, b| Partial::select(mask, a, b)),
        }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        let value = self.value.exp2();
        self.chain(value, value * lit::<V>(core::f64::consts::LN_2))
    }
    #[inline(always)]
    fn log2(self) -> Self {
        self.chain(self.value.log2(), lit::<V>(core::f64::consts::LOG2_E) / self.value)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let value = self.value.tanh();
        self.chain(value, V::constant(1.0) - value * value)
    }
    #[inline(always)]
    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }
    #[inline(always)]
    fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }
}
