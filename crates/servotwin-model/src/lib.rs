//! Physics of electro-hydraulic servo actuators.
#![no_std]
extern crate alloc;
