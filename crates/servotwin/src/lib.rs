//! The hybrid twin of electro-hydraulic servo actuators.

pub mod ensemble;
pub mod figure;
pub mod files;
pub mod nearest;
pub mod signal;
pub mod table;
