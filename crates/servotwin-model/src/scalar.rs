//! The number that every equation is written for.
//!
//! An equation is one generic text. The type that it is called with decides what runs:
//!
//! | type | use |
//! |---|---|
//! | `f64` | constants of a variant, single runs |
//! | [`crate::lanes`] | ensembles: one variant per SIMD lane |
//! | `crate::dual::Dual` | the exact Jacobian of the implicit solver |
//! | [`crate::symbol::Symbol`] | the C source of the same equations |
//!
//! Only operations that IEEE 754 rounds correctly are primitive (`+ − × ÷ √`,
//! comparison, selection, rounding to an integer and scaling by a power of
//! two). Nothing fuses a product with a sum, so lanes equal scalars bit for bit
//! on every machine. The transcendental functions are built from the primitives
//! in [`crate::math`], once for all types.
//!
//! There is no data-dependent `if` in an equation: [`Scalar::select`],
//! [`Scalar::min`] and [`Scalar::max`] take its place.

use core::ops::{Add, Div, Mul, Neg, Sub};
use core::slice;

/// A number that an equation can be evaluated with.
///
/// `Base` is the type without derivatives: a dual number's plain value.
/// Numbers that do not depend on the state (a component's constants) are passed as `Base`,
/// so that they carry no derivatives.
pub trait Scalar:
    Copy
    + Add<Self, Output = Self>
    + Sub<Self, Output = Self>
    + Mul<Self, Output = Self>
    + Div<Self, Output = Self>
    + Neg<Output = Self>
    + Add<<Self as Scalar>::Base, Output = Self>
    + Sub<<Self as Scalar>::Base, Output = Self>
    + Mul<<Self as Scalar>::Base, Output = Self>
    + Div<<Self as Scalar>::Base, Output = Self>
{
    /// The number without derivatives.
    type Base: Scalar<Base = Self::Base, Mask = Self::Mask>;
    /// The result of a comparison, one truth value per lane.
    type Mask: Copy;

    /// The same constant in every lane.
    fn constant(value: f64) -> Self;
    /// A number whose derivatives are zero.
    fn from_base(value: Self::Base) -> Self;
    /// The number without its derivatives.
    fn base(self) -> Self::Base;
    /// Square root; NaN below zero.
    fn sqrt(self) -> Self;
    /// Absolute value; the derivative at zero is taken from the right.
    fn abs(self) -> Self;
    /// `self < other`, false where either is NaN.
    fn less(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// `e^self`.
    fn exp(self) -> Self;
    /// `2^self` for |self| ≤ 1000.
    fn exp2(self) -> Self;
    /// Binary logarithm of a positive, normal number.
    fn log2(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Sine of an angle within ±π.
    fn sin(self) -> Self;
    /// Cosine of an angle within ±π.
    fn cos(self) -> Self;

    /// −1 where negative, else 1.
    #[inline(always)]
    fn sign(self) -> Self::Base {
        self.signed(<Self::Base as Scalar>::constant(1.0))
    }

    /// A magnitude with the sign of [`Scalar::sign`].
    #[inline(always)]
    fn signed(self, magnitude: Self::Base) -> Self::Base {
        let negative = self.base().less(<Self::Base as Scalar>::constant(0.0));
        <Self::Base as Scalar>::select(negative, -magnitude, magnitude)
    }

    /// The smaller of two numbers; `other` where they are equal.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(self.less(other), self, other)
    }

    /// The larger of two numbers; `other` where they are equal.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(other.less(self), self, other)
    }

    /// `self` limited to `low ..= high`.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }
}

/// A literal inside an equation: a number without derivatives.
#[inline(always)]
pub(crate) fn lit<S: Scalar>(value: f64) -> S::Base {
    <S::Base as Scalar>::constant(value)
}

/// A [`Scalar`] with no derivatives that also has the bit-level primitives the
/// transcendental functions are made of.
pub trait Primitive: Scalar<Base = Self> {
    /// The nearest integer, ties to even, for |self| < 2⁵¹.
    fn round(self) -> Self;
    /// `self × 2^exponent` for an integral exponent within ±1000.
    fn scale_by_power_of_two(self, exponent: Self) -> Self;
    /// `(m, e)` with `self = m × 2^e`, `m` in `[√½, √2)` and integral `e`, for
    /// positive normal numbers.
    fn split_exponent(self) -> (Self, Self);
}

/// Work on lanes of one type; see [`Lanes::with_target_features`].
pub trait Work<V> {
    /// The result of the work.
    type Output;
    /// Does the work. Implementations are `#[inline(always)]`.
    fn run(self) -> Self::Output;
}

/// Several independent numbers, one for each variant.
///
/// `f64` is the case of one lane.
///
/// # Safety
/// An implementation is laid out as its `WIDTH` numbers in order, and nothing else.
pub unsafe trait Lanes: Primitive {
    /// Number of variants side by side.
    const WIDTH: usize;

    /// The lanes `f(0), f(1), …`.
    fn from_fn(f: impl FnMut(usize) -> f64) -> Self;
    /// The value of one lane. Panics where `lane >= WIDTH`.
    fn lane(self, lane: usize) -> f64;
    /// Replaces the value of one lane. Panics where `lane >= WIDTH`.
    fn set_lane(&mut self, lane: usize, value: f64);
    /// The numbers of a slice, lane by lane.
    #[inline(always)]
    fn numbers(lanes: &[Self]) -> &[f64] {
        // SAFETY: promised by the implementation.
        unsafe { slice::from_raw_parts(lanes.as_ptr().cast(), lanes.len() * Self::WIDTH) }
    }
    /// Does the work in a separate function, compiled for the instruction set of these lanes.
    ///
    /// All other lane code is inlined into its caller, because only then does the compiler use
    /// the instruction set. Use this for large work that several places call.
    fn with_target_features<W: Work<Self>>(work: W) -> W::Output;
}
