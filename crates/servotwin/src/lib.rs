//! The hybrid twin of electro-hydraulic servo actuators.

pub mod built_in;
pub mod catalogue;
pub mod compiled;
pub mod document;
pub mod eigenvalues;
pub mod ensemble;
pub mod evaluation;
pub mod figure;
pub mod files;
pub mod fit;
pub mod flight;
pub mod format;
pub mod job;
pub mod kind;
pub mod log;
pub mod nearest;
pub mod recording;
pub mod report;
pub mod rest;
pub mod schema;
pub mod shown;
pub mod signal;
pub mod study;
pub mod system;
pub mod table;
pub mod template;
