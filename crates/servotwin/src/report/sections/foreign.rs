//! Faults that the diagnosis was never trained on: what it says of them.

use super::flights::at_most;
use crate::flight::foreign::{ForeignMerit, ForeignOutcome, Sensible, Words};
use crate::report::page::{Grid, Page, Side};
use crate::report::words::NONE;
use crate::report::{Material, Section};

/// See the module.
pub struct Foreign;

impl Section for Foreign {
    fn id(&self) -> &'static str {
        "foreign"
    }

    fn title(&self) -> &'static str {
        "Faults never trained on"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let merits = material.flights.map_or(&[][..], |results| &results.foreign);
        let merits: Vec<&ForeignMerit> = merits.iter().filter(|m| !m.outcomes.is_empty()).collect();
        if merits.is_empty() {
            return;
        }
        page.text(
            "Nothing in training was like these, so nobody expects the right name. What is expected is \
             that the healthy actuator stays on, and that what is said makes sense: the right actuator, \
             “unknown”, or that an input is not to be believed. Sensors that stick, drift or oscillate \
             do so in the control loop; a reading that is missing or noisy is so for the diagnosis only.",
        );
        for merit in merits {
            let (wrong, of) = merit.shutdowns_healthy();
            page.table(&table(merit), &format!(
                "Setting {}: flights by the most that was said in them (each counts once), in both \
                 actuators and several environments. A healthy actuator was to be shut down in {wrong} \
                 of {of} flights ({}).",
                merit.setting,
                at_most(wrong, of)
            ));
            let told = merit.outcomes.iter().filter(|outcome| !outcome.wrong.is_empty());
            let told: Vec<String> =
                told.map(|o| format!("{} ({})", o.title, o.wrong.join("; "))).collect();
            if !told.is_empty() {
                page.note(&format!("Where that happened: {}.", told.join(", ")));
            }
        }
        page.note(
            "Sensible is a command that would be right for the fault as a whole: a shutdown where the \
             actuator does not do what it should, anything but a shutdown where only a sensor is wrong, \
             and none where no actuator is at fault. An actuator whose measured supply or return pressure is \
             wrong counts as at fault. “Off” are shutdowns, of an actuator at fault and of a healthy one. \
             The first word is whatever the diagnosis said first after the onset other than “healthy”: \
             the median, and below it the last.",
        );
    }
}

fn table(merit: &ForeignMerit) -> Grid {
    let left = [("fault", Side::Left), ("flights", Side::Right)];
    let words = Words::default().named().map(|(word, _)| (word, Side::Right));
    let right = [
        ("off: at fault", Side::Right),
        ("off: healthy", Side::Right),
        ("first word", Side::Right),
    ];
    let mut grid = Grid::new(left.into_iter().chain(words).chain(right));
    for outcome in &merit.outcomes {
        let row = row(outcome);
        if outcome.shutdowns_healthy > 0 { grid.push_strong(row) } else { grid.push(row) }
    }
    grid
}

fn row(outcome: &ForeignOutcome) -> Vec<String> {
    let count = |count: u64| if count == 0 { NONE.into() } else { count.to_string() };
    let sensible = match outcome.sensible {
        Sensible::Shutdown => "sensible: a shutdown",
        Sensible::NoShutdown => "sensible: anything but a shutdown",
        Sensible::Any => "sensible: any command",
        Sensible::Nothing => "sensible: no command",
    };
    let small = match outcome.strengths.as_str() {
        "" => sensible.into(),
        strengths => format!("{strengths}; {sensible}"),
    };
    let mut row = vec![format!("{}\n{small}", outcome.title), outcome.flights.to_string()];
    row.extend(outcome.words.named().map(|(_, number)| count(number)));
    row.push(count(outcome.shutdowns_at_fault));
    row.push(outcome.shutdowns_healthy.to_string());
    let first = outcome.first_word.as_ref();
    row.push(first.map_or(NONE.into(), |l| format!("{:.2} s\n{:.2} s", l.median_s, l.longest_s)));
    row
}
