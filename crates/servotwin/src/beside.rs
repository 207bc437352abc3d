//! Compares sensors with their twins: units, signs, exchanged and copied columns, and pressures without the atmosphere.
//!
//! These are mistakes of columns, not faults of the actuator. Each one is claimed only if it explains the difference
//! almost completely; a fault of a sensor or of a component leaves more.

use crate::system::imperfection::Imperfection;
use crate::system::{Sensor, System};
use crate::text::rounded;
use crate::units::{self, ATMOSPHERE_PA, Misread, NamedUnit};
use servotwin_model::spec::Unit;
use std::borrow::Cow;

/// Largest share of the difference that a mistake may leave unexplained.
const UNEXPLAINED: f64 = 0.05;
/// Fewer samples are no evidence.
const LEAST_SAMPLES: u64 = 20;
/// A position that leaves its mean by the first share of its scale, beside a twin at rest, moves far. By the second, no
/// bias of a sensor, a valve or a controller moves it, however slowly it drifts.
const FAR: f64 = 0.05;
const BEYOND_BIAS: f64 = 0.1;
/// How far ahead of a position its command may be, s. A slow motion needs no lead, and one in steps needs some.
const LEADS_S: [f64; 3] = [0.0, 0.05, 0.2];
/// A difference or a motion below this share of a sensor's scale is no evidence.
const LEAST_SHARE: f64 = 0.01;
/// A difference below this many deviations of a sensor is noise.
const CLEAR_DEVIATIONS: f64 = 3.0;
/// A sensor takes the place of another one only if this shortens the distances to their twins by this share.
const BETTER: f64 = 0.2;
/// A column in another unit leaves at most this share of the twin's variance unexplained.
const OTHER_UNIT: f64 = 0.25;
/// With a smaller share of unexplained motion, the column of the command is right.
const LEAST_UNEXPLAINED: f64 = 0.01;
/// Nor is its unit wrong if positions move as far as their twins, up to this logarithm. Beyond, the logarithm may be too
/// large by a share.
const LEAST_RATIO: f64 = 0.4;
const RATIO_ERROR: f64 = 0.3;
/// Below this factor, and at most this share.
const SMALL_FACTOR: f64 = 5.0;
const UNEXPLAINED_BY_SMALL: f64 = 0.01;
/// Signals that stand still are exchanged only if they differ by more than this share of a scale.
const CLEAR_SHARE: f64 = 0.5;
/// Largest error of an offset that counts as one atmosphere.
const NEARLY: f64 = 0.25;
/// The same for some of the pressures, whose difference is otherwise noise up to this many deviations.
const EXACTLY: f64 = 0.1;
const CLEAR_NOISE: f64 = 1.5;
/// The standard errors of an estimate that are no accident.
const SURE: f64 = 3.0;

/// Running sums of values.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Spread {
    /// Number of values.
    pub count: u64,
    sum: f64,
    square: f64,
}

impl Spread {
    /// Takes one finite value.
    pub fn take(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.square += value * value;
    }

    /// Takes the values of another.
    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.square += other.square;
    }

    /// The mean; 0 without a value.
    pub(crate) fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }

    /// The mean of the squares; 0 without a value.
    pub(crate) fn mean_square(&self) -> f64 {
        self.square / self.count.max(1) as f64
    }

    /// The variance; 0 without a value.
    pub(crate) fn variance(&self) -> f64 {
        (self.mean_square() - self.mean().powi(2)).max(0.0)
    }
}

/// Running comparison of a sensor's values with a twin's.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct TwinComparison {
    /// Spread of the sensor's values.
    pub(crate) own: Spread,
    /// Spread of the twin's values.
    pub(crate) twin: Spread,
    product: f64,
}

impl TwinComparison {
    /// Takes one pair of values, unless one is missing (NaN).
    pub(crate) fn take(&mut self, own: f64, twin: f64) {
        if own.is_finite() && twin.is_finite() {
            self.own.take(own);
            self.twin.take(twin);
            self.product += own * twin;
        }
    }

    /// Takes the pairs of another.
    fn add(&mut self, other: &Self) {
        self.own.add(&other.own);
        self.twin.add(&other.twin);
        self.product += other.product;
    }

    /// The mean of sensor minus twin.
    pub(crate) fn offset(&self) -> f64 {
        self.own.mean() - self.twin.mean()
    }

