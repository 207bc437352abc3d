//! The hybrid twin at work: flights in which a fault begins, a twin that steps beside the plant,
//! and a diagnosis that runs.
//!
//! - [`plan`]: which fault begins when, in which environment, in which specimen
//! - [`campaign`]: flights in lanes, each observed beside the twin of its environment
//! - [`windows`]: which windows are looked at
//! - [`training_windows`]: what the diagnosis learns from: windows of flights, one table for each kind
//! - [`train`]: bands, trees and committee for each kind: a diagnoser
//! - [`runtime`]: a twin and a diagnosis beside an actuator, one call for each sample
//! - [`watcher`]: the runtime beside a log or a live stream
//! - [`replay`]: what it says of a flight that is over
//! - [`closed_loop`]: a plant beside the runtime, and a flight control computer that reacts
//! - [`judge`]: how fast, how sure, how often wrong it is
//! - [`band`]: the confidence band as a field over what is asked, with a promise
//! - [`unseen_faults`]: what it says of faults that it was never trained on

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
