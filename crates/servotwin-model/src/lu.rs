//! Sparse LU factorization without pivoting, planned once and computed in lanes.
//!
//! The order of elimination is determined once per system by the smallest Markowitz cost
//! (the number of updates that a pivot causes) on the diagonal. The numeric
//! work then follows flat lists in `equal_length_groups`, the same for every lane.
//! Every entry of the factors, and every unknown, is a number minus a sum of products.
//! There is no pivoting for size: the matrix `I/(γh) − J` of a dissipative system has a
//! dominant diagonal for small steps, and the solver's error control
//! rejects a step that inaccurate factors have spoiled.

use crate::equal_length_groups::{EqualLengthGroup, equal_length_groups, group_by_shape, unrolled};
use crate::lane_offset::LaneOffset;
use crate::scalar::Scalar;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec;
use alloc::vec::Vec;
use core::mem;

/// A product that is subtracted from an entry of the factors.
#[derive(Clone, Copy, Debug)]
struct Product {
    lower: LaneOffset,
    upper: LaneOffset,
}

/// An entry of the factors.
#[derive(Clone, Copy, Debug)]
struct Entry {
    target: LaneOffset,
    /// Offset of the entry of the Jacobian.
    source: LaneOffset,
    /// Offset of the column's diagonal, for an entry of the lower factor.
    diagonal: LaneOffset,
}

/// The part of the factors that an entry belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Lower,
    Diagonal,
    Upper,
}

/// One of the two substitutions of a solution: its unknowns in order, and the
/// unknowns that their products read.
#[derive(Clone, Debug, Default)]
struct Substitution {
    groups: Vec<EqualLengthGroup<usize>>,
    targets: Vec<LaneOffset>,
    sources: Vec<LaneOffset>,
}

/// The LU factorization of one sparsity pattern.
///
/// The factors are stored in the order in which a solution reads them: the rows of the
/// lower factor, then those of the upper factor from the last pivot to the first, each
/// with its diagonal at the end.
#[derive(Clone, Debug)]
pub struct SparseLu {
    size: usize,
    positions: BTreeMap<(u16, u16), u16>,
    /// The entries of the factors in the order of their computation, grouped by part and
    /// number of products.
    groups: Vec<EqualLengthGroup<(Part, usize)>>,
    entries: Vec<Entry>,
    products: Vec<Product>,
    /// Required length of the array that holds the Jacobian.
    gradients: usize,
    forward: Substitution,
    backward: Substitution,
}

/// The pattern with its fill, and the order of elimination.
struct Elimination {
    rows: Vec<BTreeSet<usize>>,
    /// The position of every unknown in the order.
    rank: Vec<usize>,
}

impl SparseLu {
    /// Plans the factorization of `diagonal · I − J` for a `size × size` matrix J with
    /// the given entries: (row, column, index in an array). `absent` is the index of a
    /// zero in that array.
    ///
    /// Returns `None` if the factors have more entries than can be addressed.
    pub(crate) fn new(size: usize, entries: &[(u16, u16, u16)], absent: u16) -> Option<Self> {
        let mut rows: Vec<BTreeSet<usize>> = (0..size).map(|i| BTreeSet::from([i])).collect();
        for &(i, j, _) in entries {
            rows[i as usize].insert(j as usize);
        }
        let order = eliminate(&mut rows);
        if rows.iter().map(BTreeSet::len).sum::<usize>() > usize::from(u16::MAX) {
            return None;
        }
        let mut rank = vec![0; size];
        for (position, &index) in order.iter().enumerate() {
            rank[index as usize] = position;
        }
        let elimination = Elimination { rows, rank };
        let mut lu = Self {
            size,
            positions: BTreeMap::new(),
            groups: Vec::new(),
            entries: Vec::new(),
            products: Vec::new(),
            gradients: 1 + entries.iter().fold(absent, |most, entry| most.max(entry.2)) as usize,
            forward: Substitution::default(),
            backward: Substitution::default(),
        };
        lu.forward = lu.substitution(&elimination, Part::Lower);
        lu.backward = lu.substitution(&elimination, Part::Upper);
        let sources = entries.iter().map(|&(i, j, source)| ((i, j), source)).collect();
        lu.list_entries(&elimination, &sources, absent);
        Some(lu)
    }

