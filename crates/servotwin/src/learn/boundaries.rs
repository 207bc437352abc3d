//! The boundary values of the twin that a sensor stands next to, and what a wrong reading of them does.
//!
//! A twin at rest is asked twice, with an input as usual and a little larger. What its sensors then read is the
//! direction in which a wrong reading of this input moves their residuals.

use crate::live::runtime::{self, RuntimeError};
use crate::rest::Stopped;
use crate::study::Study;
use servotwin_diagnosis::diagnoser::{Boundary, DiagnosedSensor};
use servotwin_diagnosis::features::Quantity;
use servotwin_model::program::Slot;
use servotwin_model::solver::{Knot, SolverSettings, Twin};

/// By how much an input is changed, as a fraction of its usual value.
const CHANGE: f64 = 0.01;

/// The sensor next to a boundary follows it to this fraction. A sensor that follows less also depends on other things.
const FOLLOWS: f64 = 0.9;

/// The boundaries of a study's system. `watched` is the number of sensors, at the beginning of `sensors`, that have a
/// band.
///
/// # Errors
/// The diagnosis reads a sensor that the study does not have; the twin cannot be simulated with its usual inputs.
pub(crate) fn boundaries(
    study: &Study,
    sensors: &[DiagnosedSensor],
    watched: usize,
) -> Result<Vec<Boundary>, RuntimeError> {
    let slots = runtime::slots(study, sensors[..watched].iter().map(|s| s.name.as_str()))?;
    let usual = runtime::defaults(study);
    let at_rest = readings(study, &usual, &slots)?;
    let mut found = vec![];
    for (input, external) in study.system.network().inputs.iter().enumerate() {
        let is_boundary = input != study.command_input && external.default != 0.0;
        let unit = |sensor: usize| study.system.sensors[study.measured[sensor]].unit;
        let nearby = |sensor: &usize| unit(*sensor) == external.unit;
        if !is_boundary || !(0..watched).any(|sensor| nearby(&sensor)) {
            continue;
        }
        let change = CHANGE * external.default;
        let mut inputs = usual.clone();
        inputs[input].value += change;
        let changed = readings(study, &inputs, &slots)?;
        let follows = |sensor: usize| (changed[sensor] - at_rest[sensor]) / change;
        let next = (0..watched).filter(nearby).max_by(|&a, &b| follows(a).total_cmp(&follows(b)));
        let Some(next) = next.filter(|&next| follows(next) >= FOLLOWS) else { continue };
        let own = (0..watched).filter(|&sensor| sensors[sensor].actuator == sensors[next].actuator);
        let effects = own.map(|sensor| (sensor as u32, follows(sensor) / sensors[sensor].scale));
        found.push(Boundary {
            input: input as u32,
            sensor: next as u32,
            is_return: sensors[next].quantity == Quantity::Return,
            effects: effects.collect(),
        });
    }
    Ok(found)
}

/// The values of some slots in the steady state, SI.
fn readings(study: &Study, inputs: &[Knot], slots: &[Slot]) -> Result<Vec<f64>, RuntimeError> {
    let program = &study.system.program;
    let between = runtime::between(study);
    let mut twin = Twin::new(program, SolverSettings::of_runs(), study.sample_period_s, between);
    let parameters = program.parameters(&[]);
    twin.load(&parameters);
    twin.settle(inputs, &program.first_guess(&parameters))
        .map_err(|failure| RuntimeError::Twin(Stopped::new(&study.system, failure)))?;
    Ok(slots.iter().map(|&slot| twin.value(slot)).collect())
}
