//! Monitors a log: reads a CSV file, feeds it to the twin and the diagnosis, and prints every change of the finding.

use servotwin::prelude::*;

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
    let mut monitor = Monitor::new(study, diagnoser)?;
    for (time_s, finding) in monitor.push_table(&log)? {
        println!("{time_s:6.2} s  {finding}");
        for reason in &finding.evidence {
            println!("          {reason}");
        }
    }
    Ok(())
}
