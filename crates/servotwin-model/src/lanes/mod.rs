//! Several variants side by side in one register.
//!
//! [`Level`] names the instruction sets; [`dispatch`] runs a [`Kernel`] with the
//! widest lanes that this processor has, or with those that were asked for. All
//! levels give the same bits: see [`crate::scalar`].

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod pair;
mod portable;
mod single;

use crate::scalar::Lanes;
pub use portable::Portable;

// Not public: their values must exist only where the processor can run them.
#[cfg(target_arch = "x86_64")]
use {avx2::Avx2, avx512::Avx512, pair::Pair};

/// An instruction set that lanes can be made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// One lane, as of the twin beside an actuator: every machine.
    Single,
    /// Plain arrays of four: every machine.
    Portable,
    /// Four lanes of 256 bits.
    Avx2Once,
    /// Two times four lanes of 256 bits.
    Avx2,
    /// Eight lanes of 512 bits.
    Avx512,
    /// Two times eight lanes of 512 bits.
    Avx512Twice,
}

/// Every level, that of the slowest campaign first.
pub const ALL: [Level; 6] = [
    Level::Single,
    Level::Portable,
    Level::Avx2Once,
    Level::Avx2,
    Level::Avx512,
    Level::Avx512Twice,
];

/// Variants for each of sixteen lanes from which on these are faster in all where lists are walked: a step of
/// theirs takes longer, and at the end most of them have nothing to do.
const MANY_PER_LANE: usize = 8;

impl Level {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Level::Single => "single",
            Level::Portable => "portable",
            Level::Avx2Once => "avx2x1",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
            Level::Avx512Twice => "avx512x2",
        }
    }

    /// Variants side by side.
    pub fn width(self) -> usize {
        match self {
            Level::Single => 1,
            Level::Portable | Level::Avx2Once => 4,
            Level::Avx2 | Level::Avx512 => 8,
            Level::Avx512Twice => 16,
        }
    }

    /// How many of them a register has.
    pub fn register_width(self) -> usize {
        match self {
            Level::Single | Level::Portable => 1,
            Level::Avx2Once | Level::Avx2 => 4,
            Level::Avx512 | Level::Avx512Twice => 8,
        }
    }

    /// Whether this processor can run it.
    ///
    /// The processor itself is asked; on others than x86-64 only portable lanes are there.
    pub fn available(self) -> bool {
        match self {
            Level::Single | Level::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Level::Avx2Once | Level::Avx2 => detected::AVX2.get(detected::avx2),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 | Level::Avx512Twice => detected::AVX512.get(detected::avx512),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The level that this processor takes a step with soonest.
    pub fn best() -> Level {
        let mut best = Level::Portable;
        for level in [Level::Avx2, Level::Avx512] {
            if level.available() {
                best = level;
            }
        }
        best
    }

    /// The level that takes a step sooner, of fewer variants. Half as many lanes are not so much sooner that they
    /// would be worth another change.
    pub fn narrower(self) -> Option<Level> {
        match self {
            Level::Avx512Twice | Level::Avx512 | Level::Avx2 => {
                Some(Level::Avx2Once).filter(|level| level.available())
            }
            Level::Avx2Once | Level::Portable | Level::Single => None,
        }
    }

    /// The level that is soonest where steps are compiled and this one is where lists are walked: two registers share
    /// the time that it takes to walk a list, but straight lines of C do with half the memory in one.
    pub fn compiled(self) -> Level {
        match self {
            Level::Avx2 => Level::Avx2Once,
            level => level,
        }
    }

    /// The level that is through with as many variants soonest, where this one is the
    /// best.
    pub fn for_many(self, variants: usize) -> Level {
        match self {
            Level::Avx512 if variants >= MANY_PER_LANE * Level::Avx512Twice.width() => {
                Level::Avx512Twice
            }
            level => level,
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod detected {
    //! Asks the processor itself (`cpuid`, `xgetbv`), because `core` has no
    //! run-time detection.
    use core::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};
    use core::sync::atomic::{AtomicU8, Ordering::Relaxed};

    /// An answer that is asked for once: on a virtual machine `cpuid` takes tens
    /// of microseconds.
    pub struct Once(AtomicU8);

    pub static AVX2: Once = Once(AtomicU8::new(0));
    pub static AVX512: Once = Once(AtomicU8::new(0));

    impl Once {
        /// The answer, asking where it is not known (0; 1 is no, 2 is yes).
        pub fn get(&self, ask: fn() -> bool) -> bool {
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
        // SAFETY: bit 27 says that the system enabled XSAVE and XGETBV.
        unsafe { enabled_state() & state == state }
    }

    pub fn avx2() -> bool {
        saved_by_the_system(0b110) && __cpuid_count(7, 0).ebx & (1 << 5) != 0
    }

    pub fn avx512() -> bool {
        const F: u32 = 1 << 16;
        const DQ: u32 = 1 << 17;
        saved_by_the_system(0b1110_0110) && __cpuid_count(7, 0).ebx & (F | DQ) == F | DQ
    }
}

/// Work that can be done with lanes of any kind.
pub trait Kernel {
    /// What comes out.
    type Output;
    /// Does the work. Implementations are `#[inline(always)]`, down to every
    /// equation, so that the whole is compiled for the instruction set.
    fn run<V: Lanes>(self) -> Self::Output;
}

/// Runs a kernel with lanes of a level.
///
/// # Panics
/// Where the processor does not have the level.
pub fn dispatch<K: Kernel>(level: Level, kernel: K) -> K::Output {
    assert!(level.available(), "this processor has no {} lanes", level.name());
    match level {
        Level::Single => kernel.run::<f64>(),
        Level::Portable => kernel.run::<Portable>(),
        // SAFETY: the level is available.
        #[cfg(target_arch = "x86_64")]
        Level::Avx2Once => unsafe { run_avx2_once(kernel) },
        // SAFETY: the level is available.
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => unsafe { run_avx2(kernel) },
        // SAFETY: the level is available.
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => unsafe { run_avx512(kernel) },
        // SAFETY: the level is available.
        #[cfg(target_arch = "x86_64")]
        Level::Avx512Twice => unsafe { run_avx512_twice(kernel) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => unreachable!(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2_once<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Pair<Avx2>>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn run_avx512_twice<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Pair<Avx512>>()
}

/// The parts of [`Scalar`](crate::scalar::Scalar) that are the same for all
/// types without derivatives: the transcendental functions and the mixed
/// operators' trivial conversions.
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

/// One operator of a register type by its intrinsic.
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

/// Numbers that the bit tricks of all types share.
mod bits {
    /// 1.5 × 2⁵²: adding it rounds to an integer held in the low bits.
    pub const ROUNDING: f64 = 6_755_399_441_055_744.0;
    /// The exponent field of 1.0.
    pub const ONE: u64 = 0x3ff0_0000_0000_0000;
    /// √½, the lower end of the mantissas that `split_exponent` gives.
    pub const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    /// The bits behind the exponent.
    pub const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
    /// 2⁵²: its low bits hold a small non-negative integer.
    pub const INTEGER: u64 = 0x4330_0000_0000_0000;
    /// 2⁵² plus the exponent's bias.
    pub const INTEGER_AND_BIAS: f64 = 4_503_599_627_370_496.0 + 1023.0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// What instructions of their own do in some lanes, on a pair of numbers.
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
