//! Systems for tests, built by names.

use servotwin_model::components;
use servotwin_model::network::{ExternalInput, Instance, Network, PortOf};
use servotwin_model::program::Program;
use servotwin_model::spec::PortKind;

/// A network under construction.
#[derive(Default)]
pub struct Rig(Network);

impl Rig {
    /// Adds a component with the given parameters.
    pub fn add(mut self, id: &str, kind: &str, parameters: &[(&str, f64)]) -> Self {
        let component = components::find(kind).expect("a kind of the catalogue");
        let instance = Instance::new(id, component);
        let instance = parameters.iter().fold(instance, |i, &(name, value)| i.with(name, value));
        self.0.components.push(instance);
        self
    }

    fn port(&self, path: &str) -> PortOf {
        let (id, name) = path.rsplit_once('.').expect("component.port");
        let component = self.0.components.iter().position(|c| c.id == id).expect(path);
        let spec = self.0.components[component].component;
        PortOf { component, port: spec.port(name).expect(path) }
    }

    /// Joins ports, separated by blanks.
    pub fn join(mut self, ports: &str) -> Self {
        let ports = ports.split_whitespace().map(|p| self.port(p)).collect();
        self.0.connections.push(ports);
        self
    }

    /// Adds an external input that feeds a signal.
    pub fn input(mut self, id: &str, default: f64, target: &str) -> Self {
        let target = self.port(target);
        let spec = self.0.components[target.component].component;
        let PortKind::SignalIn { unit, .. } = spec.ports[target.port].kind else {
            panic!("{id} feeds no signal input");
        };
        self.0.inputs.push(ExternalInput { id: id.into(), unit, default, targets: vec![target] });
        self
    }

    /// The compiled system.
    pub fn compile(&self) -> Program {
        self.0.compile().unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
    }
}

/// A volume between a supply and a tank.
pub fn filling() -> Program {
    Rig::default()
        .add("supply", "pressure_source", &[])
        .add("inlet", "orifice", &[("area_m2", 1e-6)])
        .add("volume", "volume", &[("volume_m3", 1e-4)])
        .add("outlet", "orifice", &[("area_m2", 5e-7)])
        .add("tank", "tank", &[])
        .join("supply.port inlet.a")
        .join("inlet.b volume.port outlet.a")
        .join("outlet.b tank.port")
        .input("supply_pressure", 2e7, "supply.pressure")
        .compile()
}

/// One actuator with its valves, sensors and a sampled controller, on a control
/// surface with aerodynamic load.
pub fn actuator() -> Program {
    Rig::default()
        .add("supply", "pressure_source", &[])
        .add("tank", "tank", &[])
        .add("supply_valve", "shut_off_valve", &[])
        .add("manifold", "volume", &[("volume_m3", 3e-5)])
        .add("servo_valve", "servo_valve", &[])
        .add("mode_valve", "mode_valve", &[])
        .add("cylinder", "cylinder", &[])
        .add("leakage", "external_leakage", &[("area_m2", 1e-8)])
        .add("attachment", "attachment", &[("backlash_m", 1e-4)])
        .add("lever", "lever", &[])
        .add("aileron", "inertia", &[])
        .add("air", "aerodynamic_load", &[])
        .add("sensor_a", "pressure_sensor", &[])
        .add("sensor_b", "pressure_sensor", &[("bias_electrical", 0.01)])
        .add("sensor_temperature", "temperature_sensor", &[])
        .add("sensor_ram", "lvdt", &[("full_scale_m", 22.2e-3)])
        .add("controller", "sampled_position_controller", &[("delay_samples", 1.0)])
        .join("supply.port supply_valve.a")
        .join("supply_valve.b manifold.port servo_valve.p sensor_temperature.port")
        .join("servo_valve.t tank.port mode_valve.reserve")
        .join("servo_valve.a mode_valve.a cylinder.a sensor_a.port leakage.port")
        .join("servo_valve.b mode_valve.b cylinder.b sensor_b.port")
        .join("mode_valve.active supply_valve.opening")
        .join("mode_valve.transmission servo_valve.transmission")
        .join("cylinder.rod attachment.a")
        .join("attachment.b lever.rod")
        .join("lever.shaft aileron.shaft air.shaft")
        .join("cylinder.position sensor_ram.position")
        .join("sensor_ram.reading controller.position")
        .join("sensor_a.reading controller.pressure_a")
        .join("sensor_b.reading controller.pressure_b")
        .join("controller.current servo_valve.current")
        .input("command", 0.1, "controller.command")
        .input("mode", 1.0, "mode_valve.command")
        .input("altitude", 3000.0, "air.altitude")
        .compile()
}
