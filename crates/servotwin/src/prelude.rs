//! The types that most programs need: `use servotwin::prelude::*`.

pub use crate::simulate::{Simulation, SimulationError, SimulationResults, VariantSpec};
pub use crate::system::{System, SystemError};
pub use crate::table::Table;
