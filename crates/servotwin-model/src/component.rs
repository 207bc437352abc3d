//! The interface of a component in the catalogue: its declaration and the wiring of its equations.

use crate::spec::Spec;
use crate::wiring::Wiring;
use alloc::string::String;
use alloc::vec::Vec;

/// A component of the catalogue.
pub trait Component: Sync {
    /// The component's declaration.
    fn spec(&self) -> &'static Spec;

    /// Adds its equations to a program.
    fn connect(&self, wiring: &mut Wiring);

    /// A sensor's full scale and range for its parameters, in the unit of its reading; `None` for other
    /// components. The sensor's `noise_sigma` and `bits` refer to them.
    fn span(&self, _parameters: &[f64]) -> Option<MeasuringSpan> {
        None
    }

    /// How the component's signal outputs follow its signal inputs in the steady state, within its limits. Empty for a
    /// component that passes no signal on, or not by a linear law.
    fn steady_gains(&self, _parameters: &[f64]) -> Vec<SteadyGain> {
        Vec::new()
    }

    /// The least and the largest position at which every chamber of a cylinder has a volume, m; `None` for other
    /// components.
    fn travel_m(&self, _parameters: &[f64]) -> Option<(f64, f64)> {
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

/// How a signal output follows a signal input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyGain {
    /// The name of the input port.
    pub from: &'static str,
    /// The name of the output port.
    pub to: &'static str,
    /// Change of the output for a change of the input, SI over SI.
    pub gain: f64,
}

/// The measuring span of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuringSpan {
    /// Full scale; noise is given as a fraction of it.
    pub full_scale: f64,
    /// From the smallest reading to the largest; the converter divides it into steps.
    pub range: f64,
}
