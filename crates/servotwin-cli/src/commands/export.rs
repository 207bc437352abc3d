//! `servotwin export`: a trained diagnosis for other programs.

use super::watch::usual_diagnoser;
use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use serde_json::json;
use servotwin::evaluation::model_file;
use servotwin_export::folder::ExportFolder;
use std::path::PathBuf;

/// Write a trained diagnosis as C99 for a flight control computer.
///
/// The C code takes inputs, measured values and the values of the twin sample by sample, and answers as 'servotwin watch'
/// does, bit for bit. It allocates nothing and needs only sqrt and fabs of the C library. 'servotwin prove' compiles it and
/// proves that it decides as it was trained.
#[derive(clap::Args)]
pub struct Options {
    /// The language.
    #[arg(value_name = "LANGUAGE")]
    language: Language,
    /// The diagnoser, a file written by 'servotwin flights' [default: out/diagnoser-realistic.json].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The folder for the C files: a new or empty one, or that of an earlier export.
    #[arg(long, value_name = "FOLDER", default_value = "export")]
    out: PathBuf,
}

/// The languages of an export.
#[derive(clap::ValueEnum, Clone, Copy)]
enum Language {
    /// C99.
    C,
}

/// Returns the text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let file = options.model.clone().unwrap_or_else(usual_diagnoser);
    let diagnoser = model_file::read_diagnoser(&file)?;
    let Language::C = options.language;
    let description = ExportFolder::new(&options.out).write(&diagnoser, &file)?;
    Ok(match global {
        Global { json: true, .. } => json(&json!(description)),
        Global { quiet: true, .. } => String::new(),
        _ => {
            let (out, count) = (options.out.display(), description.files_sha256.len());
            format!("{out}: {count} files; 'servotwin prove {out}' proves them\n")
        }
    })
}
