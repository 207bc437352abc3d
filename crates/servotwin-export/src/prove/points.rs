//! The equations of a twin and their gradients at random points, also at those that no flight reaches: trajectories do not
//! take every branch.

use super::ProofEvidence;
use super::library::{Compiled, PointOf, RunningTwin};
use crate::error::ExportError;
use crate::twin::ExportedTwin;
use servotwin_diagnosis::random::Random;
use servotwin_model::program::{FaultAt, Program};
use servotwin_model::solver::StepMemory;

/// How far states go from their first guess, in parts of their scale: 1e-4 to 3, evenly on a logarithmic scale.
const NEAREST: f64 = -4.0;
const FARTHEST: f64 = 0.5;

/// The share of faults of the catalog that a point has.
const FAULTY: f64 = 0.2;

/// A point at which the equations are evaluated.
struct Point {
    parameters: Vec<Vec<f64>>,
    intensities: Vec<f64>,
    /// States, inputs and held values.
    given: Vec<f64>,
    slopes: Vec<f64>,
}

fn point(twin: &ExportedTwin, random: &mut Random) -> Point {
    let program = twin.program;
    let mut intensity = || if random.unit() < FAULTY { random.unit() } else { 0.0 };
    let faults = program.faults().map(|(component, fault)| FaultAt {
        component,
        fault,
        intensity: intensity(),
    });
    let faults: Vec<FaultAt> = faults.collect();
    let parameters = program.parameters(&faults);
    let exponent = random.between(NEAREST, FARTHEST);
    let mut near =
        |center: f64, scale: f64| center + scale * 10f64.powf(exponent) * random.between(-1.0, 1.0);
    let guess = program.first_guess(&parameters);
    let states = program.states().iter().zip(guess).map(|(state, guess)| near(guess, state.scale));
    let mut given: Vec<f64> = states.collect();
    let inputs = program.network().inputs.iter().zip(&twin.ranges);
    given.extend(inputs.map(|(input, [least, largest])| near(input.default, largest - least)));
    let stand_ins = program.stand_in_values(&parameters);
    given.extend(
        (0..stand_ins.len()).map(
            |place| {
                if program.is_held(place) { near(0.0, 1.0) } else { f64::NAN }
            },
        ),
    );
    let slopes = (0..program.externals().len()).map(|_| near(0.0, 1.0)).collect();
    Point {
        intensities: faults.iter().map(|fault| fault.intensity).collect(),
        parameters,
        given,
        slopes,
    }
}

/// Compares so many points in all builds.
pub(super) fn compare(
    twin: &ExportedTwin,
    compiled: &[Compiled],
    points: u64,
    evidence: &mut [ProofEvidence],
) -> Result<(), ExportError> {
    let program = twin.program;
    let mut random = Random::new(4);
    let others = compiled.iter().map(|compiled| compiled.twin(program));
    let mut others = others.collect::<Result<Vec<_>, _>>()?;
    let ticks = (0..program.clock_periods_s().count()).map(PointOf::Tick);
    let kinds: Vec<PointOf> =
        [PointOf::Gradients, PointOf::Motion, PointOf::All].into_iter().chain(ticks).collect();
    for number in 0..points {
        let point = point(twin, &mut random);
        for &kind in &kinds {
            let right = own(program, &point, kind);
            for (other, evidence) in others.iter_mut().zip(evidence.iter_mut()) {
                other.point(kind, &point.intensities, &point.given, &point.slopes);
                if !same(&right, &of_other(program, other, kind)) {
                    evidence.differ(
                        "equations of the twin".into(),
                        format!("{kind:?} at point {number}"),
                    );
                    return Ok(());
                }
            }
        }
        evidence.iter_mut().for_each(|evidence| evidence.points += 1);
    }
    Ok(())
}

/// The numbers that an evaluation gives.
fn own(program: &Program, point: &Point, kind: PointOf) -> Vec<f64> {
    let mut memory = StepMemory::<f64>::new(program);
    memory.set_constants(0, &program.block_constants(&point.parameters));
    let (states, held) = point.given.split_at(program.states().len());
    memory.set_states(0, states);
    for (&value, slot) in held.iter().zip(program.externals().start..) {
        memory.set_variable(0, slot, value);
    }
    let stand_ins = program.stand_in_values(&point.parameters).into_iter().enumerate();
    for (place, value) in stand_ins.filter(|(place, _)| !program.is_held(*place)) {
        memory.set_variable(0, program.stand_ins().start + place, value);
    }
    for (input, &slope) in point.slopes.iter().enumerate() {
        let value = memory.variable(0, program.externals().start + input);
        memory.set_input(input, |_| [value, slope, 0.0, 0.0]);
    }
    match kind {
        PointOf::Gradients | PointOf::Motion => memory.begin(),
        PointOf::All | PointOf::Tick(_) => memory.evaluate(),
    }
    if let PointOf::Tick(clock) = kind {
        memory.tick(clock, true);
    }
    let variables: Vec<f64> = (0..program.slots()).map(|slot| memory.variable(0, slot)).collect();
    numbers(program, &variables, memory.gradients(), kind)
}

fn of_other(program: &Program, other: &RunningTwin, kind: PointOf) -> Vec<f64> {
    let gradients = other.gradients(program.jacobian().slots());
    numbers(program, other.variables(), gradients, kind)
}

/// What an evaluation of this kind gives, out of all variables and gradients.
fn numbers(program: &Program, variables: &[f64], gradients: &[f64], kind: PointOf) -> Vec<f64> {
    match kind {
        PointOf::Motion => variables[program.derivatives()].to_vec(),
        PointOf::All | PointOf::Tick(_) => variables.to_vec(),
        PointOf::Gradients => {
            let mut slopes = vec![0.0; program.states().len()];
            program.jacobian().add_time_derivative(1.0, gradients, &mut slopes);
            let entries = program.jacobian().values(gradients).map(|(_, _, value)| value);
            variables.iter().copied().chain(entries).chain(slopes).collect()
        }
    }
}

/// Whether the bits are equal; any two NaN are.
fn same(a: &[f64], b: &[f64]) -> bool {
    let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
    a.len() == b.len() && a.iter().zip(b).all(same)
}
