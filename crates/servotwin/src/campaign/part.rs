//! Parts: files with the windows of some variants of an operating case, which appear when all have ended.
//!
//! The bytes of a part depend only on the study. Parts that are computed anywhere, repeatedly or simultaneously,
//! therefore give the same files as a single machine.

use super::{Campaign, CampaignError, PreparedCampaign, Scenario, Study, VariantEffort};
use crate::manifest::in_hexadecimal;
use crate::table::parquet::ParquetReader;
use crate::table::{self, Column, Table, TableError, Values};
use servotwin_diagnosis::residual::Window;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

/// The format of parts; those of another format are simulated again.
pub(super) const PART_FORMAT: &str = "windows 1";

/// The folder of parts in an output folder.
pub const PARTS: &str = "parts";

/// A share of the parts, for one of several machines: `3/100` is the third of a hundred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Number of the share, from 1.
    number: usize,
    of: usize,
}

impl Share {
    /// Creates the share with a number from 1 to `of`; `None` if out of range.
    pub(crate) fn new(number: usize, of: usize) -> Option<Self> {
        (1..=of).contains(&number).then_some(Share { number, of })
    }

    /// Whether it contains a part; the parts of all campaigns of a study are numbered consecutively.
    pub(crate) fn holds(self, part: usize) -> bool {
        part % self.of == self.number - 1
    }

    /// The block of so many things that belongs to the share.
    pub(crate) fn block(self, count: usize) -> Range<usize> {
        count * (self.number - 1) / self.of..count * self.number / self.of
    }
}

impl FromStr for Share {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').and_then(|(number, of)| {
            Share::new(number.trim().parse().ok()?, of.trim().parse().ok()?)
        });
        numbers.ok_or("a share is written NUMBER/ALL, such as 3/100, and counts from 1")
    }
}

impl fmt::Display for Share {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}/{}", self.number, self.of)
    }
}

/// The data of one variant in a part.
#[derive(Clone, Debug)]
pub struct PartRow {
    /// Why the variant was not simulated to the end; empty if it was.
    pub failure: String,
    /// The effort of its simulation.
    pub effort: VariantEffort,
    /// Its window of residuals.
    pub window: Window,
}

impl PartRow {
    /// Reads the rows of a part.
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
            PartRow { failure: failure.clone(), effort: efforts[row], window }
        };
        Ok(failures.iter().enumerate().map(row).collect())
    }

    /// The table of a part with the given rows.
    fn to_table(rows: &BTreeMap<usize, PartRow>) -> Result<Table, TableError> {
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

/// Checksum over the rows of a part, which detects flipped bits.
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
    in_hexadecimal(digest)
}

/// Name of the column with one of the window's values.
fn window_column(place: usize) -> String {
    format!("w:{place:03}")
}

/// The files of the parts of one data set.
#[derive(Clone, Debug)]
pub(super) struct PartFiles {
    folder: PathBuf,
    stem: String,
    /// The fingerprint that a part must have to be used.
    fingerprint: String,
    /// The variants of each part.
    parts: Vec<Range<usize>>,
}

impl Campaign<'_> {
    /// The files of each scenario.
    pub(super) fn files(&self, prepared: &PreparedCampaign) -> Vec<PartFiles> {
        let of = |(place, &scenario): (usize, &Scenario)| {
            let is_own = |part: &&Range<usize>| part.end <= prepared.counts[place];
            PartFiles {
                folder: self.folder.join(PARTS),
                stem: format!("{}{}", scenario.name(), self.purpose.suffix()),
                fingerprint: prepared.fingerprints[place].clone(),
                parts: prepared.parts.iter().filter(is_own).cloned().collect(),
            }
        };
        self.scenarios.iter().enumerate().map(of).collect()
    }

    /// The file names of a part in the folder of parts, with its number of rows.
    pub fn part_files(&self, prepared: &PreparedCampaign, part: usize) -> (Vec<String>, usize) {
        let files = self.files(prepared);
        let own = || files.iter().filter(|files| part < files.count());
        let names = own().map(|files| files.name(part)).collect();
        (names, own().map(|files| files.variants_of(part).len()).sum())
    }
}

