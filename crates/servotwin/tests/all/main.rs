//! The one integration test binary of this crate: one module per room.

mod aileron;
mod evaluation;
mod figure;
mod files;
mod peer_cases;
mod foreign;
mod physics;
mod system;
mod table;
mod val_peers;
