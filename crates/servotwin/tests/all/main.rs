//! The one integration test binary of this crate: one module per room.

#![expect(clippy::too_many_lines, reason = "a test may list many cases")]

mod aileron;
mod beside;
mod cavitation;
mod compiled;
mod crane;
mod data_card;
mod effort;
mod errors;
mod evaluation;
mod examples;
mod fitted;
mod flights;
#[allow(dead_code, reason = "shared by several crates")]
#[path = "../../../servotwin-io/tests/all/folder.rs"]
mod folder;
mod golden;
mod peer_cases;
mod physics;
#[path = "../../../servotwin-io/tests/all/places.rs"]
mod places;
mod plausibility;
mod recordings;
mod records;
mod relief;
mod reservoir;
mod runtime;
mod schema;
mod sealed;
mod signal;
mod simulate;
mod step_page;
mod study_mistakes;
mod system;
mod triplex;
mod units;
mod val_peers;
