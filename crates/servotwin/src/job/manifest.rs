//! `manifest.json`, the origin of results: versions, seeds, and hashes of inputs and outputs. It contains no time of
//! day, so the same study gives the same bytes.

use super::{Folder, JobError};
use crate::files::FileError;
use crate::learn::EvaluationError;
use crate::manifest;
use crate::study::{Purpose, Scenario, Study};
use crate::table::parquet::ParquetReader;
use crate::table::{Table, TableError};
use serde::{Deserialize, Serialize};
use servotwin_model::solver::{self, Control};
use std::path::{Path, PathBuf};

pub use crate::manifest::FORMAT;
pub(crate) use crate::manifest::FileHash;

/// The origin of the results in a folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: String,
    /// The version of the program that wrote the results.
    pub version: String,
    /// The name of the study.
    pub study: String,
    /// Hashes of the texts of the study and its system.
    pub inputs: Vec<FileHash>,
    /// The seed of everything that is drawn.
    pub seed: u64,
    /// A description of the solver's settings.
    pub solver: String,
    /// [`Network::identity`](servotwin_model::network::Network::identity) of the equations, which compiled steps carry.
    pub equations: String,
    /// The data sets in the folder.
    pub data_sets: Vec<DataSetEntry>,
    /// Hashes of all result files.
    pub outputs: Vec<FileHash>,
}

/// The contents of a data set, as counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataSetEntry {
    /// The name of the scenario.
    pub scenario: String,
    /// Whether the data set is for training; otherwise it is for evaluation.
    pub is_training: bool,
    /// Number of variants.
    pub variants: usize,
    /// Variants without a fault.
    pub healthy: usize,
    /// Faulty variants that never leave the band of healthy residuals.
    pub undetectable: usize,
    /// Variants that were not simulated to the end.
    pub failed: Vec<FailedVariant>,
}

/// A variant whose simulation stopped early.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FailedVariant {
    /// The number of the variant.
    pub variant: u32,
    /// The name of its fault.
    pub fault: String,
    /// The intensity of the fault.
    pub intensity: f64,
    /// The name of the operating case.
    pub case: String,
    /// Why the simulation stopped.
    pub reason: String,
}

impl Manifest {
    /// Reads the manifest of a folder; `None` if the folder has no servotwin manifest.
    ///
    /// # Errors
    /// It cannot be read, or is damaged.
    pub fn read(folder: &Path) -> Result<Option<Self>, FileError> {
        manifest::read(folder)
    }

    /// The stored hash of a file, if known.
    pub(crate) fn hash_of(&self, file: &str) -> Option<&FileHash> {
        manifest::hash_of([&self.inputs, &self.outputs], file)
    }
}

/// Makes the manifest of the folder's current files and of newly drawn figures. Known hashes are kept: a stage vouches
/// only for files written since ([`manifest::forget`]), not for files damaged before it began.
fn made(folder: &Folder, study: &Study, figures: &[PathBuf]) -> Result<Manifest, JobError> {
    let known = Manifest::read(folder.path())?;
    let mut results = folder.results_there()?;
    results.extend(
        figures.iter().filter(|&figure| !results.contains(figure)).cloned().collect::<Vec<_>>(),
    );
    let both = |scenario| Purpose::OF_RECORDS.map(|purpose| (scenario, purpose));
    let data_sets = Scenario::ALL.into_iter().flat_map(both);
    let data_sets =
        data_sets.filter(|&(scenario, purpose)| folder.data_set(scenario, purpose).exists());
    Ok(Manifest {
        format: FORMAT.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        study: study.name.clone(),
        inputs: hashes(folder, known.as_ref(), &[folder.study(), folder.system()])?,
        seed: study.seed,
        solver: in_words(&solver::SolverSettings::of_runs()),
        equations: format!("{:016x}", study.system.program.identity()),
        data_sets: data_sets
            .map(|(s, purpose)| data_set(folder, known.as_ref(), s, purpose))
            .collect::<Result<_, _>>()?,
        outputs: hashes(folder, known.as_ref(), &results)?,
    })
}

/// Describes the solver's settings.
fn in_words(settings: &solver::SolverSettings) -> String {
    let steps = match settings.control {
        Control::Fixed { step_s } => format!("steps of {step_s} s"),
        Control::Adaptive { tolerance, max_step_s, attempt_rate_limit_per_s } => format!(
            "steps by error: at most {tolerance:e} of each state's scale a step (velocities up to five times as much, and all more beyond {attempt_rate_limit_per_s} attempts a second), at most {max_step_s} s long"
        ),
    };
    let end =
        if settings.land_on_samples { "ending on every sample" } else { "samples interpolated" };
    format!("{:?}, {steps}, {end}", settings.method)
}

/// Writes the manifest of the folder's current files.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(folder: &Folder, study: &Study) -> Result<Manifest, JobError> {
    write_with(folder, study, &[])
}

