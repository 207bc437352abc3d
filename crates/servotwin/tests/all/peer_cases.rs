//! What the peers of `peers/` integrate: shared by the tests that compare and
//! the example that writes the peers' input.

/// How long, and how often states are compared.
pub const DURATION_S: f64 = 10.0;
/// Time between compared states, s.
pub const PERIOD_S: f64 = 0.1;
/// The command of every case, when the golden files were last written.
#[allow(dead_code)] // The tests read the command from the golden file.
pub const COMMAND: &str = "noise:rms=5deg,bandwidth=1Hz,seed=3";
/// Name, fault and intensity.
pub const CASES: [(&str, Option<(&str, f64)>); 11] = [
    ("healthy", None),
    ("leakage_a", Some(("actuator_1.leakage_a.leakage", 1.0))),
    ("clogging_pa", Some(("actuator_1.servo_valve.clogging_pa", 0.6))),
    ("slow_valve", Some(("actuator_1.servo_valve.natural_frequency_loss", 0.8))),
    ("ringing_valve", Some(("actuator_2.servo_valve.damping_loss", 0.7))),
    ("supply_valve", Some(("actuator_1.supply_valve.stuck", 0.6))),
    ("tank_valve", Some(("actuator_2.tank_valve.stuck", 0.5))),
    ("internal_leakage", Some(("actuator_2.cylinder.internal_leakage", 1.0))),
    ("pressure_bias", Some(("actuator_1.sensor_pressure_a.bias_positive", 1.0))),
    ("ram_bias", Some(("actuator_1.sensor_ram.bias_positive", 0.5))),
    ("backlash", Some(("actuator_1.attachment.backlash", 1.0))),
];
