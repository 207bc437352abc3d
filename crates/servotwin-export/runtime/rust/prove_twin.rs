//! Entry points for the twin in `servotwin prove`, those of `prove_twin.c`. Not part of an export.
//!
//! # Safety
//! Callers pass lists as long as those of the exported program.

use crate::guarded;
use servotwin_flight::course::Knot;
use servotwin_flight::twin::Twin;
use servotwin_flight::twin_sizes::{
    CONSTANTS, FAULTS, GRADIENTS, HELD, INPUTS, PARAMETERS, STATES, VARIABLES,
};
use servotwin_flight::{equations, twin_tables};

type Pairs = [[f64; 2]; INPUTS];

/// A twin, and what an evaluation wrote last.
pub struct ProvenTwin {
    twin: Twin,
    variables: [f64; VARIABLES],
    gradients: [f64; GRADIENTS],
}

/// Inputs are pairs of a value and a slope.
fn knots(pairs: &Pairs) -> [Knot; INPUTS] {
    pairs.map(|[value, slope_per_s]| Knot { value, slope_per_s })
}

#[unsafe(no_mangle)]
pub extern "C" fn prove_twin_size() -> u64 {
    size_of::<ProvenTwin>() as u64
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_twin_parameters(
    intensities: *const [f64; FAULTS],
    parameters: *mut [f64; PARAMETERS],
) {
    unsafe {
        *parameters = twin_tables::PARAMETERS;
        guarded((), || equations::faults(&*intensities, &mut *parameters));
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_twin_start(
    proven: *mut ProvenTwin,
    parameters: *const [f64; PARAMETERS],
    pairs: *const Pairs,
) -> i32 {
    unsafe { (&raw mut (*proven).twin).write(Twin::new()) };
    let (proven, parameters, pairs) = unsafe { (&mut *proven, &*parameters, &*pairs) };
    let is_well = guarded(false, || proven.twin.start(parameters, &knots(pairs)).is_ok());
    proven.variables = *proven.twin.variables();
    i32::from(is_well)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_twin_step(proven: *mut ProvenTwin, pairs: *const Pairs) -> i32 {
    let (proven, pairs) = unsafe { (&mut *proven, &*pairs) };
    let is_well = guarded(false, || proven.twin.step(&knots(pairs)).is_ok());
    proven.variables = *proven.twin.variables();
    i32::from(is_well)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_twin_load(
    proven: *mut ProvenTwin,
    parameters: *const [f64; PARAMETERS],
) {
    guarded((), || unsafe { (&mut *proven).twin.load(&*parameters) });
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_twin_variables(proven: *const ProvenTwin) -> *const f64 {
    unsafe { (&raw const (*proven).variables).cast() }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_twin_gradients(proven: *const ProvenTwin) -> *const f64 {
    unsafe { (&raw const (*proven).gradients).cast() }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_twin_point(
    proven: *mut ProvenTwin,
    which: i32,
    parameters: *const [f64; PARAMETERS],
    given: *const [f64; STATES + HELD],
    slopes: *const [f64; INPUTS],
) {
    // The twin itself may not have been started, so nothing refers to all of it.
    let (variables, gradients) =
        unsafe { (&mut (*proven).variables, &mut (*proven).gradients) };
    let (parameters, given, slopes) = unsafe { (&*parameters, &*given, &*slopes) };
    let mut constants = [0.0; CONSTANTS];
    variables.fill(0.0);
    variables[..STATES + HELD].copy_from_slice(given);
    guarded((), || {
        equations::constants(parameters, &mut constants);
        equations::stand_ins(parameters, variables);
    });
    for (slope, place) in slopes.iter().zip(&twin_tables::SLOPES) {
        gradients[*place] = *slope;
    }
    let is_evaluated = guarded(false, || {
        evaluate(which, &constants, variables, gradients);
        true
    });
    if !is_evaluated {
        variables.fill(f64::NAN);
    }
}

/// Evaluates all variables, their gradients, the motion, or a tick.
fn evaluate(
    which: i32,
    constants: &[f64; CONSTANTS],
    variables: &mut [f64; VARIABLES],
    gradients: &mut [f64; GRADIENTS],
) {
    match which {
        1 => equations::begin(constants, variables, gradients),
        2 => equations::motion(constants, variables),
        _ => {
            equations::evaluate(constants, variables);
            if let Ok(clock) = usize::try_from(which - 3) {
                equations::tick(clock, constants, variables);
            }
        }
    }
}
