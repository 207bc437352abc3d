//! The virtual twin that an export takes along.

use servotwin_model::program::{Program, Slot};
use servotwin_model::solver::{Between, Control, SolverSettings};

/// A virtual twin to be exported.
#[derive(Clone)]
pub struct ExportedTwin<'p> {
    /// Its system.
    pub program: &'p Program,
    /// Method and control of its steps.
    pub settings: SolverSettings,
    /// The time between samples, s.
    pub period_s: f64,
    /// The course of each external input between samples.
    pub between: Vec<Between>,
    /// The least and the largest plausible value of each external input, SI.
    pub ranges: Vec<[f64; 2]>,
    /// The variables that the diagnosis compares with its sensors, in their order.
    pub sensors: Vec<Slot>,
}

impl ExportedTwin<'_> {
    /// Whether every step has the same length.
    pub fn has_fixed_step(&self) -> bool {
        matches!(self.settings.control, Control::Fixed { .. })
    }
}