    /// Number of values that the factors need.
    pub fn slots(&self) -> usize {
        self.positions.len()
    }

    /// Number of multiply-subtract operations of one factorization.
    pub fn updates(&self) -> usize {
        self.products.len()
    }

    /// Lists one of the substitutions and assigns positions to its factors.
    fn substitution(&mut self, elimination: &Elimination, part: Part) -> Substitution {
        let sources: Vec<Vec<usize>> = (0..self.size)
            .map(|target| {
                let of_part = |&source: &usize| elimination.part(target, source) == part;
                elimination.rows[target].iter().copied().filter(of_part).collect()
            })
            .collect();
        let lengths: Vec<usize> = sources.iter().map(Vec::len).collect();
        let mut order = group_by_shape(&lengths, &sources);
        if part == Part::Lower {
            // An unknown without products stays as it is.
            order.retain(|&target| lengths[target] > 0);
        }
        let mut listed = Substitution {
            groups: equal_length_groups(order.iter().map(|&target| lengths[target])),
            ..Substitution::default()
        };
        for &target in &order {
            for &source in &sources[target] {
                self.place(target, source);
                listed.sources.push(LaneOffset::new(source as u16));
            }
            if part == Part::Upper {
                self.place(target, target);
            }
            listed.targets.push(LaneOffset::new(target as u16));
        }
        listed
    }

    /// Assigns the next position to an entry.
    fn place(&mut self, row: usize, column: usize) {
        let place = u16::try_from(self.positions.len()).expect("at most 65,536 entries");
        self.positions.insert((row as u16, column as u16), place);
    }

    /// Lists how the entries of the factors follow from those of J; `sources` maps the
    /// entries of J to their indices.
    fn list_entries(
        &mut self,
        elimination: &Elimination,
        sources: &BTreeMap<(u16, u16), u16>,
        absent: u16,
    ) {
        let all: Vec<(u16, u16)> = self.positions.keys().copied().collect();
        let index = |entry: (u16, u16)| all.binary_search(&entry).expect("an entry");
        let (mut shapes, mut needs, mut pivots) = (Vec::new(), Vec::new(), Vec::new());
        for &(row, column) in &all {
            let part = elimination.part(row as usize, column as usize);
            let between = self.pivots(elimination, row, column);
            let factors = between.iter().flat_map(|&k| [index((row, k)), index((k, column))]);
            let diagonal = (part == Part::Lower).then(|| index((column, column)));
            needs.push(factors.chain(diagonal).collect());
            shapes.push((part, between.len()));
            pivots.push(between);
        }
        let order = group_by_shape(&shapes, &needs);
        self.groups = equal_length_groups(order.iter().map(|&entry| shapes[entry]));
        for entry in order {
            let (row, column) = all[entry];
            let position = |row, column| LaneOffset::new(self.positions[&(row, column)]);
            self.products.extend(
                pivots[entry]
                    .iter()
                    .map(|&k| Product { lower: position(row, k), upper: position(k, column) }),
            );
            self.entries.push(Entry {
                target: position(row, column),
                source: LaneOffset::new(*sources.get(&(row, column)).unwrap_or(&absent)),
                diagonal: position(column, column),
            });
        }
    }

    /// The pivots whose products are subtracted from an entry, in their order.
    fn pivots(&self, elimination: &Elimination, row: u16, column: u16) -> Vec<u16> {
        let rank = |k: usize| elimination.rank[k];
        let earlier = rank(row as usize).min(rank(column as usize));
        let of_row = elimination.rows[row as usize].iter().copied();
        let used =
            |k: &usize| rank(*k) < earlier && elimination.rows[*k].contains(&(column as usize));
        let mut pivots: Vec<usize> = of_row.filter(used).collect();
        pivots.sort_by_key(|&k| rank(k));
        pivots.into_iter().map(|k| k as u16).collect()
    }

