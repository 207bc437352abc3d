//! All integration tests of the crate in one binary, to link once.

mod baseline;
mod diagnoser;
#[allow(dead_code)]
#[path = "../toy/mod.rs"]
mod toy;
