//! What came out, on one screen.

use crate::evaluation::Evaluation;
use crate::evaluation::protocol::Protocol;
use crate::report::lines::{ACCURACY, Line, PAPER, SAFETY};
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{NONE, percent, share};
use crate::report::{Material, Section};

/// See the module.
pub struct Summary;

impl Section for Summary {
    fn id(&self) -> &'static str {
        "summary"
    }

    fn title(&self) -> &'static str {
        "Summary"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let study = material.study;
        page.text(&format!(
            "The virtual twin ({}) is compared with plants that have one of {} faults each, in {} \
             operating cases. From the differences between measured and expected sensor signals \
             (residuals), decision trees say which actuator failed (A), what the flight control \
             computer must do (B), and what is broken (C, D, E). This report says how far that \
             can be trusted.",
            study.system.title,
            study.faults.len(),
            study.cases.len(),
        ));
        for result in &material.results.subjects {
            page.table(
                &grid(&result.evaluation, study.name == PAPER),
                &format!(
                    "Setting: {}. Rates are of faults that were detected; the trees never saw the \
                 tested fault at the tested intensity (grouped), or the tested operating case.",
                    result.title
                ),
            );
        }
        page.note(
            "“Paper's features” are trees as the seed paper describes them: mean, variance and \
             indicator of each residual, each actuator by itself. “Paper” are the accuracies that \
             it reports, with a third of the variants held out at random.",
        );
    }
}

fn grid(evaluation: &Evaluation, is_papers: bool) -> Grid {
    let mut heads = vec![
        ("", Side::Left),
        ("grouped", Side::Right),
        ("new operating case", Side::Right),
        ("random third", Side::Right),
        ("paper's features, random third", Side::Right),
    ];
    if is_papers {
        heads.push(("paper", Side::Right));
    }
    let mut grid = Grid::new(heads);
    for line in &SAFETY {
        grid.push_strong(row(line, evaluation, is_papers));
    }
    for line in &ACCURACY {
        grid.push(row(line, evaluation, is_papers));
    }
    grid
}

fn row(line: &Line, evaluation: &Evaluation, is_papers: bool) -> Vec<String> {
    let of = |protocol| share(line.of(evaluation, protocol));
    let mut row = vec![
        line.title.into(),
        of(Protocol::Grouped),
        of(Protocol::LeaveCaseOut),
        of(Protocol::RandomThird),
        share(line.of_baseline(evaluation, Protocol::RandomThird)),
    ];
    if is_papers {
        row.push(line.paper.map_or(NONE.into(), |paper| percent(Some(paper))));
    }
    row
}
