//! Doubt about a boundary sensor: a wrong supply or return pressure looks like a leak or a closed valve.
//!
//! The twin computes with the measured boundary value u. If that reading is off by δ, the residuals of the actuator
//! move in a direction that the twin's own equations give, and that of the sensor next to the boundary moves by δ. A
//! leak and a closed valve move the same residuals in the same direction. But they change the pressure drop between
//! boundary and sensor, and this drop grows with the load flow. With r the residual and y the twin's signal of the
//! sensor next to the boundary:
//!
//! ```text
//! wrong reading    r = δ + s₀ y
//! fault            r = δ + s y,  s ≠ s₀
//! s = Σry/Σy²,   information I = n Σy² / (Σr² − (Σry)²/Σy²)                                   (1)
//! evidence         ½ (s − s₀)² / (1/I + V₀ + e²/⟨y²⟩) − ½ ln n                               (2)
//! s₀ = V₀ I_h s_h,   V₀ = 1/(1/σ² + I_h)                                                     (3)
//! ```
//!
//! The specimen's own line is not exactly the twin's, so its residual has a slope s₀ in health, too. (3) takes it from
//! the windows before the deviation (index h), and from the spread σ of lines where these had no motion. The sums take
//! deviations from the means of windows, so a drift of δ does no harm. (2) is the logarithm of a likelihood ratio less
//! the price of a parameter by Schwarz, "Estimating the Dimension of a Model", Annals of Statistics 6, 1978. n counts
//! independent samples. What is left of the residual beside the line is in part the white noise of the sensor, which is
//! new in every sample. The other part is an error of the model, which is new in every window only. The error e
//! of the twin's pressure drop moves with the flow, because the quiescent flows of valves differ. A small motion is
//! therefore weak evidence.
//!
//! Equations (1) to (3) take residuals as measured ([`Window::undivided_variance`]). δ moves the mean of a residual that is
//! divided by its spread d by δ times the mean of 1/d.
//!
//! A shutdown waits for this evidence while a wrong reading explains all that the actuator shows: what is left of the
//! mean residuals lies within their bands, and δ is no larger than a transducer's error. Before any window in its band,
//! δ may be as large as the range of the input allows: the reading may have been wrong from the start, or be a default.
//!
//! A leak of the return line hardly changes this slope. There, another law decides: which of the two moved. A reading
//! that goes wrong moves the twin and leaves the sensor where it was; a leak moves the sensor and leaves the reading.
//! With u the reading, u₀ an earlier one beside which the sensor agreed with the twin, and c the change of the residual
//! for one unit of u, a fall has no wrong reading as its cause if
//!
//! ```text
//! r < 0,   |r| − c max|u − u₀| > band                                                        (4)
//! ```
//!
//! and if its own transducer is not the cause. With x_i what the fall moves another sensor of the actuator by, and σ_i the
//! noise of the mean of its n samples,
//!
//! ```text
//! Σ x_i (r_i − x_i/2)/σ_i²                                                                   (5)
//! ```
//!
//! is the logarithm of a likelihood ratio. Summed over the new samples since the deviation began, it must exceed what one
//! window may count ([`Tuning::clip_nats`]), because trees and (5) see the same noise.
//! The maximum in (4) is that since the deviation began. Only a fall next to a return line counts, in windows that no
//! baseline corrects: the reservoir holds its pressure from below, so no other consumer can lower it. A supply falls
//! whenever others draw from it.

use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::DiagnosedSensor;
use super::tuning::Tuning;
use crate::error::{Error, require_sound};
use crate::panel::SensorBand;
use crate::residual::Window;

/// What a wrong reading of one boundary value does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boundary {
    /// Index of the input.
    pub input: u32,
    /// Index of the sensor next to the boundary.
    pub sensor: u32,
    /// Whether the boundary is a return line, whose pressure no consumer lowers.
    pub is_return: bool,
    /// Each watched sensor of its actuator, and the change of its twin value in parts of scale for a change of the
    /// input by one SI unit.
    pub effects: Vec<(u32, f64)>,
}

