//! Rows that reach every leaf of a tree and both sides of every threshold.
//!
//! The values that lead to a node form a box: an interval for each feature that a test above it reads. From a point of
//! this box, the node's own feature is set one step below its threshold, to the threshold, one step above it,
//! and to no value. A test that repeats a feature can leave a node without any row; such nodes are counted.

use servotwin_diagnosis::tree::Branches;
use std::collections::BTreeMap;

/// Values above the first bound, up to and including the second.
type Interval = (f64, f64);

/// A row at a test of a tree.
pub(super) struct TestRow {
    /// The tested node.
    pub(crate) node: usize,
    /// All features that the tree reads on the way, by place in the stage's row.
    pub(crate) values: BTreeMap<usize, f64>,
}

/// The rows of a tree, and the nodes that no row reaches.
pub(super) struct Rows {
    pub(crate) rows: Vec<TestRow>,
    pub(crate) unreachable: Vec<usize>,
}

impl Rows {
    /// The rows of all tests.
    pub(crate) fn of(branches: &Branches) -> Self {
        let mut rows = Rows { rows: Vec::new(), unreachable: Vec::new() };
        rows.visit(branches, 0, &BTreeMap::new());
        rows
    }

    fn visit(&mut self, branches: &Branches, node: usize, above: &BTreeMap<usize, Interval>) {
        if above.values().any(|&(low, high)| low.next_up() > high) {
            self.unreachable.push(node);
        }
        let test = branches.split(node).zip(branches.children(node));
        let Some(((feature, threshold), (left, right))) = test else { return };
        let (low, high) =
            above.get(&feature).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let tried = [threshold.next_down(), threshold, threshold.next_up()];
        let inside = tried.into_iter().filter(|value| *value > low && *value <= high);
        // A value that is missing here was missing in the tests above too, which then led elsewhere.
        let missing = (!above.contains_key(&feature)).then_some(f64::NAN);
        for value in inside.chain(missing) {
            let mut values: BTreeMap<usize, f64> =
                above.iter().map(|(&place, &interval)| (place, within(interval))).collect();
            values.insert(feature, value);
            self.rows.push(TestRow { node, values });
        }
        for (child, interval) in
            [(left, (low, high.min(threshold))), (right, (low.max(threshold), high))]
        {
            let mut above = above.clone();
            above.insert(feature, interval);
            self.visit(branches, child, &above);
        }
    }
}

/// A value of an interval.
fn within((low, high): Interval) -> f64 {
    let middle = 0.5 * low + 0.5 * high;
    match (low.is_finite(), high.is_finite()) {
        (true, true) if middle > low && middle <= high => middle,
        (true, false) => low.next_up().max(low + 1.0),
        (false, false) => 0.0,
        _ => high,
    }
}
