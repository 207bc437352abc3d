//! The flight stage: trains a diagnoser for each setting and measures its performance.

use super::sealed::{Opening, OpeningRecord, Openings, SealedSubject};
use super::{Folder, JobError, held_out, pools};
use crate::campaign::CampaignError;
use crate::evaluation::{EvaluationError, model_file};
use crate::files::FileError;
use crate::flight::boundaries::boundaries;
use crate::flight::campaign::FlightCampaign;
use crate::flight::fitted_twins::CalibrationRecords;
use crate::flight::judge::{self, FlightMetrics};
use crate::flight::measure;
use crate::flight::other_plant::{OTHER_PLANT, OTHER_PLANT_FITTED, OtherPlants};
use crate::flight::outcome::{self, FlightOutcome};
use crate::flight::plan::Purpose;
use crate::flight::train;
use crate::flight::training_windows::{self, LeftOut, TrainingWindows};
use crate::flight::unseen_faults::{self, UnseenFaultMetrics, set_names};
use crate::manifest::{sha256, sha256_of_text};
use crate::parallel::Workers;
use crate::study::flights::{Limits, Redraw, Size};
use crate::study::{Flights, Setting, Study};
use crate::table;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::sync::Arc;

/// The settings with flights. In the first, each specimen equals its twin, as after a perfect fit; in the second,
/// specimens differ from it.
pub const SETTINGS: [Setting; 2] = [Setting::Noise, Setting::Realistic];

/// Flights with the faults of the study, and healthy ones.
pub const JUDGE: &str = "judge";
/// Flights with faults that were never trained on.
pub const UNSEEN: &str = "unseen";
/// The same, of chosen challenge sets.
const CHALLENGE: &str = "challenge";
/// The flights of [`JUDGE`], watched by a diagnosis without each sensor.
const MISSING_SENSORS: &str = "missing_sensors";
/// Healthy flights, each in an environment of its own.
pub const HEALTHY: &str = "healthy";
const SEALED_JUDGE: &str = "sealed_judge";
const SEALED_UNSEEN: &str = "sealed_unseen";

/// The suites of flights, as the files with their outcomes are named.
pub const SUITES: [&str; 7] =
    [JUDGE, UNSEEN, CHALLENGE, MISSING_SENSORS, HEALTHY, SEALED_JUDGE, SEALED_UNSEEN];

/// The results of the flights, with the settings in the order of [`SETTINGS`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightResults {
    /// Whether the flights have the study's full sizes.
    pub is_full: bool,
    /// The numbers of training flights.
    pub learn: Size,
    /// The numbers of evaluation flights.
    pub judge: Size,
    /// Lengths of the sliding windows, s.
    pub windows_s: Vec<f64>,
    /// The targets of the study.
    pub limits: Limits,
    /// Figures of merit, one entry for each setting.
    pub merits: Vec<FlightMetrics>,
    /// Answers to faults without training, one entry for each setting.
    pub foreign: Vec<UnseenFaultMetrics>,
    /// Figures of merit of the diagnoser for specimens with tolerances, in plants that differ from their twin in
    /// structure; `None` without such plants.
    pub other_plant: Option<FlightMetrics>,
    /// The same beside twins that are fitted to these plants; `None` if that was not judged.
    pub other_plant_fitted: Option<FittedPlants>,
}

/// The figures of merit beside twins that are fitted to plants of another structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedPlants {
    /// Figures of merit.
    pub merit: FlightMetrics,
    /// What became of the calibration flights.
    pub calibration: CalibrationRecords,
}

impl FlightResults {
    fn new(
        flights: &Flights,
        is_full: bool,
        measured: Vec<(FlightMetrics, UnseenFaultMetrics)>,
        other_plant: Option<FlightMetrics>,
    ) -> Self {
        let (merits, foreign) = measured.into_iter().unzip();
        FlightResults {
            is_full,
            learn: flights.learn,
            judge: flights.judge,
            windows_s: flights.windows_s.clone(),
            limits: flights.limits,
            merits,
            foreign,
            other_plant,
            other_plant_fitted: None,
        }
    }

