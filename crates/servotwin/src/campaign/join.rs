//! Joins parts to data sets, one after the other: memory holds the rows of one group of the file.

use super::data_set::Maker;
use super::part::{PartFiles, PartRow};
use super::{Campaign, CampaignError, CampaignOutcome, Plants, PreparedCampaign, calibration_file};
use crate::table::parquet::ParquetWriter;

/// Least number of rows in one group of a data set; a group is held in memory until it is written.
const GROUP_ROWS: usize = 16_000;

impl Campaign<'_> {
    /// Joins the parts of a completed campaign to its data sets.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if parts are missing, [`CampaignError::Cancelled`]; or a file cannot be read or written.
    pub fn merge(&self) -> Result<CampaignOutcome, CampaignError> {
        let prepared = self.done()?;
        // If shares had separate folders, perhaps only their parts were copied together.
        let is_told = calibration_file(&self.folder, self.purpose).exists();
        if self.plants() == Plants::Pool && !is_told {
            self.calibrate()?;
        }
        let variants = prepared.counts.iter().sum();
        let mut outcome =
            CampaignOutcome { variants, resumed: variants, ..CampaignOutcome::default() };
        self.write_data_sets(&prepared, &mut outcome)?;
        Ok(outcome)
    }

    /// The windows of all variants of a completed campaign, by scenario.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if parts are missing, or a file cannot be read.
    pub fn windows(&self) -> Result<Vec<Vec<PartRow>>, CampaignError> {
        let prepared = self.done()?;
        let of = |files: &PartFiles| {
            let rows = (0..files.count()).map(|part| files.rows(self.study, part));
            Ok(rows.collect::<Result<Vec<_>, CampaignError>>()?.into_iter().flatten().collect())
        };
        self.files(&prepared).iter().map(of).collect()
    }

    /// The plan of a campaign whose parts are complete.
    fn done(&self) -> Result<PreparedCampaign, CampaignError> {
        let prepared = self.prepared()?;
        let files = self.files(&prepared);
        if files.iter().all(PartFiles::seem_complete) {
            return Ok(prepared);
        }
        match files.iter().map(PartFiles::missing_variants).sum() {
            0 => Ok(prepared),
            missing => {
                let damaged = files.iter().find_map(PartFiles::damaged);
                Err(CampaignError::Unfinished { missing, damaged })
            }
        }
    }

    pub(super) fn write_data_sets(
        &self,
        prepared: &PreparedCampaign,
        outcome: &mut CampaignOutcome,
    ) -> Result<(), CampaignError> {
        outcome.failed.clear();
        outcome.on_the_move = 0;
        for (place, files) in self.files(prepared).iter().enumerate() {
            self.write_data_set(prepared, place, files, outcome)?;
        }
        Ok(())
    }

    fn write_data_set(
        &self,
        prepared: &PreparedCampaign,
        place: usize,
        files: &PartFiles,
        outcome: &mut CampaignOutcome,
    ) -> Result<(), CampaignError> {
        let (study, scenario) = (self.study, self.scenarios[place]);
        let maker = Maker { campaign: self, scenario, suite: &prepared.suite };
        let name = format!("dataset-{}{}.parquet", scenario.name(), self.purpose.suffix());
        let mut writer: Option<ParquetWriter> = None;
        let mut in_group = 0;
        for part in 0..files.count().max(1) {
            if self.is_cancelled() {
                return Err(CampaignError::Cancelled);
            }
            let variants = files.variants_of(part);
            let rows = if variants.is_empty() { vec![] } else { files.rows(study, part)? };
            let numbered = variants.clone().zip(&rows).filter(|(_, row)| !row.failure.is_empty());
            let failed = numbered.map(|(index, row)| (scenario, index, row.failure.clone()));
            outcome.failed.extend(failed);
            outcome.on_the_move += rows.iter().filter(|row| row.effort.began_on_the_move).count();
            let table = maker.table(variants, &rows);
            let writer = match &mut writer {
                Some(writer) => writer,
                None => {
                    let schema = table
                        .without_rows()
                        .with_metadata("fingerprint", prepared.fingerprints[place].clone())
                        .with_metadata("study", study.name.clone())
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
