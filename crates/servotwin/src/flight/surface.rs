//! What an aircraft or machine notices of its actuators: the quantity that follows the command, and the force fight.

use crate::study::Study;
use servotwin_model::program::{Observable, Slot};
use servotwin_model::spec::Unit;

/// The quantities of a study's system that its user notices.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// The quantity that follows the command: a surface angle or a piston position; `None` if the system has neither.
    pub following: Option<Slot>,
    /// The force in the rod of each actuator, N; empty if one has no rod.
    pub rods: Vec<Slot>,
}

impl Surface {
    /// Finds the quantities of a study.
    pub fn of(study: &Study) -> Self {
        let observables = study.system.program.observables();
        let ends = following_end(study);
        let rod = |unit: &String| {
            let own = format!("{unit}.");
            let is_rod = |o: &&Observable| o.name.starts_with(&own) && o.name.contains(ROD_FORCE);
            observables.iter().find(is_rod).map(|o| o.slot)
        };
        Surface {
            following: observables.iter().find(|o| o.name.ends_with(ends)).map(|o| o.slot),
            rods: study.units.iter().map(rod).collect::<Option<_>>().unwrap_or_default(),
        }
    }
}

/// A part of the names of rod forces.
pub const ROD_FORCE: &str = "rod.force";

/// The end of the name of the quantity that follows the command.
pub fn following_end(study: &Study) -> &'static str {
    match study.system.network().inputs[study.command_input].unit {
        Unit::Radian => ".angle_rad",
        _ => ".position_m",
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
