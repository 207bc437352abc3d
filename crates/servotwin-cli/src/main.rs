//! The command line of servotwin.
//!
//! Results go to standard output, everything else to standard error. If a reader
//! closes the pipe early, the program ends quietly. Exit codes:
//!
//! | code | meaning |
//! |---|---|
//! | 0 | success |
//! | 1 | the run failed, a result could not be written, or the result calls for a person |
//! | 2 | wrong usage: an option, a signal, a name that the system does not have |
//! | 3 | a system file (or another input file) is missing or has mistakes |
//! | 130 | stopped by Ctrl-C or another request to end; no file was left half-written |

mod commands;
mod failure;
mod out;
mod paths;
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
use servotwin_view::document::{Call, Document, Form, Verdict};
use servotwin_view::render;
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
    /// Show everything that the command found, not only the beginning.
    #[arg(long, global = true, conflicts_with_all = ["json", "quiet"])]
    details: bool,
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

const EXIT_CODES: &str = "Exit codes: 0 success, 1 the run failed or its result calls for a person, 2 wrong usage, \
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

/// What every command does.
trait Run {
    /// The files that the command reads and writes, if the user names its outputs. Commands that write into a folder of
    /// results check its files themselves.
    fn paths(&self) -> Paths {
        Paths::default()
    }

    /// Runs the command. Its result is printed by [`main`].
    ///
    /// # Errors
    /// The command cannot be run to its end.
    fn run(&self, global: Global) -> Result<Document, Failure>;
}

impl Command {
    fn chosen(&self) -> &dyn Run {
        match self {
            Command::Catalog(options) => options,
            Command::Init(options) => options,
            Command::Check(options) => options,
            Command::Describe(options) => options,
            Command::Simulate(options) => &**options,
            Command::Study(options) => options,
            Command::Run(options) => options,
            Command::Report(options) => options,
            Command::Fly(options) => &**options,
            Command::Watch(options) => &**options,
            #[cfg(feature = "serve")]
            Command::Serve(options) => &**options,
            Command::Test(options) => options,
            Command::Fit(options) => options,
            Command::History(options) => options,
            Command::Features(options) => options,
            Command::Fmea(options) => options,
            Command::FaultTree(options) => options,
            Command::Sensors(options) => options,
            Command::WorstCase(options) => options,
            Command::Export(options) => options,
            Command::Prove(options) => options,
            Command::Tools(options) => options,
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
    let Cli { global, command } =
        Cli::from_arg_matches(&command_line().get_matches()).unwrap_or_else(|error| error.exit());
    global.compile.set(global.quiet);
    let command = command.chosen();
    let paths = command.paths();
    paths.remove_leftovers();
    let outcome = paths.check().and_then(|()| match global.dry_run {
        true => Ok(0),
        false => {
            let mut document = command.run(global)?;
            warn_of(&mut document, global);
            print(&rendered(&document, global)).map(|()| document.exit_code)
        }
    });
    ExitCode::from(outcome.unwrap_or_else(|failure| tell(&failure, global.json).exit_code))
}

/// A result for its reader.
fn rendered(document: &Document, global: Global) -> String {
    match &document.verdict {
        _ if global.json => render::json(document),
        Some(Verdict { call: Call::Act, line }) if global.quiet => format!("{}\n", line.text),
        _ if global.quiet && document.form != Form::Listing => String::new(),
        _ => render::terminal(document, global.details, out::columns()),
    }
}

/// Writes a verdict to standard error if it calls for a person, and standard output is for programs or the input is at
/// fault.
fn warn_of(document: &mut Document, global: Global) {
    let is_input = document.exit_code > 1;
    if let Some(Verdict { call: Call::Act, line }) = &document.verdict
        && (global.json || is_input)
    {
        let _ = writeln!(out::stderr(), "{}", sanitize::clip(line.text.clone()));
        if !global.json {
            document.verdict = None;
        }
    }
}

/// Writes a failure for people, and for programs that want JSON.
fn tell(failure: &Failure, is_json: bool) -> &Failure {
    if is_json {
        let _ = print(&render::json(&failure.document()));
    }
    // If standard error is closed too, there is no way to report that.
    for line in failure.message.lines() {
        let _ = writeln!(out::stderr(), "{}", sanitize::clip(line.into()));
    }
    failure
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
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::work(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}