/// Like [`write()`], with newly drawn figures.
///
/// # Errors
/// A file cannot be read or written.
pub fn write_with(
    folder: &Folder,
    study: &Study,
    figures: &[PathBuf],
) -> Result<Manifest, JobError> {
    let manifest = made(folder, study, figures)?;
    manifest::write(folder.path(), &manifest)?;
    Ok(manifest)
}

fn hashes(
    folder: &Folder,
    known: Option<&Manifest>,
    paths: &[PathBuf],
) -> Result<Vec<FileHash>, JobError> {
    paths.iter().map(|path| hash(folder, known, path)).collect()
}

fn hash(folder: &Folder, known: Option<&Manifest>, path: &Path) -> Result<FileHash, JobError> {
    let file = name(folder, path);
    match known.and_then(|known| known.hash_of(&file)) {
        Some(known) => Ok(known.clone()),
        None => Ok(FileHash { file, sha256: manifest::sha256(path)? }),
    }
}

/// The path of a file relative to the folder, with `/` on every system.
fn name(folder: &Folder, path: &Path) -> String {
    let inside = path.strip_prefix(folder.path()).unwrap_or(path);
    let parts = inside.iter().map(|part| part.to_string_lossy());
    parts.collect::<Vec<_>>().join("/")
}

fn data_set(
    folder: &Folder,
    known: Option<&Manifest>,
    scenario: Scenario,
    purpose: Purpose,
) -> Result<DataSetEntry, JobError> {
    let path = folder.data_set(scenario, purpose);
    let file = name(folder, &path);
    let known = known.filter(|known| known.hash_of(&file).is_some());
    let is_of = |entry: &&DataSetEntry| {
        entry.scenario == scenario.name() && entry.is_training == (purpose == Purpose::Train)
    };
    if let Some(entry) = known.and_then(|known| known.data_sets.iter().find(is_of)) {
        return Ok(entry.clone());
    }
    let wrong = |error: TableError| JobError::DataSet {
        path: path.clone(),
        error: EvaluationError::Table(error),
    };
    entry(&path, scenario, purpose).map_err(wrong)
}

fn entry(path: &Path, scenario: Scenario, purpose: Purpose) -> Result<DataSetEntry, TableError> {
    let mut entry = DataSetEntry {
        scenario: scenario.name().into(),
        is_training: purpose == Purpose::Train,
        variants: 0,
        healthy: 0,
        undetectable: 0,
        failed: vec![],
    };
    // Read in parts: there may be millions of rows.
    for part in ParquetReader::open_columns(path, &COLUMNS)? {
        entry.add(&part?)?;
    }
    Ok(entry)
}

/// The columns of a data set that the manifest summarizes.
const COLUMNS: [&str; 6] = ["variant", "intensity", "fault", "case", "failure", "detectable"];

impl DataSetEntry {
    fn add(&mut self, table: &Table) -> Result<(), TableError> {
        let (variants, intensities) = (table.u32("variant")?, table.f64("intensity")?);
        let (faults, cases) = (table.text("fault")?, table.text("case")?);
        let (reasons, detectable) = (table.text("failure")?, table.bool("detectable")?);
        self.variants += table.row_count();
        for row in 0..table.row_count() {
            let (is_healthy, ran) = (intensities[row] == 0.0, reasons[row].is_empty());
            self.healthy += usize::from(is_healthy);
            self.undetectable += usize::from(!is_healthy && ran && !detectable[row]);
            if !ran {
                self.failed.push(FailedVariant {
                    variant: variants[row],
                    fault: faults[row].clone(),
                    intensity: intensities[row],
                    case: cases[row].clone(),
                    reason: reasons[row].clone(),
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::job::{Folder, Subject};
    use crate::manifest::remedy;
    use crate::records::calibration_file;
    use crate::study::suites::KNOWN;
    use crate::study::{Purpose, Scenario};

    #[test]
    fn every_file_that_is_read_again_has_a_command_that_makes_it_anew() {
        let folder = Folder::new("out");
        let mut files = vec![folder.study(), folder.system()];
        files.extend([folder.data_card(), folder.flights(), folder.sealed_flights()]);
        files.push(folder.results());
        files.extend(KNOWN.map(|(suite, ..)| folder.outcomes(suite, "noise")));
        for scenario in Scenario::ALL {
            files.extend(Purpose::OF_RECORDS.map(|purpose| folder.data_set(scenario, purpose)));
            files.push(folder.diagnoser(scenario));
            files.push(folder.left_out(scenario));
        }
        files.extend(Purpose::OF_RECORDS.map(|purpose| calibration_file(folder.path(), purpose)));
        files.extend(Subject::ALL.map(|subject| folder.records(subject)));
        for file in files {
            let name = file.file_name().unwrap().to_str().unwrap();
            assert!(remedy(folder.path(), name).contains("makes it anew"), "{name}");
        }
    }
}
