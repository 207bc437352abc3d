//! The stage of flights: a diagnoser for each setting, and what it is worth.

use super::{Folder, JobError, pools};
use crate::evaluation::model_file;
use crate::evaluation::parallel::Workers;
use crate::flight::flown::Flown;
use crate::flight::foreign::{self, ForeignMerit};
use crate::flight::judge::{self, Merit};
use crate::flight::plan::Purpose;
use crate::flight::{lessons, train};
use crate::study::campaign::CampaignError;
use crate::study::flights::{Limits, Size};
use crate::study::{Flights, Setting, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;

/// The settings in which flights are flown: a specimen that is the twin (or to which the twin is
/// fitted perfectly), and one that is not.
pub const SETTINGS: [Setting; 2] = [Setting::Noise, Setting::Realistic];

/// What was measured in flights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightResults {
    /// Whether these are the full sizes of the study.
    pub is_full: bool,
    /// How many flights taught.
    pub learn: Size,
    /// How many were judged.
    pub judge: Size,
    /// Lengths of the windows, s.
    pub windows_s: Vec<f64>,
    /// What was asked for.
    pub limits: Limits,
    /// For each setting what was measured.
    pub merits: Vec<Merit>,
    /// For each setting what was said of faults that were never trained on.
    pub foreign: Vec<ForeignMerit>,
}

/// Who works, and who is told.
pub struct Crew<'c> {
    /// Threads, and what stops them.
    pub workers: Workers<'c>,
    /// Is told what is being done, and how much of all is done, from 0 to 1.
    pub progress: &'c (dyn Fn(&str, f64) + Sync),
}

impl Crew<'_> {
    fn check(&self) -> Result<(), JobError> {
        match self.workers.is_cancelled() {
            true => Err(CampaignError::Cancelled.into()),
            false => Ok(()),
        }
    }
}

/// Learns in flights and writes the diagnoser of a setting; also how many of these flights could not be
/// simulated to the end, which teach nothing.
///
/// # Errors
/// A twin cannot be simulated; what training says; the file cannot be written.
pub fn learn(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    setting: Setting,
    crew: &Crew,
) -> Result<(Diagnoser, u64), JobError> {
    let flown = Flown::new(study, flights, Purpose::Learn, setting, crew.workers)?;
    let lessons = lessons::tables(study, flights, setting, &flown, crew.workers);
    crew.check()?;
    let (tables, failed) = lessons?;
    let diagnoser = train::diagnoser(study, flights, tables, &pools(study), crew.workers)?;
    model_file::write(folder.diagnoser(setting), &diagnoser)?;
    Ok((diagnoser, failed as u64))
}

/// Learns and judges in flights of every setting, and writes what was measured.
///
/// # Errors
/// As [`learn`].
pub fn fly_all(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    is_full: bool,
    crew: &Crew,
) -> Result<FlightResults, JobError> {
    let possible = |setting: &Setting| !setting.has_noise() || study.realism.is_some();
    let settings: Vec<Setting> = SETTINGS.into_iter().filter(possible).collect();
    let (mut merits, mut foreign) = (vec![], vec![]);
    for (place, &setting) in settings.iter().enumerate() {
        let part = |share: f64| (place as f64 + share) / settings.len() as f64;
        (crew.progress)(&format!("{}: flights to learn from", setting.name()), part(0.0));
        let (diagnoser, failed_to_learn) = learn(folder, study, flights, setting, crew)?;
        let flown = Flown::new(study, flights, Purpose::Judge, setting, crew.workers)?;
        let told = |done: usize, of: usize| {
            let share = 0.4 + 0.5 * done as f64 / of.max(1) as f64;
            (crew.progress)(&format!("{}: flights to be judged in", setting.name()), part(share));
        };
        let limit_s = match setting.has_tolerances() {
            true => flights.limits.latency_unfitted_s,
            false => flights.limits.latency_s,
        };
        let merit = judge::judge(study, (setting.name(), limit_s), &flown, &diagnoser, &told);
        crew.check()?;
        let merit = merit.map_err(|error| JobError::Evaluation(error.into()))?;
        merits.push(Merit { failed_to_learn, ..merit });
        (crew.progress)(&format!("{}: faults never trained on", setting.name()), part(0.9));
        let diagnoser = Arc::new(diagnoser);
        let said = foreign::judge(study, flights, setting, &diagnoser, crew.workers);
        crew.check()?;
        foreign.push(said?);
    }
    let results = FlightResults {
        is_full,
        learn: flights.learn,
        judge: flights.judge,
        windows_s: flights.windows_s.clone(),
        limits: flights.limits,
        merits,
        foreign,
    };
    model_file::write(folder.flights(), &results)?;
    Ok(results)
}

/// Reads what was measured in flights; `None` if there were none.
///
/// # Errors
/// The file cannot be read.
pub fn results(folder: &Folder) -> Result<Option<FlightResults>, JobError> {
    match folder.flights().exists() {
        true => Ok(Some(model_file::read(folder.flights())?)),
        false => Ok(None),
    }
}

/// Reads the diagnoser of a setting.
///
/// # Errors
/// [`JobError::Missing`], or it is none.
pub fn diagnoser(folder: &Folder, setting: Setting) -> Result<Diagnoser, JobError> {
    let path = folder.diagnoser(setting);
    match path.exists() {
        true => Ok(model_file::read_diagnoser(path)?),
        false => Err(JobError::Missing { path, stage: "flights" }),
    }
}
