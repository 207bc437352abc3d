//! The one integration test binary of this crate: one module per room.

mod aileron;
mod cavitation;
mod compiled;
mod crane;
mod effort;
mod errors;
mod evaluating;
mod evaluation;
mod examples;
mod figure;
mod files;
mod fitted;
mod flights;
mod golden;
mod intake;
mod log;
#[cfg(feature = "mqtt")]
mod mqtt;
mod peer_cases;
mod physics;
mod recordings;
mod relief;
mod runtime;
mod schema;
mod study_mistakes;
mod system;
mod table;
mod table_model;
mod triplex;
mod val_peers;
