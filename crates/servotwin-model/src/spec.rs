//! What a component declares: parameters, faults, ports and states.
//!
//! Each is declared once, as data. The parser of system files, the fault list, the
//! documentation, the column names and the checks are all derived from it.

use crate::scalar::Scalar;

/// Name suffix and symbol of a unit, and the unit that reports show instead.
struct UnitFacts {
    suffix: &'static str,
    symbol: &'static str,
    shown: &'static str,
    shown_per_si: f64,
}

const DEGREES: f64 = 180.0 / core::f64::consts::PI;

/// Declares the units, one per row: variant, name suffix, SI symbol, symbol that reports show, and how many of these
/// are one SI unit.
macro_rules! units {
    ($($(#[$doc:meta])* $unit:ident: $suffix:literal, $symbol:literal, $shown:literal, $shown_per_si:expr;)*) => {
        /// A physical unit (SI) of a parameter, a signal or a state.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Unit {
            $($(#[$doc])* $unit,)*
        }

        impl Unit {
            /// All units, for tests and for the parser's hints.
            pub const ALL: [Unit; [$(Unit::$unit),*].len()] = [$(Unit::$unit),*];

            const fn facts(self) -> UnitFacts {
                match self {
                    $(Unit::$unit => UnitFacts {
                        suffix: $suffix,
                        symbol: $symbol,
                        shown: $shown,
                        shown_per_si: $shown_per_si,
                    },)*
                }
            }
        }
    };
}

units! {
    /// A pure number.
    None: "", "", "", 1.0;
    /// Pascal, absolute pressure.
    Pascal: "_pa", "Pa", "bar", 1e-5;
    /// Kelvin.
    Kelvin: "_k", "K", "°C", 1.0;
    /// Meter.
    Metre: "_m", "m", "mm", 1e3;
    /// Square meter.
    SquareMetre: "_m2", "m²", "mm²", 1e6;
    /// Cubic meter.
    CubicMetre: "_m3", "m³", "cm³", 1e6;
    /// Meter per second.
    MetrePerSecond: "_m_s", "m/s", "mm/s", 1e3;
    /// Square meter per second: a kinematic viscosity.
    SquareMetrePerSecond: "_m2_s", "m²/s", "cSt", 1e6;
    /// Cubic meter per second.
    CubicMetrePerSecond: "_m3_s", "m³/s", "L/min", 6e4;
    /// Kilogram.
    Kilogram: "_kg", "kg", "kg", 1.0;
    /// Kilogram square meter.
    KilogramSquareMetre: "_kg_m2", "kg m²", "kg m²", 1.0;
    /// Kilogram per cubic meter.
    KilogramPerCubicMetre: "_kg_m3", "kg/m³", "kg/m³", 1.0;
    /// Newton.
    Newton: "_n", "N", "N", 1.0;
    /// Newton meter.
    NewtonMetre: "_nm", "N m", "N m", 1.0;
    /// Newton per meter.
    NewtonPerMetre: "_n_m", "N/m", "N/µm", 1e-6;
    /// Newton second per meter.
    NewtonSecondPerMetre: "_n_s_m", "N s/m", "N s/m", 1.0;
    /// Newton meter second per radian.
    NewtonMetreSecond: "_nm_s", "N m s", "N m s", 1.0;
    /// Radian.
    Radian: "_rad", "rad", "°", DEGREES;
    /// Radian per second.
    RadianPerSecond: "_rad_s", "rad/s", "°/s", DEGREES;
    /// One per radian.
    PerRadian: "_per_rad", "1/rad", "1/rad", 1.0;
    /// Second.
    Second: "_s", "s", "s", 1.0;
    /// Hertz.
    Hertz: "_hz", "Hz", "Hz", 1.0;
    /// One per meter.
    PerMetre: "_per_m", "1/m", "1/m", 1.0;
    /// Meter per pascal.
    MetrePerPascal: "_m_pa", "m/Pa", "mm/bar", 1e8;
    /// One per pascal.
    PerPascal: "_per_pa", "1/Pa", "1/bar", 1e5;
    /// Cubic meter per second and pascal: a laminar conductance.
    CubicMetrePerSecondPascal: "_m3_s_pa", "m³/(s Pa)", "L/(min bar)", 6e9;
    /// Pascal second per cubic meter: a laminar resistance.
    PascalSecondPerCubicMetre: "_pa_s_m3", "Pa s/m³", "bar min/L", 1e-5 / 6e4;
    /// Pascal second squared per meter to the sixth: a turbulent resistance.
    PascalSecondSquaredPerMetreToTheSixth: "_pa_s2_m6", "Pa s²/m⁶", "bar min²/L²", 1e-5 / 3.6e9;
    /// One per kelvin.
    PerKelvin: "_per_k", "1/K", "1/K", 1.0;
    /// One per second.
    PerSecond: "_per_s", "1/s", "1/s", 1.0;
    /// One per second squared.
    PerSecondSquared: "_per_s2", "1/s²", "1/s²", 1.0;
    /// Ampere.
    Ampere: "_a", "A", "mA", 1e3;
}

impl Unit {
    /// The unit of a quantity, by the longest suffix of its name.
    const fn of_name(name: &str) -> Unit {
        let (mut unit, mut place) = (Unit::None, 0);
        while place < Unit::ALL.len() {
            let suffix = Unit::ALL[place].suffix();
            if suffix.len() > unit.suffix().len() && ends_with(name.as_bytes(), suffix.as_bytes()) {
                unit = Unit::ALL[place];
            }
            place += 1;
        }
        unit
    }

    /// The suffix of every public name in this unit, e.g. `_pa`.
    pub const fn suffix(self) -> &'static str {
        self.facts().suffix
    }

    /// The SI symbol, e.g. `Pa`.
    pub const fn symbol(self) -> &'static str {
        self.facts().symbol
    }

    /// Symbol of the unit that reports show, e.g. `bar`.
    pub const fn shown(self) -> &'static str {
        self.facts().shown
    }

    /// Converts an SI value to the unit that reports show.
    pub fn to_shown(self, si: f64) -> f64 {
        let offset = if self == Unit::Kelvin { -273.15 } else { 0.0 };
        si * self.facts().shown_per_si + offset
    }

    /// Converts a difference of two SI values to the unit that reports show.
    pub fn difference_to_shown(self, si: f64) -> f64 {
        si * self.facts().shown_per_si
    }
}

