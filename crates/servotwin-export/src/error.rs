//! What can go wrong while a diagnoser is exported or an export is proven.

use servotwin::live::runtime::RuntimeError;
use servotwin_io::files::FileError;
use std::path::{Path, PathBuf};

/// A diagnoser that cannot be exported, or an export that cannot be proven.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum ExportError {
    /// A stage has a classifier without a counterpart in an export.
    #[error("stage {stage} is '{kind}'; the export knows decision trees (CART) and boosted trees")]
    Classifier { stage: String, kind: &'static str },
    /// A stage is too large for the integers of its tables.
    #[error("stage {stage} has {count} {what}; the export takes at most {most}")]
    TooMany { stage: String, what: &'static str, count: usize, most: usize },
    /// Part of the diagnosis has no counterpart in an export yet.
    #[error("{0}")]
    Unsupported(&'static str),
    /// The diagnoser does not fit together.
    #[error(transparent)]
    Diagnosis(#[from] servotwin_diagnosis::Error),
    /// The diagnoser does not belong to the study.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder holds something else than an export.
    #[error("{}: this folder holds other files; name an empty folder, or that of an earlier export", .0.display())]
    FolderInUse(PathBuf),
    /// The folder holds no export.
    #[error("{}: there is no export here; 'servotwin export c --out {}' writes one", .0.display(), .0.display())]
    NoExport(PathBuf),
    /// The description of an export cannot be read.
    #[error("{}: this describes no export ({cause}): export to an empty folder", path.display())]
    Damaged { path: PathBuf, cause: serde_json::Error },
    /// There is no C compiler to prove anything with.
    #[error("neither gcc nor clang starts: install one of them")]
    NoBuild,
    /// The compiler does not start.
    #[error("the compiler '{compiler}' does not start: {cause}")]
    NoCompiler { compiler: String, cause: std::io::Error },
    /// The compiler refuses the text.
    #[error("the compiler '{compiler}' refuses the exported text:\n{messages}")]
    Refused { compiler: String, messages: String },
    /// The compiled code cannot be loaded.
    #[error("the compiled export cannot be loaded: {0}")]
    Load(#[from] libloading::Error),
}

impl ExportError {
    /// A path that cannot be read or written.
    pub(crate) fn from_io(path: &Path, cause: std::io::Error) -> Self {
        FileError::from_io(path, cause).into()
    }
}
