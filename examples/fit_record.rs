//! Fits the twin's parameters to a record of an actuator whose friction is higher than nominal.

use servotwin::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    fit_record()
}

/// Prints the estimated parameters and the findings.
pub fn fit_record() -> Result<(), Box<dyn std::error::Error>> {
    let study = Study::read("spring_actuator")?;
    let measured = Simulation::new(&study.system)
        .input("command", "noise:rms=4deg,bandwidth=1Hz,seed=5")
        .parameter("cylinder.coulomb_friction_n", 540.0)
        .duration_s(15.0)
        .run()?;
    let record = FitRecord::from_table("record", &measured.table()?, &study.system)?;
    let fit = Fit::of_study(&study, vec![record]);
    let fitted = fit.solve()?;
    match fitted.is_update() {
        true => println!("the record is within tolerances:"),
        false => println!("tolerances do not explain the record:"),
    }
    for (name, value) in fit.parameters(&fitted) {
        println!("{name} = {value:.4e}");
    }
    for finding in &fitted.findings {
        println!("{finding}");
    }
    Ok(())
}
