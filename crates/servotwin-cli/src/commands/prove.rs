//! `servotwin prove`: an export decides as its diagnoser was trained to.

use super::export::{twin_of, unfit};
use super::find_study;
use super::progress::Stages;
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::evaluation::model_file;
use servotwin_export::ExportError;
use servotwin_export::certificate::Certificate;
use servotwin_export::folder::ExportFolder;
use servotwin_export::prove::{Build, Plan, ProofEvidence, prove};
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

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = ExportFolder::new(&options.folder);
    let description = folder.description();
    if !matches!(description, Err(ExportError::NoExport(_))) {
        folder.forget_certificate()?;
    }
    let description = description?;
    let file = options.model.clone().unwrap_or_else(|| description.diagnoser.clone());
    let diagnoser = Arc::new(model_file::read_diagnoser(&file)?);
    let builds = match &options.compiler {
        Some(command) => vec![Build::new(command)],
        None => Build::available(),
    };
    if builds.is_empty() {
        return Err(ExportError::NoBuild.into());
    }
    let place = options.study.clone().unwrap_or_else(|| description.twin.study.clone());
    let study = find_study(Some(&place))?;
    let twin =
        twin_of(&study, &diagnoser, description.twin.has_fixed_step).map_err(unfit(&file))?;
    let compared = folder.compare(&description, (&diagnoser, &file), (&twin, &place))?;
    let mut evidence = vec![];
    if compared.differences.is_empty() {
        let plan = Plan {
            twin: Some(&twin),
            study: Some(&study),
            samples: (options.hours * 3600.0 / diagnoser.period_s).round() as u64,
            variants: options.variants,
            kept: options.keep.as_deref(),
            ..Plan::new(&diagnoser, &compared.files)
        };
        evidence = proven(&plan, &builds, global)?;
    }
    let certificate = Certificate::new(description, compared, evidence);
    let written = folder.write_certificate(&certificate)?;
    report(options, &certificate, &written, global)
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

/// The output for people or programs.
fn report(
    options: &Options,
    certificate: &Certificate,
    written: &[PathBuf],
    global: Global,
) -> Result<String, Failure> {
    let output = match global {
        Global { json: true, .. } => json(&json!(certificate)),
        Global { quiet: true, .. } if certificate.holds => String::new(),
        Global { quiet: true, .. } => format!("{}\n", certificate.verdict()),
        _ => {
            let paths = written.iter().map(|path| format!("{}\n", path.display()));
            format!("{}{}", text_of(certificate), paths.collect::<String>())
        }
    };
    match certificate.holds {
        true => Ok(output),
        false => Err(Failure::NotProven { folder: options.folder.clone(), output }),
    }
}

/// The evidence for people.
fn text_of(certificate: &Certificate) -> String {
    let mut text = String::new();
    if let Some(first) = certificate.builds.first().filter(|first| first.rows > 0) {
        text += &format!(
            "trees: {} leaves, {} thresholds, {} rows, {} random rows\n\
             twin: {} points, {} variants ({} without a steady state), {} samples\n\
             twin and diagnosis together: {} samples\n",
            first.leaves,
            first.thresholds,
            first.rows,
            first.random_rows,
            first.points,
            first.variants,
            first.unsettled,
            first.twin_samples,
            first.hybrid_samples,
        );
        text += &format!("diagnosis: {} samples\n", first.samples);
    }
    if let Some(first) = certificate.builds.first() {
        let raised = first.raised.iter().map(|(action, count)| format!("{action} {count}"));
        text += &format!("raised on the way: {}\n", raised.collect::<Vec<_>>().join(", "));
    }
    for difference in &certificate.differences {
        text += &format!("  {difference}\n");
    }
    for build in &certificate.builds {
        let verdict = if build.holds() { "same bits" } else { "DIFFERENT" };
        text += &format!("  {verdict}  {}\n", build.command);
        for difference in build.differences.iter().take(3) {
            text += &format!("    {difference}\n");
        }
        if build.leaves_not_reached > 0 {
            text += &format!("    leaves not reached: {}\n", build.leaves_not_reached);
        }
    }
    text + certificate.verdict() + "\n"
}
