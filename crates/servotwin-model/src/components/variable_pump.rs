//! A pump of variable displacement with a pressure compensator.
//!
//! ```text
//! s_c = σ((p_set − Δp)/Δp_r),   Δp = p_out − p_in                          (VP1)
//! s'  = (s_c − s)/τ                                                       (VP2)
//! q   = n Q s − C_li Δp                                inlet → outlet      (VP3)
//! ```
//!
//! The compensator reduces the displacement from 1 to 0 over the last `Δp_r` below its set pressure; `σ` is
//! the cubic step of [`crate::math::smooth_step`]. `s` is the position of the swash plate or ring, with the
//! time constant τ of the stroking piston. `n` is the speed per unit of the rated speed. Pulsation is
//! neglected, and so is the smaller intake of an inlet that cavitates.
//!
//! Source: (VP3) as for the pumps and motors in Merritt 1967. (VP1), the line of a data sheet, and (VP2), the
//! first order that is usual for it, are the toolkit's own choice.

use super::flow_source::{WEAR, delivered, full_flow, internal_leakage, speed};
use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::math::smooth_step;
use crate::scalar::Scalar;
use crate::spec::{Category, Start, Unit, declare::*};
use crate::wiring::{Output, Wiring};

parameters! {
    flow_m3_s: full_flow(),
    set_pa: parameter(21e6, (1e5, 1e8), "set pressure, at which the displacement is zero"),
    range_pa: parameter(1e6, (1e3, 1e8), "range below the set pressure, from full to no flow"),
    time_constant_s: parameter(0.04, (1e-4, 10.0), "time constant τ of the compensator"),
    internal_leakage_m3_s_pa: internal_leakage(),
    speed: speed(),
}

/// A pump of variable displacement; see the module documentation.
pub(crate) static VARIABLE_PUMP: Component = Component {
    kind: "variable_pump",
    summary: "pump of variable displacement with pressure compensator",
    parameters: &PARAMETERS,
    faults: &[
        WEAR,
        fault("flow_loss", Category::Jamming, "the swash plate does not reach its full angle")
            .scales("flow_m3_s", 0.3, (0.0, 1.0)),
        fault("set_pressure_loss", Category::Wear, "the compensator's spring has lost force")
            .scales("set_pa", 0.5, (0.05, 1.0)),
        fault(
            "slow_compensator",
            Category::Dynamics,
            "dirt in its orifice slows the stroking piston",
        )
        .scales("time_constant_s", 20.0, (1.0, 100.0)),
    ],
    ports: &[
        hydraulic("inlet", "from the tank"),
        hydraulic("outlet", "to the system"),
        input_or("speed", Unit::None, "speed", "speed per unit of the rated speed"),
        output("displacement", Unit::None, "position s: 1 full displacement, 0 none"),
    ],
    states: &[state("displacement", 1.0, "position s of the swash plate").from(Start::Value(0.5))],
    connect,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let displacement = wiring.state("displacement");
    wiring.set("displacement", displacement);
    let pressures = [wiring.pressure("inlet"), wiring.pressure("outlet")];
    let inputs = [displacement, pressures[0], pressures[1]];
    let rate = wiring.rate("displacement");
    wiring.equation(Compensator, inputs, [rate]);
    let inputs = [wiring.signal("speed"), displacement, pressures[0], pressures[1]];
    let flow = Output::transfer(wiring.flow("inlet"), wiring.flow("outlet"));
    wiring.equation(StrokedFlow, inputs, [flow]);
}

/// Equations (VP1) and (VP2): (displacement, p_in, p_out) → rate of the displacement.
pub(crate) struct Compensator;

impl Equation<3, 1, 3> for Compensator {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 3] {
        let one = S::constant(1.0);
        [given[index::set_pa], one / given[index::range_pa], one / given[index::time_constant_s]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 3], [displacement, inlet, outlet]: [S; 3]) -> [S; 1] {
        let wanted = smooth_step((inlet - outlet + c[0]) * c[1]);
        [(wanted - displacement) * c[2]]
    }
}

/// Equation (VP3): (speed, displacement, p_in, p_out) → flow.
pub(crate) struct StrokedFlow;

impl Equation<4, 1, 2> for StrokedFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [given[index::flow_m3_s], given[index::internal_leakage_m3_s_pa]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], inputs: [S; 4]) -> [S; 1] {
        let [speed, displacement, inlet, outlet] = inputs;
        [delivered(c, [speed * displacement, inlet, outlet])]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    #[test]
    fn the_compensator_takes_the_flow_back_over_its_range() {
        let changes = [("flow_m3_s", 5e-4), ("set_pa", 21e6), ("range_pa", 1e6)];
        let c = constants(Compensator, &VARIABLE_PUMP, &changes, 0);
        let at_rest =
            |bar: f64, s: f64| Compensator::evaluate(&c, [s, 0.0, bar * 1e5])[0].abs() < 1e-12;
        assert!(at_rest(150.0, 1.0) && at_rest(200.0, 1.0));
        assert!(at_rest(205.0, 0.5) && at_rest(210.0, 0.0) && at_rest(300.0, 0.0));
    }
}
