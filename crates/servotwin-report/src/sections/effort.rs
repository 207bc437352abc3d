//! The course of the simulations: which ones ring, which began without a steady state, and the solver's steps by fault.

use crate::Material;
use crate::page::{Alignment, HtmlTable, Page};
use crate::words::{number, spoken};
use servotwin::job::manifest::{DataSetEntry, KindEffort};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    let sets = &material.manifest.data_sets;
    let strange = |set: &&DataSetEntry| set.efforts.iter().any(is_strange);
    let strange: Vec<&DataSetEntry> = sets.iter().filter(strange).collect();
    for set in &strange {
        let efforts = set.efforts.iter().filter(|effort| is_strange(effort));
        page.table(&grid(efforts), &format!("{}: {}", called(set), caption(set)));
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

const RINGS: &str = "Variants that ring take more than five times the steps of their twin, because a part of them \
                     oscillates fast (a limit cycle): what their sensors show is true on average and in size, not \
                     sample by sample.";

/// The caption of a data set's table.
fn caption(set: &DataSetEntry) -> String {
    let sum = |count: fn(&KindEffort) -> usize| set.efforts.iter().map(count).sum::<usize>();
    let moving = sum(|effort| effort.began_on_the_move);
    let cycles = sum(|effort| effort.limit_cycles);
    let mut parts = vec![];
    if sum(|effort| effort.rings) > 0 {
        parts.push(RINGS.to_owned());
    }
    if moving > 0 {
        parts.push(format!(
            "For {moving} variants no steady state was found, and the run began on the move (manifest.json names them). {}",
            match cycles {
                0 => "No limit cycle was measured among them.".into(),
                _ if cycles == moving =>
                    "The loop swings for ever: a limit cycle was measured.".into(),
                _ => format!(
                    "In {cycles} of them the loop swings for ever: a limit cycle was measured."
                ),
            }
        ));
    }
    parts.join(" ")
}

const STEPS: &str = "The solver takes the steps that its error control asks for: many where a part oscillates fast or \
                     cavitates. Variants that could not be simulated to the end are left out.";

fn is_strange(effort: &KindEffort) -> bool {
    effort.rings + effort.began_on_the_move > 0
}

fn called(set: &DataSetEntry) -> String {
    format!("{}, for {}", set.setting, if set.is_training { "learning" } else { "judging" })
}

fn grid<'e>(efforts: impl Iterator<Item = &'e KindEffort>) -> HtmlTable {
    let mut grid = HtmlTable::new([
        ("fault", Alignment::Left),
        ("variants", Alignment::Right),
        ("steps a second", Alignment::Right),
        ("at most", Alignment::Right),
        ("ring", Alignment::Right),
        ("began on the move", Alignment::Right),
        ("limit cycle", Alignment::Right),
    ]);
    for effort in efforts {
        grid.push(vec![
            spoken(&effort.kind),
            effort.variants.to_string(),
            number(effort.mean_steps_per_s),
            number(effort.most_steps_per_s),
            effort.rings.to_string(),
            effort.began_on_the_move.to_string(),
            effort.limit_cycles.to_string(),
        ]);
    }
    grid
}
