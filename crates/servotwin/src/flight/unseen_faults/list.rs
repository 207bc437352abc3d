//! The unseen faults, which no training data contain, one line each.

use super::effect::Effect::{
    Drift, Fault, InputTimes, Missing, Noise, Swing, Times, ToldFrozen, ToldLate, ToldMissing,
    ToldOff, ToldTooLarge, Value, Weather,
};
use super::effect::{On, other, own, whole};
use serde::{Deserialize, Serialize};
use servotwin_diagnosis::features::Quantity::{PressureA, Ram, Supply};

/// The command for the faulty actuator that counts as sensible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sensible {
    /// A shutdown: the actuator does not work properly.
    Shutdown,
    /// Any command except a shutdown: only a sensor is wrong.
    NoShutdown,
    /// Any action.
    Any,
    /// No command: no actuator is at fault.
    Nothing,
}

/// A fault without training data.
pub struct Foreign {
    /// The display title.
    pub title: &'static str,
    /// The strengths that are flown.
    pub strengths: &'static [f64],
    /// The strengths in words, with their unit.
    pub strengths_in_words: &'static str,
    /// The command that counts as sensible.
    pub sensible: Sensible,
    /// The effects at a strength.
    pub effects: fn(f64) -> Vec<On>,
}

const fn foreign(
    title: &'static str,
    (strengths, strengths_in_words): (&'static [f64], &'static str),
    sensible: Sensible,
    effects: fn(f64) -> Vec<On>,
) -> Foreign {
    Foreign { title, strengths, strengths_in_words, sensible, effects }
}

use Sensible::{Any, NoShutdown, Nothing, Shutdown};

/// A sensor with this bandwidth is practically stuck, Hz.
const STUCK_HZ: f64 = 1e-3;
/// How late the sensor of a boundary value may be, s: a slow transducer and a slow bus.
const LATE_S: f64 = 0.2;
const ONCE: (&[f64], &str) = (&[1.0], "");