    /// Figures of merit in plants that differ from their twin in structure: beside nominal twins, then beside fitted ones.
    pub fn of_other_plants(&self) -> impl Iterator<Item = &FlightMetrics> {
        let fitted = self.other_plant_fitted.iter().map(|fitted| &fitted.merit);
        self.other_plant.iter().chain(fitted)
    }

    /// Whether the results have the full sizes and cover every setting of the study.
    pub fn is_full_of(&self, study: &Study) -> bool {
        let has =
            |setting: Setting| self.merits.iter().any(|merit| merit.setting == setting.name());
        self.is_full && settings(study).into_iter().all(has)
    }

    /// Adds settings that only `other` has. They must come from flights of the same sizes.
    fn join(&mut self, other: FlightResults) {
        let sizes = |of: &Self| (of.is_full, of.learn, of.judge, of.limits, of.windows_s.clone());
        if sizes(self) != sizes(&other) {
            return;
        }
        for (merit, foreign) in other.merits.into_iter().zip(other.foreign) {
            if self.merits.iter().all(|own| own.setting != merit.setting) {
                self.merits.push(merit);
                self.foreign.push(foreign);
            }
        }
        self.other_plant = self.other_plant.take().or(other.other_plant);
        let own = self.other_plant_fitted.take();
        self.other_plant_fitted = own.or(other.other_plant_fitted);
        let place = |name: &str| SETTINGS.iter().position(|setting| setting.name() == name);
        self.merits.sort_by_key(|merit| place(&merit.setting));
        self.foreign.sort_by_key(|foreign| place(&foreign.setting));
    }
}

/// The results of the diagnosers in sealed environments.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SealedResults {
    /// The opening that these results belong to.
    pub opening: Opening,
    /// All openings on record when these results were written, this one included.
    pub openings: Openings,
    /// The results; those of training flights are not repeated.
    pub results: FlightResults,
}

/// The resources of a stage: threads, and a receiver of progress.
pub struct Crew<'c> {
    /// The threads, and their cancellation.
    pub workers: Workers<'c>,
    /// Receives the task at hand, and the share of all work that is done, from 0 to 1.
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

/// The settings in which a study can fly.
pub fn settings(study: &Study) -> Vec<Setting> {
    let possible = |setting: &Setting| !setting.has_noise() || study.realism.is_some();
    SETTINGS.into_iter().filter(possible).collect()
}

/// Trains the diagnoser of a setting in flights and writes it. Also returns the counts of unusable training flights.
///
/// # Errors
/// A twin cannot be simulated; training fails; the file cannot be written.
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
    let lessons = training_windows::of_flights(flights, &flown);
    crew.check()?;
    learn_from(folder, study, flights, setting, lessons, crew)
}

/// Trains the diagnoser of a setting and writes it. `lessons` come from flights that may have been flown on other
/// machines; hard negatives are added here. Held-out healthy flights set the margin of a shutdown.
///
/// # Errors
/// Training fails; the diagnoser is unsafe in health; the file cannot be written.
pub fn learn_from(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    setting: Setting,
    mut lessons: TrainingWindows,
    crew: &Crew,
) -> Result<(Diagnoser, LeftOut), JobError> {
    let (pools, workers) = (pools(study), crew.workers);
    training_windows::add_hard_negatives(study, flights, setting, &mut lessons, &pools, workers)?;
    let left_out = lessons.left_out();
    let tables = training_windows::tables(study, flights, setting, lessons, workers)?;
    let trained = train::diagnoser(study, flights, setting, tables, &pools, workers)?;
    let boundaries = boundaries(study, &trained.sensors, trained.watched())?;
    let diagnoser = Diagnoser { boundaries, ..trained };
    let diagnoser = held_out::with_margin(study, flights, setting, diagnoser, crew.workers)?;
    model_file::write_model(folder.diagnoser(setting), &diagnoser)?;
    Ok((diagnoser, left_out))
}

/// Computes the figures of merit of a diagnoser from the outcomes of all evaluation flights.
pub fn merit(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    (diagnoser, left_out): (&Diagnoser, LeftOut),
    outcomes: &[FlightOutcome],
) -> FlightMetrics {
    let asked = (setting.name(), limit_s(flights, setting));
    let merit = judge::merit(study, asked, diagnoser, outcomes);
    let LeftOut { failed, on_the_move } = left_out;
    FlightMetrics { failed_to_learn: failed, on_the_move_to_learn: on_the_move, ..merit }
}