impl Boundary {
    /// Checks indices and numbers.
    ///
    /// # Errors
    /// [`Error::CorruptModel`].
    pub(super) fn check(&self, inputs: usize, watched: usize) -> Result<(), Error> {
        let known = |sensor: u32| (sensor as usize) < watched;
        let is_sound = (self.input as usize) < inputs
            && self.effect().is_some_and(|effect| effect != 0.0)
            && self.effects.iter().all(|&(sensor, effect)| known(sensor) && effect.is_finite());
        require_sound(is_sound, "a boundary names no input, or no effect on its sensor")
    }

    /// The effect on the sensor next to the boundary.
    pub fn effect(&self) -> Option<f64> {
        self.effects.iter().find(|(sensor, _)| *sensor == self.sensor).map(|(_, effect)| *effect)
    }

    /// The change of the mean residual of a sensor in a window for a change of the input by one SI unit.
    fn moves(window: &Window, sensor: u32, effect: f64) -> f64 {
        effect * window.inverse_spread(sensor as usize)
    }

    /// Equation (5), in nats.
    fn shared_nats(&self, new: &NewWindow) -> f64 {
        let NewWindow { window, sensors, .. } = *new;
        let moves = Self::moves(window, self.sensor, self.effect().unwrap_or_default());
        let fallen = window.mean(self.sensor as usize) / moves;
        let mut nats = 0.0;
        for &(sensor, effect) in &self.effects {
            let place = sensor as usize;
            let noise = sensors[place].noise * window.inverse_spread(place);
            if sensor == self.sensor || noise <= 0.0 {
                continue;
            }
            let expected = fallen * Self::moves(window, sensor, effect);
            let gain = expected * (window.mean(place) - 0.5 * expected);
            nats += gain * window.count() as f64 / (noise * noise);
        }
        nats
    }

    /// Whether a wrong reading explains a window: it moves the sensor next to the boundary by a part of its band, by no
    /// more than is possible, and what is left of all mean residuals lies within their bands. Returns also the true value, SI,
    /// if it does.
    fn explains(&self, new: &NewWindow, tuning: &Tuning) -> (bool, f64) {
        let NewWindow { window, bands, reading, possible, .. } = *new;
        let half_width = |sensor: u32| bands[sensor as usize].half_width.max(1e-12);
        let (mut along, mut of) = (0.0, 0.0);
        for &(sensor, effect) in &self.effects {
            let weighed = Self::moves(window, sensor, effect) / half_width(sensor);
            along += weighed * window.mean(sensor as usize) / half_width(sensor);
            of += weighed * weighed;
        }
        let wrong_by = along / of;
        let value = reading + wrong_by;
        let is_left_in_band = |&(sensor, effect): &(u32, f64)| {
            let expected = wrong_by * Self::moves(window, sensor, effect);
            (window.mean(sensor as usize) - expected).abs() <= half_width(sensor)
        };
        let error = (wrong_by * self.effect().unwrap_or_default()).abs();
        let moved = error * window.inverse_spread(self.sensor as usize);
        let is_possible = error <= tuning.largest_boundary_error
            || possible.is_some_and(|[least, largest]| (least..=largest).contains(&value));
        let explains = moved > tuning.least_boundary_move * half_width(self.sensor)
            && is_possible
            && self.effects.iter().all(is_left_in_band);
        (explains, value)
    }
}

/// A new window of a length, with the reading of a boundary.
#[derive(Clone, Copy)]
pub(super) struct NewWindow<'w> {
    pub(crate) window: &'w Window,
    pub(crate) bands: &'w [SensorBand],
    pub(crate) sensors: &'w [DiagnosedSensor],
    /// The number of panes of a window, and the share of it that is new.
    pub(crate) panes: u32,
    pub(crate) share: f64,
    pub(crate) period_s: f64,
    /// The input at the last sample, SI.
    pub(crate) reading: f64,
    /// The range of the true value, SI, if the sensor has not agreed with the twin yet.
    pub(crate) possible: Option<[f64; 2]>,
}

