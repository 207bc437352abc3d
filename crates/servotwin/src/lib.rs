//! The hybrid twin of electro-hydraulic servo actuators.

pub mod ensemble;