const fn ends_with(name: &[u8], end: &[u8]) -> bool {
    let mut left = end.len();
    while left > 0
        && left <= name.len()
        && name[name.len() - 1 - (end.len() - left)] == end[left - 1]
    {
        left -= 1;
    }
    left == 0
}

/// A number that a system file gives to a component.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// The name, ending in its unit's suffix.
    pub name: &'static str,
    /// The unit.
    pub unit: Unit,
    /// The value if the file gives none; `None` makes the parameter mandatory.
    pub default: Option<f64>,
    /// The smallest value allowed.
    pub min: f64,
    /// The largest value allowed.
    pub max: f64,
    /// One line of documentation.
    pub summary: &'static str,
}

/// How a fault of intensity `i` in 0 … 1 changes a parameter `p`.
///
/// All three laws leave `p` unchanged at `i = 0`, to the last bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// `p + i · full`: for parameters that are zero when healthy.
    Add,
    /// `p · (1 − i (1 − full))`: a linear loss or growth to `full` times.
    Scale,
    /// `p · full^i`: the same ratio per step of intensity, for oversized parts.
    Geometric,
}

impl Law {
    /// The parameter under a fault of the given intensity.
    pub fn apply<S: Scalar<Base = S>>(self, parameter: S, intensity: S, full: f64) -> S {
        let (one, number) = (S::constant(1.0), S::constant);
        match self {
            Law::Add => parameter + intensity * number(full),
            Law::Scale => parameter * (one - intensity * number(1.0 - full)),
            Law::Geometric => parameter * (intensity * number(crate::math::ln(full))).exp(),
        }
    }
}

