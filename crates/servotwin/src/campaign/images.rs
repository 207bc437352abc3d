//! Variants that need no simulation of their own.
//!
//! Where units are alike and nothing but the fault tells them apart, a fault
//! of the second or a later one gives the signals of the same fault of the first, with the
//! units moved round. Such a variant need not be simulated: its sensors show what the
//! other one's show, in another order. That the units are alike is tested,
//! not assumed: of every kind the strongest fault of each unit but the first, in the
//! first operating case, is simulated all the same, as a *probe*. And specimens
//! without a fault and without tolerances differ by the noise of their sensors only:
//! one simulation serves all of a case.

use super::{Planned, Study};
use servotwin_diagnosis::residual::Window;
use std::collections::{BTreeMap, BTreeSet};

/// By how much means and deviations of a probe's scaled residuals may differ
/// from its image's: a thirtieth of the band (4), and a hundred times the
/// solver's error, because a limit cycle multiplies rounding errors.
const LARGEST_DIFFERENCE: f64 = 1e-3;

/// Where a variant's signals come from. In 32 bits, as variants are numbered in shards: there may be
/// millions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Source {
    /// The variant that is simulated.
    simulated: u32,
    /// By how many places the units are moved round: the fault is in this unit, and in the first one of what is
    /// simulated.
    moved: u32,
}

/// Which variants are simulated, and whom each simulation serves.
pub(super) struct Images {
    /// For every variant where its signals come from.
    sources: Vec<Source>,
    /// Every variant that is not simulated, behind the one that serves it, in order.
    served: Vec<(u32, u32)>,
    /// Variants that are simulated although they are mirror images: (probe, original, unit).
    probes: Vec<(usize, usize, usize)>,
    /// The sensors with the units moved round, for a fault in each unit but the first.
    orders: Vec<Vec<usize>>,
}

impl Images {
    /// Every variant simulated.
    pub fn none(plan: &[Planned]) -> Self {
        let own = |simulated| Source { simulated, moved: 0 };
        Images {
            sources: (0..plan.len() as u32).map(own).collect(),
            served: Vec::new(),
            probes: Vec::new(),
            orders: Vec::new(),
        }
    }

    /// The images among planned variants without tolerances. Units are moved round only in a study
    /// with several units whose sensors correspond.
    pub fn of(study: &Study, plan: &[Planned]) -> Self {
        let mut images = Self::none(plan);
        images.share_healthy(plan);
        let units = study.units.len();
        // Where the fault's unit stands, the first one's stood in what is simulated.
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
        // Case by case, as they stand in the plan: no more of it needs to be looked up at a time.
        for of_case in plan.chunk_by(|one, next| one.case == next.case) {
            self.mirror_case(study, start, of_case);
            start += of_case.len();
        }
    }

    /// The images among variants of one case, of which the first has the number `start`.
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

    /// The variant to simulate for this one.
    pub fn simulated(&self, variant: usize) -> usize {
        self.sources[variant].simulated as usize
    }

    /// All variants whose signals the simulation of one gives, itself first.
    pub fn served(&self, simulated: usize) -> impl Iterator<Item = usize> + '_ {
        let first = self.served.partition_point(|&(by, _)| (by as usize) < simulated);
        let own = self.served[first..].iter().take_while(move |&&(by, _)| by as usize == simulated);
        std::iter::once(simulated).chain(own.map(|&(_, variant)| variant as usize))
    }

    /// The order of the simulated sensors in which a variant's stand; `None` for the same order.
    pub fn order(&self, variant: usize) -> Option<&[usize]> {
        let moved = self.sources[variant].moved.checked_sub(1)?;
        Some(&self.orders[moved as usize])
    }

    /// Whether a variant is a mirror image of another.
    pub fn is_mirrored(&self, variant: usize) -> bool {
        self.sources[variant].moved > 0
    }

    /// Whether any variant is.
    pub fn has_mirrored(&self) -> bool {
        self.sources.iter().any(|source| source.moved > 0)
    }

    /// Number of variants that are not simulated, because the same fault of another unit shows them, and of healthy
    /// specimens, because another one's simulation serves them.
    pub fn counts(&self) -> [usize; 2] {
        let mirrored = self.sources.iter().filter(|source| source.moved > 0).count();
        [mirrored, self.served.len() - mirrored]
    }

    /// The probes and what they are compared with.
    pub fn probed(&self) -> BTreeSet<usize> {
        self.probes.iter().flat_map(|&(probe, original, _)| [probe, original]).collect()
    }

    /// Whether all probes are what the images say.
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
