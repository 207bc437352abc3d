//! Evaluation and flights in pieces, of which each is computed by itself, be it on another machine. What
//! comes of a piece travels as JSON.

use crate::errors::Failure;
use crate::long::{Watch, long};
use crate::study::Study;
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use servotwin::campaign::CampaignError;
use servotwin::evaluation::model_file;
use servotwin::flight::outcome::FlightOutcome;
use servotwin::flight::training_windows::{self, TrainingWindows};
use servotwin::flight::windows::WindowDesign;
use servotwin::job::flights::{self, Crew};
use servotwin::job::{self, Among, Folder, JobError, Subject, manifest, outcomes};
use servotwin::run::{Runner, plan};
use servotwin::study::suites::LEARN;
use servotwin::study::{Purpose, Scenario, Study as Inner, Suite};
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::path::PathBuf;
use std::sync::Arc;

fn to_text(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("pieces are JSON")
}

fn from_text<T: DeserializeOwned>(text: &str) -> Result<T, Failure> {
    // A diagnoser is sent as its file is, with its checksum.
    model_file::parse("the piece".as_ref(), text).map_err(Failure::value)
}

fn subject(name: &str) -> Result<Subject, Failure> {
    let found = Subject::ALL.into_iter().find(|subject| subject.name() == name);
    found.ok_or_else(|| Failure::value(format!("there is no subject '{name}'")))
}

/// The subjects of a folder's evaluation.
#[pyfunction]
pub fn evaluation_subjects(py: Python<'_>, out: PathBuf) -> PyResult<Vec<&'static str>> {
    let folder = Folder::new(out);
    let list = py.detach(|| -> Result<Vec<_>, Failure> {
        let study = folder.read_study()?;
        Ok(job::subjects(&folder, &study)?.into_iter().map(Subject::name).collect())
    })?;
    Ok(list)
}

/// Evaluates a subject of a folder; its result.
#[pyfunction]
#[pyo3(signature = (out, name, threads = None))]
pub fn evaluate_subject(
    py: Python<'_>,
    out: PathBuf,
    name: &str,
    threads: Option<usize>,
) -> PyResult<String> {
    let (folder, subject) = (Folder::new(out), subject(name)?);
    let result = long(py, None, |watch| -> Result<String, Failure> {
        let study = folder.read_study()?;
        let workers = watch.workers(threads);
        Ok(to_text(&job::evaluate_subject(&folder, &study, subject, workers)?))
    })?;
    Ok(result?)
}

/// Writes the results of a folder's subjects, in their order; the whole evaluation as JSON.
#[pyfunction]
pub fn join_evaluation(py: Python<'_>, out: PathBuf, found: Vec<String>) -> PyResult<String> {
    let folder = Folder::new(out);
    let text = py.detach(|| -> Result<String, Failure> {
        let (study, _hold) = folder.open()?;
        let subjects = found.iter().map(|text| from_text(text)).collect::<Result<Vec<_>, _>>()?;
        let results = job::write_results(&folder, &study, subjects)?;
        manifest::write(&folder, &study)?;
        Ok(to_text(&results))
    })?;
    Ok(text)
}

fn scenario(study: &Inner, name: &str) -> Result<Scenario, Failure> {
    let found = flights::scenarios(study).into_iter().find(|scenario| scenario.name() == name);
    found.ok_or_else(|| Failure::value(format!("no flights are flown in scenario '{name}'")))
}

fn suite<'s>(study: &'s Inner, full: bool, name: &str) -> Result<&'s Suite, Failure> {
    study.suite(name, full).ok_or_else(|| Failure::value(format!("there is no suite '{name}'")))
}

/// Learns and judges in flights, into a folder; what was measured, as JSON.
#[pyfunction]
#[pyo3(signature = (study, out, full = false, threads = None, progress = None))]
pub fn fly_all(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    full: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (study, folder) = (&*study.inner, Folder::new(out));
    let result = long(py, progress.as_ref(), |watch| -> Result<String, Failure> {
        let _hold = folder.keep_study(study, false)?.hold;
        let told = |what: &str, share: f64| watch.tell(what, (share * 1000.0) as usize, 1000);
        let crew = Crew { workers: watch.workers(threads), progress: &told };
        let scenarios = flights::scenarios(study);
        let results = flights::fly_all(&folder, (study, full), &scenarios, &crew)?;
        manifest::write(&folder, study)?;
        Ok(to_text(&results))
    })?;
    Ok(result?)
}

/// The suites of a study's flights that are not flown on request alone, in each scenario, those to learn from first: scenario,
/// suite, and how many runs there are in each environment.
#[pyfunction]
#[pyo3(signature = (study, full = false))]
pub fn flight_pieces(study: &Study, full: bool) -> Vec<(&'static str, String, Vec<usize>)> {
    let study = &*study.inner;
    let mut pieces = vec![];
    for scenario in flights::scenarios(study) {
        let of = |suite: &Suite| suite.scenarios.contains(&scenario) && !suite.is_on_request;
        let learn = study.suite(LEARN, full).into_iter();
        let judged = study.suites(full).filter(|suite| suite.purpose == Purpose::Test);
        for suite in learn.chain(judged).filter(|suite| of(suite)) {
            // Unseen faults are flown all together.
            let mut counts = vec![1];
            if !suite.is_unseen {
                counts = vec![0; suite.environments];
                let runs = plan::runs(study, suite, &(0..suite.environments));
                runs.iter().for_each(|run| counts[run.environment] += 1);
            }
            pieces.push((scenario.name(), suite.name.clone(), counts));
        }
    }
    pieces
}

