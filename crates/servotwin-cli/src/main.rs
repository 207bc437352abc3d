//! The command line of servotwin.
//!
//! Results go to standard output, everything else to standard error. If a reader
//! closes the pipe early, the program ends quietly. Exit codes:
//!
//! | code | meaning |
//! |---|---|
//! | 0 | success |
//! | 1 | the run failed, or a result could not be written |
//! | 2 | wrong usage: an option, a signal, a name that the system does not have |
//! | 3 | a system file (or another input file) is missing or has mistakes |
//! | 130 | stopped by Ctrl-C or another request to end; no file was left half-written |

mod commands;
mod failure;
mod hint;
mod out;
mod paths;
mod render;
mod stop;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
#[cfg(feature = "serve")]
use commands::serve;
use commands::{
    catalog, check, describe, export, fault_tree, features, fit, fly, fmea, history, init, prove,
    report, run, sensors, simulate, study, test, tools, watch, worst_case,
};
use failure::Failure;
use paths::Paths;
use servotwin::compiled::{self, Policy};
use servotwin::sanitize;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// Hybrid twins of electro-hydraulic servo actuators.
#[derive(Parser)]
#[command(name = "servotwin", version, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Options of every command.
#[derive(clap::Args, Clone, Copy)]
pub(crate) struct Global {
    /// Write the result as JSON, with numbers in SI units.
    #[arg(long, global = true)]
    json: bool,
    /// Write no progress, no notes, and no summary of what the command ran, checked or wrote to files.
    #[arg(long, short, global = true)]
    quiet: bool,
    /// When to compile the equations with the C compiler: where it saves time (auto, the default), never, or always
    /// (only). With only, a failed compilation ends the run. The results are the same.
    #[arg(
        long,
        global = true,
        value_name = "WHEN",
        default_value = "auto",
        hide_default_value = true
    )]
    compile: Compile,
    /// Check the options and the paths, then end. The tests of the book use it.
    #[arg(long, global = true, hide = true)]
    dry_run: bool,
}

/// When equations are compiled.
#[derive(clap::ValueEnum, Clone, Copy)]
enum Compile {
    Auto,
    Never,
    Only,
}

impl Compile {
    /// Applies to the whole process.
    fn set(self, is_quiet: bool) {
        compiled::set_policy(match self {
            Compile::Auto => Policy::Auto,
            Compile::Never => Policy::Never,
            Compile::Only => Policy::Only,
        });
        match self {
            Compile::Only => compiled::report_problems(|problem| {
                let _ = writeln!(out::stderr(), "{problem} (--compile only)");
                std::process::exit(1);
            }),
            _ if is_quiet => {}
            _ => compiled::report_problems(|problem| {
                let _ = writeln!(out::stderr(), "warning: {problem}");
            }),
        }
    }
}

const EXIT_CODES: &str = "Exit codes: 0 success, 1 the run failed, 2 wrong usage, \
    3 an input file is missing or has mistakes, 130 stopped by Ctrl-C or another request to end.";

/// The groups of commands in the help, each with the command that it begins with.
const GROUPS: [(&str, &str); 6] = [
    ("Model", "catalog"),
    ("Study", "study"),
    ("Operation", "fly"),
    ("Safety", "fmea"),
    ("Export", "export"),
    ("Tools", "tools"),
];

const START: &str = "\
Start here:
  servotwin fly              a fault, its evidence and the verdict, within seconds
  servotwin watch LOG        diagnose a record of your own
  servotwin study            train and evaluate a diagnosis: the paper's, or that of your own study
";

/// The commands, in the groups of the help.
#[derive(Subcommand)]
enum Command {
    Catalog(catalog::Options),
    Init(init::Options),
    Check(check::Options),
    Describe(describe::Options),
    Simulate(Box<simulate::Options>),

    Study(study::Options),
    Run(run::Options),
    Report(report::Options),

    Fly(Box<fly::Options>),
    Watch(Box<watch::Options>),
    #[cfg(feature = "serve")]
    Serve(Box<serve::Options>),
    Test(test::Options),
    Fit(fit::Options),
    History(history::Options),
    Features(features::Options),

    Fmea(fmea::Options),
    FaultTree(fault_tree::Options),
    Sensors(sensors::Options),
    WorstCase(worst_case::Options),

