//! Small networks: flow signs, and every mistake with its position.

use super::*;
use crate::components::{contract, find};
use crate::program::Program;

/// Builds a network from the names of its components and ports.
#[derive(Default)]
struct Draft(Network);

impl Draft {
    fn with(mut self, id: &str, kind: &str) -> Self {
        let component = find(kind).unwrap_or_else(|| panic!("no component '{kind}'"));
        let mut instance = Instance::new(id, component);
        instance.parameters = contract::parameters(component);
        self.0.components.push(instance);
        self
    }

    /// Sets a parameter of the last component.
    fn set(mut self, parameter: &str, value: f64) -> Self {
        let last = self.0.components.pop().expect("a component");
        self.0.components.push(last.with(parameter, value));
        self
    }

    /// Finds a port by `component.port`.
    fn port(&self, id: &str) -> PortOf {
        let (id, port) = id.rsplit_once('.').expect("component.port");
        let component = self.0.components.iter().position(|c| c.id == id).expect("a component");
        let spec = self.0.components[component].component;
        PortOf { component, port: spec.port(port).expect("a port") }
    }

    fn join(mut self, ports: &[&str]) -> Self {
        let ports = ports.iter().map(|p| self.port(p)).collect();
        self.0.connections.push(ports);
        self
    }

    fn input(mut self, id: &str, unit: Unit, target: &str) -> Self {
        let targets = vec![self.port(target)];
        self.0.inputs.push(ExternalInput { id: id.into(), unit, default: 0.0, targets });
        self
    }

    fn mistakes(&self) -> Vec<Mistake> {
        self.0.compile().err().expect("mistakes")
    }
}

/// A compiled network with its memory.
struct Running {
    program: Program,
    constants: Vec<f64>,
    variables: Vec<f64>,
}

impl Running {
    /// Evaluates the equations at the initial guess of the states.
    fn new(draft: &Draft) -> Self {
        let program = draft.0.compile().unwrap_or_else(|m| panic!("{m:?}"));
        let parameters = program.parameters(&[]);
        let constants = program.block_constants(&parameters);
        let mut variables = vec![0.0; program.memory()];
        let guess = program.first_guess(&parameters);
        variables[..guess.len()].copy_from_slice(&guess);
        let stand_ins = program.stand_in_values(&parameters);
        variables[program.externals().end..][..stand_ins.len()].copy_from_slice(&stand_ins);
        program.evaluate(&constants, &mut variables);
        Self { program, constants, variables }
    }

    fn value(&self, name: &str) -> f64 {
        let found = self.program.observable(name);
        self.variables[found.unwrap_or_else(|| panic!("{name}")).slot as usize]
    }

    /// One step of Euler's method.
    fn advance(&mut self, step_s: f64) {
        for (state, rate) in self.program.derivatives().enumerate() {
            self.variables[state] += step_s * self.variables[rate];
        }
        self.program.evaluate(&self.constants, &mut self.variables);
    }
}

const FILLING: &str = "volume.port.flow_m3_s";

/// Supply at 200 bar, a component between `a` and `b`, a volume at `start` bar.
fn between(kind: &str, start_bar: f64) -> Draft {
    Draft::default()
        .with("supply", "pressure_source")
        .set("pressure_pa", 200e5)
        .with("part", kind)
        .with("volume", "volume")
        .set("start_pa", start_bar * 1e5)
        .join(&["supply.port", "part.a"])
        .join(&["part.b", "volume.port"])
}

#[test]
fn an_input_has_the_range_of_the_parameters_that_it_replaces() {
    let declared = |kind: &str, parameter: &str| {
        let spec = find(kind).unwrap();
        let parameter = &spec.parameters[spec.parameter(parameter).unwrap()];
        (parameter.min, parameter.max)
    };
    let draft = Draft::default()
        .with("supply", "pressure_source")
        .with("air", "aerodynamic_load")
        .input("pressure", Unit::Pascal, "supply.pressure")
        .input("altitude", Unit::Metre, "air.altitude");
    assert_eq!(draft.0.input_range(0), declared("pressure_source", "pressure_pa"));
    assert_eq!(draft.0.input_range(1), declared("aerodynamic_load", "altitude_m"));
}

