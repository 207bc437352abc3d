//! The hybrid twin at work: flights in which a fault begins, a twin that steps beside the plant,
//! and a diagnosis that runs.
//!
//! - [`plan`]: which fault begins when, in which environment, in which specimen
//! - [`flown`]: flights in lanes, each observed beside the twin of its environment
//! - [`windows`]: which windows are looked at
//! - [`lessons`]: what the diagnosis learns from: windows of flights, one table for each kind
//! - [`train`]: bands, trees and committee for each kind: a diagnoser
//! - [`runtime`]: a twin and a diagnosis beside an actuator, one call for each sample
//! - [`watcher`]: the runtime beside a log or a live stream
//! - [`told`]: what it says of a flight that is over
//! - [`closed_loop`]: a plant beside the runtime, and a flight control computer that reacts
//! - [`judge`]: how fast, how sure, how often wrong it is
//! - [`band`]: the confidence band as a field over what is asked, with a promise
//! - [`foreign`]: what it says of faults that it was never trained on

pub mod band;
pub mod closed_loop;
pub mod flown;
pub mod foreign;
pub mod further;
pub mod judge;
pub mod lessons;
pub mod plan;
pub mod runtime;
pub mod told;
pub mod train;
pub mod watcher;
pub mod windows;
