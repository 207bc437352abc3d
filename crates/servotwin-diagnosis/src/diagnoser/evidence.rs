//! The third value of a session: what its windows say. For each window length, bands, trees and committee judge the
//! newest window, and the evidence of all windows is gathered for every pair of hypotheses and for every boundary.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::boundary::{Boundary, Doubt, NewWindow};
use super::common_mode::CommonMode;
use super::decision::{DecisionLimits, Hypotheses, IsNovel, PairSums, WindowAnswer};
use super::guard::Guard;
use super::outcome::{Places, is_share};
use super::tuning::Tuning;
use super::{Diagnoser, Length};
use crate::error::{Error, require_sound, same_length};
use crate::features::Views;
use crate::hierarchy::{Diagnosis, Scratch};
use crate::panel::{SensorBand, agree};
use crate::residual::Window;
use crate::windows::Windows;

/// The evidence of all window lengths.
#[derive(Debug, Clone)]
pub(super) struct Evidence {
    pub(crate) lengths: Vec<LengthEvidence>,
}

/// Judges the windows of one length and gathers their evidence.
#[derive(Debug, Clone)]
pub(super) struct LengthEvidence {
    hypotheses: Hypotheses,
    /// Whether its windows are corrected by the baseline.
    is_corrected: bool,
    /// The constants, with the allowances of this length.
    tuning: Tuning,
    limits: DecisionLimits,
    /// Samples of a full window.
    pub(crate) samples: u64,
    views: Views,
    of_trees: Scratch,
    of_committee: Scratch,
    common_mode: CommonMode,
    /// Whether the newest sample completed a window that was judged.
    pub(crate) is_new: bool,
    state: LengthState,
}

/// What the evidence of one length remembers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LengthState {
    /// Probability of each hypothesis in the last window.
    probabilities: Vec<f64>,
    last: Option<Judgement>,
    sums: PairSums,
    /// One for each boundary of the diagnoser.
    doubts: Vec<Doubt>,
}

/// The judgement of a window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Judgement {
    /// The sensor with the largest residual in parts of its band, and that residual.
    pub(crate) worst: (usize, f64),
    /// The trees' hypothesis; `None` if every residual is in its band.
    of_trees: Option<usize>,
    /// The trees' detail.
    detail_of_trees: Option<u32>,
    /// The committee's likeliest hypothesis.
    likeliest: usize,
    /// The committee's detail of that hypothesis, with its probability.
    detail: Option<(u32, f64)>,
    /// Whether the window is unlike all training data.
    is_novel: bool,
}

impl Judgement {
    fn fits(&self, places: &Places) -> bool {
        let is_hypothesis = |place: usize| place < places.hypotheses.count();
        let has_detail = |detail: u32| (detail as usize) < places.details;
        self.worst.0 < places.sensors
            && self.worst.1.is_finite()
            && self.of_trees.is_none_or(is_hypothesis)
            && self.detail_of_trees.is_none_or(has_detail)
            && is_hypothesis(self.likeliest)
            && self.detail.is_none_or(|(detail, share)| has_detail(detail) && is_share(share))
    }
}

impl Evidence {
    pub(super) fn new(diagnoser: &Diagnoser) -> Result<Self, Error> {
        let lengths = diagnoser.lengths.iter();
        let lengths = lengths.map(|length| LengthEvidence::new(diagnoser, length));
        Ok(Evidence { lengths: lengths.collect::<Result<_, _>>()? })
    }

    /// Takes the full windows that the newest sample completed, beside its inputs. Does not allocate.
    ///
    /// # Errors
    /// The hierarchies' errors for rows that do not fit, which never occur after [`Diagnoser::check`].
    pub(super) fn take(
        &mut self,
        diagnoser: &Diagnoser,
        (windows, inputs): (&Windows, &[f64]),
        guard: &Guard,
        is_masked: impl Fn(u32) -> bool,
    ) -> Result<(), Error> {
        for (place, length) in diagnoser.lengths.iter().enumerate() {
            let newest = windows.of(place);
            let is_new = newest.has_ended() && newest.is_full();
            self.lengths[place].is_new = is_new;
            if is_new {
                let (window, share) = (newest.window(), newest.share_of_newest());
                self.lengths[place].take(length, window, guard, &is_masked)?;
                self.take_doubts(diagnoser, place, (window, share), inputs);
            }
        }
        Ok(())
    }

