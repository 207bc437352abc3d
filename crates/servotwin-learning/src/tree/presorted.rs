//! The rows sorted by every feature, shared by all nodes and trees.

use alloc::vec::Vec;

use crate::samples::Samples;

/// The rows of the samples in ascending order of each feature, and their ranks.
pub(crate) struct Presorted {
    rows: usize,
    /// Feature-major: the rows in ascending order of the feature, equal values by row.
    order: Vec<u32>,
    /// Feature-major: the rank of each row among the distinct values of the feature.
    rank: Vec<u32>,
}

/// Bits that sort as unsigned numbers in the order of the values; −0 sorts as 0, and NaN after all numbers.
pub(super) fn sortable_bits(value: f64) -> u64 {
    let bits = (value + 0.0).to_bits();
    if bits >> 63 == 1 { !bits } else { bits | (1 << 63) }
}

/// The value of [`sortable_bits`].
pub(super) fn value_of_bits(bits: u64) -> f64 {
    f64::from_bits(if bits >> 63 == 1 { bits & !(1 << 63) } else { !bits })
}

impl Presorted {
    /// Sorts every feature.
    pub(crate) fn new(samples: &Samples) -> Self {
        let rows = samples.rows();
        let mut order = Vec::with_capacity(rows * samples.features());
        let mut keys: Vec<(u64, u32)> = Vec::with_capacity(rows);
        for feature in 0..samples.features() {
            let column = samples.column(feature);
            keys.clear();
            keys.extend(column.iter().zip(0..).map(|(&value, row)| (sortable_bits(value), row)));
            keys.sort_unstable();
            order.extend(keys.iter().map(|&(_, row)| row));
        }
        Presorted { rows, order, rank: Vec::new() }
    }

    /// Sorts every feature and ranks the rows, for trees that draw features at each split.
    pub(crate) fn with_ranks(samples: &Samples) -> Self {
        let mut sorted = Presorted::new(samples);
        sorted.rank.resize(sorted.order.len(), 0);
        for feature in 0..samples.features() {
            let column = samples.column(feature);
            let first = feature * sorted.rows;
            let ranks = &mut sorted.rank[first..first + sorted.rows];
            let order = &sorted.order[first..first + sorted.rows];
            let mut rank = 0;
            for pair in order.windows(2) {
                let (value, next) = (column[pair[0] as usize], column[pair[1] as usize]);
                rank += u32::from(value < next || (next.is_nan() && !value.is_nan()));
                ranks[pair[1] as usize] = rank;
            }
        }
        sorted
    }

    /// The rows in ascending order of a feature.
    pub(crate) fn order(&self, feature: usize) -> &[u32] {
        &self.order[feature * self.rows..(feature + 1) * self.rows]
    }

    /// The ranks of all rows in a feature; only after [`Presorted::with_ranks`].
    pub(crate) fn rank(&self, feature: usize) -> &[u32] {
        &self.rank[feature * self.rows..(feature + 1) * self.rows]
    }
}

#[cfg(test)]
mod tests {
    use super::{sortable_bits, value_of_bits};

    #[test]
    fn bits_sort_as_numbers() {
        let ascending = [f64::MIN, -2.0, -1.0, -5e-324, 0.0, 5e-324, 1.0, f64::MAX];
        assert!(ascending.windows(2).all(|pair| sortable_bits(pair[0]) < sortable_bits(pair[1])));
        assert_eq!(ascending.map(|value| value_of_bits(sortable_bits(value))), ascending);
        assert_eq!(sortable_bits(-0.0), sortable_bits(0.0));
        assert!(sortable_bits(f64::MAX) < sortable_bits(f64::NAN.copysign(1.0)));
    }
}
