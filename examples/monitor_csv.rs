//! Monitors a log: reads a CSV file, feeds it to the twin and the diagnosis, and prints every change of the finding.

use servotwin::prelude::*;
use servotwin_watch::whole_table::watch_table;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let study = Study::default();
    let diagnoser = read_diagnoser("out/diagnoser-realistic.json")?;
    monitor_csv(&study, diagnoser, "flight.csv")
}

/// Prints every change of the finding with its evidence.
pub fn monitor_csv(
    study: &Study,
    diagnoser: Diagnoser,
    log: &str,
) -> Result<(), Box<dyn std::error::Error>> {
    let log = Table::read(log)?;
    let found = watch_table(study, &Arc::new(diagnoser), &log, &AtomicBool::new(false))?;
    for warning in &found.warnings {
        eprintln!("warning: {warning}");
    }
    for (time_s, finding) in found.changes {
        println!("{time_s:6.2} s  {finding}");
        for reason in &finding.evidence {
            println!("          {reason}");
        }
    }
    Ok(())
}