#[test]
fn fluid_flows_from_high_to_low_pressure() {
    for kind in ["orifice", "filter", "shut_off_valve", "flow_sensor"] {
        let high_to_low = Running::new(&between(kind, 100.0));
        let filling = high_to_low.value(FILLING);
        assert!(filling > 0.0, "{kind}: {filling}");
        assert_eq!(filling, -high_to_low.value("supply.port.flow_m3_s"), "{kind} keeps the volume");
        let emptying = Running::new(&between(kind, 300.0)).value(FILLING);
        assert_eq!(emptying, -filling, "{kind} is odd in the pressure drop");
    }
}

#[test]
fn a_flow_meter_reads_both_directions_up_to_its_full_scale() {
    let after_a_while = |drop_pa: f64| {
        let mut running = Running::new(
            &Draft::default()
                .with("supply", "pressure_source")
                .set("pressure_pa", 200e5)
                .with("meter", "flow_sensor")
                .with("other", "pressure_source")
                .set("pressure_pa", 200e5 - drop_pa)
                .join(&["supply.port", "meter.a"])
                .join(&["meter.b", "other.port"]),
        );
        assert_eq!(running.value("meter.reading"), 0.0, "the rotor stands at the beginning");
        (0..1000).for_each(|_| running.advance(1e-4));
        (running.value("other.port.flow_m3_s"), running.value("meter.reading"))
    };
    for drop_pa in [5e3, -5e3, 5e4] {
        let (flow, reading) = after_a_while(drop_pa);
        // Δp = R q + K q|q| with the parameters' defaults.
        let drop = 1e7 * flow + 4e11 * flow * flow.abs();
        assert!((drop / drop_pa - 1.0).abs() < 1e-9, "{flow} at {drop_pa}");
        assert!((reading / flow - 1.0).abs() < 1e-6, "{reading} instead of {flow}");
    }
    let (flow, reading) = after_a_while(2e5);
    assert!(flow > 6e-4 && (reading - 5e-4).abs() < 1e-12, "{reading} at {flow}");
}

#[test]
fn check_and_relief_valves_pass_one_way() {
    let flow = |draft: &Draft| Running::new(draft).value(FILLING);
    assert!(flow(&between("check_valve", 199.0)) > 0.0);
    assert_eq!(flow(&between("check_valve", 201.0)), 0.0);
    assert_eq!(flow(&between("check_valve", 199.9)), 0.0, "below the cracking pressure");
    let mut relief = between("relief_valve", 10.0);
    assert_eq!(flow(&relief), 0.0, "below the set pressure");
    let part = &mut relief.0.components[1];
    *part = part.clone().with("set_pa", 100e5);
    assert!(flow(&relief) > 0.0);
}

#[test]
fn a_leak_only_takes() {
    let filling = |start_pa, area| {
        let draft = Draft::default()
            .with("tank", "tank")
            .with("path", "orifice")
            .set("area_m2", 0.0)
            .with("volume", "volume")
            .set("start_pa", start_pa)
            .with("leak", "external_leakage")
            .set("area_m2", area)
            .join(&["tank.port", "path.a"])
            .join(&["path.b", "volume.port", "leak.port"]);
        Running::new(&draft).value(FILLING)
    };
    // 1.1 L/min at 100 bar through the largest rod seal leak.
    assert!((filling(100e5, 2e-7) * 6e4 + 1.1).abs() < 0.02);
    assert_eq!(filling(100e5, 0.0), 0.0);
    assert_eq!(filling(0.5e5, 2e-7), 0.0);
}

#[test]
fn a_moving_spool_pushes_the_rod_out() {
    let draft = Draft::default()
        .with("supply", "pressure_source")
        .with("tank", "tank")
        .with("valve", "servo_valve")
        .with("cylinder", "cylinder")
        .join(&["supply.port", "valve.p"])
        .join(&["tank.port", "valve.t"])
        .join(&["valve.a", "cylinder.a"])
        .join(&["valve.b", "cylinder.b"])
        .input("current", Unit::None, "valve.current");
    let mut running = Running::new(&draft);
    let current = running.program.externals().start;
    running.variables[current] = 1.0;
    for _ in 0..8_000 {
        running.advance(5e-6);
    }
    // 97.5 mm/s without friction, clearance and pilot flow.
    let velocity = running.value("cylinder.velocity_m_s");
    assert!((0.093..0.099).contains(&velocity), "{velocity}");
}

#[test]
fn an_open_port_is_named() {
    let draft = Draft::default()
        .with("tank", "tank")
        .with("volume", "volume")
        .with("path", "orifice")
        .join(&["tank.port", "path.a"]);
    let mistakes = draft.mistakes();
    for port in ["path.b", "volume.port"] {
        assert!(mistakes.contains(&Mistake::OpenPort(draft.port(port))), "{port}: {mistakes:?}");
    }
}

