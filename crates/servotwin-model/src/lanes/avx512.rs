//! Eight lanes in a 512-bit register.

use super::{base_scalar, bits, operator};
use crate::scalar::{Lanes, Primitive, Scalar, Work};
use core::arch::x86_64::*;

/// Eight lanes of AVX-512 (F and DQ).
///
/// Values are created only inside [`super::dispatch`], which has checked that the
/// processor has AVX-512. This makes the intrinsics below sound.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Avx512(__m512d);

operator!(Avx512, Add, add, _mm512_add_pd);
operator!(Avx512, Sub, sub, _mm512_sub_pd);
operator!(Avx512, Mul, mul, _mm512_mul_pd);
operator!(Avx512, Div, div, _mm512_div_pd);

impl core::ops::Neg for Avx512 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm512_xor_pd(self.0, _mm512_set1_pd(-0.0)) })
    }
}

impl Scalar for Avx512 {
    base_scalar!();
    type Mask = __mmask8;

    #[inline(always)]
    fn constant(value: f64) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm512_set1_pd(value) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm512_andnot_pd(_mm512_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> __mmask8 {
        // SAFETY: see the type.
        unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: see the type. The instruction treats equal numbers and NaN as the
        // trait requires.
        Self(unsafe { _mm512_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm512_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn select(mask: __mmask8, yes: Self, no: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm512_mask_blend_pd(mask, no.0, yes.0) })
    }
}

#[inline(always)]
fn integers(value: u64) -> __m512i {
    // SAFETY: called with values of the type only.
    unsafe { _mm512_set1_epi64(value as i64) }
}

impl Primitive for Avx512 {
    #[inline(always)]
    fn round(self) -> Self {
        (self + Self::constant(bits::ROUNDING)) - Self::constant(bits::ROUNDING)
    }
    #[inline(always)]
    fn scale_by_power_of_two(self, exponent: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm512_scalef_pd(self.0, exponent.0) })
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        // SAFETY: see the type.
        unsafe {
            let moved = _mm512_add_epi64(
                _mm512_castpd_si512(self.0),
                integers(bits::ONE - bits::ROOT_HALF),
            );
            let mantissa = _mm512_add_epi64(
                _mm512_and_si512(moved, integers(bits::MANTISSA)),
                integers(bits::ROOT_HALF),
            );
            let exponent = _mm512_or_si512(_mm512_srli_epi64::<52>(moved), integers(bits::INTEGER));
            (
                Self(_mm512_castsi512_pd(mantissa)),
                Self(_mm512_castsi512_pd(exponent)) - Self::constant(bits::INTEGER_AND_BIAS),
            )
        }
    }
}

// SAFETY: `repr(transparent)` over its numbers.
unsafe impl Lanes for Avx512 {
    const WIDTH: usize = 8;

    #[inline(always)]
    fn from_fn(f: impl FnMut(usize) -> f64) -> Self {
        let values: [f64; 8] = core::array::from_fn(f);
        // SAFETY: see the type; the array has eight values.
        Self(unsafe { _mm512_loadu_pd(values.as_ptr()) })
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        let mut values = [0.0; 8];
        // SAFETY: see the type; the array has eight values.
        unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self.0) };
        values[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        *self = Self::from_fn(|i| if i == lane { value } else { self.lane(i) });
    }

    fn with_target_features<W: Work<Self>>(work: W) -> W::Output {
        #[inline(never)]
        #[target_feature(enable = "avx512f,avx512dq")]
        fn with_features<V, W: Work<V>>(work: W) -> W::Output {
            work.run()
        }
        // SAFETY: see the type.
        unsafe { with_features::<Self, W>(work) }
    }
}