    /// The variance of `factor` times the sensor minus the twin.
    pub(crate) fn variance(&self, factor: f64) -> f64 {
        let product = self.product / self.own.count.max(1) as f64;
        let covariance = product - self.own.mean() * self.twin.mean();
        let (own, twin) = (self.own.variance(), self.twin.variance());
        (factor * factor * own - 2.0 * factor * covariance + twin).max(0.0)
    }

    /// The gain of the sensor beside the twin: the slope of the regression.
    fn gain(&self) -> f64 {
        let (own, twin) = (self.own.variance(), self.twin.variance());
        0.5 * (own + twin - self.variance(1.0)) / twin
    }

    /// The mean square of sensor minus twin.
    fn misfit(&self) -> f64 {
        self.variance(1.0) + self.offset().powi(2)
    }

    /// Whether the twin moves enough to compare motions.
    pub(crate) fn moves(&self, scale: f64) -> bool {
        self.own.count >= LEAST_SAMPLES && self.twin.variance().sqrt() > LEAST_SHARE * scale
    }

    /// Whether a flipped sign explains the difference: sensor plus twin hardly vary.
    pub(crate) fn is_turned(&self) -> bool {
        self.variance(-1.0) < UNEXPLAINED * self.variance(1.0)
    }
}

/// A sensor, as a log has it.
pub struct SensorColumn<'s> {
    /// Its name in sentences.
    pub(crate) name: Cow<'s, str>,
    /// The sensor of the system.
    pub(crate) sensor: &'s Sensor,
    /// The standard deviation of its noise, SI.
    pub(crate) deviation: f64,
    /// The unit in which the log is read.
    pub(crate) unit: &'static NamedUnit,
}

impl<'s> SensorColumn<'s> {
    /// A sensor of a system, read in `unit`.
    pub fn new(system: &'s System, sensor: usize, unit: &'static NamedUnit) -> Self {
        let deviation = Imperfection::of(system, sensor).deviation();
        let sensor = &system.sensors[sensor];
        SensorColumn { name: (&sensor.id).into(), sensor, deviation, unit }
    }
}

/// A sensor whose values agree with the twin in another unit.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherUnit {
    /// The index of the sensor.
    pub sensor: usize,
    /// Its values are this many times those of the twin.
    pub(crate) ratio: f64,
    /// How it was read.
    pub misread: Misread,
}

/// A mistake of the column of an input, by which the twin flies something else than the actuator.
#[derive(Debug, Clone, PartialEq)]
pub enum InputMistake {
    /// It is in another unit.
    Unit(Misread),
    /// It is exchanged with the column of this sensor.
    Exchanged(usize),
    /// It stands still while the actuator flies `factor · (x + lead_s · dx/dt)`, where x are this sensor's values, SI: the
    /// lead is what an actuator is behind its command.
    Still {
        /// The index of the sensor.
        sensor: usize,
        /// See above.
        factor: f64,
        /// See above, s.
        lead_s: f64,
    },
}

impl InputMistake {
    /// Says which mistake it is of an input of this name and unit.
    pub fn in_words(
        &self,
        (input, declared): (&str, &NamedUnit),
        columns: &[SensorColumn],
    ) -> String {
        match self {
            Self::Unit(misread) => {
                let (seems, remedy) = misread.in_words(declared);
                format!("{input} seems {seems}: the twin then follows the sensors; {remedy}")
            }
            Self::Exchanged(sensor) => format!(
                "{input} and {} look exchanged: the twin follows the sensors the other way round",
                columns[*sensor].name
            ),
            Self::Still { sensor, .. } => format!(
                "{input} stands still while the sensors move as those of a healthy actuator that is commanded to the \
                 values of {}: it is no column of the command; if the actuator moves without a command, \
                 {input} = {{ value = … }} in a map file says that it stands still",
                columns[*sensor].name
            ),
        }
    }
}

/// Every sensor beside the twin of every sensor.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Comparisons {
    width: usize,
    cells: Vec<TwinComparison>,
}

impl Comparisons {
    /// An empty comparison of a number of sensors.
    pub fn new(width: usize) -> Self {
        Comparisons { width, cells: vec![TwinComparison::default(); width * width] }
    }

