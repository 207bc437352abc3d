//! The law by which a controller makes one sensor follow others.
//!
//! The law is not written in the study: it follows from the components between the sensors. Beginning with what the
//! sensor measures, the steady gains of the components are multiplied against the direction of the signals, until the
//! readings of other sensors are reached.

use crate::system::System;
use servotwin_model::component::SteadyGain;
use servotwin_model::network::PortOf;
use servotwin_model::spec::PortKind;

/// The most components between two sensors. Signals that run in a circle never reach a sensor.
const MAX_DEPTH: usize = 16;

/// The sensors that a sensor follows, as indices into `measured`, and the change of its value for a change of theirs, SI
/// over SI. `measured` has the indices of the study's sensors in the system's list. Empty if no controller drives it.
pub(super) fn of_controller(
    system: &System,
    measured: &[usize],
    place: usize,
) -> Vec<(usize, f64)> {
    let component = system.sensors[measured[place]].component;
    let mut law = vec![];
    for port in signal_inputs(system, component) {
        follow(system, measured, PortOf { component, port }, (1.0, MAX_DEPTH), &mut law);
    }
    law.retain(|&(other, gain)| other != place && gain != 0.0);
    // Features are named in this order.
    law.sort_by_key(|(other, _)| *other);
    law
}

/// Adds what drives an input, times a gain.
fn follow(
    system: &System,
    measured: &[usize],
    input: PortOf,
    (gain, depth): (f64, usize),
    law: &mut Vec<(usize, f64)>,
) {
    let Some(source) = source(system, input).filter(|_| depth > 0) else { return };
    let is_source = |&sensor: &usize| system.sensors[sensor].component == source.component;
    if let Some(sensor) = measured.iter().position(is_source) {
        match law.iter_mut().find(|(known, _)| *known == sensor) {
            Some((_, sum)) => *sum += gain,
            None => law.push((sensor, gain)),
        }
        return;
    }
    let instance = &system.network().components[source.component];
    let spec = instance.component;
    for SteadyGain { from, to, gain: own } in
        (instance.component.steady_gains)(&instance.parameters)
    {
        let is_output = spec.port(to) == Some(source.port);
        if let Some(port) = spec.port(from).filter(|_| is_output) {
            let input = PortOf { component: source.component, port };
            follow(system, measured, input, (gain * own, depth - 1), law);
        }
    }
}

/// The signal output that is connected to an input.
fn source(system: &System, input: PortOf) -> Option<PortOf> {
    let network = system.network();
    let is_output = |port: &&PortOf| {
        let spec = network.components[port.component].component;
        matches!(spec.ports[port.port].kind, PortKind::SignalOut { .. })
    };
    let joined = network.connections.iter().filter(|ports| ports.contains(&input));
    joined.flatten().find(is_output).copied()
}

/// The signal inputs of a component.
fn signal_inputs(system: &System, component: usize) -> impl Iterator<Item = usize> {
    let ports = system.network().components[component].component.ports;
    (0..ports.len()).filter(|&port| matches!(ports[port].kind, PortKind::SignalIn { .. }))
}

#[cfg(test)]
mod tests {
    use crate::study::Study;

    /// 272 of the rated current per metre of ram and 0.45 per 20.684 MPa move a spool with a stroke of 1 mm.
    #[test]
    fn the_spool_follows_ram_and_pressures_by_the_law_of_the_controller() {
        let study = Study::default();
        let place = |id: &str| {
            let is_it = |&sensor: &usize| study.system.sensors[sensor].id == id;
            study.measured.iter().position(is_it).expect("a sensor of the study")
        };
        for actuator in 1..=2 {
            let of = |name: &str| place(&format!("{name}_{actuator}"));
            let law = super::of_controller(&study.system, &study.measured, of("x_v"));
            let per_pa = 0.45 / 20.684e6 * 1e-3;
            let mut wanted = vec![(of("x_p"), -0.272), (of("p_a"), -per_pa), (of("p_b"), per_pa)];
            wanted.sort_by_key(|(sensor, _)| *sensor);
            assert_eq!(law.len(), 3);
            for ((sensor, gain), (expected, value)) in law.iter().zip(&wanted) {
                assert_eq!(sensor, expected);
                assert!((gain / value - 1.0).abs() < 1e-12, "{gain} instead of {value}");
            }
            assert!(super::of_controller(&study.system, &study.measured, of("p_s")).is_empty());
        }
    }
}
