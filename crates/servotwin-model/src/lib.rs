//! Physics of electro-hydraulic servo actuators.
#![no_std]
extern crate alloc;

pub(crate) mod atmosphere;
pub mod c_source;
pub mod component;
pub mod components;
pub(crate) mod dual;
mod equal_length_groups;
pub(crate) mod equation;
pub mod fluid;
pub mod hash;
pub mod jacobian;
mod lane_offset;
pub mod lanes;
pub(crate) mod lu;
pub mod math;
pub mod network;
pub mod program;
pub mod scalar;
mod sequence;
pub mod signal;
pub mod solver;
pub mod spec;
pub mod symbol;
pub(crate) mod wiring;
