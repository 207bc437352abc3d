//! `servotwin tools man`: manual pages.

use crate::Cli;
use crate::failure::Failure;
use clap::CommandFactory;
use clap_mangen::Man;

/// Write the manual page of the program, or of one of its commands, to standard output.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The command [default: the program as a whole].
    command: Option<String>,
}

/// Returns the page.
pub(crate) fn run(options: &Options) -> Result<String, Failure> {
    let mut cli = Cli::command();
    cli.build();
    let page = match &options.command {
        None => cli,
        Some(name) => {
            let known = cli.get_subcommands().map(|c| c.get_name().to_owned()).collect();
            let unknown = || Failure::NoCommand { word: name.clone(), known };
            cli.find_subcommand(name).cloned().ok_or_else(unknown)?
        }
    };
    let mut text = Vec::new();
    Man::new(page).render(&mut text).expect("writing to memory does not fail");
    Ok(String::from_utf8(text).expect("clap writes UTF-8"))
}
