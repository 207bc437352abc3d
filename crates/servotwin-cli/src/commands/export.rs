//! `servotwin export`: a trained diagnosis and its twin for other programs.

use super::watch::input::usual_diagnoser;
use super::{find_study, note, recordings};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run};
use servotwin::learn::model_file;
use servotwin::live::runtime::RuntimeError;
use servotwin_export::fmu::{self, Version};
use servotwin_export::folder::ExportFolder;
use servotwin_export::{ExportError, ExportedTwin};
use servotwin_view::document::{Document, Verdict, line};
use servotwin_watch::guard;
use std::path::{Path, PathBuf};

/// Write a trained diagnosis and its virtual twin for a flight control computer.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    target: Target,
}

/// The targets of an export.
#[derive(clap::Subcommand)]
enum Target {
    C(COptions),
    Fmu(FmuOptions),
}

/// Write a system with its faults, or a hybrid twin, as a Functional Mock-up Unit.
///
/// The FMU serves co-simulation and model exchange in any tool with FMI 2.0 or 3.0. Each fault is a tunable parameter from
/// 0 to 1 (fault.COMPONENT.NAME), so the tool can inject it while it simulates. With --model the FMU is the hybrid twin
/// instead: it takes inputs and measured values and returns the diagnosis; it serves co-simulation. The FMU holds C
/// sources and a binary for 64-bit Linux, for which gcc or clang is needed.
#[derive(clap::Args)]
struct FmuOptions {
    /// The study, whose system is exported: a file, a built-in study, or a folder with results [default: that of the
    /// folder of the diagnoser, or paper].
    #[arg(value_name = "STUDY")]
    study: Option<PathBuf>,
    /// Export the hybrid twin with this diagnoser, a file written by 'servotwin study --suite flights'.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The version of the Functional Mock-up Interface.
    #[arg(long, value_name = "VERSION", default_value = "2",
          value_parser = super::one_of(Version::ALL, Version::name))]
    fmi: Version,
    /// The file of the FMU [default: the name of the system, with the ending .fmu].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Write them as C99.
///
/// The C code takes inputs and measured values sample by sample, and answers as 'servotwin watch' does, bit for bit. It
/// allocates nothing and needs only sqrt, fabs, memcpy and memset of the C library. 'servotwin prove' compiles it and
/// proves that it decides as it was trained. Of a diagnoser of recordings, the decision tree is written: it
/// takes the features of a window.
#[derive(clap::Args)]
struct COptions {
    /// The diagnoser, a file written by 'servotwin study --suite flights' [default: out/diagnoser-realistic.json].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The study, whose system is the twin: a file, a built-in study, or a folder with results [default: that of the
    /// folder of the diagnoser, or paper].
    #[arg(long, value_name = "STUDY")]
    study: Option<PathBuf>,
    /// Simulate the twin in steps of 1 ms, each with the same work, instead of steps under error control, with which the
    /// diagnosis was trained.
    #[arg(long)]
    fixed_step: bool,
    /// The folder for the C files: a new or empty one, or that of an earlier export.
    #[arg(long, value_name = "FOLDER", default_value = "export")]
    out: PathBuf,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        match &self.target {
            Target::C(options) => {
                let file = options.model.clone().unwrap_or_else(usual_diagnoser);
                Paths::default().read("the diagnoser", [file])
            }
            Target::Fmu(options) => Paths::default()
                .read("the diagnoser", options.model.clone())
                .write("--out", Format::Any, &options.out),
        }
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        match &self.target {
            Target::C(options) => write_c(options, global),
            Target::Fmu(options) => write_fmu(options),
        }
    }
}

fn write_fmu(options: &FmuOptions) -> Result<Document, Failure> {
    let file = options.model.as_deref();
    let diagnoser = file.map(model_file::read_diagnoser).transpose()?;
    let place = options.study.clone().or_else(|| file.map(study_beside));
    let study = find_study(place.as_deref())?;
    let twin = match diagnoser.as_ref().zip(file) {
        Some((diagnoser, file)) => {
            ExportedTwin::beside(&study, diagnoser, false).map_err(unfit(file))?
        }
        None => ExportedTwin::alone(&study).map_err(ExportError::from)?,
    };
    let name = study.system.name.as_str();
    let out = options.out.clone().unwrap_or_else(|| format!("{name}.fmu").into());
    let title = (name, study.system.title.as_str());
    let variables = fmu::write(&twin, diagnoser.as_ref(), options.fmi, title, &out)?;
    let values = [("file", (&out).into()), ("variables", variables.into())];
    Ok(Document::new("export", Verdict::good(line("{file}: {variables} variables", values))))
}

/// Writes a diagnosis and its twin to a folder.
fn write_c(options: &COptions, global: Global) -> Result<Document, Failure> {
    let file = options.model.clone().unwrap_or_else(usual_diagnoser);
    let diagnoser = model_file::read_diagnoser(&file)?;
    if diagnoser.recorded.is_some() {
        return recordings::export((&diagnoser, &file), &options.out);
    }
    guard::of_records(&diagnoser).iter().for_each(|text| note(global, text));
    let place = options.study.clone().unwrap_or_else(|| study_beside(&file));
    let study = find_study(Some(&place))?;
    let twin = ExportedTwin::beside(&study, &diagnoser, options.fixed_step);
    let twin = twin.map_err(unfit(&file))?;
    let written = ExportFolder::new(&options.out).write((&diagnoser, &file), (&twin, &place))?;
    let values = [("folder", (&options.out).into()), ("files", written.files_sha256.len().into())];
    let verdict = line("{folder}: {files} files; 'servotwin prove {folder}' proves them", values);
    let mut document = Document::new("export", Verdict::good(verdict));
    document.data("description", &written);
    Ok(document)
}

/// The study of a diagnoser: the folder that it lies in, if that holds one.
pub(crate) fn study_beside(diagnoser: &Path) -> PathBuf {
    let file = std::path::absolute(diagnoser).unwrap_or_else(|_| diagnoser.into());
    let folder = file.parent().unwrap_or(Path::new(""));
    let holds_study = folder.join("study.toml").exists();
    if holds_study { folder.into() } else { "paper".into() }
}

/// The failure of a diagnoser that does not fit its study.
pub(crate) fn unfit(file: &Path) -> impl Fn(RuntimeError) -> Failure {
    move |error| Failure::of_diagnoser(file, &error)
}
