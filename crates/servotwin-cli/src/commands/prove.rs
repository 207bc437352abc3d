//! `servotwin prove`: an export decides as its diagnoser was trained to.

use super::export::{twin_of, unfit};
use super::find_study;
use super::progress::Stages;
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::evaluation::model_file;
use servotwin_export::certificate::Certificate;
use servotwin_export::folder::ExportFolder;
use servotwin_export::prove::{Build, Mistakes, Plan, Vectors, Work, WorstPath, mutants, prove};
use servotwin_export::{ExportError, Language, SourceFile};
use std::path::PathBuf;
use std::sync::Arc;

/// The number of sequences of samples that are tried for the most work.
const TRIALS: u64 = 300;

/// Compile an export and prove that it decides as it was trained.
///
/// Each build (gcc and clang, as far as they are installed, with -O0, -O2 and -O3; cargo for an export as Rust) is
/// compared bit by bit with the diagnoser: every leaf of every tree, both sides of every threshold, missing values at every
/// test, and random samples through the whole chain with lost sensors, wrong inputs and commands of the flight control
/// computer. The twin is compared with that of the toolkit over variants with random faults. The certificate is written
/// beside the files, as proof.json and proof.html. It also bounds the work of one sample; worst_path.csv has samples that
/// come near the bound.
#[derive(clap::Args)]
pub struct Options {
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
    /// Also make this many mistakes in the exported text, one at a time, and prove that each is found.
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    mutants: usize,
    /// Also search this many sequences for samples that show modified condition/decision coverage (MC/DC) of the
    /// hand-written code of an export as C, such as 400: mcdc.csv has commands, samples and outcomes, and
    /// mcdc_decisions.csv names the samples for each condition.
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    vectors: u64,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|hours: &f64| (0.0..=10_000.0).contains(hours));
    hours.ok_or_else(|| "a number from 0 to 10000, such as 24".into())
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let folder = ExportFolder::new(&options.folder);
    let description = folder.description()?;
    let file = options.model.clone().unwrap_or_else(|| description.diagnoser.clone());
    let diagnoser = Arc::new(model_file::read_diagnoser(&file)?);
    let files = folder.files(&description, &file)?;
    let builds = match description.language {
        Language::C => Build::available(),
        Language::Rust => Build::rust(),
    };
    let first = builds.first().ok_or(match description.language {
        Language::C => ExportError::NoBuild,
        Language::Rust => ExportError::NoRust,
    })?;
    if options.vectors > 0 {
        Vectors::check(first)?;
    }
    let mistakes = Mistakes { count: options.mutants, seed: 1, only: None };
    let exported = description.twin.as_ref();
    let study = exported.map(|twin| {
        let place = options.study.clone().unwrap_or_else(|| twin.study.clone());
        find_study(Some(&place)).map(|study| (study, place))
    });
    let study = study.transpose()?;
    let twin = study.as_ref().zip(exported).map(|((study, place), exported)| {
        let twin = twin_of(study, &diagnoser, exported.has_fixed_step).map_err(unfit(&file))?;
        folder.check_system(exported, &twin, place)?;
        Ok::<_, Failure>(twin)
    });
    let twin = twin.transpose()?;
    let stages = Stages::new(global);
    stages.show("looking for the most work", 0.0);
    let worst_path = WorstPath::find(&diagnoser, TRIALS)?;
    let mut plan = Plan {
        twin: twin.as_ref(),
        study: study.as_ref().map(|(study, _)| study),
        samples: (options.hours * 3600.0 / diagnoser.period_s).round() as u64,
        variants: options.variants,
        worst_path: Some(&worst_path),
        ..Plan::new(&diagnoser, &files)
    };
    let vectors = (options.vectors > 0).then(|| {
        Vectors::find(&plan, first, options.vectors, &mut |done| {
            stages.show("looking for MC/DC", done as f64 / options.vectors as f64);
        })
    });
    let vectors = vectors.transpose()?;
    plan.vectors = vectors.as_ref();
    let evidence = prove(&plan, &builds, &mut |what, share| stages.show(what, share))?;
    let mutants = mutants(&plan, first, mistakes, &mut |done| {
        stages.show("making mistakes", done as f64 / options.mutants.max(1) as f64);
    })?;
    stages.end();
    let hashes = SourceFile::hashes(&files);
    let certificate = Certificate::new(description, hashes, evidence, mutants, worst_path, vectors);
    let written = folder.write_certificate(&certificate, &diagnoser)?;
    let output = match global {
        Global { json: true, .. } => json(&json!(certificate)),
        Global { quiet: true, .. } => String::new(),
        _ => {
            let paths = written.iter().map(|path| format!("{}\n", path.display()));
            let paths = paths.collect::<String>();
            format!("{}{paths}", text_of(&certificate))
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
    if let Some(first) = certificate.builds.first() {
        text += &format!(
            "trees: {} leaves, {} thresholds, {} rows, {} random rows\n",
            first.leaves, first.thresholds, first.rows, first.random_rows,
        );
        if certificate.export.twin.is_some() {
            text += &format!(
                "twin: {} points, {} variants ({} without a steady state), {} samples\n\
                 twin and diagnosis together: {} samples\n",
                first.points,
                first.variants,
                first.unsettled,
                first.twin_samples,
                first.hybrid_samples,
            );
        }
        text += &format!("diagnosis: {} samples\n", first.samples);
        let raised = first.raised.iter().map(|(action, count)| format!("{action} {count}"));
        text += &format!("raised on the way: {}\n", raised.collect::<Vec<_>>().join(", "));
    }
    text += &worst_path_text(&certificate.worst_path);
    text += &certificate.vectors.as_ref().map(vectors_text).unwrap_or_default();
    for build in &certificate.builds {
        let verdict = if build.holds() { "same bits" } else { "DIFFERENT" };
        text += &format!("  {verdict}  {}\n", build.command);
        for difference in build.differences.iter().take(3) {
            text += &format!("    {}: {}\n", difference.place, difference.what);
        }
        if build.leaves_not_reached > 0 {
            text += &format!("    leaves not reached: {}\n", build.leaves_not_reached);
        }
    }
    if certificate.mutants > 0 {
        let found = certificate.mutants - certificate.mutants_not_found.len();
        text += &format!("{found} of {} mistakes found\n", certificate.mutants);
    }
    text
}

fn vectors_text(vectors: &Vectors) -> String {
    let Vectors { decisions, conditions, shown, sequences, samples, open, .. } = vectors;
    let known = open.iter().filter(|condition| condition.reason.is_some()).count();
    format!(
        "MC/DC: {shown} of {conditions} conditions in {decisions} decisions are shown by {samples} samples in {sequences} \
         sequences; {known} cannot be shown, {} were not found\n",
        open.len() - known
    )
}

fn worst_path_text(worst_path: &WorstPath) -> String {
    let WorstPath { bound, reached, samples, trials, .. } = worst_path;
    let text = |Work { tests, windows, rows, panes }: &Work| {
        format!(
            "{tests} tests of trees, {windows} windows judged, {rows} rows of features, {panes} panes merged"
        )
    };
    format!(
        "most work of one sample: at most {}\n  reached after {samples} samples (best of {trials} sequences): {}\n",
        text(bound),
        text(reached)
    )
}
