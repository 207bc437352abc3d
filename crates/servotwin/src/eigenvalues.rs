//! Eigenvalues of a system in steady state.
//!
//! Rows and columns of the Jacobian are first scaled by the states' scales. This leaves the eigenvalues unchanged and
//! makes them accurate although pressures are 1e10 times positions.

use nalgebra::{Complex, DMatrix, Schur};
use servotwin_model::jacobian::dense;
use servotwin_model::program::Program;
use servotwin_model::solver::StepMemory;
use std::cmp::Ordering;

/// The eigenvalues of a square matrix, fastest last. Each conjugate pair has its positive imaginary part first;
/// imaginary parts due to rounding are set to zero. `None` if the iteration does not converge, or for numbers that are
/// not finite.
fn eigenvalues(matrix: &[Vec<f64>]) -> Option<Vec<Complex<f64>>> {
    /// Iterations for each row; a few are usual.
    const MAX_ITERATIONS: usize = 200;
    let (count, entries) = (matrix.len(), || matrix.iter().flatten().copied());
    if count == 0 || !entries().all(f64::is_finite) {
        return (count == 0).then(Vec::new);
    }
    let norm = entries().fold(0.0, f64::hypot);
    let dense = DMatrix::from_row_iterator(count, count, entries());
    let schur = Schur::try_new(dense, f64::EPSILON, MAX_ITERATIONS * count)?;
    let found = schur.complex_eigenvalues();
    let mut found: Vec<_> = found.iter().map(|value| without_rounding(*value, norm)).collect();
    found.sort_by(by_speed);
    Some(found)
}

/// An eigenvalue of a real matrix, with its imaginary part set to zero if rounding may explain it.
fn without_rounding(value: Complex<f64>, norm: f64) -> Complex<f64> {
    const ROUNDING: f64 = 1e-9;
    let is_real = value.im.abs() <= (ROUNDING * value.norm()).max(f64::EPSILON * norm);
    if is_real { Complex { im: 0.0, ..value } } else { value }
}

/// Slow before fast; within a pair, whose sizes may differ by rounding, the positive imaginary part first.
fn by_speed(a: &Complex<f64>, b: &Complex<f64>) -> Ordering {
    let rounded = |c: &Complex<f64>| (c.norm() as f32, c.re as f32);
    let (a_size, b_size) = (rounded(a), rounded(b));
    a_size.0.total_cmp(&b_size.0).then(a_size.1.total_cmp(&b_size.1)).then(b.im.total_cmp(&a.im))
}

/// The eigenvalues of a healthy system's equations at given states and inputs, 1/s. `None` if the equations give
/// numbers that are not finite.
pub(crate) fn of_system(
    program: &Program,
    states: &[f64],
    inputs: &[f64],
) -> Option<Vec<Complex<f64>>> {
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
    eigenvalues(&matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expect(matrix: &[&[f64]], expected: &[(f64, f64)], tolerance: f64) {
        let rows: Vec<Vec<f64>> = matrix.iter().map(|row| row.to_vec()).collect();
        let found = eigenvalues(&rows).unwrap();
        assert_eq!(found.len(), expected.len());
        for (found, &(re, im)) in found.iter().zip(expected) {
            let error = (found.re - re).hypot(found.im - im);
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
        for (k, value) in eigenvalues(&matrix).unwrap().iter().enumerate() {
            assert!((value.re + (k + 1) as f64).abs() < 1e-6 && value.im.abs() < 1e-6, "{value:?}");
        }
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
        assert_eq!(eigenvalues(&[vec![f64::NAN, 1.0], vec![1.0, 0.0]]), None);
    }
}
