//! Normal deviates that are equal on every machine: the method of Box and Muller (1958), with the toolkit's own `ln`
//! and `sin_cos`, from the generator of [`servotwin_diagnosis::random`].

use servotwin_model::lanes::{Kernel, Level, dispatch};
use servotwin_model::math::{ln, sin_cos};
use servotwin_model::scalar::Lanes;
use std::f64::consts::PI;

/// Number of deviates generated at once.
const READY: usize = 128;

/// A generator of normal deviates, vectorized in lanes; results do not depend on the lanes.
pub(crate) struct NormalDeviates {
    bits: servotwin_diagnosis::random::Random,
    level: Level,
    ready: [f64; READY],
    next: usize,
}

impl NormalDeviates {
    /// A generator whose numbers depend only on the seed.
    pub(crate) fn new(seed: u64) -> Self {
        Self::of(servotwin_diagnosis::random::Random::new(seed))
    }

    /// One of many independent generators with the same seed.
    pub(crate) fn stream(seed: u64, number: u64) -> Self {
        Self::of(servotwin_diagnosis::random::Random::stream(seed, number))
    }

    fn of(bits: servotwin_diagnosis::random::Random) -> Self {
        Self { bits, level: Level::best(), ready: [0.0; READY], next: READY }
    }

    /// The next deviate, with mean 0 and variance 1.
    pub(crate) fn normal(&mut self) -> f64 {
        if self.next == READY {
            dispatch(self.level, Refill { bits: &mut self.bits, ready: &mut self.ready });
            self.next = 0;
        }
        let value = self.ready[self.next];
        self.next += 1;
        value
    }

    /// A uniform deviate in (0, 1].
    pub(crate) fn unit(&mut self) -> f64 {
        uniform(&mut self.bits)
    }
}

/// Uniform in (0, 1].
fn uniform(bits: &mut servotwin_diagnosis::random::Random) -> f64 {
    ((bits.next_u64() >> 11) + 1) as f64 / (1_u64 << 53) as f64
}

struct Refill<'a> {
    bits: &'a mut servotwin_diagnosis::random::Random,
    ready: &'a mut [f64; READY],
}

impl Kernel for Refill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes>(self) {
        for pairs in self.ready.chunks_exact_mut(2 * V::WIDTH) {
            let mut drawn = [[0.0; 2]; READY];
            for pair in &mut drawn[..V::WIDTH] {
                *pair = [uniform(self.bits), uniform(self.bits)];
            }
            let [first, second] = [0, 1].map(|i| V::from_fn(|lane| drawn[lane][i]));
            let (cos, sin) = deviates(first, second);
            for (lane, pair) in pairs.chunks_exact_mut(2).enumerate() {
                pair[0] = cos.lane(lane);
                pair[1] = sin.lane(lane);
            }
        }
    }
}

/// Two normal deviates from two uniform ones (Box and Muller).
#[inline(always)]
fn deviates<V: Lanes>(first: V, second: V) -> (V, V) {
    let radius = (ln(first) * V::constant(-2.0)).sqrt();
    let turn = second * V::constant(2.0) - V::constant(1.0);
    let (sin, cos) = sin_cos(turn * V::constant(PI));
    (radius * cos, radius * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviates_made_in_lanes_are_the_same() {
        for level in servotwin_model::lanes::ALL.into_iter().filter(|level| level.available()) {
            let mut random = NormalDeviates { level, ..NormalDeviates::new(5) };
            let mut bits = servotwin_diagnosis::random::Random::new(5);
            for _ in 0..2 * READY {
                let (cos, sin) = deviates(uniform(&mut bits), uniform(&mut bits));
                assert_eq!([random.normal(), random.normal()], [cos, sin], "{}", level.name());
            }
        }
        assert_ne!(NormalDeviates::new(5).normal(), NormalDeviates::new(6).normal());
    }

    #[test]
    fn normal_deviates_have_their_moments() {
        let mut random = NormalDeviates::new(3);
        let n = 200_000;
        let values: Vec<f64> = (0..n).map(|_| random.normal()).collect();
        let moment = |k: i32| values.iter().map(|v| v.powi(k)).sum::<f64>() / f64::from(n);
        // Limits are three standard errors.
        assert!(moment(1).abs() < 0.007);
        assert!((moment(2) - 1.0).abs() < 0.01);
        assert!(moment(3).abs() < 0.026);
        assert!((moment(4) - 3.0).abs() < 0.066);
    }
}
