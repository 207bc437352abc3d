//! Linear algebra for a few dozen unknowns: symmetric matrices with their factor, inverse and eigenvalues, and a
//! quadratic's minimum within bounds.

/// A symmetric matrix, stored in full.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Symmetric {
    /// The number of rows.
    pub(super) size: usize,
    values: Vec<f64>,
}

impl Symmetric {
    /// From a function of row and column, called only for entries on and below the diagonal.
    pub(super) fn new(size: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let mut values = vec![0.0; size * size];
        for row in 0..size {
            for column in 0..=row {
                let value = entry(row, column);
                values[row * size + column] = value;
                values[column * size + row] = value;
            }
        }
        Self { size, values }
    }

    /// The entry at a row and column.
    pub(super) fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.size + column]
    }

    /// The matrix with a diagonal added.
    pub(super) fn plus_diagonal(&self, diagonal: &[f64]) -> Self {
        let added = |row, column| if row == column { diagonal[row] } else { 0.0 };
        Self::new(self.size, |row, column| self.at(row, column) + added(row, column))
    }

    /// The submatrix of the given rows and columns.
    pub(super) fn part(&self, which: &[usize]) -> Self {
        Self::new(which.len(), |row, column| self.at(which[row], which[column]))
    }

    /// Its product with a vector.
    pub(super) fn times(&self, vector: &[f64]) -> Vec<f64> {
        let rows = self.values.chunks(self.size.max(1));
        rows.map(|row| dot(row, vector)).collect()
    }

    /// The factor L of L Lᵀ, row by row; `None` if the matrix is not positive definite.
    fn factor(&self) -> Option<Vec<f64>> {
        let n = self.size;
        let mut l = vec![0.0; n * n];
        for row in 0..n {
            for column in 0..=row {
                let sum = dot(&l[row * n..row * n + column], &l[column * n..column * n + column]);
                let rest = self.at(row, column) - sum;
                l[row * n + column] = match row == column {
                    true if rest > 0.0 => rest.sqrt(),
                    true => return None,
                    false => rest / l[column * n + column],
                };
            }
        }
        Some(l)
    }

    /// The solution of A x = b; `None` if the matrix is not positive definite.
    pub(super) fn solve(&self, b: &[f64]) -> Option<Vec<f64>> {
        let l = self.factor()?;
        Some(back_substituted(&l, self.size, b))
    }

    /// The inverse; `None` if the matrix is not positive definite.
    pub(super) fn inverse(&self) -> Option<Self> {
        let (l, n) = (self.factor()?, self.size);
        let column = |place: usize| {
            let unit: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == place))).collect();
            back_substituted(&l, n, &unit)
        };
        let columns: Vec<Vec<f64>> = (0..n).map(column).collect();
        Some(Self::new(n, |row, column| columns[column][row]))
    }

    /// Eigenvalues, largest first (Jacobi's rotations; Golub and Van Loan, *Matrix Computations*, 8.5).
    pub(super) fn eigenvalues(&self) -> Vec<f64> {
        let n = self.size;
        let mut a = self.values.clone();
        for _sweep in 0..60 {
            let off: f64 = (0..n)
                .flat_map(|i| (0..i).map(move |j| (i, j)))
                .map(|(i, j)| a[i * n + j].powi(2))
                .sum();
            let all: f64 = a.iter().map(|x| x * x).sum();
            if off <= 1e-30 * all {
                break;
            }
            for p in 0..n {
                for q in p + 1..n {
                    rotate(&mut a, n, p, q);
                }
            }
        }
        let mut found: Vec<f64> = (0..n).map(|k| a[k * n + k]).collect();
        found.sort_by(|x, y| y.total_cmp(x));
        found
    }

    /// The minimum of ½ xᵀAx − gᵀx with every x within its bounds, by active sets: unknowns that would leave are held,
    /// and released when their slope points inwards again. Where that goes in circles, one unknown changes at a time, the
    /// first that must, which ends for every positive definite matrix (Murty 1974). `None` if the matrix is not positive
    /// definite, or no minimum was found.
    pub(super) fn minimum_within(&self, g: &[f64], bounds: &[(f64, f64)]) -> Option<Vec<f64>> {
        const MOST_TURNS: usize = 10_000;
        const TURNS_AT_ONCE: usize = 50;
        let n = self.size;
        let mut held: Vec<Option<f64>> = vec![None; n];
        let mut x = vec![0.0; n];
        for turn in 0..MOST_TURNS {
            let free: Vec<usize> = (0..n).filter(|&i| held[i].is_none()).collect();
            for i in 0..n {
                x[i] = held[i].unwrap_or(0.0);
            }
            let pull = self.times(&x);
            let right: Vec<f64> = free.iter().map(|&i| g[i] - pull[i]).collect();
            let found = self.part(&free).solve(&right)?;
            for (&i, value) in free.iter().zip(found) {
                x[i] = value;
            }
            let pull = self.times(&x);
            let mut next: Vec<Option<f64>> = (0..n)
                .map(|i| {
                    let (low, high) = bounds[i];
                    match held[i] {
                        None if x[i] > high => Some(high),
                        None if x[i] < low => Some(low),
                        None => None,
                        Some(at) => {
                            let outwards = if at == high { g[i] - pull[i] } else { pull[i] - g[i] };
                            Some(at).filter(|_| outwards >= 0.0 || low == high)
                        }
                    }
                })
                .collect();
            let Some(first) = (0..n).find(|&i| next[i] != held[i]) else { return Some(x) };
            if turn >= TURNS_AT_ONCE {
                next[first + 1..].copy_from_slice(&held[first + 1..]);
            }
            held = next;
        }
        None
    }
}

