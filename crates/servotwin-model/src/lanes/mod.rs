//! Several variants side by side in one register.
//!
//! [`Level`] lists the instruction sets. [`dispatch`] runs a [`Kernel`] with the
//! lanes of a level. All levels return the same bits: see [`crate::scalar`].

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;
mod single;

use crate::scalar::Lanes;
pub(crate) use portable::Portable;

// Private, because their values may exist only where the processor supports them.
#[cfg(target_arch = "x86_64")]
use {avx2::Avx2, avx512::Avx512};

/// An instruction set for lanes, with their number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// One lane, as for the twin beside an actuator; runs on every machine.
    Single,
    /// Plain arrays of four; runs on every machine.
    Portable,
    /// Four lanes of 256 bits.
    Avx2,
    /// Eight lanes of 512 bits.
    Avx512,
}

/// Every level, from the slowest for runs to the fastest.
pub const ALL: [Level; 4] = [Level::Single, Level::Portable, Level::Avx2, Level::Avx512];

impl Level {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Level::Single => "single",
            Level::Portable => "portable",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
        }
    }

    /// Number of variants side by side.
    pub fn width(self) -> usize {
        match self {
            Level::Single => 1,
            Level::Portable | Level::Avx2 => 4,
            Level::Avx512 => 8,
        }
    }

    /// Number of variants in a register.
    pub fn register_width(self) -> usize {
        match self {
            Level::Single | Level::Portable => 1,
            Level::Avx2 => 4,
            Level::Avx512 => 8,
        }
    }

    /// Whether this processor supports the level.
    ///
    /// The processor itself reports it. Processors other than x86-64 have only single and portable lanes.
    pub fn available(self) -> bool {
        match self {
            Level::Single | Level::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => detected::AVX2.get(detected::avx2),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => detected::AVX512.get(detected::avx512),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The fastest level of this processor.
    pub fn best() -> Level {
        let mut best = Level::Portable;
        for level in [Level::Avx2, Level::Avx512] {
            if level.available() {
                best = level;
            }
        }
        best
    }

    /// The level with a faster step and fewer lanes. A step with half the lanes is not enough faster to justify a
    /// further change.
    pub fn narrower(self) -> Option<Level> {
        match self {
            Level::Avx512 => Some(Level::Avx2).filter(|level| level.available()),
            Level::Avx2 | Level::Portable | Level::Single => None,
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod detected {
    //! Queries the processor itself (`cpuid`, `xgetbv`), because `core` has no
    //! run-time detection.
    use core::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};
    use core::sync::atomic::{AtomicU8, Ordering::Relaxed};

    /// A result that is queried only once, because `cpuid` takes tens of microseconds
    /// on a virtual machine.
    pub(crate) struct Once(AtomicU8);

    pub(crate) static AVX2: Once = Once(AtomicU8::new(0));
    pub(crate) static AVX512: Once = Once(AtomicU8::new(0));

    impl Once {
        /// The stored result; queries it if unknown (0 is unknown, 1 is no, 2 is yes).
        pub(crate) fn get(&self, ask: fn() -> bool) -> bool {
            if self.0.load(Relaxed) == 0 {
                self.0.store(1 + u8::from(ask()), Relaxed);
            }
            self.0.load(Relaxed) == 2
        }
    }

    #[target_feature(enable = "xsave")]
    fn enabled_state() -> u64 {
        // SAFETY: only called where cpuid reports OSXSAVE.
        unsafe { _xgetbv(0) }
    }

    fn saved_by_the_system(state: u64) -> bool {
        if __cpuid(0).eax < 7 || __cpuid(1).ecx & (1 << 27) == 0 {
            return false;
        }
        // SAFETY: bit 27 shows that the system enabled XSAVE and XGETBV.
        unsafe { enabled_state() & state == state }
    }

    pub(crate) fn avx2() -> bool {
        saved_by_the_system(0b110) && __cpuid_count(7, 0).ebx & (1 << 5) != 0
    }

    pub(crate) fn avx512() -> bool {
        const F: u32 = 1 << 16;
        const DQ: u32 = 1 << 17;
        saved_by_the_system(0b1110_0110) && __cpuid_count(7, 0).ebx & (F | DQ) == F | DQ
    }
}

/// Work that runs with lanes of any level.
pub trait Kernel {
    /// The result of the work.
    type Output;
    /// Does the work. Implementations are `#[inline(always)]`, down to every
    /// equation, so that all of it is compiled for the instruction set.
    fn run<V: Lanes>(self) -> Self::Output;
}

/// Runs a kernel with lanes of a level.
///
/// # Panics
/// If the processor does not support the level.
pub fn dispatch<K: Kernel>(level: Level, kernel: K) -> K::Output {
    assert!(level.available(), "this processor has no {} lanes", level.name());
    match level {
        Level::Single => kernel.run::<f64>(),
        Level::Portable => kernel.run::<Portable>(),
        // SAFETY: the level is available.
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => unsafe { run_avx2(kernel) },
        // SAFETY: the level is available.
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => unsafe { run_avx512(kernel) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => unreachable!(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

/// The part of [`Scalar`](crate::scalar::Scalar) that is the same for all
/// types without derivatives: the transcendental functions and the conversions
/// to and from `Base`.
macro_rules! base_scalar {
    () => {
        type Base = Self;

        #[inline(always)]
        fn from_base(value: Self) -> Self {
            value
        }
        #[inline(always)]
        fn base(self) -> Self {
            self
        }
        #[inline(always)]
        fn exp(self) -> Self {
            $crate::math::exp(self)
        }
        #[inline(always)]
        fn exp2(self) -> Self {
            $crate::math::exp2(self)
        }
        #[inline(always)]
        fn log2(self) -> Self {
            $crate::math::log2(self)
        }
        #[inline(always)]
        fn tanh(self) -> Self {
            $crate::math::tanh(self)
        }
        #[inline(always)]
        fn sin(self) -> Self {
            $crate::math::sin_cos(self).0
        }
        #[inline(always)]
        fn cos(self) -> Self {
            $crate::math::sin_cos(self).1
        }
    };
}

/// Implements one operator of a register type by its intrinsic.
#[cfg(target_arch = "x86_64")]
macro_rules! operator {
    ($type:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl core::ops::$trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: values of this type exist only inside `dispatch`.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

use base_scalar;
#[cfg(target_arch = "x86_64")]
use operator;

/// Constants for the bit operations of all types.
mod bits {
    /// 1.5 × 2⁵²: adding it rounds to an integer held in the low bits.
    pub(crate) const ROUNDING: f64 = 6_755_399_441_055_744.0;
    /// The exponent field of 1.0.
    pub(crate) const ONE: u64 = 0x3ff0_0000_0000_0000;
    /// √½, the lower end of the mantissas that `split_exponent` returns.
    pub(crate) const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    /// The bits below the exponent.
    pub(crate) const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
    /// 2⁵²: its low bits hold a small non-negative integer.
    pub(crate) const INTEGER: u64 = 0x4330_0000_0000_0000;
    /// 2⁵² plus the exponent's bias.
    pub(crate) const INTEGER_AND_BIAS: f64 = 4_503_599_627_370_496.0 + 1023.0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// Applies the operations that some levels implement with special instructions to a pair of numbers.
    struct Chosen(f64, f64);

    impl Kernel for Chosen {
        type Output = Vec<u64>;
        fn run<V: Lanes>(self) -> Vec<u64> {
            let (a, b) = (V::constant(self.0), V::constant(self.1));
            let scaled = a.scale_by_power_of_two(V::constant(-37.0));
            let mantissa = a.split_exponent().0;
            let results = [a.min(b), a.max(b), b.min(a), b.max(a), scaled, a.round(), mantissa];
            results.iter().map(|r| r.lane(V::WIDTH - 1).to_bits()).collect()
        }
    }

    #[test]
    fn every_level_chooses_and_scales_as_single_numbers_do() {
        let numbers = [0.0, -0.0, 1.5, -2.5, 1e300, 3e-290, f64::NAN, f64::INFINITY];
        for (a, b) in numbers.iter().flat_map(|&a| numbers.map(|b| (a, b))) {
            let single = Chosen(a, b).run::<f64>();
            for level in ALL.into_iter().filter(|level| level.available()) {
                let lanes = dispatch(level, Chosen(a, b));
                let same = |i: usize| {
                    let both_nan =
                        f64::from_bits(lanes[i]).is_nan() && f64::from_bits(single[i]).is_nan();
                    both_nan || lanes[i] == single[i]
                };
                assert!((0..single.len()).all(same), "{a} {b} {}", level.name());
            }
        }
    }
}
