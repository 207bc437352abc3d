//! Shards: files with the windows of a few hundred variants, which appear when all have ended.

use super::{CampaignError, Role, Setting, Study, VariantEffort};
use crate::table::parquet::ParquetReader;
use crate::table::{self, Column, Table, TableError, Values};
use servotwin_diagnosis::residual::Window;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Number of variants in a shard.
pub(super) const SHARD: usize = 205;

/// The data of one variant in a shard.
#[derive(Clone, Debug)]
pub struct ShardRow {
    /// Why the variant was not simulated to the end; empty if it was.
    pub failure: String,
    /// The effort of its simulation.
    pub effort: VariantEffort,
    /// Its window of residuals.
    pub window: Window,
}

impl ShardRow {
    /// Reads the rows of a shard.
    fn from_table(study: &Study, table: &Table) -> Result<Vec<Self>, TableError> {
        let (sensors, watched) = (study.measured.len(), study.base_sensors());
        let count = Window::watching(sensors, watched).to_values().len();
        let columns = (0..count).map(|place| table.f64(&window_column(place)));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let failures = table.text("failure")?;
        let efforts = VariantEffort::from_table(table)?;
        let row = |(row, failure): (usize, &String)| {
            let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
            let window = Window::from_values(sensors, watched, &values);
            let window = window.expect("as many values as counted");
            ShardRow { failure: failure.clone(), effort: efforts[row], window }
        };
        Ok(failures.iter().enumerate().map(row).collect())
    }

    /// The table of a shard with the given rows.
    fn to_table(rows: &BTreeMap<usize, ShardRow>) -> Result<Table, TableError> {
        let failures = rows.values().map(|row| row.failure.clone()).collect();
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(rows.keys().map(|&v| v as u32).collect())),
            Column::new("failure", "", Values::Text(failures)),
        ];
        let efforts: Vec<VariantEffort> = rows.values().map(|row| row.effort).collect();
        columns.extend(VariantEffort::to_columns(&efforts));
        let values: Vec<Vec<f64>> = rows.values().map(|row| row.window.to_values()).collect();
        for place in 0..values.first().map_or(0, Vec::len) {
            let column = values.iter().map(|row| row[place]).collect();
            columns.push(Column::new(window_column(place), "", Values::Float(column)));
        }
        Table::from_columns(columns)
    }
}

