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
use servotwin::flight::campaign::FlightCampaign;
use servotwin::flight::judge;
use servotwin::flight::outcome::FlightOutcome;
use servotwin::flight::plan;
use servotwin::flight::plan::Purpose;
use servotwin::flight::training_windows::{self, TrainingWindows};
use servotwin::flight::unseen_faults::{self, UnseenFaultMetrics};
use servotwin::job::flights::{self, Crew};
use servotwin::job::{self, Among, Folder, Subject, manifest};
use servotwin::study::{Flights, Setting, Study as Inner};
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

fn sizes(study: &Inner, full: bool) -> Result<Flights, Failure> {
    let flights = if full { study.full_flights()? } else { study.flights()? };
    flights.ok_or_else(|| Failure::value("the study has no [flights], or no full sizes of them"))
}

fn setting(study: &Inner, name: &str) -> Result<Setting, Failure> {
    let found = flights::settings(study).into_iter().find(|setting| setting.name() == name);
    found.ok_or_else(|| Failure::value(format!("no flights are flown in setting '{name}'")))
}

fn purpose(learn: bool) -> Purpose {
    if learn { Purpose::Learn } else { Purpose::Judge }
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
        let flights = sizes(study, full)?;
        let _hold = folder.keep_study(study, false)?.hold;
        let told = |what: &str, share: f64| watch.tell(what, (share * 1000.0) as usize, 1000);
        let crew = Crew { workers: watch.workers(threads), progress: &told };
        let results =
            flights::fly_all(&folder, study, &flights, &flights::settings(study), full, &crew)?;
        manifest::write(&folder, study)?;
        Ok(to_text(&results))
    })?;
    Ok(result?)
}

/// The settings of a study's flights, and how many flights there are in each environment to learn from and
/// in each to be judged in.
#[pyfunction]
#[pyo3(signature = (study, full = false))]
pub fn flight_pieces(
    py: Python<'_>,
    study: &Study,
    full: bool,
) -> PyResult<(Vec<&'static str>, Vec<usize>, Vec<usize>)> {
    let study = &*study.inner;
    let pieces = py.detach(|| -> Result<_, Failure> {
        let sizes = sizes(study, full)?;
        let of = |purpose: Purpose| {
            let mut counts = vec![0; purpose.environments(&sizes).len()];
            let plan = plan::flights(study, &sizes, purpose);
            plan.iter().for_each(|flight| counts[flight.environment] += 1);
            // The further flights to learn from are flown where everything is learned from: they need the bands.
            if purpose == Purpose::Learn {
                counts.truncate(sizes.learn.environments);
            }
            counts
        };
        let names = flights::settings(study).into_iter().map(Setting::name).collect();
        Ok((names, of(Purpose::Learn), of(Purpose::Judge)))
    })?;
    Ok(pieces)
}

/// Flies the flights of an environment, to learn from or watched by a diagnoser (its JSON); what came of it.
#[pyfunction]
#[pyo3(signature = (study, full, setting, environment, diagnoser = None, threads = None))]
pub fn fly_piece(
    py: Python<'_>,
    study: &Study,
    full: bool,
    setting: &str,
    environment: usize,
    diagnoser: Option<&str>,
    threads: Option<usize>,
) -> PyResult<String> {
    let study = &*study.inner;
    let setting = self::setting(study, setting)?;
    let diagnoser: Option<Diagnoser> = diagnoser.map(from_text).transpose()?;
    let result = long(py, None, |watch| -> Result<String, Failure> {
        let (flights, workers) = (sizes(study, full)?, watch.workers(threads));
        let purpose = purpose(diagnoser.is_none());
        let own = |flown: usize| flown == environment;
        let flown = FlightCampaign::where_it_is(study, &flights, purpose, setting, own, workers)?;
        let text = match diagnoser {
            None => to_text(&training_windows::of_flights(&flights, &flown)),
            Some(diagnoser) => {
                let watched = judge::watch(&flown, &diagnoser, &|_, _| ());
                to_text(&watched.map_err(Failure::value)?)
            }
        };
        check(watch)?;
        Ok(text)
    })?;
    Ok(result?)
}