    /// Takes one sample of all sensors and of their twins, SI; NaN is missing.
    pub fn take(&mut self, measured: &[f64], twin: &[f64]) {
        for (cells, &own) in self.cells.chunks_exact_mut(self.width.max(1)).zip(measured) {
            cells.iter_mut().zip(twin).for_each(|(cell, &twin)| cell.take(own, twin));
        }
    }

    /// Takes the samples of another comparison of the same sensors.
    fn add(&mut self, other: &Self) {
        self.cells.iter_mut().zip(&other.cells).for_each(|(cell, other)| cell.add(other));
    }

    /// Pairs of sensors with the same moving values, although their twins differ. Same values have the same sums.
    fn copies(&self, columns: &[SensorColumn]) -> Vec<[usize; 2]> {
        let sums = |sensor: usize| (0..self.width).map(move |twin| self.at(sensor, twin));
        let least = |sensor: usize| {
            let SensorColumn { sensor, deviation, .. } = &columns[sensor];
            (CLEAR_DEVIATIONS * deviation).max(LEAST_SHARE * sensor.scale)
        };
        let is_copy = |&[other, one]: &[usize; 2]| {
            let [own, beside] = [one, other].map(|twin| self.at(one, twin));
            let moves = own.own.variance().sqrt() > LEAST_SHARE * columns[one].sensor.scale;
            // Least distances of the twins: of their means, and along the sensor's values.
            let means = (own.twin.mean() - beside.twin.mean()).abs();
            let products = (own.product - beside.product).abs() / own.own.count.max(1) as f64;
            let distance = means.max(products / own.own.mean_square().sqrt());
            own.own.count >= LEAST_SAMPLES
                && moves
                && sums(one).eq(sums(other))
                && distance > least(one).max(least(other))
        };
        let pairs = (0..self.width).flat_map(|one| (0..one).map(move |other| [other, one]));
        pairs.filter(is_copy).collect()
    }

    /// A sensor beside its own twin.
    pub(crate) fn of(&self, sensor: usize) -> &TwinComparison {
        self.at(sensor, sensor)
    }

    fn at(&self, sensor: usize, twin: usize) -> &TwinComparison {
        &self.cells[sensor * self.width + twin]
    }

    /// Groups of sensors that follow each other's twins instead of their own: each follows that of the next, and the
    /// last that of the first.
    pub(crate) fn exchanged(&self, columns: &[SensorColumn]) -> Vec<Vec<usize>> {
        let twins = self.nearest_twins(columns);
        let mut groups: Vec<Vec<usize>> = vec![];
        for first in 0..self.width {
            if twins[first] == first || groups.iter().flatten().any(|&sensor| sensor == first) {
                continue;
            }
            let next = |&sensor: &usize| Some(twins[sensor]).filter(|&next| next != first);
            let group: Vec<usize> = std::iter::successors(Some(first), next).collect();
            if self.is_exchanged(columns, &group) {
                groups.push(group);
            }
        }
        groups
    }

