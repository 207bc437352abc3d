//! A hybrid twin for electro-hydraulic servo actuators.
//!
//! A *virtual twin* simulates how an actuator should behave.
//! A *diagnosis*, trained on thousands of simulated faults, compares the twin with the sensors and reports which actuator
//! failed, what the flight control computer must do, and which component is at fault.
//!
//! Five steps lead from a system file to a finding.
//! Start with `use servotwin::prelude::*;`.
//!
//! # 1. Load a system
//!
//! A [`System`](system::System) comes from a TOML file or is built in.
//! It knows its inputs, sensors, parameters, and every fault that its components can have.
//!
//! ```
//! use servotwin::prelude::*;
//!
//! let system = System::default(); // an aileron with two actuators
//! assert_eq!(system.sensors.len(), 13);
//! assert!(system.fault_list().iter().any(|fault| fault.id == "actuator_1.leakage_a.leakage"));
//! ```
//!
//! # 2. Simulate
//!
//! A [`Simulation`](simulate::Simulation) takes names and returns a [`Table`](table::Table).
//!
//! ```
//! use servotwin::prelude::*;
//!
//! let system = System::default();
//! let simulation = Simulation::new(&system).input("command", "step:size=5deg,at=0.1s").duration_s(0.5);
//! let healthy = simulation.run()?.table()?;
//! let leaking = simulation.fault("actuator_1.leakage_a.leakage", 0.5).run()?.table()?;
//! assert!(leaking.f64("p_a_1_pa")?[50] < healthy.f64("p_a_1_pa")?[50]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # 3. Run a study, and 4. train
//!
//! A [`Study`](study::Study) lists faults, intensities and operating cases.
//! [`Study::run`](study::Study::run) simulates them all, trains the diagnosis and evaluates it on new commands.
//! The crate `servotwin-report` makes a page of the results.
//!
//! ```no_run
//! use servotwin::prelude::*;
//!
//! let study = Study::default(); // the study of the paper, in its quick size
//! let results = study.run("out")?;
//! println!("{}", results.folder().results().display());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # 5. Monitor
//!
//! A [`Monitor`](prelude::Monitor) runs the twin and the diagnosis in parallel with an actuator.
//! The diagnosis learns from flights, which are part of the [full](study::Study::full) study.
//! `servotwin_watch::whole_table` watches a table of samples.
//!
//! ```no_run
//! use servotwin::prelude::*;
//!
//! let study = Study::default();
//! let diagnoser = read_diagnoser("out/diagnoser-realistic.json")?;
//! let mut monitor = Monitor::new(&study, diagnoser)?;
//! monitor.set("command", 0.05)?;
//! monitor.set("p_a_1", 9.8e6)?;
//! println!("{}", monitor.push());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`fit`] estimates the parameters of a twin, or the intensity of a fault, from a record.
//! The book in the folder `docs` explains the methods; five short programs stand in the folder `examples`.
//!
//! # All modules
//!
//! | task | modules |
//! |---|---|
//! | describe a file format as data | [`format`](mod@format) (keys and values), [`kind`] (which type of file a text is), [`units`] (names of units) |
//! | help a writer of files | [`catalogue`] (components as documents), [`template`] (files to start with), [`built_in`] (files that names select) |
//! | read files | [`system`] (components and connections), [`signal`] (functions of time), [`study`] (faults, operating cases, scenarios) |
//! | run variants | [`compiled`] (steps made by the machine's C compiler), [`ensemble`] (threads × lanes), [`parallel`] (other work on threads) |
//! | simulate by names | [`simulate`] (names in, a table out), [`recording`] (what a run records), [`validity`] (pressures and pistons outside the model) |
//! | analyze the steady state | [`rest`] (states, eigenvalues and description), [`plausibility`] (warnings) |
//! | run a study | [`job`] (all work in its output folder), [`run`] (suites in lanes), [`records`] (windows of records), [`learn`] (training and evaluation), [`flight`] (flights), [`measure`] (outcomes counted) |
//! | work with measured signals | [`live`] (twin and diagnosis, sample by sample), [`fit`] (parameters from records), [`recordings`] (studies of recordings), [`beside`] (a sensor beside its twin) |

pub mod beside;
pub mod built_in;
pub mod catalogue;
pub mod compiled;
mod eigenvalues;
pub mod ensemble;
pub mod fit;
pub mod flight;
pub mod format;
pub mod job;
pub mod kind;
pub mod learn;
pub mod live;
pub mod measure;
pub mod parallel;
pub mod plausibility;
pub mod prelude;
pub mod recording;
pub mod recordings;
pub mod records;
pub mod rest;
pub mod run;
pub mod signal;
pub mod simulate;
pub mod study;
pub mod system;
pub mod template;
pub mod units;
pub mod validity;

#[doc(no_inline)]
pub use servotwin_io::{
    files, leftovers, manifest, moment, nearest, sanitize, table, text, toml_text,
};
#[doc(no_inline)]
pub use servotwin_view as view;
#[doc(no_inline)]
pub use servotwin_view::shown;
