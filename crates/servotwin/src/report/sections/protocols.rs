//! The protocols: how variants were held out, and what came out under each.

use crate::evaluation::protocol::ProtocolResult;
use crate::report::lines::STAGES;
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{by_kind, percent, stacked};
use crate::report::{Material, Section};

/// See the module.
pub struct Protocols;

impl Section for Protocols {
    fn id(&self) -> &'static str {
        "protocols"
    }

    fn title(&self) -> &'static str {
        "The trees under every protocol"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        page.text(
            "A tree is only as good as its test is honest. A random third is the kindest test: for \
             nearly every variant a neighbour (the same fault at the same intensity in another \
             operating case) was in training. Kept together, neighbours and mirror images never stand \
             on both sides. Leaving out an intensity, an operating case, a command or a whole kind of \
             fault asks how the trees behave where they have no experience; but one case leaves its \
             command in training at another load. New commands are the hardest: nothing that is flown \
             in the judged cases was learned from, and where the fault is unseen as well, neither was \
             the fault.",
        );
        for result in &material.results.subjects {
            let evaluation = &result.evaluation;
            page.table(&grid(&evaluation.protocols), &format!(
                "Setting: {}. Accuracy of each stage where the stages above are right (A actuator, B \
                 command, C to E details within a command), and of all together (end to end), with 95 % \
                 intervals from drawing kinds of fault at their intensities; the interval “by kind” draws \
                 whole kinds, and is that of a fault of a new kind. Mirror images count once. “Of all” is \
                 the share isolated of all faults, the undetectable ones included.",
                result.title
            ));
            if !evaluation.baseline.is_empty() {
                page.table(&grid(&evaluation.baseline), &format!(
                    "Setting: {}. The same for the seed paper's trees: mean, variance and indicator of \
                     each residual, each actuator by itself, and its band of ±3 %.",
                    result.title
                ));
            }
        }
    }
}

/// Protocols in rows, measures in columns.
fn grid(results: &[ProtocolResult]) -> Grid {
    let asked = |letter: &str| results.iter().any(|result| result.stage(letter).is_some());
    let letters: Vec<&str> =
        STAGES.iter().map(|stage| stage.0).filter(|letter| asked(letter)).collect();
    let mut heads = vec![("held out", Side::Left), ("splits", Side::Right)];
    heads.extend(letters.iter().map(|letter| (*letter, Side::Right)));
    let whole = ["end to end", "by kind", "of all"];
    heads.extend(whole.map(|head| (head, Side::Right)));
    let mut grid = Grid::new(heads);
    for result in results {
        let mut row = vec![result.title.clone(), result.splits.to_string()];
        let accuracy = |letter: &&str| stacked(result.stage(letter).map(|score| score.accuracy));
        row.extend(letters.iter().map(accuracy));
        row.push(stacked(result.end_to_end));
        row.push(by_kind(result.end_to_end));
        row.push(percent(result.isolated_of_all));
        grid.push(row);
    }
    grid
}
