//! Checks whether a run stays where the model holds: pressures within the fluid laws, pistons within their cylinders.

use crate::shown::shown;
use crate::system::System;
use servotwin_model::fluid::VAPOR_PRESSURE_PA;
use servotwin_model::program::{Observable, Slot};
use servotwin_model::spec::Unit;
use std::collections::BTreeSet;
use std::fmt;

/// Maximum valid pressure, Pa. No data sheet goes beyond it, and there the laws (density and viscosity from temperature
/// alone, linear bulk modulus) do not hold.
pub(crate) const MAX_PRESSURE_PA: f64 = 1e8;

/// The limit of the validity range that a value crossed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrossedLimit {
    /// Vapor pressure: there is a cavity, or a boundary value is below that of any fluid.
    Vapor,
    /// 1000 bar.
    High,
    /// The position at which a piston leaves no volume in a chamber.
    Travel,
}

/// A value that left the range of validity.
#[derive(Clone, Debug, PartialEq)]
pub struct ValidityFinding {
    /// Name of the value among the recordable quantities.
    pub name: String,
    /// The crossed limit.
    pub limit: CrossedLimit,
    /// Time of the first sample outside, s.
    pub first_s: f64,
    /// Total time outside, s.
    pub duration_s: f64,
    /// The farthest value, Pa or m.
    pub extreme: f64,
}

impl fmt::Display for ValidityFinding {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ValidityFinding { name, limit, first_s, duration_s, extreme } = self;
        let bar = extreme * 1e-5;
        match limit {
            CrossedLimit::Vapor => write!(
                out,
                "{name} is at vapor pressure for {duration_s:.4} s, first at {first_s:.4} s: a cavity, whose size is \
                 followed, but not its place and its waves"
            ),
            CrossedLimit::High => write!(
                out,
                "{name} is above {:.0} bar for {duration_s:.4} s, first at {first_s:.4} s, and reaches {bar:.0} bar: \
                 the laws of the fluids do not hold there",
                MAX_PRESSURE_PA * 1e-5
            ),
            CrossedLimit::Travel => write!(
                out,
                "{name} is outside of the cylinder for {duration_s:.4} s, first at {first_s:.4} s, and reaches {}: a \
                 chamber has no volume there, because the end stops are too soft for this load",
                shown(*extreme, Unit::Metre)
            ),
        }
    }
}

/// A watched value.
#[derive(Clone, Debug)]
struct Watched {
    name: String,
    slot: Slot,
    /// The lower and the upper limit.
    range: (f64, f64),
    limits: [CrossedLimit; 2],
    /// For each limit: first sample outside, number of samples outside, farthest value.
    outside: [Option<(usize, usize, f64)>; 2],
}

/// Watches every pressure and every piston of a system during a run, sample by sample.
#[derive(Clone, Debug)]
pub struct ValidityMonitor {
    period_s: f64,
    watched: Vec<Watched>,
}

impl ValidityMonitor {
    /// A monitor for this time between samples, s, and a variant's parameters that differ from the system's: component,
    /// parameter, SI value.
    pub fn new(system: &System, period_s: f64, overrides: &[(usize, usize, f64)]) -> Self {
        let mut seen = BTreeSet::new();
        let watch = |o: &Observable, range, limits| Watched {
            name: o.name.clone(),
            slot: o.slot,
            range,
            limits,
            outside: [None; 2],
        };
        let observables = system.program.observables().iter();
        let absolute =
            observables.filter(|o| o.unit == Unit::Pascal && o.name.ends_with("pressure_pa"));
        let own = absolute.filter(|o| seen.insert(o.slot));
        let pressures = own.map(|o| {
            let range = (VAPOR_PRESSURE_PA, MAX_PRESSURE_PA);
            watch(o, range, [CrossedLimit::Vapor, CrossedLimit::High])
        });
        let components = system.network().components.iter().enumerate();
        let pistons = components.filter_map(|(component, instance)| {
            let mut parameters = instance.parameters.clone();
            for (_, parameter, value) in overrides.iter().filter(|(own, ..)| *own == component) {
                parameters[*parameter] = *value;
            }
            let travel_m = (instance.component.travel_m)(&parameters)?;
            let position = system.program.observable(&format!("{}.position_m", instance.id))?;
            Some(watch(position, travel_m, [CrossedLimit::Travel; 2]))
        });
        Self { period_s, watched: pressures.chain(pistons).collect() }
    }

    /// The variables that a run must record for the monitor.
    pub fn slots(&self) -> impl Iterator<Item = Slot> + '_ {
        self.watched.iter().map(|watched| watched.slot)
    }

    /// Takes the values of [`ValidityMonitor::slots`] at a sample.
    pub fn sample(&mut self, index: usize, values: &[f64]) {
        for (watched, &value) in self.watched.iter_mut().zip(values) {
            let (low, high) = watched.range;
            let is_outside = [value <= low, value > high];
            for (outside, is_outside) in watched.outside.iter_mut().zip(is_outside) {
                if is_outside {
                    let (_, count, farthest) = outside.get_or_insert((index, 0, value));
                    *count += 1;
                    *farthest =
                        if value > high { value.max(*farthest) } else { value.min(*farthest) };
                }
            }
        }
    }

    /// The values that left the range of validity.
    pub fn findings(&self) -> Vec<ValidityFinding> {
        let of = |watched: &Watched| {
            let name = watched.name.clone();
            let limits = watched.limits.into_iter().zip(watched.outside);
            let outside = limits.filter_map(|(limit, outside)| Some((limit, outside?)));
            let finding =
                |(limit, (first, count, extreme)): (CrossedLimit, (usize, usize, f64))| {
                    ValidityFinding {
                        name: name.clone(),
                        limit,
                        first_s: first as f64 * self.period_s,
                        duration_s: count as f64 * self.period_s,
                        extreme,
                    }
                };
            outside.map(finding).collect::<Vec<_>>()
        };
        self.watched.iter().flat_map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pressure_outside_of_its_range_is_named_with_time_and_size() {
        let mut monitor = ValidityMonitor::new(&System::default(), 0.01, &[]);
        let count = monitor.watched.len();
        assert!(count > 4, "{count}");
        for (index, first) in [1e7, 20.0, 1.5e8, 2e8, 20.0, 1e7].into_iter().enumerate() {
            let mut values = vec![1e7; count];
            values[0] = first;
            monitor.sample(index, &values);
        }
        // The pistons received pressures.
        let mut findings = monitor.findings();
        findings.retain(|finding| finding.limit != CrossedLimit::Travel);
        let numbers: Vec<_> =
            findings.iter().map(|f| (f.limit, f.first_s, f.duration_s, f.extreme)).collect();
        assert_eq!(
            numbers,
            [(CrossedLimit::Vapor, 0.01, 0.02, 20.0), (CrossedLimit::High, 0.02, 0.02, 2e8)]
        );
        assert!(findings[1].to_string().contains("reaches 2000 bar"), "{}", findings[1]);
    }
}
