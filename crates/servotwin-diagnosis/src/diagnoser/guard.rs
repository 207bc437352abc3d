//! The first value of a session: whether a sample may be judged, and the values to judge.
//!
//! Behind an implausible input nothing is judged, and afterwards the twin settles first. An input may be missing for a
//! moment: the twin then goes on without it, and nothing is judged until the twin has recovered. A sensor without usable
//! values is *lost* after some samples. The diagnosis then continues with a stand-in value, the twin's with the noise of a
//! healthy sensor, unless too many sensors are lost.
//!
//! Trees and ranges learned residuals with the declared noise, and nothing resembles these without it. A sensor that is
//! quieter than half of its declared noise therefore gets that noise. Its own is measured by the differences of
//! successive residuals, which hardly contain their motion:
//!
//! ```text
//! σ² ≈ ½ ⟨(r_k − r_{k−1})²⟩
//! ```
//!
//! Source: von Neumann, "Distribution of the Ratio of the Mean Square Successive Difference to the Variance", Annals of
//! Mathematical Statistics 12, 1941.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::environment::{InputChecks, InputDifference, InputRange, Why};
use super::outcome::{Alarm, IndexedFinding};
use super::{DiagnosedSensor, Diagnoser, LARGEST_COUNT};
use crate::error::{Error, require_sound};
use crate::features::Sensor;
use crate::random::Random;

/// Upper limit of residuals and twin signals, in parts of scale; larger ones are no measurements.
const PLAUSIBLE: f64 = 1e6;

/// A sensor is quiet if its variance is below the declared one by this factor: half of the declared deviation.
const QUIET: f64 = 4.0;

/// The number of differences of successive residuals from which the noise of a sensor is measured. They give its variance to
/// a fifth, so healthy sensors are never quiet.
const NOISE_DIFFERENCES: u64 = 100;

/// The largest square of a difference that counts, in parts of its mean by the declared noise: a residual that jumps says
/// nothing about noise.
const LARGEST_DIFFERENCE: f64 = 4.0;

/// What a session receives at once, in the order of its diagnoser.
#[derive(Debug, Clone, Copy)]
pub(super) struct Received<'s> {
    pub(crate) inputs: &'s [f64],
    /// NaN means missing.
    pub(crate) measured: &'s [f64],
    pub(crate) twin: &'s [f64],
    /// Number of the sample.
    pub(crate) sample: u64,
}

/// Whether a sample is judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Admission {
    /// [`Guard::measured`] holds the values to judge.
    Judged,
    /// The twin settles.
    Settling,
    /// An input is missing for a moment, or the twin recovers from that: nothing changes.
    Passed,
    /// Values are missing or wrong, for so many consecutive samples.
    Unusable(Alarm, u64),
    /// An input is implausible: the twin's values mean nothing.
    Implausible(IndexedFinding),
}

/// The checks of a session, with their state.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    /// Number of repetitions from which each input counts as frozen.
    frozen_after: Vec<Option<u64>>,
    /// Indices of both inputs of each difference.
    pairs: Vec<[usize; 2]>,
    /// Number of consecutive samples for which the twin goes on without an input.
    held_samples: u64,
    /// Number of samples that the twin then needs to recover.
    recover_samples: u64,
    /// Number of consecutive samples after which a sensor counts as lost, and as back.
    until_lost: u64,
    until_back: u64,
    /// Number of samples that are not judged after a start or a restart.
    settle_samples: u64,
    /// For each sensor, the noise of a value that stands in for it, in parts of scale.
    noise: Vec<f64>,
    /// For each sensor, the corresponding ones of the other actuators; none where actuators are not alike.
    peers: Vec<Vec<usize>>,
    /// The measured values, with stand-ins for masked and lost sensors.
    pub(crate) measured: Vec<f64>,
    /// The sensors with stand-in values.
    pub(crate) stands_in: Vec<bool>,
    /// The sensors whose corresponding one of another actuator has a stand-in value.
    pub(crate) unpaired: Vec<bool>,
    pub(crate) state: GuardState,
}

