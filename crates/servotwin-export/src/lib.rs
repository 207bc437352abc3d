//! A trained diagnosis for a flight control computer.
//!
//! - [`c`]: the diagnoser as C99 without allocation or recursion
//! - [`certificate`]: what a proof showed, as data and as a page
//! - [`folder`]: an export on disk, with what it was made of
//! - [`prove`]: compiles an export and compares its decisions with those of the diagnoser
//!
//! The flight control computer's answer must be the trained one. Therefore nothing is approximated: the C code has the
//! same operations in the same order, and the comparison demands equal bits.

pub mod c;
pub mod certificate;
mod error;
pub mod folder;
pub mod prove;

pub use error::ExportError;
