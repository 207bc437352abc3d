//! Reads records: one table, or a folder of logs, with the labels of each record.

use super::twin::TWIN;
use super::windows::texts;
use super::{RecordingError, RecordingStudy};
use crate::files::FileError;
use crate::table::{self, Column, ColumnKind, Table, Values};
use crate::text::natural_order;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The name of the record of a log, where the study has no column for it.
const RECORD: &str = "record";

/// The formats that a folder of logs may have.
const LOGS: [&str; 2] = ["csv", "parquet"];

impl RecordingStudy {
    /// Reads the records that the study names, with the columns of their labels and of their twin. `folder` is that of the
    /// study file.
    ///
    /// # Errors
    /// The study names no records; a file cannot be read; a column is missing; a record has no labels, or its twin
    /// cannot be simulated.
    pub fn read(&self, folder: &Path) -> Result<Table, RecordingError> {
        let Some(records) = &self.records else { return Err(RecordingError::NoNames) };
        let labels = self.labels.as_ref().map(|path| table::read_usable(folder.join(&path.value)));
        let labels = labels.transpose()?;
        let record = self.record.as_deref();
        let of_labels: BTreeSet<&str> =
            labels.iter().flat_map(Table::names).filter(|name| Some(*name) != record).collect();
        let mut wanted: BTreeSet<&str> =
            self.wanted().into_iter().filter(|name| !of_labels.contains(name)).collect();
        let path = folder.join(records);
        let mut table = if path.is_dir() {
            let record = record.unwrap_or(RECORD);
            wanted.remove(record);
            read_logs(&path, record, &wanted)?
        } else {
            let table = table::read_wanted(&path, &|name| wanted.contains(name))?;
            wanted.iter().try_for_each(|name| table.column(name).map(drop))?;
            table
        };
        if let (Some(labels), Some(record)) = (&labels, record) {
            join(&mut table, labels, record)?;
        }
        if let Some(system) = self.system(folder)? {
            self.add_twin(&mut table, &system)?;
            table.metadata.insert(TWIN.into(), system.text);
        }
        Ok(table)
    }

    /// The columns that the study reads.
    fn wanted(&self) -> BTreeSet<&str> {
        let sensors = self.sensors.iter().flat_map(|sensor| {
            let inputs = sensor.nominal_from.iter().flatten();
            [&sensor.measured].into_iter().chain(&sensor.nominal).chain(inputs)
        });
        let driven = self.twin.iter().flat_map(|twin| twin.inputs.values());
        let names = sensors
            .chain(driven)
            .chain(self.healthy.keys().map(|name| &name.value))
            .chain(self.kept());
        let is_of_twin = |name: &&str| self.twin.is_some() && name.starts_with(TWIN);
        names.map(String::as_str).filter(|name| !is_of_twin(name)).collect()
    }
}

/// Reads the logs of a folder, in the order of their names, in which numbers count as numbers, one behind the other.
fn read_logs(
    folder: &Path,
    record: &str,
    wanted: &BTreeSet<&str>,
) -> Result<Table, RecordingError> {
    let failed = |cause| RecordingError::from(FileError::from_io(folder, cause));
    let mut paths: Vec<PathBuf> = vec![];
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        if LOGS.iter().any(|log| ending.eq_ignore_ascii_case(log)) && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort_by_cached_key(|path| natural_order(&path.to_string_lossy()));
    let mut all: Option<Table> = None;
    for path in &paths {
        let log = table::read_wanted(path, &|name| wanted.contains(name))?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut table = Table::new();
        table.push(Column::new(record, "", vec![name; log.row_count()]))?;
        for name in wanted {
            // A column of whole numbers in one log may have fractions in the next.
            let column = log.column(name)?;
            let values = match column.values.kind() {
                ColumnKind::Integer | ColumnKind::Unsigned => column.numbers()?.into_owned().into(),
                _ => column.values.clone(),
            };
            table.push(column.with_values(values))?;
        }
        match &mut all {
            None => all = Some(table),
            Some(all) => all.append(table)?,
        }
    }
    all.ok_or_else(|| RecordingError::NoRecords(folder.into()))
}

/// Adds the columns of the labels to every row of their record.
fn join(table: &mut Table, labels: &Table, record: &str) -> Result<(), RecordingError> {
    let mut known: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (row, name) in texts(labels.column(record)?).into_iter().enumerate() {
        known.entry(name).or_default().push(row);
    }
    let mut rows = vec![];
    for name in texts(table.column(record)?) {
        match known.get(&name).map(Vec::as_slice) {
            Some([row]) => rows.push(*row),
            other => {
                let count = other.map_or(0, <[usize]>::len);
                return Err(RecordingError::Labels { record: name, count });
            }
        }
    }
    let new = labels.columns().iter().filter(|column| column.name != record);
    for column in new {
        if table.has(&column.name) {
            table.take(&column.name)?;
        }
        table.push(column.with_values(gathered(&column.values, &rows)))?;
    }
    Ok(())
}

fn gathered(values: &Values, rows: &[usize]) -> Values {
    match values {
        Values::Float(values) => pick(values, rows).into(),
        Values::Integer(values) => pick(values, rows).into(),
        Values::Unsigned(values) => pick(values, rows).into(),
        Values::Flag(values) => pick(values, rows).into(),
        Values::Text(values) => pick(values, rows).into(),
    }
}

fn pick<T: Clone>(values: &[T], rows: &[usize]) -> Vec<T> {
    rows.iter().map(|&row| values[row].clone()).collect()
}
