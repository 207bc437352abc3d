//! `servotwin worst-case`: searches the flights in which the diagnosis is closest to an error.

use super::flights::with_crew;
use super::scenario_of;
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::flight::worst_case::{SearchObjective, SearchOutcome};
use servotwin::job::{Among, Folder};
use servotwin_report::words::number;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::worst_case::finding_line::FindingLine;
use servotwin_safety::worst_case::summary::{MethodSummary, ObjectiveSummary, WorstCaseFinding};
use servotwin_safety::worst_case::{MAX_RUNS, WorstCaseSearch, replay, stored_line};
use std::fmt::Write;
use std::path::PathBuf;

/// Search the worst case: the flights in which the diagnosis is closest to an error.
///
/// Command, load, air speed, pressures, temperatures, tolerances, fault and onset are searched for the shutdown of a
/// healthy actuator, the missed shutdown, the false alarm and the largest transient, with the diagnoser in the folder.
/// As many random flights are flown for comparison. Every finding is said in words, and --replay flies it again. The
/// command ends with what was not searched. It writes safety/worst-case.csv with every flight,
/// safety/worst-case-cells.csv and a figure for each objective. An interrupted search goes on where it was last stored.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The output folder of a study with a diagnoser ('servotwin study --suite flights').
    #[arg(value_name = "FOLDER", default_value = "out")]
    folder: PathBuf,
    /// What to search, separated by commas [default: all].
    #[arg(long, value_name = "OBJECTIVES", value_delimiter = ',',
          value_parser = SearchObjective::ALL.map(SearchObjective::name))]
    objective: Vec<String>,
    /// Number of flights of the search, and of random flights, for each objective.
    #[arg(long, value_name = "FLIGHTS", default_value_t = 256,
          value_parser = clap::value_parser!(u32).range(1..=MAX_RUNS as i64))]
    runs: u32,
    /// Seed of the search, of commands, noise and draws, 0 to 999.
    #[arg(long, value_name = "SEED", default_value_t = 0,
          value_parser = clap::value_parser!(u64).range(0..=999))]
    seed: u64,
    /// The scenario: noise or realistic [default: the most realistic one].
    #[arg(long, value_name = "SCENARIO")]
    scenario: Option<String>,
    /// Fly one finding again: the number of its row in safety/worst-case.csv, or the line that stands there. The command
    /// fails if its margin is not that of the line to the bit.
    #[arg(long, value_name = "ROW", conflicts_with_all = ["objective", "runs", "seed", "scenario"])]
    replay: Option<String>,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    stop::heed();
    let folder = Folder::new(&options.folder);
    if let Some(text) = &options.replay {
        let line = match text.parse() {
            Ok(row) => stored_line(&folder, row)?,
            Err(_) => text.parse()?,
        };
        return again(options, &line, global);
    }
    let wanted = options.scenario.as_deref().map(scenario_of).transpose()?;
    let results = StudyResultsFolder::open(folder.clone(), wanted)?;
    let objectives: Vec<SearchObjective> = SearchObjective::ALL
        .into_iter()
        .filter(|objective| {
            options.objective.is_empty() || options.objective.iter().any(|o| o == objective.name())
        })
        .collect();
    let _hold = folder.hold(Among::Nobody)?;
    let (summaries, written) = with_crew(options.threads, global, |crew| {
        WorstCaseSearch::new(&results, options.seed, crew)?.run(&objectives, options.runs as usize)
    })?;
    let files: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "objectives": summaries, "files": files })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{}{}\n", text(options, &summaries), files.join("\n")),
    })
}

