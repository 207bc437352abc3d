//! The catalogue: one file per component, with its equations, its parameters
//! and its faults.
//!
//! A new component is a file here (`pub mod`) and a line in the list at the end.
//! The line names the equation blocks that the file defines, so that programs can
//! run them without indirection.

pub use crate::component::{Component, MeasuringSpan};

use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::wiring::{Block, EquationIndex, Listed};
use alloc::string::String;
use alloc::vec::Vec;

pub(crate) mod accumulator;
pub(crate) mod aerodynamic_load;
pub(crate) mod attachment;
pub(crate) mod axis_controller;
pub(crate) mod bristle_cylinder;
pub(crate) mod check_valve;
pub(crate) mod contact;
#[cfg(test)]
pub(crate) mod contract;
pub(crate) mod conversion;
pub(crate) mod cylinder;
pub(crate) mod external_leakage;
pub(crate) mod filter;
pub(crate) mod fixed;
pub(crate) mod flow_sensor;
pub(crate) mod flow_source;
pub(crate) mod force;
pub(crate) mod force_fight_equaliser;
pub(crate) mod friction;
pub(crate) mod gain;
pub(crate) mod inertia;
pub(crate) mod lever;
pub(crate) mod long_line;
pub(crate) mod low_pass_filter;
pub(crate) mod lvdt;
pub(crate) mod mass;
pub(crate) mod mode_valve;
pub(crate) mod orifice;
pub(crate) mod pid_controller;
pub(crate) mod position_controller;
pub(crate) mod pressure_sensor;
pub(crate) mod pressure_source;
pub(crate) mod proportional_valve;
pub(crate) mod relief_valve;
pub(crate) mod sampled_position_controller;
pub(crate) mod selector;
pub(crate) mod servo_valve;
pub(crate) mod shut_off_valve;
pub(crate) mod spool;
pub(crate) mod spring;
pub(crate) mod tank;
pub(crate) mod tapped_pressure_sensor;
pub(crate) mod temperature_sensor;
pub(crate) mod variable_pump;
pub(crate) mod volume;

/// An operation on a block of any kind; see [`BlockKind::visit`].
pub(crate) trait Visitor {
    type Output;
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> Self::Output
    where
        E: Equation<I, O, C>;
}

macro_rules! catalogue {
    ($($module:ident :: $component:ident [$($block:ident),* $(,)?]),* $(,)?) => {
        /// Every component, in the order of the documentation.
        pub static ALL: &[&dyn Component] = &[$(&$module::$component),*];

        /// The module documentation of the components, in the same order.
        static HEADS: &[&str] = &[$({
            const FILE: &[u8] = include_bytes!(concat!(stringify!($module), ".rs"));
            const HEAD: [u8; head_length(FILE)] = head(FILE);
            match core::str::from_utf8(&HEAD) {
                Ok(text) => text,
                Err(_) => panic!("a source file is UTF-8"),
            }
        }),*];

        /// Every equation block.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u8)]
        pub(crate) enum BlockKind {
            $($(#[doc = stringify!($module)] $block,)*)*
        }

        $($(impl Listed for $module::$block {
            const KIND: EquationIndex = EquationIndex(BlockKind::$block as u8);
        })*)*

        /// The kinds, indexed by [`Kind`].
        static KINDS: &[BlockKind] = &[$($(BlockKind::$block,)*)*];

        impl BlockKind {
            /// Calls the visitor with the block's type.
            #[inline(always)]
            pub(crate) fn visit<T: Visitor>(self, visitor: T) -> T::Output {
                match self {
                    $($(BlockKind::$block => visitor.visit::<$module::$block, _, _, _>(),)*)*
                }
            }
        }
    };
}

impl Block {
    /// The kind of the block's equation.
    pub(crate) fn equation(&self) -> BlockKind {
        KINDS[self.kind.0 as usize]
    }
}

/// The number of bytes of the `//!` lines at the beginning of a file.
const fn head_length(file: &[u8]) -> usize {
    let mut at = 0;
    while at + 2 < file.len() && file[at] == b'/' && file[at + 1] == b'/' && file[at + 2] == b'!' {
        while file[at] != b'\n' {
            at += 1;
        }
        at += 1;
    }
    at
}

/// The first `LENGTH` bytes of a file.
const fn head<const LENGTH: usize>(file: &[u8]) -> [u8; LENGTH] {
    let mut head = [0; LENGTH];
    let mut at = 0;
    while at < LENGTH {
        head[at] = file[at];
        at += 1;
    }
    head
}

/// The description of a component as Markdown: the module documentation of its file, with the equations, their
/// sources and their limits.
pub fn description(kind: &str) -> Option<String> {
    let place = ALL.iter().position(|c| c.spec().kind == kind)?;
    let lines = HEADS[place].lines().map(|line| {
        let text = line.strip_prefix("//!").unwrap_or(line);
        text.strip_prefix(' ').unwrap_or(text)
    });
    Some(lines.collect::<Vec<_>>().join("\n"))
}

/// Finds a component by its kind.
pub fn find(kind: &str) -> Option<&'static dyn Component> {
    ALL.iter().copied().find(|c| c.spec().kind == kind)
}

/// Computes the constants of one block as a list.
pub(crate) struct Constants<'a, S>(pub &'a Given<'a, S>);

impl<S: Scalar<Base = S>> Visitor for Constants<'_, S> {
    type Output = Vec<S>;
    fn visit<E, const I: usize, const O: usize, const C: usize>(self) -> Self::Output
    where
        E: Equation<I, O, C>,
    {
        E::constants(self.0).to_vec()
    }
}