    /// The twin that each sensor follows: two sensors of one unit exchange their twins as long as this shortens the
    /// distances. It undoes every permutation, because distances obey the triangle inequality.
    fn nearest_twins(&self, columns: &[SensorColumn]) -> Vec<usize> {
        let mut twins: Vec<usize> = (0..self.width).collect();
        let distance = |sensor: usize, twin: usize| {
            self.at(sensor, twin).misfit().sqrt() / columns[twin].sensor.scale
        };
        let has_values = |sensor: usize| self.of(sensor).own.count >= LEAST_SAMPLES;
        let pairs = (0..self.width).flat_map(|one| (one + 1..self.width).map(move |o| (one, o)));
        let is_alike = |&(one, other): &(usize, usize)| {
            let units = [one, other].map(|sensor| columns[sensor].sensor.unit);
            units[0] == units[1] && has_values(one) && has_values(other)
        };
        let pairs: Vec<(usize, usize)> = pairs.filter(is_alike).collect();
        loop {
            let gain = |&(one, other): &(usize, usize)| {
                let now = distance(one, twins[one]) + distance(other, twins[other]);
                let then = distance(one, twins[other]) + distance(other, twins[one]);
                (now - then > BETTER * now).then_some((now - then, (one, other)))
            };
            let best = pairs.iter().filter_map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, (one, other))) = best else { return twins };
            twins.swap(one, other);
        }
    }

    /// Whether an exchange explains almost all of what sensors differ from their twins.
    fn is_exchanged(&self, columns: &[SensorColumn], group: &[usize]) -> bool {
        let scale = |sensor: usize| columns[sensor].sensor.scale;
        let twins = || group.iter().cycle().skip(1);
        let explains = |of: fn(&TwinComparison) -> f64| {
            // Noise is explained by nothing.
            let part = |(&sensor, &twin): (&usize, &usize)| {
                let noise = columns[twin].deviation.powi(2);
                (of(self.at(sensor, twin)) - noise).max(0.0) / scale(twin).powi(2)
            };
            let now: f64 = group.iter().zip(group).map(part).sum();
            let then: f64 = group.iter().zip(twins()).map(part).sum();
            then < UNEXPLAINED * now
        };
        let is_clear = |least: &dyn Fn(usize) -> f64| {
            group.iter().all(|&sensor| self.of(sensor).misfit().sqrt() > least(sensor))
        };
        // A fault may shift two chambers until each shows the level of the other, but not their motions.
        let moves = group.iter().any(|&sensor| self.of(sensor).moves(scale(sensor)));
        explains(TwinComparison::misfit)
            && match moves {
                true => {
                    is_clear(&|sensor| CLEAR_DEVIATIONS * columns[sensor].deviation)
                        && explains(|cell| cell.variance(1.0))
                }
                false => is_clear(&|sensor| CLEAR_SHARE * scale(sensor)),
            }
    }

    /// Whether a sensor follows its twin; `None` if the twin does not move.
    fn follows(&self, sensor: usize, columns: &[SensorColumn]) -> Option<bool> {
        let own = self.of(sensor);
        let moves = own.moves(columns[sensor].sensor.scale);
        moves.then(|| own.variance(1.0) < OTHER_UNIT * own.twin.variance())
    }

    /// The unit that would explain the ratio between a sensor and its twin.
    pub fn unit_beside(&self, sensor: usize, column: &SensorColumn) -> Option<OtherUnit> {
        let beside = self.of(sensor);
        let shows_unit = beside.own.count >= LEAST_SAMPLES
            && beside.twin.mean_square().sqrt() > LEAST_SHARE * column.sensor.scale;
        let ratio = (beside.own.mean_square() / beside.twin.mean_square()).sqrt();
        let misread = shows_unit.then(|| units::misread(column.unit, ratio)).flatten()?;
        Some(OtherUnit { sensor, ratio, misread })
    }

    /// The sensors that are in another unit: their motions agree with those of the twin in that unit. Signals that stand
    /// still have no motion, so that the other sensors must follow their twins.
    pub fn other_units(&self, columns: &[SensorColumn]) -> Vec<OtherUnit> {
        let beside = columns.iter().enumerate();
        let mut found: Vec<OtherUnit> =
            beside.filter_map(|(sensor, column)| self.unit_beside(sensor, column)).collect();
        let is_found = |sensor: usize| found.iter().any(|other| other.sensor == sensor);
        let others = (0..self.width).filter(|&sensor| !is_found(sensor));
        let others: Vec<bool> = others.filter_map(|sensor| self.follows(sensor, columns)).collect();
        let is_healthy = !others.is_empty() && !others.contains(&false);
        found.retain(|other| {
            let (beside, column) = (self.of(other.sensor), &columns[other.sensor]);
            let factor = other.misread.factor();
            let left = beside.variance(factor) / beside.twin.variance();
            match (beside.moves(column.sensor.scale), factor.ln().abs() < SMALL_FACTOR.ln()) {
                (true, false) => left < OTHER_UNIT,
                // A fault of the actuator may move a sensor two or three times as far.
                (true, true) => left < UNEXPLAINED_BY_SMALL && is_healthy,
                (false, _) => is_healthy,
            }
        });
        found
    }

    /// The pressures that are one atmosphere off while they stand still, in words: a faulty sensor explains them, too.
    pub fn atmosphere_at_rest(&self, columns: &[SensorColumn]) -> Option<String> {
        let words = self.without_atmosphere(columns, true)?;
        Some(format!("{words}; while nothing moves, an offset of a faulty sensor looks the same"))
    }

    /// The pressures that are one atmosphere below or, if they are read as gauge pressures, above their twins, in words:
    /// all, or some beside others that agree with theirs. A unit that states *absolute* is believed.
    fn without_atmosphere(&self, columns: &[SensorColumn], at_rest: bool) -> Option<String> {
        let is_pressure = |sensor: &usize| {
            columns[*sensor].sensor.unit == Unit::Pascal
                && !columns[*sensor].unit.is_absolute
                && self.of(*sensor).own.count >= LEAST_SAMPLES
        };
        let pressures: Vec<usize> = (0..self.width).filter(is_pressure).collect();
        let is_steady = |sensor: usize| self.of(sensor).variance(1.0).sqrt() < ATMOSPHERE_PA;
        let steady: Vec<usize> = pressures.iter().copied().filter(|&s| is_steady(s)).collect();
        let atmospheres = |sensor: usize| self.of(sensor).offset() / ATMOSPHERE_PA;
        let sign = if steady.iter().any(|&s| atmospheres(s) > 1.0 - NEARLY) { 1.0 } else { -1.0 };
        let error = |sensor: usize| (sign * atmospheres(sensor) - 1.0).abs();
        // A fault may lower two chambers by one atmosphere, and the supply by more.
        let are_most = steady.len() > 2 || steady.len() == pressures.len().max(2);
        if are_most && steady.iter().all(|&sensor| error(sensor) < NEARLY) {
            return Some(atmosphere_in_words(sign, &steady, columns));
        }
        // A single offset may be a fault, so that it must be one atmosphere and nothing else.
        let most = |of_mean_pa: f64| (EXACTLY + SURE * of_mean_pa / ATMOSPHERE_PA).min(NEARLY);
        // A gain that is too low by a few per cent shifts the level, too. Only motion, which it shrinks, tells the two apart.
        let is_shifted =
            |own: &TwinComparison, SensorColumn { deviation, sensor, .. }: &SensorColumn| {
                if at_rest && !own.moves(sensor.scale) {
                    return true;
                }
                let error = deviation / (own.twin.variance() * own.own.count as f64).sqrt();
                let too_high = own.gain() - 1.0;
                let of_level = own.offset() / own.twin.mean();
                too_high.abs() < SURE * error && (too_high - of_level).abs() > SURE * error
            };
        let is_low = |&sensor: &usize| {
            let (own, column) = (self.of(sensor), &columns[sensor]);
            column.unit.is_proportional() == (sign < 0.0)
                && error(sensor) < most(column.deviation / (own.own.count as f64).sqrt())
                && own.variance(1.0) < (CLEAR_NOISE * column.deviation).powi(2)
                && is_shifted(own, column)
        };
        let (low, others): (Vec<usize>, Vec<usize>) = pressures.iter().copied().partition(is_low);
        let agrees = |&sensor: &usize| is_steady(sensor) && atmospheres(sensor).abs() < NEARLY;
        let is_clear = !low.is_empty() && others.iter().all(agrees);
        is_clear.then(|| atmosphere_in_words(sign, &low, columns))
    }

    /// The shares of the motions of the positions that the twin does not explain, from the smallest to the largest.
    fn unexplained(&self, columns: &[SensorColumn]) -> Vec<f64> {
        let share = |(sensor, column): (usize, &SensorColumn)| {
            let beside = self.of(sensor);
            let most = beside.own.variance().max(beside.twin.variance());
            let least = (LEAST_SHARE * column.sensor.scale).powi(2);
            let has_evidence = beside.own.count >= LEAST_SAMPLES && most > least;
            has_evidence.then(|| beside.variance(1.0) / most)
        };
        let mut shares: Vec<f64> = positions(columns).filter_map(share).collect();
        shares.sort_by(f64::total_cmp);
        shares
    }

    /// Whether a position or its twin moves.
    pub fn has_motion(&self, columns: &[SensorColumn]) -> bool {
        !self.unexplained(columns).is_empty()
    }

    /// The mistakes that an input may have, by how far the positions move beside their twins. A twin whose command is
    /// too large may reach its limits, and the sensors then seem less small than they are.
    fn likely_mistakes(
        &self,
        declared: &'static NamedUnit,
        columns: &[SensorColumn],
    ) -> Vec<InputMistake> {
        let sensors = positions(columns).map(|(sensor, _)| sensor);
        let moves = |&sensor: &usize| self.of(sensor).moves(columns[sensor].sensor.scale);
        let ratio = |sensor: usize| {
            let beside = self.of(sensor);
            0.5 * (beside.own.variance() / beside.twin.variance()).ln()
        };
        let ratios = sensors.clone().filter(moves).map(ratio);
        let farthest = ratios.max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let is_likely = |misread: &Misread| {
            let factor = misread.factor().ln();
            farthest
                .is_none_or(|ratio| ratio.abs() > LEAST_RATIO && factor / ratio > 1.0 - RATIO_ERROR)
        };
        let units = units::misreadings(declared).into_iter().filter(is_likely);
        units.map(InputMistake::Unit).chain(sensors.map(InputMistake::Exchanged)).collect()
    }

    /// Whether the twin of a position moves.
    pub fn twin_moves(&self, columns: &[SensorColumn]) -> bool {
        positions(columns).any(|(sensor, column)| self.of(sensor).moves(column.sensor.scale))
    }

    /// Whether positions move far while the twins of all stand still.
    pub fn is_still(&self, columns: &[SensorColumn]) -> bool {
        !self.twin_moves(columns) && self.moving_beyond(FAR, columns).next().is_some()
    }

    /// The positions that leave their mean by more than a share of their scale.
    fn moving_beyond(&self, share: f64, columns: &[SensorColumn]) -> impl Iterator<Item = usize> {
        let moves = move |(sensor, column): &(usize, &SensorColumn)| {
            self.of(*sensor).own.variance().sqrt() > share * column.sensor.scale
        };
        positions(columns).filter(moves).map(|(sensor, _)| sensor)
    }

    /// A column of the command that stands still while all sensors move as those of a healthy actuator that flies one of
    /// them; `rerun` as in [`Comparisons::input_mistake`].
    ///
    /// # Errors
    /// What `rerun` reports.
    pub(crate) fn still_input<E>(
        &self,
        columns: &[SensorColumn],
        rerun: &mut dyn FnMut(&InputMistake) -> Result<Option<Comparisons>, E>,
    ) -> Result<Option<InputMistake>, E> {
        if !self.is_still(columns) {
            return Ok(None);
        }
        let flown = self.moving_beyond(BEYOND_BIAS, columns);
        for (sensor, lead_s) in flown.flat_map(|sensor| LEADS_S.map(|lead_s| (sensor, lead_s))) {
            let mut mistake = InputMistake::Still { sensor, factor: 1.0, lead_s };
            // The twin of the first run says how far the position goes for a command.
            let Some(first) = rerun(&mistake)? else { continue };
            let TwinComparison { own, twin, .. } = first.of(sensor);
            let factor = (own.variance() / twin.variance()).sqrt();
            mistake = InputMistake::Still { sensor, factor, lead_s };
            let Some(undone) = rerun(&mistake)? else { continue };
            let moving: Vec<bool> =
                (0..self.width).filter_map(|sensor| undone.follows(sensor, columns)).collect();
            if moving.len() > 1 && !moving.contains(&false) {
                return Ok(Some(mistake));
            }
        }
        Ok(None)
    }

    /// Reports a mistake of the column of an input: with it the twin follows the sensors, which it does not without.
    /// `rerun` compares the sensors with the twin of a log with the mistake undone; `None` if that is impossible.
    ///
    /// # Errors
    /// What `rerun` reports.
    pub fn input_mistake<E>(
        &self,
        input: (&str, &'static NamedUnit),
        columns: &[SensorColumn],
        rerun: &mut dyn FnMut(&InputMistake) -> Result<Option<Comparisons>, E>,
    ) -> Result<Option<String>, E> {
        let left = self.unexplained(columns);
        // A wrong command moves the twins of all sensors, a mistake or a fault of one sensor does not.
        if left.first().is_none_or(|least| *least < LEAST_UNEXPLAINED) {
            return Ok(None);
        }
        for mistake in self.likely_mistakes(input.1, columns) {
            let Some(undone) = rerun(&mistake)? else { continue };
            let then = undone.unexplained(columns);
            let is_explained = then.len() == left.len()
                && then.iter().zip(&left).all(|(then, now)| *then < UNEXPLAINED * now);
            if is_explained {
                return Ok(Some(mistake.in_words(input, columns)));
            }
        }
        let still = self.still_input(columns, rerun)?;
        Ok(still.map(|mistake| mistake.in_words(input, columns)))
    }

    /// All mistakes of columns, as sentences.
    pub fn mistakes(&self, columns: &[SensorColumn]) -> Vec<String> {
        let pressures = self.without_atmosphere(columns, false);
        self.mistakes_in_motion(columns).into_iter().chain(pressures).collect()
    }

    /// The mistakes that motion shows. An offset is none: a drifting sensor has any offset for a while.
    fn mistakes_in_motion(&self, columns: &[SensorColumn]) -> Vec<String> {
        let units = other_units_in_words(columns, &self.other_units(columns));
        let copies = self.copies(columns).into_iter().map(|pair| {
            let [one, other] = pair.map(|sensor| &columns[sensor].name);
            format!("{one} and {other} have the same values: one is a copy of the other")
        });
        // A command of the wrong sign exchanges chambers, too.
        let turned = self
            .turned_positions(columns)
            .or_else(|| exchanged_in_words(&self.exchanged(columns), columns))
            .or_else(|| self.turned_pressures(columns));
        copies.chain(units).chain(turned).collect()
    }

    /// Reports positions that move against the twin. If most do, the command has the wrong sign.
    fn turned_positions(&self, columns: &[SensorColumn]) -> Option<String> {
        let (turned, moving) = self.turned(columns, |unit| unit != Unit::Pascal);
        let verb = if turned.len() == 1 { "moves" } else { "move" };
        let seems = match turned.len() {
            0 => return None,
            most if most > 1 && 2 * most > moving => "the sign of the command seems to be wrong",
            _ => "the sign seems to be wrong, factor = -1 in the map turns it",
        };
        Some(format!("{} {verb} against the twin: {seems}", turned.join(", ")))
    }

    /// Reports pressures that move against the twin although nothing else does. A pressure has no sign: one that moves
    /// against its twin is another's, or belongs to a command of the wrong sign.
    fn turned_pressures(&self, columns: &[SensorColumn]) -> Option<String> {
        let (turned, _) = self.turned(columns, |unit| unit == Unit::Pascal);
        let advice = "a pressure has no sign, so look at which column it is";
        (!turned.is_empty())
            .then(|| format!("{}: moving against the twin; {advice}", turned.join(", ")))
    }

    /// The names of the moving sensors that move against the twin, and how many move.
    fn turned<'c>(
        &self,
        columns: &'c [SensorColumn],
        is_of: fn(Unit) -> bool,
    ) -> (Vec<&'c str>, usize) {
        let is_moving = |(sensor, column): &(usize, &SensorColumn)| {
            is_of(column.sensor.unit) && self.of(*sensor).moves(column.sensor.scale)
        };
        let moving: Vec<_> = columns.iter().enumerate().filter(is_moving).collect();
        let turned = moving.iter().filter(|(sensor, _)| self.of(*sensor).is_turned());
        (turned.map(|(_, column)| &*column.name).collect(), moving.len())
    }
}