/// Checksum over the rows of a shard, which detects flipped bits.
fn checksum(table: &Table) -> String {
    let mut digest = Sha256::new();
    for column in table.columns() {
        digest.update(column.name.as_bytes());
        match &column.values {
            Values::Float(values) => values.iter().for_each(|v| digest.update(v.to_le_bytes())),
            Values::Unsigned(values) => values.iter().for_each(|v| digest.update(v.to_le_bytes())),
            Values::Text(values) => values.iter().for_each(|v| digest.update(v.as_bytes())),
            Values::Flag(values) => values.iter().for_each(|&v| digest.update([u8::from(v)])),
            _ => {}
        }
    }
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Name of the column with one of the window's values.
fn window_column(place: usize) -> String {
    format!("w:{place:03}")
}

/// The shards of one data set.
#[derive(Clone, Debug)]
pub(super) struct Shards {
    folder: PathBuf,
    stem: String,
    /// The fingerprint that a shard must have to be used.
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

    /// Number of shards.
    pub fn count(&self) -> usize {
        self.variants.div_ceil(SHARD)
    }

    /// The variants of a shard; empty beyond the last shard.
    pub fn variants_of(&self, shard: usize) -> Range<usize> {
        variants_of(shard, self.variants)
    }

    /// The file names of shards.
    pub fn names(&self, shards: &[usize]) -> Vec<String> {
        let own = shards.iter().filter(|&&shard| shard < self.count());
        own.map(|&shard| format!("{}-{shard:04}.parquet", self.stem)).collect()
    }

    /// The shards that are absent or unusable. Damaged shards and shards of another campaign are made again.
    pub fn missing(&self, among: impl Iterator<Item = usize>) -> BTreeSet<usize> {
        among.filter(|&shard| shard < self.count() && self.sound(shard).is_none()).collect()
    }

    /// Whether all shards of this campaign seem to exist, judged by their heads.
    pub fn seem_complete(&self) -> bool {
        (0..self.count()).all(|shard| {
            let path = self.path(shard);
            let head = path.exists().then(|| ParquetReader::open(path));
            head.is_some_and(|head| head.is_ok_and(|head| self.is_own(head.schema())))
        })
    }

    fn is_own(&self, table: &Table) -> bool {
        table.metadata.get("fingerprint") == Some(&self.fingerprint)
    }

    /// Reads a shard if it is complete and belongs to this campaign.
    fn sound(&self, shard: usize) -> Option<Table> {
        let path = self.path(shard);
        let table = path.exists().then(|| table::read(path))?.ok()?;
        let is_whole = table.row_count() == self.variants_of(shard).len()
            && table.metadata.get("checksum") == Some(&checksum(&table));
        (is_whole && self.is_own(&table)).then_some(table)
    }

    /// The rows of a shard.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if the shard cannot be used.
    pub fn rows(&self, study: &Study, shard: usize) -> Result<Vec<ShardRow>, CampaignError> {
        match self.sound(shard) {
            Some(table) => Ok(ShardRow::from_table(study, &table)?),
            None => Err(CampaignError::Unfinished {
                missing: self.missing_variants(),
                damaged: self.damaged(),
            }),
        }
    }

    /// The first shard that is damaged.
    pub fn damaged(&self) -> Option<PathBuf> {
        let is_damaged = |&shard: &usize| {
            let path = self.path(shard);
            let is_other = || table::read(&path).is_ok_and(|table| !self.is_own(&table));
            path.exists() && self.sound(shard).is_none() && !is_other()
        };
        (0..self.count()).find(is_damaged).map(|shard| self.path(shard))
    }

    /// Number of variants without a usable shard.
    pub fn missing_variants(&self) -> usize {
        let missing = self.missing(0..self.count());
        missing.into_iter().map(|shard| self.variants_of(shard).len()).sum()
    }

    /// The windows of some variants.
    ///
    /// # Errors
    /// See [`Shards::rows`].
    pub fn windows(
        &self,
        study: &Study,
        variants: &BTreeSet<usize>,
    ) -> Result<BTreeMap<usize, Window>, CampaignError> {
        let shards: BTreeSet<usize> = variants.iter().map(|variant| variant / SHARD).collect();
        let mut windows = BTreeMap::new();
        for shard in shards {
            let numbered = self.variants_of(shard).zip(self.rows(study, shard)?);
            let wanted = numbered.filter(|(variant, _)| variants.contains(variant));
            windows.extend(wanted.map(|(variant, row)| (variant, row.window)));
        }
        Ok(windows)
    }
}

/// The variants of a shard; empty beyond the last shard.
pub(super) fn variants_of(shard: usize, variants: usize) -> Range<usize> {
    (shard * SHARD).min(variants)..((shard + 1) * SHARD).min(variants)
}

/// Collects the rows of a data set until a shard is complete.
pub(super) struct Collector {
    shards: Shards,
    /// For each shard, the number of missing rows.
    missing: BTreeMap<usize, usize>,
    open: BTreeMap<usize, BTreeMap<usize, ShardRow>>,
}

impl Collector {
    pub fn new(shards: &Shards, pending: &[usize]) -> Self {
        let mut missing = BTreeMap::new();
        for variant in pending {
            *missing.entry(variant / SHARD).or_default() += 1;
        }
        Self { shards: shards.clone(), missing, open: BTreeMap::new() }
    }

    /// Takes a row; `false` if its shard already exists.
    pub fn add(&mut self, variant: usize, row: ShardRow) -> Result<bool, CampaignError> {
        let shard = variant / SHARD;
        let Some(missing) = self.missing.get_mut(&shard) else { return Ok(false) };
        *missing -= 1;
        let complete = *missing == 0;
        self.open.entry(shard).or_default().insert(variant, row);
        if complete {
            self.missing.remove(&shard);
            let rows = self.open.remove(&shard).expect("just filled");
            let fingerprint = self.shards.fingerprint.clone();
            let table = ShardRow::to_table(&rows)?.with_metadata("fingerprint", fingerprint);
            let sum = checksum(&table);
            let table = table.with_metadata("checksum", sum);
            table::write(self.shards.path(shard), &table)?;
        }
        Ok(true)
    }
}
