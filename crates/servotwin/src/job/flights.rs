//! The stage of flights: a diagnoser for each setting, and what it is worth.

use super::{Folder, JobError, pools};
use crate::campaign::CampaignError;
use crate::evaluation::{EvaluationError, model_file};
use crate::files::FileError;
use crate::flight::campaign::FlightCampaign;
use crate::flight::hard_negatives;
use crate::flight::judge::{self, FlightMetrics, MissingSensorMetrics, WatchedFlights};
use crate::flight::plan::Purpose;
use crate::flight::train;
use crate::flight::training_windows::{self, LeftOut, TrainingWindows};
use crate::flight::unseen_faults::{self, UnseenFaultMetrics};
use crate::parallel::Workers;
use crate::study::flights::{Limits, Size};
use crate::study::{Flights, Setting, Study};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;

/// The settings in which flights are flown: a specimen that is the twin (or to which the twin is
/// fitted perfectly), and one that is not.
pub const SETTINGS: [Setting; 2] = [Setting::Noise, Setting::Realistic];

/// What was measured in flights, of the settings in the order of [`SETTINGS`].
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
    pub merits: Vec<FlightMetrics>,
    /// For each setting what was said of faults that were never trained on.
    pub foreign: Vec<UnseenFaultMetrics>,
}

impl FlightResults {
    /// Whether these are the full sizes, measured in every setting of the study.
    pub fn is_full_of(&self, study: &Study) -> bool {
        let has =
            |setting: Setting| self.merits.iter().any(|merit| merit.setting == setting.name());
        self.is_full && settings(study).into_iter().all(has)
    }

