//! The protocols: how variants were held out, and what came out under each.

use crate::evaluation::protocol::{Protocol, ProtocolResult};
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

fn grid(results: &[ProtocolResult]) -> Grid {
    let heads = ACCURACY.iter().map(|line| line.title.split("  ").next().unwrap_or(line.title));
    let mut all = vec![("held out".to_owned(), Side::Left), ("splits".to_owned(), Side::Right)];
    all.extend(heads.map(|head| (head.to_owned(), Side::Right)));
    all.push(("isolated".to_owned(), Side::Right));
    let mut grid = Grid::new(all);
    for result in results {
        let mut row = vec![result.title.clone(), result.splits.to_string()];
        row.extend(ACCURACY.iter().map(|line| rate((line.rate)(result)).replace(" (", "\u{a0}(")));
        row.push(percent(result.isolated_of_all));
        match result.protocol {
            Protocol::Grouped => grid.push_strong(row),
            _ => grid.push(row),
        }
    }
    grid
}