    fn take_doubts(
        &mut self,
        diagnoser: &Diagnoser,
        place: usize,
        (window, share): (&Window, f64),
        inputs: &[f64],
    ) {
        let length = &diagnoser.lengths[place];
        let (bands, sensors) = (&length.panel.bands, &diagnoser.sensors);
        let (panes, period_s) = (length.span.panes, diagnoser.period_s);
        for (number, boundary) in diagnoser.boundaries.iter().enumerate() {
            let has_agreed = self.has_agreed(place, number);
            let range = &diagnoser.environment.inputs[boundary.input as usize];
            let possible = (!has_agreed).then_some([range.least, range.largest]);
            let reading = inputs[boundary.input as usize];
            let new =
                NewWindow { window, bands, sensors, panes, share, period_s, reading, possible };
            let own = &mut self.lengths[place];
            own.state.doubts[number].take(boundary, &new, &own.tuning);
        }
    }

    /// Whether the sensor next to a boundary has agreed with the twin in windows of any length that are corrected by the
    /// baseline or not, as those of this one are. A short window sees sooner what holds for all of them.
    fn has_agreed(&self, place: usize, boundary: usize) -> bool {
        let own = self.lengths[place].is_corrected;
        let alike = self.lengths.iter().filter(|length| length.is_corrected == own);
        alike.map(|length| &length.state.doubts[boundary]).any(Doubt::has_agreed)
    }

    /// Whether the sensor next to a boundary has fallen in windows that no baseline corrects. A line that falls below its
    /// baseline may have been raised before by other consumers.
    fn has_fallen(&self, boundary: usize) -> bool {
        let plain = self.lengths.iter().filter(|length| !length.is_corrected);
        plain.map(|length| &length.state.doubts[boundary]).any(Doubt::has_fallen)
    }

    pub(super) fn clear(&mut self) {
        self.lengths.iter_mut().for_each(LengthEvidence::clear);
    }

    /// Whether any window was judged since the last clearing.
    pub(super) fn has_judged(&self) -> bool {
        self.lengths.iter().any(|length| length.last().is_some())
    }

    /// The largest evidence for any or an unknown change, in parts of its limit.
    pub(super) fn of_any_change(&self) -> f64 {
        let most = |length: &LengthEvidence| length.of_change().max(length.of_unknown());
        self.lengths.iter().map(most).fold(0.0, f64::max)
    }

    /// The input whose wrong reading explains all that an actuator shows in the windows of some length, while nothing
    /// speaks for a fault.
    pub(super) fn doubtful_input(&self, diagnoser: &Diagnoser, actuator: usize) -> Option<u32> {
        let remains = |place: usize, number: usize, boundary: &Boundary| {
            let sensor = &diagnoser.sensors[boundary.sensor as usize];
            let doubt = &self.lengths[place].state.doubts[number];
            sensor.actuator == Some(actuator as u32)
                && doubt.is_explained()
                && doubt.remains(sensor.noise, &diagnoser.tuning)
                && !(boundary.is_return && self.has_fallen(number))
        };
        let places = 0..self.lengths.len();
        places
            .flat_map(|place| diagnoser.boundaries.iter().enumerate().map(move |b| (place, b)))
            .find(|(place, (number, boundary))| remains(*place, *number, boundary))
            .map(|(_, (_, boundary))| boundary.input)
    }

    pub(super) fn save(&self) -> Vec<LengthState> {
        self.lengths.iter().map(|length| length.state.clone()).collect()
    }

    /// Restores a state.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::CorruptModel`] for one that a session of this diagnoser cannot have.
    pub(super) fn restore(&mut self, states: &[LengthState], places: &Places) -> Result<(), Error> {
        same_length("window lengths", self.lengths.len(), states.len())?;
        for (own, state) in self.lengths.iter_mut().zip(states) {
            let fits = state.probabilities.len() == places.hypotheses.count()
                && state.probabilities.iter().all(|share| is_share(*share))
                && state.last.is_none_or(|last| last.fits(places))
                && state.sums.fits(places.hypotheses)
                && state.doubts.len() == own.state.doubts.len()
                && state.doubts.iter().all(Doubt::fits);
            require_sound(fits, "the stored evidence is another diagnoser's")?;
            own.state.clone_from(state);
            own.is_new = false;
        }
        Ok(())
    }
}

