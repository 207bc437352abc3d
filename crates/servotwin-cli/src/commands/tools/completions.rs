//! `servotwin tools completions`: completion scripts for shells.

use crate::Cli;
use clap::CommandFactory;
use clap_complete::{Shell, generate};

/// Write a completion script for a shell to standard output.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The shell.
    shell: Shell,
}

/// Returns the script.
pub(crate) fn run(options: &Options) -> String {
    let mut script = Vec::new();
    generate(options.shell, &mut Cli::command(), "servotwin", &mut script);
    String::from_utf8(script).expect("clap writes UTF-8")
}
