//! Physics of electro-hydraulic servo actuators.
#![no_std]
extern crate alloc;

pub mod atmosphere;
pub mod c_source;
pub mod component;
pub mod components;
pub mod dual;
mod equal_length_groups;
pub mod equation;
pub mod fluid;
pub mod hash;
pub mod jacobian;
mod lane_offset;
pub mod lanes;
pub mod lu;
pub mod math;
pub mod network;
pub mod program;
pub mod scalar;
mod sequence;
pub mod signal;
pub mod solver;
pub mod spec;
pub mod symbol;
pub mod wiring;
