//! The measures of every summary, on a terminal or in the report: safety first.
//!
//! The first table is the *headline*: each scenario under the hardest protocol that the study
//! allows. A row is one measure and one classifier; the scenarios are its columns.

use crate::vocabulary::Vocabulary;
use crate::words::{spoken, three_digits};
use servotwin::job::Results;
use servotwin::job::results::SubjectResult;
use servotwin::learn::Evaluation;
use servotwin::learn::bands::Band;
use servotwin::learn::metrics::Rate;
use servotwin::learn::protocol::{ALL, Protocol, ProtocolResult, StageScore};
use servotwin::measure::flights::{FlightMetrics, HealthyMetrics};
use servotwin::measure::{self, Measure, Rates};
use servotwin::shown::{Shown, shown};
use servotwin::study::Study;
use servotwin_diagnosis::hierarchy::Question;

/// The accuracies that the seed paper reports for stages A and B, with a random third of the variants held out.
pub const OF_PAPER: [(&str, f64); 2] = [("A", 0.9149), ("B", 0.9844)];

/// The part of the diagnosis that answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// The trees. Their answers can be explained.
    Trees,
    /// The committee, which may abstain.
    Committee,
}

/// Measures of unsafe errors; less is better.
pub(crate) const SAFETY: [&Measure; 4] = [
    &measure::WRONG_SHUTDOWN,
    &measure::SHUTDOWN_MISSED_OF_ALL,
    &measure::SHUTDOWN_MISSED,
    &measure::NEEDLESS_SHUTDOWN,
];

/// Measures of right answers; more is better.
pub(crate) const RIGHT: [&Measure; 4] = [
    &measure::RIGHT_ACTION_OF_ALL,
    &measure::END_TO_END_OF_ALL,
    &measure::RIGHT_ACTION,
    &measure::END_TO_END,
];

/// What the flights of a scenario show, over all faults and intensities, also those that no sensor shows.
pub fn in_flight(metrics: &FlightMetrics, words: &Vocabulary) -> Vec<(String, Rate)> {
    let line = |measure: &&Measure| {
        let [sentence, _] = words.describe_measure(measure, &[metrics.limit_s]);
        Some((sentence, metrics.rates.counted(measure)?))
    };
    measure::FIRST.iter().filter_map(line).collect()
}

/// False alarms per hour, their upper limit, and their counts.
pub(crate) fn alarms_per_hour(healthy: &HealthyMetrics) -> [String; 3] {
    let HealthyMetrics { alarms, hours, alarms_per_h, alarms_per_h_upper, .. } = healthy;
    [
        format!("{} per hour", three_digits(*alarms_per_h)),
        format!("95 %: at most {}", three_digits(*alarms_per_h_upper)),
        format!("{alarms} in {hours:.1} h without a fault"),
    ]
}

/// The same in one sentence.
pub fn alarms_in_words(healthy: &HealthyMetrics) -> String {
    let [rate, limit, counts] = alarms_per_hour(healthy);
    format!("{rate} ({limit}), {counts}")
}

/// What the flights cover: the ranges of inputs and of the parameters of one actuator, with their units.
pub fn flown_ranges(study: &Study) -> Option<String> {
    let ranges = study.environment_ranges()?.ranges;
    let other = |name: &str| study.actuator_of(name).is_some_and(|actuator| actuator > 0);
    let own = ranges.iter().filter(|(name, _)| !other(name)).map(|(name, [low, high])| {
        let short =
            study.actuators.first().and_then(|actuator| name.strip_prefix(&format!("{actuator}.")));
        let unit = study.system.unit_of(name);
        let short = short.unwrap_or(name);
        let stem = short.strip_suffix(unit.suffix()).unwrap_or(short);
        let low = Shown::of(unit, *high).value(*low);
        format!("{} {} … {}", spoken(stem), three_digits(low), shown(*high, unit))
    });
    let own: Vec<String> = own.collect();
    (!own.is_empty()).then(|| own.join(", "))
}

/// Whether a stage decides between classes. The actuator stage does not if its counts contain one class only.
pub(crate) fn decides(stage: &StageScore) -> bool {
    let counts = &stage.score.confusion;
    let is_known = |class: &usize| {
        counts.iter().enumerate().any(|(truth, said)| {
            said.iter()
                .enumerate()
                .any(|(at, &count)| count > 0 && (truth == *class || at == *class))
        })
    };
    stage.question != Question::Actuator || (0..counts.len()).filter(is_known).count() > 1
}

