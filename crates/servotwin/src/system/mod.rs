//! System files: a system of catalogue components as data.
//!
//! `docs/system-format.md` describes the format. A file is read into a [`Network`] and compiled. Mistakes are reported
//! at their places, as many as possible at once.
//!
//! ```
//! use servotwin::system::System;
//!
//! let system = System::parse(
//!     r#"
//!     format = 1
//!     name = "leaking_volume"
//!     [components.supply]
//!     kind = "pressure_source"
//!     [components.leak]
//!     kind = "orifice"
//!     area_m2 = 1e-7
//!     [components.chamber]
//!     kind = "volume"
//!     volume_m3 = 1e-4
//!     [system]
//!     connections = [["supply.port", "leak.a"], ["leak.b", "chamber.port"]]
//!     "#,
//!     "leaking_volume.toml",
//! )?;
//! assert_eq!(system.program.states()[0].name, "chamber.pressure_pa");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod check;
mod fluid;
pub(crate) mod imperfection;
pub mod listing;
mod read;
pub mod reservoir;
mod rewrite;
mod schema;
mod scope;

pub(crate) use fluid::{POINT, keys_of};
pub use listing::ListedFault;
pub(crate) use reservoir::Reservoir;
pub(crate) use rewrite::NewValue;
pub use rewrite::RewriteError;
pub use schema::of_file as schema;

use crate::built_in;
use crate::compiled::Compiled;
use crate::kind::FileType;
use crate::signal::{Signal, SignalError};
use crate::toml_text::{NumberWithUnit, Quantities, TomlError};
use servotwin_model::components::MeasuringSpan;
use servotwin_model::network::{self, Instance, Network};
use servotwin_model::program::{Program, Slot};
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;
use std::path::Path;

/// The keys of a system file.
pub fn keys() -> &'static [crate::format::Key] {
    read::Text::KEYS
}

/// The format of system files that this version reads.
pub(crate) const FORMAT: u32 = 1;

/// The default system: an aileron with two actuators.
const DEFAULT: (&str, &str) = built_in::SYSTEMS[0];

/// A measured signal, compared with the twin's.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// The id, unique among sensors, e.g. `p_a_1`.
    pub id: String,
    /// The display label, e.g. `p_A1`.
    pub label: String,
    /// The component's output, by its name in the program.
    pub signal: String,
    /// The index of the component.
    pub component: usize,
    /// The unit of the signal.
    pub unit: Unit,
    /// The scale that residuals are divided by, in the signal's unit.
    pub scale: f64,
}

/// A system that can be simulated.
pub struct System {
    /// The name in files and commands.
    pub name: String,
    /// A one-line title.
    pub title: String,
    /// The compiled equations.
    pub program: Program,
    /// The measured signals, in the order of the file.
    pub sensors: Vec<Sensor>,
    /// The reservoirs that leaks empty, in the order of the file.
    pub reservoirs: Vec<Reservoir>,
    /// The file's text, stored with results.
    pub text: String,
    /// The compiled step of its program.
    pub compiled: Compiled,
}

impl System {
    /// The unit of an input or a parameter by its full name; none for other names.
    pub fn unit_of(&self, name: &str) -> Unit {
        let network = self.network();
        let input = network.inputs.iter().find(|input| input.id == name).map(|input| input.unit);
        let parameter = || {
            let (component, parameter) = self.parameter(name)?;
            Some(network.components[component].component.parameters[parameter].unit)
        };
        input.or_else(parameter).unwrap_or(Unit::None)
    }

    /// Parses a system; `path` appears only in messages.
    ///
    /// # Errors
    /// All mistakes in the text.
    pub fn parse(text: &str, path: &str) -> Result<Self, TomlError> {
        if let Some(mistakes) = FileType::System.wanted(text) {
            return Err(mistakes.refuse(path, text));
        }
        let mut reader = read::Reader::default();
        reader.read(text);
        // If the file could not be read at all, further checks would only repeat that.
        let readable = !reader.scope.parts.is_empty() || reader.mistakes.is_empty();
        let program = if readable { check::compile(&mut reader) } else { None };
        match program {
            Some(program) => Ok(Self {
                name: reader.name,
                title: reader.title,
                program,
                compiled: Compiled::default(),
                sensors: reader.sensors,
                reservoirs: reader.reservoirs,
                text: text.into(),
            }),
            None => Err(reader.mistakes.refuse(path, text)),
        }
    }

