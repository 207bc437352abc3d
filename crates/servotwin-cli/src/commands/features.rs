//! `servotwin features`: describes the features of windows.

use crate::failure::Failure;
use crate::paths::Paths;
use crate::{Global, Run};
use servotwin::files;
use servotwin::learn::EvaluationError;
use servotwin::recordings::RecordingStudy;
use servotwin::study::Study;
use servotwin_diagnosis::features::{ALL, Feature, Sensors};
use servotwin_view::document::{Document, Table, Value};
use servotwin_view::{render, row};
use std::path::{Path, PathBuf};

/// List every feature of windows with its unit and meaning.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// List those of a study of recordings (docs/own-data.md) instead of the paper's sensors.
    #[arg(long)]
    study: Option<PathBuf>,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        Paths::default().read("--study", &self.study)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        list(self.study.as_ref(), global)
    }
}

/// Describes every feature of some sensors. The text is valid Markdown.
fn list(study: Option<&PathBuf>, global: Global) -> Result<Document, Failure> {
    let sensors = match study {
        Some(path) => read_recording_study(path)?.sensors(),
        None => of_default_study()?,
    };
    let mut page = Document::listing("features", "");
    page.verdict = None;
    page.title = "Features".into();
    LIST_HEAD.lines().for_each(|line| _ = page.text(line));
    for family in ALL {
        let mut section = Document::section(family.name, family.name);
        section.text(family.summary);
        let mut table = Table::of("name:feature | unit | meaning");
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

/// The sensors of the default study. Its tests on the ground read all of them, and some more.
fn of_default_study() -> Result<Sensors, Failure> {
    let study = Study::default();
    Ok(study.on_ground()?.unwrap_or(study).sensors)
}

/// The introduction of the list.
const LIST_HEAD: &str = "\
    This reference lists every feature of the default study's sensors, by family.\n\
    It includes the sensors that only the test on the ground reads.\n\
    `servotwin features` prints it, and `--study` lists the features of another study.\n\
    A family has features only where the sensors exist that it compares.\n\
    r' is a residual: the measured value less the twin's value, over the sensor's scale.\n\
    The threshold of a tree is in the unit given here.";

/// Reads a study file of recordings.
pub(crate) fn read_recording_study(path: &Path) -> Result<RecordingStudy, Failure> {
    let text = files::read_toml(path).map_err(EvaluationError::File)?;
    Ok(RecordingStudy::parse(&text, &path.display().to_string())?)
}
