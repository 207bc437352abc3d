//! Table 1 of the seed paper, from the study's classes.

use servotwin::study::Study;

/// A row of table 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// What the flight control computer must do.
    pub command: String,
    /// What is broken.
    pub detail: String,
    /// Components of one unit.
    pub components: usize,
    /// Faults of one unit, every intensity counted.
    pub faults: usize,
}

/// The rows, in the order of the study.
pub fn rows(study: &Study) -> Vec<Row> {
    let row = |(place, class): (usize, &servotwin::study::Class)| {
        let own = study.faults.iter().filter(|fault| fault.class == place && fault.unit == 0);
        Row {
            command: class.command.clone(),
            detail: class.detail.clone(),
            components: class.components(),
            faults: own.count(),
        }
    };
    study.classes.iter().enumerate().map(row).collect()
}

/// Components and faults of all units together.
pub fn sum(study: &Study) -> (usize, usize) {
    let components: usize = rows(study).iter().map(|row| row.components).sum();
    (components * study.units.len(), study.faults.len())
}
