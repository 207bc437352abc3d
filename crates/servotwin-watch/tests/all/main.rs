//! The one integration test binary of this crate.

#[allow(dead_code, reason = "shared by several crates")]
#[path = "../../../servotwin-io/tests/all/folder.rs"]
mod folder;
mod frame;
mod guard;
mod intake;
mod log;
