//! What a healthy specimen's residuals are, learned beside it.
//!
//! Specimens differ by their tolerances, so the residuals of a healthy one are as large as those of small faults: they have
//! means of their own, and where the twin moves they follow its motion (a gain, a lag, another natural frequency; pressures
//! that two valves of different flow gain build up against each other). A [`Reference`] learns both. With `s` what the twin's
//! value of a sensor has changed by, `v` the same of the valve's spool in its unit, and `r` its residual, all in parts of scale,
//!
//! ```text
//! x = (1, 3 s, 0.3 s · ds/dt, 0.006 s² · d²s/dt², 3 v, 0.3 s · dv/dt)
//! r = θ·x + e,    θ ~ N(0, π² I),  e ~ N(0, σ²)                          (1)
//! A = Σ x xᵀ + (σ/π)² I,    θ = A⁻¹ Σ x r                                (2)
//! r' = (r − θ·x) / √(1 + (σ/n)² x·A⁻¹x + Σ (κ_i/n)² (x_i − c_i)²)        (3)
//! ```
//!
//! with n the sensor's noise and c the means of 3 s and 3 v. This is regression with a prior (Bishop, *Pattern Recognition and
//! Machine Learning*, 2006, section 3.3). The root in (3) is how much wider than noise a residual is expected: while the twin
//! moves as it has not moved yet (the second term), and while it moves much, because no specimen is quite linear (the third).
//! One cannot tell a tolerance from a fault then, and so a residual counts less. What was learned is forgotten over a minute or
//! so: Σ is multiplied by 1 − b/M with every block of b samples.
//!
//! The first samples settle it. Later ones come in blocks, and a block is learned from when the next one has ended and nothing was
//! suspected in either: a fault that begins is not learned before it is suspected. A residual counts at most for a quarter of its
//! scale: no tolerance is larger, and one wild value of a broken line must not stay for a minute.
//!
//! What is left of a residual without it shows what has changed since, however far the specimen is from its twin. It does
//! not show what was there from the beginning, or comes more slowly than it follows: residuals as they are must be looked
//! at too.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require, same_length};
use crate::features::{Quantity, Sensors};
use crate::numeric::{cholesky, cholesky_solve};

/// A residual counts at most for this part of its scale.
const MOST: f64 = 0.25;

/// What a residual is explained by.
const TERMS: usize = 6;
/// Which of these are the twin's value, and that of the valve.
const VALUE: usize = 1;
const OF_VALVE: usize = 4;

/// What the twin's value, its first and its second derivative are multiplied by (1, s, s²): so that what specimens make of
/// each is of the order of [`PRIOR`].
const FACTORS: [f64; 3] = [3.0, 0.3, 0.006];

/// π: how large coefficients are, in parts of scale.
const PRIOR: f64 = 0.02;

/// σ: what no coefficient explains, in parts of scale. Eight times a sensor's usual noise, because it is no noise: what a motion
/// leaves is the same in sample after sample.
const UNEXPLAINED: f64 = 0.016;

/// κ: the part of each term that no specimen follows.
const NOT_LINEAR: [f64; TERMS - 1] = [0.005, 0.005, 0.1, 0.002, 0.0];

/// Nobody's noise is less, in parts of scale.
const LEAST_NOISE: f64 = 0.002;

/// A block has so much of the samples that settle a reference.
const BLOCK_SHARE: u32 = 2;

/// How long a reference takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Samples that it is learned from at first; at least 1.
    pub settle_samples: u32,
    /// Samples over which it forgets afterwards, at least as many.
    pub memory_samples: u32,
}