/// The stages over all actuators in any of the results: the letter of each, and what it finds.
pub(crate) fn stages(words: &Vocabulary, results: &[&ProtocolResult]) -> Vec<(String, String)> {
    let mut stages: Vec<(String, String)> = vec![];
    let all = results.iter().flat_map(|result| &result.stages);
    for stage in all.filter(|stage| stage.actuator.is_none() && decides(stage)) {
        let finds = match (stage.question, &stage.action) {
            (Question::Actuator, _) if words.has_several() => words.actuator().to_owned(),
            (Question::Actuator, _) => words.question(stage.question),
            (Question::Action, _) => "action".into(),
            (Question::Detail, Some(action)) => format!("details of “{}”", spoken(action)),
            (Question::Detail, None) => "details".into(),
        };
        if stages.iter().all(|(id, _)| *id != stage.id) {
            stages.push((stage.id.clone(), finds));
        }
    }
    stages.sort();
    stages
}

impl Who {
    /// The trees first: they explain their answer.
    pub(crate) const ALL: [Who; 2] = [Who::Trees, Who::Committee];

    /// The name in tables.
    pub const fn title(self) -> &'static str {
        match self {
            Who::Trees => "trees",
            Who::Committee => "committee",
        }
    }

    /// The result under a protocol.
    pub(crate) fn under(
        self,
        evaluation: &Evaluation,
        protocol: Protocol,
    ) -> Option<&ProtocolResult> {
        match self {
            Who::Trees => evaluation.protocol(protocol),
            Who::Committee => evaluation.committee(protocol),
        }
    }

    /// What it says of healthy specimens.
    pub(crate) fn of_healthy(self, evaluation: &Evaluation) -> &Rates {
        let [trees, committee] = &evaluation.healthy;
        if self == Who::Trees { trees } else { committee }
    }

    /// The result under the hardest protocol that the study allows.
    pub(crate) fn headline(self, evaluation: &Evaluation) -> Option<&ProtocolResult> {
        self.under(evaluation, evaluation.headline()?.protocol)
    }
}

/// The trees under each protocol, followed by the committee where it was judged.
pub(crate) fn answers(evaluation: &Evaluation) -> Vec<(Who, &ProtocolResult)> {
    let of = |protocol| Who::ALL.map(|who| Some((who, who.under(evaluation, protocol)?)));
    ALL.into_iter().flat_map(of).flatten().collect()
}

/// One row of the headline.
pub struct HeadlineRow {
    /// The name of the measure.
    pub title: String,
    /// The part of the diagnosis that answers.
    pub who: &'static str,
    /// Whether the measure concerns safety.
    pub is_safety: bool,
    /// One rate for each scenario; `None` if the scenario has none.
    pub rates: Vec<Option<Rate>>,
}

/// The results without an extra sensor, one for each scenario, from the easiest to the hardest.
pub fn scenarios(results: &Results) -> Vec<&SubjectResult> {
    results.subjects.iter().filter(|result| !result.subject.extra_sensor()).collect()
}

/// The learned bands, if they are in use. Otherwise the fixed band of the seed paper is in use.
pub(crate) fn learned(result: &SubjectResult) -> Option<&[Band]> {
    result.evaluation.bands.as_deref().filter(|_| result.settings.learned_bands)
}

/// The headline of some scenarios. Rows without any rate are left out.
pub fn headline(scenarios: &[&SubjectResult], words: &Vocabulary) -> Vec<HeadlineRow> {
    let mut rows = vec![];
    let mut push = |title: &str, who, is_safety, of: &dyn Fn(&Evaluation) -> Option<Rate>| {
        let rates = scenarios.iter().map(|result| of(&result.evaluation));
        let rates: Vec<_> = rates.map(|rate| rate.filter(|rate| rate.of > 0)).collect();
        if rates.iter().any(Option::is_some) {
            rows.push(HeadlineRow { title: title.to_owned(), who, is_safety, rates });
        }
    };
    for measure in SAFETY {
        for who in Who::ALL {
            let of = |own: &Evaluation| who.headline(own)?.rates.counted(measure);
            push(&words.measure(measure), who.title(), true, &of);
        }
    }
    for who in Who::ALL {
        let of = |own: &Evaluation| who.of_healthy(own).counted(&measure::FALSE_SHUTDOWN);
        push(&words.measure(&measure::FALSE_SHUTDOWN), who.title(), true, &of);
    }
    for (measure, is_safety) in [(measure::VISIBLE_BY_CHANCE, true), (measure::VISIBLE, false)] {
        let of = |own: &Evaluation| own.in_band.counted(&measure);
        push(&words.measure(&measure), "bands", is_safety, &of);
    }
    for measure in RIGHT {
        for who in Who::ALL {
            let of = |own: &Evaluation| who.headline(own)?.rates.counted(measure);
            push(&words.measure(measure), who.title(), false, &of);
        }
    }
    rows
}
