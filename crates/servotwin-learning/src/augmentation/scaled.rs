//! Augmentation of a window with a weaker or stronger fault.

use alloc::vec;
use alloc::vec::Vec;

use super::factor_of;
use servotwin_diagnosis::residual::{LARGEST_OF_NOISE, Window};

/// The window with a fault `factor` times as large. For a weaker fault, the lost noise and tolerances come from a
/// healthy `specimen` under the same command. For a stronger one, only the sensors' noise stays constant.
///
/// ```text
/// r → a r + b h,   b = √(1 − a²)                            a ≤ 1, h residuals of the specimen
/// C_rr → a² C_rr + b² C_hh + a b (X + Xᵀ),   X = C_rs C_ss⁻¹ C_sh
/// C_rr → a² C_rr + (1 − a²) noise²                          a > 1
/// ```
///
/// X is the part of both that the twin signals explain. `noise` is the standard deviation of each sensor's samples, in
/// parts of scale.
pub fn scaled(window: &Window, factor: f64, specimen: Option<&Window>, noise: &[f64]) -> Window {
    let n = window.sensors();
    let mut result = window.clone();
    for (i, &noise) in noise.iter().enumerate().take(n) {
        *result.mean_mut(i) *= factor;
        for j in 0..=i {
            *result.co_moment_mut(i, j) *= factor * factor;
        }
        for j in n..2 * n {
            *result.co_moment_mut(i, j) *= factor;
        }
        let of_noise = window.largest(i).min(LARGEST_OF_NOISE * noise);
        *result.largest_mut(i) = of_noise + factor * (window.largest(i) - of_noise);
    }
    match specimen.filter(|_| factor < 1.0) {
        Some(specimen) => add_specimen(&mut result, window, factor, specimen, noise),
        None => {
            for (i, &noise) in noise.iter().enumerate().take(n) {
                let of_noise = noise * noise * window.count() as f64;
                let own = result.co_moment_mut(i, i);
                *own = (*own + (1.0 - factor * factor) * of_noise).max(0.0);
            }
        }
    }
    result
}

/// Adds a specimen's residuals to the scaled ones.
fn add_specimen(
    result: &mut Window,
    before: &Window,
    factor: f64,
    specimen: &Window,
    noise: &[f64],
) {
    let n = before.sensors();
    let part = libm::sqrt(1.0 - factor * factor);
    let count = before.count() as f64;
    let twin = factor_of(before, n..2 * n);
    let (explained, of_specimen) = (explained_with(before, &twin), explained_with(specimen, &twin));
    for (i, &noise) in noise.iter().enumerate().take(n) {
        *result.mean_mut(i) += part * specimen.mean(i);
        for j in 0..=i {
            let common = |a: usize, b: usize| -> f64 {
                (0..n).map(|k| explained[a * n + k] * of_specimen[b * n + k]).sum()
            };
            let both = common(i, j) + common(j, i);
            *result.co_moment_mut(i, j) +=
                count * (part * part * specimen.covariance_of(i, j) + factor * part * both);
        }
        for j in n..2 * n {
            *result.co_moment_mut(i, j) += count * part * specimen.covariance_of(i, j);
        }
        let own = result.co_moment_mut(i, i);
        *own = own.max(0.0);
        let of_noise = |largest: f64| largest.min(LARGEST_OF_NOISE * noise);
        let [old, new] = [before.largest(i), specimen.largest(i)];
        let signals = libm::hypot(factor * (old - of_noise(old)), part * (new - of_noise(new)));
        *result.largest_mut(i) = of_noise(old).max(of_noise(new)) + signals;
    }
}

/// The parts of each residual along independent components of the twin signals, from their factor.
fn explained_with(window: &Window, factor: &[f64]) -> Vec<f64> {
    let n = window.sensors();
    let mut parts = vec![0.0; n * n];
    for i in 0..n {
        for k in 0..n {
            let known: f64 = (0..k).map(|l| factor[k * n + l] * parts[i * n + l]).sum();
            let pivot = factor[k * n + k];
            let rest = window.covariance_of(i, n + k) - known;
            parts[i * n + k] = if pivot > 0.0 { rest / pivot } else { 0.0 };
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window of residuals that are linear in two twin signals.
    fn linear(gains: [[f64; 3]; 2]) -> Window {
        let mut window = Window::new(2);
        for k in 0..500 {
            let t = f64::from(k) * 0.1;
            let twin = [libm::sin(t) + 0.3, libm::cos(1.7 * t)];
            let residual = gains.map(|[a, b, c]| a * twin[0] + b * twin[1] + c);
            let measured = [residual[0] + twin[0], residual[1] + twin[1]];
            window.add(&measured, &twin, &[1.0, 1.0]);
        }
        window
    }

    #[test]
    fn a_weaker_fault_in_another_specimen_is_the_sum_of_both() {
        let (fault, healthy) =
            ([[0.3, -0.1, 0.2], [0.05, 0.4, -0.1]], [[0.01, 0.02, -0.03], [-0.02, 0.0, 0.01]]);
        let (a, b) = (0.6, 0.8);
        let sum = |i: usize| [0, 1, 2].map(|k| a * fault[i][k] + b * healthy[i][k]);
        let expected = linear([sum(0), sum(1)]);
        let grown = scaled(&linear(fault), a, Some(&linear(healthy)), &[0.0, 0.0]);
        for i in 0..2 {
            assert!((grown.mean(i) - expected.mean(i)).abs() < 1e-12);
            assert!(grown.largest(i) >= a * linear(fault).largest(i));
            for j in 0..2 {
                assert!((grown.covariance(i, j) - expected.covariance(i, j)).abs() < 1e-10);
                let cross = [&grown, &expected].map(|window| window.cross_covariance(i, j));
                assert!((cross[0] - cross[1]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn noise_stays_what_it_is_when_a_fault_grows() {
        let fault = linear([[0.3, -0.1, 0.2], [0.0, 0.0, 0.0]]);
        let noise = libm::sqrt(fault.covariance(0, 0));
        let grown = scaled(&fault, 3.0, None, &[noise, 0.0]);
        assert!((grown.covariance(0, 0) - noise * noise).abs() < 1e-12);
        assert!((grown.mean(0) - 3.0 * fault.mean(0)).abs() < 1e-12);
        let without = scaled(&fault, 3.0, None, &[0.0, 0.0]);
        assert!((without.covariance(0, 0) - 9.0 * fault.covariance(0, 0)).abs() < 1e-12);
        assert!((without.largest(0) - 3.0 * fault.largest(0)).abs() < 1e-12);
    }
}