impl LengthEvidence {
    /// # Errors
    /// As [`Views::new`].
    pub(super) fn new(diagnoser: &Diagnoser, length: &Length) -> Result<Self, Error> {
        let (trees, committee) = (&length.panel.trees, &length.panel.committee);
        let (sensors, views) = (diagnoser.sensors_seen(), diagnoser.views_of(length));
        let hypotheses = Hypotheses::of(&trees.names);
        Ok(LengthEvidence {
            hypotheses,
            is_corrected: length.baseline_corrected.is_some(),
            tuning: diagnoser.tuning_of(length),
            limits: diagnoser.limits_of(length),
            samples: length.span.samples(),
            common_mode: CommonMode::new(&sensors, diagnoser.watched()),
            views: Views::new(sensors, &trees.names.features, views)?,
            of_trees: trees.scratch(),
            of_committee: committee.scratch(),
            is_new: false,
            state: LengthState {
                probabilities: vec![0.0; hypotheses.count()],
                last: None,
                sums: PairSums::new(hypotheses),
                doubts: vec![Doubt::default(); diagnoser.boundaries.len()],
            },
        })
    }

    fn clear(&mut self) {
        self.is_new = false;
        self.state.probabilities.fill(0.0);
        self.state.last = None;
        self.state.sums.clear();
        self.state.doubts.fill(Doubt::default());
    }

    /// The judgement of the last window.
    pub(super) fn last(&self) -> Option<&Judgement> {
        self.state.last.as_ref()
    }

    /// The feature rows of the last window outside its bands: the one that tells actuators apart, and one for each view.
    pub(super) fn rows(&self) -> (&[f64], &[Vec<f64>]) {
        self.views.rows()
    }

    /// The largest share of a deviation that an actuator has in common with another one.
    pub(super) fn common_mode(
        &self,
        actuator: usize,
        window: &Window,
        bands: &[SensorBand],
    ) -> f64 {
        self.common_mode.share(actuator, window, bands)
    }

    pub(super) fn probability(&self, hypothesis: usize) -> f64 {
        self.state.probabilities[hypothesis]
    }

    pub(super) fn probability_of_actuator(&self, actuator: usize) -> f64 {
        self.state.probabilities[self.hypotheses.of_actuator(actuator)].iter().sum()
    }

    /// As [`PairSums::margin`].
    pub(super) fn margin(&self, claim: usize) -> f64 {
        self.state.sums.margin(claim, &self.limits)
    }

    /// As [`PairSums::margin_of_actuator`].
    pub(super) fn margin_of_actuator(&self, actuator: usize) -> f64 {
        self.state.sums.margin_of_actuator(actuator, &self.limits)
    }

    /// Evidence of any change, in parts of its limit.
    pub(super) fn of_change(&self) -> f64 {
        self.state.sums.of_change(&self.limits)
    }

    /// Evidence of an unknown change, in parts of its limit.
    pub(super) fn of_unknown(&self) -> f64 {
        self.state.sums.of_unknown(&self.limits)
    }

    pub(super) fn doubt(&self, boundary: usize) -> &Doubt {
        &self.state.doubts[boundary]
    }

    /// Takes a window.
    fn take(
        &mut self,
        length: &Length,
        window: &Window,
        guard: &Guard,
        is_masked: impl Fn(u32) -> bool,
    ) -> Result<(), Error> {
        let novelty = self.judge(length, window, guard, is_masked)?;
        let LengthState { probabilities, sums, .. } = &mut self.state;
        let answer = match novelty {
            Some(novelty) => WindowAnswer::Probabilities(probabilities, novelty),
            None => WindowAnswer::InBand,
        };
        sums.take(answer, &self.tuning, &self.limits);
        Ok(())
    }

