//! The one integration test binary of this crate: one module per room.

#![expect(clippy::too_many_lines, reason = "a test may list many cases")]

mod aileron;
mod cavitation;
mod compiled;
mod crane;
mod golden;
mod peer_cases;
mod physics;
mod plausibility;
mod relief;
mod schema;
mod signal;
mod simulate;
mod step_page;
mod study_mistakes;
mod system;
mod triplex;
mod units;
mod val_peers;
