//! Mistakes in a system file and their messages.

use crate::document::{self, Explained, NumberWithUnit, suggest};
use crate::units::word;
use servotwin_model::fluid::own::LEAST_BULK_MODULUS_PA;
use servotwin_model::spec::Unit;

/// A mistake in a system file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum SystemMistake {
    /// A mistake that any TOML file can have.
    #[error(transparent)]
    Document(#[from] document::TomlMistake),
    /// A name with letters that ids cannot have.
    #[error("'{name}' cannot be a name")]
    BadName { name: String },
    /// A reserved name.
    #[error("the name '{name}' has a meaning of its own")]
    ReservedName { name: String },
    /// A liquid would not be thinner at 100 °C than at 40 °C.
    #[error("the fluid '{fluid}' is no thinner at 100 °C than at 40 °C")]
    ThickensWhenWarm { fluid: String },
    /// Two things have the same id.
    #[error("there are two things called '{id}'")]
    DuplicateId { id: String },
    /// An unknown word: a component's kind, a liquid, an assembly, a fluid.
    #[error("unknown {what} '{word}'")]
    UnknownWord {
        /// What the word should name, e.g. "kind of component".
        what: &'static str,
        word: String,
        nearest: Option<String>,
        known: Vec<String>,
    },
    /// Something is declared and never used.
    #[error("the {what} '{name}' is never used")]
    Unused { what: &'static str, name: String },
    /// Both or neither of `kind` and `assembly`.
    #[error("component '{id}' needs either a 'kind' or an 'assembly'")]
    KindOrAssembly { id: String },
    /// A parameter's name with another unit's suffix.
    #[error("{}", wrong_suffix(.key, .right, *.unit))]
    WrongSuffix {
        key: String,
        right: &'static str,
        unit: Unit,
        /// The value in SI, if it can be converted.
        si: Option<f64>,
    },
    /// The name of a fault where a parameter is expected.
    #[error("'{key}' is a fault, no parameter")]
    FaultAmongParameters { key: String },
    /// The name of a port where a parameter is expected.
    #[error("'{key}' is a port, no parameter")]
    PortAmongParameters { key: String, id: String },
    /// The kind of a component inside an assembly cannot be overridden.
    #[error("the kind of '{id}' cannot be overridden")]
    KindOverridden { id: String },
    /// A fluid given to a component that takes it from its circuit.
    #[error("'{id}' ({kind}) takes the fluid of its circuit")]
    FluidNotHere { id: String, kind: &'static str },
    /// Several fluids are declared and a source names none.
    #[error("several fluids are declared, but '{id}' names none")]
    WhichFluid { id: String, known: Vec<String> },
    /// The laws of a fluid do not hold at the temperature of its source.
    #[error("'{id}' is at {kelvin} K, but the liquid '{liquid}' is only known for {} … {} K", .range_k.0, .range_k.1)]
    FluidTemperature {
        id: String,
        kelvin: f64,
        liquid: String,
        /// The temperatures at which the laws hold, K.
        range_k: (f64, f64),
    },
    /// The bulk modulus of a self-defined liquid would be too low at the temperature of its source.
    #[error("'{id}' is at {kelvin} K, where the bulk modulus of its liquid would be {}: allowed are {} … {} K", NumberWithUnit(*.pa, "Pa"), .range_k.0, .range_k.1)]
    FluidTooSoft {
        id: String,
        kelvin: f64,
        /// The bulk modulus at that temperature, Pa.
        pa: f64,
        /// The temperatures at which the bulk modulus is high enough, K.
        range_k: (f64, f64),
    },
    /// An end of a connection that names a component but no port.
    #[error("'{id}' is a component: which of its ports?")]
    NoPort { id: String, known: Vec<String> },
    /// A port that a component does not have.
    #[error("'{id}' ({kind}) has no port '{port}'")]
    UnknownPort {
        id: String,
        kind: &'static str,
        port: String,
        nearest: Option<String>,
        known: Vec<String>,
    },
    /// A connection of fewer than two ports.
    #[error("a connection joins at least two ports")]
    TooFewEnds,
    /// A port that occurs twice in a connection.
    #[error("'{end}' stands twice in this connection")]
    RepeatedEnd { end: String },
    /// A connection names two inputs of the system.
    #[error("the inputs '{first}' and '{second}' feed the same signal")]
    TwoInputs { first: String, second: String },
    /// An input of the system meets an output.
    #[error("the input '{input}' meets the output '{output}'")]
    InputAndOutput { input: String, output: String },
    /// An input of the system feeds something that reads no signal.
    #[error("an input cannot feed '{end}', which is {family}")]
    NoSignalInput { end: String, family: &'static str },
    /// An input of the system feeds nothing.
    #[error("the input '{id}' feeds nothing")]
    InputUnused { id: String },
    /// An unknown unit, or one outside SI.
    #[error("unknown unit '{word}'")]
    UnknownUnit {
        word: String,
        /// The SI unit that may be meant.
        meant: Option<Unit>,
    },
    /// A sensor whose signal is not an output of a component.
    #[error("'{signal}' is no signal output of a component")]
    NoOutput {
        signal: String,
        /// Outputs that may be meant.
        known: Vec<String>,
    },
    /// A reservoir feeds something that is no free pressure source with an input.
    #[error(
        "'{word}' is no pressure source whose pressure is an input, or has a reservoir already"
    )]
    NoSupply {
        word: String,
        /// Sources that a reservoir can feed.
        known: Vec<String>,
    },
    /// A sensor whose noise exceeds its scale, by which residuals are divided.
    #[error("the scale of sensor '{sensor}' is {}, less than noise and steps of '{component}': {}", NumberWithUnit(*.scale, .unit.symbol()), NumberWithUnit(rounded(*.noise), .unit.symbol()))]
    ScaleBelowNoise {
        sensor: String,
        /// The component that it reads.
        component: String,
        scale: f64,
        /// The standard deviation of noise and quantization.
        noise: f64,
        /// The full scale of the component.
        full_scale: Option<f64>,
        unit: Unit,
    },
    /// A port that must be connected is open.
    #[error("the {family} port '{end}' is connected to nothing")]
    OpenPort {
        end: String,
        /// The kind of port: hydraulic, mechanical or signal.
        family: &'static str,
        summary: &'static str,
        /// The same port in other instances of the assembly.
        also: Vec<String>,
    },
    /// A connection joins ports of different families.
    #[error("'{}' is {}, but '{}' is {}", .first.0, .first.1, .second.0, .second.1)]
    MixedKinds {
        /// The first port and its family.
        first: (String, &'static str),
        second: (String, &'static str),
    },
    /// A signal in one unit meets an input in another.
    #[error("'{}' is in {}, but '{}' reads {}", .from.0, quoted(.from.1), .to.0, quoted(.to.1))]
    MixedUnits { from: (String, Unit), to: (String, Unit) },
    /// Two components set the same pressure, motion or signal.
    #[error("both '{first}' and '{second}' {}", both(sets(.family)))]
    TwoSources {
        first: String,
        second: String,
        /// The kind of port: hydraulic, mechanical or signal.
        family: &'static str,
    },
    /// Nothing sets the pressure, motion or signal of a node.
    #[error("nothing {} where {} meet", sets(.family), quote_all(.ends))]
    NoSource {
        ends: Vec<String>,
        /// The kind of port: hydraulic, mechanical or signal.
        family: &'static str,
    },
    /// A circuit without a source and a tank.
    #[error("the hydraulic circuit of '{id}' has neither a source nor a tank")]
    NoReference { id: String },
    /// The sources of one circuit disagree.
    #[error("{second} is in one circuit with {first}")]
    TwoFluids {
        /// The first source, its liquid and its temperature.
        first: String,
        second: String,
    },
    /// Signals depend on each other without a state in between.
    #[error("the signals of {} depend on each other at once", quote_all(.ids))]
    AlgebraicLoop { ids: Vec<String> },
    /// Parameters that are impossible in combination.
    #[error("'{id}' is impossible: {reason}")]
    Impossible { id: String, reason: String },
    /// The system has no states.
    #[error("the system has nothing that moves: no state variable")]
    Empty,
    /// More variables than a program can address.
    #[error("the system is too large for one program")]
    TooLarge,
}

/// The verb phrase for a component that sets a node's potential, by family.
fn sets(family: &str) -> &'static str {
    match family {
        "hydraulic" => "sets the pressure",
        "signal" => "gives the signal",
        _ => "sets the motion",
    }
}

/// Describes the wrong name of a parameter with this unit.
fn wrong_suffix(key: &str, right: &str, unit: Unit) -> String {
    let symbol = unit.symbol();
    match right.strip_suffix(unit.suffix()) {
        _ if unit == Unit::None => format!("'{key}' has a unit, but {right} is a pure number"),
        Some(bare) if bare == key => {
            format!("'{key}' lacks its unit: the parameter is {right}, in {symbol}")
        }
        _ => format!("'{key}' is not in SI: the parameter is {right}, in {symbol}"),
    }
}

/// Rounds to three digits, which keeps the magnitude readable.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Turns "sets" into "set".
fn both(verb: &str) -> String {
    verb.replacen("s ", " ", 1)
}

fn quoted(unit: Unit) -> &'static str {
    if unit == Unit::None { "pure numbers" } else { unit.symbol() }
}

fn quote_all(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => String::new(),
    }
}

