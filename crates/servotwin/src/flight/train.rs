//! Trees, committee and bands for each length of a window, learned from flights.

use crate::evaluation::parallel::Workers;
use crate::evaluation::protocol::{self, Protocol, ProtocolResult};
use crate::evaluation::{self, DataSet, EvaluationError, FeatureInfo, Settings};
use crate::study::{Role, Study};
use crate::table::Table;
use servotwin_diagnosis::panel::{Panel, SensorBand};

/// What was learned for windows of one length.
pub struct Learned {
    /// The length, s.
    pub window_s: f64,
    /// Bands, trees and committee.
    pub panel: Panel,
    /// Windows of faults and healthy ones from which they were learned.
    pub lessons: [usize; 2],
}

/// How windows of flights are learned from: bands are learned too, and windows carry the noise of
/// their flight, so that they need no moves.
pub fn settings() -> Settings {
    Settings { learned_bands: true, ..Settings::default() }
}

fn data_set(study: &Study, tables: &[(Role, Table)]) -> Result<DataSet, EvaluationError> {
    let features = FeatureInfo::of_study(study, false);
    DataSet::new(tables, features, &study.units)?.taught()
}

/// Learns from the windows of one length.
///
/// # Errors
/// What training says.
pub fn train(
    study: &Study,
    window_s: f64,
    table: Table,
    pools: &[usize],
    workers: Workers,
) -> Result<Learned, EvaluationError> {
    let data = data_set(study, &[(Role::Training, table)])?;
    let trained = evaluation::train(&data, &settings(), pools, workers)?;
    let bands = trained.bands.unwrap_or_default();
    let faults = data.rows.iter().filter(|row| !row.is_healthy).count();
    let panel = Panel {
        bands: bands
            .into_iter()
            .map(|band| SensorBand { sensor: band.sensor, half_width: band.half_width })
            .collect(),
        least_confidence: trained.committee.least_confidence,
        trees: trained.trees,
        committee: trained.committee.hierarchy,
        ..Panel::default()
    };
    Ok(Learned { window_s, panel, lessons: [faults, data.rows.len() - faults] })
}

/// How good trees and committee are on single windows of flights in environments from which nothing
/// was learned.
///
/// # Errors
/// What training says.
pub fn judge_windows(
    study: &Study,
    tables: [Table; 2],
    pools: &[usize],
    workers: Workers,
) -> Result<[Option<ProtocolResult>; 2], EvaluationError> {
    let [learned, judged] = tables;
    let data = data_set(study, &[(Role::Judged, judged), (Role::Training, learned)])?;
    let settings = settings();
    let (data, _) = evaluation::banded(&data, &settings, pools);
    let judge = |training, lessons| {
        let holding = protocol::Holding { lessons, ..settings.holding };
        let protocol = Protocol::NewCommand;
        protocol::evaluate(protocol, &data, training, holding, &settings.shutdown, workers)
    };
    let trees = evaluation::run::settled(&data, &settings.training);
    let trees = judge(&trees, settings.holding.lessons)?;
    let committee = judge(&settings.committee, settings.committee_lessons)?;
    Ok([trees, committee].map(|found| found.map(|(result, _)| result)))
}
