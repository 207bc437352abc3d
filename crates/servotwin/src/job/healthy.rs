//! Many healthy flights of the stored diagnosers, each in an environment of its own. An interrupted run goes on where it
//! was last stored.

use super::flights::{Crew, diagnoser};
use super::{Folder, JobError};
use crate::evaluation::model_file;
use crate::flight::healthy::{self, Differences, HealthyFlight, HealthyPlants, HealthySummary};
use crate::flight::other_plant::OtherPlants;
use crate::manifest::{sha256, sha256_of_text};
use crate::study::{HealthyDraw, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::Session;
use std::sync::Arc;

/// Number of environments whose twins are in memory at a time.
pub(super) const BATCH: usize = 96;

/// A run is stored whenever it has grown by this fraction: every batch at first, and rarely once its file is large.
const STORED_EVERY: f64 = 0.05;

/// The healthy flights of one scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HealthyRun {
    /// The scenario.
    pub setting: String,
    /// The seed of environments, specimens and noise.
    pub seed: u64,
    /// Duration of a flight, s.
    pub duration_s: f64,
    /// The hash of the diagnoser's file.
    pub diagnoser_sha256: String,
    /// The hash of the study file.
    pub study_sha256: String,
    /// Number of environments flown.
    pub flown: u64,
    /// Number of those in which the plant could not be simulated to the end.
    pub failed: u64,
    /// The counts of all finished flights.
    pub summary: HealthySummary,
    /// The finished flights.
    pub flights: Vec<HealthyFlight>,
}

impl HealthyRun {
    /// Whether both runs fly the same environments beside the same diagnoser.
    fn is_same_as(&self, other: &HealthyRun) -> bool {
        let of = |run: &HealthyRun| {
            let HealthyRun { setting, seed, duration_s, diagnoser_sha256, study_sha256, .. } = run;
            let hashes = (diagnoser_sha256.clone(), study_sha256.clone());
            (setting.clone(), *seed, duration_s.to_bits(), hashes)
        };
        of(self) == of(other)
    }
}

/// Flies healthy flights of a scenario until there are `count`, each in an environment of its own, and writes them. What
/// the folder's file holds of the same flights stays; a file of other flights is replaced. Nothing is learned.
///
/// `None` if the study has no flights of these sizes.
///
/// # Errors
/// The diagnoser is missing; a twin cannot be simulated; the file cannot be read or written.
pub fn fly(
    folder: &Folder,
    study: &Study,
    plants: HealthyPlants,
    (count, draw): (usize, HealthyDraw),
    crew: &Crew,
) -> Result<Option<HealthyRun>, JobError> {
    let Some(duration_s) = study.healthy_duration_s(draw) else { return Ok(None) };
    let other = match plants {
        HealthyPlants::Of(_) => None,
        HealthyPlants::Other => {
            match study.other_plant().map_err(|error| JobError::Study(error.into()))? {
                Some(differences) => Some(OtherPlants::new(study, &differences)?),
                None => return Ok(None),
            }
        }
    };
    let differences = other.as_ref().map_or(Differences::Scattered(1.0), Differences::Structure);
    let setting = plants.setting();
    let session = Session::new(Arc::new(diagnoser(folder, setting)?))
        .map_err(|error| JobError::Evaluation(error.into()))?;
    let mut run = begun(folder, study, plants, (draw.seed, duration_s))?;
    let mut stored = run.flown as usize;
    while (run.flown as usize) < count {
        let from = run.flown as usize;
        let numbers = from..count.min(from + BATCH);
        let what = format!("{}: healthy flights", plants.name());
        (crew.progress)(&what, from as f64 / count as f64);
        let drawn = study.healthy_environments(draw, numbers.clone());
        let environments =
            drawn.map_err(|error| JobError::Study(error.into()))?.unwrap_or_default();
        let place = (&environments[..], numbers.clone());
        let of_seed = (draw.seed, duration_s);
        let (flights, failed) =
            healthy::fly(study, place, of_seed, (setting, differences), &session, crew.workers)?;
        run.flights.extend(flights);
        run.failed += failed;
        run.flown = numbers.end as u64;
        let has_grown = (numbers.end - stored) as f64 > STORED_EVERY * stored as f64;
        if has_grown || numbers.end == count {
            run.summary = HealthySummary::new(&run.flights, duration_s);
            model_file::write(folder.healthy_flights(plants), &run)?;
            stored = numbers.end;
        }
    }
    Ok(Some(run))
}

/// The stored run of the same flights, or one without flights.
fn begun(
    folder: &Folder,
    study: &Study,
    plants: HealthyPlants,
    (seed, duration_s): (u64, f64),
) -> Result<HealthyRun, JobError> {
    let new = HealthyRun {
        setting: plants.name().into(),
        seed,
        duration_s,
        diagnoser_sha256: sha256(&folder.diagnoser(plants.setting()))?,
        study_sha256: sha256_of_text(&study.text),
        flown: 0,
        failed: 0,
        summary: HealthySummary::new(&[], duration_s),
        flights: vec![],
    };
    let stored = stored(folder, plants)?;
    Ok(stored.filter(|stored| stored.is_same_as(&new)).unwrap_or(new))
}

/// Reads the healthy flights of a scenario; `None` if there are none.
///
/// # Errors
/// The file cannot be read, or contradicts the manifest.
pub fn stored(folder: &Folder, plants: HealthyPlants) -> Result<Option<HealthyRun>, JobError> {
    let path = folder.healthy_flights(plants);
    Ok(if path.exists() { Some(model_file::read(path)?) } else { None })
}
