//! The hybrid twin in operation: a twin and a running diagnosis with an actuator.
//!
//! - [`runtime`]: both, one call per sample
//! - `monitor`: the same by names
//! - [`watcher`]: the runtime on a log or a live stream
//! - [`observer`]: who is told what it found, in names
//! - [`closed_loop`]: a plant with the runtime, and a flight control computer that reacts
//! - [`cost`]: what a fault and the reaction to it cost in fluid, time and authority
//! - [`tracking`]: the error of the controlled quantity, the force fight, the first report of a fault

pub mod closed_loop;
pub mod cost;
pub(crate) mod monitor;
pub mod observer;
pub mod runtime;
pub mod tracking;
pub mod watcher;
