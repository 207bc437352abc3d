//! The one integration test binary of this crate.

mod dialect;
mod files;
#[allow(dead_code, reason = "shared by several crates")]
mod folder;
mod lines;
mod moment;
mod numbers;
mod table;
mod texts;
mod toml_text;