/// The sensors that measure no pressure.
fn positions<'c, 's>(
    columns: &'c [SensorColumn<'s>],
) -> impl Iterator<Item = (usize, &'c SensorColumn<'s>)> + Clone {
    columns.iter().enumerate().filter(|(_, column)| column.sensor.unit != Unit::Pascal)
}

/// Sensors beside their twins in one pane of 2 s after the other, because columns may change within a record. `T` is a
/// place in it.
pub struct Panes<T> {
    /// The samples of a pane, and of the current one.
    samples: (u64, u64),
    pane: Comparisons,
    /// All panes since the first of those that contradict the columns, and their number.
    since: Comparisons,
    wrong: u32,
    /// The first places of both.
    begins: [T; 2],
}

/// The length of a pane, s.
const PANE_S: f64 = 2.0;
/// The number of successive panes that must contradict the columns. Panes without motion do not count.
pub const PANES: u32 = 4;

impl<T: Copy + Default> Panes<T> {
    /// Before the first sample of a number of sensors.
    pub fn new(width: usize, period_s: f64) -> Self {
        let samples = ((PANE_S / period_s).ceil() as u64, 0);
        let [pane, since] = [Comparisons::new(width), Comparisons::new(width)];
        Panes { samples, pane, since, wrong: 0, begins: Default::default() }
    }

