//! Merges two consecutive windows into one.
//!
//! ```text
//! n = n_a + n_b,   δ = m_b − m_a
//! m = m_a + δ n_b/n
//! M = M_a + M_b + δ δᵀ n_a n_b/n
//! ```
//!
//! with m the means and M the co-moments (Chan, Golub, LeVeque, "Updating Formulae and a Pairwise Algorithm for
//! Computing Sample Variances", 1979). Nothing is ever subtracted, so no precision is lost over days of samples.

use super::{GROUP, Window};

impl Window {
    /// Adds the samples of the window that follows this one. Does not allocate.
    ///
    /// # Panics
    /// If the other window has another number of sensors.
    pub(crate) fn absorb(&mut self, later: &Window) {
        assert!(self.sensors == later.sensors && self.watched == later.watched);
        if later.count == 0 {
            return;
        }
        let count = self.count + later.count;
        // If this window is empty, the share is one and the result is exactly the other window.
        let share = later.count as f64 / count as f64;
        for ((d, mean), other) in self.deviation.iter_mut().zip(&mut self.mean).zip(&later.mean) {
            *d = other - *mean;
            *mean += *d * share;
        }
        let weight = self.count as f64 * share;
        self.absorb_moments(later, weight);
        self.absorb_undivided(later, share, weight);
        for (largest, &other) in self.largest.iter_mut().zip(&later.largest) {
            *largest = if other > *largest { other } else { *largest };
        }
        let shifted = later.first_excursion.map(|sample| sample + self.count);
        self.first_excursion = self.first_excursion.or(shifted);
        self.count = count;
    }

    fn absorb_moments(&mut self, later: &Window, weight: f64) {
        let (mut rows, mut others) = (self.moments.as_mut_slice(), later.moments.as_slice());
        for (i, &d) in self.deviation[..self.mean.len()].iter().enumerate() {
            let scaled = d * weight;
            let length = (i / GROUP + 1) * GROUP;
            let (row, later_rows) = rows.split_at_mut(length);
            let (other, later_others) = others.split_at(length);
            for ((moment, other), column) in row.iter_mut().zip(other).zip(&self.deviation) {
                *moment += other + scaled * column;
            }
            (rows, others) = (later_rows, later_others);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    fn filled(random: &mut Random, samples: usize, offset: f64) -> Vec<[f64; 6]> {
        let sample = |_| core::array::from_fn(|_| offset + random.unit());
        (0..samples).map(sample).collect()
    }

    fn window(samples: &[[f64; 6]]) -> Window {
        let mut window = Window::watching(3, 2);
        for s in samples {
            window.add(&s[..3], &s[3..], &[1.0, 2.0, 40.0]);
        }
        window
    }

    proptest! {
        #[test]
        fn merged_windows_equal_one_over_all_samples(
            sizes in prop::collection::vec(0_usize..40, 1..6), seed in 0_u64..1000, offset in -5.0..5.0_f64
        ) {
            let mut random = Random::new(seed);
            let parts: Vec<_> = sizes.iter().map(|&n| filled(&mut random, n, offset)).collect();
            let whole = window(&parts.concat());
            let mut merged = Window::watching(3, 2);
            parts.iter().for_each(|part| merged.absorb(&window(part)));
            prop_assert_eq!(merged.count(), whole.count());
            prop_assert_eq!(merged.first_excursion(), whole.first_excursion());
            for (a, b) in merged.to_values().iter().zip(whole.to_values()) {
                prop_assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{a} {b}");
            }
        }
    }

    #[test]
    fn nothing_and_a_window_are_the_window_to_the_bit() {
        let one = window(&filled(&mut Random::new(3), 17, 1.0));
        let mut empty = window(&filled(&mut Random::new(4), 5, 2.0));
        empty.clear();
        assert_eq!(empty, Window::watching(3, 2));
        empty.absorb(&one);
        assert_eq!(empty, one);
        empty.absorb(&Window::watching(3, 2));
        assert_eq!(empty, one);
    }
}
