//! Where results come from: `manifest.json`, with versions, seeds, and hashes of what went in and
//! what came out. It holds no time of day: the same study gives the same bytes.

use super::{Folder, JobError};
use crate::evaluation::protocol::Holding;
use crate::evaluation::{EvaluationError, model_file};
use crate::files;
use crate::study::{Role, Setting, Study};
use crate::table::parquet::ParquetReader;
use crate::table::{Table, TableError};
use serde::{Deserialize, Serialize};
use servotwin_model::solver::{self, Control};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// The word that a manifest begins with.
pub const FORMAT: &str = "servotwin manifest 1";

/// Where the results in a folder come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: String,
    /// The version of the program that wrote it.
    pub version: String,
    /// The name of the study.
    pub study: String,
    /// The texts that everything comes from.
    pub inputs: Vec<FileHash>,
    /// The seed of noise and specimens, where the study has a realistic setting.
    pub specimen_seed: Option<u64>,
    /// The seed of splits into training and test.
    pub split_seed: u64,
    /// The solver's settings.
    pub solver: String,
    /// The data sets.
    pub data_sets: Vec<DataSetEntry>,
    /// Every result file.
    pub outputs: Vec<FileHash>,
}

/// A file and what was in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileHash {
    /// The file, seen from the folder.
    pub file: String,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub sha256: String,
}

/// What is in a data set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataSetEntry {
    /// The setting.
    pub setting: String,
    /// Whether a diagnosis learns from it; otherwise it is judged on it.
    pub is_training: bool,
    /// Number of variants.
    pub variants: usize,
    /// Variants that were not simulated, being mirror images of others.
    pub reflected: usize,
    /// Variants without a fault.
    pub healthy: usize,
    /// Faulty variants that never leave the band of healthy residuals.
    pub undetectable: usize,
    /// Variants that were not simulated to the end.
    pub failed: Vec<FailedVariant>,
}

/// A variant that was not simulated to the end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FailedVariant {
    /// Its number.
    pub variant: u32,
    /// Its fault.
    pub fault: String,
    /// Its intensity.
    pub intensity: f64,
    /// The operating case.
    pub case: String,
    /// Why.
    pub reason: String,
}

/// The manifest of what is in a folder now.
///
/// # Errors
/// A file cannot be read.
pub fn of(folder: &Folder, study: &Study) -> Result<Manifest, JobError> {
    let both = |setting| Role::ALL.map(|role| (setting, role));
    let data_sets = Setting::ALL.into_iter().flat_map(both);
    let data_sets = data_sets.filter(|&(setting, role)| folder.data_set(setting, role).exists());
    Ok(Manifest {
        format: FORMAT.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        study: study.name.clone(),
        inputs: hashes(folder, &[folder.study(), folder.system()])?,
        specimen_seed: study.realism.as_ref().map(|realism| realism.seed),
        split_seed: Holding::default().seed,
        solver: in_words(&solver::Settings::campaign()),
        data_sets: data_sets
            .map(|(s, role)| data_set(folder, s, role))
            .collect::<Result<_, _>>()?,
        outputs: hashes(folder, &folder.results_there()?)?,
    })
}

/// The solver's settings as people say them.
fn in_words(settings: &solver::Settings) -> String {
    let steps = match settings.control {
        Control::Fixed { step_s } => format!("steps of {step_s} s"),
        Control::Adaptive { tolerance, max_step_s } => format!(
            "steps by error: at most {tolerance:e} of each state's scale a step, at most {max_step_s} s long"
        ),
    };
    let end =
        if settings.land_on_samples { "ending on every sample" } else { "samples interpolated" };
    format!("{:?}, {steps}, {end}", settings.method)
}

/// Writes the manifest of what is in a folder now.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(folder: &Folder, study: &Study) -> Result<Manifest, JobError> {
    let manifest = of(folder, study)?;
    model_file::write(folder.manifest(), &manifest)?;
    Ok(manifest)
}

fn hashes(folder: &Folder, paths: &[PathBuf]) -> Result<Vec<FileHash>, JobError> {
    paths.iter().map(|path| hash(folder, path)).collect()
}

fn hash(folder: &Folder, path: &Path) -> Result<FileHash, JobError> {
    let mut digest = Sha256::new();
    files::read_through(path, |bytes| digest.update(bytes))?;
    let inside = path.strip_prefix(folder.path()).unwrap_or(path);
    let parts = inside.iter().map(|part| part.to_string_lossy());
    Ok(FileHash {
        // The same on every system.
        file: parts.collect::<Vec<_>>().join("/"),
        sha256: digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect(),
    })
}

fn data_set(folder: &Folder, setting: Setting, role: Role) -> Result<DataSetEntry, JobError> {
    let path = folder.data_set(setting, role);
    let wrong = |error: TableError| JobError::DataSet {
        path: path.clone(),
        error: EvaluationError::Table(error),
    };
    entry(&path, setting, role).map_err(wrong)
}

fn entry(path: &Path, setting: Setting, role: Role) -> Result<DataSetEntry, TableError> {
    let mut entry = DataSetEntry {
        setting: setting.name().into(),
        is_training: role == Role::Training,
        variants: 0,
        reflected: 0,
        healthy: 0,
        undetectable: 0,
        failed: vec![],
    };
    // Part by part: there may be millions of rows.
    for part in ParquetReader::open_columns(path, &COLUMNS)? {
        entry.add(&part?)?;
    }
    Ok(entry)
}

/// The columns of a data set that a manifest looks at.
const COLUMNS: [&str; 7] =
    ["variant", "intensity", "fault", "case", "failure", "detectable", "reflected"];

impl DataSetEntry {
    fn add(&mut self, table: &Table) -> Result<(), TableError> {
        let (variants, intensities) = (table.u32("variant")?, table.f64("intensity")?);
        let (faults, cases) = (table.text("fault")?, table.text("case")?);
        let (reasons, detectable) = (table.text("failure")?, table.bool("detectable")?);
        self.variants += table.row_count();
        self.reflected += table.bool("reflected")?.iter().filter(|&&is_image| is_image).count();
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
