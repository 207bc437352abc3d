//! A web page beside the running twin: inject a fault and see residuals, diagnosis, command and surface answer.
//!
//! ```text
//! browser ── requests ──> server ──> flight, replay or stream (its own thread) ──> feed ──> server ──> browsers
//! ```
//!
//! - `flight`: the flight in closed loop, with a ghost that flies the same without a diagnosis
//! - [`measured`]: a log or a stream beside its twin
//! - `injection`: faults as they are injected by hand: a step, a ramp, or intermittent
//! - [`signals`]: what a frame contains, with names, units and bands
//! - `state`: what viewers receive besides samples
//! - `session`: a flight as viewers saw it, as one file
//! - [`feed`]: frames and events for every viewer, and the last minute for those that come later
//! - `page`: the page, and one file that holds it with a session and replays it
//! - `request`: what a viewer may ask for
//! - `server`: HTTP and WebSocket, and who may come in
//!
//! The flight never waits for a browser: it puts a frame into the feed and goes on. A viewer that is too slow loses
//! frames, and the feed reports how many. The diagnosis never loses a sample.

pub mod feed;
pub(crate) mod flight;
pub(crate) mod injection;
pub mod measured;
pub(crate) mod page;
pub(crate) mod request;
pub(crate) mod server;
pub(crate) mod session;
pub mod signals;
pub(crate) mod state;

pub use feed::{LiveSource, RunError};
pub use flight::Live;
pub use measured::{Measured, Stream};
pub use page::saved_page;
pub use server::{Access, ServeError, Server};
pub use session::{SavedSession, SessionError};
