//! The hybrid twin of electro-hydraulic servo actuators.

pub mod signal;
