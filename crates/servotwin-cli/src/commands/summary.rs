//! The final summary of the main job: safety first, then right answers; one column for each scenario.

use servotwin::job::{Results, Subject};
use servotwin::learn::baseline::RandomThirds;
use servotwin::study::Study;
use servotwin_report::lines::{self, OF_PAPER, Who};
use servotwin_report::vocabulary::{PAPER, Vocabulary};
use servotwin_report::words::{of_count, percent};
use servotwin_view::document::{Document, Table, Value, Verdict};

/// A table with the rates of trees and committee.
pub(crate) fn document(results: &Results, study: &Study) -> Document {
    let scenarios = lines::scenarios(results);
    let mut document = Document::new("study", Verdict::neutral(brief(results, study)));
    let judged = scenarios.last().and_then(|result| result.evaluation.headline());
    judged.iter().for_each(|judged| _ = document.text(judged.title.as_str()));
    let mut table = Table::of("measure:_ | by");
    for name in scenarios.iter().map(|result| result.subject.name()) {
        table.column(name, name);
    }
    let mut last = String::new();
    for row in lines::headline(&scenarios, &Vocabulary::of(study)) {
        let shown = if row.title == last { "" } else { row.title.as_str() };
        let mut cells = vec![Value::of(shown, &row.title), row.who.into()];
        cells.extend(row.rates.iter().map(|rate| Value::of(of_count(*rate), rate)));
        table.push(cells);
        last = row.title;
    }
    document.table("rates", table);
    seed_paper(results).into_iter().for_each(|line| _ = document.text(line));
    document
}

/// The main figures of the hardest scenario so far in a line: up to two of safety, and one of right answers.
pub(crate) fn brief(results: &Results, study: &Study) -> String {
    let scenarios = lines::scenarios(results);
    let Some(hardest) = scenarios.last() else { return String::new() };
    let mut rows = lines::headline(&[*hardest], &Vocabulary::of(study));
    let best = if rows.iter().any(|row| row.who == BEST) { BEST } else { Who::Trees.title() };
    rows.retain(|row| row.who == best);
    let safety = rows.iter().filter(|row| row.is_safety).take(2);
    let shown = safety.chain(rows.last().filter(|row| !row.is_safety));
    let figures: Vec<String> =
        shown.map(|row| format!("{} {}", row.title, of_count(row.rates[0]))).collect();
    format!("{}: {}", hardest.title, figures.join(", "))
}

const BEST: &str = Who::Committee.title();

/// The result of the seed paper's own test, in a separate line.
fn seed_paper(results: &Results) -> Option<String> {
    let ideal = results.of(Subject::Ideal).filter(|_| results.study == PAPER);
    let thirds = ideal.map_or(&[][..], |ideal| &ideal.evaluation.random_thirds);
    let told = |thirds: &RandomThirds| {
        let (_, paper) = OF_PAPER.iter().find(|(stage, _)| *stage == thirds.stage)?;
        let (mean, paper) = (percent(Some(thirds.mean())), percent(Some(*paper)));
        Some(format!("{} {mean} ± {:.2} ({paper})", thirds.stage, 100.0 * thirds.deviation()))
    };
    let told: Vec<String> = thirds.iter().filter_map(told).collect();
    let count = thirds.first()?.accuracies.len();
    (!told.is_empty()).then(|| {
        format!(
            "Apart, the seed paper's trees in its own test, {count} random thirds (the paper's one): {}",
            told.join(", ")
        )
    })
}
