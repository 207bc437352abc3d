//! The languages of an export.

use serde::{Deserialize, Serialize};

/// The language of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Language {
    /// C99.
    #[default]
    C,
    /// Rust without its standard library.
    Rust,
}
