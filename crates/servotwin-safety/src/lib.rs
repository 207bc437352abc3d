//! Artefacts for a safety case, filled from the results of a study.
//!
//! - [`fmea`]: an FMEA with one row per fault of the system, in which every cell names its evidence
//! - [`sensors`]: what each sensor buys: every set that leaves control possible, judged
//! - [`function_rate`]: the failure rate of the function per flight hour, with the hybrid twin and without
//! - [`fault_tree`]: fault trees with counted probabilities, as Open-PSA documents and figures
//! - [`counts`]: judged flights and tests on the ground, counted for both
//! - [`worst_case`]: a search for the flights in which the diagnosis is closest to an error
//!
//! Nothing is invented: failure rates come from a table of the user ([`rates`]), everything else from simulations, and a
//! cell without evidence names what is missing.

pub mod counts;
mod error;
pub mod fault_tree;
pub mod fmea;
pub mod function_rate;
pub mod interval;
pub mod rated_flights;
pub mod rates;
pub mod results;
pub mod sensors;
pub mod tree;
pub mod worst_case;

pub use error::SafetyError;