/// Writes the outcomes of a suite of flights.
///
/// # Errors
/// The file cannot be written.
pub fn write_outcomes(
    folder: &Folder,
    suite: &str,
    setting: &str,
    outcomes: &[FlightOutcome],
) -> Result<(), JobError> {
    let path = folder.outcomes(suite, setting);
    let rows =
        outcome::table(outcomes).with_metadata("suite", suite).with_metadata("setting", setting);
    table::write(&path, &rows).map_err(|error| JobError::Outcomes { path, error })
}

/// Trains and evaluates in the flights of some of [`settings`], and writes the results after each setting.
///
/// # Errors
/// As [`results`], before the first flight; as [`learn`].
pub fn fly_all(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    settings: &[Setting],
    is_full: bool,
    crew: &Crew,
) -> Result<FlightResults, JobError> {
    // The final write keeps earlier results. Detect an unreadable file now, not after hours of simulation.
    results(folder)?;
    for (place, &setting) in settings.iter().enumerate() {
        let part = |share: f64| (place as f64 + share) / settings.len() as f64;
        (crew.progress)(&format!("{}: flights to learn from", setting.name()), part(0.0));
        let (diagnoser, left_out) = learn(folder, study, flights, setting, crew)?;
        let part = |share: f64| part(0.4 + 0.6 * share);
        let model = (diagnoser, left_out);
        let judged = judge_in(study, flights, setting, model, crew, &part)?;
        judged.write_outcomes(folder, [JUDGE, UNSEEN], setting)?;
        write(folder, flights, is_full, vec![judged.metrics], None)?;
        if setting.has_tolerances() && flights.other_plant.is_some() {
            fly_other_plant(folder, study, flights, is_full, crew)?;
        }
    }
    results(folder)?.ok_or_else(|| JobError::Missing { path: folder.flights(), stage: "flights" })
}

/// The figures of merit in a scenario, and the outcomes that they were counted from.
struct JudgedScenario {
    metrics: (FlightMetrics, UnseenFaultMetrics),
    /// Of the faults of the study, and of those that were never trained on.
    outcomes: [Vec<FlightOutcome>; 2],
}

impl JudgedScenario {
    fn write_outcomes(
        &self,
        folder: &Folder,
        suites: [&str; 2],
        setting: Setting,
    ) -> Result<(), JobError> {
        let mut both = suites.into_iter().zip(&self.outcomes);
        both.try_for_each(|(suite, own)| write_outcomes(folder, suite, setting.name(), own))
    }
}

/// Judges a diagnoser in the evaluation flights of a setting. `part` maps the share of this work to that of all work.
fn judge_in(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    (diagnoser, left_out): (Diagnoser, LeftOut),
    crew: &Crew,
    part: &(dyn Fn(f64) -> f64 + Sync),
) -> Result<JudgedScenario, JobError> {
    let flown = FlightCampaign::new(study, flights, Purpose::Judge, setting, crew.workers)?;
    let watched = watched(&flown, &diagnoser, crew, &|share| {
        (crew.progress)(&format!("{}: flights to be judged in", setting.name()), part(0.8 * share));
    })?;
    let merit = merit(study, flights, setting, (&diagnoser, left_out), &watched);
    (crew.progress)(&format!("{}: faults never trained on", setting.name()), part(0.8));
    let (sets, diagnoser) = (set_names(), Arc::new(diagnoser));
    let said = unseen_faults::judge(study, flights, setting, &diagnoser, &sets, crew.workers);
    crew.check()?;
    let (unseen, outcomes) = said?;
    Ok(JudgedScenario { metrics: (merit, unseen), outcomes: [watched, outcomes] })
}

/// Flies planned flights, watched by a diagnoser. `told` takes the share of the flights that have ended.
fn watched(
    flown: &FlightCampaign,
    diagnoser: &Diagnoser,
    crew: &Crew,
    told: &(dyn Fn(f64) + Sync),
) -> Result<Vec<FlightOutcome>, JobError> {
    let share = |done: usize, of: usize| told(done as f64 / of.max(1) as f64);
    let watched = judge::watch(flown, diagnoser, &share);
    crew.check()?;
    watched.map_err(|error| JobError::Evaluation(error.into()))
}

