//! Augmentation of a window with its samples' own errors.

use alloc::vec;

use servotwin_diagnosis::residual::Window;

use super::factor_of;

/// A random variation of the window: every statistic moves within the uncertainty from the samples' own errors. `noise`
/// is the standard deviation of each sensor's samples, in parts of scale, independent from sample to sample. `lasting`
/// is that of a constant error (a solver's). `normal` draws deviates of mean 0 and variance 1.
///
/// ```text
/// s_j² = noise_j²/N + lasting²
/// m_j  → m_j + s_j z
/// C_ij → C_ij + g_j,i + g_i,j + noise_i noise_j z √((1 + δ_ij)/N),   g_j = s_j L z,   L Lᵀ = C
/// ```
///
/// with C the covariances of all residuals and twin signals. g_j is the chance covariance of an error of sensor j with
/// each of them.
pub fn disturbed(
    window: &Window,
    noise: &[f64],
    lasting: f64,
    normal: &mut impl FnMut() -> f64,
) -> Window {
    let (n, channels) = (window.sensors(), 2 * window.sensors());
    let count = (window.count() as f64).max(1.0);
    let mut result = window.clone();
    let factor = factor_of(window, 0..channels);
    let mut deviates = vec![0.0; channels];
    for (j, &noise_j) in noise.iter().enumerate().take(n) {
        let error = libm::sqrt(noise_j * noise_j / count + lasting * lasting);
        *result.mean_mut(j) += error * normal();
        deviates.iter_mut().for_each(|deviate| *deviate = normal());
        for i in 0..channels {
            let row = &factor[i * channels..=i * channels + i];
            let happens: f64 = row.iter().zip(&deviates).map(|(a, b)| a * b).sum();
            let twice = if i == j { 2.0 } else { 1.0 };
            *result.co_moment_mut(i, j) += twice * error * happens * count;
        }
        for (i, &noise_i) in noise.iter().enumerate().take(j + 1) {
            let variance = if i == j { 2.0 } else { 1.0 } / count;
            let product = noise_i * noise_j * libm::sqrt(variance) * normal();
            *result.co_moment_mut(i, j) += product * count;
        }
        *result.largest_mut(j) = moved_largest(window, j, noise_j, normal());
    }
    for i in 0..n {
        let own = result.co_moment_mut(i, i);
        *own = own.max(0.0);
    }
    result
}

/// The largest magnitude moves by the error of one sample if a signal causes it, and by 30 % of that if it is the
/// largest of many noise samples.
fn moved_largest(window: &Window, sensor: usize, noise: f64, normal: f64) -> f64 {
    const OF_NOISE_ONLY: f64 = 0.3;
    let variance = window.covariance(sensor, sensor).max(noise * noise);
    let share = if variance > 0.0 { noise * noise / variance } else { 0.0 };
    let moved = noise * (1.0 - (1.0 - OF_NOISE_ONLY) * share) * normal;
    (window.largest(sensor) + moved).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// A deviate of mean 0 and variance 1, from twelve uniform ones.
    fn normal(random: &mut servotwin_diagnosis::random::Random) -> f64 {
        (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
    }

    #[test]
    fn a_disturbed_window_varies_as_windows_of_other_noise_do() {
        let noise = [0.02, 0.05];
        let signal = |k: u32| {
            let t = f64::from(k) * 0.07;
            ([libm::sin(t), 0.3 * libm::sin(t + 0.5)], [libm::sin(1.3 * t), libm::cos(t)])
        };
        let mut random = servotwin_diagnosis::random::Random::new(1);
        let window = |random: &mut servotwin_diagnosis::random::Random| {
            let mut window = Window::new(2);
            for k in 0..300 {
                let (residual, twin) = signal(k);
                let measured = [0, 1].map(|i| twin[i] + residual[i] + noise[i] * normal(random));
                window.add(&measured, &twin, &[1.0, 1.0]);
            }
            window
        };
        let numbers = |w: &Window| {
            [
                w.mean(0),
                w.covariance(0, 0),
                w.covariance(0, 1),
                w.covariance(1, 1),
                w.cross_covariance(1, 0),
                w.covariance(0, 0) + w.covariance(1, 1) - 2.0 * w.covariance(0, 1),
            ]
        };
        let drawn: Vec<_> = (0..2000).map(|_| numbers(&window(&mut random))).collect();
        let one = window(&mut random);
        let mut source = servotwin_diagnosis::random::Random::new(2);
        let moved: Vec<_> = (0..2000)
            .map(|_| numbers(&disturbed(&one, &noise, 0.0, &mut || normal(&mut source))))
            .collect();
        let deviation = |list: &[[f64; 6]], i: usize| {
            let mean = list.iter().map(|v| v[i]).sum::<f64>() / list.len() as f64;
            (list.iter().map(|v| (v[i] - mean) * (v[i] - mean)).sum::<f64>() / list.len() as f64)
                .sqrt()
        };
        for i in 0..6 {
            let ratio = deviation(&moved, i) / deviation(&drawn, i);
            assert!((0.9..1.1).contains(&ratio), "number {i}: {ratio}");
        }
        assert_eq!(disturbed(&one, &[0.0; 2], 0.0, &mut || 1.0).to_values(), one.to_values());
    }
}
