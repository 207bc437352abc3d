//! The little linear algebra that the classifiers share.

use alloc::vec;
use alloc::vec::Vec;

use crate::data::Samples;

/// Dot product, summed in eight fixed lanes: the compiler may use SIMD, and the result is the
/// same on every machine.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_blocks, a_rest) = a.as_chunks::<8>();
    let (b_blocks, b_rest) = b.as_chunks::<8>();
    let mut lanes = [0.0; 8];
    for (x, y) in a_blocks.iter().zip(b_blocks) {
        for lane in 0..8 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5]))
        + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]))
        + rest
}

/// `target += factor * direction`.
pub(crate) fn add_scaled(target: &mut [f64], factor: f64, direction: &[f64]) {
    for (slot, step) in target.iter_mut().zip(direction) {
        *slot += factor * step;
    }
}

/// `target += factors[0] * directions[0] + …`, added one after the other as by [`add_scaled`], but
/// with the target read and written once for four directions. `directions` holds one after the
/// other, each as long as the target.
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

/// Place of the largest value; of equal ones the first.
pub(crate) fn arg_max(values: impl IntoIterator<Item = f64>) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (place, value) in values.into_iter().enumerate() {
        if value > best.1 {
            best = (place, value);
        }
    }
    best.0
}

/// Turns logarithms into shares that sum to one, and returns the logarithm of the sum before.
/// If all are minus infinity (a row absurdly far from every class), the shares are equal.
pub(crate) fn softmax(values: &mut [f64]) -> f64 {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        let share = 1.0 / values.len() as f64;
        values.fill(share);
        return largest;
    }
    let mut sum = 0.0;
    for value in values.iter_mut() {
        *value = libm::exp(*value - largest);
        sum += *value;
    }
    for value in values.iter_mut() {
        *value /= sum;
    }
    largest + libm::log(sum)
}

/// Cholesky factor L of a symmetric matrix (row-major, `size` × `size`; the lower half is read and
/// replaced by L). Returns false when a pivot is not above `smallest_pivot`.
pub(crate) fn cholesky(matrix: &mut [f64], size: usize, smallest_pivot: f64) -> bool {
    for row in 0..size {
        for column in 0..=row {
            let (head, tail) = matrix.split_at(row * size);
            let row_part = &tail[..column];
            let sum = if column < row {
                dot(row_part, &head[column * size..column * size + column])
            } else {
                dot(row_part, row_part)
            };
            let value = matrix[row * size + column] - sum;
            if row == column {
                if value.is_nan() || value <= smallest_pivot {
                    return false;
                }
                matrix[row * size + row] = libm::sqrt(value);
            } else {
                matrix[row * size + column] = value / matrix[column * size + column];
            }
        }
    }
    true
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
/// A column that varies by rounding only has the deviation 0.
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
    pub means: Vec<f64>,
    /// One over the standard deviation, or 0.
    pub scales: Vec<f64>,
}

impl Standardiser {
    pub fn new(samples: &Samples) -> Self {
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

    /// The standardised table, row-major with `stride` places a row; places past the features
    /// are 0.
    pub fn rows(&self, samples: &Samples, stride: usize) -> Vec<f64> {
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
    fn dot_of_any_length() {
        for length in 0..20 {
            let a: Vec<f64> = (0..length).map(f64::from).collect();
            let expected: f64 = a.iter().map(|x| x * x).sum();
            assert_eq!(dot(&a, &a), expected);
        }
    }

    #[test]
    fn cholesky_solves_and_refuses() {
        let matrix = [4.0, 2.0, 0.6, 2.0, 2.0, 0.5, 0.6, 0.5, 1.0];
        let mut factor = matrix;
        assert!(cholesky(&mut factor, 3, 0.0));
        let mut x = [1.0, -2.0, 3.0];
        cholesky_solve(&factor, 3, &mut x);
        for (row, expected) in [1.0, -2.0, 3.0].iter().enumerate() {
            assert!((dot(&matrix[row * 3..row * 3 + 3], &x) - expected).abs() < 1e-12);
        }
        assert!(!cholesky(&mut [1.0, 1.0, 1.0, 1.0], 2, 1e-12));
    }

    #[test]
    fn softmax_of_large_numbers_sums_to_one() {
        let mut values = [1000.0, 1001.0];
        let log_sum = softmax(&mut values);
        assert!((values[0] + values[1] - 1.0).abs() < 1e-15);
        assert!((log_sum - 1_001.313_261_687_518).abs() < 1e-9);
    }

    #[test]
    fn ties_go_to_the_first() {
        assert_eq!(arg_max([1.0, 2.0, 2.0]), 1);
        assert_eq!(arg_max([f64::NAN, 0.0]), 1);
    }
}
