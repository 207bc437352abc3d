//! Why a condition cannot be shown for a diagnosis.
//!
//! A reason must be true: where a condition is shown although one is given, the proof fails.

use crate::mcdc::Decision;
use servotwin_diagnosis::classifiers::{Classifier, Model};
use servotwin_diagnosis::diagnoser::{Diagnoser, common_mode};
use servotwin_diagnosis::hierarchy::{Hierarchy, Question, Stage};

/// `LEAST_BAND` of the C text.
const LEAST_BAND: f64 = 1e-12;

/// A condition that a diagnosis may have no evaluation for.
struct Known {
    file: &'static str,
    /// Part of the function, the kind of decision and its text.
    decision: &'static str,
    /// The whole condition; empty for all conditions of the decision.
    condition: &'static str,
    holds: fn(&Diagnoser) -> bool,
    why: &'static str,
}

impl Known {
    fn concerns(&self, decision: &Decision, condition: usize) -> bool {
        let text = &decision.conditions[condition];
        let whole = format!("{}: {} {}", decision.function, decision.kind.name(), decision.text);
        self.file == decision.file
            && (self.condition.is_empty() || self.condition == text)
            && whole.contains(self.decision)
    }
}

/// The reason for a condition, if one is known.
pub(super) fn of(
    decision: &Decision,
    condition: usize,
    diagnoser: &Diagnoser,
) -> Option<&'static str> {
    let is_true = |known: &&Known| known.concerns(decision, condition) && (known.holds)(diagnoser);
    KNOWN.iter().find(is_true).map(|known| known.why)
}

fn always(_: &Diagnoser) -> bool {
    true
}

fn has_no_boundary(diagnoser: &Diagnoser) -> bool {
    diagnoser.boundaries.is_empty()
}

fn has_no_baseline(diagnoser: &Diagnoser) -> bool {
    diagnoser.lengths.iter().all(|length| length.baseline_corrected.is_none())
}

fn has_baseline(diagnoser: &Diagnoser) -> bool {
    !has_no_baseline(diagnoser)
}

fn has_one_length(diagnoser: &Diagnoser) -> bool {
    diagnoser.lengths.len() == 1
}

fn has_one_actuator(diagnoser: &Diagnoser) -> bool {
    diagnoser.names().actuators.len() == 1
}

fn pairs(diagnoser: &Diagnoser) -> usize {
    common_mode::corresponding(&diagnoser.sensors_seen(), diagnoser.watched()).len()
}

fn has_one_pair(diagnoser: &Diagnoser) -> bool {
    pairs(diagnoser) == 1 && diagnoser.names().actuators.len() == 2
}

fn has_no_pair(diagnoser: &Diagnoser) -> bool {
    pairs(diagnoser) == 0
}

fn has_no_difference(diagnoser: &Diagnoser) -> bool {
    diagnoser.environment.differences.is_empty()
}

fn has_wide_bands(diagnoser: &Diagnoser) -> bool {
    let mut bands = diagnoser.lengths.iter().flat_map(|length| &length.panel.bands);
    bands.all(|band| band.half_width > LEAST_BAND)
}

fn knows_ranges(diagnoser: &Diagnoser) -> bool {
    diagnoser.lengths.iter().all(|length| !length.novelty.classes.is_empty())
}

fn hierarchies(diagnoser: &Diagnoser) -> impl Iterator<Item = &Hierarchy> {
    diagnoser.lengths.iter().flat_map(|length| [&length.panel.trees, &length.panel.committee])
}

/// Whether every hierarchy has a stage for the actuator.
fn asks_for_actuators(diagnoser: &Diagnoser) -> bool {
    hierarchies(diagnoser).all(|hierarchy| hierarchy.stage(Question::Actuator, 0, 0).is_some())
}

/// Whether every hierarchy has a stage for the action of every actuator.
fn asks_for_actions(diagnoser: &Diagnoser) -> bool {
    let actuators = 0..diagnoser.names().actuators.len() as u32;
    hierarchies(diagnoser).all(|hierarchy| {
        let is_asked = |actuator| hierarchy.stage(Question::Action, actuator, 0).is_some();
        actuators.clone().all(is_asked)
    })
}