impl Settings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::SettingOutOfRange`].
    pub fn check(&self) -> Result<(), Error> {
        let (settle, memory) = (self.settle_samples, self.memory_samples);
        require(settle > 0, "settle_samples", f64::from(settle), "at least 1")?;
        let is_longer = memory >= settle;
        require(is_longer, "memory_samples", f64::from(memory), "at least settle_samples")
    }

    fn block_samples(&self) -> u32 {
        (self.settle_samples / BLOCK_SHARE).max(1)
    }

    /// What is kept of everything before when a block is added.
    fn kept(&self) -> f64 {
        1.0 - f64::from(self.block_samples()) / f64::from(self.memory_samples)
    }
}

/// The sums of (2) over some samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sums {
    /// Σ x xᵀ, row by row.
    squares: [[f64; TERMS]; TERMS],
    /// Σ x r
    products: [f64; TERMS],
}

impl Sums {
    const NONE: Sums = Sums { squares: [[0.0; TERMS]; TERMS], products: [0.0; TERMS] };

    fn take(&mut self, terms: &[f64; TERMS], residual: f64) {
        for (row, own) in self.squares.iter_mut().zip(terms) {
            row.iter_mut().zip(terms).for_each(|(sum, other)| *sum += own * other);
        }
        self.products.iter_mut().zip(terms).for_each(|(sum, own)| *sum += own * residual);
    }

    fn add(&mut self, kept: f64, other: &Sums) {
        let squares = self.squares.iter_mut().flatten().zip(other.squares.iter().flatten());
        let products = self.products.iter_mut().zip(&other.products);
        squares.chain(products).for_each(|(sum, other)| *sum = kept * *sum + other);
    }
}

/// Where the twin is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Followed {
    /// Where it began.
    first: f64,
    last: f64,
    /// By how much it changed last.
    change: f64,
}

/// What is remembered of one sensor, in parts of its scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Memory {
    twin: Option<Followed>,
    terms: [f64; TERMS],
    learned: Sums,
    /// The last whole block, and the one that has begun.
    waiting: Option<Sums>,
    block: Sums,
}

impl Memory {
    const NONE: Memory = Memory {
        twin: None,
        terms: [0.0; TERMS],
        learned: Sums::NONE,
        waiting: None,
        block: Sums::NONE,
    };

    /// Follows the twin by a sample.
    fn follow(&mut self, twin: f64, period_s: f64) {
        let usual = Followed { first: twin, last: twin, change: 0.0 };
        let Followed { first, last, change: last_change } = self.twin.unwrap_or(usual);
        let change = twin - last;
        let rate = change / period_s;
        let bend = (change - last_change) / (period_s * period_s);
        let [of_value, of_rate, of_bend] = FACTORS;
        self.terms = [1.0, of_value * (twin - first), of_rate * rate, of_bend * bend, 0.0, 0.0];
        self.twin = Some(Followed { first, last: twin, change });
    }
}

/// What (2) gives of a sensor.
#[derive(Debug, Clone)]
struct Explained {
    /// A⁻¹, which is asked for in every sample and made once a block.
    inverse: [[f64; TERMS]; TERMS],
    /// θ
    coefficients: [f64; TERMS],
    /// Of the terms but the first.
    centres: [f64; TERMS - 1],
}

impl Explained {
    fn by(sums: &Sums) -> Self {
        let mut factor = [0.0; TERMS * TERMS];
        factor.iter_mut().zip(sums.squares.iter().flatten()).for_each(|(a, sum)| *a = *sum);
        let prior = (UNEXPLAINED / PRIOR) * (UNEXPLAINED / PRIOR);
        (0..TERMS).for_each(|term| factor[term * (TERMS + 1)] += prior);
        let mut inverse = [[0.0; TERMS]; TERMS];
        let mut coefficients = [0.0; TERMS];
        // Sums of squares and a prior are positive definite; what is not finite explains nothing.
        if cholesky(&mut factor, TERMS, 0.0) {
            for (term, row) in inverse.iter_mut().enumerate() {
                row[term] = 1.0;
                cholesky_solve(&factor, TERMS, row);
            }
            coefficients = sums.products;
            cholesky_solve(&factor, TERMS, &mut coefficients);
        }
        let mut centres = [0.0; TERMS - 1];
        for term in [VALUE, OF_VALVE] {
            centres[term - 1] = sums.squares[0][term] / sums.squares[0][0].max(1.0);
        }
        Explained { inverse, coefficients, centres }
    }

    /// What is left of a residual: (3).
    fn left(&self, residual: f64, terms: &[f64; TERMS], noise: f64) -> f64 {
        let rows = self.inverse.iter().map(|row| product(row, terms));
        let spread = rows.zip(terms).fold(0.0, |sum, (row, term)| sum + row * term);
        let mut unexpected = UNEXPLAINED * UNEXPLAINED * spread;
        for (k, share) in NOT_LINEAR.iter().enumerate() {
            let moved = share * (terms[k + 1] - self.centres[k]);
            unexpected += moved * moved;
        }
        let widened = 1.0 + unexpected / (noise * noise);
        (residual - product(&self.coefficients, terms)) / libm::sqrt(widened)
    }
}

fn product(a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
    a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b)
}

/// What residuals of every sensor are in health, in fixed memory.
#[derive(Debug, Clone)]
pub struct Reference {
    settings: Settings,
    period_s: f64,
    noises: Vec<f64>,
    /// The spool in each sensor's unit, which is not itself.
    valves: Vec<Option<usize>>,
    samples: u64,
    /// Of the block that has begun, and whether something was suspected meanwhile.
    in_block: u32,
    is_suspect: bool,
    sensors: Vec<Memory>,
    explained: Vec<Explained>,
}

/// A stored [`Reference`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stored {
    samples: u64,
    in_block: u32,
    is_suspect: bool,
    sensors: Vec<Memory>,
}

impl Reference {
    /// One that has learned nothing, of some sensors, with so many seconds from sample to sample.
    ///
    /// # Errors
    /// As [`Settings::check`].
    pub fn new(settings: Settings, period_s: f64, sensors: &Sensors) -> Result<Self, Error> {
        settings.check()?;
        let list = &sensors.0;
        let valve = |place: usize| {
            let is_of = |other: &usize| {
                let (own, other) = (&list[place], &list[*other]);
                other.quantity == Quantity::Spool && own.unit.is_some() && other.unit == own.unit
            };
            (0..list.len()).find(is_of).filter(|valve| *valve != place)
        };
        Ok(Reference {
            settings,
            period_s,
            noises: list.iter().map(|sensor| sensor.noise.max(LEAST_NOISE)).collect(),
            valves: (0..list.len()).map(valve).collect(),
            samples: 0,
            in_block: 0,
            is_suspect: false,
            sensors: vec![Memory::NONE; list.len()],
            explained: vec![Explained::by(&Sums::NONE); list.len()],
        })
    }

    /// Takes a sample, and learns from it if it is trusted: of a specimen of which nothing is suspected. Does not allocate.
    ///
    /// # Panics
    /// If there are fewer values or scales than sensors; here and below.
    pub fn take(&mut self, measured: &[f64], twin: &[f64], scales: &[f64], is_trusted: bool) {
        self.samples += 1;
        let is_settling = self.samples <= u64::from(self.settings.settle_samples);
        self.follow(twin, scales);
        for (place, memory) in self.sensors.iter_mut().enumerate() {
            let residual = ((measured[place] - twin[place]) / scales[place]).clamp(-MOST, MOST);
            let sums = if is_settling { &mut memory.learned } else { &mut memory.block };
            sums.take(&memory.terms, residual);
        }
        if is_settling {
            if self.is_settled() {
                self.explain();
            }
            return;
        }
        self.in_block += 1;
        self.is_suspect |= !is_trusted;
        if self.in_block == self.settings.block_samples() {
            self.end_block();
        }
    }

    /// Follows the twin by a sample.
    fn follow(&mut self, twin: &[f64], scales: &[f64]) {
        for (place, memory) in self.sensors.iter_mut().enumerate() {
            memory.follow(twin[place] / scales[place], self.period_s);
        }
        for (place, valve) in self.valves.iter().enumerate() {
            let Some(valve) = valve else { continue };
            let [_, value, rate, ..] = self.sensors[*valve].terms;
            self.sensors[place].terms[OF_VALVE..].copy_from_slice(&[value, rate]);
        }
    }

    /// Learns from the block before, if neither is suspect.
    fn end_block(&mut self) {
        let kept = self.settings.kept();
        for memory in &mut self.sensors {
            let ended = core::mem::replace(&mut memory.block, Sums::NONE);
            let waited = memory.waiting.replace(ended);
            match waited.filter(|_| !self.is_suspect) {
                Some(waited) => memory.learned.add(kept, &waited),
                None if self.is_suspect => memory.waiting = None,
                None => (),
            }
        }
        (self.in_block, self.is_suspect) = (0, false);
        self.explain();
    }

    /// Until it has settled nothing is explained.
    fn explain(&mut self) {
        let is_settled = self.is_settled();
        for (explained, memory) in self.explained.iter_mut().zip(&self.sensors) {
            *explained = Explained::by(if is_settled { &memory.learned } else { &Sums::NONE });
        }
    }

    /// Whether it has learned from enough.
    pub fn is_settled(&self) -> bool {
        self.samples >= u64::from(self.settings.settle_samples)
    }

    /// The measured values of the sample that was taken last as they would be of a specimen that is its twin, into `values`;
    /// those of sensors in whose place something stands stay. Does not allocate.
    pub fn subtract(
        &self,
        measured: &[f64],
        twin: &[f64],
        scales: &[f64],
        stands_in: &[bool],
        values: &mut [f64],
    ) {
        for (place, value) in values.iter_mut().enumerate() {
            let (scale, terms) = (scales[place], &self.sensors[place].terms);
            let residual = (measured[place] - twin[place]) / scale;
            *value = if stands_in[place] {
                measured[place]
            } else {
                twin[place]
                    + scale * self.explained[place].left(residual, terms, self.noises[place])
            };
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        (self.samples, self.in_block, self.is_suspect) = (0, 0, false);
        self.sensors.fill(Memory::NONE);
        self.explain();
    }

    /// Everything that is remembered.
    pub fn store(&self) -> Stored {
        Stored {
            samples: self.samples,
            in_block: self.in_block,
            is_suspect: self.is_suspect,
            sensors: self.sensors.clone(),
        }
    }

    /// Takes over what was stored of as many sensors.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`].
    pub fn restore(&mut self, stored: &Stored) -> Result<(), Error> {
        same_length("sensors of a reference", self.sensors.len(), stored.sensors.len())?;
        (self.samples, self.in_block) = (stored.samples, stored.in_block);
        self.is_suspect = stored.is_suspect;
        self.sensors.clone_from_slice(&stored.sensors);
        self.explain();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::Sensor;
    use alloc::string::ToString;

    const SETTINGS: Settings = Settings { settle_samples: 400, memory_samples: 6000 };
    const PERIOD_S: f64 = 0.01;
    /// Of a spool and a pressure in one unit, and a pressure in another one.
    const SCALES: [f64; 3] = [1e-3, 2e7, 2e7];

    fn sensors() -> Sensors {
        let sensor = |name: &str, quantity, unit| Sensor {
            name: name.to_string(),
            quantity,
            unit: Some(unit),
            noise: 0.002,
            is_noisy: true,
        };
        let list = [
            sensor("x_v1", Quantity::Spool, 0),
            sensor("p_A1", Quantity::PressureA, 0),
            sensor("p_A2", Quantity::PressureA, 1),
        ];
        Sensors(list.to_vec())
    }

    fn reference() -> Reference {
        Reference::new(SETTINGS, PERIOD_S, &sensors()).unwrap()
    }

    /// Twins whose spool swings by a part of its scale, twice in three seconds.
    fn swinging(sample: usize, size: f64) -> [f64; 3] {
        let angle = 2.0 * core::f64::consts::PI * sample as f64 * PERIOD_S / 1.5;
        [size * libm::sin(angle), 0.5, 0.5]
    }

    /// Takes a sample, and says what is left; all in parts of scale.
    fn take(
        reference: &mut Reference,
        twin: [f64; 3],
        residual: [f64; 3],
        is_trusted: bool,
    ) -> [f64; 3] {
        let twin: [f64; 3] = core::array::from_fn(|k| twin[k] * SCALES[k]);
        let measured: [f64; 3] = core::array::from_fn(|k| twin[k] + residual[k] * SCALES[k]);
        reference.take(&measured, &twin, &SCALES, is_trusted);
        let mut values = [0.0; 3];
        reference.subtract(&measured, &twin, &SCALES, &[false; 3], &mut values);
        core::array::from_fn(|k| (values[k] - twin[k]) / SCALES[k])
    }

    /// The most that is left of what a specimen shows over some samples.
    fn most(
        reference: &mut Reference,
        samples: core::ops::Range<usize>,
        size: f64,
        shown: impl Fn([f64; 3], [f64; 3]) -> [f64; 3],
    ) -> [f64; 3] {
        let mut most = [0.0; 3];
        for sample in samples {
            let (before, twin) = (swinging(sample.max(1) - 1, size), swinging(sample, size));
            let left = take(reference, twin, shown(twin, before), true);
            most = core::array::from_fn(|k| f64::max(most[k], left[k].abs()));
        }
        most
    }

    #[test]
    fn a_residual_that_was_always_there_is_the_specimen_s_own() {
        let mut reference = reference();
        let shown = |_, _| [0.02, -0.03, 0.0];
        for sample in 0..400 {
            assert!(!reference.is_settled());
            most(&mut reference, sample..sample + 1, 0.0, shown);
        }
        assert!(reference.is_settled());
        let left = most(&mut reference, 400..500, 0.0, shown);
        assert!(left.iter().all(|left| *left < 1e-3), "{left:?}");
    }

    #[test]
    fn another_gain_and_a_lag_are_the_specimen_s_own_where_the_twin_moves() {
        let mut reference = reference();
        // A spool that goes two parts in a hundred farther, and comes a millisecond later.
        let shown = |twin: [f64; 3], before: [f64; 3]| {
            [0.02 * twin[0] - 0.1 * (twin[0] - before[0]), 0.0, 0.0]
        };
        most(&mut reference, 0..400, 0.5, shown);
        let left = most(&mut reference, 400..600, 0.5, shown);
        assert!(left[0] < 1e-3, "{left:?} of 0.01");
    }

    #[test]
    fn a_pressure_follows_the_valve_of_its_own_unit() {
        let mut reference = reference();
        let shown = |twin: [f64; 3], _| [0.0, 0.02 * twin[0], 0.02 * twin[0]];
        most(&mut reference, 0..400, 0.5, shown);
        let [_, own, other] = most(&mut reference, 400..600, 0.5, shown);
        assert!(own < 1e-3 && other > 5e-3, "{own} {other}");
    }

    #[test]
    fn a_motion_that_was_not_met_yet_says_little_and_one_that_was_says_more() {
        let shown = |twin: [f64; 3], _| [0.04 * twin[0], 0.0, 0.0];
        let healthy = |_, _| [0.0; 3];
        let mut at_rest = reference();
        most(&mut at_rest, 0..400, 0.0, healthy);
        let unknown = most(&mut at_rest, 400..500, 0.5, shown)[0];
        let mut in_motion = reference();
        most(&mut in_motion, 0..400, 0.5, healthy);
        let known = most(&mut in_motion, 400..500, 0.5, shown)[0];
        assert!(unknown < 0.006 && known > 1.5 * unknown, "{unknown} {known}");
        // Where nothing moves both know the same.
        let still = |_, _| [0.02, 0.0, 0.0];
        for mut reference in [at_rest, in_motion] {
            most(&mut reference, 500..510, 0.0, still);
            let left = most(&mut reference, 510..511, 0.0, still)[0];
            assert!(left > 0.01, "{left}");
        }
    }

    #[test]
    fn what_changes_is_learned_slowly_and_never_at_once() {
        let mut reference = reference();
        most(&mut reference, 0..400, 0.0, |_, _| [0.0; 3]);
        let shown = |_, _| [0.02, 0.0, 0.0];
        let still = |reference: &mut Reference, samples| most(reference, samples, 0.0, shown)[0];
        let first = still(&mut reference, 400..401);
        assert!(first > 0.015);
        // A block is 200 samples, and waits for the next one.
        let later = still(&mut reference, 798..799);
        assert_eq!(first, later);
        still(&mut reference, 799..1600);
        let soon = still(&mut reference, 1600..1601);
        assert!(soon < 0.9 * first && soon > 0.2 * first, "{soon}");
        still(&mut reference, 1601..60_000);
        assert!(still(&mut reference, 60_000..60_001) < 1e-3);
    }

    #[test]
    fn what_is_suspected_is_not_learned_nor_the_block_before() {
        let mut reference = reference();
        most(&mut reference, 0..400, 0.0, |_, _| [0.0; 3]);
        let learned = reference.store();
        let fault = [0.02, 0.0, 0.0];
        for sample in 0..2000 {
            // A fault begins in the first block and is suspected at the end of the second.
            let is_suspected = sample >= 390;
            take(&mut reference, [0.0, 0.5, 0.5], fault, !is_suspected);
        }
        let pairs = learned
            .sensors
            .iter()
            .zip(&reference.store().sensors)
            .map(|(a, b)| (a.learned, b.learned))
            .collect::<Vec<_>>();
        assert!(pairs.iter().all(|(before, after)| before == after));
    }

    #[test]
    fn one_wild_value_moves_little() {
        let mut reference = reference();
        most(&mut reference, 0..399, 0.0, |_, _| [0.0; 3]);
        take(&mut reference, [0.0, 0.5, 0.5], [1e300, 0.0, 0.0], true);
        let left = most(&mut reference, 400..401, 0.0, |_, _| [0.0; 3])[0];
        assert!(left > 0.0 && left < MOST / 400.0, "{left}");
    }

    #[test]
    fn what_stands_in_for_a_sensor_has_no_tolerance() {
        let mut reference = reference();
        most(&mut reference, 0..401, 0.0, |_, _| [0.02; 3]);
        let (twin, measured) = ([0.0; 3], SCALES.map(|scale| 0.02 * scale));
        let mut values = [0.0; 3];
        reference.subtract(&measured, &twin, &SCALES, &[false, true, false], &mut values);
        assert_eq!(values[1], measured[1]);
        assert!(values[0].abs() < 1e-3 * SCALES[0] && values[2].abs() < 1e-3 * SCALES[2]);
    }

    #[test]
    fn what_was_stored_goes_on_and_what_is_impossible_is_refused() {
        let shown = |twin: [f64; 3], _| [0.03 * twin[0], 0.01, 0.0];
        for stop in [1, 250, 400, 555, 1234] {
            let mut one = reference();
            most(&mut one, 0..stop, 0.4, shown);
            let mut other = reference();
            other.restore(&one.store()).unwrap();
            let [a, b] = [&mut one, &mut other].map(|own| most(own, stop..stop + 900, 0.4, shown));
            assert_eq!(a.map(f64::to_bits), b.map(f64::to_bits));
            assert_eq!(one.store(), other.store());
            one.clear();
            assert_eq!(one.store(), reference().store());
        }
        let fewer = Sensors(sensors().0[..2].to_vec());
        let mut of_fewer = Reference::new(SETTINGS, PERIOD_S, &fewer).unwrap();
        assert!(of_fewer.restore(&reference().store()).is_err());
        for (settle_samples, memory_samples) in [(0, 10), (10, 9)] {
            let settings = Settings { settle_samples, memory_samples };
            assert!(Reference::new(settings, PERIOD_S, &sensors()).is_err());
        }
    }
}
