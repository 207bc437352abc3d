//! Sparse LU factors without pivoting, planned once, computed in lanes.
//!
//! The order of elimination is found once per system by least Markowitz cost
//! (the number of updates that a pivot causes) on the diagonal. The numeric
//! work then follows flat lists, the same for every lane. There is no
//! pivoting for size: the matrix `I/(γh) − J` of a dissipative system has a
//! dominant diagonal for small steps, and the error control of the solver
//! rejects a step that bad factors have spoilt.

use crate::place::Place;
use crate::scalar::Lanes;
use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;

/// One unknown that is eliminated.
#[derive(Clone, Copy, Debug)]
struct Pivot {
    diagonal: Place,
    /// How many entries of its row of the upper factor stand before the diagonal.
    columns: u16,
    /// How many rows are eliminated.
    rows: u16,
}

/// One unknown of a triangular solution, and the number of its products.
#[derive(Clone, Copy, Debug)]
struct Unknown {
    target: Place,
    products: u32,
}

/// The plan of a factorisation of one sparsity pattern.
///
/// The factors stand in the order in which a solution reads them: the rows of the
/// lower factor, then those of the upper from the last pivot to the first, each
/// with its diagonal at the end.
#[derive(Clone, Debug)]
pub struct Plan {
    size: usize,
    positions: BTreeMap<(u16, u16), u16>,
    pivots: Vec<Pivot>,
    /// Of every pivot and eliminated row the entry that becomes a factor.
    factors: Vec<Place>,
    /// Of every factor what its products with the pivot's row are subtracted from.
    targets: Vec<Place>,
    /// The unknowns of both substitutions, in their order.
    forward: Vec<Unknown>,
    backward: Vec<Unknown>,
    /// The unknowns that the products read.
    sources: Vec<Place>,
}

impl Plan {
    /// Plans the factorisation of a `size × size` matrix with the given entries
    /// (row, column); the diagonal is always part of it.
    ///
    /// # Panics
    /// Where the factors have more than 65,536 entries.
    pub fn new(size: usize, entries: &[(u16, u16)]) -> Self {
        let mut rows: Vec<Vec<bool>> = vec![vec![false; size]; size];
        for &(i, j) in entries {
            rows[i as usize][j as usize] = true;
        }
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] = true;
        }
        let order = eliminate(&mut rows);
        let mut plan = Self {
            size,
            positions: BTreeMap::new(),
            pivots: Vec::new(),
            factors: Vec::new(),
            targets: Vec::new(),
            forward: Vec::new(),
            backward: Vec::new(),
            sources: Vec::new(),
        };
        let mut rank = vec![0; size];
        for (position, &index) in order.iter().enumerate() {
            rank[index as usize] = position;
        }
        plan.list_solution(&rows, &order, &rank);
        plan.list_eliminations(&order, &rank);
        plan
    }

    /// Number of values that the factors need.
    pub fn slots(&self) -> usize {
        self.positions.len()
    }

    /// Number of multiply-subtract operations of one factorisation.
    pub fn updates(&self) -> usize {
        self.targets.len()
    }

    /// Where the diagonal entries are stored.
    #[inline(always)]
    pub(crate) fn diagonals(&self) -> impl Iterator<Item = Place> {
        self.pivots.iter().map(|pivot| pivot.diagonal)
    }

    /// Where an entry is stored.
    ///
    /// # Panics
    /// Where the entry is not part of the pattern.
    pub fn slot(&self, row: u16, column: u16) -> u16 {
        self.positions[&(row, column)]
    }

    fn list_solution(&mut self, rows: &[Vec<bool>], order: &[u16], rank: &[usize]) {
        for &target in order {
            let unknown = self.unknown(target, rows, |s| rank[s] < rank[target as usize]);
            if unknown.products > 0 {
                self.forward.push(unknown);
            }
        }
        for &target in order.iter().rev() {
            let unknown = self.unknown(target, rows, |s| rank[s] > rank[target as usize]);
            self.backward.push(unknown);
            self.place(target, target);
        }
    }

    /// Lists the products of an unknown with the wanted sources.
    fn unknown(
        &mut self,
        target: u16,
        rows: &[Vec<bool>],
        wanted: impl Fn(usize) -> bool,
    ) -> Unknown {
        let row = &rows[target as usize];
        let before = self.sources.len();
        for source in (0..self.size).filter(|&s| row[s] && wanted(s)) {
            self.place(target, source as u16);
            self.sources.push(Place::new(source as u16));
        }
        Unknown { target: Place::new(target), products: (self.sources.len() - before) as u32 }
    }

    /// Gives an entry the next place.
    fn place(&mut self, row: u16, column: u16) {
        let place = u16::try_from(self.positions.len()).expect("at most 65,536 entries");
        self.positions.insert((row, column), place);
    }

    fn list_eliminations(&mut self, order: &[u16], rank: &[usize]) {
        let size = self.size as u16;
        for &pivot in order {
            let later = |&index: &u16| rank[index as usize] > rank[pivot as usize];
            let used = |&column: &u16| self.positions.contains_key(&(pivot, column));
            let columns: Vec<u16> = (0..size).filter(later).filter(used).collect();
            let before = self.factors.len();
            for row in (0..size).filter(later) {
                if let Some(&factor) = self.positions.get(&(row, pivot)) {
                    self.factors.push(Place::new(factor));
                    self.targets
                        .extend(columns.iter().map(|&c| Place::new(self.positions[&(row, c)])));
                }
            }
            self.pivots.push(Pivot {
                diagonal: Place::new(self.positions[&(pivot, pivot)]),
                columns: columns.len() as u16,
                rows: (self.factors.len() - before) as u16,
            });
        }
    }

    /// Factors in place. Afterwards the diagonal holds reciprocal pivots.
    ///
    /// A zero pivot gives infinities or NaN in its own lane only.
    #[inline(always)]
    pub fn factor<V: Lanes>(&self, values: &mut [V]) {
        assert!(values.len() >= self.slots());
        let values = values.as_mut_ptr();
        let mut factors = self.factors.as_ptr();
        let mut targets = self.targets.as_ptr();
        for pivot in &self.pivots {
            // SAFETY: the plan lists a factor for every row of a pivot and a target for
            // every column of every row, and all places are below `slots`.
            unsafe {
                let diagonal = pivot.diagonal.among(values);
                let right = diagonal.sub(pivot.columns as usize);
                let reciprocal = V::constant(1.0) / *diagonal;
                *diagonal = reciprocal;
                let last = factors.add(pivot.rows as usize);
                while factors != last {
                    let place = (*factors).among(values);
                    let factor = *place * reciprocal;
                    *place = factor;
                    for column in 0..pivot.columns as usize {
                        let target = (*targets).among(values);
                        *target = *target - factor * *right.add(column);
                        targets = targets.add(1);
                    }
                    factors = factors.add(1);
                }
            }
        }
    }

    /// Solves in place with the factors of [`Plan::factor`].
    #[inline(always)]
    pub fn solve<V: Lanes>(&self, values: &[V], x: &mut [V]) {
        assert!(values.len() >= self.slots() && x.len() >= self.size);
        let mut sources = self.sources.as_ptr();
        let mut values = values.as_ptr();
        let x = x.as_mut_ptr();
        // SAFETY: the plan lists a source for every product, and a value for every
        // product and every diagonal, in this order; all unknowns are below `size`.
        unsafe {
            for unknown in &self.forward {
                let sum = substitute(*unknown, &mut sources, &mut values, x);
                *unknown.target.among(x) = sum;
            }
            for unknown in &self.backward {
                let sum = substitute(*unknown, &mut sources, &mut values, x);
                *unknown.target.among(x) = sum * *values;
                values = values.add(1);
            }
        }
    }
}

