//! Runs an FMU in co-simulation: `fmi-rs-host FMU VERSION NOISE INPUT AT_STEP VALUE OUTPUT…`, each variable by its
//! reference. The parameter NOISE becomes 0; the input gets its value before that step. Prints the outputs after each of 200 steps of 10 ms.

use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation as _, Common as _};
use fmi::fmi3::import::Fmi3Import;
use fmi::fmi3::{CoSimulation as _, Common as _, Fmi3Model as _, GetSet as _};

type Failure = Box<dyn std::error::Error>;

const STEPS: usize = 200;
const STEP_S: f64 = 0.01;

struct Run {
    noise: u32,
    input: u32,
    at_step: usize,
    value: f64,
    outputs: Vec<u32>,
}

fn print(values: &[f64]) {
    let row: Vec<String> = values.iter().map(|value| format!("{value:e}")).collect();
    println!("{}", row.join(","));
}

fn run_two(path: &str, run: &Run) -> Result<(), Failure> {
    let import: Fmi2Import = fmi::import::from_path(path)?;
    let mut slave = import.instantiate_cs("slave", false, true)?;
    slave.setup_experiment(None, 0.0, None)?;
    slave.set_real(&[run.noise], &[0.0])?;
    slave.enter_initialization_mode()?;
    slave.exit_initialization_mode()?;
    let mut values = vec![0.0; run.outputs.len()];
    for step in 0..STEPS {
        if step == run.at_step {
            slave.set_real(&[run.input], &[run.value])?;
        }
        slave.do_step(step as f64 * STEP_S, STEP_S, true)?;
        slave.get_real(&run.outputs, &mut values)?;
        print(&values);
    }
    Ok(())
}

fn run_three(path: &str, run: &Run) -> Result<(), Failure> {
    let import: Fmi3Import = fmi::import::from_path(path)?;
    let mut slave = import.instantiate_cs("slave", false, true, false, false, &[])?;
    slave.set_float64(&[run.noise], &[0.0])?;
    slave.enter_initialization_mode(None, 0.0, None)?;
    slave.exit_initialization_mode()?;
    let mut values = vec![0.0; run.outputs.len()];
    let (mut event, mut terminate, mut early, mut last_s) = (false, false, false, 0.0);
    for step in 0..STEPS {
        if step == run.at_step {
            slave.set_float64(&[run.input], &[run.value])?;
        }
        let time_s = step as f64 * STEP_S;
        slave.do_step(time_s, STEP_S, true, &mut event, &mut terminate, &mut early, &mut last_s)?;
        slave.get_float64(&run.outputs, &mut values)?;
        print(&values);
    }
    Ok(())
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, version, noise, input, at_step, value, outputs @ ..] = arguments.as_slice() else {
        return Err("FMU VERSION NOISE INPUT AT_STEP VALUE OUTPUT…".into());
    };
    let outputs: Result<Vec<u32>, _> = outputs.iter().map(|output| output.parse()).collect();
    let run = Run {
        noise: noise.parse()?,
        input: input.parse()?,
        at_step: at_step.parse()?,
        value: value.parse()?,
        outputs: outputs?,
    };
    if version == "2" { run_two(path, &run) } else { run_three(path, &run) }
}