/// Judges the stored diagnosers of some settings in sealed environments, and writes the results. Nothing is learned.
///
/// The opening is recorded after everything that can be checked before, and before the first flight.
///
/// # Errors
/// A diagnoser is missing or the study has no flights of these sizes, before the opening; the record or the results
/// cannot be written; a twin cannot be simulated.
pub fn fly_sealed(
    folder: &Folder,
    study: &Study,
    settings: &[Setting],
    is_full: bool,
    record: &OpeningRecord,
    crew: &Crew,
) -> Result<SealedResults, JobError> {
    let stored = settings.iter().map(|&setting| diagnoser(folder, setting));
    let diagnosers = stored.collect::<Result<Vec<_>, _>>()?;
    let hashes = settings.iter().map(|&setting| sha256(&folder.diagnoser(setting)));
    let hashes = hashes.collect::<Result<Vec<_>, _>>()?;
    let names: Vec<&str> = settings.iter().map(|setting| setting.name()).collect();
    let size = if is_full { "full" } else { "small" };
    let opening = record.open(&SealedSubject {
        study: &study.name,
        study_text: &study.text,
        diagnoser_sha256: sha256_of_text(&hashes.join(" ")),
        judged: format!("{size} sizes: {}", names.join(" and ")),
    })?;
    let draw = Redraw { seed: Some(opening.seed), ..Redraw::default() };
    let drawn = study.flights_with(is_full, draw).map_err(|error| JobError::Study(error.into()))?;
    let Some(flights) = drawn else {
        return Err(JobError::Missing { path: folder.flights(), stage: "flights" });
    };
    let mut judged = vec![];
    for (place, (&setting, diagnoser)) in settings.iter().zip(diagnosers).enumerate() {
        let part = |share: f64| (place as f64 + share) / settings.len() as f64;
        let model = (diagnoser, LeftOut::default());
        let own = judge_in(study, &flights, setting, model, crew, &part)?;
        own.write_outcomes(folder, [SEALED_JUDGE, SEALED_UNSEEN], setting)?;
        judged.push(own.metrics);
    }
    let results = FlightResults::new(&flights, is_full, judged, None);
    // Everything but the last line of the record counts as aborted, until the results are there.
    let openings = record.count()?;
    let without_result = openings.without_result.saturating_sub(1);
    let openings = Openings { without_result, ..openings };
    let sealed = SealedResults { opening, openings, results };
    model_file::write(folder.sealed_flights(), &sealed)?;
    record.close(&sealed.opening, &sealed.summary())?;
    Ok(sealed)
}

/// Reads the results in sealed environments; `None` if none were opened in this folder.
///
/// # Errors
/// The file cannot be read, or contradicts the manifest.
pub fn sealed_results(folder: &Folder) -> Result<Option<SealedResults>, JobError> {
    let path = folder.sealed_flights();
    Ok(if path.exists() { Some(model_file::read(path)?) } else { None })
}

impl SealedResults {
    /// The results in a line, for the record.
    fn summary(&self) -> String {
        let of = |merit: &FlightMetrics| {
            let since = merit.rates.of(&measure::ISOLATED_SINCE_VISIBLE);
            format!(
                "{}: {} of {} in time since visible, {} healthy shutdowns, {} wrong shutdowns",
                merit.setting,
                since.count,
                since.of,
                merit.healthy.shutdowns,
                merit.rates.of(&measure::WRONG_SHUTDOWN).count
            )
        };
        self.results.merits.iter().map(of).collect::<Vec<_>>().join("; ")
    }

    /// Which opening these results belong to, in a sentence. `known` are the openings on record now, where the record is
    /// at hand.
    pub fn in_words(&self, known: Option<Openings>) -> String {
        let Openings { opened, without_result } = known.unwrap_or(self.openings);
        let Opening { number, seed, commit } = &self.opening;
        format!(
            "Sealed opening {number} of {opened} (seed {seed}, commit {commit}; {without_result} of {opened} without a \
             result)."
        )
    }
}

