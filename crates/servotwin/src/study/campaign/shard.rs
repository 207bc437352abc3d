//! Shards: the windows of a few hundred variants in a file that appears when all have ended.

use super::part::variants_of;
use super::{CampaignError, Role, Setting, Study};
use crate::table::{self, Column, Table, TableError, Values};
use servotwin_diagnosis::residual::Window;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Variants in one shard.
pub(super) const SHARD: usize = 205;

/// What a shard holds of one variant.
#[derive(Clone, Debug)]
pub struct Row {
    /// Why the variant was not simulated to the end; empty where it was.
    pub failure: String,
    /// What its sensors showed.
    pub window: Window,
}

impl Row {
    /// The rows of a shard.
    fn from_table(study: &Study, table: &Table) -> Result<Vec<Self>, TableError> {
        let (sensors, watched) = (study.measured.len(), study.base_sensors());
        let count = Window::watching(sensors, watched).to_values().len();
        let columns = (0..count).map(|place| table.f64(&window_column(place)));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let failures = table.text("failure")?;
        let row = |(row, failure): (usize, &String)| {
            let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
            let window = Window::from_values(sensors, watched, &values);
            Row { failure: failure.clone(), window: window.expect("as many values as counted") }
        };
        Ok(failures.iter().enumerate().map(row).collect())
    }

    /// The shard of some rows.
    fn to_table(rows: &BTreeMap<usize, Row>) -> Result<Table, TableError> {
        let failures = rows.values().map(|row| row.failure.clone()).collect();
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(rows.keys().map(|&v| v as u32).collect())),
            Column::new("failure", "", Values::Text(failures)),
        ];
        let values: Vec<Vec<f64>> = rows.values().map(|row| row.window.to_values()).collect();
        for place in 0..values.first().map_or(0, Vec::len) {
            let column = values.iter().map(|row| row[place]).collect();
            columns.push(Column::new(window_column(place), "", Values::Float(column)));
        }
        Table::from_columns(columns)
    }
}

/// What the rows of a shard add up to, so that a flipped bit is seen.
fn checksum(table: &Table) -> String {
    let mut digest = Sha256::new();
    for column in table.columns() {
        digest.update(column.name.as_bytes());
        match &column.values {
            Values::Float(values) => values.iter().for_each(|v| digest.update(v.to_le_bytes())),
            Values::Unsigned(values) => values.iter().for_each(|v| digest.update(v.to_le_bytes())),
            Values::Text(values) => values.iter().for_each(|v| digest.update(v.as_bytes())),
            _ => {}
        }
    }
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The column of one of the window's values.
fn window_column(place: usize) -> String {
    format!("w:{place:03}")
}

/// The shards of one data set.
#[derive(Clone, Debug)]
pub(super) struct Shards {
    folder: PathBuf,
    stem: String,
    /// What a shard must have been made from to be taken over.
    fingerprint: String,
    /// Number of variants.
    variants: usize,
}

impl Shards {
    pub fn new(
        folder: &Path,
        setting: Setting,
        role: Role,
        fingerprint: String,
        variants: usize,
    ) -> Self {
        let stem = format!("{}{}", setting.name(), role.suffix());
        Shards { folder: folder.into(), stem, fingerprint, variants }
    }

    fn path(&self, shard: usize) -> PathBuf {
        self.folder.join(format!("{}-{shard:04}.parquet", self.stem))
    }

    fn count(&self) -> usize {
        self.variants.div_ceil(SHARD)
    }

    /// The variants of a shard, none of one beyond the last.
    fn variants_of(&self, shard: usize) -> std::ops::Range<usize> {
        variants_of(shard, self.variants)
    }

    /// The names of some shards' files.
    pub fn names(&self, shards: &[usize]) -> Vec<String> {
        let own = shards.iter().filter(|&&shard| shard < self.count());
        own.map(|&shard| format!("{}-{shard:04}.parquet", self.stem)).collect()
    }

    /// Variants that no usable shard holds. A shard of something else, or one that cannot be
    /// read, is made anew.
    pub fn pending(&self) -> Vec<usize> {
        self.pending_of(0..self.count())
    }

    /// The same of some shards.
    pub fn pending_of(&self, shards: impl Iterator<Item = usize>) -> Vec<usize> {
        let is_done = |shard: usize| {
            let path = self.path(shard);
            path.exists() && table::read(&path).is_ok_and(|table| self.is_sound(shard, &table))
        };
        let missing = shards.filter(|&shard| shard < self.count() && !is_done(shard));
        missing.flat_map(|shard| self.variants_of(shard)).collect()
    }

    fn is_sound(&self, shard: usize, table: &Table) -> bool {
        table.metadata.get("fingerprint") == Some(&self.fingerprint)
            && table.row_count() == self.variants_of(shard).len()
            && table.metadata.get("checksum") == Some(&checksum(table))
    }

    /// The rows of all shards.
    pub fn collect(&self, study: &Study) -> Result<Vec<Row>, CampaignError> {
        let mut rows = Vec::with_capacity(self.variants);
        for shard in 0..self.count() {
            rows.extend(Row::from_table(study, &table::read(self.path(shard))?)?);
        }
        Ok(rows)
    }
}

/// Gathers the rows of a data set until a shard is complete.
pub(super) struct Collector {
    shards: Shards,
    /// Rows that shards still wait for.
    missing: BTreeMap<usize, usize>,
    open: BTreeMap<usize, BTreeMap<usize, Row>>,
}

impl Collector {
    pub fn new(shards: &Shards, pending: &[usize]) -> Self {
        let mut missing = BTreeMap::new();
        for variant in pending {
            *missing.entry(variant / SHARD).or_default() += 1;
        }
        Self { shards: shards.clone(), missing, open: BTreeMap::new() }
    }

    /// Takes a row; `false` if its shard is there already.
    pub fn add(&mut self, variant: usize, row: Row) -> Result<bool, CampaignError> {
        let shard = variant / SHARD;
        let Some(missing) = self.missing.get_mut(&shard) else { return Ok(false) };
        *missing -= 1;
        let complete = *missing == 0;
        self.open.entry(shard).or_default().insert(variant, row);
        if complete {
            self.missing.remove(&shard);
            let rows = self.open.remove(&shard).expect("just filled");
            let fingerprint = self.shards.fingerprint.clone();
            let table = Row::to_table(&rows)?.with_metadata("fingerprint", fingerprint);
            let sum = checksum(&table);
            let table = table.with_metadata("checksum", sum);
            table::write(self.shards.path(shard), &table)?;
        }
        Ok(true)
    }
}
