//! Binned feature values, and sums over the rows of each bin, for the splits of boosted trees and of single trees on
//! many rows.
//!
//! Source: Ke et al., "LightGBM: A Highly Efficient Gradient Boosting Decision Tree", NIPS 2017.

use alloc::borrow::Cow;
use alloc::vec;
use alloc::vec::Vec;

use super::presorted::{sortable_bits, value_of_bits};
use crate::samples::Samples;
use servotwin_diagnosis::random::Random;

/// Number of rows that suffice to place the bins.
const ENOUGH: usize = 10_000;

/// Number of columns summed at once: their sums are independent of each other.
const TOGETHER: usize = 4;

/// The bin of every row in every feature that varies.
pub(crate) struct Bins {
    rows: usize,
    max_bins: usize,
    /// The feature of each binned column.
    features: Vec<usize>,
    /// Number of bins of each column.
    counts: Vec<usize>,
    /// Column-major: the bin of every row.
    table: Vec<u8>,
    /// Column-major: the lowest and the highest value in each of `max_bins` bins.
    bounds: Vec<(f64, f64)>,
}

impl Bins {
    /// Divides the values of `rows` into at most `max_bins` bins a feature (2 to 256), each with equally many distinct
    /// values. With more than [`ENOUGH`] rows, a random sample of them places the bins.
    pub(crate) fn new(samples: &Samples, rows: &[u32], max_bins: usize) -> Self {
        let (features, counts, table, bounds) = (vec![], vec![], vec![], vec![]);
        let mut bins = Bins { rows: samples.rows(), max_bins, features, counts, table, bounds };
        let drawn = drawn(rows);
        let (mut keys, mut values) = (vec![], vec![]);
        for feature in 0..samples.features() {
            let column = samples.column(feature);
            keys.clear();
            keys.extend(drawn.iter().map(|&row| sortable_bits(column[row as usize])));
            keys.sort_unstable();
            values.clear();
            values.extend(keys.iter().map(|&key| value_of_bits(key)));
            values.dedup();
            if values.len() > 1 {
                bins.add_column(feature, column, &ends_of(&values, max_bins), rows);
            }
        }
        bins
    }

    /// Adds a column; `ends` are the upper ends of all bins except the last.
    fn add_column(&mut self, feature: usize, column: &[f64], ends: &[f64], rows: &[u32]) {
        let first = self.table.len();
        self.table.resize(first + column.len(), 0);
        Search::new(ends).places_into(column, &mut self.table[first..]);
        self.features.push(feature);
        self.counts.push(ends.len() + 1);
        let own = self.bounds.len();
        self.bounds.resize(own + self.max_bins, (f64::INFINITY, f64::NEG_INFINITY));
        let (bins, bounds) = (&self.table[first..], &mut self.bounds[own..]);
        for &row in rows {
            let (low, high) = &mut bounds[usize::from(bins[row as usize])];
            *low = low.min(column[row as usize]);
            *high = high.max(column[row as usize]);
        }
    }

    /// Maximum number of bins of a column.
    pub(crate) fn max_bins(&self) -> usize {
        self.max_bins
    }

    /// Number of binned columns.
    pub(crate) fn columns(&self) -> usize {
        self.features.len()
    }

    /// The feature of a binned column.
    pub(crate) fn feature(&self, column: usize) -> usize {
        self.features[column]
    }

    /// Number of bins of a column, at least 2.
    pub(crate) fn count(&self, column: usize) -> usize {
        self.counts[column]
    }

    /// The bins of all rows in a column, ascending with the feature's values.
    pub(crate) fn column(&self, column: usize) -> &[u8] {
        &self.table[column * self.rows..(column + 1) * self.rows]
    }

    /// The lowest and the highest value in each bin of a column.
    pub(crate) fn bounds(&self, column: usize) -> &[(f64, f64)] {
        &self.bounds[column * self.max_bins..][..self.counts[column]]
    }

