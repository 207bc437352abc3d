//! Measures of what a fault does to a flight: the error of the quantity that follows the command, the force fight of
//! several actuators, and the first report of a fault.

use super::closed_loop::FlightRecord;
use crate::study::Study;
use crate::study::faults::full_name;
use servotwin_diagnosis::diagnoser::IndexedFinding;
use servotwin_model::program::Slot;
use servotwin_model::spec::Unit;

/// Quantities of the plant to record apart from its sensors, with names and units.
#[derive(Debug, Clone)]
pub struct TrackedQuantities {
    /// The slots to record.
    pub slots: Vec<Slot>,
    /// Their names.
    pub names: Vec<String>,
    /// Their units.
    pub units: Vec<Unit>,
    /// The index of the quantity that follows the command.
    pub following: Option<usize>,
}

impl TrackedQuantities {
    /// Selects the quantity that follows the command (a surface angle or a piston position), the load on it, and the
    /// forces in the rods.
    pub fn of(study: &Study) -> Self {
        let follows = match command_unit(study) {
            Unit::Radian => ".angle_rad",
            _ => ".position_m",
        };
        let is_wanted = |name: &str| {
            let ends = [follows, ".rod.force_n", ".shaft.torque_nm"];
            ends.iter().any(|end| name.ends_with(end))
        };
        let observables = study.system.program.observables().iter();
        let found: Vec<_> = observables.filter(|o| is_wanted(&o.name)).collect();
        TrackedQuantities {
            slots: found.iter().map(|o| o.slot).collect(),
            names: found.iter().map(|o| o.name.clone()).collect(),
            units: found.iter().map(|o| o.unit).collect(),
            following: found.iter().position(|o| o.name.ends_with(follows)),
        }
    }

    /// The quantity that follows the command minus the command, SI.
    pub fn tracking_error(&self, study: &Study, record: &FlightRecord) -> Option<Vec<f64>> {
        let unit = command_unit(study);
        let place = self.following.filter(|&place| self.units[place] == unit)?;
        let command = &record.inputs[study.command_input];
        Some(record.plant[place].iter().zip(command).map(|(is, wanted)| is - wanted).collect())
    }

    /// The slot of the quantity that follows the command.
    pub fn following_slot(&self) -> Option<Slot> {
        self.following.map(|place| self.slots[place])
    }

    /// The index of the rod force of an actuator; `None` if it has no rod.
    fn rod(&self, actuator: &str) -> Option<usize> {
        let own = full_name(actuator, "");
        let is_rod = |name: &String| name.starts_with(&own) && name.contains("rod.force");
        self.names.iter().position(is_rod)
    }

    /// The slots of the rod forces of all actuators; `None` if one has no rod.
    pub fn rod_slots(&self, study: &Study) -> Option<Vec<Slot>> {
        study
            .actuators
            .iter()
            .map(|actuator| self.rod(actuator).map(|place| self.slots[place]))
            .collect()
    }

    /// The rod force of an actuator, N; `None` if it has no rod.
    pub(crate) fn rod_force<'r>(
        &self,
        actuator: &str,
        record: &'r FlightRecord,
    ) -> Option<&'r Vec<f64>> {
        self.rod(actuator).map(|place| &record.plant[place])
    }

    /// The force fight, N, of [`force_fight_n`]. `None` for one actuator, or if one has no rod.
    pub fn force_fight(&self, study: &Study, record: &FlightRecord) -> Option<Vec<f64>> {
        let forces = study.actuators.iter().map(|actuator| self.rod_force(actuator, record));
        let forces: Vec<&Vec<f64>> = forces.collect::<Option<_>>()?;
        let at = |sample: usize| {
            force_fight_n(&forces.iter().map(|rod| rod[sample]).collect::<Vec<f64>>())
        };
        (0..record.time_s.len()).map(at).collect()
    }
}

/// How far a quantity of a flight is from zero since an onset, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// The root mean square.
    pub rms: f64,
    /// The largest magnitude.
    pub largest: f64,
}

impl Deviation {
    /// The deviation of the last values of a record, of which `since` come before the onset.
    pub fn since(since: usize, values: &[f64]) -> Self {
        let tail = &values[since..];
        let square = tail.iter().map(|x| x * x).sum::<f64>() / tail.len().max(1) as f64;
        let largest = tail.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        Deviation { rms: square.sqrt(), largest }
    }
}

/// The force fight, N. For two actuators it is half the difference of their rod forces, for more the largest deviation
/// of a rod force from the mean; `None` for a single one.
pub fn force_fight_n(rods_n: &[f64]) -> Option<f64> {
    match *rods_n {
        [] | [_] => None,
        [first, second] => Some(0.5 * (first - second)),
        _ => {
            let mean = rods_n.iter().sum::<f64>() / rods_n.len() as f64;
            let farther = |most: f64, one: f64| if one.abs() > most.abs() { one } else { most };
            Some(rods_n.iter().map(|rod| rod - mean).fold(0.0, farther))
        }
    }
}

/// The unit of the command.
pub fn command_unit(study: &Study) -> Unit {
    study.system.network().inputs[study.command_input].unit
}

/// The first time from `since_s` on at which the diagnosis reported a fault, s.
pub fn first_report_s(record: &FlightRecord, since_s: f64) -> Option<f64> {
    let is_report = |finding: IndexedFinding| {
        !matches!(
            finding,
            IndexedFinding::Unjudged
                | IndexedFinding::Healthy
                | IndexedFinding::EnvironmentInvalid { .. }
        )
    };
    let mut later = record.changes.iter().filter(|change| change.time_s >= since_s);
    later.find(|change| is_report(change.finding)).map(|change| change.time_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actuators_fight_by_what_their_forces_differ() {
        assert_eq!(force_fight_n(&[100.0]), None);
        assert_eq!(force_fight_n(&[300.0, -100.0]), Some(200.0));
        assert_eq!(force_fight_n(&[100.0, 100.0, -500.0]), Some(-400.0));
    }
}
