//! The unseen faults, which no training data contain, one line each.

use super::effect::Effect::{
    Drift, Fault, Grows, InputTimes, Missing, Noise, Pulses, Swing, Times, ToldFrozen, ToldLate,
    ToldMissing, ToldOff, ToldTooLarge, Value, Weather,
};
use super::effect::{On, other, own, whole};
use crate::flight::outcome::Needed;
use servotwin_diagnosis::features::Quantity::{PressureA, Ram, Supply};

/// A fault without training data.
pub struct UnseenFault {
    /// The challenge set that it belongs to, as options name it.
    pub set: &'static str,
    /// The display title.
    pub title: &'static str,
    /// The strengths that are flown.
    pub strengths: &'static [f64],
    /// The strengths in words, with their unit.
    pub strengths_in_words: &'static str,
    /// What is right after the onset.
    pub needed: Needed,
    /// The effects at a strength.
    pub effects: fn(f64) -> Vec<On>,
}

const fn fault(
    set: &'static str,
    title: &'static str,
    (strengths, strengths_in_words): (&'static [f64], &'static str),
    needed: Needed,
    effects: fn(f64) -> Vec<On>,
) -> UnseenFault {
    UnseenFault { set, title, strengths, strengths_in_words, needed, effects }
}

use Needed::{Any, NoShutdown, Nothing, Shutdown};

/// A sensor with this bandwidth is practically stuck, Hz.
const STUCK_HZ: f64 = 1e-3;
/// How late the sensor of a boundary value may be, s: a slow transducer and a slow bus.
const LATE_S: f64 = 0.2;
const ONCE: (&[f64], &str) = (&[1.0], "");

const FULL: (&[f64], &str) = (&[1.0], "100 %, 0.25 s on and 0.25 s off");
const GROWN: (&[f64], &str) = (&[1.0], "to 100 % within 8 s");

// The challenge sets. A fault with another name begins another set.
const INTERMITTENT: &str = "intermittent";
const DRIFTING: &str = "drifting";
const OSCILLATORY: &str = "oscillatory";
const DOUBLE: &str = "double";
const ENVIRONMENT_SENSORS: &str = "environment-sensors";
const ENVIRONMENT: &str = "environment";
const SENSORS: &str = "sensors";
const MECHANICS: &str = "mechanics";