/// Sums over windows of a residual and the twin's signal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sums {
    /// Number of samples, and of windows that share none.
    samples: f64,
    windows: f64,
    /// Σr², Σry and Σy².
    moments: [f64; 3],
}

/// A slope with its information, equation (1).
struct Slope {
    slope: f64,
    information: f64,
    independent: f64,
}

impl Sums {
    fn fits(&self) -> bool {
        let Sums { samples, windows, moments } = *self;
        [samples, windows, moments[0], moments[2]].iter().all(|sum| *sum >= 0.0)
            && moments.iter().chain([&samples, &windows]).all(|sum| sum.is_finite())
    }

    /// Keeps a share of what was.
    fn fade(&mut self, kept: f64) {
        let Sums { samples, windows, moments } = self;
        moments.iter_mut().chain([samples, windows]).for_each(|sum| *sum *= kept);
    }

    fn add(&mut self, other: &Sums) {
        self.samples += other.samples;
        self.windows += other.windows;
        self.moments.iter_mut().zip(other.moments).for_each(|(sum, more)| *sum += more);
    }

    /// The sums of what is new in a window: a share of it.
    fn of(window: &Window, sensor: usize, share: f64) -> Self {
        let new = share * window.count() as f64;
        let moments = [
            window.undivided_variance(sensor),
            window.undivided_cross_covariance(sensor),
            window.twin_covariance(sensor, sensor),
        ];
        Sums { samples: new, windows: share, moments: moments.map(|moment| new * moment) }
    }

    /// Equation (1); `None` without motion. `noise` is the standard deviation of a sample of the residual by the
    /// sensor's noise, in parts of scale.
    fn slope(&self, noise: f64) -> Option<Slope> {
        let [of_residual, of_both, of_twin] = self.moments;
        if self.samples <= 1.0 || of_residual <= 0.0 || of_twin <= 0.0 {
            return None;
        }
        let left = (of_residual - of_both * of_both / of_twin).max(1e-12 * of_residual);
        let white = (self.samples * noise * noise / left).min(1.0);
        let independent = (white * self.samples + (1.0 - white) * self.windows).max(1.0);
        let information = independent * of_twin / left;
        Some(Slope { slope: of_both / of_twin, information, independent })
    }
}

/// The evidence of a running session against a wrong reading of one boundary value.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Doubt {
    /// Consecutive windows in which the sensor next to the boundary deviated.
    deviating: u32,
    /// The number of windows, the last one included, for which a wrong reading counts as an explanation.
    explained: u32,
    /// The windows since then.
    since: Sums,
    /// Windows before it, none of which holds its onset.
    healthy: Sums,
    /// Healthy windows that may hold an onset: those of the last full group, and of the group being filled.
    waiting: Sums,
    filling: Sums,
    /// The number of windows in the group being filled.
    filled: u32,
    /// u₀, and the reading beside the newest healthy window, which may hold an onset.
    right: Option<f64>,
    candidate: Option<f64>,
    /// The largest change of the reading from u₀ since the deviation began, SI.
    moved: f64,
    /// The sum of (5) since the deviation began, nats.
    shared: f64,
    /// The left side of (4), in parts of scale, and whether the sensor has fallen by (4) and (5).
    fallen: f64,
    has_fallen: bool,
    /// What the true value is if a wrong reading explains the newest window, SI.
    value: f64,
    /// The mean of the reading over about the last window, SI.
    recent: Option<f64>,
}

impl Doubt {
    /// Whether a session can have stored these numbers.
    pub(crate) fn fits(&self) -> bool {
        let optional = [self.right, self.candidate, self.recent];
        let own = self.numbers().into_iter().chain([self.moved]);
        optional.into_iter().flatten().chain(own).all(|reading| reading.is_finite())
            && [&self.since, &self.healthy, &self.waiting, &self.filling]
                .iter()
                .all(|sums| sums.fits())
    }

