//! Checks whether the pressures of a run stay in the validity range of the fluid laws.

use crate::system::System;
use servotwin_model::fluid::VAPOR_PRESSURE_PA;
use servotwin_model::program::Slot;
use servotwin_model::spec::Unit;
use std::collections::BTreeSet;
use std::fmt;

/// Maximum valid pressure, Pa. No data sheet goes beyond it, and there the laws (density and viscosity from temperature
/// alone, linear bulk modulus) do not hold.
pub const MAX_PRESSURE_PA: f64 = 1e8;

/// The limit of the validity range that a pressure crossed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrossedLimit {
    /// Vapor pressure: there is a cavity, or a boundary value is below that of any fluid.
    Vapor,
    /// [`MAX_PRESSURE_PA`].
    High,
}

/// A pressure that left the range of validity.
#[derive(Clone, Debug, PartialEq)]
pub struct PressureFinding {
    /// Name of the pressure among the recordable quantities.
    pub name: String,
    /// The crossed limit.
    pub limit: CrossedLimit,
    /// Time of the first sample outside, s.
    pub first_s: f64,
    /// Total time outside, s.
    pub duration_s: f64,
    /// The farthest value, Pa.
    pub extreme_pa: f64,
}

impl fmt::Display for PressureFinding {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PressureFinding { name, limit, first_s, duration_s, extreme_pa } = self;
        let bar = extreme_pa * 1e-5;
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
        }
    }
}

/// A watched pressure.
#[derive(Clone, Debug)]
struct Watched {
    name: String,
    slot: Slot,
    /// For each limit: first sample outside, number of samples outside, farthest value.
    outside: [Option<(usize, usize, f64)>; 2],
}

/// Watches every pressure of a system during a run, sample by sample.
#[derive(Clone, Debug)]
pub struct PressureMonitor {
    period_s: f64,
    watched: Vec<Watched>,
}

impl PressureMonitor {
    /// A monitor for this time between samples, s.
    pub fn new(system: &System, period_s: f64) -> Self {
        let mut seen = BTreeSet::new();
        let observables = system.program.observables().iter();
        let absolute =
            observables.filter(|o| o.unit == Unit::Pascal && o.name.ends_with(".pressure_pa"));
        let own = absolute.filter(|o| seen.insert(o.slot));
        let watch = |o: &servotwin_model::program::Observable| Watched {
            name: o.name.clone(),
            slot: o.slot,
            outside: [None; 2],
        };
        Self { period_s, watched: own.map(watch).collect() }
    }

    /// The variables that a run must record for the monitor.
    pub fn slots(&self) -> impl Iterator<Item = Slot> + '_ {
        self.watched.iter().map(|watched| watched.slot)
    }

    /// Takes the values of [`PressureMonitor::slots`] at a sample.
    pub fn sample(&mut self, index: usize, values: &[f64]) {
        for (watched, &value) in self.watched.iter_mut().zip(values) {
            let is_outside = [value <= VAPOR_PRESSURE_PA, value > MAX_PRESSURE_PA];
            for (outside, is_outside) in watched.outside.iter_mut().zip(is_outside) {
                if is_outside {
                    let (_, count, farthest) = outside.get_or_insert((index, 0, value));
                    *count += 1;
                    let is_farther =
                        if value > MAX_PRESSURE_PA { value > *farthest } else { value < *farthest };
                    *farthest = if is_farther { value } else { *farthest };
                }
            }
        }
    }

    /// The pressures that left the range of validity.
    pub fn findings(&self) -> Vec<PressureFinding> {
        let of = |watched: &Watched| {
            let name = watched.name.clone();
            let limits = [CrossedLimit::Vapor, CrossedLimit::High].into_iter().zip(watched.outside);
            let outside = limits.filter_map(|(limit, outside)| Some((limit, outside?)));
            let finding =
                |(limit, (first, count, extreme_pa)): (CrossedLimit, (usize, usize, f64))| {
                    PressureFinding {
                        name: name.clone(),
                        limit,
                        first_s: first as f64 * self.period_s,
                        duration_s: count as f64 * self.period_s,
                        extreme_pa,
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
        let mut monitor = PressureMonitor::new(&System::default(), 0.01);
        let count = monitor.watched.len();
        assert!(count > 4, "{count}");
        for (index, first) in [1e7, 20.0, 1.5e8, 2e8, 20.0, 1e7].into_iter().enumerate() {
            let mut values = vec![1e7; count];
            values[0] = first;
            monitor.sample(index, &values);
        }
        let findings = monitor.findings();
        let numbers: Vec<_> =
            findings.iter().map(|f| (f.limit, f.first_s, f.duration_s, f.extreme_pa)).collect();
        assert_eq!(
            numbers,
            [(CrossedLimit::Vapor, 0.01, 0.02, 20.0), (CrossedLimit::High, 0.02, 0.02, 2e8)]
        );
        assert!(findings[1].to_string().contains("reaches 2000 bar"), "{}", findings[1]);
    }
}
