//! Flights: runs in which a fault begins, watched by diagnoses. Every flight becomes a row of outcomes.
//!
//! - `watched`: sessions watch the runs of any suite
//! - `effects`: runs of a suite in closed loop, and what their faults do to the flight
//! - [`margin`]: how far a flight is from an error
//! - [`worst_case`]: a search for the flights in which the diagnosis is closest to an error
//! - [`unseen_faults`]: the response to faults outside the training data

mod effects;
mod evidence;
pub mod margin;
pub mod unseen_faults;
pub(crate) mod watched;
pub mod worst_case;
