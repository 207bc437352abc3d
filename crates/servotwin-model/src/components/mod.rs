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
        pub static ALL: &[&Component] = &[$(&$module::$component),*];

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
    let place = ALL.iter().position(|c| c.kind == kind)?;
    let lines = HEADS[place].lines().map(|line| {
        let text = line.strip_prefix("//!").unwrap_or(line);
        text.strip_prefix(' ').unwrap_or(text)
    });
    Some(lines.collect::<Vec<_>>().join("\n"))
}

/// Finds a component by its kind.
pub fn find(kind: &str) -> Option<&'static Component> {
    ALL.iter().copied().find(|c| c.kind == kind)
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
    pressure_source::PRESSURE_SOURCE [],
    tank::TANK [],
    flow_source::FLOW_SOURCE [PumpFlow],
    variable_pump::VARIABLE_PUMP [Compensator, StrokedFlow],
    volume::VOLUME [VolumePressure, FluidPressure],
    orifice::ORIFICE [Restriction],
    external_leakage::EXTERNAL_LEAKAGE [LeakageFlow],
    filter::FILTER [FilterFlow],
    check_valve::CHECK_VALVE [OneWayFlow],
    relief_valve::RELIEF_VALVE [],
    accumulator::ACCUMULATOR [GasPressure],
    long_line::LONG_LINE [LineFlow, LinePressure],
    shut_off_valve::SHUT_OFF_VALVE [ShutOffFlow],
    servo_valve::SERVO_VALVE [SpoolMotion, EdgeFlow, PilotFlow],
    proportional_valve::PROPORTIONAL_VALVE [ControlledSpool, RatedEdge],
    mode_valve::MODE_VALVE [ModePosition, Transmission, BypassFlow, MakeUpFlow, ReserveFlow],
    cylinder::CYLINDER [ChamberPressure, SealLeakage, PistonForce, PistonFriction, PistonStop],
    bristle_cylinder::BRISTLE_CYLINDER [BristleFriction],

    fixed::FIXED [],
    mass::MASS [MassMotion, MassStops],
    inertia::INERTIA [Turning],
    lever::LEVER [LeverMotion, LeverMoment],
    attachment::ATTACHMENT [Joint],
    friction::FRICTION [Rubbing],
    spring::SPRING [Spreading],
    force::FORCE [Applied],
    aerodynamic_load::AERODYNAMIC_LOAD [Stream, StreamAtAltitude, HingeMoment, HingeDamping],

    pressure_sensor::PRESSURE_SENSOR [PressureToCurrent, CurrentToPressure],
    tapped_pressure_sensor::TAPPED_PRESSURE_SENSOR [TappingLine],
    lvdt::LVDT [PositionToRatio, RatioToPosition],
    temperature_sensor::TEMPERATURE_SENSOR [Warming, TemperatureToCurrent, CurrentToTemperature],
    flow_sensor::FLOW_SENSOR [Metering, FlowToCurrent, CurrentToFlow],

    position_controller::POSITION_CONTROLLER [PositionDemand, PressureFeedback, LimitedCurrent],
    sampled_position_controller::SAMPLED_POSITION_CONTROLLER [SampledLaw],
    axis_controller::AXIS_CONTROLLER [AxisDemand, AxisDamping, AxisOutput],
    pid_controller::PID_CONTROLLER [PidLaw],
    force_fight_equaliser::FORCE_FIGHT_EQUALISER [PressureDifference, FightFilter, FightCorrection],
    force_fight_equaliser::FORCE_FIGHT_EQUALISER_3 [FightOfThree],
    force_fight_equaliser::FORCE_FIGHT_EQUALISER_4 [FightOfFour],
    low_pass_filter::LOW_PASS_FILTER [FirstOrder],
    selector::SELECTOR [Selection, MiddleOfThree, MiddleOfFour],
    gain::GAIN [Product],
}
