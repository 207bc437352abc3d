//! The main job, stage by stage: campaign, training, evaluation, report.
//!
//! Every stage reads what the former has left in the output folder ([`folder`]), so that a user can
//! change one thing and repeat the rest. What is diagnosed is a [`Subject`]: a data set, with or
//! without the sensor that the system could have.

mod error;
pub mod explain;
pub mod folder;
pub mod manifest;
pub mod report;
pub mod results;
mod subject;

pub use error::JobError;
pub use folder::Folder;
pub use results::Results;
pub use subject::Subject;

use crate::evaluation::parallel::Workers;
use crate::evaluation::{self, DataSet, FeatureInfo, model_file};
use crate::study::Study;
use crate::table;
use results::SubjectResult;
use servotwin_diagnosis::hierarchy::Hierarchy;

/// The subjects whose data sets lie in a folder.
///
/// # Errors
/// [`JobError::NoDataSet`] if there is none.
pub fn subjects(folder: &Folder, study: &Study) -> Result<Vec<Subject>, JobError> {
    let there = |subject: &Subject| {
        let possible = !subject.extra_sensor() || study.extra_sensor.is_some();
        possible && folder.data_set(subject.setting()).exists()
    };
    let subjects: Vec<Subject> = Subject::ALL.into_iter().filter(there).collect();
    match subjects.is_empty() {
        true => Err(JobError::NoDataSet { folder: folder.path().into() }),
        false => Ok(subjects),
    }
}

/// Reads the data set of a subject.
///
/// # Errors
/// The file cannot be read, or is not as the study says.
pub fn data_set(folder: &Folder, study: &Study, subject: Subject) -> Result<DataSet, JobError> {
    let path = folder.data_set(subject.setting());
    let wrong = |error| JobError::DataSet { path: path.clone(), error };
    let table = table::read(&path).map_err(|error| wrong(error.into()))?;
    let features = FeatureInfo::of_study(study, subject.extra_sensor());
    DataSet::new(&table, features, &study.units).map_err(wrong)
}

/// Trains the hierarchy of a subject with all its detectable faults and writes it.
///
/// # Errors
/// A file cannot be read or written; what training says.
pub fn train(folder: &Folder, study: &Study, subject: Subject) -> Result<Hierarchy, JobError> {
    let data = data_set(folder, study, subject)?;
    let hierarchy = evaluation::train(&data, &subject.settings(&data).training)?;
    model_file::write(folder.hierarchy(subject), &hierarchy)?;
    Ok(hierarchy)
}

/// Evaluates every subject in a folder with the hierarchies that were trained for them, and writes
/// the results. `progress` is told what is being done, and how much of all is done, from 0 to 1.
///
/// # Errors
/// A file is missing or cannot be read or written; what evaluation says.
pub fn evaluate_all(
    folder: &Folder,
    study: &Study,
    workers: Workers,
    progress: &dyn Fn(&str, f64),
) -> Result<Results, JobError> {
    let mut list = vec![];
    let subjects = subjects(folder, study)?;
    for (place, &subject) in subjects.iter().enumerate() {
        let data = data_set(folder, study, subject)?;
        let hierarchy = hierarchy(folder, subject)?;
        let settings = subject.settings(&data);
        let told = |what: &str, share: f64| {
            let done = (place as f64 + share) / subjects.len() as f64;
            progress(&format!("{}: {what}", subject.name()), done);
        };
        let evaluation = evaluation::evaluate(&data, &hierarchy, &settings, workers, &told)?;
        list.push(SubjectResult::new(subject, study, settings, evaluation));
    }
    let results = Results::new(study, list);
    model_file::write(folder.results(), &results)?;
    Ok(results)
}

/// Reads the hierarchy that was trained for a subject.
///
/// # Errors
/// [`JobError::Missing`], or it is not a hierarchy.
pub fn hierarchy(folder: &Folder, subject: Subject) -> Result<Hierarchy, JobError> {
    let path = folder.hierarchy(subject);
    match path.exists() {
        true => Ok(model_file::read_hierarchy(path)?),
        false => Err(JobError::Missing { path, stage: "train" }),
    }
}