/// What a guard remembers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GuardState {
    /// For each input the bits of its last value, NaN before the first, and its repetitions.
    inputs: Vec<(u64, u64)>,
    /// Consecutive samples in which an input is missing.
    missing: u64,
    /// Remaining samples until the twin has recovered from missing inputs.
    recovering: u64,
    /// Remaining samples while the twin settles.
    settling: u64,
    /// Consecutive samples without usable values.
    gap: u64,
    sensors: Vec<SensorState>,
}

/// What a guard remembers of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorState {
    is_taken_out: bool,
    is_lost: bool,
    /// Consecutive samples that contradict `is_lost`.
    against: u64,
    /// The last residual, in parts of scale, of a sensor that is there.
    last: Option<f64>,
    /// Number of differences between successive residuals, up to those that are remembered, and half of their mean
    /// square.
    differences: u64,
    variance: f64,
}

impl Guard {
    pub(super) fn new(diagnoser: &Diagnoser) -> Self {
        let checks = &diagnoser.environment;
        let period_s = diagnoser.period_s;
        let frozen_after = |input: &InputRange| input.frozen_after_samples(period_s);
        let pair = |d: &InputDifference| Some([checks.place(&d.of)?, checks.place(&d.minus)?]);
        let sensors = diagnoser.sensors.len();
        let state = GuardState {
            inputs: vec![(0, 0); checks.inputs.len()],
            missing: 0,
            recovering: 0,
            settling: 0,
            gap: 0,
            sensors: vec![SensorState::default(); sensors],
        };
        let settle_samples = diagnoser.samples(diagnoser.tuning.settle_s);
        let seen = diagnoser.sensors_seen();
        let rotations = seen.rotations(diagnoser.views()).unwrap_or_default();
        let peers = |sensor: usize| rotations.iter().map(|order| order[sensor]).collect();
        let mut guard = Guard {
            frozen_after: checks.inputs.iter().map(frozen_after).collect(),
            pairs: checks.differences.iter().filter_map(pair).collect(),
            held_samples: diagnoser.samples(diagnoser.tuning.input_held_s),
            recover_samples: diagnoser.samples(diagnoser.tuning.input_recover_s),
            until_lost: diagnoser.samples(diagnoser.tuning.no_data_after_s).max(1),
            until_back: settle_samples.max(1),
            settle_samples,
            noise: seen.0.iter().map(Sensor::noise_of_stand_in).collect(),
            peers: (0..sensors).map(peers).collect(),
            measured: vec![0.0; sensors],
            stands_in: vec![false; sensors],
            unpaired: vec![false; sensors],
            state,
        };
        guard.reset();
        guard
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        self.state.inputs.fill((f64::NAN.to_bits(), 0));
        self.state.sensors.fill(SensorState::default());
        (self.state.missing, self.state.recovering, self.state.gap) = (0, 0, 0);
        self.settle();
    }

    /// Judges no sample until the twin has settled.
    pub(super) fn settle(&mut self) {
        self.state.settling = self.settle_samples;
    }

    /// The twin has settled already.
    pub(super) fn has_settled(&mut self) {
        self.state.settling = 0;
    }

    /// Consecutive unusable samples from which the windows before them are worth nothing.
    pub(super) fn longest_gap(&self) -> u64 {
        self.until_lost
    }

    /// Takes a sensor out, or puts it back; `None` for an unknown sensor.
    pub(super) fn take_out(&mut self, sensor: usize, is_out: bool) -> Option<()> {
        self.state.sensors.get_mut(sensor)?.is_taken_out = is_out;
        Some(())
    }

    pub(super) fn is_lost(&self, sensor: usize) -> bool {
        self.state.sensors.get(sensor).is_some_and(|state| state.is_lost)
    }

    /// Number of lost sensors.
    pub(super) fn lost(&self) -> u32 {
        self.state.sensors.iter().filter(|state| state.is_lost).count() as u32
    }

