//! A component of the catalogue: what it declares, and the wiring of its equations.

use crate::spec::{Fault, Parameter, Port, PortKind, State};
use crate::wiring::Wiring;
use alloc::string::String;
use alloc::vec::Vec;

/// A component of the catalogue.
#[derive(Clone, Copy)]
pub struct Component {
    /// The word for `kind` in a system file.
    pub kind: &'static str,
    /// One line of documentation.
    pub summary: &'static str,
    /// Parameters, in the order in which equations index them.
    pub parameters: &'static [Parameter],
    /// Faults, in the order of the fault list.
    pub faults: &'static [Fault],
    /// Ports, in the order of their positions.
    pub ports: &'static [Port],
    /// State variables, in the order of their positions.
    pub states: &'static [State],
    /// Whether it fixes the absolute pressure of its hydraulic circuit.
    pub reference: bool,
    /// Adds its equations to a program.
    pub(crate) connect: fn(&mut Wiring),
    /// Checks whether the parameters fit together, each of which is within its declared range; describes what does not
    /// fit and names the parameters.
    pub(crate) check: fn(&[f64]) -> Result<(), String>,
    /// A sensor's measuring span for its parameters, in the unit of its reading; `None` for other components. The
    /// sensor's `noise_sigma` and `bits` refer to it.
    pub span: fn(&[f64]) -> Option<MeasuringSpan>,
    /// How the signal outputs follow the signal inputs in the steady state, within their limits. Empty for a component
    /// that passes no signal on, or not by a linear law.
    pub steady_gains: fn(&[f64]) -> Vec<SteadyGain>,
    /// The least and the largest position at which every chamber of a cylinder has a volume, m; `None` for other
    /// components.
    pub travel_m: fn(&[f64]) -> Option<(f64, f64)>,
}

/// The measuring span of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuringSpan {
    /// Full scale; noise is given as a fraction of it.
    pub full_scale: f64,
    /// From the smallest reading to the largest; the converter divides it into steps.
    pub range: f64,
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

impl Component {
    /// What components have in common that declare nothing else.
    pub(crate) const PLAIN: Component = Component {
        kind: "",
        summary: "",
        parameters: &[],
        faults: &[],
        ports: &[],
        states: &[],
        reference: false,
        connect: |_| (),
        check: |_| Ok(()),
        span: |_| None,
        steady_gains: |_| Vec::new(),
        travel_m: |_| None,
    };

    /// The position of a parameter by name.
    pub fn parameter(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|p| p.name == name)
    }

    /// The position of a fault by name.
    pub fn fault(&self, name: &str) -> Option<usize> {
        self.faults.iter().position(|f| f.name == name)
    }

    /// Range of a signal input: that of its default parameter, or else its own.
    pub fn input_range(&self, port: &Port) -> Option<(f64, f64)> {
        match port.kind {
            PortKind::SignalIn { default: Some(name), .. } => {
                let declared = &self.parameters[self.parameter(name)?];
                Some((declared.min, declared.max))
            }
            _ => port.range,
        }
    }

    /// The position of a port by name.
    pub fn port(&self, name: &str) -> Option<usize> {
        self.ports.iter().position(|p| p.name == name)
    }
}
