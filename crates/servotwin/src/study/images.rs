//! Variants that are mirror images of each other.
//!
//! Where two units are alike and nothing but the fault tells them apart, a fault
//! of the second gives the signals of the same fault of the first, with the
//! units exchanged. Such a variant need not be simulated: its window is the
//! other one's with the sensors reordered. That the units are alike is tested,
//! not assumed: of every kind the strongest fault of the second unit, in the
//! first operating case, is simulated all the same, as a *probe*.

use super::Study;
use super::campaign::Planned;
use servotwin_diagnosis::residual::Window;
use std::collections::BTreeMap;

/// By how much means and deviations of a probe's scaled residuals may differ
/// from its image's: a thirtieth of the band (4), and a hundred times the
/// solver's error, because a limit cycle multiplies rounding errors.
const LARGEST_DIFFERENCE: f64 = 1e-3;

/// Which variants are images of which.
pub(super) struct Images {
    /// For every variant the one whose image it is; `None` where it is simulated.
    original: Vec<Option<usize>>,
    /// The other way round.
    image: Vec<Option<usize>>,
    /// Variants that are simulated although they are images: (probe, original).
    probes: Vec<(usize, usize)>,
    /// The sensors with the units exchanged.
    order: Vec<usize>,
}

impl Images {
    /// The images among planned variants of a study with two units whose sensors
    /// correspond; `None` where there can be none.
    pub fn of(study: &Study, plan: &[Planned]) -> Option<Self> {
        let order = study.sensors.exchanged(0, 1).filter(|_| study.units.len() == 2)?;
        let fault = |planned: &Planned| planned.fault.map(|f| &study.faults[f]);
        let mut first_units = BTreeMap::new();
        for (variant, planned) in plan.iter().enumerate() {
            if let Some(fault) = fault(planned).filter(|fault| fault.unit == 0) {
                let key = (planned.case, &fault.kind, fault.at.intensity.to_bits());
                first_units.insert(key, variant);
            }
        }
        let mut images = Self {
            original: vec![None; plan.len()],
            image: vec![None; plan.len()],
            probes: Vec::new(),
            order,
        };
        for (variant, planned) in plan.iter().enumerate() {
            let Some(fault) = fault(planned).filter(|fault| fault.unit == 1) else { continue };
            let key = (planned.case, &fault.kind, fault.at.intensity.to_bits());
            let Some(&original) = first_units.get(&key) else { continue };
            let stronger = |other: &&super::FaultCase| {
                other.kind == fault.kind && other.at.intensity > fault.at.intensity
            };
            if planned.case == 0 && !study.faults.iter().any(|f| stronger(&f)) {
                images.probes.push((variant, original));
            } else {
                images.original[variant] = Some(original);
                images.image[original] = Some(variant);
            }
        }
        Some(images)
    }

    /// The variant to simulate for this one.
    pub fn simulated(&self, variant: usize) -> usize {
        self.original[variant].unwrap_or(variant)
    }

    /// The variant that is this one's image.
    pub fn image_of(&self, variant: usize) -> Option<usize> {
        self.image[variant]
    }

    /// The window of a variant's image.
    pub fn reflected(&self, window: &Window) -> Window {
        window.reordered(&self.order)
    }

    /// Number of variants that are not simulated.
    pub fn count(&self) -> usize {
        self.original.iter().flatten().count()
    }

    /// Whether all probes are what the images say.
    pub fn hold<'w>(&self, window: impl Fn(usize) -> &'w Window) -> bool {
        self.probes.iter().all(|&(probe, original)| {
            difference(window(probe), &self.reflected(window(original))) <= LARGEST_DIFFERENCE
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
