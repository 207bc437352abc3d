//! The one integration test binary of this crate: one module per room.

mod beside;
mod data_card;
mod effort;
mod errors;
mod evaluating;
mod evaluation;
mod examples;
mod fitted;
mod flights;
#[allow(dead_code, reason = "shared by several crates")]
#[path = "../../../servotwin-io/tests/all/folder.rs"]
mod folder;
#[path = "../../../servotwin-io/tests/all/places.rs"]
mod places;
mod recordings;
mod records;
mod reservoir;
mod runtime;
mod sealed;
