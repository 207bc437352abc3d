//! Joins shards to data sets, one after the other: memory holds the rows of one group of the file.

use super::columns::HEALTHY;
use super::data_set::Maker;
use super::shard::{ShardRow, Shards};
use super::{
    Campaign, CampaignError, CampaignOutcome, OnTheMove, Plants, PreparedCampaign, calibration_file,
};
use crate::table::parquet::ParquetWriter;

/// Number of shards in one group of a data set; a group is held in memory until it is written.
const GROUP_SHARDS: usize = 80;

impl Campaign<'_> {
    /// Joins the shards of a completed campaign to its data sets.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if shards are missing, [`CampaignError::NotAlike`], [`CampaignError::Cancelled`];
    /// or a file cannot be read or written.
    pub fn merge(&self) -> Result<CampaignOutcome, CampaignError> {
        let prepared = self.done()?;
        if !self.units_are_alike(&prepared)? {
            return Err(CampaignError::NotAlike);
        }
        // If parts had separate folders, perhaps only their shards were copied together.
        let is_told = calibration_file(&self.folder, self.role).exists();
        if self.plants() == Plants::Pool && !is_told {
            self.calibrate()?;
        }
        self.joined(&prepared)
    }

    /// Recomputes the data sets from the shards of a completed campaign.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if shards are missing, or a file cannot be read or written.
    pub fn features(&self) -> Result<CampaignOutcome, CampaignError> {
        self.joined(&self.done()?)
    }

    /// The windows of all variants of a completed campaign, by scenario.
    ///
    /// # Errors
    /// [`CampaignError::Unfinished`] if shards are missing, or a file cannot be read.
    pub fn windows(&self) -> Result<Vec<Vec<ShardRow>>, CampaignError> {
        let prepared = self.done()?;
        let of = |shards: &Shards| {
            let rows = (0..shards.count()).map(|shard| shards.rows(self.study, shard));
            Ok(rows.collect::<Result<Vec<_>, CampaignError>>()?.into_iter().flatten().collect())
        };
        self.shards(&prepared).iter().map(of).collect()
    }

    /// The plan of a campaign whose shards are complete, either with symmetric copies or with every variant simulated.
    fn done(&self) -> Result<PreparedCampaign, CampaignError> {
        let missing = |prepared: &PreparedCampaign| {
            let shards = self.shards(prepared);
            match shards.iter().all(Shards::seem_complete) {
                true => 0,
                false => shards.iter().map(Shards::missing_variants).sum::<usize>(),
            }
        };
        let prepared = self.prepared()?;
        let least = missing(&prepared);
        if least == 0 {
            return Ok(prepared);
        }
        let prepared = self.without_images(prepared);
        match missing(&prepared).min(least) {
            0 => Ok(prepared),
            missing => Err(CampaignError::Unfinished {
                missing,
                damaged: self.shards(&prepared).iter().find_map(Shards::damaged),
            }),
        }
    }

    /// Whether the probes agree with their symmetric copies.
    pub(super) fn units_are_alike(
        &self,
        prepared: &PreparedCampaign,
    ) -> Result<bool, CampaignError> {
        let probed = prepared.images.probed();
        let windows = self.shards(prepared)[0].windows(self.study, &probed)?;
        Ok(prepared.images.hold(|variant| &windows[&variant]))
    }

    fn joined(&self, prepared: &PreparedCampaign) -> Result<CampaignOutcome, CampaignError> {
        let variants = prepared.counts.iter().sum();
        let mut outcome =
            CampaignOutcome { variants, resumed: variants, ..CampaignOutcome::default() };
        self.write_data_sets(prepared, &mut outcome)?;
        Ok(outcome)
    }

    pub(super) fn write_data_sets(
        &self,
        prepared: &PreparedCampaign,
        outcome: &mut CampaignOutcome,
    ) -> Result<(), CampaignError> {
        [outcome.images, outcome.alike] = prepared.images.counts();
        outcome.failed.clear();
        outcome.on_the_move.clear();
        let shards = self.shards(prepared);
        for (place, shards) in shards.iter().enumerate() {
            self.write_data_set(prepared, place, shards, outcome)?;
        }
        Ok(())
    }

    fn write_data_set(
        &self,
        prepared: &PreparedCampaign,
        place: usize,
        shards: &Shards,
        outcome: &mut CampaignOutcome,
    ) -> Result<(), CampaignError> {
        let (study, setting) = (self.study, self.settings[place]);
        let PreparedCampaign { plan, images, .. } = prepared;
        let maker = Maker { campaign: self, setting, plan, images };
        let name = format!("dataset-{}{}.parquet", setting.name(), self.role.suffix());
        let mut writer: Option<ParquetWriter> = None;
        for shard in 0..shards.count().max(1) {
            if self.is_cancelled() {
                return Err(CampaignError::Cancelled);
            }
            let variants = shards.variants_of(shard);
            let rows = if variants.is_empty() { vec![] } else { shards.rows(study, shard)? };
            let numbered = variants.clone().zip(&rows).filter(|(_, row)| !row.failure.is_empty());
            let failed = numbered.map(|(index, row)| (setting, index, row.failure.clone()));
            outcome.failed.extend(failed);
            let numbered = variants.clone().zip(&rows);
            let moving = numbered.filter(|(_, row)| row.effort.began_on_the_move);
            let moving =
                moving.map(|(variant, row)| self.on_the_move(prepared, place, variant, row));
            outcome.on_the_move.extend(moving);
            let part = maker.table(variants, &rows);
            let writer = match &mut writer {
                Some(writer) => writer,
                None => {
                    let schema = part
                        .without_rows()
                        .with_metadata("fingerprint", prepared.fingerprints[place].clone())
                        .with_metadata("study", study.name.clone())
                        .with_metadata("setting", setting.name());
                    writer.insert(ParquetWriter::create(self.folder.join(&name), &schema)?)
                }
            };
            writer.append(&part)?;
            if (shard + 1).is_multiple_of(GROUP_SHARDS) {
                writer.end_group()?;
            }
        }
        if let Some(writer) = writer {
            writer.finish()?;
        }
        Ok(())
    }

    fn on_the_move(
        &self,
        prepared: &PreparedCampaign,
        place: usize,
        variant: usize,
        row: &ShardRow,
    ) -> OnTheMove {
        let planned = prepared.plan[variant];
        let fault = planned.fault.map(|fault| self.study.faults[fault].id.clone());
        OnTheMove {
            setting: self.settings[place],
            variant,
            fault: fault.unwrap_or_else(|| HEALTHY.into()),
            case: self.cases()[planned.case].name.clone(),
            limit_cycle: row.effort.limit_cycle,
        }
    }
}
