//! The flight stage: trains a diagnoser for each scenario, and flies suites with it.

use super::outcomes::{self, Basis, FlownSuite};
use super::sealed::{Opening, OpeningRecord, Openings, SealedSubject};
use super::{Crew, Folder, Job, JobError, held_out, pools};
use crate::files::create_folder;
use crate::flight::unseen_faults::UnseenFaultMetrics;
use crate::learn::boundaries::boundaries;
use crate::learn::model_file;
use crate::learn::training_windows::{self, LeftOut, TrainingFlights, TrainingWindows};
use crate::learn::windows::WindowDesign;
use crate::learn::{spreads, train};
use crate::manifest::sha256_of_text;
use crate::measure;
use crate::measure::flights::{FlightGroup, FlightMetrics};
use crate::measure::outcome::RunOutcome;
use crate::run::compute::compute;
use crate::study::suites::{
    HARD_NEGATIVES, HEALTHY, HEALTHY_OTHER_STRUCTURE, JUDGE, LEARN, OTHER_STRUCTURE,
    OTHER_STRUCTURE_FITTED, UNSEEN,
};
use crate::study::{Flights, Purpose, Scenario, Study, Suite};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::collections::BTreeMap;
use std::path::Path;

/// The scenarios with flights. In the first, each specimen equals its twin, as after a perfect fit; in the second,
/// specimens differ from it.
pub const SCENARIOS: [Scenario; 2] = [Scenario::Noise, Scenario::Realistic];

/// The name of a suite begins with this where it was flown in a sealed opening.
const SEALED: &str = "sealed_";

/// The results of the flights, counted from the outcomes in a folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightResults {
    /// Training flights that were not used, by scenario; [`Folder::left_out`] is their file.
    #[serde(skip)]
    pub left_out: BTreeMap<String, LeftOut>,
    /// The flown suites, by scenario, suite and missing sensor. Suites of healthy flights and those in closed loop
    /// are left out: their figures come from the outcomes themselves.
    pub suites: Vec<FlightMetrics>,
    /// The flown suites of unseen faults.
    pub unseen: Vec<UnseenFaultMetrics>,
}

impl FlightResults {
    /// Figures of merit of a suite, by scenario and missing sensor.
    pub fn of_suite(&self, suite: &str) -> impl Iterator<Item = &FlightMetrics> {
        self.suites.iter().filter(move |metrics| metrics.group.suite == suite)
    }

    /// Figures of merit of [`JUDGE`], by scenario.
    pub fn judged(&self) -> impl Iterator<Item = &FlightMetrics> {
        self.of_suite(JUDGE)
    }

    /// Figures of merit in plants that differ from their twin in structure: beside nominal twins, then beside fitted ones.
    pub fn of_other_plants(&self) -> impl Iterator<Item = &FlightMetrics> {
        self.of_suite(OTHER_STRUCTURE).chain(self.of_suite(OTHER_STRUCTURE_FITTED))
    }

    /// The unseen faults of the suite [`UNSEEN`] in a scenario.
    pub fn unseen_in(&self, scenario: &str) -> Option<&UnseenFaultMetrics> {
        self.unseen.iter().find(|metrics| metrics.suite == UNSEEN && metrics.scenario == scenario)
    }

    /// Counts the outcomes that a folder holds of a study's suites. `prefix` stands before the names of the suites.
    fn count(folder: &Folder, study: &Study, prefix: &str) -> Result<Self, JobError> {
        let flights = flights(study)?;
        let mut all = FlightResults { left_out: BTreeMap::new(), suites: vec![], unseen: vec![] };
        let mut learned = scenarios(study);
        learned.retain(|&scenario| folder.diagnoser(scenario).exists());
        for scenario in learned {
            let basis = Basis::of(folder, study, scenario)?;
            let model = diagnoser(folder, scenario)?;
            let judged = study.suites().filter(|suite| suite.purpose == Purpose::Test);
            for (suite, scenario) in in_scenarios(judged, &[scenario]) {
                let name = format!("{prefix}{}", suite.name);
                let stored = outcomes::stored(folder, &name, scenario)?;
                if let Some(stored) = stored.filter(|stored| stored.basis == basis) {
                    all.take((study, limit_s(flights, scenario)), suite, &model, stored);
                }
            }
        }
        Ok(all)
    }

    /// The same results, with the training flights that the folder names as left out.
    fn with_left_out(mut self, folder: &Folder) -> Result<Self, JobError> {
        for scenario in Scenario::ALL {
            let path = folder.left_out(scenario);
            if path.exists() {
                self.left_out.insert(scenario.name().into(), model_file::read(path)?);
            }
        }
        Ok(self)
    }