/// Whether every stage that may be there is there.
fn asks_for_everything(diagnoser: &Diagnoser) -> bool {
    let names = diagnoser.names();
    let (actuators, actions) = (names.actuators.len() as u32, names.actions.len() as u32);
    let pairs = (0..actuators).flat_map(|u| (0..actions).map(move |a| (u, a)));
    asks_for_actuators(diagnoser)
        && asks_for_actions(diagnoser)
        && hierarchies(diagnoser).all(|hierarchy| {
            pairs.clone().all(|(u, a)| hierarchy.stage(Question::Detail, u, a).is_some())
        })
}

fn stages_of_actions(diagnoser: &Diagnoser) -> impl Iterator<Item = &Stage> {
    let stages = hierarchies(diagnoser).flat_map(|hierarchy| &hierarchy.stages);
    stages.filter(|stage| stage.place.question != Question::Actuator)
}

/// Whether every stage below the actuator reads the view of the actuator.
fn reads_own_views(diagnoser: &Diagnoser) -> bool {
    asks_for_actuators(diagnoser)
        && stages_of_actions(diagnoser).all(|s| s.place.actuator.is_none())
}

/// Whether every actuator has a view of its own.
fn has_all_views(diagnoser: &Diagnoser) -> bool {
    let actuators = diagnoser.names().actuators.len();
    diagnoser.lengths.iter().all(|length| diagnoser.views_of(length) >= actuators)
}

/// Whether no node of any tree sends a missing value to the left.
fn sends_missing_right(diagnoser: &Diagnoser) -> bool {
    let stages = hierarchies(diagnoser).flat_map(|hierarchy| &hierarchy.stages);
    let mut trees = stages.flat_map(|stage| crate::prove::models::trees(&stage.model));
    trees.all(|tree| {
        (0..tree.len()).all(|node| tree.split(node).is_none() || !tree.missing_left(node))
    })
}

/// The largest distance of two scores that boosted trees with every class can reach.
fn widest_scores(diagnoser: &Diagnoser) -> f64 {
    let stages = hierarchies(diagnoser).flat_map(|hierarchy| &hierarchy.stages);
    let width = |stage: &Stage| match &stage.model {
        Model::BoostedTrees(model) if model.present.len() < model.classes() => f64::INFINITY,
        Model::BoostedTrees(model) => {
            let largest = |values: &[f64]| values.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
            let trees: f64 = model.trees.iter().map(|tree| largest(&tree.values)).sum();
            2.0 * (largest(&model.priors) + trees)
        }
        _ => 0.0,
    };
    stages.map(width).fold(0.0, f64::max)
}

/// Whether no probability of boosted trees can be as small as `LEAST_PROBABILITY` of the C text.
fn has_no_tiny_probability(diagnoser: &Diagnoser) -> bool {
    // Less than 32 classes share the rest: ln(1e-15) + ln(32) is above -31.1.
    widest_scores(diagnoser) < 31.0
}

/// Whether no exponential of a probability can be 0.
fn has_no_vanishing_exponential(diagnoser: &Diagnoser) -> bool {
    let mut stages = hierarchies(diagnoser).flat_map(|hierarchy| &hierarchy.stages);
    // ln(1e-15) / T is above -700 for temperatures above 0.05.
    widest_scores(diagnoser) < 700.0 && stages.all(|stage| stage.temperature > 0.05)
}

/// Whether the first window length is judged before all others.
fn judges_first_length_first(diagnoser: &Diagnoser) -> bool {
    let samples = |place: usize| diagnoser.lengths[place].span.samples();
    let first = &diagnoser.lengths[0];
    let is_later = |place: usize| samples(place) >= samples(0);
    first.baseline_corrected.is_none() && (1..diagnoser.lengths.len()).all(is_later)
}

/// The same, with other lengths behind it.
fn ends_with_first_of_several(diagnoser: &Diagnoser) -> bool {
    diagnoser.lengths.len() > 1 && judges_first_length_first(diagnoser)
}

