//! The best threshold of one feature.

use super::criterion::Scan;
use alloc::vec::Vec;
use servotwin_diagnosis::numeric::MAX_VALUE;

/// A possible split of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) feature: usize,
    pub(crate) threshold: f64,
    /// The gap between the two values beside the threshold, over the range of the feature's values at the node.
    pub(crate) margin: f64,
    /// Score of the split; larger is better; comparable within one node.
    pub(crate) score: f64,
    /// Whether rows without a value go left; `None` if the node has none.
    pub(crate) missing_left: Option<bool>,
}

/// Scores that differ by less than this part are equal: they differ only in the order of summation.
const SAME_SCORE: f64 = 1e-12;

impl Candidate {
    /// The smallest score that counts as equally good.
    pub(crate) fn worth(&self) -> f64 {
        self.score - SAME_SCORE * libm::fabs(self.score)
    }

    /// A higher score wins. Between equal scores the wider margin wins, because unseen rows most likely respect a
    /// threshold in a wide gap. The lower feature breaks the remaining ties.
    pub(crate) fn beats(&self, other: &Option<Candidate>) -> bool {
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

/// The rows of a node with values, labels and weights.
pub(crate) struct NodeRows<'a> {
    /// Rows in ascending order of the feature.
    pub(crate) sorted: &'a [u32],
    /// The feature's value for every row of the samples.
    pub(crate) column: &'a [f64],
    /// Label of every row of the samples.
    pub(crate) labels: &'a [u32],
    /// Weight of every row of the samples.
    pub(crate) weights: &'a [f64],
}

impl NodeRows<'_> {
    /// Number of rows with a value of the feature; they come first.
    fn known(&self) -> usize {
        let is_missing = |&row: &u32| self.column[row as usize].is_nan();
        match self.sorted.last().is_some_and(is_missing) {
            true => self.sorted.partition_point(|row| !is_missing(row)),
            false => self.sorted.len(),
        }
    }

    /// Whether the value at an index in the order is unique.
    fn is_single(&self, place: usize) -> bool {
        let value = |place: usize| self.sorted.get(place).map(|&row| self.column[row as usize]);
        value(place + 1) != value(place)
    }

    fn move_left<S: Scan>(&self, row: u32, scan: &mut S) {
        let row = row as usize;
        scan.move_left(self.labels[row] as usize, self.weights[row]);
    }
}

/// A threshold between two adjacent values: their middle, or the lower one if rounding lifts the middle to the upper
/// one.
///
/// Predicted rows may be 32-bit numbers. If the rounded values still differ, the threshold separates them, too.
pub(crate) fn separate(lower: f64, upper: f64) -> f64 {
    let middle = lower / 2.0 + upper / 2.0;
    let threshold = if lower <= middle && middle < upper { middle } else { lower };
    let (short_lower, short_upper) = (f64::from(lower as f32), f64::from(upper as f32));
    let is_safe = short_lower <= threshold && threshold < short_upper;
    // The larger one is below both upper values, because rounding keeps the order.
    if is_safe || short_lower >= short_upper { threshold } else { lower.max(short_lower) }
}

/// Moves the left rows to the front; both sides keep their order. Returns the number of left rows, their largest value,
/// and the smallest value of the others. `moving` is scratch memory.
pub(crate) fn divide_rows(
    rows: &mut [u32],
    moving: &mut Vec<u32>,
    values: &[f64],
    goes_left: impl Fn(usize, f64) -> bool,
) -> (usize, f64, f64) {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut middle = 0;
    moving.clear();
    for place in 0..rows.len() {
        let row = rows[place];
        let value = values[row as usize];
        if goes_left(row as usize, value) {
            low = low.max(value);
            rows[middle] = row;
            middle += 1;
        } else {
            high = high.min(value);
            moving.push(row);
        }
    }
    rows[middle..].copy_from_slice(moving);
    (middle, low, high)
}

/// The threshold of the test for a missing value: no number exceeds it.
const ANY_VALUE: f64 = MAX_VALUE;

