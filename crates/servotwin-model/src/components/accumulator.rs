//! A gas accumulator, which stores fluid or damps pulsations.
//!
//! ```text
//! V_g  = V_0 (p_0/p)^{1/n}                      polytropic gas            (A1)
//! C    = σ V_g/(n p) + V_f/E(p)                                           (A2)
//! p'   = q/C                                                              (A3)
//! ```
//!
//! `V_0` and `p_0` are the gas volume and the gas pressure before filling. Below the precharge, the bladder
//! rests on its seat and only the fluid in the connection, `V_f`, is compressed: `σ`, the cubic step of
//! [`crate::math::smooth_step`], closes off the gas between 1.0 and 0.95 times `p_0`. `E` is the modulus of
//! [`crate::fluid`]. With it, an empty accumulator separates from its fluid: the pressure stays at the vapor
//! pressure until the cavity is filled again.
//!
//! Source: the polytropic change of an ideal gas, and continuity. The seat is the toolkit's own choice.

use super::volume::fluid_pressure;
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::fluid::{BULK_CONSTANTS, VAPOR_PRESSURE_PA, compressibility_per_pa};
use crate::math::{power, smooth_step};
use crate::scalar::Scalar;
use crate::spec::{Category, declare::*};
use crate::wiring::Wiring;

/// The pressure at which the bladder begins to leave its seat, per unit of the precharge.
const SEATED: f64 = 0.95;

parameters! {
    gas_volume_m3: required((1e-7, 1.0), "gas volume before filling"),
    precharge_pa: required((1e4, 1e8), "gas pressure before filling, absolute"),
    polytropic_exponent: parameter(1.4, (1.0, 1.7), "polytropic exponent of the gas"),
    fluid_volume_m3: parameter(2e-5, (1e-8, 1.0), "fluid volume in the connection"),
    start_pa: parameter(1e7, (1e3, 1e8), "first guess for the steady state"),
}

/// A gas accumulator; see the module documentation.
pub(crate) static ACCUMULATOR: Component = Component {
    kind: "accumulator",
    summary: "gas accumulator",
    parameters: &PARAMETERS,
    faults: &[fault("precharge_loss", Category::Wear, "gas has been lost").scales(
        "precharge_pa",
        0.1,
        (0.01, 1.0),
    )],
    ports: &[pressure("port", "fluid side")],
    states: &[pressure_state("pressure_pa", "start_pa", "pressure, absolute")],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let state = wiring.state("pressure_pa");
    let pressure = fluid_pressure(wiring, "pressure_pa");
    wiring.set("port", pressure);
    let flow = wiring.flow("port").variable();
    let rate = wiring.rate("pressure_pa");
    wiring.equation(GasPressure, [state, flow], [rate]);
}

/// Equations (A1)–(A3): (pressure, flow into the accumulator) → pressure rate.
pub(crate) struct GasPressure;

impl Equation<2, 1, { 5 + BULK_CONSTANTS }> for GasPressure {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 5 + BULK_CONSTANTS] {
        let one = S::constant(1.0);
        let [a, b, c, d, e, f] = given.fluid.bulk.to_array();
        let per_exponent = one / given[index::polytropic_exponent];
        let precharge = given[index::precharge_pa];
        // V_g/(n p) = (V_0/n) p_0^{1/n} p^{−1/n − 1}
        let gas = given[index::gas_volume_m3] * per_exponent * power(precharge, per_exponent);
        let seated = precharge * S::constant(SEATED);
        let per_lift = one / (precharge - seated);
        [
            gas,
            -(per_exponent + one),
            seated,
            per_lift,
            given[index::fluid_volume_m3],
            a,
            b,
            c,
            d,
            e,
            f,
        ]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 5 + BULK_CONSTANTS], [p, flow]: [S; 2]) -> [S; 1] {
        let gas = power(p.max(S::constant(VAPOR_PRESSURE_PA)), c[1]) * c[0];
        let open = smooth_step((p - c[2]) * c[3]);
        [flow / (open * gas + compressibility_per_pa(&c[5..], p) * c[4])]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    const RESERVE: &[(&str, f64)] =
        &[("gas_volume_m3", 1e-4), ("precharge_pa", 10e5), ("fluid_volume_m3", 1e-6)];

    #[test]
    fn the_gas_is_compressed_polytropically() {
        let c = constants(GasPressure, &ACCUMULATOR, RESERVE, 0);
        let slope = |p: f64| GasPressure::evaluate(&c, [p, 1.0])[0];
        let mut pressure = 10e5;
        let step = 1e-8;
        // 30 % of the shell is filled, by the midpoint rule.
        for _ in 0..3_000 {
            pressure += step * slope(pressure + 0.5 * step * slope(pressure));
        }
        let expected = 10e5 * libm::pow(1.0 / 0.7, 1.4);
        assert!((pressure / expected - 1.0).abs() < 1e-2, "{pressure}");
    }

    #[test]
    fn below_the_precharge_there_is_little_to_give() {
        let c = constants(GasPressure, &ACCUMULATOR, RESERVE, 0);
        let slope = |p: f64| GasPressure::evaluate(&c, [p, 1.0])[0];
        assert!(slope(9e5) > 50.0 * slope(11e5));
        for pressure in [-1e6, 0.0, 1e3, 9.5e5, 1e6] {
            assert!(slope(pressure).is_finite() && slope(pressure) > 0.0);
        }
    }
}