/// Declares the categories: variant and name in tables and files.
macro_rules! categories {
    ($($(#[$doc:meta])* $category:ident = $name:literal;)*) => {
        /// The physical kind of a fault, for reports and for selecting faults.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Category {
            $($(#[$doc])* $category,)*
        }

        impl Category {
            /// The name in tables and files.
            pub fn name(self) -> &'static str {
                match self {
                    $(Category::$category => $name,)*
                }
            }
        }
    };
}

categories! {
    /// Fluid leaves the circuit.
    ExternalLeakage = "external leakage";
    /// Fluid passes an internal seal.
    InternalLeakage = "internal leakage";
    /// A passage is narrowed.
    Clogging = "clogging";
    /// Edges or clearances are worn.
    Wear = "wear";
    /// A drive is slow or poorly damped.
    Dynamics = "dynamics";
    /// A part sticks or moves less than it should.
    Jamming = "jamming";
    /// Friction is increased.
    Friction = "friction";
    /// A joint has play or lost stiffness.
    Looseness = "looseness";
    /// The fluid's properties are wrong.
    Contamination = "contamination";
    /// A signal has a constant error.
    Bias = "bias";
    /// A signal has a gain error.
    Calibration = "calibration";
    /// A signal lags.
    Lag = "lag";
}

/// A fault of a component: a parameter that changes with intensity.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    /// The name within its component, e.g. `clogging_pa`.
    pub name: &'static str,
    /// The parameter that it changes.
    pub parameter: &'static str,
    /// How it changes the parameter.
    pub law: Law,
    /// The law's value at intensity 1; a system file can give another.
    pub full: f64,
    /// The smallest `full` that a system file may give.
    pub full_min: f64,
    /// The largest `full` that a system file may give.
    pub full_max: f64,
    /// The physical kind.
    pub category: Category,
    /// One line of documentation.
    pub summary: &'static str,
}

impl Fault {
    /// Adds `full · i` to a parameter.
    pub(crate) const fn adds(self, parameter: &'static str, full: f64, range: (f64, f64)) -> Self {
        self.acting(Law::Add, parameter, full, range)
    }

    /// Scales a parameter linearly to `full` times its value.
    pub(crate) const fn scales(
        self,
        parameter: &'static str,
        full: f64,
        range: (f64, f64),
    ) -> Self {
        self.acting(Law::Scale, parameter, full, range)
    }

    /// Multiplies a parameter by `full^i`, such as that of a shrinking passage.
    pub(crate) const fn shrinks(
        self,
        parameter: &'static str,
        full: f64,
        range: (f64, f64),
    ) -> Self {
        self.acting(Law::Geometric, parameter, full, range)
    }

    const fn acting(
        self,
        law: Law,
        parameter: &'static str,
        full: f64,
        (full_min, full_max): (f64, f64),
    ) -> Self {
        Fault { law, parameter, full, full_min, full_max, ..self }
    }
}

/// The kind of a port: the quantities that it exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortKind {
    /// Pressure and flow. Exactly one component per node sets the pressure.
    Hydraulic {
        /// Whether this component sets the pressure.
        sets: bool,
    },
    /// Position, velocity and force along a line.
    Translational {
        /// Whether this component sets position and velocity.
        sets: bool,
    },
    /// Angle, rate and moment about an axis.
    Rotational {
        /// Whether this component sets angle and rate.
        sets: bool,
    },
    /// A signal that the component reads.
    SignalIn {
        /// The signal's unit.
        unit: Unit,
        /// The parameter that supplies the signal if nothing is connected; `None`
        /// makes the connection mandatory.
        default: Option<&'static str>,
    },
    /// A signal that the component outputs.
    SignalOut {
        /// The signal's unit.
        unit: Unit,
    },
}

