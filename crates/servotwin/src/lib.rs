//! The hybrid twin of electro-hydraulic servo actuators.

pub mod document;
pub mod eigenvalues;
pub mod ensemble;
pub mod evaluation;
pub mod figure;
pub mod files;
pub mod fit;
pub mod flight;
pub mod job;
pub mod log;
pub mod nearest;
pub mod report;
pub mod signal;
pub mod study;
pub mod system;
pub mod table;
