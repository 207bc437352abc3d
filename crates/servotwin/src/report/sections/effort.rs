//! How simulations went: which rang, which began on the move, and the solver's steps by fault.

use crate::job::manifest::{DataSetEntry, KindEffort};
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{number, spoken};
use crate::report::{Material, Section};

/// See the module.
pub struct Effort;

impl Section for Effort {
    fn id(&self) -> &'static str {
        "effort"
    }

    fn title(&self) -> &'static str {
        "How the simulations went"
    }

    fn is_appendix(&self) -> bool {
        true
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let sets = &material.manifest.data_sets;
        let strange = |set: &&DataSetEntry| set.efforts.iter().any(is_strange);
        let strange: Vec<&DataSetEntry> = sets.iter().filter(strange).collect();
        for set in &strange {
            let efforts = set.efforts.iter().filter(|effort| is_strange(effort));
            page.table(&grid(efforts), &format!("{}: {STRANGE}", called(set)));
        }
        if strange.is_empty() && !sets.is_empty() {
            page.text(
                "Every simulation began at rest, and none took more than five times the steps of its twin.",
            );
        }
        for set in sets {
            page.folded(&format!("Steps by fault: {}", called(set)), |page| {
                page.table(&grid(set.efforts.iter()), STEPS);
            });
        }
    }
}

const STRANGE: &str = "variants that ring take more than five times the steps of their twin, because a part of them \
                       oscillates fast (a limit cycle): what their sensors show is true on average and in size, not \
                       sample by sample. Where no rest was found the run began on the move: the loop swings for ever.";

const STEPS: &str = "The solver takes the steps that its error control asks for: many where a part oscillates fast or \
                     cavitates. Variants that could not be simulated to the end are left out.";

fn is_strange(effort: &KindEffort) -> bool {
    effort.rings + effort.began_on_the_move > 0
}

fn called(set: &DataSetEntry) -> String {
    format!("{}, for {}", set.setting, if set.is_training { "learning" } else { "judging" })
}

fn grid<'e>(efforts: impl Iterator<Item = &'e KindEffort>) -> Grid {
    let mut grid = Grid::new([
        ("fault", Side::Left),
        ("variants", Side::Right),
        ("steps a second", Side::Right),
        ("at most", Side::Right),
        ("ring", Side::Right),
        ("began on the move", Side::Right),
    ]);
    for effort in efforts {
        grid.push(vec![
            spoken(&effort.kind),
            effort.variants.to_string(),
            number(effort.mean_steps_per_s),
            number(effort.most_steps_per_s),
            effort.rings.to_string(),
            effort.began_on_the_move.to_string(),
        ]);
    }
    grid
}