    /// Reads a system file, or a built-in system by its name.
    ///
    /// # Errors
    /// The file cannot be read, or has mistakes.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, TomlError> {
        let (text, name) = FileType::System.read(path.as_ref())?;
        Self::parse(&text, &name)
    }

    /// Components, connections and inputs.
    pub fn network(&self) -> &Network {
        self.program.network()
    }

    /// Finds a parameter by its full name, as component and parameter.
    pub fn parameter(&self, name: &str) -> Option<(usize, usize)> {
        let (id, parameter) = name.rsplit_once('.')?;
        let components = &self.network().components;
        let component = components.iter().position(|c| c.id == id)?;
        Some((component, components[component].component.parameter(parameter)?))
    }

    /// The full names of all parameters.
    pub(crate) fn all_parameters(&self) -> Vec<String> {
        self.network().components.iter().flat_map(Instance::parameter_names).collect()
    }

    /// Checks whether a parameter may have a value.
    ///
    /// # Errors
    /// The allowed values, in words.
    pub(crate) fn allows(
        &self,
        component: usize,
        parameter: usize,
        value: f64,
    ) -> Result<(), String> {
        let instance = &self.network().components[component];
        let (min, max) = instance.range(parameter);
        if (min..=max).contains(&value) {
            return Ok(());
        }
        let unit = instance.component.parameters[parameter].unit;
        let range = Quantities(min, max, unit.symbol());
        let soft = instance.fluid.too_soft_pa(value).filter(|_| unit == Unit::Kelvin);
        Err(match soft {
            Some(pa) => {
                let (value, pa) = (NumberWithUnit(value, unit.symbol()), NumberWithUnit(pa, "Pa"));
                format!("{range}; at {value} the bulk modulus of its liquid would be {pa}")
            }
            None => range.to_string(),
        })
    }

    /// Checks whether the system is possible with other parameter values: (component, parameter, value).
    ///
    /// # Errors
    /// The impossible value or combination, in words.
    pub fn possible_with(&self, values: &[(usize, usize, f64)]) -> Result<(), String> {
        let mut network = self.network().clone();
        for &(component, parameter, value) in values {
            let instance = &mut network.components[component];
            let declared = &instance.component.parameters[parameter];
            self.allows(component, parameter, value).map_err(|allowed| {
                let (id, name) = (&instance.id, declared.name);
                let value = NumberWithUnit(value, declared.unit.symbol());
                format!("{id}.{name} = {value} is out of range: allowed are {allowed}")
            })?;
            instance.parameters[parameter] = value;
        }
        let ids = |component: usize| &self.network().components[component].id;
        network.compile().map(drop).map_err(|mistakes| match mistakes.first() {
            Some(network::Mistake::Impossible { component, reason }) => {
                format!("'{}' is impossible: {reason}", ids(*component))
            }
            Some(network::Mistake::TwoFluids { first, second }) => format!(
                "'{}' and '{}' are in one circuit: set the temperatures of both",
                ids(*first),
                ids(*second)
            ),
            _ => "the system is impossible with it".into(),
        })
    }

    /// Builds the input's course from a signal, for a run of `duration_s` seconds.
    ///
    /// # Errors
    /// The signal does not fit this input, or leaves its range.
    pub fn driven(
        &self,
        input: usize,
        signal: &Signal,
        duration_s: f64,
    ) -> Result<Piecewise, SignalError> {
        let unit = self.network().inputs[input].unit;
        self.admitted(input, signal.build(unit, duration_s)?, duration_s)
    }

    /// The course of an input, checked against its range.
    ///
    /// # Errors
    /// The course leaves the range.
    pub(crate) fn admitted(
        &self,
        input: usize,
        curve: Piecewise,
        duration_s: f64,
    ) -> Result<Piecewise, SignalError> {
        let unit = self.network().inputs[input].unit;
        let (min, max) = self.network().input_range(input);
        let (least, largest) = curve.bounds(0.0, duration_s);
        if least >= min && largest <= max {
            return Ok(curve);
        }
        let value = if least < min { least } else { largest };
        Err(SignalError::leaves(&self.network().inputs[input].id, value, (min, max), unit))
    }

    /// The default values of all inputs as constant signals.
    pub fn default_inputs(&self) -> Vec<Piecewise> {
        let inputs = self.network().inputs.iter();
        let constant = |value| Piecewise::constant(value).expect("defaults are finite");
        inputs.map(|input| constant(input.default)).collect()
    }

    /// The plausible readings of a sensor: its range, extended by its width at both ends for faulty sensors.
    pub fn readable(&self, sensor: usize) -> (f64, f64) {
        let instance = &self.network().components[self.sensors[sensor].component];
        match (instance.component.span)(&instance.parameters) {
            Some(MeasuringSpan { full_scale, range }) => {
                (full_scale - 2.0 * range, full_scale + range)
            }
            None => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// The accepted values of an input: its range, extended by its width at both ends for the sensors that measure it.
    pub fn accepted_range(&self, input: usize) -> (f64, f64) {
        let (low, high) = self.network().input_range(input);
        (low - (high - low), high + (high - low))
    }

    /// The variables that some sensors measure, each given by its index.
    pub(crate) fn sensor_slots(&self, sensors: &[usize]) -> Vec<Slot> {
        let slot = |&sensor: &usize| {
            let name = &self.sensors[sensor].signal;
            self.program.observable(name).expect("a sensor's signal is an output").slot
        };
        sensors.iter().map(slot).collect()
    }

    /// The index of the component with an output, and the unit of the output.
    pub(crate) fn output(&self, signal: &str) -> Option<(usize, Unit)> {
        let (part, _) = signal.rsplit_once('.')?;
        let component = self.network().components.iter().position(|own| own.id == part)?;
        Some((component, self.program.observable(signal)?.unit))
    }

    /// Adds a sensor that reads an output, without a label, unless there is one with this id or no such output.
    pub(crate) fn add_sensor(&mut self, id: &str, signal: &str, scale: f64) {
        if let (Some((component, unit)), None) = (self.output(signal), self.sensor(id)) {
            let [id, label, signal] = [id, id, signal].map(str::to_owned);
            self.sensors.push(Sensor { id, label, signal, component, unit, scale });
        }
    }

    /// A sensor by id.
    pub fn sensor(&self, id: &str) -> Option<&Sensor> {
        self.sensors.iter().find(|sensor| sensor.id == id)
    }
}

impl Default for System {
    /// The aileron with two actuators of `systems/aileron_dual.toml`.
    fn default() -> Self {
        let system = Self::parse(DEFAULT.1, &format!("systems/{}.toml", DEFAULT.0));
        system.unwrap_or_else(|error| panic!("the embedded system is wrong:\n{error}"))
    }
}
