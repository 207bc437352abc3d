//! Numbers that carry their derivatives.
//!
//! `Dual<V, N>` is a value and its partial derivatives with respect to the `N`
//! inputs of one equation. Evaluating an equation with dual numbers gives its
//! exact Jacobian beside its value, in every lane.

use crate::scalar::{Scalar, lit};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A value with `N` partial derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Dual<V, const N: usize> {
    /// The value.
    pub value: V,
    /// The partial derivatives with respect to the `N` inputs.
    pub partials: [V; N],
}

/// The partial derivatives of a result from those of two numbers. A closure
/// would be compiled without the instruction set of the lanes where the compiler
/// does not inline it.
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
    pub fn input(value: V, index: usize) -> Self {
        let mut partials = [V::constant(0.0); N];
        partials[index] = V::constant(1.0);
        Self { value, partials }
    }

    /// The chain rule: a function's value and its derivative here.
    #[inline(always)]
    fn chain(self, value: V, derivative: V) -> Self {
        Self { value, partials: combined!(self, self, |a, _b| a * derivative) }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Add for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, partials: combined!(self, other, |a, b| a + b) }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Sub for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, partials: combined!(self, other, |a, b| a - b) }
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
            partials: combined!(self, other, |a, b| a * other.value + b * self.value),
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
            partials: combined!(self, other, |a, b| (a - quotient * b) * reciprocal),
        }
    }
}

impl<V: Scalar<Base = V>, const N: usize> Neg for Dual<V, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, partials: combined!(self, self, |a, _b| -a) }
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
        Self { value, partials: [V::constant(0.0); N] }
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
            partials: combined!(yes, no, |a, b| V::select(mask, a, b)),
        }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.value.ln(), V::constant(1.0) / self.value)
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
