//! What stands between the variables of a plant and the values that a diagnosis receives: latencies, noise, and the
//! steps of converters.

use crate::signal::random::NormalDeviates;
use crate::study::Study;
use crate::system::imperfection::Imperfection;

/// The sensors of one plant in one run.
pub(crate) struct SensorChain {
    /// Noise and converter steps with their random numbers; `None` for perfect sensors.
    noise: Option<(Vec<Imperfection>, NormalDeviates)>,
    /// The latency of each sensor, at most one sample, in samples; empty without latencies.
    latencies: Vec<f64>,
    /// The variables at the sample before.
    before: Vec<f64>,
}

impl SensorChain {
    /// The first `count` measured sensors of a study. They are perfect without random numbers for their noise.
    pub(crate) fn new(study: &Study, count: usize, noise: Option<NormalDeviates>) -> Self {
        let of = |&sensor: &usize| Imperfection::of(&study.system, sensor);
        let noise = noise.map(|noise| (study.measured[..count].iter().map(of).collect(), noise));
        SensorChain { noise, latencies: vec![], before: vec![] }
    }

    /// The same with a latency of each sensor, in samples, at most one.
    pub(crate) fn with_latencies(self, latencies: Vec<f64>) -> Self {
        SensorChain { latencies, ..self }
    }

    /// Turns the variables of the next sample into measured values.
    pub(crate) fn measure(&mut self, sample: &mut [f64]) {
        if !self.latencies.is_empty() {
            self.delay(sample);
        }
        if let Some((imperfections, noise)) = &mut self.noise {
            for (value, own) in sample.iter_mut().zip(imperfections) {
                *value = own.apply(*value, noise);
            }
        }
    }

    /// Interpolates linearly between the samples.
    fn delay(&mut self, sample: &mut [f64]) {
        if self.before.is_empty() {
            self.before = sample.to_vec();
        }
        let both = sample.iter_mut().zip(&mut self.before).zip(&self.latencies);
        for ((value, before), share) in both {
            let now = *value;
            *value = now + (*before - now) * share;
            *before = now;
        }
    }
}