/// Flies a finding again.
fn again(options: &Options, line: &FindingLine, global: Global) -> Result<String, Failure> {
    let results = StudyResultsFolder::open(Folder::new(&options.folder), Some(line.scenario))?;
    let outcome = with_crew(options.threads, global, |crew| replay(&results, line, crew))?;
    let SearchOutcome { margin, is_error, is_visible, action, action_s, wrong_shutdown } = &outcome;
    let action = match action.as_str() {
        "" => "no action".into(),
        action => format!("{action} at {action_s:.2} s"),
    };
    let wrong = wrong_shutdown.as_ref().map_or(String::new(), |name| shut_down(name) + "\n");
    Ok(match global {
        Global { json: true, .. } => json(&json!({
            "objective": line.objective, "margin": margin, "is_error": is_error, "is_visible": is_visible,
            "action": outcome.action, "action_s": action_s, "wrong_shutdown": wrong_shutdown,
        })),
        Global { quiet: true, .. } => String::new(),
        _ => format!(
            "{wrong}{}: margin {margin}, as the line states to the bit; error: {}; first action: {action}\n",
            line.objective.name(),
            if *is_error { "yes" } else { "no" },
        ),
    })
}

/// The sentence about a healthy actuator that was shut down. The only actuator of a system has no name.
fn shut_down(name: &str) -> String {
    match name {
        "" => "HEALTHY ACTUATOR SHUT DOWN: the only actuator".into(),
        name => format!("HEALTHY ACTUATOR SHUT DOWN: {name}"),
    }
}

/// Describes the results: shutdowns of healthy actuators first.
fn text(options: &Options, summaries: &[ObjectiveSummary]) -> String {
    let mut out = String::new();
    let findings = || summaries.iter().flat_map(|summary| &summary.findings);
    for finding in findings() {
        if let Some(name) = &finding.wrong_shutdown {
            let _ = writeln!(out, "{}", shut_down(name));
            let _ = writeln!(out, "  {}", finding.flight);
            let _ = writeln!(out, "  {}", replayed(options, finding));
        }
    }
    for summary in summaries {
        let ObjectiveSummary { objective, search, random, findings, .. } = summary;
        let _ = writeln!(out, "{}", objective.name());
        let _ = writeln!(out, "  search: {}", of_method(search));
        let _ = writeln!(out, "  random: {}", of_method(random));
        for finding in findings {
            let kind = if finding.is_error { "finding" } else { "closest" };
            let WorstCaseFinding { margin, flight, method, .. } = finding;
            let _ = writeln!(out, "  {kind}: margin {} ({method}): {flight}", number(*margin));
            let _ = writeln!(out, "    {}", replayed(options, finding));
        }
        not_searched(&mut out, summary);
    }
    out
}

/// The command that flies a finding again.
fn replayed(options: &Options, finding: &WorstCaseFinding) -> String {
    format!("servotwin worst-case {} --replay {}", options.folder.display(), finding.row)
}

fn of_method(method: &MethodSummary) -> String {
    let MethodSummary { runs, failed, errors, first_error, smallest_margin } = method;
    let first = match first_error {
        Some(run) => format!(", the first in flight {run}"),
        None => String::new(),
    };
    let smallest = smallest_margin.map_or("none".into(), number);
    format!(
        "{runs} flights ({failed} not finished), {errors} errors{first}; smallest margin {smallest}"
    )
}

/// States what was not searched.
fn not_searched(out: &mut String, summary: &ObjectiveSummary) {
    let cells = &summary.cells;
    let random = cells.iter().map(|cell| cell.random);
    let (least, most) = (random.clone().min().unwrap_or(0), random.max().unwrap_or(0));
    let uppers = cells.iter().map(|cell| cell.share_upper);
    let (low, high) = (uppers.clone().fold(1.0, f64::min), uppers.fold(0.0, f64::max));
    let (joint, visited) = summary.joint_cells;
    let _ = writeln!(
        out,
        "  not searched: {visited} of {joint} joint cells of the environment have a flight; {} cells of single \
         dimensions have {least} to {most} random flights each, and errors in at most {} to {} % of flights with 95 % \
         confidence",
        cells.len(),
        number(100.0 * low),
        number(100.0 * high),
    );
    let _ = writeln!(out, "  held fixed: {}", summary.held_fixed.join("; "));
}