/// How the spreads of healthy residuals grow in a scenario, as JSON for [`fly_piece`] and [`learn_from_flights`].
#[pyfunction]
#[pyo3(signature = (study, full, scenario, threads = None))]
pub fn learn_spreads(
    py: Python<'_>,
    study: &Study,
    full: bool,
    scenario: &str,
    threads: Option<usize>,
) -> PyResult<String> {
    let study = &*study.inner;
    let scenario = self::scenario(study, scenario)?;
    let result = long(py, None, |watch| -> Result<String, Failure> {
        let design = flights::design((study, full), scenario, watch.workers(threads))?;
        Ok(to_text(&design.spreads))
    })?;
    Ok(result?)
}

/// The windows of a scenario with spreads from [`learn_spreads`].
fn design<'s>(
    study: &'s Inner,
    scenario: Scenario,
    spreads: &str,
) -> Result<WindowDesign<'s>, Failure> {
    let flights = study.flights.as_ref().ok_or(JobError::NoFlights)?;
    Ok(WindowDesign { study, flights, scenario, spreads: from_text(spreads)? })
}

/// Flies an environment of a suite; what came of it. `known` is the JSON of the spreads for a suite to learn from, and
/// that of the diagnoser that watches for others.
#[pyfunction]
#[pyo3(signature = (study, full, scenario, suite, environment, known, threads = None))]
#[expect(clippy::too_many_arguments, reason = "they are Python's")]
pub fn fly_piece(
    py: Python<'_>,
    study: &Study,
    full: bool,
    scenario: &str,
    suite: &str,
    environment: usize,
    known: &str,
    threads: Option<usize>,
) -> PyResult<String> {
    let study = &*study.inner;
    let (scenario, suite) = (self::scenario(study, scenario)?, self::suite(study, full, suite)?);
    let result = long(py, None, |watch| -> Result<String, Failure> {
        let workers = watch.workers(threads);
        if suite.purpose == Purpose::Train {
            let design = design(study, scenario, known)?;
            let own = environment..environment + 1;
            let runner = Runner::new(study, suite, (scenario, None), own, workers)?;
            let taken = to_text(&training_windows::of_runs(&design, &runner));
            check(watch)?;
            return Ok(taken);
        }
        let diagnoser: Diagnoser = from_text(known)?;
        let place = (study, suite, scenario);
        Ok(to_text(&outcomes::fly_environment(place, environment, &Arc::new(diagnoser), workers)?))
    })?;
    Ok(result?)
}

/// Learns from what was flown in all environments and writes the diagnoser of a scenario.
#[pyfunction]
#[pyo3(signature = (study, out, full, scenario, spreads, flown, threads = None))]
#[expect(clippy::too_many_arguments, reason = "they are Python's")]
pub fn learn_from_flights(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    full: bool,
    scenario: &str,
    spreads: &str,
    flown: Vec<String>,
    threads: Option<usize>,
) -> PyResult<()> {
    let (study, folder) = (&*study.inner, Folder::new(out));
    let scenario = self::scenario(study, scenario)?;
    let result = long(py, None, |watch| -> Result<(), Failure> {
        let _hold = folder.hold(Among::Nobody)?;
        let design = design(study, scenario, spreads)?;
        let mut taken = TrainingWindows::default();
        for text in &flown {
            taken.add(from_text(text)?);
        }
        let crew = Crew { workers: watch.workers(threads), progress: &|_, _| () };
        flights::learn_from(&folder, &design, full, taken, &crew)?;
        Ok(())
    })?;
    Ok(result?)
}

/// What was watched in each environment of a suite in a scenario.
type Watched = (String, String, Vec<String>);

/// Writes what was watched in all flights, and counts it; the results as JSON.
#[pyfunction]
pub fn join_flights(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    full: bool,
    found: Vec<Watched>,
) -> PyResult<String> {
    let (study, folder) = (&*study.inner, Folder::new(out));
    let text = py.detach(|| -> Result<String, Failure> {
        let _hold = folder.hold(Among::Nobody)?;
        for (scenario, suite, texts) in &found {
            let (scenario, suite) =
                (self::scenario(study, scenario)?, self::suite(study, full, suite)?);
            let mut judged: Vec<FlightOutcome> = vec![];
            for text in texts {
                judged.extend(from_text::<Vec<FlightOutcome>>(text)?);
            }
            outcomes::write(&folder, (study, full), suite, scenario, judged)?;
        }
        let results = flights::count(&folder, study, full)?;
        manifest::write(&folder, study)?;
        Ok(to_text(&results))
    })?;
    Ok(text)
}

fn check(watch: &Watch) -> Result<(), Failure> {
    match watch.workers(None).is_cancelled() {
        true => Err(CampaignError::Cancelled.into()),
        false => Ok(()),
    }
}
