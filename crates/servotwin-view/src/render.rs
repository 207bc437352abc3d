//! The renderers of a [`Document`](crate::document::Document).

mod json;
mod markdown;
mod terminal;

pub use json::json;
pub use markdown::markdown;
pub use terminal::terminal;
