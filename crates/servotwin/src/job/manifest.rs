//! `manifest.json`, the origin of results: versions, seeds, and hashes of inputs and outputs. It contains no time of
//! day, so the same study gives the same bytes.

use super::{Folder, JobError, Subject};
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
    /// The seed of splits into training and test.
    pub split_seed: u64,
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
    /// Counts and solver effort, by kind of fault.
    pub efforts: Vec<KindEffort>,
    /// Variants that began without a steady state.
    pub(crate) on_the_move: Vec<MovingVariant>,
    /// Variants that were not simulated to the end.
    pub failed: Vec<FailedVariant>,
}

/// The solver's effort for a kind of fault. Simulations that stopped early are left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KindEffort {
    /// The kind of fault, or `healthy`.
    pub kind: String,
    /// Number of variants.
    pub variants: usize,
    /// The solver's steps for each simulated second, on average.
    pub mean_steps_per_s: f64,
    /// The maximum of a variant.
    pub most_steps_per_s: f64,
    /// Variants that ring (`VariantEffort::rings`).
    pub rings: usize,
    /// Variants that began in motion, because no steady state was found.
    pub began_on_the_move: usize,
    /// Those of them with a measured limit cycle.
    pub(crate) limit_cycles: usize,
}

/// A variant that began in motion, because no steady state was found for it or for its twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct MovingVariant {
    /// The number of the variant.
    pub(crate) variant: u32,
    /// The name of its fault.
    pub(crate) fault: String,
    /// The intensity of the fault.
    pub(crate) intensity: f64,
    /// The name of the operating case.
    pub(crate) case: String,
    /// Whether a limit cycle was measured.
    pub(crate) limit_cycle: bool,
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
        self.inputs.iter().chain(&self.outputs).find(|known| known.file == file)
    }

    /// Writes the manifest into its folder. Equal manifests give equal bytes.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), FileError> {
        manifest::write(folder, self)
    }
}

/// Makes the manifest of the folder's current files. Known hashes are kept: a stage vouches only for files written
/// since ([`manifest::forget`]), not for files damaged before it began.
///
/// # Errors
/// A file cannot be read.
pub fn of(folder: &Folder, study: &Study) -> Result<Manifest, JobError> {
    with(folder, study, &[])
}

/// Like [`of`], with newly drawn figures.
fn with(folder: &Folder, study: &Study, figures: &[PathBuf]) -> Result<Manifest, JobError> {
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
        split_seed: Subject::Ideal.settings(study).holding.seed,
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
    let manifest = with(folder, study, figures)?;
    manifest.write(folder.path())?;
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
        efforts: vec![],
        on_the_move: vec![],
        failed: vec![],
    };
    // Read in parts: there may be millions of rows.
    for part in ParquetReader::open_columns(path, &COLUMNS)? {
        entry.add(&part?)?;
    }
    Ok(entry)
}

/// The columns of a data set that the manifest summarizes.
const COLUMNS: [&str; 11] = [
    "variant",
    "intensity",
    "fault",
    "kind",
    "case",
    "failure",
    "detectable",
    "steps_per_s",
    "began_on_the_move",
    "limit_cycle",
    "rings",
];

impl DataSetEntry {
    fn add(&mut self, table: &Table) -> Result<(), TableError> {
        let (variants, intensities) = (table.u32("variant")?, table.f64("intensity")?);
        let (faults, cases) = (table.text("fault")?, table.text("case")?);
        let (reasons, detectable) = (table.text("failure")?, table.bool("detectable")?);
        let (kinds, steps) = (table.text("kind")?, table.f64("steps_per_s")?);
        let (moving, rings) = (table.bool("began_on_the_move")?, table.bool("rings")?);
        let cycles = table.bool("limit_cycle")?;
        self.variants += table.row_count();
        for row in 0..table.row_count() {
            let (is_healthy, ran) = (intensities[row] == 0.0, reasons[row].is_empty());
            self.healthy += usize::from(is_healthy);
            self.undetectable += usize::from(!is_healthy && ran && !detectable[row]);
            if ran {
                let cycles = moving[row] && cycles[row];
                self.effort(&kinds[row]).add(steps[row], rings[row], [moving[row], cycles]);
                if moving[row] {
                    self.on_the_move.push(MovingVariant {
                        variant: variants[row],
                        fault: faults[row].clone(),
                        intensity: intensities[row],
                        case: cases[row].clone(),
                        limit_cycle: cycles,
                    });
                }
            } else {
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

    /// The entry of a kind of fault, inserted if missing. Entries are sorted by kind.
    fn effort(&mut self, kind: &str) -> &mut KindEffort {
        let place = self.efforts.binary_search_by(|effort| effort.kind.as_str().cmp(kind));
        let place = place.unwrap_or_else(|place| {
            self.efforts.insert(place, KindEffort::new(kind));
            place
        });
        &mut self.efforts[place]
    }
}

impl KindEffort {
    fn new(kind: &str) -> Self {
        KindEffort {
            kind: kind.into(),
            variants: 0,
            mean_steps_per_s: 0.0,
            most_steps_per_s: 0.0,
            rings: 0,
            began_on_the_move: 0,
            limit_cycles: 0,
        }
    }

    fn add(&mut self, steps_per_s: f64, rings: bool, [moves, cycles]: [bool; 2]) {
        self.variants += 1;
        self.mean_steps_per_s += (steps_per_s - self.mean_steps_per_s) / self.variants as f64;
        self.most_steps_per_s = self.most_steps_per_s.max(steps_per_s);
        self.rings += usize::from(rings);
        self.began_on_the_move += usize::from(moves);
        self.limit_cycles += usize::from(cycles);
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