    /// Takes a window. One that holds the onset of the deviation counts nothing: there the residual steps, whatever the
    /// flow is. Nor does one in which the reading moves, for example because it is right again: there the residual
    /// follows the twin, as beside a leak.
    pub(crate) fn take(&mut self, boundary: &Boundary, new: &NewWindow, tuning: &Tuning) {
        let NewWindow { window, bands, panes, share, period_s, reading, .. } = *new;
        let sensor = boundary.sensor as usize;
        let sums = Sums::of(window, sensor, share);
        let (mean, band) = (window.mean(sensor), bands[sensor].half_width);
        let is_moving = self.follow(boundary, new);
        let (is_explained, value) = boundary.explains(new, tuning);
        self.value = value;
        self.explain(is_explained, panes, is_moving);
        if mean.abs() <= band {
            (self.deviating, self.since) = (0, Sums::default());
            (self.moved, self.shared, self.fallen, self.has_fallen) = (0.0, 0.0, 0.0, false);
            let is_right = mean.abs() <= tuning.least_boundary_move * band;
            let forgotten = period_s / tuning.healthy_slope_memory_s;
            return self.take_healthy(&sums, panes, forgotten, is_right.then_some(reading));
        }
        (self.waiting, self.filling, self.filled) = (Sums::default(), Sums::default(), 0);
        self.candidate = None;
        self.shared += share * boundary.shared_nats(new);
        self.fall(boundary, new, tuning);
        if is_moving {
            self.deviating = 0;
        }
        self.deviating = self.deviating.saturating_add(1);
        if self.deviating > panes {
            self.since.fade(libm::exp(-sums.samples * period_s / tuning.boundary_memory_s));
            self.since.add(&sums);
        }
    }

    /// Whether the reading moves by as much as a band within about a window.
    fn follow(&mut self, boundary: &Boundary, new: &NewWindow) -> bool {
        let recent = self.recent.get_or_insert(new.reading);
        let distance = new.reading - *recent;
        *recent += distance / f64::from(new.panes);
        let sensor = boundary.sensor;
        let effect = Boundary::moves(new.window, sensor, boundary.effect().unwrap_or_default());
        (distance * effect).abs() > new.bands[sensor as usize].half_width
    }

    /// Equations (4) and (5). A reading that moved and came back counts as moved, because windows still hold what it did.
    fn fall(&mut self, boundary: &Boundary, new: &NewWindow, tuning: &Tuning) {
        let Some(right) = self.right else { return };
        let (sensor, effect) = (boundary.sensor, boundary.effect().unwrap_or_default());
        self.moved = self.moved.max((new.reading - right).abs());
        let mean = new.window.mean(sensor as usize);
        let by_reading = (self.moved * Boundary::moves(new.window, sensor, effect)).abs();
        let is_lower = (mean < 0.0) != (effect < 0.0);
        self.fallen = mean.abs() - by_reading;
        self.has_fallen = is_lower
            && self.fallen > new.bands[sensor as usize].half_width
            && self.shared > tuning.clip_nats;
    }

    /// Whether the sensor has fallen while the reading stayed where it was right, equation (4).
    pub(crate) fn has_fallen(&self) -> bool {
        self.has_fallen
    }

    /// What a session tells of it, see [`Session::boundary_numbers`](super::session::Session::boundary_numbers).
    pub(crate) fn numbers(&self) -> [f64; 5] {
        let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
        let [is_explained, has_fallen] = [flag(self.is_explained()), flag(self.has_fallen)];
        [is_explained, has_fallen, self.fallen, self.shared, self.value]
    }

    /// Whether the sensor has agreed with the twin for some windows.
    pub(crate) fn has_agreed(&self) -> bool {
        self.healthy.samples > 0.0
    }