/// Whether the lengths of a stream never wait for each other.
fn has_time_for_all_lengths(diagnoser: &Diagnoser) -> bool {
    [false, true].into_iter().all(|is_corrected| {
        let own = diagnoser.lengths.iter();
        let own = own.filter(|length| length.baseline_corrected.is_some() == is_corrected);
        let panes = own.clone().map(|length| length.span.pane_samples).min();
        panes.is_none_or(|pane| own.count() <= pane as usize)
    })
}

fn has_finite_ranges(diagnoser: &Diagnoser) -> bool {
    let mut inputs = diagnoser.environment.inputs.iter();
    inputs.all(|input| input.least.is_finite() && input.largest.is_finite())
}

fn freezes_no_input(diagnoser: &Diagnoser) -> bool {
    diagnoser.environment.inputs.iter().all(|input| input.frozen_after_s.is_none())
}

fn freezes_all_inputs(diagnoser: &Diagnoser) -> bool {
    diagnoser.environment.inputs.iter().all(|input| input.frozen_after_s.is_some())
}

fn has_sensors_of_actuators_alone(diagnoser: &Diagnoser) -> bool {
    diagnoser.sensors.iter().all(|sensor| sensor.actuator.is_some())
}

const SESSION: &str = "servotwin_session.c";
const JUDGE: &str = "servotwin_judge.c";
const BOUNDARY: &str = "servotwin_boundary.c";
const WINDOWS: &str = "servotwin_windows.c";
const MODELS: &str = "servotwin_models.c";
const HYBRID: &str = "servotwin_hybrid.c";
const MATH: &str = "servotwin_math.c";

const ROUNDING: &str = "only a build that rounds differently gets there, and it must not be used";
const COUNTER: &str = "the counter stops after 2^32 samples, which are 497 days at 100 Hz";
const ENUMERATION: &str = "every value of the enumeration has a case of its own";
const JUDGED: &str = "evidence is gathered from judgements and cleared with them, so there is one";
const NO_BOUNDARY: &str = "this diagnosis has no boundary";
const NO_DIFFERENCE: &str = "this diagnosis has no difference of inputs";
const NO_BASELINE: &str = "this diagnosis has no windows beyond a baseline";
const ONE_LENGTH: &str = "this diagnosis has one window length";
const ONE_ACTUATOR: &str = "this diagnosis has one actuator";
const TWO_ACTUATORS: &str =
    "two actuators have one pair of corresponding sensors, to which both belong";
const ALL_STAGES: &str = "this diagnosis has this stage for everything that is asked";
const BANDS: &str = "all bands of this diagnosis are wider";

