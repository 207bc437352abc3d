//! Table 1 of the seed paper, from the study's classes.

use servotwin::study::Study;

/// A row of table 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FaultRow {
    /// The action that the flight control computer must take.
    pub action: String,
    /// The fault class.
    pub detail: String,
    /// The number of components of one actuator in this class.
    pub components: usize,
    /// The number of faults of one actuator, counting every intensity.
    pub faults: usize,
}

/// Returns the rows in the order of the study's classes.
pub fn rows(study: &Study) -> Vec<FaultRow> {
    let row = |(place, class): (usize, &servotwin::study::Class)| {
        let own = study.faults.iter().filter(|fault| fault.class == place && fault.actuator == 0);
        FaultRow {
            action: class.action.clone(),
            detail: class.detail.clone(),
            components: class.components(),
            faults: own.count(),
        }
    };
    study.classes.iter().enumerate().map(row).collect()
}

/// Counts components and faults over all actuators.
pub fn sum(study: &Study) -> (usize, usize) {
    let components: usize = rows(study).iter().map(|row| row.components).sum();
    (components * study.actuators.len(), study.faults.len())
}