impl PortKind {
    /// The family in words; ports of one family can be connected.
    pub fn family(self) -> &'static str {
        match self {
            PortKind::Hydraulic { .. } => "hydraulic",
            PortKind::Translational { .. } => "translational",
            PortKind::Rotational { .. } => "rotational",
            PortKind::SignalIn { .. } | PortKind::SignalOut { .. } => "signal",
        }
    }

    /// Whether this port sets the node's potential or its signal.
    pub fn sets(self) -> bool {
        match self {
            PortKind::Hydraulic { sets }
            | PortKind::Translational { sets }
            | PortKind::Rotational { sets } => sets,
            PortKind::SignalIn { .. } => false,
            PortKind::SignalOut { .. } => true,
        }
    }
}

/// A connection point of a component.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// The name within its component.
    pub name: &'static str,
    /// The quantities that it exchanges.
    pub kind: PortKind,
    /// Whether it may be left open. An open hydraulic port is plugged, an open
    /// mechanical port is free.
    pub optional: bool,
    /// Range of a signal input that has no default parameter.
    pub(crate) range: Option<(f64, f64)>,
    /// One line of documentation.
    pub summary: &'static str,
}

/// A state variable of a component.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// The name, ending in its unit's suffix.
    pub name: &'static str,
    /// The unit.
    pub(crate) unit: Unit,
    /// The magnitude that errors are measured against.
    pub(crate) scale: f64,
    /// Permitted error per `scale` in a step, as a multiple of that of other states.
    pub(crate) error_weight: f64,
    /// The initial guess for the steady-state search.
    pub start: Start,
    /// Lower bound in the steady-state search; minus infinity for no bound.
    pub(crate) lowest: f64,
    /// One line of documentation.
    pub summary: &'static str,
}

impl State {
    /// Sets the initial guess for the steady-state search.
    pub(crate) const fn from(self, start: Start) -> Self {
        State { start, ..self }
    }

    /// Sets the error weight.
    pub(crate) const fn with_error_weight(self, error_weight: f64) -> Self {
        State { error_weight, ..self }
    }
}

/// Lower bound of a pressure in the steady-state search. An implicit step may end below vacuum, where hardly any flow
/// raises the pressure again, and the search would fail. No system of the catalogue has a lower steady-state pressure.
const LOWEST_AT_REST_PA: f64 = 1e3;

/// The initial guess of a state for the steady-state search.
#[derive(Clone, Copy, Debug)]
pub enum Start {
    /// A fixed number.
    Value(f64),
    /// The value of a parameter of the component.
    Parameter(&'static str),
}

/// Shorthands that make a component's declaration read as a table.
pub mod declare {
    use super::*;

    /// Declares the parameters of a component, one per row: `name: parameter(default, range, summary)`.
    /// The unit follows from the name.
    ///
    /// System files and equations use the name. The macro creates the array `PARAMETERS` for the component and
    /// the module `index` with the position of each parameter: an equation reads `given[index::area_m2]`.
    macro_rules! parameters {
        ($($name:ident: $($declare:ident)::+ ($($argument:expr),* $(,)?)),* $(,)?) => {
            /// The positions of the parameters.
            #[allow(non_upper_case_globals, dead_code)]
            pub(crate) mod index {
                #[allow(non_camel_case_types)]
                enum Position { $($name),* }
                $(pub const $name: usize = Position::$name as usize;)*
            }

            /// The parameters in the order of their positions.
            pub(crate) const PARAMETERS: [$crate::spec::Parameter; [$(index::$name),*].len()] =
                [$($($declare)::+(stringify!($name), $($argument),*)),*];
        };
    }
    pub(crate) use parameters;

    /// A parameter with a default.
    pub(crate) const fn parameter(
        name: &'static str,
        default: f64,
        range: (f64, f64),
        summary: &'static str,
    ) -> Parameter {
        Parameter { default: Some(default), ..required(name, range, summary) }
    }