    fn take(
        &mut self,
        (study, limit_s): (&Study, f64),
        suite: &Suite,
        model: &Diagnoser,
        FlownSuite { scenario, calibration, outcomes, .. }: FlownSuite,
    ) {
        let name = &suite.name;
        let mut counted = |missing: &str, rows: &[RunOutcome]| {
            let (suite, missing) = (name.clone(), missing.to_owned());
            let group = FlightGroup { suite, scenario: scenario.clone(), missing };
            let metrics = FlightMetrics::of(study, group, limit_s, rows);
            self.suites.push(FlightMetrics { calibration, ..metrics });
        };
        if suite.is_unseen {
            self.unseen.push(UnseenFaultMetrics::of(name, &scenario, &outcomes));
        } else if suite.misses_sensors {
            for sensor in &model.sensors {
                let is_own = |row: &&RunOutcome| row.missing == sensor.name;
                let rows: Vec<_> = outcomes.iter().filter(is_own).cloned().collect();
                counted(&sensor.name, &rows);
            }
        } else if !suite.is_closed_loop
            && ![HEALTHY, HEALTHY_OTHER_STRUCTURE].contains(&name.as_str())
        {
            counted("", &outcomes);
        }
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

/// The scenarios in which a study can fly; the twins of tests on the ground are fitted.
pub fn scenarios(study: &Study) -> Vec<Scenario> {
    let possible = |scenario: &Scenario| !scenario.has_noise() || study.realism.is_some();
    let all = if study.is_on_ground() { &[Scenario::Fitted][..] } else { &SCENARIOS };
    all.iter().copied().filter(possible).collect()
}

/// Suites with each of the scenarios in which they are flown, scenario by scenario.
pub(super) fn in_scenarios<'s>(
    suites: impl Iterator<Item = &'s Suite>,
    scenarios: &[Scenario],
) -> Vec<(&'s Suite, Scenario)> {
    let suites: Vec<&Suite> = suites.collect();
    let of_scenario = |&scenario: &Scenario| {
        let own = suites.iter().filter(move |suite| suite.scenarios.contains(&scenario));
        own.map(move |suite| (*suite, scenario))
    };
    scenarios.iter().flat_map(of_scenario).collect()
}

pub(super) fn flights(study: &Study) -> Result<&Flights, JobError> {
    study.flights.as_ref().ok_or(JobError::NoFlights)
}

impl Job<'_> {
    /// Trains the diagnoser of a scenario in flights and writes it. Held-out healthy flights set the margin of a shutdown.
    ///
    /// # Errors
    /// A twin cannot be simulated; training fails; the diagnoser is unsafe in health; the file cannot be written.
    pub fn learn(&self, scenario: Scenario) -> Result<Diagnoser, JobError> {
        let Job { study, folder, crew: Crew { workers, .. }, .. } = *self;
        let (pools, design) = (pools(study), self.design(scenario)?);
        let mut taken = TrainingWindows::default();
        let taught = |taken: &mut TrainingWindows, name: &str, bands, [from, to]: [f64; 2]| {
            let Some(suite) = study.suite(name) else { return Ok(()) };
            let flights = TrainingFlights::new(folder.path(), &design, suite, bands, workers);
            let told = |done: usize, all: usize| {
                let share = from + (to - from) * done as f64 / all.max(1) as f64;
                self.tell("flights to learn from", share);
            };
            compute(&flights, &flights.files.all(), workers, &told)?;
            flights.add_to(taken)
        };
        taught(&mut taken, LEARN, vec![], [0.0, 0.5])?;
        if let Some(bands) = taken.bands(&design, &pools) {
            taught(&mut taken, HARD_NEGATIVES, bands, [0.5, 0.7])?;
        }
        self.tell("training", 0.7);
        let learned = training_windows::data_sets(&design, &taken, workers)?;
        let environment = train::environment(study)?;
        let trained = train::diagnoser(&design, learned, &pools, workers)?;
        let boundaries = boundaries(study, &trained.sensors, trained.watched())?;
        let diagnoser = Diagnoser { boundaries, environment, ..trained };
        let diagnoser = held_out::with_margin(study, scenario, diagnoser, workers)?;
        model_file::write(folder.left_out(scenario), taken.left_out())?;
        model_file::write_model(folder.diagnoser(scenario), &diagnoser)?;
        Ok(diagnoser)
    }

