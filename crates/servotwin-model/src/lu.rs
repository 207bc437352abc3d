//! Sparse LU factors without pivoting, planned once, computed in lanes.
//!
//! The order of elimination is found once per system by least Markowitz cost
//! (the number of updates that a pivot causes) on the diagonal. The numeric
//! work is then two flat lists of slots, the same for every lane. There is no
//! pivoting for size: the matrix `I/(γh) − J` of a dissipative system has a
//! dominant diagonal for small steps, and the error control of the solver
//! rejects a step that bad factors have spoilt.

use crate::scalar::Lanes;
use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;

/// One unknown that is eliminated, and where its eliminations end.
#[derive(Clone, Copy, Debug)]
struct Pivot {
    diagonal: u16,
    eliminations_end: u32,
}

/// One row that a pivot eliminates: `value[factor] ·= 1/pivot`, then updates.
#[derive(Clone, Copy, Debug)]
struct Elimination {
    factor: u16,
    updates_end: u32,
}

/// One target of an elimination: `value[target] −= value[factor] · value[right]`.
#[derive(Clone, Copy, Debug)]
struct Update {
    target: u16,
    right: u16,
}

/// One product of a triangular solution: `x[target] −= value[slot] · x[source]`.
#[derive(Clone, Copy, Debug)]
struct Product {
    slot: u16,
    source: u16,
}

/// One unknown of a triangular solution, and where its products end.
#[derive(Clone, Copy, Debug)]
struct Unknown {
    target: u16,
    diagonal: u16,
    products_end: u32,
}

/// The plan of a factorisation of one sparsity pattern.
#[derive(Clone, Debug)]
pub struct Plan {
    size: usize,
    slots: usize,
    diagonal: Vec<u16>,
    positions: BTreeMap<(u16, u16), u16>,
    order: Vec<u16>,
    pivots: Vec<Pivot>,
    eliminations: Vec<Elimination>,
    updates: Vec<Update>,
    /// The products of the unknowns `forward`, then of the unknowns `backward`,
    /// each in the order of the substitution.
    products: Vec<Product>,
    forward: Vec<Unknown>,
    backward: Vec<Unknown>,
}

