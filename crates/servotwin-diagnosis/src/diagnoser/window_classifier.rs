//! The classifier of one window length: bands, trees and committee judge a window.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::common_mode::CommonMode;
use super::decision::{Hypotheses, IsNovel, WindowAnswer};
use super::outcome::{Places, is_share};
use super::{Diagnoser, Length};
use crate::error::Error;
use crate::features::Views;
use crate::hierarchy::{Diagnosis, Scratch};
use crate::panel::{SensorBand, agree};
use crate::residual::Window;

/// Working memory to judge windows of one length, and the last judgement.
#[derive(Debug, Clone)]
pub(super) struct WindowClassifier {
    hypotheses: Hypotheses,
    views: Views,
    of_trees: Scratch,
    of_committee: Scratch,
    pub memory: WindowMemory,
    common_mode: CommonMode,
    max_common_mode: f64,
    share_of_known: f64,
    in_band_share: f64,
}

/// The stored result of the last window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WindowMemory {
    /// Probability of each hypothesis.
    probabilities: Vec<f64>,
    last: Option<Judgement>,
}

/// The judgement of a window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Judgement {
    /// The sensor with the largest residual in parts of its band, and that residual.
    pub worst: (usize, f64),
    /// The trees' hypothesis; `None` if every residual is in its band.
    pub of_trees: Option<usize>,
    /// The trees' detail.
    pub detail_of_trees: Option<u32>,
    /// The committee's likeliest hypothesis.
    pub likeliest: usize,
    /// The committee's detail of that hypothesis, with its probability.
    pub detail: Option<(u32, f64)>,
    /// Whether the window is unlike all training data.
    pub is_novel: bool,
}

impl Judgement {
    fn fits(&self, places: &Places) -> bool {
        let is_hypothesis = |place: usize| place < places.hypotheses.count();
        self.worst.0 < places.sensors
            && self.worst.1.is_finite()
            && self.of_trees.is_none_or(is_hypothesis)
            && self.detail_of_trees.is_none_or(|detail| places.has_detail(detail))
            && is_hypothesis(self.likeliest)
            && self
                .detail
                .is_none_or(|(detail, share)| places.has_detail(detail) && is_share(share))
    }
}

impl WindowClassifier {
    pub(crate) fn new(diagnoser: &Diagnoser, length: &Length) -> Result<Self, Error> {
        let (trees, committee) = (&length.panel.trees, &length.panel.committee);
        let views = diagnoser.views_of(length);
        let hypotheses = Hypotheses::of(&trees.names);
        Ok(WindowClassifier {
            hypotheses,
            views: Views::new(diagnoser.sensors_seen(), &trees.names.features, views)?,
            of_trees: trees.scratch(),
            of_committee: committee.scratch(),
            memory: WindowMemory { probabilities: vec![0.0; hypotheses.count()], last: None },
            common_mode: CommonMode::new(&diagnoser.sensors_seen(), diagnoser.watched()),
            max_common_mode: diagnoser.tuning.max_common_mode,
            share_of_known: 1.0 - length.novelty.quantile,
            in_band_share: diagnoser.tuning.in_band_share(),
        })
    }

    pub(crate) fn forget(&mut self) {
        self.memory.probabilities.fill(0.0);
        self.memory.last = None;
    }

    /// Whether a stored memory has the same number of hypotheses and valid indices.
    pub(crate) fn fits(&self, memory: &WindowMemory, places: &Places) -> bool {
        memory.probabilities.len() == self.hypotheses.count()
            && memory.probabilities.iter().all(|share| is_share(*share))
            && memory.last.is_none_or(|last| last.fits(places))
    }

    pub(crate) fn last(&self) -> Option<&Judgement> {
        self.memory.last.as_ref()
    }

    /// The feature rows of the last window outside its bands, one for each view.
    pub(crate) fn rows(&self) -> &[Vec<f64>] {
        self.views.rows()
    }

    pub(crate) fn common_mode(
        &self,
        actuator: usize,
        window: &Window,
        bands: &[SensorBand],
    ) -> f64 {
        self.common_mode.share(actuator, window, bands)
    }

    pub(crate) fn probability(&self, hypothesis: usize) -> f64 {
        self.memory.probabilities[hypothesis]
    }

    pub(crate) fn probability_of_actuator(&self, actuator: usize) -> f64 {
        self.memory.probabilities[self.hypotheses.of_actuator(actuator)].iter().sum()
    }

