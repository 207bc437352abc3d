//! Normal deviates that are the same on every machine: by Box and Muller (1958)
//! with the toolkit's own `ln` and `sin_cos`, from the generator of
//! [`servotwin_diagnosis::random`].

use servotwin_model::lanes::{Kernel, Level, dispatch};
use servotwin_model::math::{ln, sin_cos};
use servotwin_model::scalar::Lanes;
use std::f64::consts::PI;

/// A generator of random numbers.
pub struct Random {
    bits: servotwin_diagnosis::random::Random,
    /// The second of a pair of normal deviates.
    spare: Option<f64>,
}

impl Random {
    /// A generator whose numbers depend on the seed alone.
    pub fn new(seed: u64) -> Self {
        Self { bits: servotwin_diagnosis::random::Random::new(seed), spare: None }
    }

    /// Uniform in (0, 1].
    pub fn uniform(&mut self) -> f64 {
        ((self.bits.next_u64() >> 11) + 1) as f64 / (1_u64 << 53) as f64
    }

    /// Normal with mean 0 and variance 1.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let (first, second) = (self.uniform(), self.uniform());
        let (cos, sin) = deviates(first, second);
        self.spare = Some(sin);
        cos
    }
}

/// A source of many normal deviates: those of [`Random::normal`], in the same
/// order, made in lanes.
pub struct Normals {
    random: Random,
    level: Level,
    ready: [f64; READY],
    next: usize,
}

/// Deviates made at once.
const READY: usize = 128;

impl Normals {
    /// The deviates of a generator.
    pub fn new(random: Random) -> Self {
        Self { random, level: Level::best(), ready: [0.0; READY], next: READY }
    }

    /// The next deviate.
    pub fn draw(&mut self) -> f64 {
        if self.next == READY {
            dispatch(self.level, Refill { random: &mut self.random, ready: &mut self.ready });
            self.next = 0;
        }
        let value = self.ready[self.next];
        self.next += 1;
        value
    }
}

struct Refill<'a> {
    random: &'a mut Random,
    ready: &'a mut [f64; READY],
}

impl Kernel for Refill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes>(self) {
        for pairs in self.ready.chunks_exact_mut(2 * V::WIDTH) {
            let mut uniform = [[0.0; 2]; READY];
            for pair in &mut uniform[..V::WIDTH] {
                *pair = [self.random.uniform(), self.random.uniform()];
            }
            let [first, second] = [0, 1].map(|i| V::from_fn(|lane| uniform[lane][i]));
            let (cos, sin) = deviates(first, second);
            for (lane, pair) in pairs.chunks_exact_mut(2).enumerate() {
                pair[0] = cos.lane(lane);
                pair[1] = sin.lane(lane);
            }
        }
    }
}

/// Two normal deviates from two uniform ones: Box and Muller.
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
        let mut one_by_one = Random::new(5);
        for level in servotwin_model::lanes::ALL.into_iter().filter(|level| level.available()) {
            let mut normals = Normals { level, ..Normals::new(Random::new(5)) };
            let mut one_by_one = Random::new(5);
            for _ in 0..3 * READY {
                assert_eq!(normals.draw(), one_by_one.normal(), "{}", level.name());
            }
        }
        assert_ne!(one_by_one.normal(), Normals::new(Random::new(6)).draw());
    }

    #[test]
    fn normal_deviates_have_their_moments() {
        let mut random = Random::new(3);
        let n = 200_000;
        let values: Vec<f64> = (0..n).map(|_| random.normal()).collect();
        let moment = |k: i32| values.iter().map(|v| v.powi(k)).sum::<f64>() / f64::from(n);
        // Three standard errors of each.
        assert!(moment(1).abs() < 0.007);
        assert!((moment(2) - 1.0).abs() < 0.01);
        assert!(moment(3).abs() < 0.026);
        assert!((moment(4) - 3.0).abs() < 0.066);
    }
}
