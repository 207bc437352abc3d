//! The one integration test binary of this crate.

mod figure;
#[allow(dead_code, reason = "shared by several crates")]
#[path = "../../../servotwin-io/tests/all/folder.rs"]
mod folder;
