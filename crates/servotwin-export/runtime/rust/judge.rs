//! The judgement of one window: bands, trees and boosted trees.

use crate::models::{Views, largest};
use crate::sizes::{ACTIONS, ACTUATORS, FEATURES, HYPOTHESES, SENSORS, VIEWS};
use crate::tables::{self, TUNING};
use crate::trained::{CommonPair, Known, Length};
use crate::windows::Window;
use crate::{features, sizes};

/// A hypothesis is healthy, or an action of an actuator.
pub const HEALTHY: usize = 0;

const LEAST_BAND: f64 = 1e-12;
const LEAST_BAND_PRODUCT: f64 = 1e-24;

/// The hypothesis of an action of an actuator.
pub fn hypothesis_of(actuator: usize, action: usize) -> usize {
    1 + actuator * ACTIONS + action
}

/// The actuator and the action of a hypothesis; `None` for healthy.
pub fn parts_of(hypothesis: usize) -> Option<(usize, usize)> {
    hypothesis.checked_sub(1).map(|place| (place / ACTIONS, place % ACTIONS))
}

/// The last window of a length.
#[derive(Clone)]
pub struct Judgement {
    /// Whether there was one; otherwise the other members have no meaning.
    pub has_judged: bool,
    /// Every residual is in its band.
    pub is_in_band: bool,
    /// The window is unlike all training data.
    pub is_novel: bool,
    /// The largest residual in parts of its band, with its sensor.
    pub worst: f64,
    pub worst_sensor: usize,
    /// The hypothesis of the trees outside the band, and its detail.
    of_trees: Option<usize>,
    detail_of_trees: Option<usize>,
    /// The same of the boosted trees.
    likeliest: usize,
    detail: Option<usize>,
    detail_probability: f64,
    /// Of each hypothesis by the boosted trees.
    pub probabilities: [f64; HYPOTHESES],
}

/// Removes masked actuators from the probabilities.
fn mask(probabilities: &mut [f64; HYPOTHESES], is_masked: &[bool; ACTUATORS]) {
    if !is_masked.contains(&true) {
        return;
    }
    for (actuator, _) in is_masked.iter().enumerate().filter(|(_, masked)| **masked) {
        probabilities[hypothesis_of(actuator, 0)..][..ACTIONS].fill(0.0);
    }
    let sum = probabilities.iter().fold(0.0, |sum, probability| sum + probability);
    if sum > 0.0 {
        probabilities.iter_mut().for_each(|probability| *probability /= sum);
    } else {
        probabilities[HEALTHY] = 1.0;
    }
}

/// The share of a deviation that the corresponding sensors of two actuators have in common.
fn common_share(pair: &CommonPair, window: &Window, bands: &[f64]) -> f64 {
    let (mut sum, mut difference) = (0.0, 0.0);
    for (a, b) in pair.of_first.iter().zip(pair.of_second) {
        let (a, b) = (usize::from(*a), usize::from(*b));
        let weight = 1.0 / (bands[a] * bands[b]).max(LEAST_BAND_PRODUCT);
        let mean_sum = window.mean[a] + window.mean[b];
        let mean_difference = window.mean[a] - window.mean[b];
        let own = window.covariance(a, a) + window.covariance(b, b);
        let common = 2.0 * window.covariance(a, b);
        sum += weight * (own + common + mean_sum * mean_sum);
        difference += weight * (own - common + mean_difference * mean_difference);
    }
    let whole = sum + difference;
    if whole > 0.0 { sum / whole } else { 0.0 }
}

/// The largest share of a deviation that an actuator has in common with another one.
pub fn common_mode(actuator: usize, window: &Window, length: &Length) -> f64 {
    let is_own = |pair: &&CommonPair| pair.first == actuator || pair.second == actuator;
    let pairs = tables::COMMON_PAIRS.iter().filter(is_own);
    pairs.map(|pair| common_share(pair, window, length.bands)).fold(0.0, f64::max)
}