    /// An explanation of windows without the onset holds until a whole window has nothing of it: noise lifts one sensor
    /// or another out of its band now and then. An explanation of a window with the onset holds for this window alone,
    /// because the mean of any larger deviation passes through the explained ones, unless the reading moves meanwhile:
    /// then it is the reading that deviates.
    fn explain(&mut self, is_explained: bool, panes: u32, is_moving: bool) {
        self.explained = match is_explained {
            true if is_moving || self.deviating >= panes => panes,
            true => 1,
            false => self.explained.saturating_sub(1),
        };
    }

    /// Whether a wrong reading explains the present windows.
    pub(crate) fn is_explained(&self) -> bool {
        self.explained > 0
    }

    /// Takes a window without a deviation. It counts once a whole group of further ones has followed, because a
    /// deviation shows in the mean of a window later than in its moments. A sample forgets the part `forgotten` of all
    /// before. `right` is a reading that the sensor agrees with closely.
    fn take_healthy(&mut self, new: &Sums, panes: u32, forgotten: f64, right: Option<f64>) {
        self.filling.add(new);
        self.filled += 1;
        if self.filled >= panes {
            self.healthy.fade(libm::exp(-self.waiting.samples * forgotten));
            self.healthy.add(&self.waiting);
            self.waiting = self.filling;
            (self.filling, self.filled) = (Sums::default(), 0);
            self.right = self.candidate.or(self.right);
            self.candidate = right;
        }
    }

    /// Equation (2), in nats.
    pub(crate) fn evidence_nats(&self, noise: f64, tuning: &Tuning) -> f64 {
        let Some(now) = self.since.slope(noise) else { return 0.0 };
        let of_lines = 1.0 / (tuning.line_slope_deviation * tuning.line_slope_deviation);
        let (own, variance) = match self.healthy.slope(noise) {
            Some(healthy) => {
                let variance = 1.0 / (of_lines + healthy.information);
                (variance * healthy.information * healthy.slope, variance)
            }
            None => (0.0, 1.0 / of_lines),
        };
        let change = now.slope - own;
        let motion = self.since.moments[2] / self.since.samples;
        let of_flow = tuning.line_error * tuning.line_error / motion;
        let of_change = 1.0 / now.information + variance + of_flow;
        0.5 * (change * change / of_change - libm::log(now.independent))
    }

