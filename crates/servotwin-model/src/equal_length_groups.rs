//! Groups of items with the same shape.
//!
//! Lists of sums of products hold short sums of many lengths. Where the length changes
//! from one sum to the next, the processor mispredicts the loop's end, which costs as
//! much as ten products. The items are therefore sorted into *groups* of one shape, as
//! far as their dependencies allow, and a group's loop knows its length.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec;
use alloc::vec::Vec;

/// Consecutive items of one shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EqualLengthGroup<S> {
    pub(crate) shape: S,
    pub(crate) count: usize,
}

/// Evaluates an expression with a length that the compiler knows if it is at most eight.
macro_rules! unrolled {
    ($length:expr, |$known:ident| $what:expr) => {
        unrolled!($length, |$known| $what, 0 1 2 3 4 5 6 7 8)
    };
    ($length:expr, |$known:ident| $what:expr, $($usual:literal)*) => {
        match $length {
            $($usual => { let $known = $usual; $what })*
            $known => $what,
        }
    };
}
pub(crate) use unrolled;

/// Sorts the items so that each comes after those that it needs, in few groups.
/// Every group takes the shape with the most items that are ready.
///
/// # Panics
/// If items need each other in a circle.
pub(crate) fn group_by_shape<S: Copy + Ord>(shapes: &[S], needs: &[Vec<usize>]) -> Vec<usize> {
    let mut needed_by = vec![Vec::new(); shapes.len()];
    let mut missing = vec![0; shapes.len()];
    for (item, needs) in needs.iter().enumerate() {
        missing[item] = needs.len();
        for &need in needs {
            needed_by[need].push(item);
        }
    }
    let mut ready: BTreeMap<S, BTreeSet<usize>> = BTreeMap::new();
    for item in (0..shapes.len()).filter(|&item| missing[item] == 0) {
        ready.entry(shapes[item]).or_default().insert(item);
    }
    let mut order = Vec::with_capacity(shapes.len());
    while let Some((&shape, _)) = ready.iter().max_by_key(|(_, items)| items.len()) {
        while let Some(item) = ready.get_mut(&shape).and_then(BTreeSet::pop_first) {
            order.push(item);
            for &later in &needed_by[item] {
                missing[later] -= 1;
                if missing[later] == 0 {
                    ready.entry(shapes[later]).or_default().insert(later);
                }
            }
        }
        ready.remove(&shape);
    }
    assert_eq!(order.len(), shapes.len(), "items need each other in a circle");
    order
}

/// The groups of a list of shapes.
pub(crate) fn equal_length_groups<S: Copy + PartialEq>(
    shapes: impl Iterator<Item = S>,
) -> Vec<EqualLengthGroup<S>> {
    let mut groups: Vec<EqualLengthGroup<S>> = Vec::new();
    for shape in shapes {
        match groups.last_mut() {
            Some(group) if group.shape == shape => group.count += 1,
            _ => groups.push(EqualLengthGroup { shape, count: 1 }),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn needs_come_first_and_runs_are_few() {
        let shapes = [1, 2, 1, 2, 1, 2];
        let needs = [vec![], vec![0], vec![], vec![2], vec![1, 3], vec![4]];
        let order = group_by_shape(&shapes, &needs);
        assert_eq!(order, [0, 2, 1, 3, 4, 5]);
        let groups = equal_length_groups(order.iter().map(|&item| shapes[item]));
        let listed: Vec<(i32, usize)> =
            groups.iter().map(|group| (group.shape, group.count)).collect();
        assert_eq!(listed, [(1, 2), (2, 2), (1, 1), (2, 1)]);
    }

    #[test]
    #[should_panic(expected = "in a circle")]
    fn a_circle_is_refused() {
        group_by_shape(&[1, 1], &[vec![1], vec![0]]);
    }
}
