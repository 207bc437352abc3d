//! What a valid system says that is hardly meant: pumps that nothing relieves, and a steady state at the default inputs
//! that is unstable, out of range or missing.

use crate::rest::{self, Rest};
use crate::shown::shown;
use crate::system::System;
use crate::validity::MAX_PRESSURE_PA;
use servotwin_model::network::{Network, PortOf};
use servotwin_model::spec::{PortKind, Unit};

/// Growth of an unstable motion that counts, 1/s; an integrator's eigenvalue is zero up to rounding.
const GROWTH_PER_S: f64 = 1e-3;

/// Warnings about a system, one sentence each. Searches for the steady state at the default inputs.
pub fn warnings(system: &System) -> Vec<String> {
    let mut all: Vec<String> = unrelieved_pumps(system.network()).collect();
    match rest::of(system) {
        Ok(rest) => all.extend(warnings_at_rest(system, &rest)),
        Err(error) => all.push(format!("at the default inputs {error}")),
    }
    all
}

fn warnings_at_rest(system: &System, rest: &Rest) -> Vec<String> {
    let mut all = Vec::new();
    if !rest.is_found {
        let why = if rest.limit_cycle { ": it oscillates forever" } else { "" };
        all.push(format!("no steady state was found at the default inputs{why}"));
    }
    let fastest = rest.eigenvalues.iter().max_by(|a, b| a.re.total_cmp(&b.re));
    if let Some(growing) = fastest.filter(|value| value.re > GROWTH_PER_S) {
        all.push(format!(
            "the steady state at the default inputs is unstable: a motion grows as e^(t/{}); look for exchanged ports A \
             and B, a wrong sign, or a gain that is too large",
            shown(1.0 / growing.re, Unit::Second)
        ));
    }
    for (state, &value) in system.program.states().iter().zip(&rest.states) {
        let instance = &system.network().components[state.component];
        let spec = instance.component.spec();
        let is_piston = spec.states[state.state].name == "position_m";
        let stroke = spec.parameter("stroke_half_m").map(|index| instance.parameters[index]);
        if state.unit == Unit::Pascal && value > MAX_PRESSURE_PA {
            let (value, most) = (shown(value, Unit::Pascal), shown(MAX_PRESSURE_PA, Unit::Pascal));
            let name = &state.name;
            all.push(format!(
                "{name} is {value} in the steady state at the default inputs, above {most}, where the model ends"
            ));
        } else if is_piston && stroke.is_some_and(|stroke| value.abs() > stroke) {
            let id = &instance.id;
            all.push(format!(
                "the piston of '{id}' is in its end stop in the steady state at the default inputs: look for exchanged \
                 ports A and B, a wrong sign, or a load that is too large"
            ));
        }
    }
    all
}

/// Pumps of constant displacement that would reach a pressure beyond the model if their flow had no way out.
fn unrelieved_pumps(network: &Network) -> impl Iterator<Item = String> + '_ {
    let pumps = network.components.iter().enumerate();
    pumps.filter_map(|(component, instance)| {
        let value = |name: &str| {
            let index = instance.component.spec().parameter(name)?;
            Some(instance.parameters[index])
        };
        let outlet = instance.component.spec().port("outlet")?;
        let is_fixed = instance.component.spec().kind == "flow_source";
        let highest_pa = value("flow_m3_s")? * value("speed")? / value("internal_leakage_m3_s_pa")?;
        let is_unrelieved = is_fixed
            && highest_pa > MAX_PRESSURE_PA
            && !is_relieved(network, PortOf { component, port: outlet });
        let id = &instance.id;
        is_unrelieved.then(|| {
            let limit = match highest_pa.is_finite() {
                true => format!("up to {}, at which all of it leaks", shown(highest_pa, Unit::Pascal)),
                false => "without limit".into(),
            };
            format!(
                "the outlet of the pump '{id}' has no relief valve: if its flow has no other way, the pressure rises {limit}"
            )
        })
    })
}

/// Whether a flow into a port always finds a way to a relief valve or to a component that fixes the pressure.
fn is_relieved(network: &Network, outlet: PortOf) -> bool {
    let mut reached = vec![outlet];
    let mut next = 0;
    while let Some(&at) = reached.get(next) {
        next += 1;
        let instance = &network.components[at.component];
        let spec = instance.component.spec();
        let is_inlet = spec.ports[at.port].name == "a";
        let set_pa = spec.parameter("set_pa").map(|index| instance.parameters[index]);
        let passes = match spec.kind {
            "pressure_source" | "tank" => return true,
            "relief_valve" if is_inlet && set_pa < Some(MAX_PRESSURE_PA) => return true,
            "orifice" | "filter" | "long_line" | "flow_sensor" => true,
            "check_valve" => is_inlet,
            _ => false,
        };
        let is_hydraulic =
            |port: &usize| matches!(spec.ports[*port].kind, PortKind::Hydraulic { .. });
        let behind = (0..spec.ports.len()).filter(|port| passes && is_hydraulic(port));
        let behind = behind.map(|port| PortOf { component: at.component, port });
        let joined = network.connections.iter().filter(|joined| joined.contains(&at)).flatten();
        for port in behind.chain(joined.copied()) {
            if !reached.contains(&port) {
                reached.push(port);
            }
        }
    }
    false
}
