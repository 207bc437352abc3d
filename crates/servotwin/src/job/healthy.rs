//! Many healthy flights of the stored diagnosers, each in an environment of its own. An interrupted run goes on where it
//! was last stored.

use super::flights::{Crew, diagnoser};
use super::{Folder, JobError};
use crate::flight::healthy::{self, Differences, HealthyPlants};
use crate::flight::judge::HealthyMetrics;
use crate::flight::other_plant::OtherPlants;
use crate::flight::outcome::{self, FlightOutcome};
use crate::manifest::{sha256, sha256_of_text};
use crate::study::{HealthyDraw, Study};
use crate::table::{self, TableError};
use servotwin_diagnosis::diagnoser::Session;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Number of environments whose twins are in memory at a time.
pub(super) const BATCH: usize = 96;

/// A run is stored whenever it has grown by this fraction: every batch at first, and rarely once its file is large.
const STORED_EVERY: f64 = 0.05;

/// The healthy flights of one scenario. Its file is the table of outcomes with the other fields as metadata.
#[derive(Debug, Clone, PartialEq)]
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
    /// The outcome in each environment.
    pub outcomes: Vec<FlightOutcome>,
}

impl HealthyRun {
    /// Number of flights in which the plant could not be simulated to the end.
    pub fn failed(&self) -> usize {
        self.outcomes.iter().filter(|row| !row.is_finished).count()
    }

    /// The counts of all finished flights.
    pub fn summary(&self) -> HealthyMetrics {
        let finished: Vec<&FlightOutcome> =
            self.outcomes.iter().filter(|row| row.is_finished).collect();
        HealthyMetrics::new(&finished)
    }

    fn metadata(&self) -> BTreeMap<String, String> {
        let HealthyRun { setting, seed, duration_s, diagnoser_sha256, study_sha256, .. } = self;
        let fields = [
            ("setting", setting.clone()),
            ("seed", seed.to_string()),
            ("duration_s", duration_s.to_string()),
            ("diagnoser_sha256", diagnoser_sha256.clone()),
            ("study_sha256", study_sha256.clone()),
        ];
        fields.map(|(key, value)| (key.to_owned(), value)).into()
    }

    fn write(&self, folder: &Folder, plants: HealthyPlants) -> Result<(), JobError> {
        let mut rows = outcome::table(&self.outcomes);
        rows.metadata.extend(self.metadata());
        let path = folder.healthy_flights(plants);
        table::write(&path, &rows).map_err(|error| JobError::Outcomes { path, error })
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
        .map_err(|error| JobError::Evaluation(error.into()))?
        .at_rest();
    let mut run = begun(folder, study, plants, (draw.seed, duration_s))?;
    let mut stored = run.outcomes.len();
    while run.outcomes.len() < count {
        let from = run.outcomes.len();
        let numbers = from..count.min(from + BATCH);
        let what = format!("{}: healthy flights", plants.name());
        (crew.progress)(&what, from as f64 / count as f64);
        let drawn = study.healthy_environments(draw, numbers.clone());
        let environments =
            drawn.map_err(|error| JobError::Study(error.into()))?.unwrap_or_default();
        let place = (&environments[..], numbers.clone());
        let of_seed = (draw.seed, duration_s);
        let plants_of_flights = (setting, differences);
        let flown = healthy::fly(study, place, of_seed, plants_of_flights, &session, crew.workers)?;
        run.outcomes.extend(flown);
        let has_grown = (numbers.end - stored) as f64 > STORED_EVERY * stored as f64;
        if has_grown || numbers.end == count {
            run.write(folder, plants)?;
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
        outcomes: vec![],
    };
    let stored = stored(folder, plants)?;
    Ok(stored.filter(|stored| stored.metadata() == new.metadata()).unwrap_or(new))
}

/// Reads the healthy flights of a scenario; `None` if there are none.
///
/// # Errors
/// The file cannot be read, or contradicts the manifest.
pub fn stored(folder: &Folder, plants: HealthyPlants) -> Result<Option<HealthyRun>, JobError> {
    let path = folder.healthy_flights(plants);
    if !path.exists() {
        return Ok(None);
    }
    let wrong = |error: TableError| JobError::Outcomes { path: path.clone(), error };
    let rows = table::read(&path).map_err(wrong)?;
    let text = |key: &str| rows.metadata.get(key).cloned().unwrap_or_default();
    Ok(Some(HealthyRun {
        setting: text("setting"),
        seed: text("seed").parse().unwrap_or_default(),
        duration_s: text("duration_s").parse().unwrap_or_default(),
        diagnoser_sha256: text("diagnoser_sha256"),
        study_sha256: text("study_sha256"),
        outcomes: outcome::from_table(&rows).map_err(wrong)?,
    }))
}
