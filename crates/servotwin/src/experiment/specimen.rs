//! Specimens: plants with their own tolerances.

use crate::signal::random::NormalDeviates;
use crate::study::{Lot, Realism, Setting, Study};

/// Parameters that differ from the system's: (component, parameter, value).
pub(crate) type Overrides = Vec<(usize, usize, f64)>;

/// A draw of a study's random numbers: a specimen, and the noise of its sensors. It depends on the lot and the number
/// alone.
#[derive(Clone, Copy)]
pub(crate) struct SpecimenDraw<'s> {
    pub study: &'s Study,
    /// The scenario: whether specimens have tolerances, and sensors noise.
    pub setting: Setting,
    pub lot: Lot,
    pub number: usize,
}

impl<'s> SpecimenDraw<'s> {
    /// The specimen's parameters with tolerances; empty if plants equal their twins.
    pub fn parameters(self) -> Overrides {
        self.scattered_parameters(1.0)
    }

    /// The same with deviations that are `scatter` times as large.
    pub fn scattered_parameters(self, scatter: f64) -> Overrides {
        let Self { study, lot, number, .. } = self;
        let drawn = self.tolerant().map(|r| r.scattered_specimen(study, lot, number, scatter));
        drawn.unwrap_or_default()
    }

    /// The same for chosen deviations, one for each tolerance, in standard deviations.
    pub fn parameters_with(self, deviations: &[f64]) -> Overrides {
        self.tolerant().map(|r| r.specimen_with(self.study, deviations)).unwrap_or_default()
    }

    /// The random numbers of its sensors; `None` if these are perfect.
    pub fn noise(self) -> Option<NormalDeviates> {
        let realism = self.study.realism.as_ref().filter(|_| self.setting.has_noise());
        realism.map(|realism| realism.noise(self.lot, self.number))
    }

    fn tolerant(self) -> Option<&'s Realism> {
        self.study.realism.as_ref().filter(|_| self.setting.has_tolerances())
    }
}
