//! A pump of constant displacement.
//!
//! ```text
//! q = n Q − C_li (p_out − p_in)                        inlet → outlet      (FS1)
//! ```
//!
//! `n` is the speed per unit of the rated speed. `C_li` is the internal leakage, which is laminar, as in
//! gaps. The pump pushes against any pressure, so it needs a relief valve and a volume at its outlet.
//! Pulsation is neglected, and so is the smaller intake of an inlet that cavitates.
//!
//! Source: ideal flow minus a laminar leakage, as for the pumps and motors in Merritt 1967.

use crate::component::Component;
use crate::equation::{Equation, Given};
use crate::scalar::Scalar;
use crate::spec::{Category, Fault, Parameter, Unit, declare::*};
use crate::wiring::{Output, Wiring};

/// The parameter for the full flow, which every pump has.
pub(crate) const fn full_flow(name: &'static str) -> Parameter {
    let summary = "full flow Q at rated speed";
    required(name, (0.0, 1.0), summary)
}

/// The parameter for the internal leakage, which every pump has.
pub(crate) const fn internal_leakage(name: &'static str) -> Parameter {
    let summary = "laminar conductance C_li from outlet to inlet";
    parameter(name, 5e-13, (0.0, 1e-8), summary)
}

/// The parameter for the speed, which every pump has.
pub(crate) const fn speed(name: &'static str) -> Parameter {
    parameter(name, 1.0, (0.0, 2.0), "speed n per unit of the rated speed")
}

/// The fault of worn gaps, which every pump has.
pub(crate) const WEAR: Fault =
    fault("wear", Category::InternalLeakage, "worn gaps: leakage rises by 6 L/min at 100 bar")
        .adds("internal_leakage_m3_s_pa", 1e-11, (1e-14, 1e-7));

parameters! {
    flow_m3_s: full_flow(),
    internal_leakage_m3_s_pa: internal_leakage(),
    speed: speed(),
}

/// A pump of constant displacement; see the module documentation.
pub(crate) static FLOW_SOURCE: Component =
    Component {
        kind: "flow_source",
        summary: "pump of constant displacement",
        parameters: &PARAMETERS,
        faults: &[
            WEAR,
            fault("flow_loss", Category::Wear, "lost displacement: a broken vane or piston")
                .scales("flow_m3_s", 0.3, (0.0, 1.0)),
        ],
        ports: &[
            hydraulic("inlet", "from the tank"),
            hydraulic("outlet", "to the system"),
            input_or("speed", Unit::None, "speed", "speed per unit of the rated speed"),
        ],
        connect,
        ..Component::PLAIN
    };

fn connect(wiring: &mut Wiring) {
    let speed = wiring.signal("speed");
    let inputs = [speed, wiring.pressure("inlet"), wiring.pressure("outlet")];
    let flow = Output::transfer(wiring.flow("inlet"), wiring.flow("outlet"));
    wiring.equation(PumpFlow, inputs, [flow]);
}

/// Equation (FS1) with the constants `[Q, C_li]`; `speed` is the speed times the relative displacement.
#[inline(always)]
pub(crate) fn delivered<S: Scalar>(c: &[S::Base; 2], [speed, inlet, outlet]: [S; 3]) -> S {
    speed * c[0] - (outlet - inlet) * c[1]
}

/// Equation (FS1): (speed, p_in, p_out) → flow.
pub(crate) struct PumpFlow;

impl Equation<3, 1, 2> for PumpFlow {
    fn constants<S: Scalar<Base = S>>(given: &Given<S>) -> [S; 2] {
        [given[index::flow_m3_s], given[index::internal_leakage_m3_s_pa]]
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(c: &[S::Base; 2], inputs: [S; 3]) -> [S; 1] {
        [delivered(c, inputs)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::contract::constants;
    use super::*;

    #[test]
    fn it_gives_its_flow_less_what_leaks() {
        let changes = [("flow_m3_s", 5e-4), ("internal_leakage_m3_s_pa", 1e-12)];
        let c = constants(PumpFlow, &FLOW_SOURCE, &changes, 0);
        let [flow] = PumpFlow::evaluate(&c, [1.0, 1e5, 101e5]);
        assert!((flow - 4.9e-4).abs() < 1e-15, "{flow}");
        assert_eq!(PumpFlow::evaluate(&c, [0.0, 1e5, 1e5]), [0.0]);
    }
}
