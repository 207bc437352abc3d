//! Splits are complete, disjoint, seeded, and keep what they promise.

use proptest::prelude::*;
use servotwin_learning::splits::*;
use std::collections::BTreeSet;

fn check_partition(splits: &[Split], rows: usize) {
    let mut tested = vec![0; rows];
    for split in splits {
        let mut all = [split.train.clone(), split.test.clone()].concat();
        all.sort_unstable();
        assert_eq!(all, (0..rows).collect::<Vec<_>>());
        assert!(!split.test.is_empty() && !split.train.is_empty());
        split.test.iter().for_each(|&row| tested[row] += 1);
    }
    assert!(tested.iter().all(|&times| times == 1));
}

proptest! {
    #[test]
    fn grouped_folds(groups in prop::collection::vec(0u32..9, 40..80), folds in 2usize..4, seed: u64) {
        let splits = grouped_k_fold(&groups, folds, seed).unwrap();
        check_partition(&splits, groups.len());
        for split in &splits {
            let shared = split.train.iter().any(|&a| split.test.iter().any(|&b| groups[a] == groups[b]));
            prop_assert!(!shared);
        }
    }

    #[test]
    fn thirds(groups in prop::collection::vec(0u32..30, 40..80), seed: u64) {
        let split = &random_thirds(&groups, 1, seed).unwrap()[0];
        let names = |rows: &[usize]| rows.iter().map(|&row| groups[row]).collect::<BTreeSet<_>>();
        let (train, test) = (names(&split.train), names(&split.test));
        prop_assert!(train.is_disjoint(&test));
        let expected = ((train.len() + test.len()) as f64 / 3.0).round() as usize;
        prop_assert_eq!(test.len(), expected);
        prop_assert_eq!(split.train.len() + split.test.len(), groups.len());
    }
}

#[test]
fn groups_left_out_one_by_one() {
    let splits = leave_one_group_out(&[7, 3, 7, 5]).unwrap();
    check_partition(&splits, 4);
    assert_eq!(
        splits.iter().map(|s| s.test.clone()).collect::<Vec<_>>(),
        [vec![1], vec![3], vec![0, 2]]
    );
}

#[test]
fn repeats_differ_but_come_again() {
    let rows: Vec<u32> = (0..30).collect();
    let splits = random_thirds(&rows, 4, 1).unwrap();
    assert!(splits.iter().all(|split| split.test.len() == 10));
    assert_ne!(splits[0], splits[1]);
    assert_eq!(splits, random_thirds(&rows, 4, 1).unwrap());
}

#[test]
fn too_little_to_split_is_an_error() {
    assert!(random_thirds(&[2, 2], 1, 0).is_err());
    assert!(grouped_k_fold(&[0, 1], 1, 0).is_err());
    assert!(grouped_k_fold(&[0, 0, 0, 1], 3, 0).is_err());
    assert!(leave_one_group_out(&[2, 2]).is_err());
}
