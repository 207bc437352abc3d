//! The protocols: how variants were held out, and what came out under each.

use crate::evaluation::protocol::ProtocolResult;
use crate::report::lines::ACCURACY;
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{percent, rate};
use crate::report::{Material, Section};

/// See the module.
pub struct Protocols;

impl Section for Protocols {
    fn id(&self) -> &'static str {
        "protocols"
    }

    fn title(&self) -> &'static str {
        "Accuracy under every protocol"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        page.text(
            "A tree is only as good as its test is honest. A random third is the kindest test: for \
             nearly every variant a neighbour (the same fault at the same intensity in another \
             operating case, or in the other actuator) was in training. Kept together (grouped), \
             neighbours and mirror images never stand on both sides. Leaving out an intensity, an \
             operating case or a whole kind of fault asks how the trees behave where they have no \
             experience.",
        );
        for result in &material.results.subjects {
            let evaluation = &result.evaluation;
            page.table(&grid(&evaluation.protocols), &format!(
                "Setting: {}. Accuracy of each stage where the stages above are right, and of all \
                 together (end to end), with 95 % intervals (Wilson; repeated variants count once). \
                 “Isolated” is the share of all faults, the undetectable ones included.",
                result.title
            ));
            if !evaluation.baseline.is_empty() {
                page.table(
                    &grid(&evaluation.baseline),
                    &format!(
                        "Setting: {}. The same for the seed paper's trees: its 36 features, each \
                     actuator by itself.",
                        result.title
                    ),
                );
            }
        }
    }
}

/// Stages in rows, protocols in columns.
fn grid(results: &[ProtocolResult]) -> Grid {
    let mut heads = vec![("held out", Side::Left)];
    heads.extend(results.iter().map(|result| (result.title.as_str(), Side::Right)));
    let mut grid = Grid::new(heads);
    let mut splits = vec!["splits".to_owned()];
    splits.extend(results.iter().map(|result| result.splits.to_string()));
    grid.push(splits);
    for line in &ACCURACY {
        let mut row = vec![line.title.to_owned()];
        // The interval on a line of its own.
        row.extend(results.iter().map(|r| rate((line.rate)(r)).replace(" (", "\n(")));
        grid.push(row);
    }
    let mut isolated = vec!["isolated".to_owned()];
    isolated.extend(results.iter().map(|result| percent(result.isolated_of_all)));
    grid.push(isolated);
    grid
}
