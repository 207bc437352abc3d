//! C compilers, and a temporary folder in which they work.

use crate::c::CFile;
use crate::error::ExportError;
use servotwin_io::files::FileError;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// The C compilers that are installed.
pub(crate) fn compilers() -> impl Iterator<Item = &'static str> {
    let starts = |compiler: &&str| {
        let run = Command::new(compiler).arg("--version").output();
        run.is_ok_and(|output| output.status.success())
    };
    ["gcc", "clang"].into_iter().filter(starts)
}

/// A temporary folder with C files.
pub(crate) struct Workplace(TempDir);

impl Workplace {
    /// A folder with these files.
    pub fn new<'f>(files: impl IntoIterator<Item = &'f CFile>) -> Result<Self, ExportError> {
        let folder = tempfile::tempdir().map_err(|cause| problem(&std::env::temp_dir(), cause))?;
        let workplace = Workplace(folder);
        files.into_iter().try_for_each(|file| workplace.write(file.name, &file.text))?;
        Ok(workplace)
    }

    /// The path of a file.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) -> Result<(), ExportError> {
        let path = self.path(name);
        fs::write(&path, text).map_err(|cause| problem(&path, cause))
    }

    /// Reads a file.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, ExportError> {
        let path = self.path(name);
        fs::read(&path).map_err(|cause| problem(&path, cause))
    }

    /// Runs a compiler in the folder. `shown` is its command for messages.
    pub fn run<'a>(
        &self,
        compiler: &str,
        shown: &str,
        arguments: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), ExportError> {
        let mut command = Command::new(compiler);
        command.current_dir(self.0.path()).args(arguments);
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

fn problem(path: &Path, cause: std::io::Error) -> ExportError {
    FileError::from_io(path, cause).into()
}