    /// Judges a window. Masked actuators are no possible answers, and stand-in sensor values do not count in relations
    /// with others. Does not allocate.
    ///
    /// # Errors
    /// The hierarchies' errors for rows that do not fit, which never occur after [`Diagnoser::check`].
    pub(crate) fn classify(
        &mut self,
        length: &Length,
        window: &Window,
        is_masked: &[bool],
        stands_in: &[bool],
    ) -> Result<WindowAnswer<'_>, Error> {
        let worst = worst(window, &length.panel.bands);
        let mut said = Judgement {
            worst,
            of_trees: None,
            detail_of_trees: None,
            likeliest: 0,
            detail: None,
            is_novel: false,
        };
        let WindowMemory { probabilities, last } = &mut self.memory;
        if worst.1 <= 1.0 {
            probabilities.fill(0.0);
            probabilities[0] = self.in_band_share;
            *last = Some(said);
            return Ok(WindowAnswer::InBand);
        }
        self.views.stand_in(stands_in);
        let rows = self.views.compute(window)?;
        let (trees, committee) = (&length.panel.trees, &length.panel.committee);
        let of_trees = trees.diagnose(rows, &mut self.of_trees)?;
        said.of_trees = Some(place(self.hypotheses, of_trees));
        said.detail_of_trees = of_trees.detail;
        committee.probabilities_into(rows, &mut self.of_committee, probabilities)?;
        mask(probabilities, self.hypotheses, is_masked);
        said.likeliest = crate::numeric::arg_max(probabilities.iter().copied());
        let fault = self.hypotheses.split(said.likeliest);
        if let Some((actuator, action)) = fault.map(|(a, c)| (a as u32, c as u32)) {
            let detail = committee.detail(rows, (actuator, action), &mut self.of_committee)?;
            said.detail = detail.map(|answer| (answer.class, answer.probability));
        }
        let view = fault.map_or(0, |(actuator, _)| actuator).min(rows.len() - 1);
        let action = fault.map(|(_, action)| action as u32);
        let common_mode = fault.map_or(0.0, |(actuator, _)| {
            self.common_mode.share(actuator, window, &length.panel.bands)
        });
        said.is_novel =
            common_mode > self.max_common_mode || length.novelty.score(action, &rows[view]) > 1.0;
        *last = Some(said);
        let novelty = IsNovel { novel: said.is_novel, share_of_known: self.share_of_known };
        Ok(WindowAnswer::Probabilities(probabilities, novelty))
    }

    /// Whether trees and committee agree on a hypothesis with enough confidence, and the window is not novel.
    pub(crate) fn agrees_on(&self, hypothesis: usize, least_confidence: Option<f64>) -> bool {
        let Some(last) = self.last() else { return false };
        let committee = Some(last.likeliest);
        agree(last.of_trees, committee, self.probability(hypothesis), least_confidence)
            && last.likeliest == hypothesis
            && !last.is_novel
    }

    /// The detail of the last window, if trees and committee agree on it.
    pub(crate) fn detail(&self, least_confidence: f64) -> Option<u32> {
        let last = self.last()?;
        let (detail, probability) = last.detail?;
        let agreed = agree(last.detail_of_trees, Some(detail), probability, Some(least_confidence));
        agreed.then_some(detail)
    }
}

/// The trees' hypothesis; healthy also if they name an actuator but no action.
fn place(hypotheses: Hypotheses, said: Diagnosis) -> usize {
    let fault = said.actuator.zip(said.action);
    fault.map_or(0, |(actuator, action)| hypotheses.place(actuator as usize, action as usize))
}

/// The sensor with the largest residual in parts of its band, and that residual. Any residual leaves a
/// band of zero width.
fn worst(window: &Window, bands: &[SensorBand]) -> (usize, f64) {
    const LEAST_BAND: f64 = 1e-12;
    let size = |(sensor, band): (usize, &SensorBand)| {
        (sensor, window.largest(sensor) / band.half_width.max(LEAST_BAND))
    };
    let larger = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 { b } else { a };
    bands.iter().enumerate().map(size).fold((0, 0.0), larger)
}

/// Removes masked actuators from the probabilities.
fn mask(probabilities: &mut [f64], hypotheses: Hypotheses, is_masked: &[bool]) {
    if !is_masked.contains(&true) {
        return;
    }
    for actuator in (0..hypotheses.actuators).filter(|&actuator| is_masked[actuator]) {
        probabilities[hypotheses.of_actuator(actuator)].fill(0.0);
    }
    let sum: f64 = probabilities.iter().sum();
    if sum > 0.0 {
        probabilities.iter_mut().for_each(|p| *p /= sum);
    } else {
        probabilities[0] = 1.0;
    }
}
