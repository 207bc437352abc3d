//! The hybrid twin in flight: a fault begins, a twin steps in parallel with the plant, and a diagnosis runs.
//!
//! - [`plan`]: which fault begins when, in which environment, in which specimen
//! - [`campaign`]: flights in lanes, each observed together with the twin of its environment
//! - [`windows`]: which windows are judged
//! - [`training_windows`]: training data: windows of flights, one table for each kind
//! - [`hard_negatives`]: healthy out-of-band windows from many environments
//! - [`train`]: bands, trees and committee for each kind: a diagnoser
//! - [`runtime`]: a twin and a diagnosis in parallel with an actuator, one call for each sample
//! - [`watcher`]: the runtime on a log or a live stream
//! - [`replay`]: the diagnosis of a recorded flight
//! - [`closed_loop`]: a plant, the runtime, and a flight control computer that reacts
//! - [`judge`]: latency, isolation rate and errors
//! - [`band`]: the conditional band with its guarantee
//! - [`unseen_faults`]: the diagnosis of faults without training data

pub mod band;
pub mod campaign;
pub mod closed_loop;
pub mod hard_negatives;
pub mod judge;
pub mod plan;
pub mod replay;
pub mod runtime;
pub mod train;
pub mod training_windows;
pub mod unseen_faults;
pub mod watcher;
pub mod windows;