impl Plan {
    /// Plans the factorisation of a `size × size` matrix with the given entries
    /// (row, column); the diagonal is always part of it.
    ///
    /// # Panics
    /// Where the factors have more than 65,535 entries.
    pub fn new(size: usize, entries: &[(u16, u16)]) -> Self {
        let mut rows: Vec<Vec<bool>> = vec![vec![false; size]; size];
        for &(i, j) in entries {
            rows[i as usize][j as usize] = true;
        }
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] = true;
        }
        let order = eliminate(&mut rows);
        let mut positions = BTreeMap::new();
        for (i, row) in rows.iter().enumerate() {
            for (j, _) in row.iter().enumerate().filter(|(_, used)| **used) {
                let slot = u16::try_from(positions.len()).expect("at most 65,535 entries");
                positions.insert((i as u16, j as u16), slot);
            }
        }
        let mut plan = Self {
            size,
            slots: positions.len(),
            diagonal: (0..size as u16).map(|i| positions[&(i, i)]).collect(),
            positions,
            order,
            pivots: Vec::new(),
            eliminations: Vec::new(),
            updates: Vec::new(),
            products: Vec::new(),
            forward: Vec::new(),
            backward: Vec::new(),
        };
        plan.list_eliminations();
        plan.list_solution();
        plan
    }

    /// Number of values that the factors need.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Number of multiply-subtract operations of one factorisation.
    pub fn updates(&self) -> usize {
        self.updates.len()
    }

    /// Where the diagonal entry of a row is stored.
    pub fn diagonal(&self, row: usize) -> usize {
        self.diagonal[row] as usize
    }

    /// Where an entry is stored.
    ///
    /// # Panics
    /// Where the entry is not part of the pattern.
    pub fn slot(&self, row: u16, column: u16) -> u16 {
        self.positions[&(row, column)]
    }

    fn list_eliminations(&mut self) {
        let rank = self.ranks();
        for &pivot in &self.order {
            for row in 0..self.size as u16 {
                if rank[row as usize] <= rank[pivot as usize] {
                    continue;
                }
                let Some(&factor) = self.positions.get(&(row, pivot)) else {
                    continue;
                };
                for column in 0..self.size as u16 {
                    if rank[column as usize] <= rank[pivot as usize] {
                        continue;
                    }
                    if let Some(&right) = self.positions.get(&(pivot, column)) {
                        let target = self.positions[&(row, column)];
                        self.updates.push(Update { target, right });
                    }
                }
                let updates_end = self.updates.len() as u32;
                self.eliminations.push(Elimination { factor, updates_end });
            }
            self.pivots.push(Pivot {
                diagonal: self.diagonal[pivot as usize],
                eliminations_end: self.eliminations.len() as u32,
            });
        }
    }

    fn list_solution(&mut self) {
        let rank = self.ranks();
        for target in self.order.clone() {
            let unknown = self.unknown(target, |source| rank[source] < rank[target as usize]);
            self.forward.extend(unknown);
        }
        for target in self.order.clone().into_iter().rev() {
            let before = self.products.len() as u32;
            let unknown = self.unknown(target, |source| rank[source] > rank[target as usize]);
            self.backward.push(unknown.unwrap_or(Unknown {
                target,
                diagonal: self.diagonal[target as usize],
                products_end: before,
            }));
        }
    }

    /// Lists the products of an unknown with the wanted sources; `None` where
    /// there are none.
    fn unknown(&mut self, target: u16, wanted: impl Fn(usize) -> bool) -> Option<Unknown> {
        let before = self.products.len();
        for source in (0..self.size as u16).filter(|&s| wanted(s as usize)) {
            if let Some(&slot) = self.positions.get(&(target, source)) {
                self.products.push(Product { slot, source });
            }
        }
        (self.products.len() > before).then(|| Unknown {
            target,
            diagonal: self.diagonal[target as usize],
            products_end: self.products.len() as u32,
        })
    }

    fn ranks(&self) -> Vec<u16> {
        let mut rank = vec![0; self.size];
        for (position, &index) in self.order.iter().enumerate() {
            rank[index as usize] = position as u16;
        }
        rank
    }

    /// Factors in place. Afterwards the diagonal holds reciprocal pivots.
    ///
    /// A zero pivot gives infinities or NaN in its own lane only.
    #[inline(always)]
    pub fn factor<V: Lanes>(&self, values: &mut [V]) {
        assert!(values.len() >= self.slots);
        let mut elimination = 0;
        let mut update = 0;
        for p in &self.pivots {
            let reciprocal = V::constant(1.0) / values[p.diagonal as usize];
            values[p.diagonal as usize] = reciprocal;
            for e in &self.eliminations[elimination..p.eliminations_end as usize] {
                let factor = values[e.factor as usize] * reciprocal;
                values[e.factor as usize] = factor;
                for u in &self.updates[update..e.updates_end as usize] {
                    // SAFETY: every slot of the plan is below `slots`.
                    unsafe {
                        let product = factor * *values.get_unchecked(u.right as usize);
                        let target = values.get_unchecked_mut(u.target as usize);
                        *target = *target - product;
                    }
                }
                update = e.updates_end as usize;
            }
            elimination = p.eliminations_end as usize;
        }
    }

    /// Solves in place with the factors of [`Plan::factor`].
    #[inline(always)]
    pub fn solve<V: Lanes>(&self, values: &[V], x: &mut [V]) {
        assert!(values.len() >= self.slots && x.len() >= self.size);
        let mut next = 0;
        for unknown in &self.forward {
            // SAFETY: the plan's slots and unknowns are in range, asserted above.
            unsafe {
                let sum = self.substitute(*unknown, &mut next, values, x);
                *x.get_unchecked_mut(unknown.target as usize) = sum;
            }
        }
        for unknown in &self.backward {
            // SAFETY: as above.
            unsafe {
                let sum = self.substitute(*unknown, &mut next, values, x);
                let pivot = *values.get_unchecked(unknown.diagonal as usize);
                *x.get_unchecked_mut(unknown.target as usize) = sum * pivot;
            }
        }
    }

    /// `x[target]` less the products from `next` on.
    ///
    /// # Safety
    /// `values` must have all slots, `x` all unknowns.
    #[inline(always)]
    unsafe fn substitute<V: Lanes>(
        &self,
        unknown: Unknown,
        next: &mut usize,
        values: &[V],
        x: &[V],
    ) -> V {
        // SAFETY: promised by the caller; the plan's own lists end where it says.
        unsafe {
            let mut sum = *x.get_unchecked(unknown.target as usize);
            while *next < unknown.products_end as usize {
                let p = *self.products.get_unchecked(*next);
                let value = *values.get_unchecked(p.slot as usize);
                sum = sum - value * *x.get_unchecked(p.source as usize);
                *next += 1;
            }
            sum
        }
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