    /// Sums over `rows` in every bin of some columns. `parts` holds `width` numbers for each of these rows. `sums`
    /// receives `width` numbers for each of `max_bins` bins of each column.
    pub(crate) fn sum_into(
        &self,
        columns: &[usize],
        rows: &[u32],
        parts: &[f64],
        width: usize,
        sums: &mut [f64],
    ) {
        sums.fill(0.0);
        let stride = self.max_bins * width;
        let groups = sums.chunks_mut(TOGETHER * stride).zip(columns.chunks(TOGETHER));
        for (sums, columns) in groups {
            match width {
                // The widths of two, three and four classes have specialized code.
                2 => self.add_group::<2>(columns, rows, parts, sums),
                6 => self.add_group::<6>(columns, rows, parts, sums),
                8 => self.add_group::<8>(columns, rows, parts, sums),
                _ => {
                    for (sums, &column) in sums.chunks_mut(stride).zip(columns) {
                        add(self.column(column), rows, parts, width, sums);
                    }
                }
            }
        }
    }

    fn add_group<const WIDTH: usize>(
        &self,
        columns: &[usize],
        rows: &[u32],
        parts: &[f64],
        sums: &mut [f64],
    ) {
        let (parts, _) = parts.as_chunks::<WIDTH>();
        let (sums, _) = sums.as_chunks_mut::<WIDTH>();
        match *columns {
            [a, b, c, d] => {
                let columns = [a, b, c, d].map(|column| self.column(column));
                add_together(columns, rows, parts, sums, self.max_bins);
            }
            _ => {
                for (sums, &column) in sums.chunks_mut(self.max_bins).zip(columns) {
                    add_together([self.column(column)], rows, parts, sums, 0);
                }
            }
        }
    }
}

/// A random sample of the rows if there are more than enough.
fn drawn(rows: &[u32]) -> Cow<'_, [u32]> {
    if rows.len() <= ENOUGH {
        return Cow::Borrowed(rows);
    }
    let mut random = Random::new(0);
    (0..ENOUGH).map(|_| rows[random.index(rows.len())]).collect()
}

/// The last values of all bins except the last; `values` are distinct and ascending.
fn ends_of(values: &[f64], max_bins: usize) -> Vec<f64> {
    let bins = values.len().min(max_bins);
    (1..bins).map(|bin| values[bin * values.len() / bins - 1]).collect()
}

/// Number of values looked up at once: their searches are independent of each other.
const AT_ONCE: usize = 8;

/// Finds values among the ends of bins. Every search takes the same steps.
struct Search {
    /// Ascending and padded with infinity. The search reads a power of two less one of them.
    ends: [f64; 256],
    steps: u32,
}

impl Search {
    /// Accepts at most 255 ascending ends.
    fn new(ends: &[f64]) -> Self {
        let mut all = [f64::INFINITY; 256];
        all[..ends.len()].copy_from_slice(ends);
        Search { ends: all, steps: usize::BITS - ends.len().leading_zeros() }
    }

    /// Writes the number of ends below each value.
    fn places_into(&self, values: &[f64], places: &mut [u8]) {
        for (values, places) in values.chunks(AT_ONCE).zip(places.chunks_mut(AT_ONCE)) {
            let mut own = [0.0; AT_ONCE];
            own[..values.len()].copy_from_slice(values);
            places.copy_from_slice(&self.places(own)[..values.len()]);
        }
    }

    fn places(&self, values: [f64; AT_ONCE]) -> [u8; AT_ONCE] {
        let mut places = [0_u8; AT_ONCE];
        for step in (0..self.steps).rev() {
            let half = 1_u8 << step;
            for (place, value) in places.iter_mut().zip(values) {
                let is_below = self.ends[usize::from(*place + (half - 1))] < value;
                *place += u8::from(is_below) * half;
            }
        }
        places
    }
}

/// Adds the parts of rows to the bins of columns; the sums of two columns are `stride` entries apart.
fn add_together<const WIDTH: usize, const COLUMNS: usize>(
    columns: [&[u8]; COLUMNS],
    rows: &[u32],
    parts: &[[f64; WIDTH]],
    sums: &mut [[f64; WIDTH]],
    stride: usize,
) {
    for (&row, parts) in rows.iter().zip(parts) {
        for (place, column) in columns.iter().enumerate() {
            let sum = &mut sums[place * stride + usize::from(column[row as usize])];
            for (sum, part) in sum.iter_mut().zip(parts) {
                *sum += part;
            }
        }
    }
}

