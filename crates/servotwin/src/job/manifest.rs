//! Where results come from: `manifest.json`, with versions, seeds, and hashes of what went in and
//! what came out. It holds no time of day: the same study gives the same bytes.

use super::{Folder, JobError, Subject};
use crate::evaluation::EvaluationError;
use crate::files::FileError;
use crate::manifest;
use crate::study::{Role, Setting, Study};
use crate::table::parquet::ParquetReader;
use crate::table::{Table, TableError};
use serde::{Deserialize, Serialize};
use servotwin_model::solver::{self, Control};
use std::path::{Path, PathBuf};

pub use crate::manifest::{FORMAT, FileHash};

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
    /// [`Network::identity`](servotwin_model::network::Network::identity) of the equations, which compiled steps carry.
    #[serde(default)]
    pub equations: String,
    /// The data sets.
    pub data_sets: Vec<DataSetEntry>,
    /// Every result file.
    pub outputs: Vec<FileHash>,
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
    /// What simulations took, by kind of fault.
    pub efforts: Vec<KindEffort>,
    /// Variants that began without a steady state.
    #[serde(default)]
    pub on_the_move: Vec<MovingVariant>,
    /// Variants that were not simulated to the end.
    pub failed: Vec<FailedVariant>,
}

/// What the simulations of a kind of fault took, those that did not end left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KindEffort {
    /// The kind; `healthy` without a fault.
    pub kind: String,
    /// Number of variants.
    pub variants: usize,
    /// The solver's steps for each simulated second, on average.
    pub mean_steps_per_s: f64,
    /// The most that a variant took.
    pub most_steps_per_s: f64,
    /// Variants that ring ([`Effort::rings`](crate::campaign::Effort::rings)).
    pub rings: usize,
    /// Variants that began on the move: no rest was found.
    pub began_on_the_move: usize,
    /// Those of them that were measured to swing for ever.
    #[serde(default)]
    pub limit_cycles: usize,
}

/// A variant that began without a steady state: none was found for it or for its twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MovingVariant {
    /// Its number.
    pub variant: u32,
    /// Its fault.
    pub fault: String,
    /// Its intensity.
    pub intensity: f64,
    /// The operating case.
    pub case: String,
    /// Whether it was measured to swing for ever.
    pub limit_cycle: bool,
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

impl Manifest {
    /// Reads the manifest of a folder; `None` if there is none of ours.
    ///
    /// # Errors
    /// It cannot be read, or is damaged.
    pub fn read(folder: &Path) -> Result<Option<Self>, FileError> {
        manifest::read(folder)
    }

    /// What was in a file when it was written, if that is known.
    pub fn hash_of(&self, file: &str) -> Option<&FileHash> {
        self.inputs.iter().chain(&self.outputs).find(|known| known.file == file)
    }

    /// Writes it into its folder; the same manifest gives the same bytes.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), FileError> {
        manifest::write(folder, self)
    }
}

/// The manifest of what is in a folder now. What the one that lies there knows of a file is kept: a stage vouches only for
/// what was written since ([`manifest::forget`]), and not for what was damaged before it began.
///
/// # Errors
/// A file cannot be read.
pub fn of(folder: &Folder, study: &Study) -> Result<Manifest, JobError> {
    with(folder, study, &[])
}

/// The same with figures that have just been drawn.
fn with(folder: &Folder, study: &Study, figures: &[PathBuf]) -> Result<Manifest, JobError> {
    let known = Manifest::read(folder.path())?;
    let mut results = folder.results_there()?;
    results.extend(
        figures.iter().filter(|&figure| !results.contains(figure)).cloned().collect::<Vec<_>>(),
    );
    let both = |setting| Role::ALL.map(|role| (setting, role));
    let data_sets = Setting::ALL.into_iter().flat_map(both);
    let data_sets = data_sets.filter(|&(setting, role)| folder.data_set(setting, role).exists());
    Ok(Manifest {
        format: FORMAT.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        study: study.name.clone(),
        inputs: hashes(folder, known.as_ref(), &[folder.study(), folder.system()])?,
        specimen_seed: study.realism.as_ref().map(|realism| realism.seed),
        split_seed: Subject::Ideal.settings(study).holding.seed,
        solver: in_words(&solver::Settings::campaign()),
        equations: format!("{:016x}", study.system.program.identity()),
        data_sets: data_sets
            .map(|(s, role)| data_set(folder, known.as_ref(), s, role))
            .collect::<Result<_, _>>()?,
        outputs: hashes(folder, known.as_ref(), &results)?,
    })
}

/// The solver's settings as people say them.
fn in_words(settings: &solver::Settings) -> String {
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

/// Writes the manifest of what is in a folder now.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(folder: &Folder, study: &Study) -> Result<Manifest, JobError> {
    write_with(folder, study, &[])
}

/// The same with figures that have just been drawn.
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

/// A file seen from the folder, the same on every system.
fn name(folder: &Folder, path: &Path) -> String {
    let inside = path.strip_prefix(folder.path()).unwrap_or(path);
    let parts = inside.iter().map(|part| part.to_string_lossy());
    parts.collect::<Vec<_>>().join("/")
}

fn data_set(
    folder: &Folder,
    known: Option<&Manifest>,
    setting: Setting,
    role: Role,
) -> Result<DataSetEntry, JobError> {
    let path = folder.data_set(setting, role);
    let file = name(folder, &path);
    let known = known.filter(|known| known.hash_of(&file).is_some());
    let is_of = |entry: &&DataSetEntry| {
        entry.setting == setting.name() && entry.is_training == (role == Role::Training)
    };
    if let Some(entry) = known.and_then(|known| known.data_sets.iter().find(is_of)) {
        return Ok(entry.clone());
    }
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
        efforts: vec![],
        on_the_move: vec![],
        failed: vec![],
    };
    // Part by part: there may be millions of rows.
    for part in ParquetReader::open_columns(path, &COLUMNS)? {
        entry.add(&part?)?;
    }
    Ok(entry)
}

/// The columns of a data set that a manifest looks at.
const COLUMNS: [&str; 12] = [
    "variant",
    "intensity",
    "fault",
    "kind",
    "case",
    "failure",
    "detectable",
    "reflected",
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
        self.reflected += table.bool("reflected")?.iter().filter(|&&is_image| is_image).count();
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

    /// That of a kind; kinds stand in the order of their names.
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
    use crate::campaign::calibration_file;
    use crate::job::{Folder, Subject};
    use crate::manifest::remedy;
    use crate::study::{Role, Setting};

    #[test]
    fn every_file_that_is_read_again_has_a_command_that_makes_it_anew() {
        let folder = Folder::new("out");
        let mut files = vec![folder.study(), folder.system()];
        files.extend([folder.flights(), folder.missing_sensors(), folder.results()]);
        for setting in Setting::ALL {
            files.extend(Role::ALL.map(|role| folder.data_set(setting, role)));
            files.extend([folder.diagnoser(setting), folder.band(setting)]);
        }
        files.extend(Role::ALL.map(|role| calibration_file(folder.path(), role)));
        for subject in Subject::ALL {
            files.extend([folder.hierarchy(subject), folder.panel(subject)]);
        }
        for file in files {
            let name = file.file_name().unwrap().to_str().unwrap();
            assert!(remedy(folder.path(), name).contains("makes it anew"), "{name}");
        }
    }
}
