//! The aerodynamic hinge moment on a control surface.
//!
//! ```text
//! q = λ ρ V²/2,   m² = V²/a²                                              (H1)
//! s = q S c / √(1 − m²),   s_ω = s c / (2V)                               (H2)
//! M = s (C_0 + C_α α + C_θ θ) + s_ω C_ω ω                                  (H3)
//! ```
//!
//! ρ and a are the density and the speed of sound of the standard atmosphere, and λ is the load factor. The
//! Prandtl-Glauert factor accounts for compressibility. The moment is linear in small angles and valid below
//! a Mach number of about 0.8. 1 − m² is held above 0.19 (Mach 0.9, which the range of V reaches). Below
//! 1 m/s, the damping is that at 1 m/s. The air is an equation only if the altitude is connected; otherwise
//! it is a constant.
//!
//! Source: hinge moments linear in the angles, as in Etkin & Reid 1996; Prandtl and Glauert; the atmosphere
//! of ISO 2533.

use crate::atmosphere::standard_air;
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::{Scalar, lit};
use crate::spec::{Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// Mach 0.9 in the stratosphere, where the speed of sound is lowest. (H2) does not hold beyond.
const LARGEST_SPEED_M_S: f64 = 265.0;

parameters! {
    air_speed_m_s: parameter(150.0, (0.0, LARGEST_SPEED_M_S), "true air speed V"),
    altitude_m: parameter(3000.0, (-2e3, 2e4), "altitude"),
    incidence_rad: parameter(0.05236, (-0.5, 0.5), "incidence α"),
    load_factor: parameter(1.0, (0.0, 10.0), "factor λ on the dynamic pressure"),
    reference_area_m2: parameter(1.93, (1e-3, 1e3), "surface area S"),
    chord_m: parameter(0.58, (1e-2, 1e2), "surface chord c"),
    hinge_moment_zero: parameter(-0.01, (-1.0, 1.0), "coefficient C_0"),
    hinge_moment_incidence_per_rad: parameter(
        -0.25,
        (-10.0, 10.0),
        "coefficient C_α of the incidence",
    ),
    hinge_moment_deflection_per_rad: parameter(
        -0.60,
        (-10.0, 10.0),
        "coefficient C_θ of the deflection",
    ),
    hinge_moment_rate_per_rad: parameter(-1.5, (-100.0, 100.0), "coefficient C_ω of ω c/(2V)"),
}

/// The air's hinge moment; see the module documentation.
pub(crate) static AERODYNAMIC_LOAD: Component = Component {
    kind: "aerodynamic_load",
    summary: "hinge moment of the air on a control surface",
    parameters: &PARAMETERS,
    ports: &[
        rotational("shaft", "hinge of the surface"),
        input_or("air_speed", Unit::MetrePerSecond, "air_speed_m_s", "true air speed"),
        input_or("altitude", Unit::Metre, "altitude_m", "altitude"),
        input_or("incidence", Unit::Radian, "incidence_rad", "incidence of the wing"),
        input_or("load_factor", Unit::None, "load_factor", "factor on the dynamic pressure"),
        output("dynamic_pressure", Unit::Pascal, "dynamic pressure with the load factor"),
    ],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let [pressure, static_scale, rate_scale] = core::array::from_fn(|_| wiring.internal());
    let stream = [pressure, static_scale, rate_scale].map(Output::add);
    let [speed, factor] = [wiring.signal("air_speed"), wiring.signal("load_factor")];
    if wiring.connected("altitude") {
        let inputs = [speed, factor, wiring.signal("altitude")];
        wiring.equation(StreamAtAltitude, inputs, stream);
    } else {
        wiring.equation(Stream, [speed, factor], stream);
    }
    wiring.set("dynamic_pressure", pressure.variable());
    let moment = Output::add(wiring.force("shaft"));
    let [angle, rate] = [wiring.position("shaft"), wiring.velocity("shaft")];
    let inputs = [static_scale.variable(), wiring.signal("incidence"), angle];
    wiring.equation(HingeMoment, inputs, [moment]);
    let inputs = [rate_scale.variable(), rate];
    wiring.equation(HingeDamping, inputs, [moment]);
}

/// Equation (H2): returns the dynamic pressure and the scales of the static and of the rate
/// moment.
#[inline(always)]
fn scales<S: Scalar>(q: S, mach_2: S, speed: S, area_chord: S::Base, half: S::Base) -> [S; 3] {
    let beta_2 = (-mach_2 + lit::<S>(1.0)).max(S::constant(0.19));
    let scale = q * area_chord / beta_2.sqrt();
    [q, scale, scale * half / speed.max(S::constant(1.0))]
}

fn area_and_chord<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
    [
        given[index::reference_area_m2] * given[index::chord_m],
        given[index::chord_m] * S::constant(0.5),
    ]
}