/// All unseen faults.
pub static ALL: &[Foreign] = &[
    foreign("stuck stroke sensor", ONCE, Any, |_| {
        vec![own(Value("sensor_ram.bandwidth_hz", STUCK_HZ))]
    }),
    foreign("stuck spool sensor", ONCE, NoShutdown, |_| {
        vec![own(Value("sensor_spool.bandwidth_hz", STUCK_HZ))]
    }),
    foreign("stuck chamber pressure sensor", ONCE, NoShutdown, |_| {
        vec![own(Value("sensor_pressure_a.bandwidth_hz", STUCK_HZ))]
    }),
    foreign(
        "drifting stroke sensor",
        (&[0.01, 0.03], "1 and 3 % of range per s"),
        NoShutdown,
        |s| vec![own(Drift("sensor_ram.bias_electrical", s))],
    ),
    foreign(
        "drifting chamber pressure sensor",
        (&[0.02, 0.05], "2 and 5 % of range per s"),
        NoShutdown,
        |s| vec![own(Drift("sensor_pressure_a.bias_electrical", s))],
    ),
    foreign("no reading of the stroke sensor", ONCE, NoShutdown, |_| vec![own(Missing(Ram))]),
    foreign("no reading of a pressure sensor", ONCE, NoShutdown, |_| vec![own(Missing(PressureA))]),
    foreign(
        "noise of the stroke sensor",
        (&[3.0, 5.0, 10.0], "3, 5 and 10 times"),
        NoShutdown,
        |s| vec![own(Noise(Ram, s))],
    ),
    foreign(
        "noise of a pressure sensor",
        (&[3.0, 5.0, 10.0], "3, 5 and 10 times"),
        NoShutdown,
        |s| vec![own(Noise(PressureA, s))],
    ),
    foreign("noise of the supply pressure sensor", (&[5.0], "5 times"), NoShutdown, |s| {
        vec![own(Noise(Supply, s))]
    }),
    foreign("spool jams where it is", ONCE, Shutdown, |_| {
        vec![own(Value("servo_valve.breakaway", 1.0))]
    }),
    foreign("spool drags", (&[0.03, 0.1], "slew rate 3 and 10 %"), Shutdown, |s| {
        vec![own(Times("servo_valve.slew_rate_m_s", s))]
    }),
    foreign(
        "oscillation of the servo current",
        (&[0.05, 0.2], "5 and 20 % of rated current, 1.5 Hz"),
        Shutdown,
        |s| vec![own(Swing("servo_valve.null_bias", s))],
    ),
    foreign(
        "oscillation of the stroke reading",
        (&[0.03, 0.1], "3 and 10 % of range, 1.5 Hz"),
        NoShutdown,
        |s| vec![own(Swing("sensor_ram.bias_electrical", s))],
    ),
    foreign("backlash of the attachment", (&[1e-4, 3e-4], "±0.1 and ±0.3 mm"), Any, |s| {
        vec![own(Value("attachment.backlash_m", s))]
    }),
    foreign("stiffness of the attachment", (&[0.1, 0.3], "10 and 30 % are left"), Any, |s| {
        vec![own(Times("attachment.stiffness_n_m", s))]
    }),
    foreign("seal friction", (&[2.0, 4.0, 8.0], "2, 4 and 8 times"), Any, |s| {
        vec![own(Times("cylinder.coulomb_friction_n", s))]
    }),
    foreign("guides drag", (&[3.0, 6.0], "3 and 6 times"), Any, |s| {
        vec![own(Times("cylinder.viscous_friction_n_s_m", s))]
    }),
    foreign(
        "leak and stroke sensor bias in one actuator",
        (&[0.5, 1.0], "both 50 and 100 %"),
        Any,
        |s| vec![own(Fault("leakage_a.leakage", s)), own(Fault("sensor_ram.bias_positive", s))],
    ),
    foreign(
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
    foreign(
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
    foreign("a leak in each of two actuators", (&[0.5, 1.0], "both 50 and 100 %"), Shutdown, |s| {
        vec![own(Fault("leakage_supply.leakage", s)), other(Fault("leakage_a.leakage", s))]
    }),
    foreign(
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
    foreign("supply pressure falls, measured", (&[0.5, 0.85], "to 50 and 85 %"), Any, |s| {
        vec![own(InputTimes("supply_pressure", s))]
    }),
    foreign(
        "hot day beyond training, measured",
        (&[358.0, 368.0], "85 and 95 °C"),
        Nothing,
        |s| {
            vec![whole(Weather("supply.temperature_k", s)), whole(Weather("tank.temperature_k", s))]
        },
    ),
    foreign("the twin is told a frozen command", ONCE, Nothing, |_| {
        vec![whole(ToldFrozen("command"))]
    }),
    foreign("the twin is told no command", ONCE, Nothing, |_| vec![whole(ToldMissing("command"))]),
    foreign("the twin is told an impossible command", ONCE, Nothing, |_| {
        vec![whole(ToldTooLarge("command"))]
    }),
    foreign("the supply pressure that the twin is told is missing", ONCE, Any, |_| {
        vec![own(ToldMissing("supply_pressure"))]
    }),
    foreign(
        "the supply pressure that the twin is told is wrong, inside of its range",
        (&[-0.04, 0.04], "−4 and +4 %"),
        NoShutdown,
        |s| vec![own(ToldOff("supply_pressure", s))],
    ),
    foreign(
        "supply pressure falls, and the twin is told the old one",
        (&[0.9, 0.7], "to 90 and 70 %"),
        Any,
        |s| vec![own(InputTimes("supply_pressure", s)), own(ToldFrozen("supply_pressure"))],
    ),
    foreign(
        "the return pressure that the twin is told is wrong, inside of its range",
        (&[-0.1, 0.1], "−10 and +10 %"),
        NoShutdown,
        |s| vec![own(ToldOff("return_pressure", s))],
    ),
    foreign(
        "the supply pressure changes, measured",
        (&[0.9, 1.03], "to 90 and 103 %"),
        Nothing,
        |s| vec![whole(InputTimes("supply_pressure", s))],
    ),
    foreign(
        "the supply pressure changes, and the twin is told late",
        (&[0.9, 1.03], "to 90 and 103 %, 0.2 s late"),
        Nothing,
        |s| {
            vec![
                whole(InputTimes("supply_pressure", s)),
                whole(ToldLate("supply_pressure", LATE_S)),
            ]
        },
    ),
    foreign(
        "the return pressure changes, and the twin is told late",
        (&[0.8, 1.5], "to 80 and 150 %, 0.2 s late"),
        Nothing,
        |s| {
            vec![
                whole(InputTimes("return_pressure", s)),
                whole(ToldLate("return_pressure", LATE_S)),
            ]
        },
    ),
];
