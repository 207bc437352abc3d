//! `servotwin features`: computes the features of windows of measured and nominal signals.

use super::read_table;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run};
use servotwin::learn::EvaluationError;
use servotwin::recordings::{NominalFit, NominalSource, RecordingError, RecordingStudy};
use servotwin::shown::number;
use servotwin::study::Study;
use servotwin::table::Table;
use servotwin::toml_text::counted;
use servotwin::{files, table};
use servotwin_diagnosis::features::{ALL, Feature};
use servotwin_view::document::{Document, Table as Rows, Value, Verdict, line};
use servotwin_view::{render, row};
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

impl Run for Options {
    fn paths(&self) -> Paths {
        Paths::default()
            .read("INPUT", &self.input)
            .read("--study", &self.study)
            .read("--healthy", &self.healthy)
            .write("--out", Format::Table, &self.out)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        match (&self.input, &self.study, &self.out) {
            (Some(traces), Some(study), Some(out)) => of_traces(self, traces, study, out, global),
            _ => list(self.study.as_ref(), global),
        }
    }
}

/// Describes every feature of some sensors. The text is valid Markdown.
fn list(study: Option<&PathBuf>, global: Global) -> Result<Document, Failure> {
    let sensors = match study {
        Some(path) => read_recording_study(path)?.sensors(),
        None => Study::default().sensors,
    };
    let mut page = Document::listing("features", "");
    page.verdict = None;
    page.title = "Features".into();
    LIST_HEAD.lines().for_each(|line| _ = page.text(line));
    for family in ALL {
        let mut section = Document::section(family.name, family.name);
        section.text(family.summary);
        let mut table = Rows::of("name:feature | unit | meaning");
        for Feature { name, unit, meaning, .. } in family.features(&sensors) {
            table.push(row![Value::of(format!("`{name}`"), &name), unit, meaning]);
        }
        if table.is_empty() {
            section.text("None: these sensors have nothing for it to compare.");
        }
        section.table("features", table);
        page.add(section);
    }
    Ok(if global.json { page } else { Document::raw(render::markdown(&page)) })
}

/// The introduction of the list.
const LIST_HEAD: &str = "\
    This reference lists every feature of the default study's sensors, by family.\n\
    `servotwin features --list` prints it, and `--study` lists the features of another study.\n\
    A family has features only where the sensors exist that it compares.\n\
    r' is a residual: the measured value less the twin's value, over the sensor's scale.\n\
    The threshold of a tree is in the unit given here.";

/// Reads a study file of recordings.
pub(crate) fn read_recording_study(path: &Path) -> Result<RecordingStudy, Failure> {
    let text = files::read_toml(path).map_err(EvaluationError::File)?;
    Ok(RecordingStudy::parse(&text, &path.display().to_string())?)
}

fn of_traces(
    options: &Options,
    traces: &Path,
    study: &Path,
    out: &Path,
    global: Global,
) -> Result<Document, Failure> {
    let parsed = read_recording_study(study)?;
    let of = |path: &Path| {
        let path = path.to_owned();
        move |error| match error {
            RecordingError::Evaluation(error) => {
                let (path, study) = (path.display(), study.display());
                Failure::input(format!("{path} does not follow {study}: {error}"))
            }
            error @ RecordingError::TooFar { .. } => Failure::of_recordings(&path, error),
            error => Failure::of_recordings(study, error),
        }
    };
    let system = parsed.system(study.parent().unwrap_or(Path::new("")));
    let system = system.map_err(|error| Failure::of_recordings(study, error))?;
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
    let values = [
        ("file", out.into()),
        ("windows", windows.table.row_count().into()),
        ("columns", windows.table.columns().len().into()),
    ];
    let verdict = Verdict::good(line("{file}: {windows} windows, {columns} columns", values));
    let mut document = Document::new("features", verdict);
    remarks(&mut document, windows.left_over, windows.incomplete, &fits);
    Ok(document)
}

/// What the windows do not show: rows that are not used, and how well nominal values fit.
pub(crate) fn remarks(
    document: &mut Document,
    left_over: usize,
    incomplete: usize,
    fits: &[NominalFit],
) {
    let rows = |count| Value::of(counted(count, "row"), &count);
    document.fact("left_over_rows", "beyond whole windows, not used", rows(left_over));
    document.fact("incomplete_rows", "without a number of every sensor", rows(incomplete));
    let mut table = Rows::of(
        "sensor | source:nominal value | rows:healthy rows | deviation:remaining deviation | r2:R²",
    );
    for NominalFit { sensor, source, rows, deviation, r2 } in fits {
        let (how, r2) = match source {
            NominalSource::Column(name) => (format!("the column {name}"), *r2),
            NominalSource::Regression(inputs, conditions) => {
                let (how, r2) = match inputs.as_slice() {
                    [] => ("the mean".into(), None),
                    inputs => (format!("a regression on {}", inputs.join(", ")), *r2),
                };
                match conditions {
                    1 => (how, r2),
                    more => (format!("{how} in each of {more} conditions"), r2),
                }
            }
        };
        let r2 = r2.map(|r2| Value::number(r2, format!("{r2:.3}")));
        let deviation = Value::number(*deviation, number(*deviation, 3));
        table.push(row![sensor, Value::of(how, source), *rows, deviation, r2]);
    }
    document.table("nominals", table);
}
