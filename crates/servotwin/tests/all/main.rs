//! The one integration test binary of this crate: one module per room.

mod aileron;
mod cavitation;
mod compiled;
mod crane;
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
mod golden;
mod peer_cases;
mod physics;
#[path = "../../../servotwin-io/tests/all/places.rs"]
mod places;
mod relief;
mod reservoir;
mod runtime;
mod schema;
mod sealed;
mod step_page;
mod study_mistakes;
mod system;
mod table_model;
mod triplex;
mod val_peers;
