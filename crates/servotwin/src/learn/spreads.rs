//! Learns how the spread of a healthy residual grows with the flow through a valve ([`Spread`]).
//!
//! The first healthy flight of some environments of [`LEARN`] is flown once more. If r/d(g) has one variance at all spool
//! positions, the likelihood of the flights' scaled residuals r is largest for the true growth g:
//!
//! (SP2)  ln L(g)/n = −½ ln mean (r/d)² − mean ln d
//!
//! The growth with the largest likelihood of a few is taken; like sensors share one. The likelihood is that of independent
//! normal residuals, which these are not: it only ranks growths.
//!
//! Tests on the ground have no such growth. Their command is one and the same, and their twins are fitted: what is left
//! in fast motion is what shows the dynamics of a valve.

use crate::parallel::Workers;
use crate::run::runner::Runner;
use crate::run::{Observer, Run, RunError, plan};
use crate::study::suites::LEARN;
use crate::study::{Scenario, Study, Suite};
use servotwin_diagnosis::features::{Quantity, Sensor};
use servotwin_diagnosis::spread::{Reach, Spread};
use std::collections::BTreeMap;

/// Number of environments: their flights of 20 s have 96,000 samples of each sensor, to rank seven growths.
const ENVIRONMENTS: usize = 48;

/// The growths to choose from.
const GROWTHS: [f64; 7] = [0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0];

/// The gain in ln L per sample below which residuals do not grow enough, in nats. A spread narrows bands, so that what no
/// twin models, such as other friction, leaves them: it must gain more than it costs. Pressures and rams of the aileron
/// gain 0.01; with spreads for them too, the diagnosis raised an action in 28 instead of 1 of 1,200 healthy flights of plants
/// with another structure. Spools gain 0.6.
const MIN_GAIN_NATS: f64 = 0.03;

/// The sums of a sensor for each growth, over samples: (r/d)² and ln d.
type Sums = [[f64; 2]; GROWTHS.len()];

/// Sums up a flight.
struct Summing<'s> {
    spools: &'s [Option<usize>],
    scales: &'s [f64],
    reach: Reach,
    sums: Vec<Sums>,
    samples: usize,
}

impl Observer for Summing<'_> {
    fn sample(&mut self, _index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        self.samples += 1;
        let reach = self.reach.take(twin, self.scales);
        for (sensor, sums) in self.sums.iter_mut().enumerate() {
            let Some(spool) = self.spools[sensor] else { continue };
            let residual = (measured[sensor] - twin[sensor]) / self.scales[sensor];
            for (sum, growth) in sums.iter_mut().zip(GROWTHS) {
                let factor = Spread { spool: spool as u32, growth }.factor(reach[spool]);
                sum[0] += (residual / factor).powi(2);
                sum[1] += factor.ln();
            }
        }
    }
}

/// The spool sensor of each sensor's actuator; `None` without one.
fn spools(study: &Study) -> Vec<Option<usize>> {
    let sensors = &study.sensors.0[..study.base_sensors()];
    let spool_of = |actuator: usize| {
        let is_own = |s: &Sensor| s.quantity == Quantity::Spool && s.actuator == Some(actuator);
        sensors.iter().position(is_own)
    };
    sensors.iter().map(|s| s.actuator.and_then(spool_of)).collect()
}

/// The spread of each sensor in the healthy flights of a scenario; `None` where it does not grow.
///
/// # Errors
/// A twin cannot be simulated, or the run was cancelled.
pub(crate) fn learn(
    study: &Study,
    scenario: Scenario,
    pools: &[usize],
    workers: Workers,
) -> Result<Vec<Option<Spread>>, RunError> {
    let spools = spools(study);
    let mut spreads = vec![None; spools.len()];
    if let Some(suite) = study.suite(LEARN).filter(|_| !study.is_on_ground()) {
        let (sums, samples) = sums((study, suite), scenario, &spools, workers)?;
        for (sensor, spread) in spreads.iter_mut().enumerate() {
            let of_pool = (0..spools.len()).filter(|&other| pools[other] == pools[sensor]);
            let of_pool: Vec<Sums> = of_pool.map(|other| sums[other]).collect();
            let growth = most_likely(&of_pool, samples);
            *spread = spools[sensor]
                .filter(|_| growth > 0.0)
                .map(|spool| Spread { spool: spool as u32, growth });
        }
    }
    Ok(spreads)
}