    /// Flies some parts of a suite to learn from, which [`Job::learn`] reads.
    ///
    /// # Errors
    /// As [`Job::learn`]; [`RunError::Unfinished`] for [`HARD_NEGATIVES`] before all flights of [`LEARN`].
    pub(super) fn fly_to_learn(
        &self,
        (suite, scenario): (&Suite, Scenario),
        parts: &[usize],
    ) -> Result<(), JobError> {
        let design = self.design(scenario)?;
        let mut bands = vec![];
        if suite.name == HARD_NEGATIVES {
            match self.learned_bands(&design)? {
                Some(learned) => bands = learned,
                None => return Ok(()),
            }
        }
        let what = format!("{}: suite {}", scenario.name(), suite.name);
        let workers = self.crew.workers;
        let flights = TrainingFlights::new(self.folder.path(), &design, suite, bands, workers);
        let told = |done, all: usize| self.tell(&what, done as f64 / all.max(1) as f64);
        compute(&flights, parts, workers, &told)?;
        Ok(())
    }

    /// The bands of all flights of [`LEARN`], kept in a file for the parts of [`HARD_NEGATIVES`]; `None` for too few windows.
    pub(super) fn learned_bands(
        &self,
        design: &WindowDesign,
    ) -> Result<Option<Vec<Vec<f64>>>, JobError> {
        let Job { study, folder, crew: Crew { workers, .. }, .. } = *self;
        let Some(suite) = study.suite(LEARN) else { return Ok(None) };
        known(&folder.bands(design.scenario), study, || {
            let mut taken = TrainingWindows::default();
            TrainingFlights::new(folder.path(), design, suite, vec![], workers)
                .add_to(&mut taken)?;
            Ok(taken.bands(design, &pools(study)))
        })
    }

    /// The windows of a scenario's diagnosis, with the spreads of healthy flights.
    ///
    /// # Errors
    /// The study has no flights, or a twin cannot be simulated.
    pub(super) fn design(&self, scenario: Scenario) -> Result<WindowDesign<'_>, JobError> {
        let Job { study, folder, crew, .. } = *self;
        let flights = flights(study)?;
        let spreads = known(&folder.spreads(scenario), study, || {
            Ok(spreads::learn(study, scenario, &pools(study), crew.workers)?)
        })?;
        Ok(WindowDesign { study, flights, scenario, spreads })
    }

    /// Trains in some of [`scenarios`], flies every suite that is not flown on request alone, and writes the results after
    /// each scenario.
    ///
    /// # Errors
    /// As `Job::learn` and `Job::fly_suites`.
    pub fn fly_all(&self, scenarios: &[Scenario]) -> Result<FlightResults, JobError> {
        let suites: Vec<&Suite> = self.study.usual_suites().collect();
        let mut counted = None;
        for (place, &scenario) in scenarios.iter().enumerate() {
            let part = |share: f64| (place as f64 + share) / scenarios.len() as f64;
            let learning = |what: &str, share: f64| {
                self.tell(&format!("{}: {what}", scenario.name()), part(0.4 * share));
            };
            self.told(&learning).learn(scenario)?;
            let flying = |what: &str, share: f64| self.tell(what, part(0.4 + 0.6 * share));
            counted = Some(self.told(&flying).fly_suites(&suites, &[scenario])?);
        }
        counted.map_or_else(|| self.count(), Ok)
    }

    /// Flies suites in those of the scenarios that they have, with the stored diagnosers, and writes the results.
    ///
    /// # Errors
    /// As [`Job::fly`]; the results cannot be written.
    pub(crate) fn fly_suites(
        &self,
        suites: &[&Suite],
        scenarios: &[Scenario],
    ) -> Result<FlightResults, JobError> {
        let flown = in_scenarios(suites.iter().copied(), scenarios);
        for (place, &(suite, scenario)) in flown.iter().enumerate() {
            let part = |share: f64| (place as f64 + share) / flown.len() as f64;
            self.told(&|what, share| self.tell(what, part(share))).fly(suite, scenario)?;
        }
        self.count()
    }

    /// Counts the outcomes in the folder and writes the results.
    ///
    /// # Errors
    /// A file cannot be read or written.
    fn count(&self) -> Result<FlightResults, JobError> {
        let counted = FlightResults::count(self.folder, self.study, "")?;
        model_file::write(self.folder.flights(), &counted)?;
        counted.with_left_out(self.folder)
    }

    /// Judges the stored diagnosers of some scenarios in sealed environments, and writes the results. Nothing is learned.
    ///
    /// The opening is recorded after everything that can be checked before, and before the first flight.
    ///
    /// # Errors
    /// A diagnoser is missing or the study has no flights, before the opening; the record or the results cannot be written;
    /// a twin cannot be simulated.
    pub fn fly_sealed(
        &self,
        scenarios: &[Scenario],
        record: &OpeningRecord,
    ) -> Result<SealedResults, JobError> {
        let Job { study, folder, .. } = *self;
        flights(study)?;
        scenarios.iter().try_for_each(|&scenario| diagnoser(folder, scenario).map(drop))?;
        let hash = |&scenario: &Scenario| Ok(Basis::of(folder, study, scenario)?.diagnoser_sha256);
        let hashes = scenarios.iter().map(hash).collect::<Result<Vec<_>, JobError>>()?;
        let names: Vec<&str> = scenarios.iter().map(|scenario| scenario.name()).collect();
        let opening = record.open(&SealedSubject {
            study: &study.name,
            study_text: &study.text,
            diagnoser_sha256: sha256_of_text(&hashes.join(" ")),
            judged: names.join(" and "),
        })?;
        for suite in [JUDGE, UNSEEN].into_iter().filter_map(|name| study.suite(name)) {
            let name = format!("{SEALED}{}", suite.name);
            let mut suite = suite.clone().with_seed(opening.seed);
            suite.name = name;
            for &scenario in scenarios {
                self.fly(&suite, scenario)?;
            }
        }
        let results = FlightResults::count(folder, study, SEALED)?;
        // Everything but the last line of the record counts as aborted, until the results are there.
        let openings = record.count()?;
        let without_result = openings.without_result.saturating_sub(1);
        let openings = Openings { without_result, ..openings };
        let sealed = SealedResults { opening, openings, results };
        model_file::write(folder.sealed_flights(), &sealed)?;
        record.close(&sealed.opening, &sealed.summary())?;
        Ok(sealed)
    }
}

