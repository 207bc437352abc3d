//! The answers to the samples of the start test, as every build must compute them to the bit.
//!
//! The same samples and the same mixture are in `servotwin_session.c` and `servotwin_twin.c`.

use crate::error::ExportError;
use crate::notation::{write_list, write_public};
use crate::twin::ExportedTwin;
use servotwin_diagnosis::diagnoser::environment::InputRange;
use servotwin_diagnosis::diagnoser::{Diagnoser, Session};
use servotwin_diagnosis::random::Random;
use servotwin_diagnosis::sliding::WindowSpan;
use servotwin_model::c_source::hexadecimal;
use servotwin_model::program::Slot;
use servotwin_model::solver::{self, Knot};
use std::sync::Arc;

/// Panes through the diagnosis after the first full window: `KNOWN_PANES` of the C text.
const PANES: u32 = 3;

/// Samples through the twin: `KNOWN_SAMPLES` of the C text.
const TWIN_SAMPLES: u32 = 8;

/// A mixture of the bits of numbers (FNV-1a, a word at a time).
struct Mixture(u64);

impl Mixture {
    fn new() -> Self {
        Mixture(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, number: f64) {
        let number = if number.is_nan() { f64::NAN } else { number };
        self.0 = (self.0 ^ number.to_bits()).wrapping_mul(0x0100_0000_01b3);
    }
}

/// Writes plausible inputs, and the answer of the diagnosis.
pub(super) fn write(text: &mut String, diagnoser: &Diagnoser) -> Result<(), ExportError> {
    let inputs = center(diagnoser, &mut Random::new(6));
    let entries: Vec<String> = inputs.iter().map(|&input| hexadecimal(input)).collect();
    write_list(text, "double", "known_inputs", &entries, "0x0p+0");
    let answer = of_diagnosis(diagnoser, &inputs)?;
    write_public(text, "uint64_t", "known_answer", &literal(answer));
    Ok(())
}

fn literal(answer: u64) -> String {
    format!("0x{answer:016x}U")
}

/// The mixture of what a session finds in its first windows.
fn of_diagnosis(diagnoser: &Diagnoser, inputs: &[f64]) -> Result<u64, ExportError> {
    let mut session = Session::new(Arc::new(diagnoser.clone()))?.at_rest();
    let WindowSpan { pane_samples, panes } = diagnoser.lengths[0].span;
    let samples = (pane_samples * (panes + PANES)) as usize;
    let ranges = &diagnoser.environment.inputs;
    let mut mixture = Mixture::new();
    for k in 0..samples {
        let moved = inputs.iter().zip(ranges).map(|(input, range)| {
            let step = (range.largest - range.least) * 2f64.powi(-20);
            if k % 2 == 1 { input + step } else { *input }
        });
        let moved: Vec<f64> = moved.collect();
        moved.iter().for_each(|&input| mixture.add(input));
        let sensors = || diagnoser.sensors.iter().enumerate();
        let part = |count: usize, parts: f64| count as f64 / parts;
        let twin: Vec<f64> =
            sensors().map(|(s, sensor)| sensor.scale * part((5 * k + 3 * s) % 17, 16.0)).collect();
        let measured: Vec<f64> = sensors()
            .map(|(s, sensor)| twin[s] + sensor.scale * part(1 + (7 * k + 11 * s) % 13, 8.0))
            .collect();
        session.push(&moved, &measured, &twin);
    }
    session.features(0).iter().flatten().for_each(|&feature| mixture.add(feature));
    let names = diagnoser.names();
    let hypotheses = (0..names.actuators.len())
        .flat_map(|actuator| (0..names.actions.len()).map(move |action| (actuator, action)));
    mixture.add(session.probability(0, None));
    for (actuator, action) in hypotheses {
        mixture.add(session.probability(0, Some((actuator, action))));
        mixture.add(session.evidence(0, actuator, action));
    }
    for actuator in 0..names.actuators.len() {
        mixture.add(session.evidence_of_actuator(0, actuator));
        mixture.add(session.common_mode(0, actuator));
    }
    for boundary in 0..diagnoser.boundaries.len() {
        mixture.add(session.boundary_evidence_nats(0, boundary));
    }
    let novelty = &diagnoser.lengths[0].novelty;
    if !novelty.classes.is_empty() {
        mixture.add(novelty.score(None, &session.features(0)[0]));
    }
    mixture.add(session.evidence_of_change(0));
    mixture.add(session.evidence_of_unknown(0));
    Ok(mixture.0)
}

/// The answer of the twin, as a constant.
pub(super) fn of_twin(twin: &ExportedTwin) -> String {
    let ExportedTwin { program, settings, period_s, .. } = *twin;
    let mut own = solver::Twin::new(program, settings, period_s, twin.between.clone());
    let parameters = program.parameters(&[]);
    own.load(&parameters);
    let inputs = program.network().inputs.iter();
    let mut knots: Vec<Knot> = inputs.map(|input| Knot::from(input.default)).collect();
    let mut is_well = own.settle(&knots, &program.first_guess(&parameters)).is_ok();
    let mut mixture = Mixture::new();
    for _ in 0..TWIN_SAMPLES {
        if !is_well {
            break;
        }
        for knot in &mut knots {
            let rise = (knot.value.abs() + 0.125) * 2f64.powi(-7);
            *knot = Knot { value: knot.value + rise, slope_per_s: rise / period_s };
            [knot.value, knot.slope_per_s].into_iter().for_each(|number| mixture.add(number));
        }
        is_well = own.step(&knots).is_ok();
    }
    if is_well {
        let slots = 0..program.derivatives().end;
        slots.for_each(|slot| mixture.add(own.value(slot as Slot)));
    }
    literal(mixture.0)
}

/// Inputs that are plausible alone and together, as far as some are found.
pub(crate) fn center(diagnoser: &Diagnoser, random: &mut Random) -> Vec<f64> {
    let environment = &diagnoser.environment;
    let place = |name: &str| environment.inputs.iter().position(|input| input.name == name);
    let mut values = Vec::new();
    for _ in 0..1000 {
        let inside =
            |input: &InputRange, share: f64| input.least + share * (input.largest - input.least);
        values = environment.inputs.iter().map(|i| inside(i, random.between(0.1, 0.9))).collect();
        let holds = environment.differences.iter().all(|difference| {
            let pair = place(&difference.of).zip(place(&difference.minus));
            let of = pair.map_or(0.0, |(of, minus)| values[of] - values[minus]);
            of > difference.least && of < difference.largest
        });
        if holds {
            break;
        }
    }
    values
}