    /// Judges a window; `None` if every residual is in its band. Masked actuators are no possible answers, and stand-in
    /// sensor values do not count in relations with others. A stand-in looks healthy. So that no actuator looks healthier
    /// than another one, the question which of them failed is asked without the sensors that one of them lacks.
    fn judge(
        &mut self,
        length: &Length,
        window: &Window,
        guard: &Guard,
        is_masked: impl Fn(u32) -> bool,
    ) -> Result<Option<IsNovel>, Error> {
        let bands = &length.panel.bands;
        let mut said = Judgement {
            worst: worst(window, bands),
            of_trees: None,
            detail_of_trees: None,
            likeliest: 0,
            detail: None,
            is_novel: false,
        };
        let LengthState { probabilities, last, .. } = &mut self.state;
        if said.worst.1 <= 1.0 {
            probabilities.fill(0.0);
            probabilities[0] = self.tuning.in_band_share();
            *last = Some(said);
            return Ok(None);
        }
        self.views.stand_in(&guard.stands_in, &guard.unpaired);
        let (paired, rows) = self.views.compute(window)?;
        let (trees, committee) = (&length.panel.trees, &length.panel.committee);
        let of_trees = trees.diagnose_paired((paired, rows), &mut self.of_trees)?;
        said.of_trees = Some(place(self.hypotheses, of_trees));
        said.detail_of_trees = of_trees.detail;
        committee.probabilities_into((paired, rows), &mut self.of_committee, probabilities)?;
        mask(probabilities, self.hypotheses, is_masked);
        said.likeliest = crate::numeric::arg_max(probabilities.iter().copied());
        let fault = self.hypotheses.split(said.likeliest);
        if let Some((actuator, action)) = fault.map(|(a, c)| (a as u32, c as u32)) {
            let detail = committee.detail(rows, (actuator, action), &mut self.of_committee)?;
            said.detail = detail.map(|answer| (answer.class, answer.probability));
        }
        let (actuator, action) = fault.unzip();
        let view = actuator.unwrap_or(0).min(rows.len() - 1);
        let common_mode =
            actuator.map_or(0.0, |actuator| self.common_mode.share(actuator, window, bands));
        let score = length.novelty.score(action.map(|action| action as u32), &rows[view]);
        said.is_novel = common_mode > self.tuning.max_common_mode || score > 1.0;
        *last = Some(said);
        let share_of_known = 1.0 - length.novelty.quantile;
        Ok(Some(IsNovel { novel: said.is_novel, share_of_known }))
    }

    /// Whether trees and committee agree on a hypothesis with enough confidence, and the window is not novel.
    pub(super) fn agrees_on(&self, hypothesis: usize, least_confidence: Option<f64>) -> bool {
        let Some(last) = self.last() else { return false };
        let committee = Some(last.likeliest);
        agree(last.of_trees, committee, self.probability(hypothesis), least_confidence)
            && last.likeliest == hypothesis
            && !last.is_novel
    }

    /// The detail of the last window and its probability, if trees and committee agree on it.
    pub(super) fn detail(&self) -> Option<(u32, f64)> {
        let last = self.last()?;
        let (detail, probability) = last.detail?;
        let least = Some(self.tuning.least_detail_confidence);
        agree(last.detail_of_trees, Some(detail), probability, least)
            .then_some((detail, probability))
    }
}

/// The trees' hypothesis; healthy also if they name an actuator but no action.
fn place(hypotheses: Hypotheses, said: Diagnosis) -> usize {
    let fault = said.actuator.zip(said.action);
    fault.map_or(0, |(actuator, action)| hypotheses.place(actuator as usize, action as usize))
}

/// The sensor with the largest residual in parts of its band, and that residual. Any residual leaves a band of zero
/// width.
fn worst(window: &Window, bands: &[SensorBand]) -> (usize, f64) {
    const LEAST_BAND: f64 = 1e-12;
    let size = |(sensor, band): (usize, &SensorBand)| {
        (sensor, window.largest(sensor) / band.half_width.max(LEAST_BAND))
    };
    let larger = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 { b } else { a };
    bands.iter().enumerate().map(size).fold((0, 0.0), larger)
}

/// Removes masked actuators from the probabilities.
fn mask(probabilities: &mut [f64], hypotheses: Hypotheses, is_masked: impl Fn(u32) -> bool) {
    let mut any = false;
    for actuator in (0..hypotheses.actuators).filter(|&actuator| is_masked(actuator as u32)) {
        probabilities[hypotheses.of_actuator(actuator)].fill(0.0);
        any = true;
    }
    let sum: f64 = probabilities.iter().sum();
    if any && sum > 0.0 {
        probabilities.iter_mut().for_each(|p| *p /= sum);
    } else if any {
        probabilities[0] = 1.0;
    }
}
