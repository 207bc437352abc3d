//! The sections of the report, one file each; [`super::CHAPTERS`] sets their order.

pub(crate) mod actuator_tree;
pub(crate) mod bands;
pub(crate) mod classifiers;
pub(crate) mod commands;
pub(crate) mod committee;
pub(crate) mod confusion;
pub(crate) mod constants;
pub(crate) mod detectability;
pub(crate) mod exclusions;
pub(crate) mod faults;
pub(crate) mod flights;
pub(crate) mod macrostructure;
pub(crate) mod making;
pub(crate) mod protocols;
pub(crate) mod residuals;
pub(crate) mod safety;
pub(crate) mod settings;
pub(crate) mod summary;
pub(crate) mod system;
pub(crate) mod twin;
pub(crate) mod unseen;
