//! Compilers, and a folder in which they work.

use crate::error::ExportError;
use crate::source_file::SourceFile;
use servotwin_io::files::create_folder;
use servotwin_io::leftovers::TemporaryFolder;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Whether a compiler is installed.
fn starts(compiler: &str) -> bool {
    let run = Command::new(compiler).arg("--version").output();
    run.is_ok_and(|output| output.status.success())
}

/// The C compilers that are installed.
pub(crate) fn compilers() -> impl Iterator<Item = &'static str> {
    ["gcc", "clang"].into_iter().filter(|compiler| starts(compiler))
}

/// The names of the files that are compiled.
pub(crate) fn compiled<'f>(
    files: impl IntoIterator<Item = &'f SourceFile>,
) -> impl Iterator<Item = &'static str> {
    files.into_iter().map(|file| file.name).filter(|name| name.ends_with(".c"))
}

/// A folder with source files, which goes with this value unless it is to be kept.
pub(crate) struct Workplace {
    path: PathBuf,
    _temporary: Option<TemporaryFolder>,
}

impl Workplace {
    /// A folder with these files: `kept`, or a temporary one.
    pub(crate) fn new<'f>(
        files: impl IntoIterator<Item = &'f SourceFile>,
        kept: Option<&Path>,
    ) -> Result<Self, ExportError> {
        let workplace = match kept {
            Some(path) => Workplace { path: path.into(), _temporary: None },
            None => {
                let folder = TemporaryFolder::new()
                    .map_err(|cause| ExportError::from_io(&std::env::temp_dir(), cause))?;
                Workplace { path: folder.path().into(), _temporary: Some(folder) }
            }
        };
        create_folder(&workplace.path)?;
        files.into_iter().try_for_each(|file| workplace.write(file.name, &file.text))?;
        Ok(workplace)
    }

    /// The path of a file.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file.
    pub(crate) fn write(&self, name: &str, text: &str) -> Result<(), ExportError> {
        let path = self.path(name);
        fs::write(&path, text).map_err(|cause| ExportError::from_io(&path, cause))
    }

    /// Reads a file.
    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, ExportError> {
        let path = self.path(name);
        fs::read(&path).map_err(|cause| ExportError::from_io(&path, cause))
    }

    /// Runs a compiler in the folder. `shown` is its command for messages.
    pub(crate) fn run<'a>(
        &self,
        compiler: &str,
        shown: &str,
        arguments: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), ExportError> {
        let mut command = Command::new(compiler);
        command.current_dir(&self.path).args(arguments);
        let no_compiler = |cause| ExportError::NoCompiler { compiler: compiler.into(), cause };
        let output = command.output().map_err(no_compiler)?;
        if output.status.success() {
            return Ok(());
        }
        let all = String::from_utf8_lossy(&output.stderr);
        let messages = all.lines().take(10).collect::<Vec<_>>().join("\n");
        Err(ExportError::Refused { compiler: shown.into(), messages })
    }
}
