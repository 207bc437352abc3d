//! The twin beside its C text: random inputs, faults that are there at the start and faults that begin on the way.

use super::ProofEvidence;
use super::library::{Compiled, RunningTwin};
use crate::error::ExportError;
use crate::twin::ExportedTwin;
use servotwin_diagnosis::random::Random;
use servotwin_model::program::{FaultAt, Slot};
use servotwin_model::solver::{self, Knot};

/// How far inputs go from their defaults, in parts of their range.
const REACH: f64 = 0.05;

/// The longest time until an input turns, in samples, and the share of jumps.
const LONGEST: usize = 200;
const JUMPS: f64 = 0.2;

/// The share of variants whose inputs begin anywhere in their range. Few of these find a steady state.
const WILD: f64 = 0.3;

/// Inputs that wander about their defaults.
pub(super) struct Inputs<'t> {
    twin: &'t ExportedTwin<'t>,
    random: Random,
    /// The step of each sample, and samples until it changes.
    courses: Vec<(f64, usize)>,
    knots: Vec<Knot>,
}

impl<'t> Inputs<'t> {
    pub(crate) fn new(twin: &'t ExportedTwin, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let is_wild = random.unit() < WILD;
        let inputs = twin.program.network().inputs.iter().zip(&twin.ranges);
        let knots = inputs.map(|(input, [least, largest])| {
            Knot::from(if is_wild { random.between(*least, *largest) } else { input.default })
        });
        let knots: Vec<Knot> = knots.collect();
        Inputs { twin, courses: vec![(0.0, 0); knots.len()], knots, random }
    }

    /// The inputs at the next sample.
    pub(crate) fn next(&mut self) -> &[Knot] {
        let Inputs { twin, random, courses, knots } = self;
        let inputs = twin.program.network().inputs.iter().zip(&twin.ranges);
        for (((step, left), knot), (input, [least, largest])) in
            courses.iter_mut().zip(knots.iter_mut()).zip(inputs)
        {
            if *left == 0 {
                let reach = REACH * (largest - least);
                let goal =
                    (input.default + reach * random.between(-1.0, 1.0)).clamp(*least, *largest);
                *left = if random.unit() < JUMPS { 1 } else { 1 + random.index(LONGEST) };
                *step = (goal - knot.value) / *left as f64;
            }
            *left -= 1;
            // Slopes that differ from the steps, so that the curves bend.
            let slope_per_s = random.between(0.0, 2.0) * *step / twin.period_s;
            *knot = Knot { value: knot.value + *step, slope_per_s };
        }
        knots
    }
}

/// Runs so many twins with random faults for this duration, s, in Rust and in all builds. `tell` hears the number of
/// variants so far.
pub(super) fn compare(
    twin: &ExportedTwin,
    compiled: &[Compiled],
    (variants, duration_s): (u64, f64),
    evidence: &mut [ProofEvidence],
    tell: &mut dyn FnMut(u64),
) -> Result<(), ExportError> {
    let mut random = Random::new(3);
    let faults: Vec<(usize, usize)> = twin.program.faults().collect();
    let others = compiled.iter().map(|compiled| compiled.twin(twin.program));
    let mut others = others.collect::<Result<Vec<_>, _>>()?;
    for (other, evidence) in others.iter_mut().zip(evidence.iter_mut()) {
        if !other.is_exact() {
            evidence.differ("start test".into(), "the twin computes otherwise".into());
        }
    }
    for seed in 0..variants {
        let place = random.index(faults.len());
        let intensity = random.unit();
        let fault = faults
            .get(place)
            .map(|&(component, fault)| (place, FaultAt { component, fault, intensity }));
        let begins_late = random.unit() < 0.5;
        Run { twin, duration_s, fault, begins_late, seed }.compare(&mut others, evidence);
        tell(seed + 1);
        if evidence.iter().any(ProofEvidence::has_enough) {
            break;
        }
    }
    Ok(())
}

/// A run of one variant.
struct Run<'r> {
    twin: &'r ExportedTwin<'r>,
    duration_s: f64,
    /// The fault, and its place in the catalog.
    fault: Option<(usize, FaultAt)>,
    begins_late: bool,
    seed: u64,
}

impl Run<'_> {
    /// Parameters by component, and the intensity of every fault of the catalog.
    fn parameters(&self, is_faulty: bool) -> (Vec<Vec<f64>>, Vec<f64>) {
        let program = self.twin.program;
        let fault = self.fault.filter(|_| is_faulty);
        let mut intensities = vec![0.0; program.faults().count()];
        if let Some((place, fault)) = fault {
            intensities[place] = fault.intensity;
        }
        let faults: Vec<FaultAt> = fault.into_iter().map(|(_, fault)| fault).collect();
        (program.parameters(&faults), intensities)
    }

    fn compare(&self, others: &mut [RunningTwin], evidence: &mut [ProofEvidence]) {
        let ExportedTwin { program, settings, period_s, .. } = *self.twin;
        let mut own = solver::Twin::new(program, settings, period_s, self.twin.between.clone());
        let mut inputs = Inputs::new(self.twin, self.seed);
        let samples = (self.duration_s / period_s) as u64;
        let onset = samples / 3;
        for sample in 0..samples {
            let is_late = self.begins_late && sample == onset;
            let knots = inputs.next();
            let (parameters, intensities) = match sample == 0 || is_late {
                true => self.parameters(!self.begins_late || is_late),
                false => Default::default(),
            };
            if sample == 0 || is_late {
                own.load(&parameters);
            }
            let is_well = match sample {
                0 => own.settle(knots, &program.first_guess(&parameters)),
                _ => own.step(knots),
            }
            .is_ok();
            for (other, evidence) in others.iter_mut().zip(evidence.iter_mut()) {
                let other_is_well = match sample {
                    0 => other.start(&intensities, knots),
                    _ if is_late => other.step_with(&intensities, knots),
                    _ => other.step(knots),
                };
                evidence.twin_samples += 1;
                if is_well != other_is_well || is_well && !has_same_values(&own, other) {
                    let fault = self.fault;
                    evidence.differ(format!("twin with {fault:?}"), format!("sample {sample}"));
                    return;
                }
            }
            if !is_well {
                break;
            }
        }
        for evidence in evidence {
            evidence.variants += 1;
            evidence.unsettled += own.statistics().unsettled;
        }
    }
}

fn has_same_values(own: &solver::Twin, other: &RunningTwin) -> bool {
    let same = |(slot, value): (usize, &f64)| own.value(slot as Slot).to_bits() == value.to_bits();
    other.variables().iter().enumerate().all(same)
}