    /// Looks at a sample. The sensors of masked actuators get a stand-in value.
    pub(super) fn admit(
        &mut self,
        diagnoser: &Diagnoser,
        received: Received,
        is_masked: impl Fn(u32) -> bool,
    ) -> Admission {
        if let Some((input, why)) = self.implausible(&diagnoser.environment, received.inputs) {
            self.settle();
            self.state.recovering = 0;
            return Admission::Implausible(IndexedFinding::EnvironmentInvalid { input, why });
        }
        // The twin settles by its inputs, whether or not all sensors are there.
        let is_settled = self.state.settling == 0;
        self.state.settling = self.state.settling.saturating_sub(1);
        if self.state.missing > 0 {
            self.state.recovering = self.recover_samples;
            return Admission::Passed;
        }
        if let Err(alarm) = self.take_values(diagnoser, received, is_masked) {
            self.state.gap += 1;
            return Admission::Unusable(alarm, self.state.gap);
        }
        self.state.gap = 0;
        if self.state.recovering > 0 {
            self.state.recovering -= 1;
            return Admission::Passed;
        }
        if is_settled { Admission::Judged } else { Admission::Settling }
    }

    /// The first implausible input, if any. Values that a short list lacks count as missing. A value that is missing for a
    /// moment counts as the one before.
    fn implausible(&mut self, checks: &InputChecks, inputs: &[f64]) -> Option<(u32, Why)> {
        let told = |input: usize| inputs.get(input).copied().unwrap_or(f64::NAN);
        let is_missing = (0..checks.inputs.len()).any(|input| told(input).is_nan());
        self.state.missing = if is_missing { self.state.missing.saturating_add(1) } else { 0 };
        let mut first = None;
        for (place, input) in checks.inputs.iter().enumerate() {
            let is_frozen = !told(place).is_nan() && self.is_frozen(place, told(place));
            let why = input.wrong(self.held(place, told(place)));
            first =
                first.or(why.or(is_frozen.then_some(Why::Frozen)).map(|why| (place as u32, why)));
        }
        let contradiction = || {
            let value = |input: usize| self.held(input, told(input));
            let difference = |[of, minus]: [usize; 2]| value(of) - value(minus);
            let mut pairs = checks.differences.iter().zip(&self.pairs);
            let (_, [of, _]) =
                pairs.find(|(d, pair)| !(d.least..=d.largest).contains(&difference(**pair)))?;
            Some((*of as u32, Why::Contradicts))
        };
        first.or_else(contradiction)
    }

    /// A value, or the one before if it is missing and was not for long.
    fn held(&self, input: usize, told: f64) -> f64 {
        let is_held = told.is_nan() && self.state.missing <= self.held_samples;
        if is_held { f64::from_bits(self.state.inputs[input].0) } else { told }
    }

    fn is_frozen(&mut self, place: usize, value: f64) -> bool {
        let (last, repeats) = &mut self.state.inputs[place];
        *repeats = if *last == value.to_bits() { repeats.saturating_add(1) } else { 0 };
        *last = value.to_bits();
        self.frozen_after[place].is_some_and(|limit| *repeats >= limit)
    }

    /// Checks the values and copies them, with stand-ins; the alarm of unusable ones.
    fn take_values(
        &mut self,
        diagnoser: &Diagnoser,
        Received { measured, twin, sample, .. }: Received,
        is_masked: impl Fn(u32) -> bool,
    ) -> Result<(), Alarm> {
        let sensors = &diagnoser.sensors;
        if measured.len() != sensors.len() || twin.len() != sensors.len() {
            return Err(Alarm::Error);
        }
        let is_sound = |place: usize| (twin[place] / sensors[place].scale).abs() <= PLAUSIBLE;
        let usability = |place: usize, value: f64| match value {
            value if value.is_nan() => Err(Alarm::NoData),
            value if ((value - twin[place]) / sensors[place].scale).abs() > PLAUSIBLE => {
                Err(Alarm::Error)
            }
            _ => Ok(()),
        };
        for (place, sensor) in sensors.iter().enumerate() {
            let is_there = is_sound(place) && usability(place, measured[place]).is_ok();
            let state = &mut self.state.sensors[place];
            if state.is_taken_out || sensor.actuator.is_some_and(&is_masked) {
                (state.is_lost, state.against) = (false, 0);
            } else if is_sound(place) {
                let limit = if state.is_lost { self.until_back } else { self.until_lost };
                state.notice(is_there, limit);
            }
            let residual = is_there.then(|| (measured[place] - twin[place]) / sensor.scale);
            state.measure_noise(residual, self.noise[place]);
        }
        self.find_stand_ins(sensors, is_masked);
        let mut usable = Ok(());
        for (place, sensor) in sensors.iter().enumerate() {
            let noise = self.noise[place];
            let of_noise = || {
                let mut random = Random::stream(place as u64, sample + 1);
                sensor.scale * noise * normal(&mut random)
            };
            self.measured[place] = if self.stands_in[place] {
                twin[place] + of_noise()
            } else if self.state.sensors[place].is_quiet(noise) {
                measured[place] + of_noise()
            } else {
                measured[place]
            };
            usable = match usable {
                _ if !is_sound(place) => Err(Alarm::Error),
                Ok(()) => usability(place, self.measured[place]),
                wrong => wrong,
            };
        }
        if usable.is_ok() && self.is_blind(diagnoser) { Err(Alarm::NoData) } else { usable }
    }

