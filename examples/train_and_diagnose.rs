//! Runs a whole study, then lets its diagnosis monitor a simulated fault.

use servotwin::prelude::*;
use servotwin_watch::whole_table::watch_table;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The quick size has no flights, from which the diagnosis at work learns.
    let study = Study::default().full()?;
    train_and_diagnose(&study, "out", "actuator_1.servo_valve.bias_positive")
}

/// Runs the study into a folder and prints what its diagnosis finds.
pub fn train_and_diagnose(
    study: &Study,
    out: &str,
    fault: &str,
) -> Result<(), Box<dyn std::error::Error>> {
    let results = study.run(out)?;
    servotwin_report::write(results.folder(), study)?;
    println!("the report is {}", results.folder().report().display());

    let diagnoser = results.diagnoser(Scenario::Noise)?;
    let record = Simulation::new(&study.system)
        .input("command", "noise:rms=3deg,bandwidth=1Hz,seed=99")
        .fault(fault, 1.0)
        .noise(1)
        .sample_period_s(diagnoser.period_s)
        .run()?;
    let (table, stop) = (record.table()?, AtomicBool::new(false));
    let found = watch_table(study, &Arc::new(diagnoser), &table, &stop)?;
    for (time_s, finding) in found.changes {
        println!("{time_s:6.2} s  {finding}");
    }
    Ok(())
}