/// Flies faults that were never trained on, watched by a diagnoser; what was said of them.
#[pyfunction]
#[pyo3(signature = (study, full, setting, diagnoser, threads = None))]
pub fn fly_foreign(
    py: Python<'_>,
    study: &Study,
    full: bool,
    setting: &str,
    diagnoser: &str,
    threads: Option<usize>,
) -> PyResult<String> {
    let study = &*study.inner;
    let setting = self::setting(study, setting)?;
    let diagnoser: Arc<Diagnoser> = Arc::new(from_text(diagnoser)?);
    let result = long(py, None, |watch| -> Result<String, Failure> {
        let (flights, workers) = (sizes(study, full)?, watch.workers(threads));
        diagnoser.check().map_err(Failure::value)?;
        let sets = unseen_faults::set_names();
        let said = unseen_faults::judge(study, &flights, setting, &diagnoser, &sets, workers)?;
        check(watch)?;
        Ok(to_text(&said))
    })?;
    Ok(result?)
}

/// Learns from what was flown in all environments and writes the diagnoser of a setting; which flights taught
/// nothing.
#[pyfunction]
#[pyo3(signature = (study, out, full, setting, flown, threads = None))]
pub fn learn_from_flights(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    full: bool,
    setting: &str,
    flown: Vec<String>,
    threads: Option<usize>,
) -> PyResult<String> {
    let (study, folder) = (&*study.inner, Folder::new(out));
    let setting = self::setting(study, setting)?;
    let result = long(py, None, |watch| -> Result<String, Failure> {
        let flights = sizes(study, full)?;
        let _hold = folder.hold(Among::Nobody)?;
        let mut lessons = TrainingWindows::default();
        for text in &flown {
            lessons.add(from_text(text)?);
        }
        let crew = Crew { workers: watch.workers(threads), progress: &|_, _| () };
        let learned = flights::learn_from(&folder, study, &flights, setting, lessons, &crew)?;
        Ok(to_text(&learned.1))
    })?;
    Ok(result?)
}

/// What was found in a setting: its name, which flights to learn from taught nothing, what was watched in each
/// environment, and what was said of foreign faults.
type Measured = (String, String, Vec<String>, String);

/// Judges what was watched in all flights, and writes what was measured; the same as JSON.
#[pyfunction]
#[pyo3(signature = (study, out, full, found, threads = None))]
pub fn join_flights(
    py: Python<'_>,
    study: &Study,
    out: PathBuf,
    full: bool,
    found: Vec<Measured>,
    threads: Option<usize>,
) -> PyResult<String> {
    let (study, folder) = (&*study.inner, Folder::new(out));
    let result = long(py, None, |watch| -> Result<String, Failure> {
        let flights = sizes(study, full)?;
        let _hold = folder.hold(Among::Nobody)?;
        let mut measured = vec![];
        for (name, left_out, texts, said) in &found {
            let setting = setting(study, name)?;
            let diagnoser = model_file::read_diagnoser(folder.diagnoser(setting))?;
            let mut judged: Vec<FlightOutcome> = vec![];
            for text in texts {
                judged.extend(from_text::<Vec<FlightOutcome>>(text)?);
            }
            judged.sort_by_key(|outcome| outcome.number);
            let (counted, unseen): (UnseenFaultMetrics, Vec<FlightOutcome>) = from_text(said)?;
            flights::write_outcomes(&folder, flights::JUDGE, name, &judged)?;
            flights::write_outcomes(&folder, flights::UNSEEN, name, &unseen)?;
            let learned = (&diagnoser, from_text(left_out)?);
            let merit = flights::merit(study, &flights, setting, learned, &judged);
            measured.push((merit, counted));
        }
        let mut results = flights::write(&folder, &flights, full, measured, None)?;
        // Plants of another structure are flown here, beside the diagnosers that were just written.
        let crew = Crew { workers: watch.workers(threads), progress: &|_, _| () };
        if flights::fly_other_plant(&folder, study, &flights, full, &crew)?.is_some() {
            results = flights::results(&folder)?.unwrap_or(results);
        }
        manifest::write(&folder, study)?;
        Ok(to_text(&results))
    })?;
    Ok(result?)
}

fn check(watch: &Watch) -> Result<(), Failure> {
    match watch.workers(None).is_cancelled() {
        true => Err(CampaignError::Cancelled.into()),
        false => Ok(()),
    }
}
