//! File input and output of servotwin, independent of the content.
//!
//! [`table`] holds named columns and reads and writes them as CSV and Parquet. [`toml_text`] reads TOML
//! with the place of every value, for messages that point at it. [`files`] writes a file whole or not at all, and
//! [`leftovers`] removes the temporary files of killed processes. [`manifest`] keeps the checksum of every file of an
//! output folder. [`moment`] reads dates and times, and [`sanitize`] makes untrusted text safe to print. [`text`]
//! writes names and numbers for readers, and [`nearest`] finds the known name nearest to a mistyped one.
//!
//! No module here depends on a system, a study or a diagnosis.

pub mod files;
pub mod leftovers;
pub mod manifest;
pub mod moment;
pub mod nearest;
pub mod sanitize;
pub mod table;
pub mod text;
pub mod toml_text;
