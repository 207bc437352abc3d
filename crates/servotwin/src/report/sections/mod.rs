//! The sections of the report, one file each; [`super::ALL`] is their order.

pub mod ablation;
pub mod actuator_tree;
pub mod ambiguity;
pub mod bands;
pub mod classifiers;
pub mod commands;
pub mod commands_curve;
pub mod committee;
pub mod confusion;
pub mod detectability;
pub mod exclusions;
pub mod faults;
mod findings;
pub mod flights;
pub mod foreign;
pub mod leaves;
pub mod macrostructure;
pub mod making;
pub mod protocols;
pub mod residuals;
pub mod robustness;
pub mod safety;
pub mod settings;
pub mod summary;
pub mod system;
pub mod twin;
pub mod uncertainty;
