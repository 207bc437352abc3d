//! The records of a study in words: what was simulated, and what failed.

use servotwin::job::Folder;
use servotwin::records::RecordsOutcome;
use servotwin::study::{Purpose, Study};
use servotwin::toml_text::counted;
use servotwin_view::document::{Document, Table, Value, Verdict, line};
use servotwin_view::row;

/// Whether all records are simulated.
pub(super) fn verdict(folder: &Folder, records: &[RecordsOutcome]) -> Verdict {
    let failed: usize = records.iter().map(|own| own.failed.len()).sum();
    let values = [("folder", folder.path().into()), ("failed", failed.into())];
    Verdict::good(line("{folder}: the data sets are complete; {failed} rows failed.", values))
}

/// Describes what was simulated.
pub(super) fn describe(document: &mut Document, study: &Study, records: &[RecordsOutcome]) {
    if records.is_empty() {
        return;
    }
    let mut counted = Table::of(
        "scenarios: | training: | variants: | resumed: | steps: | rejected: | jacobians: | unsettled: | on_the_move:",
    );
    let mut failed = Table::of("scenario | variant | reason:not simulated to the end");
    for outcome in records {
        counted.push(counts(outcome));
        for (scenario, variant, reason) in &outcome.failed {
            failed.push(row![scenario.name(), *variant, reason]);
        }
    }
    document.list("records", records.iter().map(|outcome| line_of(study, outcome)));
    document.table("counts", counted);
    document.table("failed", failed);
}

/// Describes some records in a line.
pub(super) fn line_of(study: &Study, outcome: &RecordsOutcome) -> String {
    let &RecordsOutcome { variants, resumed, seconds, duration_s, on_the_move, .. } = outcome;
    let mut text = format!(
        "{}, {}: {variants} rows of {duration_s} s, {} of them now in {seconds:.1} s; {} failed",
        study.name,
        outcome.title(),
        variants - resumed,
        outcome.failed.len()
    );
    if on_the_move > 0 {
        text += &format!(
            "; {} began on the move, because no steady state was found: they teach no band, and have the flag \
             began_on_the_move in the data set",
            counted(on_the_move, "variant")
        );
    }
    text
}

fn counts(outcome: &RecordsOutcome) -> Vec<Value> {
    let RecordsOutcome { statistics, .. } = outcome;
    row![
        Value::list(outcome.scenarios.iter().map(|scenario| scenario.name())),
        outcome.purpose == Purpose::Train,
        outcome.variants,
        outcome.resumed,
        statistics.steps,
        statistics.rejected,
        statistics.jacobians,
        statistics.unsettled,
        outcome.on_the_move,
    ]
}
