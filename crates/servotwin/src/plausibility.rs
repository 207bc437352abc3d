//! What a valid system says that is hardly meant: pumps that nothing relieves or that a relief valve robs of their flow,
//! pressure sensors without head room, and a steady state at the default inputs that is unstable, out of range or missing.

use crate::rest::{self, Rest};
use crate::shown::shown;
use crate::system::System;
use crate::validity::MAX_PRESSURE_PA;
use servotwin_model::component::Component;
use servotwin_model::network::{Instance, Network, PortOf};
use servotwin_model::spec::{PortKind, Unit};

/// Growth of an unstable motion that counts, 1/s; an integrator's eigenvalue is zero up to rounding.
const GROWTH_PER_S: f64 = 1e-3;

/// Warnings about a system, one sentence each. Searches for the steady state at the default inputs.
pub fn warnings(system: &System) -> Vec<String> {
    let network = system.network();
    let mut all: Vec<String> = (0..network.components.len())
        .flat_map(|component| {
            let relief = relief_of_pump(network, component);
            relief.into_iter().chain(sensors_without_head_room(network, component))
        })
        .collect();
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
        let is_piston = instance.component.states[state.state].name == "position_m";
        let stroke = parameter(instance, "stroke_half_m");
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

/// The value of a component's parameter.
fn parameter(instance: &Instance, name: &str) -> Option<f64> {
    Some(instance.parameters[instance.component.parameter(name)?])
}

fn is_tank(network: &Network, at: &PortOf) -> bool {
    network.components[at.component].component.kind == "tank"
}

/// What is wrong with a pump and its relief valves: one is reversed, one opens below the pressure that a compensated pump
/// holds, or a pump of constant displacement would reach a pressure beyond the model if its flow had no way out.
fn relief_of_pump(network: &Network, component: usize) -> Vec<String> {
    let instance = &network.components[component];
    let (spec, id) = (instance.component, &instance.id);
    let Some(port) = spec.port("outlet") else { return vec![] };
    let from = PortOf { component, port };
    if let Some(tank) =
        reached(network, from, |_, _, _| false).iter().find(|at| is_tank(network, at))
    {
        let tank = &network.components[tank.component].id;
        return vec![format!(
            "the pump '{id}' is reversed: its outlet is at the tank '{tank}'; exchange '{id}.inlet' and '{id}.outlet'"
        )];
    }
    let reached = reached(network, from, passes);
    let at = |kind: &str, port: &str| -> Vec<&Instance> {
        let own = reached.iter().map(|at| (&network.components[at.component], at.port));
        let own = own.filter(|(found, own)| {
            let spec = found.component;
            spec.kind == kind && spec.ports[*own].name == port
        });
        own.map(|(found, _)| found).collect()
    };
    let reliefs = at("relief_valve", "a");
    let set_pa = |relief: &Instance| parameter(relief, "set_pa").unwrap_or(f64::INFINITY);
    let mut all = vec![];
    if reliefs.is_empty() {
        all.extend(at("relief_valve", "b").into_iter().map(|relief| {
            let relief = &relief.id;
            format!(
                "the relief valve '{relief}' is reversed: its port b is at the outlet of the pump '{id}', and it opens \
                 from a to b; exchange '{relief}.a' and '{relief}.b'"
            )
        }));
    }
    let is_fixed = spec.kind == "flow_source";
    if let (false, Some(held_pa)) = (is_fixed, parameter(instance, "set_pa")) {
        let early = reliefs.iter().filter(|relief| set_pa(relief) < held_pa);
        all.extend(early.map(|relief| {
            let [set, held] = [set_pa(relief), held_pa].map(|pa| shown(pa, Unit::Pascal));
            let relief = &relief.id;
            format!(
                "the relief valve '{relief}' opens at {set} ({relief}.set_pa), below the {held} at which the compensator \
                 of the pump '{id}' ends its flow ({id}.set_pa): the pump never stops delivering"
            )
        }));
    }
    let is_relieved = ["pressure_source", "tank"].iter().any(|kind| !at(kind, "port").is_empty())
        || reliefs.iter().any(|relief| set_pa(relief) < MAX_PRESSURE_PA);
    let highest_pa = || {
        let flow = parameter(instance, "flow_m3_s")? * parameter(instance, "speed")?;
        Some(flow / parameter(instance, "internal_leakage_m3_s_pa")?)
    };
    if is_fixed
        && !is_relieved
        && let Some(highest_pa) = highest_pa().filter(|pa| *pa > MAX_PRESSURE_PA)
    {
        let limit = match highest_pa.is_finite() {
            true => format!("up to {}, at which all of it leaks", shown(highest_pa, Unit::Pascal)),
            false => "without limit".into(),
        };
        all.push(format!(
            "the outlet of the pump '{id}' has no relief valve: if its flow has no other way, the pressure rises {limit}"
        ));
    }
    all
}

/// Pressure sensors whose range ends at the pressure of a supply that reaches them, or below it.
fn sensors_without_head_room(network: &Network, component: usize) -> Vec<String> {
    let instance = &network.components[component];
    let spec = instance.component;
    let (port, parameter_name) = match spec.kind {
        "pressure_source" => ("port", "pressure_pa"),
        "variable_pump" => ("outlet", "set_pa"),
        _ => return vec![],
    };
    let (Some(port), Some(mut supply_pa)) = (spec.port(port), parameter(instance, parameter_name))
    else {
        return vec![];
    };
    // An input replaces the parameter of a source.
    if let Some(measured) = spec.port("pressure").map(|port| PortOf { component, port }) {
        match network.inputs.iter().find(|input| input.targets.contains(&measured)) {
            Some(input) => supply_pa = input.default,
            None if network.connections.iter().any(|ports| ports.contains(&measured)) => {
                return vec![];
            }
            None => {}
        }
    }
    let is_at_tank = |at: &&PortOf| {
        let joined = network.connections.iter().filter(|ports| ports.contains(at));
        joined.flatten().any(|at| is_tank(network, at))
    };
    let from = PortOf { component, port };
    let reached = reached(network, from, |spec, entered, left| {
        let is_spool = spec.port("p").is_some() && entered == "p" && ["a", "b"].contains(&left);
        passes(spec, entered, left) || is_spool || spec.kind == "shut_off_valve"
    });
    let sensors = reached.iter().filter(|at| !is_at_tank(at));
    let sensors = sensors.map(|at| &network.components[at.component]);
    let short = sensors.filter_map(|sensor| {
        let range_pa = parameter(sensor, "full_scale_pa").filter(|range_pa| *range_pa <= supply_pa)?;
        let [range, supply] = [range_pa, supply_pa].map(|pa| shown(pa, Unit::Pascal));
        let (sensor, id) = (&sensor.id, &instance.id);
        Some(format!(
            "the range of '{sensor}' ends at {range} ({sensor}.full_scale_pa) and has no head room: the supply '{id}' has \
             {supply}, and above its range a sensor shows a constant"
        ))
    });
    short.collect()
}

/// Whether a flow into a port of a component always finds a way out of another one.
fn passes(spec: &Component, entered: &str, _left: &str) -> bool {
    match spec.kind {
        "orifice" | "filter" | "long_line" | "flow_sensor" => true,
        "check_valve" => entered == "a",
        _ => false,
    }
}

/// The ports that a flow reaches from a port, through the components that let it pass from one port to another.
fn reached(
    network: &Network,
    from: PortOf,
    passes: impl Fn(&Component, &str, &str) -> bool,
) -> Vec<PortOf> {
    let mut reached = vec![from];
    let mut next = 0;
    while let Some(&at) = reached.get(next) {
        next += 1;
        let spec = network.components[at.component].component;
        let name = |port: usize| spec.ports[port].name;
        let is_hydraulic =
            |port: &usize| matches!(spec.ports[*port].kind, PortKind::Hydraulic { .. });
        let behind = (0..spec.ports.len()).filter(is_hydraulic);
        let behind = behind.filter(|port| passes(spec, name(at.port), name(*port)));
        let behind = behind.map(|port| PortOf { component: at.component, port });
        let joined = network.connections.iter().filter(|joined| joined.contains(&at)).flatten();
        for port in behind.chain(joined.copied()) {
            if !reached.contains(&port) {
                reached.push(port);
            }
        }
    }
    reached
}
