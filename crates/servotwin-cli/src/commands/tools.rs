//! `servotwin tools`: files for the machine, for editors and for shells.

use crate::failure::Failure;
use crate::{Cli, Global, Run};
use clap::{CommandFactory, Subcommand};
use clap_complete::{Shell, generate};
use servotwin::compiled::cache::{self, VARIABLE};
use servotwin::files::FileError;
use servotwin_view::document::{Document, Value, Verdict, line};

/// Cache of compiled equations, schemas for editors, and shell completions.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    tool: Tool,
}

#[derive(Subcommand)]
enum Tool {
    /// Show the cache of compiled equations, or clear it.
    ///
    /// Long simulations compile the system's equations and keep the result for later runs. The cache is the folder named by
    /// SERVOTWIN_CACHE, or else `servotwin` in your cache folder.
    Cache {
        /// Remove everything in the cache.
        #[arg(long)]
        clear: bool,
    },
    /// Write the JSON Schema (draft 2020-12) of system or study files, for completion and checks in editors.
    Schema {
        /// The file format.
        format: Format,
    },
    /// Write a completion script for a shell to standard output.
    Completions {
        /// The shell.
        shell: Shell,
    },
}

/// A format of files.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Format {
    /// System files.
    System,
    /// Study files.
    Study,
}

impl Run for Options {
    fn run(&self, _: Global) -> Result<Document, Failure> {
        match &self.tool {
            Tool::Cache { clear } => cache(*clear),
            Tool::Schema { format } => Ok(Document::raw(format!(
                "{:#}\n",
                match format {
                    Format::System => servotwin::system::schema(),
                    Format::Study => servotwin::study::schema(),
                }
            ))),
            Tool::Completions { shell } => {
                let mut script = Vec::new();
                generate(*shell, &mut Cli::command(), "servotwin", &mut script);
                Ok(Document::raw(String::from_utf8(script).expect("clap writes UTF-8")))
            }
        }
    }
}

fn cache(is_cleared: bool) -> Result<Document, Failure> {
    let Some(folder) = cache::folder() else {
        let text =
            format!("there is no cache: {VARIABLE} is empty, or no folder for caches is known");
        let mut document = Document::listing("cache", text);
        document.fact("folder", "", None::<&str>);
        return Ok(document);
    };
    let failed = |cause| FileError::from_io(&folder, cause);
    let removed = is_cleared.then(|| cache::clear(&folder)).transpose().map_err(failed)?;
    let libraries = cache::libraries(&folder).map_err(failed)?;
    let bytes = libraries.iter().map(|(_, bytes)| bytes).sum::<u64>();
    let text = match removed {
        Some(_) => "{folder}: {removed} removed",
        None => "{folder}: {libraries} libraries, {bytes}",
    };
    let values = [
        ("folder", (&folder).into()),
        ("libraries", libraries.len().into()),
        ("bytes", Value::of(format!("{:.1} MB", bytes as f64 / 1e6), &bytes)),
        ("removed", removed.into()),
    ];
    Ok(Document::new("cache", Verdict::neutral(line(text, values))))
}