    /// The parameters of a kind that stands for another: those of the other at the same positions, then its own.
    pub(crate) const fn with_more<const SHARED: usize, const OWN: usize, const ALL: usize>(
        shared: [Parameter; SHARED],
        own: [Parameter; OWN],
    ) -> [Parameter; ALL] {
        let mut all = [own[0]; ALL];
        let mut place = 0;
        while place < ALL {
            all[place] = if place < SHARED { shared[place] } else { own[place - SHARED] };
            place += 1;
        }
        all
    }

    /// A parameter that every system file must give.
    pub(crate) const fn required(
        name: &'static str,
        range: (f64, f64),
        summary: &'static str,
    ) -> Parameter {
        let unit = Unit::of_name(name);
        Parameter { name, unit, default: None, min: range.0, max: range.1, summary }
    }

    /// A fault; [`Fault::adds`], [`Fault::scales`] or [`Fault::shrinks`] says what it does.
    pub(crate) const fn fault(
        name: &'static str,
        category: Category,
        summary: &'static str,
    ) -> Fault {
        let (law, full) = (Law::Add, 0.0);
        Fault { name, parameter: "", law, full, full_min: full, full_max: full, category, summary }
    }

    const fn port(name: &'static str, kind: PortKind, summary: &'static str) -> Port {
        Port { name, kind, optional: false, range: None, summary }
    }

    /// A hydraulic port whose pressure another component sets.
    pub(crate) const fn hydraulic(name: &'static str, summary: &'static str) -> Port {
        port(name, PortKind::Hydraulic { sets: false }, summary)
    }

    /// A hydraulic port whose pressure this component sets.
    pub(crate) const fn pressure(name: &'static str, summary: &'static str) -> Port {
        port(name, PortKind::Hydraulic { sets: true }, summary)
    }

    /// A translational port whose motion another component sets.
    pub(crate) const fn translational(name: &'static str, summary: &'static str) -> Port {
        port(name, PortKind::Translational { sets: false }, summary)
    }

    /// A translational port whose motion this component sets.
    pub(crate) const fn moving(name: &'static str, summary: &'static str) -> Port {
        port(name, PortKind::Translational { sets: true }, summary)
    }

    /// A rotational port whose motion another component sets.
    pub(crate) const fn rotational(name: &'static str, summary: &'static str) -> Port {
        port(name, PortKind::Rotational { sets: false }, summary)
    }

    /// A rotational port whose motion this component sets.
    pub(crate) const fn turning(name: &'static str, summary: &'static str) -> Port {
        port(name, PortKind::Rotational { sets: true }, summary)
    }

    /// A signal input that must be connected.
    pub(crate) const fn input(name: &'static str, unit: Unit, summary: &'static str) -> Port {
        port(name, PortKind::SignalIn { unit, default: None }, summary)
    }

    /// A signal input that must be connected, with its range.
    pub(crate) const fn input_within(
        name: &'static str,
        unit: Unit,
        range: (f64, f64),
        summary: &'static str,
    ) -> Port {
        Port { range: Some(range), ..input(name, unit, summary) }
    }

    /// A signal input with a default parameter; it may be left open.
    pub(crate) const fn input_or(
        name: &'static str,
        unit: Unit,
        default: &'static str,
        summary: &'static str,
    ) -> Port {
        Port {
            optional: true,
            ..port(name, PortKind::SignalIn { unit, default: Some(default) }, summary)
        }
    }

    /// A signal output; it may be left open.
    pub(crate) const fn output(name: &'static str, unit: Unit, summary: &'static str) -> Port {
        Port { optional: true, ..port(name, PortKind::SignalOut { unit }, summary) }
    }

    /// Makes a port optional.
    pub(crate) const fn optional(port: Port) -> Port {
        Port { optional: true, ..port }
    }

