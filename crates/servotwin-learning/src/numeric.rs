//! Linear algebra shared by the training algorithms.

use crate::samples::Samples;
use alloc::vec;
use alloc::vec::Vec;
use servotwin_diagnosis::numeric::{add_scaled, dot};

/// `target += factors[0] * directions[0] + …`, added one after the other as by [`add_scaled`]. The target is read and
/// written only once for four directions. `directions` lists them one after the other, each as long as the target.
pub(crate) fn add_many(target: &mut [f64], factors: &[f64], directions: &[f64]) {
    let length = target.len();
    let (blocks, rest) = factors.as_chunks::<4>();
    let mut directions = directions;
    for [f, g, h, i] in blocks {
        let (a, others) = directions.split_at(length);
        let (b, others) = others.split_at(length);
        let (c, others) = others.split_at(length);
        let (d, others) = others.split_at(length);
        directions = others;
        for ((((slot, a), b), c), d) in target.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *slot = *slot + f * a + g * b + h * c + i * d;
        }
    }
    for (&factor, direction) in rest.iter().zip(directions.chunks_exact(length.max(1))) {
        add_scaled(target, factor, direction);
    }
}

/// Replaces the lower half of a symmetric matrix (row-major, `size` × `size`) by its Cholesky factor L. Returns whether
/// every pivot was above the floor that `min_pivot` gives for its diagonal element. Any other pivot becomes zero
/// together with its column: its row depends on the previous ones. `dot` fixes the order of the sums.
pub(crate) fn cholesky(
    matrix: &mut [f64],
    size: usize,
    min_pivot: impl Fn(f64) -> f64,
    dot: impl Fn(&[f64], &[f64]) -> f64,
) -> bool {
    let mut is_regular = true;
    for row in 0..size {
        for column in 0..=row {
            let (head, tail) = matrix.split_at(row * size);
            let other = if column < row { &head[column * size..] } else { tail };
            let rest = tail[column] - dot(&tail[..column], &other[..column]);
            let is_pivot = row == column;
            let has_pivot = is_pivot && rest > min_pivot(tail[column]);
            is_regular &= has_pivot || !is_pivot;
            matrix[row * size + column] = match other[column] {
                _ if has_pivot => libm::sqrt(rest),
                pivot if !is_pivot && pivot > 0.0 => rest / pivot,
                _ => 0.0,
            };
        }
    }
    is_regular
}

/// Solves `L Lᵀ x = b` in place, with L from [`cholesky`].
pub(crate) fn cholesky_solve(factor: &[f64], size: usize, b: &mut [f64]) {
    for row in 0..size {
        let sum = dot(&factor[row * size..row * size + row], &b[..row]);
        b[row] = (b[row] - sum) / factor[row * size + row];
    }
    for row in (0..size).rev() {
        let below: f64 = (row + 1..size).map(|other| factor[other * size + row] * b[other]).sum();
        b[row] = (b[row] - below) / factor[row * size + row];
    }
}

/// Weighted mean and standard deviation (divisor: the sum of weights) of a column.
///
/// A column that varies by rounding only has a deviation of 0.
pub(crate) fn mean_and_deviation(column: &[f64], weight: impl Fn(usize) -> f64) -> (f64, f64) {
    let (mut total, mut sum) = (0.0, 0.0);
    for (row, value) in column.iter().enumerate() {
        total += weight(row);
        sum += weight(row) * value;
    }
    let mean = sum / total;
    let squares: f64 = column
        .iter()
        .enumerate()
        .map(|(row, value)| weight(row) * (value - mean) * (value - mean))
        .sum();
    let deviation = libm::sqrt(squares / total);
    let rounding = column.len() as f64 * f64::EPSILON * libm::fabs(mean);
    (mean, if deviation > rounding { deviation } else { 0.0 })
}

/// The shift and scale that give every feature mean 0 and deviation 1.
///
/// Constant features get the scale 0, so that they vanish.
#[derive(Debug, Clone)]
pub(crate) struct Standardiser {
    pub(crate) means: Vec<f64>,
    /// One over the standard deviation, or 0.
    pub(crate) scales: Vec<f64>,
}

impl Standardiser {
    pub(crate) fn new(samples: &Samples) -> Self {
        let features = samples.features();
        let (mut means, mut scales) = (vec![0.0; features], vec![0.0; features]);
        for feature in 0..features {
            let (mean, deviation) =
                mean_and_deviation(samples.column(feature), |row| samples.weight(row));
            means[feature] = mean;
            scales[feature] = if deviation > 0.0 { 1.0 / deviation } else { 0.0 };
        }
        Standardiser { means, scales }
    }

    /// The standardized table, row-major with `stride` entries a row; entries past the features are 0.
    pub(crate) fn rows(&self, samples: &Samples, stride: usize) -> Vec<f64> {
        let mut table = vec![0.0; samples.rows() * stride];
        for feature in 0..samples.features() {
            let (mean, scale) = (self.means[feature], self.scales[feature]);
            for (row, value) in samples.column(feature).iter().enumerate() {
                table[row * stride + feature] = (value - mean) * scale;
            }
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cholesky_solves_and_refuses() {
        let matrix = [4.0, 2.0, 0.6, 2.0, 2.0, 0.5, 0.6, 0.5, 1.0];
        let mut factor = matrix;
        assert!(cholesky(&mut factor, 3, |_| 0.0, dot));
        let mut x = [1.0, -2.0, 3.0];
        cholesky_solve(&factor, 3, &mut x);
        for (row, expected) in [1.0, -2.0, 3.0].iter().enumerate() {
            assert!((dot(&matrix[row * 3..row * 3 + 3], &x) - expected).abs() < 1e-12);
        }
        assert!(!cholesky(&mut [1.0, 1.0, 1.0, 1.0], 2, |_| 1e-12, dot));
    }
}
