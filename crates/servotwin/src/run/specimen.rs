//! Specimens: plants with their own tolerances.

use super::Run;
use crate::signal::random::NormalDeviates;
use crate::study::{Plants, Realism, Scenario, Seed, Stream, Study, Suite};

/// Parameters that differ from the system's: (component, parameter, value).
pub(crate) type Overrides = Vec<(usize, usize, f64)>;

/// A draw of a study's random numbers: a specimen, and the noise of its sensors. It depends on the seed alone.
#[derive(Clone, Copy)]
pub(crate) struct SpecimenDraw<'s> {
    pub(crate) study: &'s Study,
    /// The scenario: whether specimens have tolerances, and sensors noise.
    pub(crate) scenario: Scenario,
    pub(crate) seed: Seed,
}

/// The number of a run's specimen among those whose twins are fitted; `None` where twins are nominal.
///
/// A specimen of the pool makes several records of an operating case. Flights have one specimen in each environment.
pub(crate) fn fitted_specimen(
    study: &Study,
    suite: &Suite,
    scenario: Scenario,
    run: &Run,
) -> Option<usize> {
    if !suite.is_fitted && scenario.plants() != Plants::Pool {
        return None;
    }
    let calibration = study.calibration.as_ref().filter(|_| suite.is_records);
    Some(calibration.map_or(run.environment, |calibration| {
        calibration.specimen(suite.purpose, run.environment, suite.seed_of(run.number))
    }))
}

impl<'s> SpecimenDraw<'s> {
    /// The draw of a run in a scenario, apart from the noise of its sensors.
    pub(crate) fn of(study: &'s Study, suite: &Suite, scenario: Scenario, run: &Run) -> Self {
        let fitted = fitted_specimen(study, suite, scenario, run);
        let seed = fitted.map_or(suite.seed_of(run.number), |number| suite.seed_of_fitted(number));
        SpecimenDraw { study, scenario, seed }
    }

    /// The specimen's parameters with tolerances, whose deviations are `scatter` times as large as declared; empty if
    /// plants equal their twins.
    pub(crate) fn parameters(self, scatter: f64) -> Overrides {
        let drawn = self.tolerant().map(|r| r.specimen(self.study, self.seed, scatter));
        drawn.unwrap_or_default()
    }

    /// The same for chosen deviations, one for each tolerance, in standard deviations.
    pub(crate) fn parameters_with(self, deviations: &[f64]) -> Overrides {
        self.tolerant().map(|r| r.specimen_with(self.study, deviations, 1.0)).unwrap_or_default()
    }

    /// The random numbers of its sensors in a stream; `None` if these are perfect.
    pub(crate) fn noise(self, stream: Stream) -> Option<NormalDeviates> {
        let is_noisy = self.study.realism.is_some() && self.scenario.has_noise();
        is_noisy.then(|| self.seed.stream(stream))
    }

    fn tolerant(self) -> Option<&'s Realism> {
        self.study.realism.as_ref().filter(|_| self.scenario.has_tolerances())
    }
}