    /// The number of samples in a pane.
    pub fn samples(&self) -> usize {
        self.samples.0 as usize
    }

    /// Begins a pane anew.
    pub fn restart(&mut self) {
        (self.samples.1, self.wrong) = (0, 0);
        self.pane = Comparisons::new(self.pane.width);
    }

    /// Takes the place of a sample, the values of all sensors and of their twins, SI. Returns the pane that it ends, with
    /// its first place.
    pub fn take(&mut self, place: T, measured: &[f64], twin: &[f64]) -> Option<(T, Comparisons)> {
        if self.samples.1 == 0 {
            self.begins[0] = place;
            if self.wrong == 0 {
                (self.begins[1], self.since) = (place, Comparisons::new(self.pane.width));
            }
        }
        self.pane.take(measured, twin);
        self.samples.1 += 1;
        if self.samples.1 < self.samples.0 {
            return None;
        }
        self.samples.1 = 0;
        let pane = std::mem::replace(&mut self.pane, Comparisons::new(self.since.width));
        self.since.add(&pane);
        Some((self.begins[0], pane))
    }

    /// The mistakes of the last panes, given the last one, and the place where they begin.
    pub fn mistakes(
        &mut self,
        last: &Comparisons,
        columns: &[SensorColumn],
    ) -> Option<(T, String)> {
        if !last.has_motion(columns) {
            return None;
        }
        let is_wrong = !last.mistakes_in_motion(columns).is_empty();
        self.wrong = if is_wrong { self.wrong + 1 } else { 0 };
        if self.wrong < PANES {
            return None;
        }
        let found = self.since.mistakes_in_motion(columns);
        (!found.is_empty()).then(|| (self.begins[1], found.join("; ")))
    }
}

