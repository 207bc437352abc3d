//! Eigenvalues of a small dense matrix, and of a system in steady state.
//!
//! Similarity eliminations with pivoting bring a real matrix to Hessenberg form. Complex QR steps with Givens rotations
//! and Wilkinson's shift (Golub and Van Loan, *Matrix Computations*, 4th ed., 7.4–7.5) then split off one eigenvalue
//! after another. Rows and columns are first scaled by the states' scales. This leaves the eigenvalues unchanged and
//! makes them accurate although pressures are 1e10 times positions.

// Matrix algorithms are clearer with the indices of their textbooks.
#![expect(clippy::needless_range_loop)]

use servotwin_model::jacobian::dense;
use servotwin_model::program::Program;
use servotwin_model::solver::StepMemory;
use std::cmp::Ordering;
use std::ops::{Add, Mul, Sub};

/// A complex number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Complex {
    /// The real part.
    pub re: f64,
    /// The imaginary part.
    pub im: f64,
}

impl Complex {
    const ZERO: Self = Self { re: 0.0, im: 0.0 };

    /// The absolute value.
    pub fn abs(self) -> f64 {
        self.re.hypot(self.im)
    }

    fn conjugate(self) -> Self {
        Self { im: -self.im, ..self }
    }

    fn scaled(self, factor: f64) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }

    /// The square root with a non-negative real part.
    fn sqrt(self) -> Self {
        let size = self.abs();
        let re = (0.5 * (size + self.re)).max(0.0).sqrt();
        let im = (0.5 * (size - self.re)).max(0.0).sqrt();
        Self { re, im: im.copysign(self.im) }
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

/// The eigenvalues of a square matrix, fastest last. Each conjugate pair has its positive imaginary part first;
/// imaginary parts due to rounding are set to zero. `None` if the iteration does not converge (numbers that are not
/// finite).
pub(crate) fn eigenvalues(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Complex>> {
    let norm = matrix.iter().flatten().fold(0.0, |sum: f64, entry| sum.hypot(*entry));
    to_hessenberg(&mut matrix);
    let complex = |row: &Vec<f64>| row.iter().map(|&re| Complex { re, im: 0.0 }).collect();
    let mut h: Vec<Vec<Complex>> = matrix.iter().map(complex).collect();
    let mut found = Vec::with_capacity(h.len());
    let mut size = h.len();
    let mut turns = 0;
    while size > 0 {
        let low = block_begin(&h, size);
        if low + 1 == size {
            found.push(without_rounding(h[size - 1][size - 1], norm));
            size -= 1;
            turns = 0;
            continue;
        }
        turns += 1;
        if turns > 200 || !h[size - 1][size - 1].abs().is_finite() {
            return None;
        }
        let shift =
            if turns % 11 == 10 { exceptional_shift(&h, size) } else { wilkinson_shift(&h, size) };
        qr_step(&mut h, low, size, shift);
    }
    found.sort_by(by_speed);
    Some(found)
}

/// An eigenvalue of a real matrix, with its imaginary part set to zero if rounding may explain it.
fn without_rounding(value: Complex, norm: f64) -> Complex {
    const ROUNDING: f64 = 1e-9;
    let is_real = value.im.abs() <= (ROUNDING * value.abs()).max(f64::EPSILON * norm);
    if is_real { Complex { im: 0.0, ..value } } else { value }
}

/// Slow before fast; within a pair, whose sizes may differ by rounding, the positive imaginary part first.
fn by_speed(a: &Complex, b: &Complex) -> Ordering {
    let rounded = |c: &Complex| (c.abs() as f32, c.re as f32);
    let (a_size, b_size) = (rounded(a), rounded(b));
    a_size.0.total_cmp(&b_size.0).then(a_size.1.total_cmp(&b_size.1)).then(b.im.total_cmp(&a.im))
}

fn to_hessenberg(a: &mut [Vec<f64>]) {
    let n = a.len();
    for m in 1..n.saturating_sub(1) {
        let pivot = (m..n).max_by(|&i, &j| a[i][m - 1].abs().total_cmp(&a[j][m - 1].abs()));
        let pivot = pivot.expect("m is below n");
        a.swap(m, pivot);
        a.iter_mut().for_each(|row| row.swap(m, pivot));
        if a[m][m - 1] == 0.0 {
            continue;
        }
        for i in m + 1..n {
            let factor = a[i][m - 1] / a[m][m - 1];
            for j in 0..n {
                a[i][j] -= factor * a[m][j];
            }
            for row in a.iter_mut() {
                row[m] += factor * row[i];
            }
            a[i][m - 1] = 0.0;
        }
    }
}

/// The start of the last block without a negligible subdiagonal entry.
fn block_begin(h: &[Vec<Complex>], size: usize) -> usize {
    let mut low = size - 1;
    while low > 0 {
        let neighbours = h[low][low].abs() + h[low - 1][low - 1].abs();
        if h[low][low - 1].abs() <= f64::EPSILON * neighbours {
            break;
        }
        low -= 1;
    }
    low
}

/// The eigenvalue of the last 2 × 2 block that is closer to the last entry.
fn wilkinson_shift(h: &[Vec<Complex>], size: usize) -> Complex {
    let (a, b) = (h[size - 2][size - 2], h[size - 2][size - 1]);
    let (c, d) = (h[size - 1][size - 2], h[size - 1][size - 1]);
    let half = (a - d).scaled(0.5);
    let root = (half * half + b * c).sqrt();
    let (plus, minus) = (half + root, half - root);
    d + if plus.abs() < minus.abs() { plus } else { minus }
}

/// A shift that breaks cycles of the iteration.
fn exceptional_shift(h: &[Vec<Complex>], size: usize) -> Complex {
    let re = h[size - 1][size - 1].re + h[size - 1][size - 2].abs();
    Complex { re, im: 0.3 * h[size - 1][size - 2].abs() }
}

/// One QR step of the rows and columns `low .. size`.
fn qr_step(h: &mut [Vec<Complex>], low: usize, size: usize, shift: Complex) {
    for (k, row) in h.iter_mut().enumerate().take(size).skip(low) {
        row[k] = row[k] - shift;
    }
    let mut rotations = Vec::with_capacity(size - low);
    for k in low..size - 1 {
        let (x, y) = (h[k][k], h[k + 1][k]);
        let length = x.abs().hypot(y.abs());
        let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
        let (c, s) = match length > 0.0 {
            true => (x.scaled(inverse), y.scaled(inverse)),
            false => (Complex { re: 1.0, im: 0.0 }, Complex::ZERO),
        };
        for j in k..size {
            let (a, b) = (h[k][j], h[k + 1][j]);
            h[k][j] = c.conjugate() * a + s.conjugate() * b;
            h[k + 1][j] = c * b - s * a;
        }
        rotations.push((c, s));
    }
    for (k, (c, s)) in (low..).zip(rotations) {
        for row in h.iter_mut().take((k + 2).min(size)).skip(low) {
            let (a, b) = (row[k], row[k + 1]);
            row[k] = a * c + b * s;
            row[k + 1] = b * c.conjugate() - a * s.conjugate();
        }
    }
    for (k, row) in h.iter_mut().enumerate().take(size).skip(low) {
        row[k] = row[k] + shift;
    }
}

/// The eigenvalues of a healthy system's equations at given states and inputs, 1/s. `None` if the equations give
/// numbers that are not finite.
pub(crate) fn of_system(program: &Program, states: &[f64], inputs: &[f64]) -> Option<Vec<Complex>> {
    let parameters = program.parameters(&[]);
    let mut memory = StepMemory::<f64>::new(program);
    memory.set_constants(0, &program.block_constants(&parameters));
    let externals = program.externals();
    for (slot, &value) in externals.clone().zip(inputs) {
        memory.set_variable(0, slot, value);
    }
    let stand_ins: Vec<f64> = program.stand_in_values(&parameters);
    for (slot, &value) in (externals.end..).zip(&stand_ins) {
        memory.set_variable(0, slot, value);
    }
    memory.set_states(0, states);
    memory.begin();
    let mut matrix = dense(program.jacobian(), memory.gradients(), 0);
    let scales: Vec<f64> = program.states().iter().map(|state| state.scale).collect();
    for (row, own) in matrix.iter_mut().zip(&scales) {
        for (entry, other) in row.iter_mut().zip(&scales) {
            *entry *= other / own;
        }
    }
    eigenvalues(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expect(matrix: &[&[f64]], expected: &[(f64, f64)], tolerance: f64) {
        let found = eigenvalues(matrix.iter().map(|row| row.to_vec()).collect()).unwrap();
        assert_eq!(found.len(), expected.len());
        for (found, &(re, im)) in found.iter().zip(expected) {
            let error = (*found - Complex { re, im }).abs();
            assert!(error < tolerance, "{found:?} is not {re} + {im} i");
        }
    }

    #[test]
    fn small_matrices_have_their_known_eigenvalues() {
        expect(&[], &[], 0.0);
        expect(&[&[-3.0]], &[(-3.0, 0.0)], 1e-15);
        expect(&[&[0.0, 1.0], &[-4.0, 0.0]], &[(0.0, 2.0), (0.0, -2.0)], 1e-14);
        let triangle: &[&[f64]] = &[&[1.0, 5.0, 7.0], &[0.0, -2.0, 9.0], &[0.0, 0.0, 30.0]];
        expect(triangle, &[(1.0, 0.0), (-2.0, 0.0), (30.0, 0.0)], 1e-12);
        // A cyclic permutation: the cube roots of one.
        let s = 0.75_f64.sqrt();
        let cycle: &[&[f64]] = &[&[0.0, 0.0, 1.0], &[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0]];
        expect(cycle, &[(-0.5, s), (-0.5, -s), (1.0, 0.0)], 1e-14);
    }

    #[test]
    fn a_companion_matrix_gives_the_roots_of_its_polynomial() {
        // (x + 1)(x + 2) … (x + 10), by multiplying out.
        let mut coefficients = vec![1.0];
        for root in 1..=10 {
            let mut next = coefficients.clone();
            next.push(0.0);
            for (place, c) in coefficients.iter().enumerate() {
                next[place + 1] += f64::from(root) * c;
            }
            coefficients = next;
        }
        let mut matrix = vec![vec![0.0; 10]; 10];
        for i in 0..10 {
            matrix[0][i] = -coefficients[i + 1];
            if i > 0 {
                matrix[i][i - 1] = 1.0;
            }
        }
        for (k, value) in eigenvalues(matrix).unwrap().iter().enumerate() {
            assert!((value.re + (k + 1) as f64).abs() < 1e-6 && value.im.abs() < 1e-6, "{value:?}");
        }
    }

    #[test]
    fn trace_and_sum_of_squares_are_kept() {
        let n = 40;
        let mut seed = 12345_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / 2f64.powi(31) - 0.5
        };
        let matrix: Vec<Vec<f64>> = (0..n).map(|_| (0..n).map(|_| next()).collect()).collect();
        let found = eigenvalues(matrix.clone()).unwrap();
        let trace: f64 = (0..n).map(|i| matrix[i][i]).sum();
        let squares: f64 = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| matrix[i][j] * matrix[j][i])
            .sum();
        let sum = found.iter().fold(Complex::ZERO, |sum, &value| sum + value);
        let square_sum = found.iter().fold(Complex::ZERO, |sum, &value| sum + value * value);
        assert!((sum - Complex { re: trace, im: 0.0 }).abs() < 1e-11);
        assert!((square_sum - Complex { re: squares, im: 0.0 }).abs() < 1e-10);
    }

    /// Code that shows one of each pair must not lose a real eigenvalue.
    #[test]
    fn as_many_have_a_positive_imaginary_part_as_a_negative_one() {
        for name in ["aileron_dual", "press_axis", "valve_and_cylinder"] {
            let system = crate::system::System::read(name).unwrap();
            let found = crate::rest::of(&system).unwrap().eigenvalues;
            let count = |sign: f64| found.iter().filter(|value| value.im * sign > 0.0).count();
            assert_eq!(count(1.0), count(-1.0), "{name}: {found:?}");
            assert!(found.iter().any(|value| value.im == 0.0), "{name}");
        }
    }

    #[test]
    fn a_matrix_that_is_not_finite_has_none() {
        assert_eq!(eigenvalues(vec![vec![f64::NAN, 1.0], vec![1.0, 0.0]]), None);
    }
}
