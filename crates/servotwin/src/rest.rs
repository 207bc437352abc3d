//! The steady state of a system: states and eigenvalues.

use crate::eigenvalues;
use crate::ensemble::{Ensemble, Variant};
use crate::system::System;
use nalgebra::Complex;
use servotwin_model::solver::{self, Cause};

/// The steady state of a system.
pub struct Rest {
    /// The states, in the order of the program.
    pub states: Vec<f64>,
    /// The eigenvalues at these states, 1/s, slowest first.
    pub eigenvalues: Vec<Complex<f64>>,
    /// Whether the states are a steady state. Otherwise the search ended there without one.
    pub is_found: bool,
    /// Whether a limit cycle was measured.
    pub limit_cycle: bool,
}

/// Why a run stopped, with the name of the state.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the run stopped at {time_s} s at {state}: {cause}")]
pub struct Stopped {
    /// Time, s.
    pub time_s: f64,
    /// The state with the largest error.
    pub state: String,
    /// Cause of the failure.
    pub(crate) cause: Cause,
}

impl Stopped {
    /// Adds the name of the state to a solver's failure.
    pub fn new(system: &System, failure: solver::SolverFailure) -> Self {
        let state = system.program.states().get(failure.state);
        let state = state.map_or_else(String::new, |state| state.name.clone());
        Stopped { time_s: failure.time_s, state, cause: failure.cause }
    }
}

/// Why a steady state cannot be described.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RestError {
    /// The search for a steady state stopped.
    #[error(transparent)]
    Stopped(Stopped),
    /// The equations at the steady state give numbers that are not finite.
    #[error("the equations at rest give numbers that are not finite")]
    NotFinite,
}

/// The steady state of a system at its default inputs.
///
/// # Errors
/// The solver stopped, or the equations give numbers that are not finite.
pub fn of(system: &System) -> Result<Rest, RestError> {
    let program = &system.program;
    let inputs = system.default_inputs();
    let variant = Variant { inputs: inputs.iter().collect(), ..Variant::default() };
    let found = Ensemble::new(program).settle(&variant);
    let (states, work) =
        found.map_err(|failure| RestError::Stopped(Stopped::new(system, failure)))?;
    let values: Vec<f64> = inputs.iter().map(|input| input.value(0.0)).collect();
    let eigenvalues = eigenvalues::of_system(program, &states, &values);
    Ok(Rest {
        states,
        eigenvalues: eigenvalues.ok_or(RestError::NotFinite)?,
        is_found: work.unsettled == 0,
        limit_cycle: work.limit_cycles > 0,
    })
}
