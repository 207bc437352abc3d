//! Compares commands: which flight determines the unknowns best.
//!
//! The information of a record about the unknowns is JᵀJ, and J needs no measurement. Commands can therefore be
//! compared before any of them is flown. The gain of a command is the reduction of the uncertainty that tolerances
//! leave,
//!
//! (FD1)  gain = ½ (ln det(JᵀJ + Q) − ln det Q) / ln 2  in bits,
//!
//! and the command with the largest gain is D-optimal among those compared. Candidates are signals of the catalogue at
//! several frequencies and sizes. Sizes are the largest that the limits of amplitude and rate allow, or a fraction of
//! it, because overlaps and friction show in small motions. All are first compared on part of the time, the best ones
//! on all of it.

use super::record::FitRecord;
use super::response::{DerivativeScheme, Linear};
use super::{Fit, FitError, FitKnowledge};
use crate::signal::Signal;
use crate::study::Study;
use crate::units;
use servotwin_model::signal::Piecewise;
use servotwin_model::spec::Unit;

/// The limits of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The largest amplitude, in the input's unit.
    pub amplitude: f64,
    /// The largest rate, in the input's unit per second.
    pub rate: f64,
    /// Duration of the flight, s.
    pub duration_s: f64,
}

/// A command and its expected information.
#[derive(Clone, Debug)]
pub struct Design {
    /// The command.
    pub command: Command,
    /// Information gain (FD1), bits.
    pub gain: f64,
    /// How well each unknown would be known.
    pub known: FitKnowledge,
}

/// A command within its limits.
#[derive(Clone, Debug)]
pub struct Command {
    /// Its text in signal syntax.
    pub text: String,
    /// Its largest amplitude, in the input's unit.
    pub amplitude: f64,
    /// Its largest rate, in the input's unit per second.
    pub rate: f64,
    signal: Piecewise,
}

/// Fractions of the largest allowed size that are compared.
const PARTS: [f64; 3] = [1.0, 0.5, 0.2];
/// Number of commands compared on the whole time.
const FINALISTS: usize = 5;
/// All commands are first compared on this fraction of the time, and on at least this many seconds.
const SHARE: f64 = 1.0 / 3.0;
const LEAST_S: f64 = 10.0;
/// Sampling interval for measuring a command's size and rate, s.
const LOOK_S: f64 = 2e-3;

/// The candidate signals; `{a}` stands for a size.
fn shapes(duration_s: f64) -> Vec<String> {
    let mut list = Vec::new();
    for bandwidth in [0.2, 0.5, 1.0, 2.0, 4.0] {
        list.push(format!("noise:rms={{a}},bandwidth={bandwidth}Hz,seed=1"));
    }
    for frequency in [0.1, 0.3, 1.0, 2.0] {
        list.push(format!("sine:amplitude={{a}},frequency={frequency}Hz"));
    }
    for to in [0.5, 1.0, 3.0] {
        list.push(format!("sweep:amplitude={{a}},from=0.05Hz,to={to}Hz,length={duration_s}s"));
    }
    for frequency in [0.05, 0.2] {
        list.push(format!(
            "sine:amplitude={{a}},frequency={frequency}Hz + noise:rms={{b}},bandwidth=2Hz,seed=1"
        ));
    }
    list
}

