//! The interface of a component in the catalogue: its declaration and the wiring of its equations.

use crate::spec::Spec;
use crate::wiring::Wiring;
use alloc::string::String;

/// A component of the catalogue.
pub trait Component: Sync {
    /// The component's declaration.
    fn spec(&self) -> &'static Spec;

    /// Adds its equations to a program.
    fn connect(&self, wiring: &mut Wiring);

    /// A sensor's full scale and range for its parameters, in the unit of its reading; `None` for other
    /// components. The sensor's `noise_sigma` and `bits` refer to them.
    fn span(&self, _parameters: &[f64]) -> Option<Span> {
        None
    }

    /// Checks whether the parameters fit together. Each one alone is already
    /// checked against its declared range.
    ///
    /// # Errors
    /// Describes what does not fit and names the parameters.
    fn check(&self, _parameters: &[f64]) -> Result<(), String> {
        Ok(())
    }
}

/// The measuring span of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Full scale; noise is given as a fraction of it.
    pub full_scale: f64,
    /// From the smallest reading to the largest; the converter divides it into steps.
    pub range: f64,
}
