//! The one integration test binary of this crate: one module per room.

mod aileron;
mod figure;
mod files;
mod physics;
mod system;
mod table;
