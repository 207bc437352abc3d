//! The one integration test binary of this crate: one module per room.

mod evaluation;
mod figure;
mod files;
mod system;
mod table;
