//! Thresholds between values that 32-bit numbers cannot tell apart.

use super::{Prepared, TableModel};

impl Prepared {
    /// Warnings about thresholds of a model that lie closer to their neighbors than a 32-bit number resolves: one for each
    /// column. The same rows from a file with 32-bit numbers may get other answers.
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
