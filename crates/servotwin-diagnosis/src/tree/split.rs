//! The best threshold of one feature.

use super::criterion::Scan;

/// The smallest differences of a feature that a sensor resolves. Zero allows everything.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Limits {
    /// The two values on both sides of a threshold must differ by at least this.
    pub gap: f64,
    /// A threshold must be at least this far from zero.
    pub magnitude: f64,
}

impl Limits {
    fn allow(self, threshold: f64, gap: f64) -> bool {
        gap >= self.gap && libm::fabs(threshold) >= self.magnitude
    }

    /// Whether two neighbouring values lie where all thresholds around them are
    /// allowed. A first allowed threshold next to forbidden ones does not.
    fn allow_around(self, lower: f64, upper: f64) -> bool {
        let far = 4.0 * self.magnitude;
        self.gap == 0.0 && (self.magnitude == 0.0 || lower >= far || upper <= -far)
    }
}

/// A way to split a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub feature: usize,
    pub threshold: f64,
    pub gap: f64,
    /// The gap over the range of the feature's values at the node.
    pub margin: f64,
    /// Larger is better; comparable within one node.
    pub score: f64,
}

/// Scores that differ by less than this part are the same: they were summed in
/// another order.
const SAME_SCORE: f64 = 1e-12;

impl Candidate {
    /// Better; or as good with a wider margin, because a threshold in a wide gap
    /// is the one that unseen rows are likeliest to respect; or as good and as
    /// wide with a lower feature.
    pub fn beats(&self, other: &Option<Candidate>) -> bool {
        other.as_ref().is_none_or(|other| {
            let nearly = SAME_SCORE * libm::fabs(other.score);
            let same = libm::fabs(self.score - other.score) <= nearly;
            match same {
                true if self.margin == other.margin => self.feature < other.feature,
                true => self.margin > other.margin,
                false => self.score > other.score,
            }
        })
    }
}

/// What one feature offers at a node.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Offer {
    /// The best split that the limits allow; of equally good ones the one in the widest gap.
    pub allowed: Option<Candidate>,
    /// The best split that they forbid, if it is better than those allowed before it.
    pub forbidden: Option<Candidate>,
}

/// The rows of a node and how they count.
pub(crate) struct NodeRows<'a> {
    /// Rows in ascending order of the feature.
    pub sorted: &'a [u32],
    /// The feature's value of every row of the samples.
    pub column: &'a [f64],
    /// Label of every row of the samples.
    pub labels: &'a [u32],
    /// Weight of every row of the samples, as the impurity sees it.
    pub weights: &'a [f64],
}

impl NodeRows<'_> {
    /// Whether no other row shares the value of the one at a place in the order.
    fn is_single(&self, place: usize) -> bool {
        let value = |place: usize| self.sorted.get(place).map(|&row| self.column[row as usize]);
        value(place + 1) != value(place)
    }
}

/// The number that separates two neighbouring values: their middle, or the lower one where the
/// middle is rounded up to the upper one.
pub(crate) fn separate(lower: f64, upper: f64) -> f64 {
    let middle = lower / 2.0 + upper / 2.0;
    if lower <= middle && middle < upper { middle } else { lower }
}

/// Tries every threshold of a feature that can be the best. Between two values whose rows all have
/// one class it cannot: impurity is concave there (Fayyad and Irani, Machine Learning 8, 1992).
/// `scan` must have been started with the node's weights.
pub(crate) fn best_of_feature<S: Scan>(
    rows: &NodeRows,
    feature: usize,
    min_rows: usize,
    limits: Limits,
    scan: &mut S,
) -> Offer {
    let mut offer = Offer::default();
    let may_skip = min_rows <= 1;
    let value_at = |place: usize| rows.column[rows.sorted[place] as usize];
    let range = value_at(rows.sorted.len() - 1) - value_at(0);
    let mut worth = f64::NEG_INFINITY;
    let mut value = rows.column[rows.sorted[0] as usize];
    // Past this many rows on the left, too few are on the right.
    let last = rows.sorted.len() + 1 - min_rows.min(rows.sorted.len()).max(1);
    // Whether all rows of the current value have one class.
    let mut is_pure = true;
    for (left, pair) in (1..last).zip(rows.sorted.windows(2)) {
        let (row, next_row) = (pair[0] as usize, pair[1] as usize);
        scan.move_left(rows.labels[row] as usize, rows.weights[row]);
        let next = rows.column[next_row];
        let same_class = rows.labels[row] == rows.labels[next_row];
        if next > value {
            let lower = core::mem::replace(&mut value, next);
            let skipped = may_skip
                && is_pure
                && same_class
                && rows.is_single(left)
                && limits.allow_around(lower, next);
            is_pure = true;
            if skipped || left < min_rows {
                continue;
            }
            let score = scan.score();
            // First the comparison that nearly all thresholds fail.
            if score >= worth {
                let (threshold, gap) = (separate(lower, next), next - lower);
                let candidate = Candidate { feature, threshold, gap, margin: gap / range, score };
                if limits.allow(threshold, gap) {
                    if candidate.beats(&offer.allowed) {
                        worth = score - SAME_SCORE * libm::fabs(score);
                        offer.allowed = Some(candidate);
                    }
                } else if candidate.beats(&offer.forbidden) {
                    offer.forbidden = Some(candidate);
                }
            }
        } else {
            is_pure &= same_class;
        }
    }
    offer
}

#[cfg(test)]
mod tests {
    use super::separate;

    #[test]
    fn threshold_separates_any_two_values() {
        let pairs = [
            (1.0, 2.0, 1.5),
            (1.0, 1.0_f64.next_up(), 1.0),
            (1.0_f64.next_up(), 1.0_f64.next_up().next_up(), 1.0_f64.next_up()),
            (f64::MIN, f64::MAX, 0.0),
            (0.0, 5e-324, 0.0),
            (-5e-324, 0.0, -5e-324),
            (f64::MAX.next_down(), f64::MAX, f64::MAX.next_down()),
        ];
        for (lower, upper, expected) in pairs {
            assert_eq!(separate(lower, upper), expected, "{lower:e} {upper:e}");
        }
    }
}
