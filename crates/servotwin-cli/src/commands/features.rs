//! `servotwin features`: computes the features of windows of measured and nominal signals.

use super::read_table;
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::render::number;
use serde_json::json;
use servotwin::document::counted;
use servotwin::evaluation::EvaluationError;
use servotwin::recordings::{NominalFit, NominalSource, RecordingError, RecordingStudy};
use servotwin::study::Study;
use servotwin::table::Table;
use servotwin::{files, table};
use servotwin_diagnosis::features::{ALL, Feature};
use std::path::{Path, PathBuf};

/// Compute the features of traces.
///
/// Traces are a table with columns of measured and nominal signals. Writes a table with the features of their
/// windows. With
/// --list, describes every feature.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The traces (.csv or .parquet).
    #[arg(value_name = "TRACES", required_unless_present = "list", requires_all = ["study", "out"])]
    input: Option<PathBuf>,
    /// List every feature with its unit and meaning instead: for the paper's sensors, or for those of --study.
    #[arg(long, conflicts_with_all = ["input", "out", "healthy"])]
    list: bool,
    /// The study file that assigns the columns of the traces (docs/own-data.md).
    #[arg(long)]
    study: Option<PathBuf>,
    /// Healthy traces, from which to learn the nominal values.
    #[arg(long, value_name = "FILE")]
    healthy: Option<PathBuf>,
    /// Write the features to this table (.csv or .parquet).
    #[arg(long)]
    out: Option<PathBuf>,
}

impl Options {
    /// The files that the command reads and writes.
    pub(crate) fn paths(&self) -> Paths {
        Paths::default()
            .read("INPUT", &self.input)
            .read("--study", &self.study)
            .read("--healthy", &self.healthy)
            .write("--out", Format::Table, &self.out)
    }
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    match (&options.input, &options.study, &options.out) {
        (Some(traces), Some(study), Some(out)) => of_traces(options, traces, study, out, global),
        _ => list(options.study.as_ref(), global),
    }
}

/// Describes every feature of some sensors. The text is valid Markdown.
fn list(study: Option<&PathBuf>, global: Global) -> Result<String, Failure> {
    let sensors = match study {
        Some(path) => {
            let in_study = |error| Failure::Recording { path: path.clone(), error };
            read_recording_study(path)?.sensors().map_err(in_study)?
        }
        None => Study::default().sensors,
    };
    let mut entries = vec![];
    let mut text = String::from(LIST_HEAD);
    for family in ALL {
        let features = family.features(&sensors);
        text += &format!("\n## {}\n\n{}\n\n", family.name, family.summary);
        if features.is_empty() {
            text += "None: these sensors have nothing for it to compare.\n";
            continue;
        }
        text += "| feature | unit | meaning |\n|---|---|---|\n";
        for feature in features {
            let Feature { name, unit, meaning, .. } = feature;
            text += &format!("| `{name}` | {unit} | {} |\n", meaning.replace('|', "\\|"));
            entries.push(json!({
                "family": family.name, "name": name, "unit": unit, "meaning": meaning
            }));
        }
    }
    Ok(if global.json { crate::render::json(&json!(entries)) } else { text })
}

/// The introduction of the list.
const LIST_HEAD: &str = "# Features\n\n\
    This reference lists every feature of the default study's sensors, by family.\n\
    `servotwin features --list` prints it, and `--study` lists the features of another study.\n\
    A family has features only where the sensors exist that it compares.\n\
    r' is a residual: the measured value less the twin's value, over the sensor's scale.\n\
    The threshold of a tree is in the unit given here.\n";

/// Reads a study file of recordings.
pub(crate) fn read_recording_study(path: &Path) -> Result<RecordingStudy, Failure> {
    let text = files::read_document(path).map_err(EvaluationError::File)?;
    RecordingStudy::parse(&text).map_err(|error| Failure::Recording { path: path.into(), error })
}

fn of_traces(
    options: &Options,
    traces: &Path,
    study: &Path,
    out: &Path,
    global: Global,
) -> Result<String, Failure> {
    let parsed = read_recording_study(study)?;
    let of = |path: &Path| {
        let path = path.to_owned();
        move |error| match error {
            RecordingError::Evaluation(error) => {
                Failure::NotAs { path: path.clone(), study: study.into(), error: Box::new(error) }
            }
            error @ RecordingError::TooFar { .. } => {
                Failure::Recording { path: path.clone(), error }
            }
            error => Failure::Recording { path: study.into(), error },
        }
    };
    let system = parsed.system(study.parent().unwrap_or(Path::new("")));
    let system = system.map_err(|error| Failure::Recording { path: study.into(), error })?;
    let read = |path: &Path| {
        let mut table = read_table(path, global)?;
        if let Some(system) = &system {
            parsed.add_twin(&mut table, system).map_err(of(path))?;
        }
        Ok::<Table, Failure>(table)
    };
    let table = read(traces)?;
    let (teacher, healthy, nominals) = match &options.healthy {
        Some(path) => {
            let teacher = read(path)?;
            let rows: Vec<usize> = (0..teacher.row_count()).collect();
            let nominals = parsed.learn(&teacher, &rows).map_err(of(path))?;
            (teacher, rows, nominals)
        }
        None => {
            let rows = parsed.healthy_rows(&table).map_err(of(traces))?;
            let nominals = parsed.learn(&table, &rows).map_err(of(traces))?;
            (table.clone(), rows, nominals)
        }
    };
    let windows = parsed.windows(&table, &nominals).map_err(of(traces))?;
    table::write(out, &windows.table)?;
    let fits = parsed.fits(&teacher, &nominals, &healthy).map_err(of(traces))?;
    let (count, columns) = (windows.table.row_count(), windows.table.columns().len());
    Ok(match (global.json, global.quiet) {
        (true, _) => crate::render::json(&json!({
            "windows": count, "columns": columns, "left_over_rows": windows.left_over,
            "incomplete_rows": windows.incomplete, "nominals": fits,
        })),
        (false, true) => String::new(),
        (false, false) => {
            let head = format!("{}: {count} windows, {columns} columns\n", out.display());
            head + &remarks(windows.left_over, windows.incomplete, &fits)
        }
    })
}

/// What the windows do not show: rows that are not used, and how well nominal values fit.
pub(crate) fn remarks(left_over: usize, incomplete: usize, fits: &[NominalFit]) -> String {
    let mut text = String::new();
    if left_over > 0 {
        text += &format!("{} beyond whole windows: not used\n", counted(left_over, "row"));
    }
    if incomplete > 0 {
        text += &format!("{} without a number of every sensor\n", counted(incomplete, "row"));
    }
    for NominalFit { sensor, source, rows, deviation, r2 } in fits {
        let (how, r2) = match source {
            NominalSource::Column(name) => (format!("the column {name}"), r2),
            NominalSource::Regression(inputs, conditions) => {
                let (how, r2) = match inputs.as_slice() {
                    [] => ("the mean".into(), &None),
                    inputs => (format!("a regression on {}", inputs.join(", ")), r2),
                };
                match conditions {
                    1 => (how, r2),
                    more => (format!("{how} in each of {more} conditions"), r2),
                }
            }
        };
        let r2 = r2.map_or(String::new(), |r2| format!(", R² {r2:.3}"));
        text += &format!(
            "{sensor}: nominal is {how}; in {rows} healthy rows the remaining deviation is {}{r2}\n",
            number(*deviation, 3)
        );
    }
    text
}