    /// Adds the settings that only the other ones have, if those were measured in the same flights and by the same
    /// rule of what is visible.
    fn join(&mut self, other: FlightResults) {
        let sizes = |of: &Self| (of.is_full, of.learn, of.judge, of.limits, of.windows_s.clone());
        if sizes(self) != sizes(&other) {
            return;
        }
        for (merit, foreign) in other.merits.into_iter().zip(other.foreign) {
            let is_of_now = merit.healthy.visible_by_chance.is_some();
            if is_of_now && self.merits.iter().all(|own| own.setting != merit.setting) {
                self.merits.push(merit);
                self.foreign.push(foreign);
            }
        }
        let place = |name: &str| SETTINGS.iter().position(|setting| setting.name() == name);
        self.merits.sort_by_key(|merit| place(&merit.setting));
        self.foreign.sort_by_key(|foreign| place(&foreign.setting));
    }
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

/// The settings in which a study's flights can be flown.
pub fn settings(study: &Study) -> Vec<Setting> {
    let possible = |setting: &Setting| !setting.has_noise() || study.realism.is_some();
    SETTINGS.into_iter().filter(possible).collect()
}

/// Learns in flights and writes the diagnoser of a setting. Also returns the flights that teach nothing.
///
/// # Errors
/// A twin cannot be simulated; what training says; the file cannot be written.
pub fn learn(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    setting: Setting,
    crew: &Crew,
) -> Result<(Diagnoser, LeftOut), JobError> {
    let usual = |environment: usize| environment < flights.learn.environments;
    let flown =
        FlightCampaign::where_it_is(study, flights, Purpose::Learn, setting, usual, crew.workers)?;
    let lessons = training_windows::cut(study, flights, &flown);
    crew.check()?;
    learn_from(folder, study, flights, setting, lessons, crew)
}

/// Learns from what was cut out of flights, be they flown elsewhere, and of the further flights, and writes the diagnoser
/// of a setting.
///
/// # Errors
/// What training says; the file cannot be written.
pub fn learn_from(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    setting: Setting,
    mut lessons: TrainingWindows,
    crew: &Crew,
) -> Result<(Diagnoser, LeftOut), JobError> {
    hard_negatives::add(study, flights, setting, &mut lessons, &pools(study), crew.workers)?;
    let left_out = lessons.left_out();
    let tables = training_windows::tables(study, flights, setting, lessons, crew.workers)?;
    let diagnoser = train::diagnoser(study, flights, setting, tables, &pools(study), crew.workers)?;
    model_file::write(folder.diagnoser(setting), &diagnoser)?;
    Ok((diagnoser, left_out))
}

/// What a diagnoser is worth in a setting, from what is remembered of all flights to be judged in.
pub fn merit(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    (diagnoser, left_out): (&Diagnoser, LeftOut),
    watched: WatchedFlights,
) -> FlightMetrics {
    let asked = (setting.name(), limit_s(flights, setting));
    let merit = judge::merit(study, flights, asked, diagnoser, watched);
    let LeftOut { failed, on_the_move } = left_out;
    FlightMetrics { failed_to_learn: failed, on_the_move_to_learn: on_the_move, ..merit }
}

/// Learns and judges in flights of some of [`settings`], and writes what was measured.
///
/// # Errors
/// As [`results`], before anything is flown; as [`learn`].
pub fn fly_all(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    settings: &[Setting],
    is_full: bool,
    crew: &Crew,
) -> Result<FlightResults, JobError> {
    // What is written in the end keeps what was measured before; hours later would be too late to say that it cannot.
    results(folder)?;
    for (place, &setting) in settings.iter().enumerate() {
        let part = |share: f64| (place as f64 + share) / settings.len() as f64;
        (crew.progress)(&format!("{}: flights to learn from", setting.name()), part(0.0));
        let (diagnoser, left_out) = learn(folder, study, flights, setting, crew)?;
        let flown = FlightCampaign::new(study, flights, Purpose::Judge, setting, crew.workers)?;
        let told = |done: usize, of: usize| {
            let share = 0.4 + 0.5 * done as f64 / of.max(1) as f64;
            (crew.progress)(&format!("{}: flights to be judged in", setting.name()), part(share));
        };
        let watched = judge::watch(&flown, &diagnoser, &told);
        crew.check()?;
        let watched = watched.map_err(|error| JobError::Evaluation(error.into()))?;
        let merit = merit(study, flights, setting, (&diagnoser, left_out), watched);
        (crew.progress)(&format!("{}: faults never trained on", setting.name()), part(0.9));
        let said =
            unseen_faults::judge(study, flights, setting, &Arc::new(diagnoser), crew.workers);
        crew.check()?;
        write(folder, flights, is_full, vec![(merit, said?)])?;
    }
    results(folder)?.ok_or_else(|| JobError::Missing { path: folder.flights(), stage: "flights" })
}

/// Flies the judged flights of some settings once more for each sensor that is missing, beside the diagnosers that lie
/// in the folder, and writes what was measured.
///
/// # Errors
/// A diagnoser is missing; a twin cannot be simulated; the file cannot be written.
pub fn without_sensors(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    settings: &[Setting],
    crew: &Crew,
) -> Result<Vec<MissingSensorMetrics>, JobError> {
    let mut merits = vec![];
    for &setting in settings {
        let diagnoser = Arc::new(diagnoser(folder, setting)?);
        let flown = FlightCampaign::new(study, flights, Purpose::Judge, setting, crew.workers)?;
        let asked = (setting.name(), limit_s(flights, setting));
        for sensor in 0..diagnoser.sensors.len() {
            let name = &diagnoser.sensors[sensor].name;
            let share = merits.len() as f64 / (settings.len() * diagnoser.sensors.len()) as f64;
            (crew.progress)(&format!("{}: flights without {name}", setting.name()), share);
            let merit = judge::without(study, &flown, asked, &diagnoser, sensor);
            crew.check()?;
            merits.push(merit.map_err(|error| JobError::Evaluation(error.into()))?);
        }
    }
    model_file::write(folder.missing_sensors(), &merits)?;
    Ok(merits)
}

/// How soon shutdown faults are to be isolated in a setting, s.
fn limit_s(flights: &Flights, setting: Setting) -> f64 {
    match setting.has_tolerances() {
        true => flights.limits.latency_unfitted_s,
        false => flights.limits.latency_s,
    }
}

/// Writes what was measured in some settings. What lies there of others stays if it was measured in flights of the same
/// sizes.
///
/// # Errors
/// As [`results`]; the file cannot be written.
pub fn write(
    folder: &Folder,
    flights: &Flights,
    is_full: bool,
    measured: Vec<(FlightMetrics, UnseenFaultMetrics)>,
) -> Result<FlightResults, JobError> {
    let (merits, foreign) = measured.into_iter().unzip();
    let mut all = FlightResults {
        is_full,
        learn: flights.learn,
        judge: flights.judge,
        windows_s: flights.windows_s.clone(),
        limits: flights.limits,
        merits,
        foreign,
    };
    if let Some(before) = results(folder)? {
        all.join(before);
    }
    model_file::write(folder.flights(), &all)?;
    Ok(all)
}

/// Reads what was measured in flights; `None` if there were none.
///
/// # Errors
/// [`JobError::Unreadable`]; the file is not what the manifest says.
pub fn results(folder: &Folder) -> Result<Option<FlightResults>, JobError> {
    if !folder.flights().exists() {
        return Ok(None);
    }
    match model_file::read(folder.flights()) {
        Ok(results) => Ok(Some(results)),
        // It says by itself what is to be done.
        Err(error @ EvaluationError::File(FileError::Altered { .. })) => Err(error.into()),
        Err(error) => Err(JobError::Unreadable { error, stage: "flights" }),
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