catalogue! {
    pressure_source::PressureSource [],
    tank::Tank [],
    flow_source::FlowSource [PumpFlow],
    variable_pump::VariablePump [Compensator, StrokedFlow],
    volume::Volume [VolumePressure, FluidPressure],
    orifice::Orifice [Restriction],
    external_leakage::ExternalLeakage [LeakageFlow],
    filter::Filter [FilterFlow],
    check_valve::CheckValve [OneWayFlow],
    relief_valve::ReliefValve [],
    accumulator::Accumulator [GasPressure],
    long_line::LongLine [LineFlow, LinePressure],
    shut_off_valve::ShutOffValve [ShutOffFlow],
    servo_valve::ServoValve [SpoolMotion, EdgeFlow, PilotFlow],
    proportional_valve::ProportionalValve [ControlledSpool, RatedEdge],
    mode_valve::ModeValve [ModePosition, Transmission, BypassFlow, MakeUpFlow, ReserveFlow],
    cylinder::Cylinder [ChamberPressure, SealLeakage, PistonForce, PistonFriction, PistonStop],
    bristle_cylinder::BristleCylinder [BristleFriction],

    fixed::Fixed [],
    mass::Mass [MassMotion, MassStops],
    inertia::Inertia [Turning],
    lever::Lever [LeverMotion, LeverMoment],
    attachment::Attachment [Joint],
    friction::Friction [Rubbing],
    spring::Spring [Spreading],
    force::Force [Applied],
    aerodynamic_load::AerodynamicLoad [Stream, StreamAtAltitude, HingeMoment, HingeDamping],

    pressure_sensor::PressureSensor [PressureToCurrent, CurrentToPressure],
    tapped_pressure_sensor::TappedPressureSensor [TappingLine],
    lvdt::Lvdt [PositionToRatio, RatioToPosition],
    temperature_sensor::TemperatureSensor [Warming, TemperatureToCurrent, CurrentToTemperature],
    flow_sensor::FlowSensor [Metering, FlowToCurrent, CurrentToFlow],

    position_controller::PositionController [PositionDemand, PressureFeedback, LimitedCurrent],
    sampled_position_controller::SampledPositionController [SampledLaw],
    axis_controller::AxisController [AxisDemand, AxisDamping, AxisOutput],
    pid_controller::PidController [PidLaw],
    force_fight_equaliser::ForceFightEqualiser [PressureDifference, FightFilter, FightCorrection],
    force_fight_equaliser::ForceFightEqualiser3 [FightOfThree],
    force_fight_equaliser::ForceFightEqualiser4 [FightOfFour],
    low_pass_filter::LowPassFilter [FirstOrder],
    selector::Selector [Selection, MiddleOfThree, MiddleOfFour],
    gain::Gain [Product],
}
