//! The hybrid twin of electro-hydraulic servo actuators.

pub mod document;
pub mod ensemble;
pub mod files;
pub mod nearest;
pub mod system;
pub mod table;
