//! Warns about thresholds between values that 32-bit numbers cannot distinguish.

use super::{PreparedTable, TableModel};
use servotwin_diagnosis::tree::Tree;
use servotwin_learning::Samples;
use std::collections::BTreeMap;

/// Counts rows with a 32-bit number equal to a threshold on their path within 32-bit precision, by feature. Rounding
/// has lost on which side of the threshold they were.
#[derive(Debug)]
pub(super) struct Undecided {
    /// Whether all values of each feature are 32-bit numbers.
    is_short: Vec<bool>,
    rows: BTreeMap<usize, usize>,
}

impl Undecided {
    pub(super) fn new(samples: &Samples) -> Self {
        let is_short = |value: &f64| value.is_nan() || f64::from(*value as f32) == *value;
        let of_feature = |feature| samples.column(feature).iter().all(is_short);
        let is_short = (0..samples.features()).map(of_feature).collect();
        Undecided { is_short, rows: BTreeMap::new() }
    }

    /// Checks the path of a row through a tree.
    pub(super) fn look(&mut self, tree: &Tree, values: &[f64]) {
        let is_undecided = |&(feature, threshold): &(usize, f64)| {
            let value = values[feature];
            self.is_short[feature] && value != threshold && value as f32 == threshold as f32
        };
        let mut asked = tree.decision_path(values).filter_map(|node| tree.split(node));
        if let Some((feature, _)) = asked.find(is_undecided) {
            *self.rows.entry(feature).or_default() += 1;
        }
    }

    /// The number of such rows, as warnings.
    pub(super) fn said(&self, model: &TableModel) -> Vec<String> {
        let said = |(&feature, &rows): (&usize, &usize)| {
            let rows = if rows == 1 { "1 row has".into() } else { format!("{rows} rows have") };
            let column = model.inputs[feature].name();
            format!(
                "{rows} 32-bit numbers in '{column}' that were rounded onto a threshold of the model: \
                 before rounding the answer may have been another one"
            )
        };
        self.rows.iter().map(said).collect()
    }
}

impl PreparedTable {
    /// Warnings about thresholds that lie closer to their neighbors than 32-bit precision: one for each column. The
    /// same rows from a file with 32-bit numbers may get other answers.
    pub fn hairline_warnings(&self, model: &TableModel) -> Vec<String> {
        let mut splits = model.model.splits();
        splits.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        splits.dedup();
        let of_feature = splits.chunk_by(|a, b| a.0 == b.0);
        of_feature.filter_map(|splits| self.hairline_warning(model, splits)).collect()
    }

    fn hairline_warning(&self, model: &TableModel, splits: &[(usize, f64)]) -> Option<String> {
        let feature = splits.first()?.0;
        let mut values = self.samples().column(feature).to_vec();
        values.retain(|value| !value.is_nan());
        values.sort_by(f64::total_cmp);
        let neighbors = |&(_, threshold): &(usize, f64)| {
            let above = values.partition_point(|value| *value <= threshold);
            let (lower, upper) = (values.get(above.checked_sub(1)?)?, values.get(above)?);
            (*lower as f32 == *upper as f32).then_some((*lower, *upper))
        };
        let close: Vec<(f64, f64)> = splits.iter().filter_map(neighbors).collect();
        let (lower, upper) = close.first()?;
        let column = model.inputs[feature].name();
        let more = match close.len() - 1 {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        Some(format!(
            "the model splits column '{column}' between {lower} and {upper}{more}: 32-bit numbers do not tell \
             these apart, so the same rows from a float32 file may get other answers"
        ))
    }
}