    Export(export::Options),
    Prove(prove::Options),

    Tools(tools::Options),
}

impl Command {
    /// The files that the command reads and writes, if the user names its outputs. Commands that write into a folder of
    /// results check its files themselves.
    fn paths(&self) -> Paths {
        match self {
            Command::Simulate(options) => options.paths(),
            Command::Features(options) => options.paths(),
            Command::Fit(options) => options.paths(),
            Command::History(options) => options.paths(),
            Command::Watch(options) => options.paths(),
            #[cfg(feature = "serve")]
            Command::Serve(options) => options.paths(),
            Command::Fmea(options) => options.paths(),
            Command::FaultTree(options) => options.paths(),
            Command::Sensors(options) => options.paths(),
            Command::Export(options) => options.paths(),
            Command::Describe(options) => options.paths(),
            _ => Paths::default(),
        }
    }

    /// Returns the text for standard output.
    fn run(&self, global: Global) -> Result<String, Failure> {
        match self {
            Command::Catalog(options) => catalog::run(options, global),
            Command::Init(options) => init::run(options, global),
            Command::Check(options) => check::run(options, global),
            Command::Describe(options) => describe::run(options, global),
            Command::Simulate(options) => simulate::run(options, global),
            Command::Study(options) => study::run(options, global),
            Command::Run(options) => run::run(options, global),
            Command::Report(options) => report::run(options, global),
            Command::Fly(options) => fly::run(options, global),
            Command::Watch(options) => watch::run(options, global),
            #[cfg(feature = "serve")]
            Command::Serve(options) => serve::run(options, global),
            Command::Test(options) => test::run(options, global),
            Command::Fit(options) => fit::run(options, global),
            Command::History(options) => history::run(options, global),
            Command::Features(options) => features::run(options, global),
            Command::Fmea(options) => fmea::run(options, global),
            Command::FaultTree(options) => fault_tree::run(options, global),
            Command::Sensors(options) => sensors::run(options, global),
            Command::WorstCase(options) => worst_case::run(options, global),
            Command::Export(options) => export::run(options, global),
            Command::Prove(options) => prove::run(options, global),
            Command::Tools(options) => tools::run(options, global),
        }
    }
}

/// The command line with its commands in groups.
fn command_line() -> clap::Command {
    let command = Cli::command();
    let mut groups = String::new();
    for own in command.get_subcommands() {
        let name = own.get_name();
        if let Some((group, _)) = GROUPS.iter().find(|(_, first)| *first == name) {
            groups += &format!("\n{group}\n");
        }
        let about = own.get_about().map(ToString::to_string).unwrap_or_default();
        groups += &format!("  {name:<11} {about}\n");
    }
    let template = format!(
        "{{about}}\n\n{{usage-heading}} {{usage}}\n\n{START}{groups}\nOptions:\n{{options}}{{after-help}}"
    );
    command.help_template(template)
}

fn main() -> ExitCode {
    stop::listen();
    report_full_files();
    let cli =
        Cli::from_arg_matches(&command_line().get_matches()).unwrap_or_else(|error| error.exit());
    cli.global.compile.set(cli.global.quiet);
    let paths = cli.command.paths();
    paths.remove_leftovers();
    let outcome = paths.check().and_then(|()| match cli.global.dry_run {
        true => Ok(()),
        false => cli.command.run(cli.global).and_then(|text| print(&text)),
    });
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if let Failure::NoUpdate { output, .. }
            | Failure::Alarm { output, .. }
            | Failure::SinksLost { output, .. }
            | Failure::NotProven { output, .. }
            | Failure::Unjudged { output, .. } = &failure
            {
                let _ = print(output);
            }
            // If standard error is closed too, there is no way to report that.
            for line in failure.to_string().lines() {
                let _ = writeln!(out::stderr(), "{}", sanitize::clip(line.into()));
            }
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Lets a write beyond the limit on the size of files (`ulimit -f`) fail as on a full disk, instead of ending the
/// program by a signal.
fn report_full_files() {
    // SAFETY: no handler is installed; the signal is ignored before any thread starts.
    #[cfg(unix)]
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

/// Writes a result. A closed pipe is no failure.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = out::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::Print(error)),
        _ => Ok(()),
    }
}