/// The names of some sensors.
fn listed(sensors: &[usize], columns: &[SensorColumn]) -> String {
    let names: Vec<&str> = sensors.iter().map(|&sensor| &*columns[sensor].name).collect();
    names.join(", ")
}

/// Says which sensors look exchanged.
fn exchanged_in_words(groups: &[Vec<usize>], columns: &[SensorColumn]) -> Option<String> {
    let are_pairs = groups.iter().all(|group| group.len() == 2);
    let (between, whom) = if are_pairs { (", ", "other") } else { ("; ", "next") };
    let group = |group: &Vec<usize>| {
        let (last, others) = group.split_last()?;
        let others = listed(others, columns);
        Some(format!("{others} and {} look exchanged", columns[*last].name))
    };
    let each: Vec<String> = groups.iter().filter_map(group).collect();
    (!each.is_empty())
        .then(|| format!("{}: each follows the twin of the {whom}", each.join(between)))
}

/// Says which sensors seem to be in another unit; `None` if there are none.
pub fn other_units_in_words(columns: &[SensorColumn], found: &[OtherUnit]) -> Option<String> {
    let each = |other: &OtherUnit| {
        let (column, ratio) = (&columns[other.sensor], rounded(other.ratio, 3));
        let (seems, remedy) = other.misread.in_words(column.unit);
        (format!("{} seems {seems}: it is {ratio} times what the twin shows", column.name), remedy)
    };
    let (each, mut remedies): (Vec<String>, Vec<String>) = found.iter().map(each).unzip();
    remedies.dedup();
    (!each.is_empty()).then(|| format!("{}; {}", each.join(", "), remedies.join(", ")))
}

/// Says that pressures are not absolute, or are taken for gauge pressures.
fn atmosphere_in_words(sign: f64, sensors: &[usize], columns: &[SensorColumn]) -> String {
    let (are, they) = match sensors.len() {
        1 => ("is", "it seems"),
        _ => ("are all", "they seem"),
    };
    let (where_is, what) = match sign < 0.0 {
        true => (
            "below",
            "gauge; give the unit with a g (barg, psig) in a map file, or with an a (bara, psia) for absolute pressures \
             that are so low",
        ),
        false => ("above", "absolute; give the unit without a g (bar, psi) in a map file"),
    };
    let names = listed(sensors, columns);
    format!(
        "{names} {are} one atmosphere {where_is} the twin, whose pressures are absolute: {they} to be {what}"
    )
}
