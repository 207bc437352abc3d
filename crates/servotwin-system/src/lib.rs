//! System files, signals and studies of servotwin, and running their variants on all cores.
//!
//! This crate reads what files declare and simulates it.
//! Suites, training, evaluation, flights and fits stand above it, in the crate `servotwin`, which re-exports every
//! module here.
//!
//! | task | modules |
//! |---|---|
//! | describe a file format as data | [`format`](mod@format) (keys and values), [`kind`] (which type of file a text is), [`units`] (names of units) |
//! | help a writer of files | [`catalogue`] (components as documents), [`template`] (files to start with), [`built_in`] (files that names select) |
//! | read files | [`system`] (components and connections), [`signal`] (functions of time), [`study`] (faults, operating cases, scenarios) |
//! | run variants | [`compiled`] (steps made by the machine's C compiler), [`ensemble`] (threads × lanes), [`parallel`] (other work on threads) |
//! | simulate by names | [`simulate`] (names in, a table out), [`recording`] (what a run records), [`shown`] (display units), [`validity`] (pressures and pistons outside the model) |
//! | analyze the steady state | [`rest`] (states, eigenvalues and description), [`plausibility`] (warnings) |
//!
//! ```
//! use servotwin_system::simulate::Simulation;
//! use servotwin_system::study::Study;
//!
//! let study = Study::default(); // the study of the paper, and its aileron
//! let fault = &study.faults[0];
//! let table = Simulation::new(&study.system)
//!     .input("command", "step:size=5deg,at=0.1s")
//!     .fault(&fault.id, 0.5)
//!     .duration_s(0.5)
//!     .run()?
//!     .table()?;
//! assert_eq!(table.row_count(), 51);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod built_in;
pub mod catalogue;
pub mod compiled;
mod eigenvalues;
pub mod ensemble;
pub mod format;
pub mod kind;
pub mod parallel;
pub mod plausibility;
pub mod recording;
pub mod rest;
pub mod signal;
pub mod simulate;
pub mod study;
pub mod system;
pub mod template;
pub mod units;
pub mod validity;

// Modules name the crates below by these short paths, as the modules of `servotwin` do.
use servotwin_io::{files, leftovers, nearest, table, toml_text};
#[doc(no_inline)]
pub use servotwin_view::shown;