impl PartFiles {
    fn name(&self, part: usize) -> String {
        format!("{}-{part:04}.parquet", self.stem)
    }

    fn path(&self, part: usize) -> PathBuf {
        self.folder.join(self.name(part))
    }

    /// Number of parts.
    pub(crate) fn count(&self) -> usize {
        self.parts.len()
    }

    /// The variants of a part; empty beyond the last part.
    pub(crate) fn variants_of(&self, part: usize) -> Range<usize> {
        self.parts.get(part).cloned().unwrap_or_default()
    }

    /// The parts that are absent or unusable. Damaged parts and parts of another campaign are made again.
    pub(crate) fn missing(&self, among: impl IntoIterator<Item = usize>) -> BTreeSet<usize> {
        let wanted = among.into_iter().filter(|&part| part < self.count());
        wanted.filter(|&part| self.sound(part).is_none()).collect()
    }

    /// Whether all parts of this campaign seem to exist, judged by their heads.
    pub(crate) fn seem_complete(&self) -> bool {
        (0..self.count()).all(|part| {
            let path = self.path(part);
            let head = path.exists().then(|| ParquetReader::open(path));
            head.is_some_and(|head| head.is_ok_and(|head| self.is_own(head.schema())))
        })
    }

    fn is_own(&self, table: &Table) -> bool {
        table.metadata.get("fingerprint") == Some(&self.fingerprint)
    }

    /// Reads a part if it is complete and belongs to this campaign.
    fn sound(&self, part: usize) -> Option<Table> {
        let path = self.path(part);
        let table = path.exists().then(|| table::read(path))?.ok()?;
        let is_whole = table.row_count() == self.variants_of(part).len()
            && table.metadata.get("checksum") == Some(&checksum(&table));
        (is_whole && self.is_own(&table)).then_some(table)
    }

    /// The rows of a part.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if the part cannot be used.
    pub(crate) fn rows(&self, study: &Study, part: usize) -> Result<Vec<PartRow>, CampaignError> {
        match self.sound(part) {
            Some(table) => Ok(PartRow::from_table(study, &table)?),
            None => Err(CampaignError::Unfinished {
                missing: self.missing_variants(),
                damaged: self.damaged(),
            }),
        }
    }

    /// The first part that is damaged.
    pub(crate) fn damaged(&self) -> Option<PathBuf> {
        let is_damaged = |&part: &usize| {
            let path = self.path(part);
            let is_other = || table::read(&path).is_ok_and(|table| !self.is_own(&table));
            path.exists() && self.sound(part).is_none() && !is_other()
        };
        (0..self.count()).find(is_damaged).map(|part| self.path(part))
    }

    /// Number of variants without a usable part.
    pub(crate) fn missing_variants(&self) -> usize {
        self.missing(0..self.count()).into_iter().map(|part| self.variants_of(part).len()).sum()
    }

    /// Writes a part with the rows of its variants.
    pub(crate) fn write(
        &self,
        part: usize,
        rows: &BTreeMap<usize, PartRow>,
    ) -> Result<(), CampaignError> {
        let table = PartRow::to_table(rows)?;
        let table = table.with_metadata("fingerprint", self.fingerprint.clone());
        let sum = checksum(&table);
        Ok(table::write(self.path(part), &table.with_metadata("checksum", sum))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_read_from_its_text_and_counts_from_one() {
        let share: Share = "3/100".parse().unwrap();
        assert_eq!(share.to_string(), "3/100");
        let held: Vec<usize> = (0..250).filter(|&part| share.holds(part)).collect();
        assert_eq!(held, [2, 102, 202]);
        for wrong in ["", "3", "0/3", "4/3", "-1/3", "a/b", "1/2/3"] {
            assert!(wrong.parse::<Share>().is_err(), "{wrong}");
        }
    }
}