    /// Finds the sensors with a stand-in value, and those that another actuator lacks.
    fn find_stand_ins(&mut self, sensors: &[DiagnosedSensor], is_masked: impl Fn(u32) -> bool) {
        let is_off = |place: usize| sensors[place].actuator.is_some_and(&is_masked);
        let lacks = |place: usize| {
            let state = &self.state.sensors[place];
            state.is_taken_out || state.is_lost
        };
        for (place, peers) in self.peers.iter().enumerate() {
            self.stands_in[place] = is_off(place) || lacks(place);
            self.unpaired[place] = peers.iter().any(|&peer| lacks(peer) && !is_off(peer));
        }
    }

    /// Whether too many of an actuator's sensors, or of all sensors, are lost: the rest does not suffice.
    fn is_blind(&self, diagnoser: &Diagnoser) -> bool {
        let has_lost_most = |actuator: Option<u32>| {
            let sensors = diagnoser.sensors.iter().zip(&self.state.sensors);
            let own =
                sensors.filter(|(sensor, _)| actuator.is_none() || sensor.actuator == actuator);
            let (count, lost) = own.fold((0, 0), |(count, lost), (_, state)| {
                (count + 1, lost + u32::from(state.is_lost))
            });
            f64::from(lost) > diagnoser.tuning.most_lost * f64::from(count)
        };
        let mut actuators = diagnoser.sensors.iter().map(|sensor| sensor.actuator);
        self.lost() > 0 && (has_lost_most(None) || actuators.any(has_lost_most))
    }

    /// Whether an actuator may be accused: where actuators are not alike, no other judged one lacks a sensor. A stand-in
    /// looks healthy, so a fault of the actuator without the sensor would look like one of its neighbor.
    pub(super) fn is_comparable(
        &self,
        diagnoser: &Diagnoser,
        actuator: usize,
        is_masked: impl Fn(u32) -> bool,
    ) -> bool {
        let sensors = diagnoser.sensors.iter().zip(&self.state.sensors);
        let mut sensors = sensors.zip(&self.peers);
        sensors.all(|((sensor, state), peers)| {
            let is_own = sensor.actuator.is_none_or(|own| own == actuator as u32);
            let is_there = !state.is_taken_out && !state.is_lost;
            is_own || is_there || !peers.is_empty() || sensor.actuator.is_some_and(&is_masked)
        })
    }

    /// Restores a state.
    ///
    /// # Errors
    /// [`Error::CorruptModel`] for one that a session of this diagnoser cannot have.
    pub(super) fn restore(&mut self, state: &GuardState) -> Result<(), Error> {
        let is_possible = |sensor: &SensorState| {
            sensor.against < if sensor.is_lost { self.until_back } else { self.until_lost }
                && sensor.differences <= NOISE_DIFFERENCES
                && sensor.variance >= 0.0
                && sensor.last.unwrap_or_default().abs() <= PLAUSIBLE
                && sensor.variance.is_finite()
        };
        let fits = state.inputs.len() == self.state.inputs.len()
            && state.sensors.len() == self.state.sensors.len()
            && state.sensors.iter().all(is_possible)
            && state.gap.max(state.missing) <= LARGEST_COUNT
            && state.settling <= self.settle_samples
            && state.recovering <= self.recover_samples;
        require_sound(fits, "the stored checks are another diagnoser's")?;
        self.state.clone_from(state);
        Ok(())
    }
}

