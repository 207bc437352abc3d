//! `servotwin check`: checks a system or a study file.

use super::features::read_recording_study;
use crate::failure::Failure;
use crate::{Global, Run};
use servotwin::built_in::{STUDIES, SYSTEMS, find};
use servotwin::kind::FileType;
use servotwin::plausibility;
use servotwin::study::{Scenario, Study};
use servotwin::system::System;
use servotwin::toml_text::Diagnostic;
use servotwin::toml_text::TomlError;
use servotwin_view::document::{Document, Line, Value, Verdict, line};
use std::path::{Path, PathBuf};

/// Check a system or a study file, and show each mistake at its place.
///
/// The check reports every mistake for which 'study' would reject the file. It also warns about what is valid but
/// probably not intended: a fault that changes nothing, a pump without a relief valve, a system that is unstable or in an
/// end stop at its default inputs.
///
/// The content decides whether a file is a system or a study: a study names its system. The output shows the first 20
/// mistakes, or all of them with --json. If a built-in name stands for a system and a study, both are checked.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// A file, or the name of a built-in system or study.
    file: PathBuf,
}

impl Run for Options {
    fn run(&self, _: Global) -> Result<Document, Failure> {
        let checked = file_types(&self.file)?.into_iter().map(|kind| match kind {
            FileType::System => Ok(of_system(&System::read(&self.file)?)),
            FileType::Study => {
                let study = Study::read(&self.file)?;
                study.complete()?;
                Ok(of_study(&study))
            }
            FileType::Recordings => of_recordings(&self.file),
        });
        let checked = checked.collect::<Result<Vec<Document>, Failure>>()?;
        let text = "{file}: no mistakes.";
        let verdict = line(text, [("file", (&self.file).into()), ("valid", true.into())]);
        let mut document = Document::new("check", Verdict::good(verdict));
        checked.into_iter().for_each(|section| document.add(section));
        Ok(document)
    }
}

/// The type of the file. A file with sections that only studies have is a study. A built-in name may stand for a system
/// and for a study.
fn file_types(file: &Path) -> Result<Vec<FileType>, TomlError> {
    let name = file.to_str().unwrap_or_default();
    let lists = [(FileType::System, &SYSTEMS[..]), (FileType::Study, &STUDIES[..])];
    let built_in = lists.into_iter().filter(|(_, list)| find(list, name).is_some());
    let built_in: Vec<FileType> = built_in.map(|(kind, _)| kind).collect();
    if !built_in.is_empty() {
        return Ok(built_in);
    }
    let (text, _) = FileType::System.read(file)?;
    Ok(vec![FileType::of(&text).unwrap_or(FileType::System)])
}

fn of_system(system: &System) -> Document {
    let network = system.network();
    let faults: usize = network.components.iter().map(|c| c.component.faults.len()).sum();
    let mut section = Document::section("system", "");
    section.fact("name", "system", system.name.as_str());
    section.fact("components", "components", network.components.len());
    section.fact("states", "states", system.program.states().len());
    section.fact("faults", "faults", faults);
    section.fact("inputs", "inputs", network.inputs.len());
    section.fact("sensors", "sensors", system.sensors.len());
    section.list("warnings", plausible(system));
    section
}

fn of_study(study: &Study) -> Document {
    let scenarios = Scenario::groups(study, |_| true).concat();
    let mut section = Document::section("study", "");
    section.fact("name", "study", study.name.as_str());
    section.fact("system", "system", study.system.name.as_str());
    section.fact("actuators", "", Value::list(study.actuators.iter()));
    section.fact("cases", "cases", study.cases.len());
    section.fact("faults", "faults at their intensities", study.faults.len());
    section.fact("sensors", "sensors", study.measured.len());
    section.fact("scenarios", "scenarios", Value::list(scenarios.into_iter().map(Scenario::name)));
    let places = study.warnings().into_iter().zip(study.warnings_in_words());
    let warnings = places.map(|(Diagnostic { line, column, message, .. }, words)| Line {
        text: format!("warning: {words}"),
        values: vec![("line", line.into()), ("column", column.into()), ("message", message.into())],
    });
    section.list("warnings", warnings.chain(plausible(&study.system)));
    section
}

/// What is valid in a system, but probably not intended.
fn plausible(system: &System) -> impl Iterator<Item = Line> {
    let warnings = plausibility::warnings(system).into_iter();
    warnings.map(|message| line("warning: {message}", [("message", message.into())]))
}

/// Checks a study of recordings. It names columns of a table instead of a system.
fn of_recordings(file: &Path) -> Result<Document, Failure> {
    let study = read_recording_study(file)?;
    let sensors = study.sensors().0.len();
    let mut section = Document::section("recordings", "");
    section.fact("sensors", "sensors or residuals of a window", sensors);
    section.fact("window_rows", "rows of a window", study.window_rows());
    Ok(section)
}
