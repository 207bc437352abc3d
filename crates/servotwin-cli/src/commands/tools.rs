//! `servotwin tools`: files for the machine, for editors and for shells.

mod cache;
mod completions;
mod man;
mod schema;

use crate::Global;
use crate::failure::Failure;
use clap::Subcommand;

/// Cache of compiled equations, schemas for editors, shell completions and manual pages.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    tool: Tool,
}

#[derive(Subcommand)]
enum Tool {
    Cache(cache::Options),
    Schema(schema::Options),
    Completions(completions::Options),
    Man(man::Options),
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    match &options.tool {
        Tool::Cache(options) => cache::run(options, global),
        Tool::Schema(options) => Ok(schema::run(options)),
        Tool::Completions(options) => Ok(completions::run(options)),
        Tool::Man(options) => man::run(options),
    }
}