/// Tries every threshold of a feature and keeps the best split. If the node has rows without a value, it tries every
/// threshold with these on either side, and the test for a missing value. `totals` are the node's weights. It omits
/// splits that send all rows to one side. The rows must have two different values, or a value and a missing one.
pub(crate) fn best_of_feature<S: Scan>(
    rows: &NodeRows,
    feature: usize,
    min_rows: usize,
    totals: &[f64],
    scan: &mut S,
    best: &mut Option<Candidate>,
) {
    let known = rows.known();
    let missing = rows.sorted.len() - known;
    scan.restart(totals);
    let mut own = None;
    let missing_left = (missing > 0).then_some(false);
    try_thresholds(rows, known, missing_left, feature, min_rows, scan, &mut own);
    if missing > 0 {
        if known >= min_rows && missing >= min_rows {
            // The scan has left the last value on the right.
            scan.restart(totals);
            rows.sorted[..known].iter().for_each(|&row| rows.move_left(row, scan));
            let (threshold, margin, score) = (ANY_VALUE, 1.0, scan.score());
            let given = Candidate { feature, threshold, margin, score, missing_left };
            if given.beats(&own) {
                own = Some(given);
            }
        }
        scan.restart(totals);
        rows.sorted[known..].iter().for_each(|&row| rows.move_left(row, scan));
        try_thresholds(rows, known, Some(true), feature, min_rows, scan, &mut own);
    }
    if let Some(own) = own.filter(|own| own.beats(best)) {
        *best = Some(own);
    }
}

/// Tries every threshold of a feature that can be the best. A threshold between two values whose rows all have one
/// class cannot. Impurity is concave there (Fayyad and Irani, Machine Learning 8, 1992), also with the same rows
/// without a value on one side. `scan` must have started with the node's weights, with rows without a value moved left
/// if they go there.
fn try_thresholds<S: Scan>(
    rows: &NodeRows,
    known: usize,
    missing_left: Option<bool>,
    feature: usize,
    min_rows: usize,
    scan: &mut S,
    best: &mut Option<Candidate>,
) {
    if known < 2 {
        return;
    }
    let missing = rows.sorted.len() - known;
    // Rows that are on a side before the first value.
    let (left_before, right_before) =
        if missing_left == Some(true) { (missing, 0) } else { (0, missing) };
    let may_skip = min_rows <= 1;
    let value_at = |place: usize| rows.column[rows.sorted[place] as usize];
    let range = value_at(known - 1) - value_at(0);
    let mut worth = best.as_ref().map_or(f64::NEG_INFINITY, Candidate::worth);
    let mut value = rows.column[rows.sorted[0] as usize];
    // With more rows on the left, too few remain on the right.
    let needed = min_rows.saturating_sub(right_before).max(1);
    let last = known + 1 - needed.min(known);
    // Whether all rows of the current value have one class.
    let mut is_pure = true;
    for (left, pair) in (1..last).zip(rows.sorted[..known].windows(2)) {
        let (row, next_row) = (pair[0] as usize, pair[1] as usize);
        scan.move_left(rows.labels[row] as usize, rows.weights[row]);
        let next = rows.column[next_row];
        let same_class = rows.labels[row] == rows.labels[next_row];
        if next > value {
            let lower = core::mem::replace(&mut value, next);
            let skipped = may_skip && is_pure && same_class && rows.is_single(left);
            is_pure = true;
            if skipped || left + left_before < min_rows {
                continue;
            }
            let score = scan.score();
            // First the comparison that nearly all thresholds fail.
            if score >= worth {
                let (threshold, margin) = (separate(lower, next), (next - lower) / range);
                let candidate = Candidate { feature, threshold, margin, score, missing_left };
                if candidate.beats(best) {
                    worth = candidate.worth();
                    *best = Some(candidate);
                }
            }
        } else {
            is_pure &= same_class;
        }
    }
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

    #[test]
    fn a_threshold_separates_what_32_bit_numbers_still_tell_apart() {
        let step = 2.0_f64.powi(-25); // Of 32-bit numbers between 1/4 and 1/2.
        for (lower, upper) in [(0.49, 1.1), (0.45, 1.4), (-0.3, 0.55), (0.51, 0.6), (0.1, 0.2)] {
            let (lower, upper) = (0.4375 + lower * step, 0.4375 + upper * step);
            let (short_lower, short_upper) = (f64::from(lower as f32), f64::from(upper as f32));
            let threshold = separate(lower, upper);
            assert!(lower <= threshold && threshold < upper, "{lower:e} {upper:e}");
            if short_lower < short_upper {
                assert!(short_lower <= threshold && threshold < short_upper, "{lower:e} {upper:e}");
            }
        }
    }
}
