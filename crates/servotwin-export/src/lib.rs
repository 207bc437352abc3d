//! A trained diagnosis and its twin for a flight control computer, and a system for other simulation tools.
//!
//! - [`c`]: the diagnoser and its twin as C99 without allocation or recursion
//! - [`certificate`]: what a proof showed, as data and as a page
//! - [`fmu`]: the system with its faults for other simulation tools
//! - [`folder`]: an export on disk, with what it was made of
//! - [`prove`]: compiles an export and compares its decisions with those of the diagnoser
//! - [`recording`]: the trees of a study of recordings as C99
//!
//! The flight control computer's answer must be the trained one. Therefore nothing is approximated: the code has the
//! same operations in the same order, and the comparison demands equal bits.

pub mod c;
pub mod certificate;
mod comparison;
mod compile;
mod description;
mod error;
mod features;
pub mod fmu;
pub mod folder;
mod notation;
pub mod prove;
pub mod recording;
mod source_file;
mod tables;
mod twin;

pub use comparison::FolderComparison;
pub use description::Description;
pub use error::ExportError;
pub use source_file::SourceFile;
pub use twin::{ExportedReaction, ExportedTwin};
