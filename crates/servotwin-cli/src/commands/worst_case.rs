//! `servotwin worst-case`: searches the flights in which the diagnosis is closest to an error.

use super::flights::with_crew;
use super::scenario_of;
use crate::failure::Failure;
use crate::render::json;
use crate::{Global, stop};
use serde_json::json;
use servotwin::flight::margin::SearchObjective;
use servotwin::job::{Among, Folder};
use servotwin_report::words::number;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::worst_case::{
    self, MAX_RUNS, MethodSummary, ObjectiveSummary, WorstCaseFinding,
};
use std::fmt::Write;
use std::path::PathBuf;

/// Search the worst case: the flights in which the diagnosis is closest to an error.
///
/// Command, load, air speed, pressures, temperatures, tolerances, fault and onset are searched for the shutdown of a
/// healthy actuator, the missed shutdown, the false alarm and the largest transient, with the diagnoser in the folder.
/// As many random flights are flown for comparison. Every finding is said in words, and 'servotwin run' flies it again.
/// The command states what was not searched. Every flight is a row of outcomes-worst_OBJECTIVE-SCENARIO.parquet, and
/// safety/worst-case-OBJECTIVE.svg compares the search with random flights. An interrupted search goes on where it was
/// last stored.
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
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    stop::heed();
    let folder = Folder::new(&options.folder);
    let wanted = options.scenario.as_deref().map(scenario_of).transpose()?;
    let results = StudyResultsFolder::open(folder.clone(), wanted)?;
    let objectives: Vec<SearchObjective> = SearchObjective::ALL
        .into_iter()
        .filter(|objective| {
            options.objective.is_empty() || options.objective.iter().any(|o| o == objective.name())
        })
        .collect();
    let _hold = folder.hold(Among::Nobody)?;
    let size = (options.seed, options.runs as usize);
    let summaries = with_crew(options.threads, global, |crew| {
        worst_case::search(&results, &objectives, size, crew)
    })?;
    Ok(match global {
        Global { json: true, .. } => json(&json!({ "objectives": summaries })),
        Global { quiet: true, .. } => String::new(),
        _ => text(options, &summaries),
    })
}

/// Describes the results: shutdowns of healthy actuators first.
fn text(options: &Options, summaries: &[ObjectiveSummary]) -> String {
    let mut out = String::new();
    let findings = summaries.iter().flat_map(|summary| &summary.findings);
    for finding in findings.filter(|finding| finding.shuts_down_healthy) {
        let _ = writeln!(out, "HEALTHY ACTUATOR SHUT DOWN: {}", finding.flight);
        let _ = writeln!(out, "  {}", replayed(options, finding));
    }
    for summary in summaries {
        let ObjectiveSummary { objective, search, random, findings, .. } = summary;
        let _ = writeln!(out, "{}", objective.name());
        let _ = writeln!(out, "  search: {}", of_method(search));
        let _ = writeln!(out, "  random: {}", of_method(random));
        for finding in findings {
            let kind = if finding.is_error { "finding" } else { "closest" };
            let WorstCaseFinding { margin, flight, .. } = finding;
            let _ = writeln!(out, "  {kind}: margin {}: {flight}", number(*margin));
            let _ = writeln!(out, "    {}", replayed(options, finding));
        }
        not_searched(&mut out, summary);
        let _ = writeln!(out, "  {}", summary.figure.display());
    }
    out
}

/// The command that flies a finding again.
fn replayed(options: &Options, finding: &WorstCaseFinding) -> String {
    format!("servotwin run {} {}", finding.run, options.folder.display())
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
    let ObjectiveSummary { share_upper, joint_cells: (joint, visited), held_fixed, .. } = summary;
    let _ = writeln!(
        out,
        "  by the random flights the error occurs in at most {} % of flights, with 95 % confidence",
        number(100.0 * share_upper)
    );
    let _ = writeln!(
        out,
        "  not searched: {visited} of {joint} joint cells of the environment have a flight"
    );
    let _ = writeln!(out, "  held fixed: {}", held_fixed.join("; "));
}
