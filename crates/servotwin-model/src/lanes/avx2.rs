//! Four lanes in a 256-bit register.

use super::{base_scalar, bits, operator};
use crate::scalar::{Lanes, Primitive, Scalar, Work};
use core::arch::x86_64::*;

/// Four lanes of AVX2.
///
/// Values are created only inside [`super::dispatch`], which has checked that the
/// processor has AVX2. This makes the intrinsics below sound.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Avx2(__m256d);

operator!(Avx2, Add, add, _mm256_add_pd);
operator!(Avx2, Sub, sub, _mm256_sub_pd);
operator!(Avx2, Mul, mul, _mm256_mul_pd);
operator!(Avx2, Div, div, _mm256_div_pd);

impl core::ops::Neg for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
}

impl Scalar for Avx2 {
    base_scalar!();
    type Mask = __m256d;

    #[inline(always)]
    fn constant(value: f64) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_set1_pd(value) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> __m256d {
        // SAFETY: see the type.
        unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: see the type. The instruction treats equal numbers and NaN as the
        // trait requires.
        Self(unsafe { _mm256_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn select(mask: __m256d, yes: Self, no: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, mask) })
    }
}

#[inline(always)]
fn integers(value: u64) -> __m256i {
    // SAFETY: called with values of the type only.
    unsafe { _mm256_set1_epi64x(value as i64) }
}

impl Primitive for Avx2 {
    #[inline(always)]
    fn round(self) -> Self {
        (self + Self::constant(bits::ROUNDING)) - Self::constant(bits::ROUNDING)
    }
    #[inline(always)]
    fn scale_by_power_of_two(self, exponent: Self) -> Self {
        let held = exponent + Self::constant(bits::ROUNDING);
        // SAFETY: see the type.
        let factor = Self(unsafe {
            let shifted = _mm256_slli_epi64::<52>(_mm256_castpd_si256(held.0));
            _mm256_castsi256_pd(_mm256_add_epi64(shifted, integers(bits::ONE)))
        });
        self * factor
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        // SAFETY: see the type.
        unsafe {
            let moved = _mm256_add_epi64(
                _mm256_castpd_si256(self.0),
                integers(bits::ONE - bits::ROOT_HALF),
            );
            let mantissa = _mm256_add_epi64(
                _mm256_and_si256(moved, integers(bits::MANTISSA)),
                integers(bits::ROOT_HALF),
            );
            let exponent = _mm256_or_si256(_mm256_srli_epi64::<52>(moved), integers(bits::INTEGER));
            (
                Self(_mm256_castsi256_pd(mantissa)),
                Self(_mm256_castsi256_pd(exponent)) - Self::constant(bits::INTEGER_AND_BIAS),
            )
        }
    }
}

// SAFETY: `repr(transparent)` over its numbers.
unsafe impl Lanes for Avx2 {
    const WIDTH: usize = 4;

    #[inline(always)]
    fn from_fn(f: impl FnMut(usize) -> f64) -> Self {
        let values: [f64; 4] = core::array::from_fn(f);
        // SAFETY: see the type; the array has four values.
        Self(unsafe { _mm256_loadu_pd(values.as_ptr()) })
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        let mut values = [0.0; 4];
        // SAFETY: see the type; the array has four values.
        unsafe { _mm256_storeu_pd(values.as_mut_ptr(), self.0) };
        values[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        *self = Self::from_fn(|i| if i == lane { value } else { self.lane(i) });
    }

    fn with_target_features<W: Work<Self>>(work: W) -> W::Output {
        #[inline(never)]
        #[target_feature(enable = "avx2")]
        fn with_features<V, W: Work<V>>(work: W) -> W::Output {
            work.run()
        }
        // SAFETY: see the type.
        unsafe { with_features::<Self, W>(work) }
    }
}
