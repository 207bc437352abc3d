//! Ambiguity: which kinds of fault are confused with each other.

use super::data_set::DataSet;
use super::run::{RowOutcome, first_error};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::hierarchy::Question;
use std::collections::BTreeMap;

/// A kind of fault confused with another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Confused {
    /// The true kind, without the actuator.
    pub kind: String,
    /// The most frequent kind in the leaf where it ended.
    pub taken_for: String,
    /// The question answered wrongly.
    pub question: Question,
    /// The number of confusions.
    pub count: u64,
    /// Their share among all tests of the kind.
    pub share: f64,
}

/// All confusions between kinds of fault.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Ambiguity {
    /// Pairs, the most frequent first.
    pub pairs: Vec<Confused>,
    /// Kinds connected by pairs that make up at least `GROUPING` of a kind's tests.
    pub groups: Vec<Vec<String>>,
}

/// The least share of tests with which a pair connects two kinds.
pub(crate) const GROUPING: f64 = 0.05;

/// Counts the confusions of traced outcomes.
pub(crate) fn evaluate(data: &DataSet, outcomes: &[Vec<RowOutcome>]) -> Ambiguity {
    let mut tests = vec![0u64; data.kinds.len()];
    let mut counts: BTreeMap<(u32, u32, Question), u64> = BTreeMap::new();
    for outcome in outcomes.iter().flatten() {
        let kind = data.rows[outcome.row].kind;
        tests[kind as usize] += 1;
        let error = outcome.confused_with.zip(first_error(data, outcome));
        if let Some((other, question)) = error {
            *counts.entry((kind, other, question)).or_default() += 1;
        }
    }
    let share = |kind: u32, count: u64| count as f64 / tests[kind as usize] as f64;
    let mut sorted: Vec<_> = counts.into_iter().collect();
    // Stable sort: equally frequent pairs stay in the order of the kinds.
    sorted.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let joined = sorted.iter().filter(|((kind, _, _), count)| share(*kind, *count) >= GROUPING);
    let groups = groups(data.kinds.len(), joined.map(|((a, b, _), _)| (*a as usize, *b as usize)));
    let name = |kind: usize| data.kinds[kind].clone();
    let confused = |((kind, other, question), count): &((u32, u32, Question), u64)| Confused {
        kind: name(*kind as usize),
        taken_for: name(*other as usize),
        question: *question,
        count: *count,
        share: share(*kind, *count),
    };
    Ambiguity {
        pairs: sorted.iter().map(confused).collect(),
        groups: groups.into_iter().map(|group| group.into_iter().map(name).collect()).collect(),
    }
}

/// The connected components with more than one member.
fn groups(size: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Vec<Vec<usize>> {
    let mut root: Vec<usize> = (0..size).collect();
    for (a, b) in pairs {
        let (a, b) = (root[a].min(root[b]), root[a].max(root[b]));
        root.iter_mut().filter(|own| **own == b).for_each(|own| *own = a);
    }
    let members = |leader: usize| (0..size).filter(|&own| root[own] == leader).collect::<Vec<_>>();
    (0..size).map(members).filter(|group| group.len() > 1).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn groups_are_joined_through_common_members() {
        let pairs = [(0, 1), (3, 4), (4, 1)];
        assert_eq!(super::groups(6, pairs.into_iter()), [vec![0, 1, 3, 4]]);
    }
}
