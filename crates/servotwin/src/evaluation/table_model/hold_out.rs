//! Holds out rows for testing. Rows of one group are never on both sides.

use super::PreparedTable;
use super::error::TableModelError;
use crate::evaluation::EvaluationError;
use servotwin_diagnosis::Error;
use servotwin_learning::splits::{Split, grouped_k_fold, stratified_k_fold};

/// How the rows of a table are held out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HoldOut {
    /// Cross-validation folds: of groups if there is a group column, otherwise stratified by class.
    Folds {
        /// Number of folds.
        folds: usize,
        /// The seed of the random folds.
        seed: u64,
    },
    /// The last share of each class in the order of the table, for time series. With groups, the last groups of each
    /// class that hold at least that share.
    Last {
        /// The share, between 0 and 1.
        share: f64,
    },
    /// According to the split column or the second table.
    Fixed,
}

/// The side of a row in a fixed split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SplitSide {
    Train,
    Test,
    /// Neither side, e.g. rows reserved for validation.
    Neither,
}

/// The values that mean test by default, each with its counterpart for training.
const WORDS: [(&str, &str); 4] =
    [("test", "train"), ("testing", "training"), ("true", "false"), ("1", "0")];

/// The sides given by a split column. If training is among its values, only these rows train; otherwise all rows that
/// are not tested do.
pub(super) fn sides(
    texts: &[String],
    column: &str,
    test_value: Option<&str>,
) -> Result<Vec<SplitSide>, TableModelError> {
    let mut values: Vec<&String> = texts.iter().collect();
    values.sort();
    values.dedup();
    let has = |word: &str| values.iter().any(|value| value.eq_ignore_ascii_case(word));
    let words = match test_value {
        Some(value) => Some((value, "train")),
        // In a column with more numbers, 0 and 1 do not mark sides.
        None => WORDS.into_iter().find(|(test, train)| {
            let is_number = *test == "1";
            has(test) && has(train) && (!is_number || values.len() == 2)
        }),
    };
    let refused = || TableModelError::Split {
        column: column.into(),
        values: values.iter().take(10).map(|value| format!("'{value}'")).collect(),
        test_value: test_value.map(str::to_owned),
    };
    let (test, train) = words.ok_or_else(refused)?;
    if !has(test) || values.len() < 2 {
        return Err(refused());
    }
    let only_train = has(train);
    let side = |text: &String| match text {
        text if text.eq_ignore_ascii_case(test) => SplitSide::Test,
        text if !only_train || text.eq_ignore_ascii_case(train) => SplitSide::Train,
        _ => SplitSide::Neither,
    };
    Ok(texts.iter().map(side).collect())
}

impl PreparedTable {
    /// Makes the splits.
    ///
    /// # Errors
    /// [`EvaluationError::TooFewGroups`], a share out of range, a group on both sides of a fixed split, or an empty
    /// side.
    pub fn splits(&self, hold_out: HoldOut) -> Result<Vec<Split>, EvaluationError> {
        let splits = match (hold_out, &self.groups) {
            (HoldOut::Folds { folds, seed }, Some(groups)) => {
                let found = groups.coded.names.len();
                if found < folds {
                    let column = groups.column.clone();
                    return Err(EvaluationError::TooFewGroups { column, found, needed: folds });
                }
                grouped_k_fold(&groups.coded.codes, folds, seed)?
            }
            (HoldOut::Folds { folds, seed }, None) => {
                stratified_k_fold(self.samples.labels(), folds, seed)?
            }
            (HoldOut::Last { share }, _) => vec![self.last_of_each_class(share)?],
            (HoldOut::Fixed, _) => vec![self.fixed()?],
        };
        for split in &splits {
            for (rows, side) in [(&split.train, "training"), (&split.test, "testing")] {
                if rows.is_empty() {
                    return Err(TableModelError::NothingLeft { side }.into());
                }
            }
        }
        Ok(splits)
    }

    fn fixed(&self) -> Result<Split, EvaluationError> {
        let Some(sides) = &self.sides else {
            return Err(TableModelError::NothingLeft { side: "testing" }.into());
        };
        let of = |side| (0..sides.len()).filter(|&row| sides[row] == side).collect();
        let split = Split { train: of(SplitSide::Train), test: of(SplitSide::Test) };
        if let Some(groups) = &self.groups {
            let mut trained = vec![false; groups.coded.names.len()];
            let group = |row: usize| groups.coded.codes[row] as usize;
            split.train.iter().for_each(|&row| trained[group(row)] = true);
            let mut both: Vec<usize> =
                split.test.iter().map(|&row| group(row)).filter(|&group| trained[group]).collect();
            both.sort_unstable();
            both.dedup();
            if let Some(&first) = both.first() {
                let (column, group) = (groups.column.clone(), groups.coded.names[first].clone());
                let groups = both.len();
                return Err(TableModelError::GroupOnBothSides { column, group, groups }.into());
            }
        }
        Ok(split)
    }

    fn last_of_each_class(&self, share: f64) -> Result<Split, EvaluationError> {
        if !(share > 0.0 && share < 1.0) {
            let (setting, allowed) = ("held out", "between 0 and 1");
            return Err(Error::SettingOutOfRange { setting, value: share, allowed }.into());
        }
        let mut is_test = vec![false; self.samples.rows()];
        for class in 0..self.samples.classes() as u32 {
            let labels = self.samples.labels();
            let rows: Vec<usize> = (0..labels.len()).filter(|&row| labels[row] == class).collect();
            let held = (rows.len() as f64 * share).floor() as usize;
            match &self.groups {
                None => rows[rows.len() - held..].iter().for_each(|&row| is_test[row] = true),
                Some(groups) => {
                    let codes = &groups.coded.codes;
                    for group in last_groups(&rows, codes, held) {
                        let members = is_test.iter_mut().zip(codes).filter(|(_, c)| **c == group);
                        members.for_each(|(test, _)| *test = true);
                    }
                }
            }
        }
        let (test, train) = (0..is_test.len()).partition(|&row| is_test[row]);
        Ok(Split { train, test })
    }
}

/// The last groups that hold at least `needed` rows; never all groups.
fn last_groups(rows: &[usize], codes: &[u32], needed: usize) -> Vec<u32> {
    // The groups in the order of their first rows.
    let mut order: Vec<u32> = vec![];
    rows.iter().map(|&row| codes[row]).for_each(|code| {
        if !order.contains(&code) {
            order.push(code);
        }
    });
    let (mut held, mut last) = (0, vec![]);
    for &group in order.iter().skip(1).rev() {
        if held >= needed {
            break;
        }
        held += rows.iter().filter(|&&row| codes[row] == group).count();
        last.push(group);
    }
    last
}
