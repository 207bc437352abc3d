//! A trained diagnosis and its twin for a flight control computer, and a system for other simulation tools.
//!
//! - [`c`]: the diagnoser as C99 without allocation or recursion
//! - [`certificate`]: what a proof showed, as data and as a page
//! - [`fmu`]: the system with its faults for other simulation tools
//! - [`folder`]: an export on disk, with what it was made of
//! - [`prove`]: compiles an export and compares its decisions with those of the diagnoser
//!
//! The flight control computer's answer must be the trained one. Therefore nothing is approximated: the C code has the
//! same operations in the same order, and the comparison demands equal bits.

pub mod c;
pub mod certificate;
mod compile;
mod error;
pub mod fmu;
pub mod folder;
pub mod prove;

pub use error::ExportError;
