//! The scenario *fitted*: every specimen flies a healthy calibration flight, its twin is fitted to that record, and
//! faults are diagnosed with the fitted twin.
//!
//! Specimens come from a pool, because a fit costs as much as several variants. A variant draws its specimen at random
//! from those of its case. With faults dealt in turn, each fault would always get the same specimen, and trees
//! would learn to recognize it.

use super::keys::SOME_SPECIMENS;
use super::reader::{Noted, Reader};
use super::{Flights, Purpose, Seed, Stream};
use crate::format::{At, Value, section};
use crate::signal::Signal;
use crate::toml_text::TextSpan;
use servotwin_model::hash::{Canonical, Fingerprint};
use servotwin_model::signal::Piecewise;

section! {
    /// The section of a study file.
    pub(super) struct Text {
        must command: At<Signal>, "command of the calibration flight";
        must duration_s: f64 = Value::Number(5.0, 1e4, "s"), "length of the calibration flight";
        must judge: usize = SOME_SPECIMENS, "number of specimens for the evaluation";
        must learn: usize = SOME_SPECIMENS, "number of specimens for the training commands";
        must in_each_case: At<usize> = SOME_SPECIMENS,
            "number of specimens in each group that run the same case";
    }
}

/// The calibration flight, and the specimens that fly it.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// One signal for each input of the system.
    pub(crate) inputs: Vec<Piecewise>,
    /// Length of the calibration flight, s.
    pub duration_s: f64,
    judge: usize,
    learn: usize,
    in_each_case: usize,
}

impl Calibration {
    pub(super) fn new(At { value: text, at }: &At<Text>, reader: &Reader) -> Result<Self, Noted> {
        needs_tolerances(reader, at)?;
        let Text { duration_s, judge, learn, .. } = *text;
        let in_each_case = text.in_each_case.value;
        let fits = in_each_case <= judge.min(learn);
        let allowed = "at most judge, and at most learn";
        let place = ("in_each_case", &text.in_each_case.at);
        reader.range(place, in_each_case as f64, fits, allowed)?;
        let command = reader.command_input()?;
        let mut inputs = reader.default_inputs();
        let signal = Ok(text.command.value.clone());
        let place = ("command", &text.command.at);
        inputs[command] = reader.signal(place, signal, command, duration_s)?;
        Ok(Self { inputs, duration_s, judge, learn, in_each_case })
    }

    /// The first test on the ground, to which the twin of every later one is fitted.
    pub(super) fn first_test(
        flights: &Flights,
        at: &TextSpan,
        reader: &Reader,
    ) -> Result<Self, Noted> {
        needs_tolerances(reader, at)?;
        let inputs = flights.varied.shared_middle(reader, flights.duration_s)?.inputs;
        let duration_s = flights.duration_s;
        Ok(Self { inputs, duration_s, judge: 1, learn: 1, in_each_case: 1 })
    }

    /// The number of specimens in a pool.
    pub fn specimens(&self, purpose: Purpose) -> usize {
        if purpose == Purpose::Train { self.learn } else { self.judge }
    }

    /// The index of a variant's specimen in its pool.
    /// `case` is the index of its operating case, and `seed` that of the variant.
    pub(crate) fn specimen(&self, purpose: Purpose, case: usize, seed: Seed) -> usize {
        let dealt = seed.choices(Stream::Pool).index(self.in_each_case);
        (case * self.in_each_case + dealt) % self.specimens(purpose)
    }
}

/// Specimens without tolerances would all equal their twins.
fn needs_tolerances(reader: &Reader, at: &TextSpan) -> Result<(), Noted> {
    match reader.text.realistic.as_ref().is_none_or(|realistic| realistic.tolerances.is_empty()) {
        true => Err(reader.empty(at, "realistic.tolerances")),
        false => Ok(()),
    }
}

impl Canonical for Calibration {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        let Calibration { inputs, duration_s, judge, learn, in_each_case } = self;
        fingerprint.add(inputs).add(duration_s).add(judge).add(learn).add(in_each_case);
    }
}