/// All unseen faults. Flights are numbered in this order, so new ones stand at the end.
pub static ALL: &[UnseenFault] = &[
    fault(SENSORS, "stuck stroke sensor", ONCE, Any, |_| {
        vec![own(Value("sensor_ram.bandwidth_hz", STUCK_HZ))]
    }),
    fault(SENSORS, "stuck spool sensor", ONCE, NoShutdown, |_| {
        vec![own(Value("sensor_spool.bandwidth_hz", STUCK_HZ))]
    }),
    fault(SENSORS, "stuck chamber pressure sensor", ONCE, NoShutdown, |_| {
        vec![own(Value("sensor_pressure_a.bandwidth_hz", STUCK_HZ))]
    }),
    fault(
        DRIFTING,
        "drifting stroke sensor",
        (&[0.01, 0.03], "1 and 3 % of range per s"),
        NoShutdown,
        |s| vec![own(Drift("sensor_ram.bias_electrical", s))],
    ),
    fault(
        DRIFTING,
        "drifting chamber pressure sensor",
        (&[0.02, 0.05], "2 and 5 % of range per s"),
        NoShutdown,
        |s| vec![own(Drift("sensor_pressure_a.bias_electrical", s))],
    ),
    fault(SENSORS, "no reading of the stroke sensor", ONCE, NoShutdown, |_| {
        vec![own(Missing(Ram))]
    }),
    fault(SENSORS, "no reading of a pressure sensor", ONCE, NoShutdown, |_| {
        vec![own(Missing(PressureA))]
    }),
    fault(
        SENSORS,
        "noise of the stroke sensor",
        (&[3.0, 5.0, 10.0], "3, 5 and 10 times"),
        NoShutdown,
        |s| vec![own(Noise(Ram, s))],
    ),
    fault(
        SENSORS,
        "noise of a pressure sensor",
        (&[3.0, 5.0, 10.0], "3, 5 and 10 times"),
        NoShutdown,
        |s| vec![own(Noise(PressureA, s))],
    ),
    fault(SENSORS, "noise of the supply pressure sensor", (&[5.0], "5 times"), NoShutdown, |s| {
        vec![own(Noise(Supply, s))]
    }),
    fault(MECHANICS, "spool jams where it is", ONCE, Shutdown, |_| {
        vec![own(Value("servo_valve.breakaway", 1.0))]
    }),
    fault(MECHANICS, "spool drags", (&[0.03, 0.1], "slew rate 3 and 10 %"), Shutdown, |s| {
        vec![own(Times("servo_valve.slew_rate_m_s", s))]
    }),
    fault(
        OSCILLATORY,
        "oscillation of the servo current",
        (&[0.05, 0.2], "5 and 20 % of rated current, 1.5 Hz"),
        Shutdown,
        |s| vec![own(Swing("servo_valve.null_bias", s))],
    ),
    fault(
        OSCILLATORY,
        "oscillation of the stroke reading",
        (&[0.03, 0.1], "3 and 10 % of range, 1.5 Hz"),
        NoShutdown,
        |s| vec![own(Swing("sensor_ram.bias_electrical", s))],
    ),
    fault(
        MECHANICS,
        "backlash of the attachment",
        (&[1e-4, 3e-4], "±0.1 and ±0.3 mm"),
        Any,
        |s| vec![own(Value("attachment.backlash_m", s))],
    ),
    fault(
        MECHANICS,
        "stiffness of the attachment",
        (&[0.1, 0.3], "10 and 30 % are left"),
        Any,
        |s| vec![own(Times("attachment.stiffness_n_m", s))],
    ),
    fault(MECHANICS, "seal friction", (&[2.0, 4.0, 8.0], "2, 4 and 8 times"), Any, |s| {
        vec![own(Times("cylinder.coulomb_friction_n", s))]
    }),
    fault(MECHANICS, "guides drag", (&[3.0, 6.0], "3 and 6 times"), Any, |s| {
        vec![own(Times("cylinder.viscous_friction_n_s_m", s))]
    }),
    fault(
        DOUBLE,
        "leak and stroke sensor bias in one actuator",
        (&[0.5, 1.0], "both 50 and 100 %"),
        Any,
        |s| vec![own(Fault("leakage_a.leakage", s)), own(Fault("sensor_ram.bias_positive", s))],
    ),
    fault(
        DOUBLE,
        "two sensors biased in one actuator",
        (&[0.5, 1.0], "both 50 and 100 %"),
        NoShutdown,
        |s| {
            vec![
                own(Fault("sensor_pressure_a.bias_positive", s)),
                own(Fault("sensor_spool.bias_positive", s)),
            ]
        },
    ),
    fault(
        DOUBLE,
        "valve bias, and a sensor of another actuator",
        (&[0.5, 1.0], "both 50 and 100 %"),
        Any,
        |s| {
            vec![
                own(Fault("servo_valve.bias_positive", s)),
                other(Fault("sensor_ram.bias_positive", s)),
            ]
        },
    ),
    fault(
        DOUBLE,
        "a leak in each of two actuators",
        (&[0.5, 1.0], "both 50 and 100 %"),
        Shutdown,
        |s| vec![own(Fault("leakage_supply.leakage", s)), other(Fault("leakage_a.leakage", s))],
    ),
    fault(
        DOUBLE,
        "worn seal, and a supply sensor of another actuator",
        (&[1.0], "both 100 %"),
        Any,
        |s| {
            vec![
                own(Fault("cylinder.internal_leakage", s)),
                other(Fault("sensor_supply.bias_positive", s)),
            ]
        },
    ),
    fault(
        ENVIRONMENT,
        "supply pressure falls, measured",
        (&[0.5, 0.85], "to 50 and 85 %"),
        Any,
        |s| vec![own(InputTimes("supply_pressure", s))],
    ),
    fault(
        ENVIRONMENT,
        "hot day beyond training, measured",
        (&[358.0, 368.0], "85 and 95 °C"),
        Nothing,
        |s| {
            vec![whole(Weather("supply.temperature_k", s)), whole(Weather("tank.temperature_k", s))]
        },
    ),
    fault(ENVIRONMENT_SENSORS, "the command at the twin freezes", ONCE, Nothing, |_| {
        vec![whole(ToldFrozen("command"))]
    }),
    fault(ENVIRONMENT_SENSORS, "the command at the twin is missing", ONCE, Nothing, |_| {
        vec![whole(ToldMissing("command"))]
    }),
    fault(ENVIRONMENT_SENSORS, "the command at the twin is impossible", ONCE, Nothing, |_| {
        vec![whole(ToldTooLarge("command"))]
    }),
    fault(ENVIRONMENT_SENSORS, "the supply pressure at the twin is missing", ONCE, Any, |_| {
        vec![own(ToldMissing("supply_pressure"))]
    }),
    fault(
        ENVIRONMENT_SENSORS,
        "the supply pressure at the twin is wrong, within its range",
        (&[-0.04, 0.04], "−4 and +4 %"),
        NoShutdown,
        |s| vec![own(ToldOff("supply_pressure", s))],
    ),
    fault(
        ENVIRONMENT_SENSORS,
        "the supply pressure falls, and the twin keeps the old value",
        (&[0.9, 0.7], "to 90 and 70 %"),
        Any,
        |s| vec![own(InputTimes("supply_pressure", s)), own(ToldFrozen("supply_pressure"))],
    ),
    fault(
        ENVIRONMENT_SENSORS,
        "the return pressure at the twin is wrong, within its range",
        (&[-0.1, 0.1], "−10 and +10 %"),
        NoShutdown,
        |s| vec![own(ToldOff("return_pressure", s))],
    ),
    fault(
        ENVIRONMENT,
        "the supply pressure changes, measured",
        (&[0.9, 1.03], "to 90 and 103 %"),
        Nothing,
        |s| vec![whole(InputTimes("supply_pressure", s))],
    ),
    fault(
        ENVIRONMENT_SENSORS,
        "the supply pressure changes, and the twin gets it late",
        (&[0.9, 1.03], "to 90 and 103 %, 0.2 s late"),
        Nothing,
        |s| {
            vec![
                whole(InputTimes("supply_pressure", s)),
                whole(ToldLate("supply_pressure", LATE_S)),
            ]
        },
    ),
    fault(
        ENVIRONMENT_SENSORS,
        "the return pressure changes, and the twin gets it late",
        (&[0.8, 1.5], "to 80 and 150 %, 0.2 s late"),
        Nothing,
        |s| {
            vec![
                whole(InputTimes("return_pressure", s)),
                whole(ToldLate("return_pressure", LATE_S)),
            ]
        },
    ),
    fault(INTERMITTENT, "a supply leak comes and goes", FULL, Shutdown, |s| {
        vec![own(Pulses("leakage_supply.leakage", s))]
    }),
    fault(INTERMITTENT, "the valve bias comes and goes", FULL, Shutdown, |s| {
        vec![own(Pulses("servo_valve.bias_positive", s))]
    }),
    fault(INTERMITTENT, "the bias of the stroke sensor comes and goes", FULL, NoShutdown, |s| {
        vec![own(Pulses("sensor_ram.bias_positive", s))]
    }),
    fault(INTERMITTENT, "the bias of a pressure sensor comes and goes", FULL, NoShutdown, |s| {
        vec![own(Pulses("sensor_pressure_a.bias_positive", s))]
    }),
    fault(DRIFTING, "a supply leak grows slowly", GROWN, Shutdown, |s| {
        vec![own(Grows("leakage_supply.leakage", s))]
    }),
    fault(DRIFTING, "the valve bias grows slowly", GROWN, Shutdown, |s| {
        vec![own(Grows("servo_valve.bias_positive", s))]
    }),
];

/// The names of all challenge sets, in the order of [`ALL`].
pub fn set_names() -> Vec<&'static str> {
    let mut names: Vec<&str> = vec![];
    for fault in ALL {
        if !names.contains(&fault.set) {
            names.push(fault.set);
        }
    }
    names
}
