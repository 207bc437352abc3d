//! What a component of the catalogue is: what it declares, and how it wires its equations.

use crate::spec::Spec;
use crate::wiring::Wiring;
use alloc::string::String;

/// A component of the catalogue.
pub trait Component: Sync {
    /// What it declares.
    fn spec(&self) -> &'static Spec;

    /// Adds its equations to a program.
    fn connect(&self, wiring: &mut Wiring);

    /// What a sensor's readings span, in the unit of its reading, for its parameters; `None` for a
    /// component that is no sensor. Its `noise_sigma` and `bits` are parts of it.
    fn span(&self, _parameters: &[f64]) -> Option<Span> {
        None
    }

    /// Whether its parameters are possible together (each alone is checked
    /// against its declared range).
    ///
    /// # Errors
    /// What does not fit, naming the parameters.
    fn check(&self, _parameters: &[f64]) -> Result<(), String> {
        Ok(())
    }
}

/// What the readings of a sensor span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Its full scale: noise is a part of this.
    pub full_scale: f64,
    /// From the least reading to the largest: what a converter divides into steps.
    pub range: f64,
}