    /// Computes the factors of `diagonal · I − J` from J in `gradients`. The
    /// diagonal of the factors holds reciprocal pivots.
    ///
    /// A zero pivot causes infinities or NaN in its own lane only.
    #[inline(always)]
    pub(crate) fn factor<V: Scalar<Base = V>>(
        &self,
        diagonal: V,
        gradients: &[V],
        values: &mut [V],
    ) {
        assert!(gradients.len() >= self.gradients && values.len() >= self.slots());
        let mut lists = Factoring {
            diagonal,
            gradients: gradients.as_ptr(),
            values: values.as_mut_ptr(),
            entries: self.entries.as_ptr(),
            products: self.products.as_ptr(),
        };
        for &EqualLengthGroup { shape: (part, products), count } in &self.groups {
            // SAFETY: the lists hold every entry of the groups and its products; all
            // offsets are below `slots` and `gradients`.
            unsafe {
                match part {
                    Part::Lower => unrolled!(products, |n| lists.make::<LOWER>(n, count)),
                    Part::Diagonal => unrolled!(products, |n| lists.make::<DIAGONAL>(n, count)),
                    Part::Upper => unrolled!(products, |n| lists.make::<UPPER>(n, count)),
                }
            }
        }
    }

    /// Solves in place with the factors of [`SparseLu::factor`].
    #[inline(always)]
    pub(crate) fn solve<V: Scalar<Base = V>>(&self, values: &[V], x: &mut [V]) {
        assert!(values.len() >= self.slots() && x.len() >= self.size);
        let mut values = values.as_ptr();
        let x = x.as_mut_ptr();
        // SAFETY: the lists hold a value and a source for every product, and after the
        // products of the second substitution a value for the diagonal, in the
        // order of the groups; all unknowns are below `size`.
        unsafe {
            values = self.forward.run::<V, false>(values, x);
            self.backward.run::<V, true>(values, x);
        }
    }
}

impl Elimination {
    fn part(&self, row: usize, column: usize) -> Part {
        match self.rank[row].cmp(&self.rank[column]) {
            core::cmp::Ordering::Less => Part::Upper,
            core::cmp::Ordering::Equal => Part::Diagonal,
            core::cmp::Ordering::Greater => Part::Lower,
        }
    }
}

/// [`Part`] as const parameters.
const LOWER: u8 = 0;
const DIAGONAL: u8 = 1;
const UPPER: u8 = 2;

/// The current position of a factorization in its lists.
struct Factoring<V> {
    diagonal: V,
    gradients: *const V,
    values: *mut V,
    entries: *const Entry,
    products: *const Product,
}

impl<V: Scalar<Base = V>> Factoring<V> {
    /// Computes `count` entries, each with the same number of products.
    ///
    /// # Safety
    /// The lists must hold that many more entries, with valid offsets.
    #[inline(always)]
    unsafe fn make<const PART: u8>(&mut self, products: usize, count: usize) {
        // SAFETY: promised by the caller.
        unsafe {
            for _ in 0..count {
                let entry = *self.entries;
                self.entries = self.entries.add(1);
                let mut sum = V::constant(-0.0) - *entry.source.among(self.gradients.cast_mut());
                if PART == DIAGONAL {
                    sum = self.diagonal + sum;
                }
                for _ in 0..products {
                    let Product { lower, upper } = *self.products;
                    sum = sum - *lower.among(self.values) * *upper.among(self.values);
                    self.products = self.products.add(1);
                }
                *entry.target.among(self.values) = match PART {
                    LOWER => sum * *entry.diagonal.among(self.values),
                    DIAGONAL => V::constant(1.0) / sum,
                    _ => sum,
                };
            }
        }
    }
}

impl Substitution {
    /// Substitutes and returns the pointer past the factors used.
    ///
    /// # Safety
    /// There must be a factor for every product and all unknowns in `x`. If the sums are
    /// `SCALED`, a diagonal must follow the factors of each unknown.
    #[inline(always)]
    unsafe fn run<V: Scalar<Base = V>, const SCALED: bool>(
        &self,
        values: *const V,
        x: *mut V,
    ) -> *const V {
        let mut lists = Substituting {
            values,
            targets: self.targets.as_ptr(),
            sources: self.sources.as_ptr(),
            x,
        };
        for &EqualLengthGroup { shape: products, count } in &self.groups {
            // SAFETY: promised by the caller.
            unsafe { unrolled!(products, |n| lists.solve::<SCALED>(n, count)) }
        }
        lists.values
    }
}

