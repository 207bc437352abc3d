//! Variants that need no simulation of their own.
//!
//! With like actuators, a fault of a later actuator gives the signals of the same fault of the first one, with the
//! actuators permuted. Such a variant is a symmetric copy: its sensors show the other one's signals in another order.
//! The symmetry is tested, not assumed. In the first operating case, the strongest fault of every kind is simulated for
//! all actuators, as a symmetry check. Healthy specimens without tolerances differ only by sensor noise, so one
//! simulation serves all of a case.

use super::{Planned, Study};
use servotwin_diagnosis::residual::Window;
use std::collections::{BTreeMap, BTreeSet};

/// Maximum difference between a symmetry check and its copy, in means and deviations of scaled residuals. It is a
/// thirtieth of the band (4), and a hundred times the solver's error, because a limit cycle amplifies rounding errors.
const LARGEST_DIFFERENCE: f64 = 1e-3;

/// The source of a variant's signals. It has 32 bits, like the variant numbers in shards, because there may be
/// millions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Source {
    /// The simulated variant.
    simulated: u32,
    /// Rotation of the actuators: the fault is in this actuator, and in the first one of the simulation.
    moved: u32,
}

/// Which variants are simulated, and which variants each simulation serves.
pub(super) struct Images {
    /// The source of every variant.
    sources: Vec<Source>,
    /// Pairs of a simulated variant and a variant that it serves, sorted.
    served: Vec<(u32, u32)>,
    /// Symmetric copies that are simulated as a check: (copy, original, actuator).
    probes: Vec<(usize, usize, usize)>,
    /// The rotated sensor order for a fault in each actuator but the first.
    orders: Vec<Vec<usize>>,
}

impl Images {
    /// Every variant is simulated.
    pub fn none(plan: &[Planned]) -> Self {
        let own = |simulated| Source { simulated, moved: 0 };
        Images {
            sources: (0..plan.len() as u32).map(own).collect(),
            served: Vec::new(),
            probes: Vec::new(),
            orders: Vec::new(),
        }
    }

    /// Finds the shared simulations among planned variants without tolerances. Actuators are rotated only if their
    /// sensors correspond.
    pub fn of(study: &Study, plan: &[Planned]) -> Self {
        let mut images = Self::none(plan);
        images.share_healthy(plan);
        let units = study.units.len();
        // The rotation moves the first actuator of the simulation to the faulty one.
        let order = |unit| study.sensors.rotated(units, units - unit);
        if let Some(orders) = (1..units).map(order).collect::<Option<Vec<_>>>() {
            images.orders = orders;
            images.mirror(study, plan);
        }
        images.served.sort_unstable();
        images
    }

    fn share_healthy(&mut self, plan: &[Planned]) {
        let mut first_of_case = BTreeMap::new();
        for (variant, planned) in plan.iter().enumerate().filter(|(_, p)| p.fault.is_none()) {
            let first = *first_of_case.entry(planned.case).or_insert(variant);
            if first != variant {
                self.serve(variant, first, 0);
            }
        }
    }

    fn mirror(&mut self, study: &Study, plan: &[Planned]) {
        let mut start = 0;
        // Case by case, in plan order, to limit the look-up.
        for of_case in plan.chunk_by(|one, next| one.case == next.case) {
            self.mirror_case(study, start, of_case);
            start += of_case.len();
        }
    }

    /// The symmetric copies within one case, whose first variant has the number `start`.
    fn mirror_case(&mut self, study: &Study, start: usize, plan: &[Planned]) {
        let of_unit = |unit: usize| {
            plan.iter().enumerate().filter_map(move |(place, planned)| {
                let fault = &study.faults[planned.fault?];
                let key = (&fault.kind, fault.at.intensity.to_bits());
                (fault.unit == unit).then_some((start + place, planned.case, fault, key))
            })
        };
        let first_units: BTreeMap<_, usize> =
            of_unit(0).map(|(variant, _, _, key)| (key, variant)).collect();
        for (variant, case, fault, key) in (1..study.units.len()).flat_map(of_unit) {
            let Some(&original) = first_units.get(&key) else { continue };
            let stronger = |other: &super::FaultCase| {
                other.kind == fault.kind && other.at.intensity > fault.at.intensity
            };
            if case == 0 && !study.faults.iter().any(stronger) {
                self.probes.push((variant, original, fault.unit));
            } else {
                self.serve(variant, original, fault.unit);
            }
        }
    }

    fn serve(&mut self, variant: usize, simulated: usize, unit: usize) {
        let simulated = simulated as u32;
        self.sources[variant] = Source { simulated, moved: unit as u32 };
        self.served.push((simulated, variant as u32));
    }

    /// The simulation that serves this variant.
    pub fn simulated(&self, variant: usize) -> usize {
        self.sources[variant].simulated as usize
    }

    /// All variants that a simulation serves, itself first.
    pub fn served(&self, simulated: usize) -> impl Iterator<Item = usize> + '_ {
        let first = self.served.partition_point(|&(by, _)| (by as usize) < simulated);
        let own = self.served[first..].iter().take_while(move |&&(by, _)| by as usize == simulated);
        std::iter::once(simulated).chain(own.map(|&(_, variant)| variant as usize))
    }

    /// The sensor order that turns the simulation into this variant; `None` for the same order.
    pub fn order(&self, variant: usize) -> Option<&[usize]> {
        let moved = self.sources[variant].moved.checked_sub(1)?;
        Some(&self.orders[moved as usize])
    }

    /// Whether a variant is a symmetric copy of another.
    pub fn is_mirrored(&self, variant: usize) -> bool {
        self.sources[variant].moved > 0
    }

    /// Whether any variant is a symmetric copy.
    pub fn has_mirrored(&self) -> bool {
        self.sources.iter().any(|source| source.moved > 0)
    }

    /// Numbers of variants without their own simulation: symmetric copies, and healthy specimens.
    pub fn counts(&self) -> [usize; 2] {
        let mirrored = self.sources.iter().filter(|source| source.moved > 0).count();
        [mirrored, self.served.len() - mirrored]
    }

    /// The symmetry checks and their originals.
    pub fn probed(&self) -> BTreeSet<usize> {
        self.probes.iter().flat_map(|&(probe, original, _)| [probe, original]).collect()
    }

    /// Whether all symmetry checks match their copies.
    pub fn hold<'w>(&self, window: impl Fn(usize) -> &'w Window) -> bool {
        self.probes.iter().all(|&(probe, original, unit)| {
            let image = window(original).reordered(&self.orders[unit - 1]);
            difference(window(probe), &image) <= LARGEST_DIFFERENCE
        })
    }
}

/// The largest difference of means and standard deviations.
fn difference(a: &Window, b: &Window) -> f64 {
    let mut largest: f64 = 0.0;
    for sensor in 0..a.sensors() {
        let deviation = |w: &Window| w.covariance(sensor, sensor).sqrt();
        largest = largest.max((a.mean(sensor) - b.mean(sensor)).abs());
        largest = largest.max((deviation(a) - deviation(b)).abs());
    }
    largest
}
