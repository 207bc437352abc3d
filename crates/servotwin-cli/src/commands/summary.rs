//! The final summary of the main job on a terminal: safety first, then right answers; one column for each scenario.

use crate::render::{Side, TextTable};
use servotwin::evaluation::baseline::RandomThirds;
use servotwin::job::{Results, Subject};
use servotwin::study::Study;
use servotwin_report::lines::{self, OF_PAPER, Who};
use servotwin_report::vocabulary::{PAPER, Vocabulary};
use servotwin_report::words::{of_count, percent};

/// A table with the rates of trees and committee.
pub(crate) fn text(results: &Results, study: &Study) -> String {
    let scenarios = lines::scenarios(results);
    let mut heads = vec![("", Side::Left), ("by", Side::Left)];
    heads.extend(scenarios.iter().map(|result| (result.subject.name(), Side::Right)));
    let mut grid = TextTable::new(&heads);
    let mut last = String::new();
    for row in lines::headline(&scenarios, &Vocabulary::of(study)) {
        let title = if row.title == last { String::new() } else { row.title.clone() };
        last = row.title;
        let mut cells = vec![title, row.who.to_owned()];
        cells.extend(row.rates.iter().map(|rate| of_count(*rate)));
        grid.push(cells);
    }
    let judged = scenarios.last().and_then(|result| result.evaluation.headline());
    let held_out = judged.map_or(String::new(), |judged| format!("{}\n", judged.title));
    held_out + &grid.text() + &seed_paper(results) + "Intervals and everything else: the report\n"
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
fn seed_paper(results: &Results) -> String {
    let ideal = results.of(Subject::Ideal).filter(|_| results.study == PAPER);
    let thirds = ideal.map_or(&[][..], |ideal| &ideal.evaluation.random_thirds);
    let told = |thirds: &RandomThirds| {
        let (_, paper) = OF_PAPER.iter().find(|(stage, _)| *stage == thirds.stage)?;
        let (mean, paper) = (percent(Some(thirds.mean())), percent(Some(*paper)));
        Some(format!("{} {mean} ± {:.2} ({paper})", thirds.stage, 100.0 * thirds.deviation()))
    };
    let told: Vec<String> = thirds.iter().filter_map(told).collect();
    if told.is_empty() {
        return String::new();
    }
    format!(
        "Apart, the seed paper's trees in its own test, {} random thirds (the paper's one): {}\n",
        thirds[0].accuracies.len(),
        told.join(", ")
    )
}