/// How to part two components that set the same.
fn part(family: &str) -> &'static str {
    match family {
        "hydraulic" => "put a valve, an orifice or a line between them",
        "signal" => "a signal has one source: keep one of them",
        "translational" => {
            "put an attachment between them (port a to the one, b to the other), or make them one mass"
        }
        _ => "make them one inertia, or let a rod with an attachment and a lever move one of them",
    }
}

/// Components that set a node of this family.
fn setter(family: &str) -> &'static str {
    match family {
        "hydraulic" => "join them with a volume, a cylinder chamber, a source or a tank",
        "signal" => "join them with an output of a component or an input of the system",
        _ => "join them with a mass, a cylinder rod or an inertia",
    }
}

impl SystemMistake {
    /// Help without names; [`Explained::help`] adds the help with names.
    fn advice(&self) -> Option<&'static str> {
        Some(match self {
            SystemMistake::BadName { .. } => "names have small letters, digits and '_'",
            SystemMistake::ReservedName { .. } => "choose another",
            SystemMistake::ThickensWhenWarm { .. } => {
                "give both viscosity_40_m2_s and viscosity_100_m2_s (1 cSt = 1e-6 m²/s)"
            }
            SystemMistake::DuplicateId { .. } => "every id stands for one thing",
            SystemMistake::KindOrAssembly { .. } => {
                "for example: kind = \"volume\"; or assembly = \"actuator\""
            }
            SystemMistake::KindOverridden { .. } => "write a second assembly for another structure",
            SystemMistake::FluidNotHere { .. } => {
                "a fluid is named by the sources and tanks of the circuit"
            }
            SystemMistake::TwoInputs { .. } | SystemMistake::InputAndOutput { .. } => {
                "a signal has one source: keep one of them"
            }
            SystemMistake::NoSignalInput { .. } => "inputs feed the signal inputs of components",
            SystemMistake::InputUnused { .. } => {
                "list what it feeds, for example: to = [\"supply.pressure\"]"
            }
            SystemMistake::MixedKinds { .. } => "a connection joins ports of one kind",
            SystemMistake::TwoSources { family, .. } => part(family),
            SystemMistake::NoSource { family, .. } => setter(family),
            SystemMistake::NoReference { .. } => "connect a pressure_source or a tank",
            SystemMistake::TwoFluids { .. } => {
                "fluid and temperature are the same throughout a circuit"
            }
            SystemMistake::AlgebraicLoop { .. } => {
                "break the loop with a component that has a state, such as a low_pass_filter"
            }
            SystemMistake::Empty => "add a component that stores something, such as a volume",
            SystemMistake::Document(_)
            | SystemMistake::UnknownWord { .. }
            | SystemMistake::UnknownPort { .. }
            | SystemMistake::Unused { .. }
            | SystemMistake::WrongSuffix { .. }
            | SystemMistake::FaultAmongParameters { .. }
            | SystemMistake::PortAmongParameters { .. }
            | SystemMistake::WhichFluid { .. }
            | SystemMistake::FluidTooSoft { .. }
            | SystemMistake::NoPort { .. }
            | SystemMistake::UnknownUnit { .. }
            | SystemMistake::NoOutput { .. }
            | SystemMistake::NoSupply { .. }
            | SystemMistake::ScaleBelowNoise { .. }
            | SystemMistake::OpenPort { .. }
            | SystemMistake::FluidTemperature { .. }
            | SystemMistake::TooFewEnds
            | SystemMistake::RepeatedEnd { .. }
            | SystemMistake::MixedUnits { .. }
            | SystemMistake::Impossible { .. }
            | SystemMistake::TooLarge => return None,
        })
    }
}

