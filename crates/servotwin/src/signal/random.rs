//! Random numbers that are the same on every machine.
//!
//! xoshiro256++ (Blackman and Vigna, "Scrambled linear pseudorandom number
//! generators", ACM TOMS 47, 2021), its state filled by splitmix64, and normal
//! deviates by Box and Muller (1958) with the toolkit's own `ln` and `sin_cos`.

use servotwin_model::math::{ln, sin_cos};
use std::f64::consts::PI;

/// A generator of random numbers.
pub struct Random {
    state: [u64; 4],
    /// The second of a pair of normal deviates.
    spare: Option<f64>,
}

impl Random {
    /// A generator whose numbers depend on the seed alone.
    pub fn new(seed: u64) -> Self {
        let mut counter = seed;
        let state = std::array::from_fn(|_| splitmix(&mut counter));
        Self { state, spare: None }
    }

    /// The next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let [a, b, c, d] = self.state;
        let result = a.wrapping_add(d).rotate_left(23).wrapping_add(a);
        let (c, d) = (c ^ a, d ^ b);
        self.state = [a ^ d, b ^ c, c ^ (b << 17), d.rotate_left(45)];
        result
    }

    /// Uniform in (0, 1].
    pub fn uniform(&mut self) -> f64 {
        ((self.bits() >> 11) + 1) as f64 / (1_u64 << 53) as f64
    }

    /// Normal with mean 0 and variance 1.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0_f64 * ln(self.uniform())).sqrt();
        let (sin, cos) = sin_cos(PI * (2.0 * self.uniform() - 1.0));
        self.spare = Some(radius * sin);
        radius * cos
    }
}

fn splitmix(counter: &mut u64) -> u64 {
    *counter = counter.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*counter ^ (*counter >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splitmix_gives_its_published_sequence() {
        // The first values for seed 1234567 of the reference implementation.
        let mut counter = 1_234_567;
        let values: [u64; 3] = std::array::from_fn(|_| splitmix(&mut counter));
        assert_eq!(
            values,
            [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]
        );
    }

    #[test]
    fn xoshiro_gives_its_published_sequence() {
        // The reference implementation started with the state 1, 2, 3, 4.
        let mut random = Random { state: [1, 2, 3, 4], spare: None };
        let values: [u64; 4] = std::array::from_fn(|_| random.bits());
        assert_eq!(values, [41_943_041, 58_720_359, 3_588_806_011_781_223, 3_591_011_842_654_386]);
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
