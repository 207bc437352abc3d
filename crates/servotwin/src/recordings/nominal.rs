//! The nominal value of a sensor, learned from healthy rows.
//!
//! ```text
//! y = a + Σ b_j (x_j − mean x_j)      a, b by least squares over the healthy rows
//! ```
//!
//! Without inputs x, this is the mean. An input that is constant or depends linearly on the others gets b = 0.
//! Rows that lack a number teach nothing.

use servotwin_diagnosis::diagnoser::Nominal;

/// A pivot below this fraction of an input's variance is rounding error.
const NEGLIGIBLE: f64 = 1e-10;

/// Learns from the healthy rows of columns; `None` if none of them is complete.
pub(super) fn learn_nominal(
    measured: &[f64],
    inputs: &[&[f64]],
    healthy: &[usize],
) -> Option<Nominal> {
    let has_all = |row: &usize| {
        measured[*row].is_finite() && inputs.iter().all(|column| column[*row].is_finite())
    };
    let healthy: Vec<usize> = healthy.iter().copied().filter(has_all).collect();
    if healthy.is_empty() {
        return None;
    }
    let mean =
        |column: &[f64]| healthy.iter().map(|&row| column[row]).sum::<f64>() / healthy.len() as f64;
    let (offset, means): (f64, Vec<f64>) =
        (mean(measured), inputs.iter().map(|column| mean(column)).collect());
    let covariance = |a: (&[f64], f64), b: (&[f64], f64)| {
        let product = |&row: &usize| (a.0[row] - a.1) * (b.0[row] - b.1);
        healthy.iter().map(product).sum::<f64>() / healthy.len() as f64
    };
    let input = |place: usize| (inputs[place], means[place]);
    let count = inputs.len();
    // One row per input: its covariances with all inputs and with the measured signal.
    let rows = (0..count).map(|i| {
        let others = (0..count).map(|j| covariance(input(i), input(j)));
        others.chain([covariance(input(i), (measured, offset))]).collect()
    });
    let slopes = solve(rows.collect());
    let spread = covariance((measured, offset), (measured, offset)).sqrt();
    let rows = healthy.len() as u64;
    let mut nominal = Nominal { offset, means, slopes, deviation: 0.0, spread, rows };
    let square = |&row: &usize| {
        let values: Vec<f64> = inputs.iter().map(|column| column[row]).collect();
        (measured[row] - nominal.at(&values)).powi(2)
    };
    let squares: f64 = healthy.iter().map(square).sum();
    nominal.deviation = (squares / rows as f64).sqrt();
    Some(nominal)
}

/// Solves symmetric equations, one row each with its right-hand side at the end, by elimination with the largest
/// remaining diagonal as pivot. Dependent unknowns are set to zero.
fn solve(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let count = rows.len();
    let own: Vec<f64> = (0..count).map(|i| rows[i][i]).collect();
    let mut open: Vec<usize> = (0..count).collect();
    let mut solved = vec![];
    let relative = |rows: &[Vec<f64>], i: usize| match own[i] > 0.0 {
        true => rows[i][i] / own[i],
        false => 0.0,
    };
    while let Some(place) = (0..open.len())
        .max_by(|&a, &b| relative(&rows, open[a]).total_cmp(&relative(&rows, open[b])))
    {
        let pivot = open.swap_remove(place);
        if relative(&rows, pivot) <= NEGLIGIBLE {
            break;
        }
        solved.push(pivot);
        let lead = rows[pivot].clone();
        for row in (0..count).filter(|&row| row != pivot) {
            let factor = rows[row][pivot] / lead[pivot];
            rows[row].iter_mut().zip(&lead).for_each(|(value, lead)| *value -= factor * lead);
        }
    }
    let mut unknowns = vec![0.0; count];
    for pivot in solved {
        unknowns[pivot] = rows[pivot][count] / rows[pivot][pivot];
    }
    unknowns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_found_again_and_redundant_inputs_do_no_harm() {
        let x: Vec<f64> = (0..50).map(|k| f64::from(k % 7)).collect();
        let z: Vec<f64> = (0..50).map(|k| f64::from(k % 5) * 1e6).collect();
        let same: Vec<f64> = x.iter().map(|x| 2.0 * x - 1.0).collect();
        let constant = vec![4.0; 50];
        let y: Vec<f64> = x.iter().zip(&z).map(|(x, z)| 3.0 + 2.0 * x - 1e-6 * z).collect();
        let all: Vec<usize> = (0..50).collect();
        let nominal = learn_nominal(&y, &[&x, &z, &same, &constant], &all).unwrap();
        for row in 0..50 {
            let inputs = [x[row], z[row], same[row], constant[row]];
            assert!((nominal.at(&inputs) - y[row]).abs() < 1e-9);
        }
        assert!(nominal.deviation < 1e-9);
        let mean = learn_nominal(&[1.0, 100.0, 3.0, f64::NAN], &[], &[0, 2, 3]).unwrap();
        assert_eq!((mean.at(&[]), mean.deviation, mean.rows), (2.0, 1.0, 2));
        assert_eq!(learn_nominal(&[f64::NAN], &[], &[0]), None);
    }
}
