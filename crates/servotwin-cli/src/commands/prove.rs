//! `servotwin prove`: an export decides as its diagnoser was trained to.

use super::export::{study_beside, twin_of, unfit};
use super::find_study;
use super::progress::Stages;
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::evaluation::model_file;
use servotwin_export::certificate::Certificate;
use servotwin_export::folder::ExportFolder;
use servotwin_export::prove::{Build, Plan, ProofEvidence, SingleEvidence, prove, prove_single};
use servotwin_export::{ExportError, Precision};
use std::path::PathBuf;
use std::sync::Arc;

/// The number of flights beside an export in single precision.
const FLIGHTS: u64 = 100;

/// Compile an export and prove that it decides as it was trained.
///
/// First the text of every file, its hashes and the twin are compared with what is exported for the diagnoser. Then each
/// build (gcc and clang, as far as they are installed, with -O0, -O2 and -O3) is compared bit by bit with the
/// diagnoser: every leaf of every tree, both sides of every threshold, missing values at every test, and random samples
/// through the whole chain with lost sensors, wrong inputs and commands of the flight control computer. The twin is compared
/// with that of the toolkit over variants with random faults. The certificate is written beside the files, as proof.json
/// and proof.html.
///
/// An export in single precision rounds differently than in training. Its trees must decide as they were trained for every
/// row of single precision, its builds must give the same bits, and its hand-written text must give the bits of training
/// in double precision. precision.csv lists what it decides differently, over the samples and over flights with faults.
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
    /// The number of flights beside an export in single precision [default: 100].
    #[arg(long, value_name = "NUMBER")]
    flights: Option<u64>,
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
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
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
    let flights = flights(options, description.precision)?;
    let exported = description.twin.as_ref();
    let place = match (exported, flights) {
        (Some(twin), _) => Some(twin.study.clone()),
        (None, 1..) => Some(study_beside(&file)),
        (None, 0) => None,
    };
    let place = place.map(|place| options.study.clone().unwrap_or(place));
    let study = place.map(|place| find_study(Some(&place)).map(|study| (study, place)));
    let study = study.transpose()?;
    let twin = study.as_ref().zip(exported).map(|((study, _), exported)| {
        twin_of(study, &diagnoser, exported.has_fixed_step).map_err(unfit(&file))
    });
    let twin = twin.transpose()?;
    let place = study.as_ref().map(|(_, place)| place.as_path());
    let whole = (&*diagnoser, file.as_path());
    let compared = folder.compare(&description, whole, twin.as_ref().zip(place))?;
    let (mut evidence, mut single) = (vec![], None);
    if compared.differences.is_empty() {
        let plan = Plan {
            twin: twin.as_ref(),
            study: study.as_ref().map(|(study, _)| study),
            precision: description.precision,
            samples: (options.hours * 3600.0 / diagnoser.period_s).round() as u64,
            variants: options.variants,
            kept: options.keep.as_deref(),
            ..Plan::new(&diagnoser, &compared.files)
        };
        (evidence, single) = proven(&plan, &builds, flights, global)?;
    }
    let certificate = Certificate::new(description, compared, evidence, single);
    let written = folder.write_certificate(&certificate)?;
    report(options, &certificate, &written, global)
}

/// Compiles and compares. A compiler that refuses the text is evidence too.
fn proven(
    plan: &Plan,
    builds: &[Build],
    flights: u64,
    global: Global,
) -> Result<(Vec<ProofEvidence>, Option<SingleEvidence>), ExportError> {
    let stages = Stages::new(global);
    let tell = &mut |what: &str, share| stages.show(what, share);
    let proven = match plan.precision {
        Precision::F64 => prove(plan, builds, tell).map(|evidence| (evidence, None)),
        Precision::F32 => prove_single(plan, builds, flights, tell)
            .map(|(evidence, single)| (evidence, Some(single))),
    };
    stages.end();
    match proven {
        Err(ExportError::Refused { compiler, messages }) => {
            Ok((vec![ProofEvidence::refused(&compiler, &messages)], None))
        }
        proven => proven,
    }
}

/// The number of flights, which an export in single precision alone needs.
fn flights(options: &Options, precision: Precision) -> Result<u64, ExportError> {
    match (precision, options.flights) {
        (Precision::F32, flights) => Ok(flights.unwrap_or(FLIGHTS)),
        (Precision::F64, None) => Ok(0),
        (Precision::F64, Some(_)) => Err(ExportError::Unsupported(
            "an export in double precision decides as it was trained in every flight: leave '--flights' out",
        )),
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
    }
    text += &decisions_text(certificate);
    if let Some(first) = certificate.builds.first().filter(|_| certificate.single.is_none()) {
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

/// What single precision decides differently.
fn decisions_text(certificate: &Certificate) -> String {
    let Some(single) = &certificate.single else { return String::new() };
    let lines = |title: &str, rows: Vec<(&str, String)>| {
        let rows = rows.iter().map(|(name, count)| format!("  {name}: {count}\n"));
        format!("{title} in single precision beside training\n{}", rows.collect::<String>())
    };
    let flights = single.flights.iter().map(|flights| lines("flights", flights.rows()));
    lines("random samples", single.chain.rows()) + &flights.collect::<String>()
}
