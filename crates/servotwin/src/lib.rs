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
//! [`Study::run`](job::RunStudy::run) simulates them all, trains the diagnosis and evaluates it on new commands.
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
//! Files, signals and simulation are modules of [`servotwin_system`], whose page has a map of them; paths through this
//! crate lead to the same types.
//! The book in the folder `docs` explains the methods; five short programs stand in the folder `examples`.

pub mod beside;
pub mod fit;
pub mod flight;
pub mod job;
pub mod learn;
pub mod live;
pub mod measure;
pub mod prelude;
pub mod recordings;
pub mod records;
pub mod run;

#[doc(no_inline)]
pub use servotwin_io::{
    files, leftovers, manifest, moment, nearest, sanitize, table, text, toml_text,
};
#[doc(no_inline)]
pub use servotwin_system::{
    built_in, catalogue, compiled, ensemble, format, kind, parallel, plausibility, recording, rest,
    shown, signal, simulate, study, system, template, units, validity,
};
#[doc(no_inline)]
pub use servotwin_view as view;
