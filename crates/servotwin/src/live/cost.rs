//! What a fault and the reaction to it cost in a flight: fluid, time in fault, and authority.
//!
//! A shutdown looks like harm in tracking error and force fight. What it saves is the fluid of the whole hydraulic
//! system, which stands here.

use super::closed_loop::FlightRecord;
use crate::study::Study;
use crate::system::reservoir::pressure_share;

/// The pressures settle within this time after an onset or a reaction, s: flows in it say nothing about a leak.
const SETTLES_S: f64 = 1.0;

/// A reservoir that lasts longer than this at its present leak counts as one without a leak, s.
const DAY_S: f64 = 86_400.0;

/// The fluid of one reservoir in a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Fluid {
    /// The id of the reservoir.
    pub reservoir: String,
    /// The fluid lost from the onset to the end, m³.
    pub lost_m3: f64,
    /// The flow that leaves it for good at the end of the flight, m³/s.
    pub loss_m3_s: f64,
    /// The time from the onset until it is empty, s, if the loss goes on; `None` if that takes longer than a day.
    pub empty_s: Option<f64>,
}

/// What a flight cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// The fluid of each reservoir.
    pub fluids: Vec<Fluid>,
    /// The time from the onset to the first reaction, or to the end, s.
    pub in_fault_s: f64,
    /// The pressure force that all actuators together can apply at the end, as a share of what they could at first. An
    /// actuator that was switched off applies none; one whose pump draws air applies less.
    pub authority: f64,
}

impl Cost {
    /// The cost of a flight in which a fault begins at `onset_s`.
    pub fn of(study: &Study, record: &FlightRecord, onset_s: f64) -> Self {
        let end_s = record.time_s.last().copied().unwrap_or(0.0);
        let reactions = || record.actions.iter().map(|action| action.time_s);
        let first_s = reactions().find(|time| *time >= onset_s).unwrap_or(end_s);
        let settled_s = SETTLES_S + reactions().fold(onset_s, f64::max);
        let reservoirs = study.system.reservoirs.iter().zip(&record.fluid_m3);
        let fluid = |(reservoir, fluid): (&crate::system::Reservoir, &Vec<f64>)| {
            let since = record.time_s.partition_point(|time| *time < settled_s);
            let onset = record.time_s.partition_point(|time| *time < onset_s);
            let left = fluid.last().copied().unwrap_or(reservoir.volume_m3);
            let before = fluid.get(onset).copied().unwrap_or(left);
            let loss_m3_s =
                slope(&record.time_s[since..], &fluid[since..]).map_or(0.0, |s| (-s).max(0.0));
            Fluid {
                reservoir: reservoir.id.clone(),
                lost_m3: before - left,
                loss_m3_s,
                empty_s: emptied_s(record, fluid)
                    .map(|time_s| time_s - onset_s)
                    .or((loss_m3_s * DAY_S > left).then(|| end_s - onset_s + left / loss_m3_s)),
            }
        };
        Cost {
            fluids: reservoirs.map(fluid).collect(),
            in_fault_s: (first_s - onset_s).max(0.0),
            authority: authority(study, record),
        }
    }
}

/// The time at which a reservoir ran empty, s.
fn emptied_s(record: &FlightRecord, fluid_m3: &[f64]) -> Option<f64> {
    let place = fluid_m3.iter().position(|fluid| *fluid <= 0.0)?;
    Some(record.time_s[place])
}

/// The slope of the straight line through points by least squares; `None` of fewer than two.
fn slope(x: &[f64], y: &[f64]) -> Option<f64> {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (mx, my) = (mean(x), mean(y));
    let products = x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my));
    let squares = x.iter().map(|x| (x - mx) * (x - mx));
    (x.len() > 1).then(|| products.sum::<f64>() / squares.sum::<f64>())
}

/// The force that the actuators can apply at the end, as a share of what they could at first.
fn authority(study: &Study, record: &FlightRecord) -> f64 {
    let off = |actuator: usize| {
        let of_actuator = |a: &&super::closed_loop::Action| a.raised.actuator as usize == actuator;
        record.actions.iter().rfind(of_actuator).is_some_and(|action| action.reaction.switches_off)
    };
    let share =
        |actuator: usize| if off(actuator) { 0.0 } else { pressure(study, record, actuator) };
    let shares = (0..study.actuators.len()).map(share);
    shares.sum::<f64>() / study.actuators.len().max(1) as f64
}

/// The share of its pressure that an actuator's source delivers at the end.
fn pressure(study: &Study, record: &FlightRecord, actuator: usize) -> f64 {
    let components = &study.system.network().components;
    let feeds = |source: usize| study.actuator_of(&components[source].id) == Some(actuator);
    let reservoirs = study.system.reservoirs.iter().zip(&record.fluid_m3);
    let mut own = reservoirs.filter(|(reservoir, _)| feeds(reservoir.supply));
    own.next()
        .and_then(|(r, fluid)| Some(pressure_share(*fluid.last()?, r.volume_m3)))
        .unwrap_or(1.0)
}
