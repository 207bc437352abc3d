
pub mod course;
pub mod equations;
pub mod following;
pub mod hybrid;
pub mod twin;
pub mod twin_sizes;
pub mod twin_tables;

pub use course::Knot;
pub use hybrid::Hybrid;
pub use twin::{Twin, TwinFailure};