/// The scalar product of two vectors.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn back_substituted(l: &[f64], n: usize, b: &[f64]) -> Vec<f64> {
    let mut x = b.to_vec();
    for row in 0..n {
        x[row] = (x[row] - dot(&l[row * n..row * n + row], &x[..row])) / l[row * n + row];
    }
    for row in (0..n).rev() {
        let below: f64 = (row + 1..n).map(|other| l[other * n + row] * x[other]).sum();
        x[row] = (x[row] - below) / l[row * n + row];
    }
    x
}

/// The rotation that makes entry (p, q) zero.
fn rotate(a: &mut [f64], n: usize, p: usize, q: usize) {
    let off = a[p * n + q];
    if off == 0.0 {
        return;
    }
    let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * off);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    let mut turn = |i: usize, j: usize| {
        let (x, y) = (a[i], a[j]);
        a[i] = c * x - s * y;
        a[j] = s * x + c * y;
    };
    (0..n).for_each(|k| turn(p * n + k, q * n + k));
    (0..n).for_each(|k| turn(k * n + p, k * n + q));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::random::NormalDeviates;

    fn random(size: usize, seed: u64) -> Symmetric {
        let mut random = NormalDeviates::new(seed);
        let rows: Vec<Vec<f64>> =
            (0..size + 2).map(|_| (0..size).map(|_| random.normal()).collect()).collect();
        Symmetric::new(size, |i, j| rows.iter().map(|row| row[i] * row[j]).sum())
    }

    #[test]
    fn inverse_and_solution_agree() {
        let a = random(9, 3);
        let inverse = a.inverse().unwrap();
        let b: Vec<f64> = (0..9).map(|i| f64::from(i) - 4.0).collect();
        let x = a.solve(&b).unwrap();
        for (x, y) in x.iter().zip(inverse.times(&b)) {
            assert!((x - y).abs() < 1e-9 * x.abs().max(1.0));
        }
        for (found, b) in a.times(&x).iter().zip(&b) {
            assert!((found - b).abs() < 1e-9);
        }
        assert_eq!(Symmetric::new(2, |_, _| 1.0).solve(&[1.0, 1.0]), None);
    }

    #[test]
    fn eigenvalues_have_the_trace_and_the_determinant_of_the_matrix() {
        let a = random(8, 5);
        let eigenvalues = a.eigenvalues();
        assert!(eigenvalues.is_sorted_by(|one, next| one >= next));
        let (l, trace): (_, f64) = (a.factor().unwrap(), (0..8).map(|k| a.at(k, k)).sum());
        assert!((eigenvalues.iter().sum::<f64>() - trace).abs() < 1e-10);
        let of_factor: f64 = (0..8).map(|k| 2.0 * l[k * 8 + k].ln()).sum();
        let determinant: f64 = eigenvalues.iter().map(|value| value.ln()).sum();
        assert!((determinant - of_factor).abs() < 1e-10, "{determinant} {of_factor}");
    }

    #[test]
    fn a_minimum_is_found_where_active_sets_go_in_circles() {
        let rows = [[14.1, -15.0, 10.0], [-15.0, 18.1, -12.0], [10.0, -12.0, 8.1]];
        let a = Symmetric::new(3, |row, column| rows[row][column]);
        let best = a.minimum_within(&[9.0, 5.0, -6.0], &[(-1.0, 1.0); 3]).unwrap();
        assert_eq!((best[0], best[2]), (1.0, -1.0));
        assert!((best[1] - 8.0 / 18.1).abs() < 1e-12, "{best:?}");
        let fixed = a.minimum_within(&[9.0, 5.0, -6.0], &[(0.0, 0.0); 3]);
        assert_eq!(fixed, Some(vec![0.0; 3]));
    }

    /// Against many random points between the bounds.
    #[test]
    fn nothing_between_the_bounds_is_lower_than_the_minimum() {
        let bounds = [(-0.3, 0.3); 6];
        let mut draws = NormalDeviates::new(1);
        for seed in 0..20 {
            let a = random(6, 100 + seed);
            let g: Vec<f64> = (0..6).map(|_| 3.0 * draws.normal()).collect();
            let value = |x: &[f64]| 0.5 * dot(x, &a.times(x)) - dot(&g, x);
            let best = a.minimum_within(&g, &bounds).unwrap();
            assert!(best.iter().all(|x| x.abs() <= 0.3));
            for _ in 0..2000 {
                let near = |x: &f64| (x + 0.1 * draws.normal()).clamp(-0.3, 0.3);
                let other: Vec<f64> = best.iter().map(near).collect();
                assert!(value(&other) >= value(&best) - 1e-12);
            }
        }
    }
}
