//! Physics of electro-hydraulic servo actuators.
#![no_std]
extern crate alloc;

pub mod atmosphere;
pub mod c_source;
pub mod component;
pub mod components;
pub mod dual;
pub mod equation;
pub mod fluid;
pub mod jacobian;
pub mod lanes;
pub mod lu;
pub mod math;
pub mod network;
mod place;
pub mod program;
mod runs;
pub mod scalar;
mod sequence;
pub mod signal;
pub mod solver;
pub mod spec;
pub mod symbol;
pub mod wiring;
