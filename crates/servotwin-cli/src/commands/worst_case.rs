//! `servotwin worst-case`: searches the flights in which the diagnosis is closest to an error.

use super::flights::with_crew;
use super::scenario_of;
use crate::failure::Failure;
use crate::{Global, Run, stop};
use servotwin::flight::worst_case::{SearchObjective, SearchOutcome};
use servotwin::job::{Among, Folder};
use servotwin_report::words::number;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::worst_case::finding_line::FindingLine;
use servotwin_safety::worst_case::summary::{MethodSummary, ObjectiveSummary, WorstCaseFinding};
use servotwin_safety::worst_case::{MAX_RUNS, WorstCaseSearch, replay, stored_line};
use servotwin_view::document::{Document, Table, Value, Verdict, line};
use servotwin_view::row;
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

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        stop::heed();
        let folder = Folder::new(&self.folder);
        if let Some(text) = &self.replay {
            let line = match text.parse() {
                Ok(row) => stored_line(&folder, row)?,
                Err(_) => text.parse()?,
            };
            return again(self, &line, global);
        }
        let wanted = self.scenario.as_deref().map(scenario_of).transpose()?;
        let results = StudyResultsFolder::open(folder.clone(), wanted)?;
        let is_wanted = |objective: &SearchObjective| {
            self.objective.is_empty() || self.objective.iter().any(|o| o == objective.name())
        };
        let objectives: Vec<SearchObjective> =
            SearchObjective::ALL.into_iter().filter(is_wanted).collect();
        let _hold = folder.hold(Among::Nobody)?;
        let (summaries, written) = with_crew(self.threads, global, |crew| {
            WorstCaseSearch::new(&results, self.seed, crew)?.run(&objectives, self.runs as usize)
        })?;
        let mut document = described(self, &summaries);
        document.files(written);
        Ok(document)
    }
}

/// Flies a finding again.
fn again(options: &Options, stored: &FindingLine, global: Global) -> Result<Document, Failure> {
    let results = StudyResultsFolder::open(Folder::new(&options.folder), Some(stored.scenario))?;
    let outcome = with_crew(options.threads, global, |crew| replay(&results, stored, crew))?;
    let SearchOutcome { margin, is_error, is_visible, action, action_s, wrong_shutdown } = outcome;
    let first = match action.as_str() {
        "" => "no action".into(),
        action => format!("{action} at {action_s:.2} s"),
    };
    let shut = wrong_shutdown.as_deref().map_or(String::new(), |name| shut_down(name) + "; ");
    let text = format!(
        "{shut}{{objective}}: margin {{margin}}, as the line states to the bit; error: {{is_error}}; first action: {first}"
    );
    let sentence = line(
        &text,
        [
            ("objective", stored.objective.name().into()),
            ("margin", Value::number(margin, margin.to_string())),
            ("is_error", is_error.into()),
            ("is_visible", is_visible.into()),
            ("action", action.into()),
            ("action_s", Value::of("", &action_s)),
            ("wrong_shutdown", wrong_shutdown.into()),
        ],
    );
    Ok(Document::new("worst-case", Verdict::neutral(sentence)))
}

/// The sentence about a healthy actuator that was shut down. The only actuator of a system has no name.
fn shut_down(name: &str) -> String {
    match name {
        "" => "HEALTHY ACTUATOR SHUT DOWN: the only actuator".into(),
        name => format!("HEALTHY ACTUATOR SHUT DOWN: {name}"),
    }
}

/// Describes the results: shutdowns of healthy actuators first.
fn described(options: &Options, summaries: &[ObjectiveSummary]) -> Document {
    let findings = || summaries.iter().flat_map(|summary| &summary.findings);
    let wrong = findings().filter_map(|finding| {
        let name = finding.wrong_shutdown.as_ref()?;
        Some(format!("{}: {}", shut_down(name), finding.flight))
    });
    let wrong: Vec<String> = wrong.collect();
    let errors: usize = summaries.iter().map(|s| s.search.errors + s.random.errors).sum();
    let flown: usize = summaries.iter().map(|s| s.search.runs + s.random.runs).sum();
    let verdict = line(
        "{errors} errors in {flown} flights; in {wrong_shutdowns} of the findings a healthy actuator is shut down.",
        [
            ("errors", errors.into()),
            ("flown", flown.into()),
            ("wrong_shutdowns", wrong.len().into()),
        ],
    );
    let mut document = Document::new("worst-case", Verdict::neutral(verdict));
    document.list("shutdowns_of_healthy_actuators", wrong);
    let mut table = Table::of(
        ":objective | :by | :flights | :not finished | :errors | :first error | :smallest margin",
    );
    for ObjectiveSummary { objective, search, random, .. } in summaries {
        for (name, own) in [("search", search), ("random flights", random)] {
            let smallest = own.smallest_margin.map(|margin| Value::digits(margin, 3));
            let MethodSummary { runs, failed, errors, first_error, .. } = *own;
            let name = Value::from(name);
            table.push(row![objective.name(), name, runs, failed, errors, first_error, smallest]);
        }
    }
    document.table("", table);
    for summary in summaries {
        let mut section = Document::section("", summary.objective.name());
        for finding in &summary.findings {
            let kind = if finding.is_error { "finding" } else { "closest" };
            let WorstCaseFinding { margin, flight, method, row, .. } = finding;
            section.text(format!("  {kind}: margin {} ({method}): {flight}", number(*margin)));
            let folder = options.folder.display();
            section.text(format!("    servotwin worst-case {folder} --replay {row}"));
        }
        not_searched(&mut section, summary);
        document.add(section);
    }
    document.data("objectives", &summaries);
    document
}

/// States what was not searched.
fn not_searched(section: &mut Document, summary: &ObjectiveSummary) {
    let cells = &summary.cells;
    let random = cells.iter().map(|cell| cell.random);
    let (least, most) = (random.clone().min().unwrap_or(0), random.max().unwrap_or(0));
    let uppers = cells.iter().map(|cell| cell.share_upper);
    let (low, high) = (uppers.clone().fold(1.0, f64::min), uppers.fold(0.0, f64::max));
    let (joint, visited) = summary.joint_cells;
    section.text(format!(
        "  not searched: {visited} of {joint} joint cells of the environment have a flight; {} cells of single \
         dimensions have {least} to {most} random flights each, and errors in at most {} to {} % of flights with 95 % \
         confidence",
        cells.len(),
        number(100.0 * low),
        number(100.0 * high),
    ));
    section.text(format!("  held fixed: {}", summary.held_fixed.join("; ")));
}
