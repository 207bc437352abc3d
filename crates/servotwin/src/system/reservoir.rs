//! The reservoir of a hydraulic system: what a leak empties.
//!
//! ```text
//! dV/dt = q_return − q_supply                                            (R1)
//! p     = p_return + (p_supply − p_return) min(V / V_low, 1)             (R2)
//! ```
//!
//! `V` is the fluid left, `q_supply` the flow that leaves the source and `q_return` the flow that comes back into the
//! tank. What does not come back has leaked. Below `V_low` the pump draws air and its pressure falls with the level.
//!
//! The pressures of source and tank are inputs of a system, so a reservoir is no component: it belongs to whoever
//! feeds these inputs sample by sample, as a flight in closed loop does.
//!
//! Source: (R1) is the balance of fluid. (R2) is our judgement: a real pump loses its pressure within seconds of
//! drawing air.

use super::System;
use servotwin_model::program::{Program, Slot};

/// The share of the volume below which the pump draws air.
const LOW: f64 = 0.05;

/// A reservoir as declared.
#[derive(Clone, Debug, PartialEq)]
pub struct Reservoir {
    /// The id, unique among reservoirs.
    pub id: String,
    /// The fluid that can leak before the pump has none, m³.
    pub(crate) volume_m3: f64,
    /// The component that delivers its fluid, a pressure source.
    pub(crate) supply: usize,
    /// The input that gives the pressure of this source.
    pub(crate) input: usize,
    /// The component that takes the fluid back, a tank.
    pub(crate) tank: usize,
}

/// The fluid in a reservoir during a run.
#[derive(Clone, Debug)]
pub struct Level {
    volume_m3: f64,
    fluid_m3: f64,
    input: usize,
    /// Flows into the source and into the tank, m³/s.
    flows: [Slot; 2],
    /// The return pressure, Pa.
    return_pressure: Slot,
    return_pa: f64,
}

impl Level {
    /// A full reservoir of a system.
    pub fn full(system: &System, reservoir: &Reservoir) -> Self {
        let program = &system.program;
        let [supply, tank] = [reservoir.supply, reservoir.tank];
        Level {
            volume_m3: reservoir.volume_m3,
            fluid_m3: reservoir.volume_m3,
            input: reservoir.input,
            flows: [supply, tank].map(|component| slot(program, component, "port.flow_m3_s")),
            return_pressure: slot(program, tank, "port.pressure_pa"),
            return_pa: 0.0,
        }
    }

    /// The fluid left, m³.
    pub fn fluid_m3(&self) -> f64 {
        self.fluid_m3
    }

    /// Lowers the supply pressure among the inputs as far as the pump draws air, equation (R2).
    pub fn limit(&self, inputs: &mut [f64]) {
        let share = pressure_share(self.fluid_m3, self.volume_m3);
        let given_pa = inputs[self.input];
        if share < 1.0 && given_pa > self.return_pa {
            inputs[self.input] = self.return_pa + (given_pa - self.return_pa) * share;
        }
    }

    /// Takes what flowed out and did not come back during a period, equation (R1). `value` reads a variable of the
    /// run at the end of the period.
    pub fn take(&mut self, period_s: f64, value: impl Fn(Slot) -> f64) {
        let gained_m3_s: f64 = self.flows.iter().map(|&flow| value(flow)).sum();
        self.fluid_m3 = (self.fluid_m3 + gained_m3_s * period_s).max(0.0);
        self.return_pa = value(self.return_pressure);
    }
}

/// The share of its pressure that a pump delivers from a reservoir with this fluid, equation (R2).
pub(crate) fn pressure_share(fluid_m3: f64, volume_m3: f64) -> f64 {
    (fluid_m3 / (LOW * volume_m3)).min(1.0)
}

/// The slot of an observable of a component that sets a pressure.
fn slot(program: &Program, component: usize, end: &str) -> Slot {
    let name = format!("{}.{end}", program.network().components[component].id);
    program.observable(&name).expect("a component that sets a pressure shows its flow").slot
}