#[test]
fn two_sources_are_named() {
    let draft = Draft::default()
        .with("supply", "pressure_source")
        .with("volume", "volume")
        .join(&["supply.port", "volume.port"]);
    let (first, second) = (draft.port("supply.port"), draft.port("volume.port"));
    assert_eq!(draft.mistakes(), [Mistake::TwoSources { first, second }]);
}

#[test]
fn a_node_without_a_source_is_named() {
    let draft = Draft::default()
        .with("tank", "tank")
        .with("one", "orifice")
        .with("two", "orifice")
        .with("volume", "volume")
        .join(&["tank.port", "one.a"])
        .join(&["one.b", "two.a"])
        .join(&["two.b", "volume.port"]);
    assert_eq!(draft.mistakes(), [Mistake::NoSource(draft.port("one.b"))]);
}

#[test]
fn a_circuit_without_reference_is_named() {
    let draft = Draft::default()
        .with("left", "volume")
        .with("path", "orifice")
        .with("right", "volume")
        .join(&["left.port", "path.a"])
        .join(&["path.b", "right.port"]);
    assert_eq!(draft.mistakes(), [Mistake::NoReference { component: 0 }]);
}

#[test]
fn sources_of_one_circuit_agree_about_the_fluid() {
    let draft = between("orifice", 1.0)
        .with("tank", "tank")
        .set("temperature_k", 350.0)
        .with("return", "orifice")
        .join(&["volume.port", "return.a"])
        .join(&["return.b", "tank.port"]);
    assert_eq!(draft.mistakes(), [Mistake::TwoFluids { first: 0, second: 3 }]);
}

#[test]
fn mixed_kinds_and_units_are_named() {
    let draft = between("shut_off_valve", 1.0)
        .with("cylinder", "cylinder")
        .join(&["cylinder.position", "part.opening"])
        .join(&["volume.port", "cylinder.rod"]);
    let mistakes = draft.mistakes();
    let mixed = Mistake::MixedKinds {
        connection: 3,
        first: draft.port("volume.port"),
        second: draft.port("cylinder.rod"),
    };
    let units = Mistake::MixedUnits {
        from: Some(draft.port("cylinder.position")),
        to: draft.port("part.opening"),
    };
    assert!(mistakes.contains(&mixed) && mistakes.contains(&units), "{mistakes:?}");
}

#[test]
fn an_input_in_the_wrong_unit_is_named() {
    let draft = between("shut_off_valve", 1.0).input("opening", Unit::Metre, "part.opening");
    let to = draft.port("part.opening");
    assert_eq!(draft.mistakes(), [Mistake::MixedUnits { from: None, to }]);
}

#[test]
fn an_input_that_targets_no_signal_is_named() {
    let draft = between("orifice", 1.0).input("opening", Unit::Metre, "part.a");
    let to = draft.port("part.a");
    assert_eq!(draft.mistakes(), [Mistake::MixedUnits { from: None, to }]);
}

#[test]
fn an_algebraic_loop_is_named() {
    let draft = between("orifice", 1.0)
        .with("one", "gain")
        .with("two", "gain")
        .join(&["one.output", "two.input"])
        .join(&["two.output", "one.input"]);
    assert_eq!(draft.mistakes(), [Mistake::AlgebraicLoop { components: vec![3, 4] }]);
}

#[test]
fn impossible_parameters_are_named() {
    let draft = Draft::default()
        .with("tank", "tank")
        .with("path", "orifice")
        .with("cylinder", "cylinder")
        .set("stroke_half_m", 0.1)
        .join(&["tank.port", "path.a"])
        .join(&["path.b", "cylinder.a"]);
    let mistakes = draft.mistakes();
    let impossible = |m: &Mistake| matches!(m, Mistake::Impossible { component: 2, .. });
    assert!(mistakes.iter().any(impossible), "{mistakes:?}");
}

#[test]
fn a_system_without_states_is_named() {
    let draft = Draft::default()
        .with("supply", "pressure_source")
        .with("path", "orifice")
        .with("tank", "tank")
        .join(&["supply.port", "path.a"])
        .join(&["path.b", "tank.port"]);
    assert_eq!(draft.mistakes(), [Mistake::Empty]);
}
