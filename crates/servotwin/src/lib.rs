//! The hybrid twin of electro-hydraulic servo actuators.

pub mod ensemble;
pub mod files;
pub mod nearest;
pub mod table;