/// All known reasons.
const KNOWN: &[Known] = &[
    known(BOUNDARY, "", "", has_no_boundary, NO_BOUNDARY),
    known(SESSION, "for boundary", "", has_no_boundary, NO_BOUNDARY),
    known(SESSION, "servotwin_is_doubtful", "", has_no_boundary, NO_BOUNDARY),
    known(SESSION, "withheld != SERVOTWIN_NONE", "", has_no_boundary, NO_BOUNDARY),
    known(SESSION, "said->finding", "SERVOTWIN_ENVIRONMENT_INVALID", has_no_boundary, NO_BOUNDARY),
    known(
        SESSION,
        "",
        "doubtful_shutdown(session, claim) == SERVOTWIN_NONE",
        has_no_boundary,
        NO_BOUNDARY,
    ),
    known(SESSION, "for (i < SERVOTWIN_DIFFERENCES)", "", has_no_difference, NO_DIFFERENCE),
    known(SESSION, "difference->least", "", has_no_difference, NO_DIFFERENCE),
    known(SESSION, "limit > 0U", "limit > 0U", freezes_all_inputs, "every input has a limit"),
    known(SESSION, "limit > 0U", "", freezes_no_input, "no input has a limit"),
    known(SESSION, "rival != claim", "other != length", has_one_length, ONE_LENGTH),
    known(SESSION, "contradicted ||", "", has_one_length, ONE_LENGTH),
    known(SESSION, "value contradicted", "", has_one_length, ONE_LENGTH),
    known(SESSION, "value disagree", "", has_one_actuator, ONE_ACTUATOR),
    known(SESSION, "", "disagree", has_one_actuator, ONE_ACTUATOR),
    known(SESSION, "add_to_windows: if", "", has_no_baseline, NO_BASELINE),
    known(SESSION, "add_to_windows: ?:", "", has_no_baseline, NO_BASELINE),
    known(SESSION, "add_to_windows: for", "", has_no_baseline, NO_BASELINE),
    known(SESSION, "add_to_windows: value has_new", "", has_no_baseline, NO_BASELINE),
    known(
        HYBRID,
        "told >= known->least",
        "fabs(told) <= DBL_MAX",
        has_finite_ranges,
        "a value within a finite range is finite",
    ),
    known(WINDOWS, "servotwin_baseline_is_settled", "", has_no_baseline, NO_BASELINE),
    known(WINDOWS, "servotwin_baseline_learn", "", has_no_baseline, NO_BASELINE),
    known(
        SESSION,
        "own == SERVOTWIN_NONE",
        "own == SERVOTWIN_NONE",
        has_sensors_of_actuators_alone,
        "every sensor belongs to an actuator",
    ),
    known(
        SESSION,
        "known->actuator != SERVOTWIN_NONE",
        "known->actuator != SERVOTWIN_NONE",
        has_sensors_of_actuators_alone,
        "every sensor belongs to an actuator",
    ),
    known(MATH, "rest ==", "difference == 0.0", always, ROUNDING),
    known(MATH, "difference ==", "rest == 0x1.fffffffe62e21p-1", always, ROUNDING),
    known(SESSION, "", "servotwin_rounds_twice() != 0", always, ROUNDING),
    known(
        MATH,
        "x < -708.0",
        "x < -708.0",
        has_no_vanishing_exponential,
        "no scores of this diagnosis are so far apart",
    ),
    known(
        MODELS,
        "",
        "largest < LEAST_PROBABILITY",
        always,
        "the largest of n probabilities is at least 1/n",
    ),
    known(
        MODELS,
        "",
        "shares[i] > LEAST_PROBABILITY",
        has_no_tiny_probability,
        "no scores of this diagnosis are so far apart",
    ),
    known(
        MODELS,
        "",
        "(feature & SERVOTWIN_MISSING_LEFT) != 0U",
        sends_missing_right,
        "no tree of this diagnosis sends a missing value to the left",
    ),
    known(
        MODELS,
        "",
        "hierarchy->actuator_stage == SERVOTWIN_NONE",
        asks_for_actuators,
        ALL_STAGES,
    ),
    known(MODELS, "", "place == SERVOTWIN_NONE", asks_for_actions, ALL_STAGES),
    known(MODELS, "", "action < hierarchy->actions", asks_for_actions, ALL_STAGES),
    known(MODELS, "", "action.decided != SERVOTWIN_NONE", asks_for_actions, ALL_STAGES),
    known(MODELS, "", "place != SERVOTWIN_NONE", asks_for_everything, ALL_STAGES),
    known(JUDGE, "", "said.action != SERVOTWIN_NONE", asks_for_actions, ALL_STAGES),
    known(
        MODELS,
        "share_among_actions",
        "stage->reads_own_view != 0",
        reads_own_views,
        "all stages below the actuator read the view of the actuator",
    ),
    known(
        JUDGE,
        "",
        "actuator < of_length->views",
        has_all_views,
        "every actuator has a view of its own",
    ),
    known(JUDGE, "", "of_length->known_classes > 0", knows_ranges, "all lengths know ranges"),
    known(JUDGE, "bands[i]", "bands[i] > LEAST_BAND", has_wide_bands, BANDS),
    known(JUDGE, "", "product > LEAST_BAND_PRODUCT", has_no_pair, "no actuators correspond"),
    known(JUDGE, "", "product > LEAST_BAND_PRODUCT", has_wide_bands, BANDS),
    known(BOUNDARY, "", "band > LEAST_BAND", has_wide_bands, BANDS),
    known(
        JUDGE,
        "!(sum > REAL(0.0))",
        "any",
        asks_for_actuators,
        "healthy always keeps some probability, so the sum is above 0",
    ),
    known(
        JUDGE,
        "sum > REAL(0.0)",
        "sum > REAL(0.0)",
        asks_for_actuators,
        "healthy always keeps some probability, so the sum is above 0",
    ),
    known(JUDGE, "", "pair->first == actuator", has_one_pair, TWO_ACTUATORS),
    known(JUDGE, "", "pair->second == actuator", has_one_pair, TWO_ACTUATORS),
    known(JUDGE, "", "pair->first == actuator", has_no_pair, "no actuators correspond"),
    known(JUDGE, "", "pair->second == actuator", has_no_pair, "no actuators correspond"),
    known(JUDGE, "hypothesis", "judgement->has_judged", always, JUDGED),
    known(JUDGE, "detail_of_trees", "judgement->has_judged", always, JUDGED),
    known(BOUNDARY, "", "doubt->deviating < UINT32_MAX", always, COUNTER),
    known(SESSION, "", "session->repeats[input] < UINT32_MAX", always, COUNTER),
    known(SESSION, "", "session->gap < UINT32_MAX", always, COUNTER),
    known(SESSION, "said->finding", "default", always, ENUMERATION),
    known(SESSION, "copy_measured", "default", always, ENUMERATION),
    known(
        SESSION,
        "said->finding",
        "SERVOTWIN_UNJUDGED",
        always,
        "a decision never ends with 'not judged'",
    ),
    known(
        SESSION,
        "!is_masked(session, actuator)",
        "is_masked(session, actuator)",
        always,
        "a masked actuator has no probability, so it gathers no evidence for a claim",
    ),
    known(
        SESSION,
        "!is_latched(session)",
        "allows(session, claim)",
        always,
        "a candidate was allowed when it was found",
    ),
    known(
        SESSION,
        "!is_same_finding",
        "session->has_judged",
        always,
        "the sample before was implausible in the same way, which cleared all windows",
    ),
    known(
        SESSION,
        "first < SERVOTWIN_LENGTHS",
        "first < SERVOTWIN_LENGTHS",
        ends_with_first_of_several,
        "the first of several lengths is judged before all others, which ends the loop",
    ),
    known(
        SESSION,
        "session->judgements[first].has_judged",
        "session->judgements[first].has_judged",
        judges_first_length_first,
        "the first length is judged before all others",
    ),
    known(
        SESSION,
        "?: (length == SERVOTWIN_NONE)",
        "length == SERVOTWIN_NONE",
        always,
        "a decision needs a judged length, which was found",
    ),
    known(
        WINDOWS,
        "while stream->turn",
        "stream->turn < plan->lengths",
        has_time_for_all_lengths,
        "a base pane has a sample for each length",
    ),
    known(
        SESSION,
        "servotwin_stream_plans[1].lengths > 0",
        "servotwin_stream_plans[1].lengths > 0",
        has_baseline,
        "this diagnosis has windows beyond a baseline",
    ),
];

const fn known(
    file: &'static str,
    decision: &'static str,
    condition: &'static str,
    holds: fn(&Diagnoser) -> bool,
    why: &'static str,
) -> Known {
    Known { file, decision, condition, holds, why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::c;
    use crate::mcdc::instrument;
    use crate::prove::vectors::recorder::MEASURED;
    use crate::source_file::SourceFile;

    #[test]
    fn every_reason_names_conditions_that_the_code_has() {
        let files: Vec<SourceFile> = c::written_by_hand().collect();
        let decisions = instrument(&files, &MEASURED).unwrap().decisions;
        let is_there = |known: &&Known| {
            decisions.iter().any(|decision| {
                (0..decision.conditions.len()).any(|place| known.concerns(decision, place))
            })
        };
        let missing = KNOWN.iter().filter(|known| !is_there(known));
        let missing: Vec<String> = missing
            .map(|known| format!("{} {} {}", known.file, known.decision, known.condition))
            .collect();
        assert!(missing.is_empty(), "{missing:#?}");
    }
}
