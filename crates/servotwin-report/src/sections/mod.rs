//! The sections of the report, one file each; [`super::CHAPTERS`] sets their order.

pub mod ablation;
pub mod actuator_tree;
pub mod ambiguity;
pub mod bands;
pub mod classifiers;
pub mod commands;
pub mod committee;
pub mod confusion;
pub mod constants;
pub mod detectability;
pub mod exclusions;
pub mod faults;
pub mod flights;
pub mod macrostructure;
pub mod making;
pub mod protocols;
pub mod residuals;
pub mod safety;
pub mod settings;
pub mod summary;
pub mod system;
pub mod twin;
pub mod uncertainty;
pub mod unseen;
