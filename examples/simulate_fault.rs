//! Simulates ten seconds of an aileron with a leaking actuator and draws what its sensors measure.

use servotwin::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    simulate_fault("leak.svg", 10.0)
}

/// Writes the figure and prints the mean pressures.
pub fn simulate_fault(figure: &str, duration_s: f64) -> Result<(), Box<dyn std::error::Error>> {
    let system = System::default();
    let simulation = Simulation::new(&system)
        .input("command", "noise:rms=5deg,bandwidth=1Hz,seed=7")
        .record(["command", "p_a_1", "p_b_1", "x_p_1"])
        .duration_s(duration_s);
    let healthy = simulation.run()?.table()?;
    let leaking = simulation.fault("actuator_1.leakage_a.leakage", 0.5).run()?;
    leaking.figure().draw().save(figure)?;

    let mean_bar = |table: &Table| -> Result<f64, TableError> {
        let pressures_pa = table.f64("p_a_1_pa")?;
        Ok(pressures_pa.iter().sum::<f64>() / pressures_pa.len() as f64 / 1e5)
    };
    println!("mean pressure in chamber A, healthy: {:.1} bar", mean_bar(&healthy)?);
    println!("mean pressure in chamber A, leaking: {:.1} bar", mean_bar(&leaking.table()?)?);
    Ok(())
}