/// The sums of each sensor and the number of samples, of the first healthy runs of some environments.
fn sums(
    (study, suite): (&Study, &Suite),
    scenario: Scenario,
    spools: &[Option<usize>],
    workers: Workers,
) -> Result<(Vec<Sums>, usize), RunError> {
    let environments = 0..suite.environments.min(ENVIRONMENTS);
    let mut first: BTreeMap<usize, Run> = BTreeMap::new();
    for run in plan::runs(study, suite, &environments).into_iter().filter(Run::is_healthy) {
        first.entry(run.environment).or_insert(run);
    }
    let runs = first.into_values().collect();
    let flown = Runner::new(study, suite, (scenario, None), runs, workers)?;
    let scales = &study.scales()[..spools.len()];
    let mut all: BTreeMap<usize, (Vec<Sums>, usize)> = BTreeMap::new();
    flown.fly(
        |_| Summing {
            spools,
            scales,
            reach: Reach::new(spools.len(), study.sample_period_s),
            sums: vec![Sums::default(); spools.len()],
            samples: 0,
        },
        |run, own, outcome| {
            if outcome.as_ref().is_ok_and(|work| !flown.is_on_the_move(run, work)) {
                all.insert(run.number, (own.sums, own.samples));
            }
        },
    );
    if workers.is_cancelled() {
        return Err(RunError::Cancelled);
    }
    // In the order of the runs, so that the sums do not depend on the threads.
    let mut total = (vec![Sums::default(); spools.len()], 0);
    for (sums, samples) in all.into_values() {
        total.1 += samples;
        for (total, own) in total.0.iter_mut().flatten().zip(sums.iter().flatten()) {
            total.iter_mut().zip(own).for_each(|(total, own)| *total += own);
        }
    }
    Ok(total)
}

/// The most likely growth of like sensors with these sums; 0 if it gains little.
fn most_likely(like: &[Sums], samples: usize) -> f64 {
    let count = (like.len() * samples) as f64;
    let likelihood = |growth: usize| {
        let sum = |part: usize| like.iter().map(|sums| sums[growth][part]).sum::<f64>();
        -0.5 * (sum(0) / count).ln() - sum(1) / count
    };
    let all: Vec<f64> = (0..GROWTHS.len()).map(likelihood).collect();
    let best = (0..all.len()).fold(0, |best, own| if all[own] > all[best] { own } else { best });
    if all[best] - all[0] > MIN_GAIN_NATS { GROWTHS[best] } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin_diagnosis::random::Random;

    fn found(growth: f64) -> f64 {
        let mut summing = Summing {
            spools: &[Some(0)],
            scales: &[1.0],
            reach: Reach::new(1, 1e9),
            sums: vec![Sums::default()],
            samples: 0,
        };
        let mut random = Random::stream(1, 1);
        for index in 0..20_000 {
            let displacement = 0.3 * (2.0 * random.unit() - 1.0);
            let size = 0.01 * (1.0 + growth * displacement.abs());
            let residual = size * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0);
            summing.sample(index, &[displacement + residual], &[displacement], &[]);
        }
        most_likely(&summing.sums, summing.samples)
    }

    #[test]
    fn the_growth_of_residuals_is_found_and_none_where_there_is_none() {
        for growth in [0.0, 3.0, 30.0, 100.0] {
            assert_eq!(found(growth), growth);
        }
        assert_eq!(most_likely(&[Sums::default()], 0), 0.0, "no flight");
    }
}
