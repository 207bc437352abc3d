//! A web page beside the running twin: inject a fault and see residuals, diagnosis, command and surface answer.
//!
//! ```text
//! browser ── requests ──> server ──> flight or stream (its own thread) ──> feed ──> server ──> browsers
//! ```
//!
//! - `flight`: the flight in closed loop, with a ghost that flies the same without a diagnosis
//! - `measured`: a stream beside its twin
//! - `injection`: faults as they are injected by hand: a step, a ramp, or intermittent
//! - [`signals`]: what a frame contains
//! - `state`: what viewers receive besides samples
//! - `feed`: frames and events for every viewer, and the last minute for those that come later
//! - `session`: the present flight as a table
//! - `page`: the page, and the present flight as a page of its own
//! - `request`: what a viewer may ask for
//! - `server`: HTTP and WebSocket, and who may come in
//!
//! The flight never waits for a browser: it puts a frame into the feed and goes on. A viewer that is too slow loses
//! frames, and the feed reports how many. The diagnosis never loses a sample.

pub(crate) mod feed;
pub(crate) mod flight;
pub(crate) mod injection;
pub(crate) mod measured;
pub(crate) mod page;
pub(crate) mod request;
pub(crate) mod server;
pub(crate) mod session;
pub mod signals;
pub(crate) mod state;

pub use feed::{Feed, FeedError, LiveSource};
pub use flight::Live;
pub use measured::Stream;
pub use server::{Access, ServeError, Server};
