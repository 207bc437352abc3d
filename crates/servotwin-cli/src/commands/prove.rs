//! `servotwin prove`: an export decides as its diagnoser was trained to.

use super::export::unfit;
use super::find_study;
use super::progress::Stages;
use crate::failure::Failure;
use crate::{Global, Run};
use servotwin::learn::model_file;
use servotwin_export::certificate::Certificate;
use servotwin_export::folder::ExportFolder;
use servotwin_export::prove::{Build, Plan, ProofEvidence, prove};
use servotwin_export::{ExportError, ExportedTwin};
use servotwin_view::document::Document;
use std::path::PathBuf;
use std::sync::Arc;

/// Compile an export and prove that it decides as it was trained.
///
/// First the text of every file, its hashes and the twin are compared with what is exported for the diagnoser. Then each
/// build (gcc and clang, as far as they are installed, with -O0, -O2 and -O3) is compared bit by bit with the
/// diagnoser: every leaf of every tree, both sides of every threshold, missing values at every test, and random samples
/// through the whole chain with lost sensors, wrong inputs and commands of the flight control computer. The twin is compared
/// with that of the toolkit over variants with random faults. The certificate is written beside the files, as proof.json
/// and proof.html.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The folder of the export.
    #[arg(value_name = "FOLDER", default_value = "export")]
    folder: PathBuf,
    /// The exported diagnoser, if it is no longer where it was.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The study of the twin, if it is no longer where it was.
    #[arg(long, value_name = "STUDY")]
    study: Option<PathBuf>,
    /// The number of faulty variants of the twin, each of 90 s.
    #[arg(long, value_name = "NUMBER", default_value_t = 100)]
    variants: u64,
    /// The duration of the samples through the whole chain, h.
    #[arg(long, value_name = "HOURS", default_value_t = 24.0, value_parser = hours)]
    hours: f64,
    /// Compile with this command and its flags, such as 'gcc-13 -O1', instead of gcc and clang at three levels.
    #[arg(long, value_name = "COMMAND")]
    compiler: Option<String>,
    /// Keep the sources, objects and library of each build, in FOLDER/1, FOLDER/2 …
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|hours: &f64| (0.0..=10_000.0).contains(hours));
    hours.ok_or_else(|| "a number from 0 to 10000, such as 24".into())
}

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        let folder = ExportFolder::new(&self.folder);
        let description = folder.description();
        if !matches!(description, Err(ExportError::NoExport(_))) {
            folder.forget_certificate()?;
        }
        let description = description?;
        let file = self.model.clone().unwrap_or_else(|| description.diagnoser.clone());
        let diagnoser = Arc::new(model_file::read_diagnoser(&file)?);
        let builds = match &self.compiler {
            Some(command) => vec![Build::new(command)],
            None => Build::available(),
        };
        if builds.is_empty() {
            return Err(ExportError::NoBuild.into());
        }
        let place = self.study.clone().unwrap_or_else(|| description.twin.study.clone());
        let study = find_study(Some(&place))?;
        let twin = ExportedTwin::beside(&study, &diagnoser, description.twin.has_fixed_step);
        let twin = twin.map_err(unfit(&file))?;
        let compared = folder.compare(&description, (&diagnoser, &file), (&twin, &place))?;
        let mut evidence = vec![];
        if compared.differences.is_empty() {
            let plan = Plan {
                twin: Some(&twin),
                study: Some(&study),
                samples: (self.hours * 3600.0 / diagnoser.period_s).round() as u64,
                variants: self.variants,
                kept: self.keep.as_deref(),
                ..Plan::new(&diagnoser, &compared.files)
            };
            evidence = proven(&plan, &builds, global)?;
        }
        let certificate = Certificate::new(description, compared, evidence);
        let written = folder.write_certificate(&certificate)?;
        let mut document = certificate.document();
        document.files(written);
        Ok(document)
    }
}

/// Compiles and compares. A compiler that refuses the text is evidence too.
fn proven(
    plan: &Plan,
    builds: &[Build],
    global: Global,
) -> Result<Vec<ProofEvidence>, ExportError> {
    let stages = Stages::new(global);
    let proven = prove(plan, builds, &mut |what: &str, share| stages.show(what, share));
    stages.end();
    match proven {
        Err(ExportError::Refused { compiler, messages }) => {
            Ok(vec![ProofEvidence::refused(&compiler, &messages)])
        }
        proven => proven,
    }
}