    /// A state variable that starts at zero, with error weight 1 and no lower bound.
    pub(crate) const fn state(name: &'static str, scale: f64, summary: &'static str) -> State {
        let (unit, start) = (Unit::of_name(name), Start::Value(0.0));
        State { name, unit, scale, error_weight: 1.0, start, lowest: f64::NEG_INFINITY, summary }
    }

    /// The error weight of a velocity that no sensor measures. Such a velocity errs most where friction reverses, and
    /// would shorten steps in which all else is accurate. A weight 10 % larger doubles the largest errors, which occur
    /// where an edge clogs or the supply is lost.
    pub(crate) const VELOCITY_ERROR_WEIGHT: f64 = 5.0;

    /// The absolute pressure of a fluid, Pa; `start` names the parameter with the initial guess.
    pub(crate) const fn pressure_state(
        name: &'static str,
        start: &'static str,
        summary: &'static str,
    ) -> State {
        State {
            lowest: LOWEST_AT_REST_PA,
            ..state(name, 2e7, summary).from(Start::Parameter(start))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * b.abs()
    }

    #[test]
    fn reports_show_engineers_units() {
        let table = [
            (Unit::Pascal, 20.684e6, 206.84, "bar"),
            (Unit::Kelvin, 313.15, 40.0, "°C"),
            (Unit::Metre, 22.2e-3, 22.2, "mm"),
            (Unit::CubicMetrePerSecond, 12.5e-3 / 60.0, 12.5, "L/min"),
            (Unit::Radian, core::f64::consts::PI, 180.0, "°"),
            (Unit::Ampere, 8e-3, 8.0, "mA"),
            (Unit::PascalSecondPerCubicMetre, 3.84e9, 0.64, "bar min/L"),
            (Unit::CubicMetrePerSecondPascal, 1.0 / 6e9, 1.0, "L/(min bar)"),
            (Unit::PascalSecondSquaredPerMetreToTheSixth, 3.6e14, 1.0, "bar min²/L²"),
            (Unit::None, 0.7, 0.7, ""),
        ];
        for (unit, si, shown, symbol) in table {
            assert_eq!(unit.shown(), symbol);
            assert!(close(unit.to_shown(si), shown), "{si} {} is {shown} {symbol}", unit.symbol());
        }
    }

    #[test]
    fn a_difference_has_no_offset() {
        assert_eq!(Unit::Kelvin.difference_to_shown(5.0), 5.0);
        assert_eq!(Unit::Kelvin.to_shown(273.15), 0.0);
    }

    #[test]
    fn every_unit_has_its_own_suffix_and_symbol() {
        for (i, a) in Unit::ALL.iter().enumerate() {
            assert_eq!(a.suffix().is_empty(), a.symbol().is_empty());
            for b in &Unit::ALL[i + 1..] {
                assert_ne!(a, b);
                assert_ne!(a.suffix(), b.suffix());
                assert_ne!(a.symbol(), b.symbol());
            }
        }
    }

    #[test]
    fn laws_are_neutral_at_zero_and_full_at_one() {
        for p in [0.0, 1e-300, 2.38e-3, 0.1, 1.0 / 3.0, 20.684e6, -2e-6] {
            for law in [Law::Add, Law::Scale, Law::Geometric] {
                for full in [0.004, 0.03, 0.05, 0.3, 2.0, 30.0] {
                    assert_eq!(law.apply(p, 0.0, full).to_bits(), p.to_bits(), "{law:?} {p}");
                }
            }
        }
        assert_eq!(Law::Add.apply(1.0, 1.0, -0.8), 1.0 - 0.8);
        assert!(close(Law::Scale.apply(2.0, 1.0, 0.05), 0.1));
        assert!(close(Law::Scale.apply(500.0, 1.0, 10.0), 5000.0));
        assert!(close(Law::Geometric.apply(100.0, 1.0, 0.03), 3.0));
        assert!(close(Law::Geometric.apply(100.0, 0.5, 0.04), 20.0));
    }
}