    /// Whether a wrong reading is still possible. `noise` is the standard deviation of a sample of the residual by the
    /// sensor's noise, in parts of scale.
    pub(crate) fn remains(&self, noise: f64, tuning: &Tuning) -> bool {
        self.evidence_nats(noise, tuning) < tuning.fault_needed_nats
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::residual::DividedSample;
    use alloc::format;
    use alloc::vec;

    const BOUNDARY: fn() -> Boundary =
        || Boundary { input: 0, sensor: 0, is_return: true, effects: vec![(0, 1e-7), (1, 0.5e-7)] };

    fn bands() -> Vec<SensorBand> {
        let band = |n: usize| SensorBand { sensor: format!("p_{n}"), half_width: 0.02 };
        (0..2).map(band).collect()
    }

    const SENSOR: DiagnosedSensor = DiagnosedSensor {
        name: alloc::string::String::new(),
        quantity: crate::features::Quantity::Other,
        actuator: None,
        scale: 1.0,
        noise: NOISE,
        is_noisy: true,
        follows: Vec::new(),
        spread: None,
    };
    static SENSORS: [DiagnosedSensor; 2] = [SENSOR; 2];

    /// The deviation of uniform noise 0.005 wide.
    const NOISE: f64 = 0.00144;

    /// A window of 50 samples from `start`, with residuals of two sensors and the twin's drop of the first.
    fn window(
        start: usize,
        drop: impl Fn(f64) -> f64,
        residual: impl Fn(f64) -> [f64; 2],
    ) -> Window {
        let mut random = Random::stream(7, start as u64);
        let mut window = Window::new(2).keeping_undivided();
        for k in 0..50 {
            let time_s = 0.01 * (start + k) as f64;
            let mut noise = || 0.005 * (random.unit() - 0.5);
            let twin = [1.0 - drop(time_s), 0.5];
            let r = residual(time_s);
            let measured = [twin[0] + r[0] + noise(), twin[1] + r[1] + noise()];
            let (judged, ones) = (&measured, &[1.0, 1.0]);
            window.add_divided(&DividedSample {
                judged,
                measured: judged,
                twin: &twin,
                scales: ones,
                spreads: ones,
            });
        }
        window
    }

    /// A window of some panes, of which a fifth is new, beside a reading that stays.
    fn new<'w>(window: &'w Window, bands: &'w [SensorBand], panes: u32) -> NewWindow<'w> {
        let (share, period_s, sensors) = (0.2, 0.01, SENSORS.as_slice());
        NewWindow { window, bands, sensors, panes, share, period_s, reading: 6e5, possible: None }
    }

    /// The doubt after some seconds, with windows that begin 0.1 s apart.
    fn doubt(
        seconds: usize,
        drop: impl Fn(f64) -> f64,
        residual: impl Fn(f64) -> [f64; 2],
    ) -> Doubt {
        let mut doubt = Doubt::default();
        for pane in 0..10 * seconds {
            let window = window(10 * pane, &drop, &residual);
            doubt.take(&BOUNDARY(), &new(&window, &bands(), 5), &Tuning::default());
        }
        doubt
    }

    /// The drop over the supply valve under a load flow that follows a motion of 0.7 Hz.
    fn moving(time_s: f64) -> f64 {
        0.03 * libm::pow(libm::sin(4.4 * time_s), 2.0)
    }

    #[test]
    fn a_leak_grows_with_the_load_flow_and_a_wrong_reading_does_not() {
        let leak = |time_s: f64| {
            let shift = -0.04 - 0.6 * moving(time_s);
            [shift, 0.5 * shift]
        };
        assert!(!doubt(2, moving, leak).remains(NOISE, &Tuning::default()));
        assert!(doubt(30, moving, |_| [-0.04, -0.02]).remains(NOISE, &Tuning::default()));
    }

    /// The quiescent flow of a valve moves the pressure behind it along with a small flow, as a leak does.
    #[test]
    fn a_small_motion_is_weak_evidence() {
        let with_flow = |part: f64| {
            let small = move |time_s: f64| part * moving(time_s);
            let residual = move |time_s: f64| [-0.04 - small(time_s), -0.02];
            doubt(10, small, residual).remains(NOISE, &Tuning::default())
        };
        assert!(with_flow(0.05) && !with_flow(1.0));
    }

    /// A model error that happens to move with the flow for some seconds is no evidence, though its samples are many.
    #[test]
    fn an_error_that_is_the_same_throughout_a_window_counts_once() {
        let swinging = |time_s: f64| {
            let shift = -0.04 + 0.004 * libm::sin(3.1 * time_s);
            [shift, 0.5 * shift]
        };
        assert!(doubt(4, moving, swinging).remains(NOISE, &Tuning::default()));
    }

    /// Without motion nothing separates the two, however long it lasts.
    #[test]
    fn an_actuator_at_rest_stays_doubtful() {
        assert!(doubt(30, |_| 0.001, |_| [-0.04, -0.02]).remains(NOISE, &Tuning::default()));
    }

    #[test]
    fn evidence_is_forgotten_when_the_deviation_ends() {
        let leak = |time_s: f64| [-0.04 - 0.9 * moving(time_s), -0.02];
        let mut doubt = doubt(3, moving, leak);
        assert!(!doubt.remains(NOISE, &Tuning::default()));
        let healthy = window(0, moving, |_| [0.0, 0.0]);
        doubt.take(&BOUNDARY(), &new(&healthy, &bands(), 5), &Tuning::default());
        assert!(doubt.remains(NOISE, &Tuning::default()) && doubt.since.samples == 0.0);
    }

    #[test]
    fn an_explanation_outlasts_the_noise_of_some_windows() {
        let at = |explained: [bool; 4], before: usize| {
            let mut doubt = Doubt::default();
            let wrong = |is_wrong: bool| if is_wrong { [-0.04, -0.02] } else { [-0.04, 0.03] };
            let all = core::iter::repeat_n(true, before).chain(explained);
            for is_explained in all {
                let window = window(0, moving, |_| wrong(is_explained));
                doubt.take(&BOUNDARY(), &new(&window, &bands(), 3), &Tuning::default());
            }
            doubt.is_explained()
        };
        assert!(at([true, false, false, true], 9));
        assert!(at([true, true, false, false], 9));
        assert!(!at([true, false, false, false], 9), "a whole window without it ends it");
        assert!(!at([false; 4], 0));
        // A larger deviation passes through what a wrong reading explains, and nothing waits for it afterwards.
        assert!(!at([true, true, false, false], 0));
    }

    /// A line that differs from the twin's by a fifth has a slope before and after a reading goes wrong. A leak changes
    /// it.
    #[test]
    fn a_slope_that_was_there_before_is_no_evidence() {
        let own = |time_s: f64| -0.2 * moving(time_s);
        let from = |shift: f64, slope: f64| {
            move |time_s: f64| {
                let later = f64::from(u8::from(time_s >= 20.0));
                let r = own(time_s) + later * (shift + slope * moving(time_s));
                [r, 0.5 * r]
            }
        };
        assert!(doubt(30, moving, from(-0.04, 0.0)).remains(NOISE, &Tuning::default()));
        assert!(!doubt(30, moving, from(-0.04, -0.5)).remains(NOISE, &Tuning::default()));
    }

    /// Without motion in health the slope of the line is not known, and may be as large as lines differ.
    #[test]
    fn a_slope_that_lines_have_is_no_evidence_after_rest() {
        let still_then_moving = |time_s: f64| if time_s < 20.0 { 0.001 } else { moving(time_s) };
        let from = |slope: f64| {
            move |time_s: f64| {
                let shift = if time_s < 20.0 { 0.0 } else { -0.04 };
                let r = shift + slope * still_then_moving(time_s);
                [r, 0.5 * r]
            }
        };
        assert!(doubt(30, still_then_moving, from(-0.2)).remains(NOISE, &Tuning::default()));
        assert!(!doubt(30, still_then_moving, from(-0.9)).remains(NOISE, &Tuning::default()));
    }

    #[test]
    fn a_wrong_reading_moves_all_sensors_in_its_direction_by_no_more_than_transducers_err() {
        let explains = |residual: [f64; 2]| {
            let window = window(0, |_| 0.0, |_| residual);
            BOUNDARY().explains(&new(&window, &bands(), 5), &Tuning::default()).0
        };
        assert!(explains([-0.04, -0.02]));
        assert!(explains([0.04, 0.02]));
        // Only the sensor next to the boundary moves: it is this sensor's own fault.
        assert!(!explains([-0.04, 0.03]));
        assert!(!explains([-0.08, -0.04]), "no transducer errs by 8 % of its scale");
        assert!(!explains([0.0, 0.0]), "nothing deviates, so there is nothing to explain");
    }

    /// A reading of 6 bar that later differs by `to`, beside a residual of `fallen`.
    fn after(to: impl Fn(usize) -> f64, fallen: f64) -> Doubt {
        let mut doubt = Doubt::default();
        for pane in 0..30 {
            let onset = pane >= 20;
            let shift = if onset { fallen } else { 0.0 };
            let window = window(10 * pane, |_| 0.001, |_| [shift, 0.5 * shift]);
            let reading = if onset { 6e5 + to(pane - 20) } else { 6e5 };
            let bands = bands();
            let new = NewWindow { reading, ..new(&window, &bands, 5) };
            doubt.take(&BOUNDARY(), &new, &Tuning::default());
        }
        doubt
    }

    #[test]
    fn a_sensor_that_falls_beside_a_reading_that_stays_has_no_wrong_reading_as_its_cause() {
        assert!(after(|_| 0.0, -0.04).has_fallen());
        assert!(!after(|_| 0.0, 0.04).has_fallen(), "a line rises when other consumers move");
        assert!(!after(|_| 0.0, -0.015).has_fallen(), "a fall within the band is none");
    }

    /// The transducer of the return pressure reads low, and the other sensor stays where it was.
    #[test]
    fn a_fall_that_no_other_sensor_shares_is_no_leak() {
        let mut doubt = Doubt::default();
        for pane in 0..30 {
            let low = if pane >= 20 { -0.04 } else { 0.0 };
            let (window, bands) = (window(10 * pane, |_| 0.001, |_| [low, 0.0]), bands());
            doubt.take(&BOUNDARY(), &new(&window, &bands, 5), &Tuning::default());
            assert!(!doubt.has_fallen());
        }
    }

    /// One unit of the reading moves the residual by 1e-7.
    #[test]
    fn a_reading_that_moves_by_what_the_sensor_deviates_is_wrong() {
        assert!(!after(|_| 4e5, -0.04).has_fallen());
        assert!(!after(|_| 3e5, -0.04).has_fallen(), "what is left lies within the band");
        assert!(after(|_| 1e5, -0.04).has_fallen());
        let and_back = |pane: usize| if pane < 3 { 4e5 } else { 0.0 };
        assert!(!after(and_back, -0.04).has_fallen(), "windows still hold what it did");
    }

    /// The residual of a reading that is right again moves along with the twin, and the slope over it is that of a leak.
    #[test]
    fn a_reading_that_is_right_again_is_no_evidence_for_a_leak() {
        let wrong = |time_s: f64| f64::from(u8::from((2.0..6.0).contains(&time_s)));
        let mut doubt = Doubt::default();
        for pane in 0..66 {
            let window = window(
                10 * pane,
                |time_s| 0.001 - 0.04 * wrong(time_s),
                |time_s| [-0.04 * wrong(time_s), -0.02 * wrong(time_s)],
            );
            let bands = bands();
            let reading = 6e5 + 4e5 * wrong(0.1 * (pane + 5) as f64);
            doubt.take(
                &BOUNDARY(),
                &NewWindow { reading, ..new(&window, &bands, 5) },
                &Tuning::default(),
            );
            assert!(doubt.remains(NOISE, &Tuning::default()) && !doubt.has_fallen(), "{pane}");
        }
    }

    #[test]
    fn a_reading_that_was_never_right_may_be_wrong_within_the_range_of_its_input() {
        let mut doubt = Doubt::default();
        let low = window(0, |_| 0.001, |_| [-0.08, -0.04]);
        let explains = |possible| {
            let bands = bands();
            let new = NewWindow { possible, ..new(&low, &bands, 5) };
            BOUNDARY().explains(&new, &Tuning::default()).0
        };
        assert!(!explains(None), "no transducer errs by 8 % of its scale");
        assert!(!explains(Some([0.0, 9e5])), "a pressure below zero is none");
        assert!(explains(Some([-3e5, 9e5])));
        (0..30).for_each(|_| doubt.take(&BOUNDARY(), &new(&low, &bands(), 5), &Tuning::default()));
        assert!(!doubt.has_agreed() && !doubt.has_fallen());
    }

    #[test]
    fn a_boundary_needs_an_effect_on_its_own_sensor() {
        assert!(BOUNDARY().check(1, 2).is_ok());
        assert!(BOUNDARY().check(0, 2).is_err() && BOUNDARY().check(1, 1).is_err());
        assert!(Boundary { sensor: 1, effects: vec![(0, 1.0)], ..BOUNDARY() }.check(1, 2).is_err());
    }
}
