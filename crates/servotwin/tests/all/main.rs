//! The one integration test binary of this crate: one module per room.

mod files;
mod table;
