//! The data of one variant in a part.

use super::{Study, VariantEffort};
use crate::run::part;
use crate::table::{Column, Table, TableError};
use servotwin_diagnosis::residual::Window;
use std::collections::BTreeMap;

/// The data of one variant in a part.
#[derive(Clone, Debug)]
pub struct PartRow {
    /// Why the variant was not simulated to the end; empty if it was.
    pub(crate) failure: String,
    /// The effort of its simulation.
    pub(crate) effort: VariantEffort,
    /// Its window of residuals.
    pub window: Window,
}

impl PartRow {
    /// Reads the rows of a part.
    pub(super) fn from_table(study: &Study, table: &Table) -> Result<Vec<Self>, TableError> {
        let windows = part::windows_of(table, (study.measured.len(), study.base_sensors()))?;
        let (failures, efforts) = (table.text("failure")?, VariantEffort::from_table(table)?);
        let rows = windows.into_iter().zip(failures.iter().cloned().zip(efforts));
        Ok(rows.map(|(window, (failure, effort))| PartRow { failure, effort, window }).collect())
    }

    /// The table of a part with the given rows.
    pub(super) fn to_table(rows: &BTreeMap<usize, PartRow>) -> Result<Table, TableError> {
        let mut columns = vec![
            Column::of("variant", "", rows.keys(), |&variant| variant as u32),
            Column::of("failure", "", rows.values(), |row| row.failure.clone()),
        ];
        let efforts: Vec<VariantEffort> = rows.values().map(|row| row.effort).collect();
        columns.extend(VariantEffort::to_columns(&efforts));
        let windows: Vec<&Window> = rows.values().map(|row| &row.window).collect();
        columns.extend(part::window_columns(&windows));
        Table::from_columns(columns)
    }
}