/// Distance of a row from the training data of a class, in parts of what counts as known. A missing value counts as one.
pub fn novelty(known: &Known, row: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (i, &x) in row.iter().enumerate().take(known.lows.len()) {
        let (low, high) = (known.lows[i], known.highs[i]);
        if !(x >= low && x <= high) {
            let excess = if x > high { x - high } else { low - x };
            sum += (excess / known.widths[i]).min(1.0);
        }
    }
    sum / known.limit
}

/// Writes the features in every view of a length.
fn compute_rows(rows: &mut Views, window: &Window, views: usize, stands_in: &[bool; SENSORS]) {
    for (row, order) in rows.iter_mut().zip(&tables::ORDERS).take(views) {
        let is_flagged = |i: usize| stands_in[usize::from(order[i])];
        let flags = core::array::from_fn(|i| if is_flagged(i) { 1.0 } else { 0.0 });
        *row = features::features(&window.reordered(order), &flags);
    }
}

impl Judgement {
    pub const NONE: Judgement = Judgement {
        has_judged: false,
        is_in_band: false,
        is_novel: false,
        worst: 0.0,
        worst_sensor: 0,
        of_trees: None,
        detail_of_trees: None,
        likeliest: HEALTHY,
        detail: None,
        detail_probability: 0.0,
        probabilities: [0.0; HYPOTHESES],
    };

    /// Judges a full window. Masked actuators are no possible answers. Outside the band, `rows` gets the features.
    pub fn of(
        window: &Window,
        length: &Length,
        is_masked: &[bool; ACTUATORS],
        stands_in: &[bool; SENSORS],
        rows: &mut [[f64; FEATURES]; VIEWS],
    ) -> Self {
        let mut judgement = Judgement { has_judged: true, ..Judgement::NONE };
        judgement.find_worst(window, length);
        judgement.is_in_band = judgement.worst <= 1.0;
        if judgement.is_in_band {
            judgement.probabilities[HEALTHY] = TUNING.in_band_share;
        } else {
            compute_rows(rows, window, length.views, stands_in);
            judgement.judge_outside_band(window, length, is_masked, rows);
        }
        judgement
    }

    /// Finds the sensor with the largest residual in parts of its band.
    fn find_worst(&mut self, window: &Window, length: &Length) {
        for sensor in 0..sizes::WATCHED {
            let size = window.largest[sensor] / length.bands[sensor].max(LEAST_BAND);
            if size > self.worst {
                (self.worst, self.worst_sensor) = (size, sensor);
            }
        }
    }

    fn judge_outside_band(
        &mut self,
        window: &Window,
        length: &Length,
        is_masked: &[bool; ACTUATORS],
        views: &Views,
    ) {
        let found = length.trees.diagnose(views);
        let claim = found.actuator.zip(found.action);
        self.of_trees =
            Some(claim.map_or(HEALTHY, |(actuator, action)| hypothesis_of(actuator, action)));
        self.detail_of_trees = found.detail;
        self.probabilities = length.committee.probabilities(views);
        mask(&mut self.probabilities, is_masked);
        self.likeliest = largest(&self.probabilities);
        let (mut view, mut class, mut common) = (0, 0, 0.0);
        if let Some((actuator, action)) = parts_of(self.likeliest) {
            let detail = length.committee.detail(views, actuator, action);
            (self.detail, self.detail_probability) = (detail.decided, detail.probability);
            (view, class) = (actuator.min(length.views - 1), action + 1);
            common = common_mode(actuator, window, length);
        }
        self.is_novel = common > TUNING.max_common_mode
            || length.known.get(class).is_some_and(|known| novelty(known, &views[view]) > 1.0);
    }

    /// Whether trees and boosted trees agree on a hypothesis, and the window is not novel.
    pub fn agrees_on(&self, length: &Length, hypothesis: usize) -> bool {
        self.has_judged
            && self.of_trees == Some(hypothesis)
            && self.likeliest == hypothesis
            && !self.is_novel
            && self.probabilities[hypothesis] >= length.least_confidence
    }

    /// The detail on which trees and boosted trees agree.
    pub fn agreed_detail(&self) -> Option<usize> {
        let is_agreed = self.has_judged
            && self.detail_of_trees == self.detail
            && self.detail_probability >= TUNING.least_detail_confidence;
        self.detail.filter(|_| is_agreed)
    }
}
