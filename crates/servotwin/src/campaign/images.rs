//! Variants that need no separate simulation, because of symmetry or because they share a simulation.
//!
//! If units are alike, a fault of a later unit gives the signals of the same fault in the first unit, with the units
//! exchanged. Such a variant is a symmetric copy: its sensors show the other one's values in another order. The
//! symmetry is tested, not assumed. In the first operating case, the strongest fault of every kind and every unit but
//! the first is simulated nevertheless, as a symmetry check (*probe*). Healthy specimens without tolerances differ only
//! by the noise of their sensors, so one simulation serves all of a case.

use super::{Planned, Study};
use servotwin_diagnosis::residual::Window;
use std::collections::{BTreeMap, BTreeSet};

/// Largest allowed difference between a probe and its copy, in means and deviations of scaled residuals. This is a
/// thirtieth of the band (4), and a hundred times the solver's error, because a limit cycle amplifies rounding errors.
const LARGEST_DIFFERENCE: f64 = 1e-3;

/// The source of a variant's signals. 32 bits save memory, as there may be millions of variants; shards number them
/// likewise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Source {
    /// The simulated variant.
    simulated: u32,
    /// By how many places the units are rotated: the fault is in this unit, and in the first one of the simulated
    /// variant.
    moved: u32,
}

/// Which variants are simulated, and which variants each simulation serves.
pub(super) struct Images {
    /// For every variant, the source of its signals.
    sources: Vec<Source>,
    /// Pairs of a simulated variant and a variant that it serves, sorted.
    served: Vec<(u32, u32)>,
    /// Symmetric copies that are simulated nevertheless: (probe, original, unit).
    probes: Vec<(usize, usize, usize)>,
    /// The order of the sensors with rotated units, for a fault in each unit but the first.
    orders: Vec<Vec<usize>>,
}

impl Images {
    /// A plan in which every variant is simulated.
    pub fn none(plan: &[Planned]) -> Self {
        let own = |simulated| Source { simulated, moved: 0 };
        Images {
            sources: (0..plan.len() as u32).map(own).collect(),
            served: Vec::new(),
            probes: Vec::new(),
            orders: Vec::new(),
        }
    }

    /// The shared simulations among planned variants without tolerances. Units are rotated only in a study with several
    /// units whose sensors correspond.
    pub fn of(study: &Study, plan: &[Planned]) -> Self {
        let mut images = Self::none(plan);
        images.share_healthy(plan);
        let units = study.units.len();
        // The simulated variant's first unit moves to the place of the faulty unit.
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
        // Cases are contiguous in the plan, so the lookup table covers only one case at a time.
        for of_case in plan.chunk_by(|one, next| one.case == next.case) {
            self.mirror_case(study, start, of_case);
            start += of_case.len();
        }
    }

    /// The symmetric copies among variants of one case; the first variant has the number `start`.
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

    /// The variant that is simulated for this one.
    pub fn simulated(&self, variant: usize) -> usize {
        self.sources[variant].simulated as usize
    }

    /// All variants that a simulation serves, itself first.
    pub fn served(&self, simulated: usize) -> impl Iterator<Item = usize> + '_ {
        let first = self.served.partition_point(|&(by, _)| (by as usize) < simulated);
        let own = self.served[first..].iter().take_while(move |&&(by, _)| by as usize == simulated);
        std::iter::once(simulated).chain(own.map(|&(_, variant)| variant as usize))
    }

    /// The order of the simulated sensors for a variant.
    pub fn order(&self, variant: usize, sensors: usize) -> Vec<usize> {
        match self.sources[variant].moved {
            0 => (0..sensors).collect(),
            moved => self.orders[moved as usize - 1].clone(),
        }
    }

    /// Whether a variant is the symmetric copy of another.
    pub fn is_mirrored(&self, variant: usize) -> bool {
        self.sources[variant].moved > 0
    }

    /// Whether any variant is a symmetric copy.
    pub fn has_mirrored(&self) -> bool {
        self.sources.iter().any(|source| source.moved > 0)
    }

    /// Number of variants that are not simulated: symmetric copies, and healthy specimens served by another simulation.
    pub fn counts(&self) -> [usize; 2] {
        let mirrored = self.sources.iter().filter(|source| source.moved > 0).count();
        [mirrored, self.served.len() - mirrored]
    }

    /// The probes and their originals.
    pub fn probed(&self) -> BTreeSet<usize> {
        self.probes.iter().flat_map(|&(probe, original, _)| [probe, original]).collect()
    }

    /// Whether all probes agree with their symmetric copies.
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