impl Explained for SystemMistake {
    fn help(&self) -> Option<String> {
        Some(match self {
            SystemMistake::Document(mistake) => return mistake.help(),
            SystemMistake::UnknownWord { nearest, known, .. }
            | SystemMistake::UnknownPort { nearest, known, .. } => suggest(nearest, known),
            SystemMistake::Unused { what, .. } => format!("remove the {what} or use it"),
            SystemMistake::WrongSuffix { right, si: Some(si), .. } => {
                format!("write: {right} = {}", NumberWithUnit(*si, ""))
            }
            SystemMistake::WrongSuffix { right, .. } => format!("write: {right} = …"),
            SystemMistake::FaultAmongParameters { key } => {
                format!("its value at intensity 1 is set by: faults.{key} = …")
            }
            SystemMistake::PortAmongParameters { key, id } => {
                format!("ports are joined in 'connections': [\"{id}.{key}\", …]")
            }
            SystemMistake::WhichFluid { known, .. } => {
                format!("add: fluid = \"…\"; known: {}", known.join(", "))
            }
            SystemMistake::FluidTooSoft { .. } => {
                let least = NumberWithUnit(LEAST_BULK_MODULUS_PA, "Pa");
                format!("by its bulk_modulus_pa at 40 °C and bulk_modulus_change; at least {least}")
            }
            SystemMistake::NoPort { known, .. } => format!("its ports: {}", known.join(", ")),
            SystemMistake::UnknownUnit { meant: Some(unit), .. } => {
                format!("files are in SI: \"{}\"", word(*unit))
            }
            SystemMistake::UnknownUnit { .. } => {
                let known: Vec<&str> = Unit::ALL.into_iter().map(word).collect();
                format!("known: {} (1: a pure number)", known.join(", "))
            }
            SystemMistake::NoOutput { known, .. } if known.is_empty() => {
                "a sensor is a signal output, such as the 'reading' of a pressure_sensor".into()
            }
            SystemMistake::NoOutput { known, .. } => format!("outputs: {}", known.join(", ")),
            SystemMistake::NoSupply { known, .. } if known.is_empty() => {
                "an input drives a source with: to = [\"supply.pressure\"]".into()
            }
            SystemMistake::NoSupply { known, .. } => format!("known: {}", known.join(", ")),
            SystemMistake::ScaleBelowNoise { full_scale, unit, .. } => format!(
                "residuals are divided by it; usual is the full scale of the sensor, {}",
                NumberWithUnit(full_scale.unwrap_or_default(), unit.symbol())
            ),
            SystemMistake::OpenPort { summary, also, .. } if also.is_empty() => {
                format!("the port is: {summary}")
            }
            SystemMistake::OpenPort { summary, also, .. } => {
                format!("the port is: {summary}; the same holds for {}", also.join(", "))
            }
            mistake => return mistake.advice().map(str::to_owned),
        })
    }

    fn range(&self) -> Option<(f64, f64)> {
        match self {
            SystemMistake::Document(mistake) => mistake.range(),
            SystemMistake::FluidTemperature { range_k, .. }
            | SystemMistake::FluidTooSoft { range_k, .. } => Some(*range_k),
            _ => None,
        }
    }
}