/// The current position of a substitution in its lists.
struct Substituting<V> {
    values: *const V,
    targets: *const LaneOffset,
    sources: *const LaneOffset,
    x: *mut V,
}

impl<V: Scalar<Base = V>> Substituting<V> {
    /// Solves for `count` unknowns, each with the same number of products.
    ///
    /// # Safety
    /// The lists must hold that many more unknowns, with valid offsets.
    #[inline(always)]
    unsafe fn solve<const SCALED: bool>(&mut self, products: usize, count: usize) {
        // SAFETY: promised by the caller.
        unsafe {
            for _ in 0..count {
                let target = (*self.targets).among(self.x);
                self.targets = self.targets.add(1);
                let mut sum = *target;
                for _ in 0..products {
                    sum = sum - *self.values * *(*self.sources).among(self.x);
                    self.values = self.values.add(1);
                    self.sources = self.sources.add(1);
                }
                if SCALED {
                    sum = sum * *self.values;
                    self.values = self.values.add(1);
                }
                *target = sum;
            }
        }
    }
}

/// Determines the order of elimination and adds the fill to the pattern.
fn eliminate(rows: &mut [BTreeSet<usize>]) -> Vec<u16> {
    let size = rows.len();
    // The remaining rows and columns, without the diagonal.
    let mut left: Vec<BTreeSet<usize>> = rows.to_vec();
    let mut columns: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); size];
    for (i, row) in left.iter_mut().enumerate() {
        row.remove(&i);
        for &j in row.iter() {
            columns[j].insert(i);
        }
    }
    let cost = |left: &[BTreeSet<usize>], columns: &[BTreeSet<usize>], k: usize| {
        let (in_row, in_column) = (left[k].len(), columns[k].len());
        (in_row * in_column, in_row + in_column, k)
    };
    let mut queue: BTreeSet<_> = (0..size).map(|k| cost(&left, &columns, k)).collect();
    let mut order = Vec::with_capacity(size);
    while let Some((.., pivot)) = queue.pop_first() {
        order.push(pivot as u16);
        let (of_row, of_column) = (mem::take(&mut left[pivot]), mem::take(&mut columns[pivot]));
        let touched: BTreeSet<usize> = of_row.union(&of_column).copied().collect();
        for &k in &touched {
            queue.remove(&cost(&left, &columns, k));
        }
        for &j in &of_row {
            columns[j].remove(&pivot);
        }
        for &i in &of_column {
            left[i].remove(&pivot);
            for &j in &of_row {
                rows[i].insert(j);
                if i != j {
                    left[i].insert(j);
                    columns[j].insert(i);
                }
            }
        }
        queue.extend(touched.iter().map(|&k| cost(&left, &columns, k)));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sparse_system_is_solved() {
        let entries = [(0, 3), (3, 0), (1, 0), (2, 1), (1, 2), (3, 2), (0, 1), (2, 2)];
        let placed: Vec<(u16, u16, u16)> =
            entries.iter().enumerate().map(|(k, &(i, j))| (i, j, k as u16 + 1)).collect();
        let lu = SparseLu::new(4, &placed, 0).unwrap();
        let mut dense = [[0.0; 4]; 4];
        let mut jacobian = vec![0.0; entries.len() + 1];
        for &(i, j, place) in &placed {
            jacobian[place as usize] = 0.3 * f64::from(place);
            dense[i as usize][j as usize] -= jacobian[place as usize];
        }
        for (i, row) in dense.iter_mut().enumerate() {
            row[i] += 5.0;
        }
        let expected = [1.0, -2.0, 0.5, 4.0];
        let mut x = [0.0; 4];
        for i in 0..4 {
            x[i] = (0..4).map(|j| dense[i][j] * expected[j]).sum();
        }
        let mut values = vec![0.0; lu.slots()];
        lu.factor(5.0, &jacobian, &mut values);
        lu.solve(&values, &mut x);
        for i in 0..4 {
            assert!((x[i] - expected[i]).abs() < 1e-14, "{x:?}");
        }
    }
}
