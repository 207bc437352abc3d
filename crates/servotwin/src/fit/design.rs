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

use super::linear::Symmetric;
use super::record::FitRecord;
use super::response::DerivativeScheme;
use super::{Fit, FitError, FitKnowledge};
use crate::signal::Signal;
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

/// Where a command is applied and what is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The index of the driven input; the others stay at their defaults.
    pub input: usize,
    /// The indices of the measured sensors in the system's list.
    pub sensors: Vec<usize>,
    /// Time between samples, s.
    pub period_s: f64,
}

/// A command and its expected information.
#[derive(Clone, Debug)]
pub struct Design {
    /// The command's text in signal syntax.
    pub command: String,
    /// Information gain (FD1), bits.
    pub gain: f64,
    /// Its largest amplitude, in the input's unit.
    pub amplitude: f64,
    /// Its largest rate, in the input's unit per second.
    pub rate: f64,
    /// How well each unknown would be known.
    pub known: FitKnowledge,
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
    /// The commands with the largest information gain, the best first. The problem's records are not used.
    ///
    /// # Errors
    /// There is nothing to estimate, or it was stopped. Commands whose twin cannot be simulated are left out.
    pub fn design(&self, rig: &Rig, limits: Limits) -> Result<Vec<Design>, FitError> {
        if self.unknowns.is_empty() {
            return Err(FitError::NoUnknown);
        }
        let unit = self.system.network().inputs[rig.input].unit;
        let fit = |shape: &String| PARTS.map(|part| fitted(shape, unit, limits, part));
        let commands = shapes(limits.duration_s).iter().flat_map(fit).flatten().collect::<Vec<_>>();
        let part_s = (SHARE * limits.duration_s).max(LEAST_S).min(limits.duration_s);
        let mut coarse = self.compared(rig, commands, part_s)?;
        coarse.truncate(FINALISTS);
        let finalists = coarse.into_iter().map(|(_, command)| command).collect();
        self.compared(rig, finalists, limits.duration_s)
            .map(|all| all.into_iter().map(|(design, _)| design).collect())
    }

    /// Compares commands over a given time, the best first.
    fn compared(
        &self,
        rig: &Rig,
        commands: Vec<Command>,
        duration_s: f64,
    ) -> Result<Vec<(Design, Command)>, FitError> {
        let mut all = Vec::new();
        for command in commands {
            match self.judged_command(rig, &command, duration_s) {
                Ok(design) => all.push((design, command)),
                Err(FitError::Run { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        all.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
        Ok(all)
    }

    fn judged_command(
        &self,
        rig: &Rig,
        command: &Command,
        duration_s: f64,
    ) -> Result<Design, FitError> {
        let inputs = self.system.network().inputs.iter();
        let constant = |value| Piecewise::constant(value).expect("a default is finite");
        let mut inputs: Vec<Piecewise> = inputs.map(|input| constant(input.default)).collect();
        inputs[rig.input] = command.signal.clone();
        let samples = (duration_s / rig.period_s + 1e-6) as usize + 1;
        // J does not depend on the measured values.
        let measured = vec![0.0; samples * rig.sensors.len()];
        let sensors = rig.sensors.clone();
        let record = FitRecord::of_samples(&command.text, rig.period_s, inputs, sensors, measured);
        let own = Fit { records: vec![record], ..self.clone() };
        let nominal = self.nominal();
        let linear = own.linear(&nominal, DerivativeScheme::Forward)?;
        let known = FitKnowledge::new(&self.unknowns, &nominal, &linear.information);
        Ok(Design {
            command: command.text.clone(),
            gain: self.gain(&linear.information),
            amplitude: command.amplitude,
            rate: command.rate,
            known: known.ok_or(FitError::Undetermined)?,
        })
    }

    /// Information gain (FD1).
    pub(super) fn gain(&self, information: &Symmetric) -> f64 {
        let priors = self.priors();
        let logarithm = |matrix: &Symmetric| -> f64 {
            matrix.eigen().iter().map(|(value, _)| value.max(f64::MIN_POSITIVE).ln()).sum()
        };
        let before: f64 = priors.iter().map(|prior| prior.ln()).sum();
        0.5 * (logarithm(&information.plus_diagonal(&priors)) - before) / std::f64::consts::LN_2
    }
}

/// A command within its limits.
#[derive(Clone)]
struct Command {
    text: String,
    signal: Piecewise,
    amplitude: f64,
    rate: f64,
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