/// Judges the stored diagnoser for specimens with tolerances in plants that differ from their twin in structure, and
/// writes the results beside the others. The plants teach nothing. `None` if the study has no such plants.
///
/// # Errors
/// The diagnoser is missing; a twin cannot be simulated; the file cannot be written.
pub fn fly_other_plant(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    is_full: bool,
    crew: &Crew,
) -> Result<Option<FlightMetrics>, JobError> {
    let Some((plants, flights)) = other_plants(study, flights)? else { return Ok(None) };
    let flown = campaign_of_other_plants(study, &flights, &plants, crew)?;
    let merit = judge_other_plants(folder, &flown, &flights, OTHER_PLANT, crew)?;
    write(folder, &flights, is_full, vec![], Some(merit.clone()))?;
    Ok(Some(merit))
}

/// The same beside twins that are fitted to their plants. It needs the study's calibration flight, too.
///
/// # Errors
/// The study has no calibration flight; as [`fly_other_plant`].
pub fn fly_fitted_other_plant(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    is_full: bool,
    crew: &Crew,
) -> Result<Option<FittedPlants>, JobError> {
    let Some((plants, flights)) = other_plants(study, flights)? else { return Ok(None) };
    (crew.progress)("another plant: fitting its twins", 0.0);
    let flown = campaign_of_other_plants(study, &flights, &plants, crew)?;
    let (flown, calibration) = flown.beside_fitted_twins(crew.workers)?;
    let merit = judge_other_plants(folder, &flown, &flights, OTHER_PLANT_FITTED, crew)?;
    let mut all = joined(folder, &flights, is_full, vec![], None)?;
    let judged = FittedPlants { merit, calibration };
    all.other_plant_fitted = Some(judged.clone());
    model_file::write(folder.flights(), &all)?;
    Ok(Some(judged))
}

/// The plants of `[flights.other_plant]`, and the sizes of the flights in which they are judged.
fn other_plants(
    study: &Study,
    flights: &Flights,
) -> Result<Option<(OtherPlants, Flights)>, JobError> {
    let Some(differences) = &flights.other_plant else { return Ok(None) };
    let healthy = flights.judge.healthy.min(differences.healthy.unwrap_or(usize::MAX));
    let judge = Size { healthy, ..flights.judge };
    let flights = Flights { judge, learned: vec![], ..flights.clone() };
    Ok(Some((OtherPlants::new(study, differences)?, flights)))
}

fn campaign_of_other_plants<'f>(
    study: &'f Study,
    flights: &'f Flights,
    plants: &'f OtherPlants,
    crew: &Crew<'f>,
) -> Result<FlightCampaign<'f>, JobError> {
    let (purpose, setting) = (Purpose::Judge, Setting::Realistic);
    Ok(FlightCampaign::new(study, flights, purpose, setting, crew.workers)?.with_plants(plants))
}

fn judge_other_plants(
    folder: &Folder,
    flown: &FlightCampaign,
    flights: &Flights,
    name: &str,
    crew: &Crew,
) -> Result<FlightMetrics, JobError> {
    let diagnoser = diagnoser(folder, Setting::Realistic)?;
    let watched = watched(flown, &diagnoser, crew, &|share| {
        (crew.progress)("another plant: flights to be judged in", share);
    })?;
    write_outcomes(folder, JUDGE, name, &watched)?;
    let asked = (name, limit_s(flights, Setting::Realistic));
    Ok(judge::merit(flown.study(), asked, &diagnoser, &watched))
}

/// Repeats the evaluation flights of some settings without each sensor in turn, using the stored diagnosers, and writes
/// the results.
///
/// # Errors
/// A diagnoser is missing; a twin cannot be simulated; the file cannot be written.
pub fn without_sensors(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    settings: &[Setting],
    crew: &Crew,
) -> Result<Vec<FlightMetrics>, JobError> {
    let mut merits = vec![];
    for (place, &setting) in settings.iter().enumerate() {
        let diagnoser = Arc::new(diagnoser(folder, setting)?);
        let flown = FlightCampaign::new(study, flights, Purpose::Judge, setting, crew.workers)?;
        let told = |done: usize, all: usize| {
            let share = (place as f64 + done as f64 / all.max(1) as f64) / settings.len() as f64;
            (crew.progress)(&format!("{}: flights without each sensor", setting.name()), share);
        };
        let watched = judge::watch_without_sensors(&flown, &diagnoser, &told);
        crew.check()?;
        let outcomes = watched.map_err(|error| JobError::Evaluation(error.into()))?;
        write_outcomes(folder, MISSING_SENSORS, setting.name(), &outcomes)?;
        merits.extend(diagnoser.sensors.iter().map(|sensor| {
            let own = outcomes.iter().filter(|row| row.missing == sensor.name).cloned();
            let name = format!("{} without {}", setting.name(), sensor.name);
            let asked = (name.as_str(), limit_s(flights, setting));
            judge::merit(study, asked, &diagnoser, &own.collect::<Vec<_>>())
        }));
    }
    model_file::write(folder.missing_sensors(), &merits)?;
    Ok(merits)
}