/// Equations (H1) and (H2) at a constant altitude: (air speed, load factor) →
/// dynamic pressure and the scales of both moments.
pub(crate) struct Stream;

impl Equation<2, 3, 4> for Stream {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 4] {
        let air = standard_air(given[index::altitude_m]);
        let sound = air.sound_speed_m_s;
        let [area_chord, half_chord] = area_and_chord(given);
        let half_density = air.density_kg_m3 * S::constant(0.5);
        [half_density, S::constant(1.0) / (sound * sound), area_chord, half_chord]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 4], [speed, factor]: [S; 2]) -> [S; 3] {
        let speed_2 = speed * speed;
        scales(speed_2 * c[0] * factor, speed_2 * c[1], speed, c[2], c[3])
    }
}

/// The same with the altitude as a signal: (air speed, load factor, altitude).
pub(crate) struct StreamAtAltitude;

impl Equation<3, 3, 2> for StreamAtAltitude {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        area_and_chord(given)
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], [speed, factor, altitude]: [S; 3]) -> [S; 3] {
        let air = standard_air(altitude);
        let mach = speed / air.sound_speed_m_s;
        let q = speed * speed * air.density_kg_m3 * lit::<S>(0.5) * factor;
        scales(q, mach * mach, speed, c[0], c[1])
    }
}

/// Equation (H3) at zero rate: (scale, incidence, angle) → moment.
pub(crate) struct HingeMoment;

impl Equation<3, 1, 3> for HingeMoment {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        [
            given[index::hinge_moment_zero],
            given[index::hinge_moment_incidence_per_rad],
            given[index::hinge_moment_deflection_per_rad],
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [scale, incidence, angle]: [S; 3]) -> [S; 1] {
        [scale * (incidence * c[1] + angle * c[2] + c[0])]
    }
}

/// The rate's share of (H3): (scale, rate) → moment.
pub(crate) struct HingeDamping;

impl Equation<2, 1, 1> for HingeDamping {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 1] {
        [given[index::hinge_moment_rate_per_rad]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 1], [scale, rate]: [S; 2]) -> [S; 1] {
        [scale * rate * c[0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_to_the_air_agree_and_give_the_hold_moment() {
        let fluid = crate::fluid::Fluid::default().at(313.15);
        let parameters: alloc::vec::Vec<f64> =
            PARAMETERS.iter().map(|p| p.default.unwrap()).collect();
        let given = Given { parameters: &parameters, fluid: &fluid, which: 0 };
        let fixed = Stream::evaluate::<f64>(&Stream::constants(&given), [150.0, 1.0]);
        let constants = StreamAtAltitude::constants(&given);
        let free = StreamAtAltitude::evaluate::<f64>(&constants, [150.0, 1.0, 3000.0]);
        for (a, b) in fixed.iter().zip(free) {
            assert!((a / b - 1.0).abs() < 1e-14);
        }
        assert!((fixed[0] - 10_227.6).abs() < 1.0);
        // 10° commanded against 100 % load: 9.171° held by 1532.95 N m.
        let angle = 9.171_f64.to_radians();
        let constants = HingeMoment::constants(&given);
        let [moment] = HingeMoment::evaluate::<f64>(&constants, [fixed[1], 0.05236, angle]);
        assert!((moment + 1532.95).abs() < 0.5, "{moment}");
        let still = Stream::evaluate::<f64>(&Stream::constants(&given), [0.0, 1.0]);
        assert_eq!(still, [0.0; 3]);
    }
}
