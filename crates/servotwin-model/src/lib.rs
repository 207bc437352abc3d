//! Physics of electro-hydraulic servo actuators.
//!
//! `no_std` with `alloc`. From the bottom up: [`scalar`] is what every equation is generic over (`f64`, [`lanes`], dual
//! numbers, [`symbol`]s), with the functions of [`math`]. [`fluid`] and [`spec`] describe liquids, parameters and
//! faults. [`components`] lists the kinds of [`component`]s, each of which wires its equation blocks. [`network`]
//! connects instances, [`program`] sorts their blocks into one flat list, with the gradients of [`jacobian`], and
//! [`solver`] steps it for many variants at once. [`c_source`] writes the same step as C.
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
