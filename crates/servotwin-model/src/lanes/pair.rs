//! Lanes of two registers.
//!
//! Two registers with the same work hide each other's latency and share the
//! reading of every list of slots. The code has no closures: a closure that is not
//! inlined is compiled without the instruction set.

use super::base_scalar;
use crate::scalar::{Lanes, Primitive, Scalar, Work};

/// Two registers side by side.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Pair<V>(V, V);

macro_rules! pair_operator {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl<V: Lanes> core::ops::$trait for Pair<V> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0 $operator other.0, self.1 $operator other.1)
            }
        }
    };
}
pair_operator!(Add, add, +);
pair_operator!(Sub, sub, -);
pair_operator!(Mul, mul, *);
pair_operator!(Div, div, /);

impl<V: Lanes> core::ops::Neg for Pair<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl<V: Lanes> Scalar for Pair<V> {
    base_scalar!();
    type Mask = (V::Mask, V::Mask);

    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self(V::constant(value), V::constant(value))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), self.1.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs(), self.1.abs())
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        (self.0.less(other.0), self.1.less(other.1))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.min(other.1))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.max(other.1))
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(V::select(mask.0, yes.0, no.0), V::select(mask.1, yes.1, no.1))
    }
}

impl<V: Lanes> Primitive for Pair<V> {
    #[inline(always)]
    fn round(self) -> Self {
        Self(self.0.round(), self.1.round())
    }
    #[inline(always)]
    fn scale_by_power_of_two(self, exponent: Self) -> Self {
        Self(self.0.scale_by_power_of_two(exponent.0), self.1.scale_by_power_of_two(exponent.1))
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        let (a, b) = (self.0.split_exponent(), self.1.split_exponent());
        (Self(a.0, b.0), Self(a.1, b.1))
    }
}

// SAFETY: `repr(C)`, two values of one type.
unsafe impl<V: Lanes> Lanes for Pair<V> {
    const WIDTH: usize = 2 * V::WIDTH;
    type Register = V;

    #[inline(always)]
    fn from_fn(mut f: impl FnMut(usize) -> f64) -> Self {
        Self(V::from_fn(&mut f), V::from_fn(|lane| f(V::WIDTH + lane)))
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        if lane < V::WIDTH { self.0.lane(lane) } else { self.1.lane(lane - V::WIDTH) }
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        if lane < V::WIDTH {
            self.0.set_lane(lane, value);
        } else {
            self.1.set_lane(lane - V::WIDTH, value);
        }
    }

    #[inline(always)]
    fn with_target_features<W: Work<Self>>(work: W) -> W::Output {
        V::with_target_features(ForPair(work))
    }
}

/// Work for a pair, done in a function compiled for the single register's instruction set.
struct ForPair<W>(W);

impl<V, W: Work<Pair<V>>> Work<V> for ForPair<W> {
    type Output = W::Output;
    #[inline(always)]
    fn run(self) -> W::Output {
        self.0.run()
    }
}
