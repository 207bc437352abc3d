//! Joins parts to data sets, one after the other: memory holds the rows of one group of the file.

use super::data_set::Maker;
use super::row::PartRow;
use super::{Records, RecordsOutcome, RunError, Scenario};
use crate::run::part::PartFiles;
use crate::table::parquet::ParquetWriter;

/// Least number of rows in one group of a data set; a group is held in memory until it is written.
const GROUP_ROWS: usize = 16_000;

impl Records<'_> {
    /// The windows of all records, by scenario.
    ///
    /// # Errors
    /// [`RunError::Unfinished`] if parts are missing, or a file cannot be read.
    pub fn windows(&self) -> Result<Vec<Vec<PartRow>>, RunError> {
        let of = |files: &PartFiles| {
            let rows = (0..files.parts.len()).map(|part| self.rows(files, part));
            Ok(rows.collect::<Result<Vec<_>, RunError>>()?.into_iter().flatten().collect())
        };
        self.files.iter().map(of).collect()
    }

    /// The rows of a part.
    ///
    /// # Errors
    /// [`RunError::Unfinished`] if the part cannot be used.
    fn rows(&self, files: &PartFiles, part: usize) -> Result<Vec<PartRow>, RunError> {
        let table = files.read(part)?;
        Ok(table.map_or(Ok(vec![]), |table| PartRow::from_table(self.study, &table))?)
    }

    pub(super) fn write_data_sets(&self, outcome: &mut RecordsOutcome) -> Result<(), RunError> {
        let mut of = self.scenarios.iter().zip(&self.files);
        of.try_for_each(|(&scenario, files)| self.write_data_set((scenario, files), outcome))
    }

    fn write_data_set(
        &self,
        (scenario, files): (Scenario, &PartFiles),
        outcome: &mut RecordsOutcome,
    ) -> Result<(), RunError> {
        let maker = Maker { records: self, scenario };
        let name = format!("dataset-{}{}.parquet", scenario.name(), self.suite.purpose.suffix());
        let mut writer: Option<ParquetWriter> = None;
        let mut in_group = 0;
        // Without any row there is a table without rows.
        let is_empty = files.parts.iter().all(Vec::is_empty);
        let own = files.parts.iter().enumerate();
        let own = own.filter(|(part, variants)| !variants.is_empty() || is_empty && *part == 0);
        for (part, variants) in own {
            if self.workers.is_cancelled() {
                return Err(RunError::Cancelled);
            }
            let rows = self.rows(files, part)?;
            let numbered = variants.iter().copied().zip(&rows);
            let numbered = numbered.filter(|(_, row)| !row.failure.is_empty());
            let failed = numbered.map(|(index, row)| (scenario, index, row.failure.clone()));
            outcome.failed.extend(failed);
            outcome.on_the_move += rows.iter().filter(|row| row.effort.began_on_the_move).count();
            let table = maker.table(variants, &rows);
            let writer = match &mut writer {
                Some(writer) => writer,
                None => {
                    let schema = table
                        .without_rows()
                        .with_metadata("study", self.study.name.clone())
                        .with_metadata("scenario", scenario.name());
                    writer.insert(ParquetWriter::create(self.folder.join(&name), &schema)?)
                }
            };
            writer.append(&table)?;
            in_group += rows.len();
            if in_group >= GROUP_ROWS {
                writer.end_group()?;
                in_group = 0;
            }
        }
        if let Some(writer) = writer {
            writer.finish()?;
        }
        Ok(())
    }
}