/// `x[target]` less the unknown's products; moves on to the next unknown's.
///
/// # Safety
/// There must be a source and a value for every product, and all unknowns in `x`.
#[inline(always)]
unsafe fn substitute<V: Lanes>(
    unknown: Unknown,
    sources: &mut *const Place,
    values: &mut *const V,
    x: *mut V,
) -> V {
    // SAFETY: promised by the caller.
    unsafe {
        let mut sum = *unknown.target.among(x);
        let end = values.add(unknown.products as usize);
        while *values != end {
            sum = sum - **values * *(**sources).among(x);
            *values = values.add(1);
            *sources = sources.add(1);
        }
        sum
    }
}

/// Finds the order of elimination and adds the fill to the pattern.
fn eliminate(rows: &mut [Vec<bool>]) -> Vec<u16> {
    let size = rows.len();
    let mut left: Vec<usize> = (0..size).collect();
    let mut order = Vec::with_capacity(size);
    while !left.is_empty() {
        let cost = |&k: &usize| {
            let in_row = left.iter().filter(|&&j| rows[k][j]).count() - 1;
            let in_column = left.iter().filter(|&&i| rows[i][k]).count() - 1;
            (in_row * in_column, in_row + in_column, k)
        };
        let pivot = left.iter().copied().min_by_key(cost).expect("something is left");
        left.retain(|&k| k != pivot);
        order.push(pivot as u16);
        for &i in left.iter().filter(|&&i| rows[i][pivot]).collect::<Vec<_>>() {
            for &j in &left {
                if rows[pivot][j] {
                    rows[i][j] = true;
                }
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sparse_system_is_solved() {
        let entries = [(0, 3), (3, 0), (1, 0), (2, 1), (1, 2), (3, 2), (0, 1)];
        let plan = Plan::new(4, &entries);
        let mut dense = [[0.0; 4]; 4];
        let mut values = vec![0.0; plan.slots()];
        let all = entries.iter().copied().chain((0..4).map(|i| (i, i)));
        for (k, (i, j)) in all.enumerate() {
            let value = if i == j { 5.0 + i as f64 } else { 0.3 * (k as f64 + 1.0) };
            dense[i as usize][j as usize] = value;
            values[plan.slot(i, j) as usize] = value;
        }
        let expected = [1.0, -2.0, 0.5, 4.0];
        let mut x = [0.0; 4];
        for i in 0..4 {
            x[i] = (0..4).map(|j| dense[i][j] * expected[j]).sum();
        }
        plan.factor(&mut values);
        plan.solve(&values, &mut x);
        for i in 0..4 {
            assert!((x[i] - expected[i]).abs() < 1e-14, "{x:?}");
        }
    }
}