/// What all parts of the flights to learn from need, with the hash of the study that it comes from.
#[derive(Serialize, Deserialize)]
struct Known<T> {
    of: String,
    value: T,
}

/// Reads what a file knows of a study, or finds it and writes it there.
fn known<T: Serialize + DeserializeOwned>(
    path: &Path,
    study: &Study,
    find: impl FnOnce() -> Result<T, JobError>,
) -> Result<T, JobError> {
    let of = sha256_of_text(&format!("{}\n{}", study.text, study.system.text));
    let stored = if path.exists() { model_file::read::<Known<T>>(path).ok() } else { None };
    if let Some(stored) = stored.filter(|stored| stored.of == of) {
        return Ok(stored.value);
    }
    let found = Known { of, value: find()? };
    create_folder(path.parent().unwrap_or(Path::new("")))?;
    model_file::write(path, &found)?;
    Ok(found.value)
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
        let of = |metrics: &FlightMetrics| {
            let since = metrics.rates.of(&measure::ISOLATED_SINCE_VISIBLE);
            format!(
                "{}: {} of {} in time since visible, {} healthy shutdowns, {} wrong shutdowns",
                metrics.title(),
                since.count,
                since.of,
                metrics.healthy.shutdowns,
                metrics.rates.of(&measure::WRONG_SHUTDOWN).count
            )
        };
        self.results.judged().map(of).collect::<Vec<_>>().join("; ")
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

/// The latency limit for shutdown faults in a scenario, s.
fn limit_s(flights: &Flights, scenario: Scenario) -> f64 {
    match scenario.has_tolerances() {
        true => flights.limits.latency_unfitted_s,
        false => flights.limits.latency_s,
    }
}

/// Reads the results of the flights; `None` if no flights were flown.
///
/// # Errors
/// The file cannot be read, or contradicts the manifest.
pub fn results(folder: &Folder) -> Result<Option<FlightResults>, JobError> {
    let path = folder.flights();
    match path.exists() {
        true => model_file::read::<FlightResults>(path)?.with_left_out(folder).map(Some),
        false => Ok(None),
    }
}

/// Reads the diagnoser of a scenario.
///
/// # Errors
/// [`JobError::Missing`], or the file is no diagnoser.
pub fn diagnoser(folder: &Folder, scenario: Scenario) -> Result<Diagnoser, JobError> {
    let path = folder.diagnoser(scenario);
    match path.exists() {
        true => Ok(model_file::read_diagnoser(path)?),
        false => Err(JobError::Missing { path, command: "study --suite flights" }),
    }
}
