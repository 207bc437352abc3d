//! The hybrid twin in operation: flights in which a fault begins, a twin that runs beside the plant, and a running
//! diagnosis.
//!
//! - [`windows`]: the windows that a diagnosis examines
//! - [`spreads`]: learns how the spread of healthy residuals grows with the flow
//! - [`training_windows`]: the training windows taken out of flights, one table for each kind
//! - [`train`]: trains a diagnoser: bands, trees and committee for each kind
//! - `boundaries`: what a wrong reading of a boundary value does
//! - [`runtime`]: a twin and a diagnosis beside an actuator, one call per sample
//! - [`watcher`]: the runtime on a log or a live stream
//! - [`closed_loop`]: a plant with the runtime, and a flight control computer that reacts
//! - [`cost`]: what a fault and the reaction to it cost in fluid, time and authority
//! - [`tracking`]: the error of the controlled quantity, the force fight, the first report of a fault
//! - `effects`: runs of a suite in closed loop, and what their faults do to the flight
//! - [`margin`]: how far a flight is from an error
//! - [`worst_case`]: a search for the flights in which the diagnosis is closest to an error
//! - [`unseen_faults`]: the response to faults outside the training data

pub(crate) mod boundaries;
pub mod closed_loop;
pub mod cost;
mod effects;
mod evidence;
pub mod margin;
pub mod runtime;
pub mod spreads;
pub mod tracking;
pub mod train;
pub mod training_windows;
pub mod unseen_faults;
pub(crate) mod watched;
pub mod watcher;
pub mod windows;
pub mod worst_case;