impl Fit<'_> {
    /// The commands of a study with the largest information gain, the best first. The problem's records are not used.
    ///
    /// # Errors
    /// There is nothing to estimate, or it was stopped. Commands whose twin cannot be simulated are left out.
    pub fn design(&self, study: &Study, limits: Limits) -> Result<Vec<Design>, FitError> {
        if self.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        let unit = self.system.network().inputs[study.command_input].unit;
        let fit = |shape: &String| PARTS.map(|part| fitted(shape, unit, limits, part));
        let commands = shapes(limits.duration_s).iter().flat_map(fit).flatten().collect::<Vec<_>>();
        let part_s = (SHARE * limits.duration_s).max(LEAST_S).min(limits.duration_s);
        let coarse = self.compared(study, commands, part_s)?;
        let finalists = coarse.into_iter().take(FINALISTS).map(|design| design.command).collect();
        self.compared(study, finalists, limits.duration_s)
    }

    /// Compares commands over a given time, the best first.
    fn compared(
        &self,
        study: &Study,
        commands: Vec<Command>,
        duration_s: f64,
    ) -> Result<Vec<Design>, FitError> {
        let mut all = Vec::new();
        for command in commands {
            match self.judged_command(study, command, duration_s) {
                Ok(design) => all.push(design),
                Err(FitError::Run { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Ok(all)
    }

    fn judged_command(
        &self,
        study: &Study,
        command: Command,
        duration_s: f64,
    ) -> Result<Design, FitError> {
        let mut inputs = self.system.default_inputs();
        inputs[study.command_input] = command.signal.clone();
        let (sensors, period_s) =
            (study.measured[..study.base_sensors()].to_vec(), study.sample_period_s);
        let samples = (duration_s / period_s + 1e-6) as usize + 1;
        // J does not depend on the measured values.
        let measured = vec![0.0; samples * sensors.len()];
        let record = FitRecord::of_samples(&command.text, period_s, inputs, sensors, measured);
        let linear = self.of_record(record).linear(&self.nominal(), DerivativeScheme::Forward)?;
        let known = FitKnowledge::new(&self.unknowns, &linear.z, &linear);
        let known = known.ok_or(FitError::Undetermined)?;
        Ok(Design { command, gain: self.gain(&linear), known })
    }

    /// Information gain (FD1).
    fn gain(&self, linear: &Linear) -> f64 {
        let eigenvalues = linear.curvature.eigenvalues().into_iter();
        let after: f64 = eigenvalues.map(|value| value.max(f64::MIN_POSITIVE).ln()).sum();
        let before: f64 = self.priors().iter().map(|prior| prior.ln()).sum();
        0.5 * (after - before) / std::f64::consts::LN_2
    }
}

/// Scales a signal to a fraction of what the limits allow; `None` where the catalogue cannot build it.
fn fitted(shape: &str, unit: Unit, limits: Limits, part: f64) -> Option<Command> {
    // Starts from a small size, then corrects it up to three times, because signals with soft limits do not scale
    // linearly.
    let mut size = 0.05 * limits.amplitude;
    let mut command = built(shape, unit, size, limits)?;
    for _ in 0..3 {
        let room = (limits.amplitude / command.amplitude).min(limits.rate / command.rate);
        // A margin of 0.1 % covers extremes between two samples.
        size *= 0.999 * part * room;
        command = built(shape, unit, size, limits)?;
        if part < 1.0 {
            break;
        }
    }
    let is_kept = command.amplitude <= limits.amplitude && command.rate <= limits.rate;
    is_kept.then_some(command)
}

fn built(shape: &str, unit: Unit, size: f64, limits: Limits) -> Option<Command> {
    // The second part of a sum is a tenth of the first.
    let text =
        shape.replace("{a}", &written(size, unit)).replace("{b}", &written(0.1 * size, unit));
    let signal = text.parse::<Signal>().ok()?.build(unit, limits.duration_s).ok()?;
    let steps = (limits.duration_s / LOOK_S) as usize;
    let values = || (0..=steps).map(|k| signal.value(k as f64 * LOOK_S));
    let amplitude = values().fold(0.0, |most: f64, value| most.max(value.abs()));
    let moved = values().zip(values().skip(1)).map(|(before, after)| (after - before).abs());
    let rate = moved.fold(0.0, f64::max) / LOOK_S;
    (amplitude > 0.0 && rate > 0.0).then_some(Command { text, signal, amplitude, rate })
}

/// A size in a display unit, rounded down to three digits.
fn written(size: f64, unit: Unit) -> String {
    let typed = units::typed(unit);
    let (value, symbol) = typed.map_or((size, ""), |typed| (size / typed.si, typed.symbol));
    let digit = 10_f64.powi(value.abs().max(1e-9).log10().floor() as i32 - 2);
    let value = (value / digit + 1e-9).floor() * digit;
    format!("{}{symbol}", format!("{value:.9}").trim_end_matches('0').trim_end_matches('.'))
}