/// Flies challenge sets in some settings with the stored diagnosers, and writes the results. Nothing is learned.
///
/// # Errors
/// A diagnoser is missing; a twin cannot be simulated; the file cannot be written.
pub fn fly_challenge_sets(
    folder: &Folder,
    study: &Study,
    flights: &Flights,
    settings: &[Setting],
    sets: &[&str],
    crew: &Crew,
) -> Result<Vec<UnseenFaultMetrics>, JobError> {
    let mut metrics = vec![];
    for (place, &setting) in settings.iter().enumerate() {
        let diagnoser = Arc::new(diagnoser(folder, setting)?);
        let share = place as f64 / settings.len() as f64;
        (crew.progress)(&format!("{}: challenge sets", setting.name()), share);
        let judged = unseen_faults::judge(study, flights, setting, &diagnoser, sets, crew.workers);
        crew.check()?;
        let (counted, outcomes) = judged?;
        write_outcomes(folder, CHALLENGE, setting.name(), &outcomes)?;
        metrics.push(counted);
    }
    model_file::write(folder.challenge_sets(), &metrics)?;
    Ok(metrics)
}

/// The latency limit for shutdown faults in a setting, s.
fn limit_s(flights: &Flights, setting: Setting) -> f64 {
    match setting.has_tolerances() {
        true => flights.limits.latency_unfitted_s,
        false => flights.limits.latency_s,
    }
}

/// Writes the results of some settings. Stored results of other settings stay if they come from flights of the same
/// sizes.
///
/// # Errors
/// As [`results`]; the file cannot be written.
pub fn write(
    folder: &Folder,
    flights: &Flights,
    is_full: bool,
    measured: Vec<(FlightMetrics, UnseenFaultMetrics)>,
    other_plant: Option<FlightMetrics>,
) -> Result<FlightResults, JobError> {
    let all = joined(folder, flights, is_full, measured, other_plant)?;
    model_file::write(folder.flights(), &all)?;
    Ok(all)
}

/// New results with those stored results of other settings that come from flights of the same sizes.
fn joined(
    folder: &Folder,
    flights: &Flights,
    is_full: bool,
    measured: Vec<(FlightMetrics, UnseenFaultMetrics)>,
    other_plant: Option<FlightMetrics>,
) -> Result<FlightResults, JobError> {
    let mut all = FlightResults::new(flights, is_full, measured, other_plant);
    if let Some(before) = results(folder)? {
        all.join(before);
    }
    Ok(all)
}

/// Reads the results of the flights; `None` if no flights were flown.
///
/// # Errors
/// [`JobError::Unreadable`]; the file contradicts the manifest.
pub fn results(folder: &Folder) -> Result<Option<FlightResults>, JobError> {
    if !folder.flights().exists() {
        return Ok(None);
    }
    match model_file::read(folder.flights()) {
        Ok(results) => Ok(Some(results)),
        // The message of this error already contains the remedy.
        Err(error @ EvaluationError::File(FileError::Altered { .. })) => Err(error.into()),
        Err(error) => Err(JobError::Unreadable { error, stage: "flights" }),
    }
}

/// Reads the diagnoser of a setting.
///
/// # Errors
/// [`JobError::Missing`], or the file is no diagnoser.
pub fn diagnoser(folder: &Folder, setting: Setting) -> Result<Diagnoser, JobError> {
    let path = folder.diagnoser(setting);
    match path.exists() {
        true => Ok(model_file::read_diagnoser(path)?),
        false => Err(JobError::Missing { path, stage: "flights" }),
    }
}