impl SensorState {
    /// Counts a sample with or without a usable value; after `limit` of them the sensor is lost, or back.
    fn notice(&mut self, is_there: bool, limit: u64) {
        self.against = if is_there == self.is_lost { self.against + 1 } else { 0 };
        if self.against >= limit {
            (self.is_lost, self.against) = (!self.is_lost, 0);
        }
    }

    /// Takes a residual, in parts of scale, into the measured noise; `None` for no measurement. `noise` is the declared
    /// deviation.
    fn measure_noise(&mut self, residual: Option<f64>, noise: f64) {
        if let Some((last, new)) = self.last.zip(residual) {
            let difference = new - last;
            let half = (0.5 * difference * difference).min(LARGEST_DIFFERENCE * noise * noise);
            self.differences = (self.differences + 1).min(NOISE_DIFFERENCES);
            self.variance += (half - self.variance) / self.differences as f64;
        }
        self.last = residual;
    }

    /// Whether the sensor is much quieter than declared.
    fn is_quiet(&self, noise: f64) -> bool {
        self.differences >= NOISE_DIFFERENCES && QUIET * self.variance < noise * noise
    }
}

/// A deviate of mean 0 and variance 1, from twelve uniform ones.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnoser::{DiagnosedSensor, FORMAT, Tuning};
    use crate::features::Quantity;

    /// Two inputs and two sensors at 100 Hz.
    fn diagnoser() -> Diagnoser {
        let input = |name: &str, frozen_after_s| InputRange {
            name: name.into(),
            least: 0.0,
            largest: 100.0,
            frozen_after_s,
        };
        let (of, minus) = ("supply".into(), "tank".into());
        let sensor = |name: &str| DiagnosedSensor {
            name: name.into(),
            quantity: Quantity::Other,
            actuator: Some(0),
            scale: 1.0,
            noise: 0.0,
            is_noisy: false,
            follows: vec![],
            spread: None,
        };
        Diagnoser {
            format: FORMAT.into(),
            period_s: 0.01,
            sensors: vec![sensor("x_p"), sensor("x_v")],
            environment: InputChecks {
                inputs: vec![input("supply", Some(0.05)), input("tank", None)],
                differences: vec![InputDifference { of, minus, least: 10.0, largest: 90.0 }],
            },
            boundaries: vec![],
            lengths: vec![],
            baseline: None,
            tuning: Tuning {
                no_data_after_s: 0.03,
                input_held_s: 0.02,
                input_recover_s: 0.01,
                settle_s: 0.05,
                ..Tuning::default()
            },
            scatter: None,
            healthy_evidence: None,
            recorded: None,
        }
    }

    fn admit(guard: &mut Guard, inputs: &[f64], measured: &[f64]) -> Admission {
        let received = Received { inputs, measured, twin: &[0.5; 2], sample: 7 };
        guard.admit(&diagnoser(), received, |_| false)
    }

    #[test]
    fn implausible_inputs_are_named_and_the_twin_settles_after_them() {
        let mut guard = Guard::new(&diagnoser());
        let wrong: [(&[f64], u32, Why); 5] = [
            (&[f64::NAN, 5.0], 0, Why::Missing),
            (&[51.0, f64::NEG_INFINITY], 1, Why::NotFinite),
            (&[52.0, -1.0], 1, Why::OutOfRange),
            (&[14.0, 5.0], 0, Why::Contradicts),
            (&[14.0, f64::NAN], 0, Why::Contradicts),
        ];
        for (inputs, input, why) in wrong {
            let finding = IndexedFinding::EnvironmentInvalid { input, why };
            assert_eq!(admit(&mut guard, inputs, &[0.5; 2]), Admission::Implausible(finding));
        }
        let frozen = IndexedFinding::EnvironmentInvalid { input: 0, why: Why::Frozen };
        for k in 0..10 {
            let expected = if k < 5 { Admission::Settling } else { Admission::Implausible(frozen) };
            assert_eq!(admit(&mut guard, &[60.0, 5.0], &[0.5; 2]), expected, "sample {k}");
        }
        for k in 0..6 {
            let expected = if k < 5 { Admission::Settling } else { Admission::Judged };
            assert_eq!(admit(&mut guard, &[61.0 + f64::from(k), 5.0], &[0.5; 2]), expected);
        }
    }

    #[test]
    fn an_input_that_is_missing_for_a_moment_restarts_nothing() {
        let mut guard = Guard::new(&diagnoser());
        guard.has_settled();
        let missing = Admission::Implausible(IndexedFinding::EnvironmentInvalid {
            input: 1,
            why: Why::Missing,
        });
        assert_eq!(admit(&mut guard, &[50.0, f64::NAN], &[0.5; 2]), missing, "it never was there");
        guard.has_settled();
        assert_eq!(admit(&mut guard, &[51.0, 5.0], &[0.5; 2]), Admission::Judged);
        assert_eq!(admit(&mut guard, &[52.0, f64::NAN], &[0.5; 2]), Admission::Passed);
        assert_eq!(admit(&mut guard, &[53.0], &[0.5; 2]), Admission::Passed);
        assert_eq!(admit(&mut guard, &[54.0, 5.0], &[0.5; 2]), Admission::Passed, "it recovers");
        assert_eq!(admit(&mut guard, &[54.5, 5.0], &[0.5; 2]), Admission::Judged);
        let passed = Admission::Passed;
        for (k, expected) in [passed, passed, missing, missing].into_iter().enumerate() {
            assert_eq!(admit(&mut guard, &[55.0 + k as f64, f64::NAN], &[0.5; 2]), expected);
        }
        assert_eq!(admit(&mut guard, &[60.0, 5.0], &[0.5; 2]), Admission::Settling);
    }

    #[test]
    fn a_sensor_that_is_much_quieter_than_declared_gets_the_declared_noise() {
        let mut noisy = diagnoser();
        for sensor in &mut noisy.sensors {
            (sensor.noise, sensor.is_noisy) = (0.01, true);
        }
        // Also where nothing settles, as in a test on the ground.
        noisy.tuning.settle_s = 0.0;
        let mut guard = Guard::new(&noisy);
        for k in 0..110 {
            let own = if k % 2 == 0 { 0.51 } else { 0.49 };
            let (inputs, measured) = ([50.0 + f64::from(k % 10), 5.0], [0.4, own]);
            let received =
                Received { inputs: &inputs, measured: &measured, twin: &[0.5; 2], sample: 7 };
            guard.admit(&noisy, received, |_| false);
            // The noise is known after a hundred differences.
            assert_eq!(guard.measured[0] == 0.4, k < 100, "{k}");
            assert_eq!(guard.measured[1], own, "it has its own noise");
        }
        assert!((guard.measured[0] - 0.4).abs() < 0.06);
    }

    #[test]
    fn a_sensor_is_lost_after_a_row_without_values_and_back_after_a_row_with() {
        let is_lost_after = |samples: &[bool]| {
            let mut guard = Guard::new(&diagnoser());
            for (k, &is_there) in samples.iter().enumerate() {
                let value = if is_there { 0.4 } else { f64::NAN };
                admit(&mut guard, &[50.0 + k as f64, 5.0], &[0.5, value]);
            }
            assert_eq!(guard.is_lost(1), guard.lost() == 1);
            assert_eq!(guard.is_lost(1), guard.measured[1] == 0.5, "the twin's value stands in");
            guard.is_lost(1)
        };
        assert!(!is_lost_after(&[false; 2]));
        assert!(is_lost_after(&[false; 3]));
        assert!(!is_lost_after(&[false, false, true, false, false]));
        assert!(is_lost_after(&[&[false; 3][..], &[true; 4]].concat()));
        assert!(!is_lost_after(&[&[false; 3][..], &[true; 5]].concat()));
        assert!(is_lost_after(&[&[false; 3][..], &[true; 4], &[false], &[true; 4]].concat()));
    }
}
