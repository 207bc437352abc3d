//! `servotwin worst-case`: searches the flights in which the diagnosis is closest to an error.

use super::progress::with_crew;
use crate::failure::Failure;
use crate::{Global, Run, stop};
use servotwin::flight::margin::SearchObjective;
use servotwin::job::{Among, Folder};
use servotwin::study::Scenario;
use servotwin::text::three_digits;
use servotwin_safety::results::StudyResultsFolder;
use servotwin_safety::worst_case::{
    self, MAX_RUNS, MethodSummary, ObjectiveSummary, WorstCaseFinding,
};
use servotwin_view::document::{Document, Table, Value, Verdict, line};
use servotwin_view::row;
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
          value_parser = super::one_of(SearchObjective::ALL, SearchObjective::name))]
    objective: Vec<SearchObjective>,
    /// Number of flights of the search, and of random flights, for each objective.
    #[arg(long, value_name = "FLIGHTS", default_value_t = 256,
          value_parser = clap::value_parser!(u32).range(1..=MAX_RUNS as i64))]
    runs: u32,
    /// Seed of the search, of commands, noise and draws, 0 to 999.
    #[arg(long, value_name = "SEED", default_value_t = 0,
          value_parser = clap::value_parser!(u64).range(0..=999))]
    seed: u64,
    /// The scenario: noise or realistic [default: the most realistic one].
    #[arg(long, value_name = "SCENARIO", value_parser = super::scenario())]
    scenario: Option<Scenario>,
    /// Number of threads [default: all processors; the results do not depend on it].
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
}

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        stop::heed();
        let folder = Folder::new(&self.folder);
        let results = StudyResultsFolder::open(folder.clone(), self.scenario)?;
        let is_wanted = |objective: &SearchObjective| {
            self.objective.is_empty() || self.objective.contains(objective)
        };
        let objectives: Vec<SearchObjective> =
            SearchObjective::ALL.into_iter().filter(is_wanted).collect();
        let _hold = folder.hold(Among::Nobody)?;
        let size = (self.seed, self.runs as usize);
        let summaries = with_crew(self.threads, global, |crew| {
            worst_case::search(&results, &objectives, size, crew)
        })?;
        let mut document = described(self, &summaries);
        document.files(summaries.iter().map(|summary| summary.figure.clone()));
        Ok(document)
    }
}

/// Describes the results: shutdowns of healthy actuators first.
fn described(options: &Options, summaries: &[ObjectiveSummary]) -> Document {
    let findings = || summaries.iter().flat_map(|summary| &summary.findings);
    let wrong = findings().filter(|finding| finding.shuts_down_healthy);
    let wrong: Vec<String> =
        wrong.map(|own| format!("HEALTHY ACTUATOR SHUT DOWN: {}", own.flight)).collect();
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
            let WorstCaseFinding { margin, flight, run, .. } = finding;
            section.text(format!("  {kind}: margin {}: {flight}", three_digits(*margin)));
            section.text(format!("    servotwin run {run} {}", options.folder.display()));
        }
        not_searched(&mut section, summary);
        document.add(section);
    }
    document.data("objectives", &summaries);
    document
}

/// States what was not searched.
fn not_searched(section: &mut Document, summary: &ObjectiveSummary) {
    let ObjectiveSummary { share_upper, joint_cells: (joint, visited), held_fixed, .. } = summary;
    section.text(format!(
        "  by the random flights the error occurs in at most {} % of flights, with 95 % confidence",
        three_digits(100.0 * share_upper)
    ));
    section.text(format!(
        "  not searched: {visited} of {joint} joint cells of the environment have a flight"
    ));
    section.text(format!("  held fixed: {}", held_fixed.join("; ")));
}