/// Adds the parts of rows to the bins of one column.
fn add(column: &[u8], rows: &[u32], parts: &[f64], width: usize, sums: &mut [f64]) {
    for (&row, parts) in rows.iter().zip(parts.chunks_exact(width)) {
        let first = usize::from(column[row as usize]) * width;
        for (sum, part) in sums[first..first + width].iter_mut().zip(parts) {
            *sum += part;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    fn samples(columns: &[&[f64]]) -> Samples {
        let names = (0..columns.len()).map(|column| column.to_string()).collect();
        let labels = vec![0; columns[0].len()];
        Samples::from_columns(names, vec!["a".into()], columns.concat(), labels).unwrap()
    }

    #[test]
    fn bins_hold_equal_numbers_of_distinct_values() {
        let six = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(ends_of(&six, 3), [2.0, 4.0]);
        assert_eq!(ends_of(&six[..2], 8), [1.0]);
        let samples = samples(&[&[3.0, -1.0, 3.0, 9.0], &[5.0, 5.0, 5.0, 5.0]]);
        let bins = Bins::new(&samples, &[0, 1, 2, 3], 8);
        assert_eq!((bins.columns(), bins.feature(0), bins.count(0)), (1, 0, 3));
        assert_eq!(bins.column(0), [1, 0, 1, 2]);
        assert_eq!(bins.bounds(0), [(-1.0, -1.0), (3.0, 3.0), (9.0, 9.0)]);
        // A row outside the training rows forms no bin, but is in one.
        assert_eq!(Bins::new(&samples, &[0, 1, 2], 8).column(0), [1, 0, 1, 1]);
    }

    #[test]
    fn every_search_finds_how_many_ends_are_below() {
        for count in [0, 1, 2, 3, 7, 8, 63, 200, 255] {
            let ends: Vec<f64> = (0..count).map(|k| f64::from(k) * 0.5).collect();
            let extreme = [f64::NEG_INFINITY, -0.0, f64::INFINITY, f64::NAN];
            let values: Vec<f64> = (-3..530).map(|k| f64::from(k) * 0.25).chain(extreme).collect();
            let mut places = vec![0; values.len()];
            Search::new(&ends).places_into(&values, &mut places);
            for (value, place) in values.iter().zip(places) {
                let below = ends.iter().filter(|end| *end < value).count();
                assert_eq!(usize::from(place), below, "{value} among {count}");
            }
        }
    }

    #[test]
    fn sums_of_every_width_and_number_of_columns_are_those_of_the_bins() {
        let columns: Vec<Vec<f64>> =
            (1..=6).map(|k| (0..40).map(|row| f64::from(row * k % 7)).collect()).collect();
        let samples = samples(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let all: Vec<u32> = (0..40).collect();
        let bins = Bins::new(&samples, &all, 7);
        let rows: Vec<u32> = all.iter().copied().filter(|row| row % 3 > 0).collect();
        for width in [2, 4, 6, 8, 10] {
            let parts: Vec<f64> = (0..rows.len() * width).map(|part| part as f64).collect();
            let mut sums = vec![f64::NAN; 5 * 7 * width];
            bins.sum_into(&[0, 1, 2, 4, 5], &rows, &parts, width, &mut sums);
            for (place, column) in [0, 1, 2, 4, 5].into_iter().enumerate() {
                for bin in 0..7 {
                    for part in 0..width {
                        let of_bin = |&at: &usize| {
                            usize::from(bins.column(column)[rows[at] as usize]) == bin
                        };
                        let expected: f64 =
                            (0..rows.len()).filter(of_bin).map(|at| parts[at * width + part]).sum();
                        assert_eq!(sums[(place * 7 + bin) * width + part], expected);
                    }
                }
            }
        }
    }
}
