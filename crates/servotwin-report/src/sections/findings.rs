//! The findings to act on, one sentence each, measured in the hardest setting. They cover undetected faults, ways to
//! detect more, dangerous errors, confused faults, the gain from the additional sensor, and missed limits. A quantity
//! that was not counted produces no finding.

use super::{bands, flights, settings};
use crate::Material;
use crate::lines::{self, Who};
use crate::vocabulary::Vocabulary;
use crate::words::{begun, chosen, percent, rate, spoken};
use servotwin::evaluation::detection::Curve;
use servotwin::evaluation::metrics::Rate;
use servotwin::evaluation::protocol::ProtocolResult;
use servotwin::job::Subject;
use servotwin::job::results::SubjectResult;
use servotwin::study::Setting;

/// A topic and its finding.
type Finding = (String, String);

/// A kind of fault with a lower detection rate is named.
const LATE: f64 = 0.9;

/// The maximum number of faults, components or pairs named.
const NAMED: usize = 4;

/// The findings of the hardest setting.
pub(super) fn all(
    material: &Material,
    hardest: &SubjectResult,
    words: &Vocabulary,
) -> Vec<Finding> {
    let mut list = vec![unseen(material, hardest)];
    list.extend(advice(material, hardest));
    list.extend(dangerous(material, hardest, words));
    list.extend(right(hardest, words));
    list.extend(confused(hardest, words));
    list.extend(additional_sensor(material));
    list.extend(limits(material, hardest, words));
    let at_work = material.flights.and_then(|results| flights::finding(results, words));
    list.extend(at_work.map(|text| ("At work".to_owned(), text)));
    list
}

/// A kind of fault with its detection rate, and the cases in which it is not detected.
pub(crate) struct Seen<'r> {
    /// The kind of fault.
    pub kind: &'r str,
    /// The action that it calls for, or an empty string.
    pub command: String,
    /// The detection rate over all intensities and cases.
    pub rate: Rate,
    /// The cases in which it is never detected.
    pub never: Vec<&'r str>,
    /// The number of cases in which it was tested.
    pub cases: usize,
    /// The intensity from which it is detected in the worst of the other cases.
    pub from: f64,
}

impl Seen<'_> {
    fn in_words(&self) -> String {
        let called = match self.command.as_str() {
            "" => String::new(),
            command => format!(" ({})", spoken(command)),
        };
        let is_never_together = !self.never.is_empty() && self.never.len() == self.cases;
        let from = match self.from {
            from if from > 0.0 && !is_never_together => {
                format!(", only from intensity {} on", chosen(from))
            }
            _ => String::new(),
        };
        let never = match self.never.len() {
            0 => String::new(),
            all if all == self.cases => ", in no case at its greatest intensity".into(),
            few if few <= 3 => format!(", never in {}", self.never.join(" and ")),
            many => format!(", never in {many} of {} cases", self.cases),
        };
        format!("{}{called}: {}{never}{from}", spoken(self.kind), rate(Some(self.rate)))
    }
}

/// Lists every kind of fault, the least detected first.
pub(crate) fn seen<'r>(material: &Material, result: &'r SubjectResult) -> Vec<Seen<'r>> {
    let detection = &result.evaluation.detection;
    let of_curve = |curve: &'r Curve| {
        let sum = |of: fn(&Rate) -> u64| curve.points.iter().map(|(_, rate)| of(rate)).sum();
        let class = material.study.classes.iter().find(|class| class.detail == curve.detail);
        let own: Vec<_> = detection
            .least
            .iter()
            .filter(|l| l.fault == curve.kind || l.fault.ends_with(&format!(".{}", curve.kind)))
            .collect();
        let (mut never, mut cases, mut from) = (vec![], vec![], 0.0_f64);
        for least in own {
            if !cases.contains(&least.case.as_str()) {
                cases.push(&least.case);
            }
            match least.intensity {
                Some(intensity) => from = from.max(intensity),
                None if never.contains(&least.case.as_str()) => {}
                None => never.push(least.case.as_str()),
            }
        }
        Seen {
            kind: &curve.kind,
            command: class.map(|class| class.command.clone()).unwrap_or_default(),
            rate: Rate::new(sum(|rate| rate.count), sum(|rate| rate.of)),
            never,
            cases: cases.len(),
            from,
        }
    };
    let mut all: Vec<Seen> = detection.curves.iter().map(of_curve).collect();
    all.retain(|seen| seen.rate.of > 0);
    let share = |seen: &Seen| seen.rate.share.unwrap_or(1.0);
    all.sort_by(|a, b| share(a).total_cmp(&share(b)).then(a.kind.cmp(b.kind)));
    all
}

/// Joins the first few items, and counts the rest.
fn named(mut items: Vec<String>, more: &str) -> String {
    let rest = items.len().saturating_sub(NAMED);
    items.truncate(NAMED);
    match rest {
        0 => items.join("; "),
        1 => format!("{}; and one more", items.join("; ")),
        rest => format!("{}; and {rest} more {more}", items.join("; ")),
    }
}

fn unseen(material: &Material, result: &SubjectResult) -> Finding {
    let all = seen(material, result);
    let late = all.iter().filter(|seen| seen.rate.share.is_some_and(|share| share < LATE));
    let late: Vec<String> = late.map(Seen::in_words).collect();
    let detected = rate(Some(result.evaluation.detection.detected));
    let detected = format!("{detected} of all faults leave the bands");
    if late.is_empty() {
        return ("Detected".into(), detected + &of_every_kind(&all));
    }
    let text = format!(
        "{detected}. {} of {} kinds do so in less than {} % of their tests: {}.",
        late.len(),
        all.len(),
        chosen(100.0 * LATE),
        named(late, "kinds")
    );
    ("Not or late detected".into(), text)
}

/// A band wider than this share of the scale makes its sensor useless.
const BLIND: f64 = 0.3;

/// Ways to detect more: fitted twins if specimens without tolerances show more, and other commands or sensors if neither
/// scenario shows a fault. Each scenario has bands of its own, so a sentence names both and compares counts alone.
fn advice(material: &Material, hardest: &SubjectResult) -> Option<Finding> {
    let of = |subject| material.results.of(subject);
    let detected = |result: &SubjectResult| result.evaluation.detection.detected;
    let share = |rate: Rate| rate.share.unwrap_or(0.0);
    let mut acts = vec![];
    let has_tolerances = hardest.subject.setting().has_tolerances();
    let perfect = of(Subject::Noise).filter(|_| has_tolerances);
    if let Some(perfect) =
        perfect.filter(|perfect| detected(perfect).low > share(detected(hardest)))
    {
        let seen_by = percent(detected(perfect).share);
        acts.push(match of(Subject::Fitted) {
            Some(fitted) => format!(
                "without tolerances {seen_by} leave the bands of the scenario noise: beside twins that are fitted to \
                 their specimens (servotwin fit) {} leave theirs",
                rate(Some(detected(fitted)))
            ),
            None => format!(
                "without tolerances {seen_by} leave the bands of the scenario noise: {}'servotwin study --fitted' \
                 measures what twins fitted to their specimens show",
                match Setting::Fitted.is_possible(material.study) {
                    true => "",
                    false => "with a section [fitted] in the study ",
                }
            ),
        });
    }
    acts.extend(blind(material, hardest));
    let hidden = perfect.map(|perfect| seen(material, perfect)).unwrap_or_default();
    let own = seen(material, hardest);
    let is_shown = |kind: &str| own.iter().any(|seen| seen.kind == kind && seen.rate.count > 0);
    let hidden = hidden.iter().filter(|seen| seen.rate.count == 0 && !is_shown(seen.kind));
    let hidden: Vec<String> = hidden.map(|seen| spoken(seen.kind)).collect();
    if !hidden.is_empty() {
        acts.push(format!(
            "no test of either scenario shows {}: that takes another command, or a sensor nearer to it \
             ([extra_sensor] measures what one buys)",
            named(hidden, "kinds")
        ));
    }
    (!acts.is_empty()).then(|| ("To do".to_owned(), format!("{}.", begun(&acts.join("; ")))))
}

/// The sensors whose learned bands are too wide to detect anything.
fn blind(material: &Material, result: &SubjectResult) -> Option<String> {
    let bands = result.evaluation.bands.iter().flatten();
    let wide: Vec<String> = bands
        .filter(|band| band.half_width > BLIND)
        .map(|band| {
            format!(
                "{} (±{} % of its scale)",
                bands::label(material.study, &band.sensor),
                chosen((100.0 * band.half_width).round())
            )
        })
        .collect();
    (!wide.is_empty()).then(|| {
        format!(
            "the band of {} is too wide to tell a fault by: narrower tolerances, or a fitted twin",
            named(wide, "sensors")
        )
    })
}

/// Ends the sentence with the detection rate of the least detected kind, if any fault was missed.
fn of_every_kind(all: &[Seen]) -> String {
    let least = all.first().filter(|least| least.rate.count < least.rate.of);
    least.map_or_else(
        || ".".into(),
        |least| {
            let (kinds, share) = (all.len(), percent(least.rate.share));
            format!("; every one of the {kinds} kinds in at least {share} of its tests.")
        },
    )
}

/// The cost of errors: actuators switched off wrongly, and faults without an answer.
fn dangerous(material: &Material, result: &SubjectResult, words: &Vocabulary) -> Vec<Finding> {
    if !words.has_off() {
        let text = "The study says of no command that it switches its unit off ([reactions], \
                    switches_off): so nothing is counted about missed or wrong switching.";
        return vec![("Dangerous".into(), text.into())];
    }
    let mut list = vec![];
    let evaluation = &result.evaluation;
    for measure in lines::safety(words) {
        let both = both(&|who| who.headline(evaluation).and_then(measure.rate));
        let Some(both) = both else { continue };
        let mut text = both;
        if measure.title.contains("(of all)") {
            let off = |seen: &Seen| material.study.reactions.switches_off(&seen.command);
            let hidden = seen(material, result).into_iter();
            let hidden = hidden.filter(|seen| off(seen) && seen.rate.count < seen.rate.of);
            let hidden: Vec<String> = hidden
                .map(|seen| {
                    format!(
                        "{} (in {} of {} tests)",
                        spoken(seen.kind),
                        seen.rate.of - seen.rate.count,
                        seen.rate.of
                    )
                })
                .collect();
            if !hidden.is_empty() {
                text += &format!("; not detected: {}", named(hidden, "kinds"));
            }
        }
        let wrong = evaluation.headline().filter(|_| measure.title.starts_with("wrong"));
        if let Some(from) = wrong.and_then(wrong_components) {
            text += &format!("; by the trees from {from}");
        }
        list.push((begun(&measure.title), text + "."));
    }
    if let Some(alarms) = evaluation.false_alarms.as_ref().filter(|alarms| alarms.alarms.of > 0) {
        let text = format!(
            "{} of {} healthy specimens leave the bands; {} are then {} by the trees, {} by the committee.",
            rate(Some(alarms.alarms)),
            alarms.alarms.of,
            rate(Some(alarms.tree_shutdowns)),
            words.switched_off(),
            rate(Some(alarms.committee_shutdowns)),
        );
        list.push(("False alarms".into(), text));
    }
    list
}

/// The components whose faults switch a healthy actuator off, the worst first.
fn wrong_components(result: &ProtocolResult) -> Option<String> {
    let mut guilty: Vec<_> =
        result.components.iter().filter(|one| one.wrong_actuator_shutdown.count > 0).collect();
    let share = |rate: Rate| rate.share.unwrap_or(0.0);
    guilty.sort_by(|a, b| {
        share(b.wrong_actuator_shutdown).total_cmp(&share(a.wrong_actuator_shutdown))
    });
    let one = |component: &&servotwin::evaluation::protocol::ComponentScore| {
        let share = percent(component.wrong_actuator_shutdown.share);
        format!("{} ({share} of its tests)", spoken(&component.component))
    };
    let guilty: Vec<String> = guilty.iter().map(one).collect();
    (!guilty.is_empty()).then(|| named(guilty, "components"))
}

/// A rate of the trees and of the committee; `None` if nothing was counted.
fn both(of: &dyn Fn(Who) -> Option<Rate>) -> Option<String> {
    let counted = |who| of(who).filter(|rate| rate.of > 0);
    match (counted(Who::Trees), counted(Who::Committee)) {
        (None, None) => None,
        (trees, None) => Some(format!("{} (trees)", rate(trees))),
        (None, committee) => Some(format!("{} (committee)", rate(committee))),
        (trees, committee) => {
            Some(format!("{} (trees), {} (committee)", rate(trees), rate(committee)))
        }
    }
}

fn right(result: &SubjectResult, words: &Vocabulary) -> Option<Finding> {
    let evaluation = &result.evaluation;
    let rates = lines::right(words).into_iter().filter_map(|measure| {
        let both = both(&|who| who.headline(evaluation).and_then(measure.rate))?;
        Some(format!("{}: {both}", measure.title))
    });
    let rates: Vec<String> = rates.collect();
    (!rates.is_empty())
        .then(|| ("Of the detected faults".to_owned(), format!("{}.", rates.join("; "))))
}

fn confused(result: &SubjectResult, words: &Vocabulary) -> Option<Finding> {
    let pairs = result.evaluation.ambiguity.pairs.iter().take(NAMED - 1).map(|pair| {
        // All tests of the kind; the share refers to them.
        let of = (pair.count as f64 / pair.share).round() as u64;
        format!(
            "{} for {} in {} of its tests ({} is then wrong)",
            spoken(&pair.kind),
            spoken(&pair.taken_for),
            rate(Some(Rate::new(pair.count, of))),
            words.question(pair.question)
        )
    });
    let pairs: Vec<String> = pairs.collect();
    (!pairs.is_empty())
        .then(|| ("Taken for each other".to_owned(), format!("{}.", pairs.join("; "))))
}

fn additional_sensor(material: &Material) -> Option<Finding> {
    let of = |subject| material.results.of(subject);
    let (without, with) = of(Subject::Realistic).zip(of(Subject::ExtraSensor))?;
    let trees = |result: &SubjectResult| Who::Trees.headline(&result.evaluation).cloned();
    let (before, after) = trees(without).zip(trees(with))?;
    let title = material.study.extra_sensor.as_deref().unwrap_or("an additional sensor");
    let text = format!("{}: {}", begun(title), settings::gain(&before, &after));
    Some(("An additional sensor".into(), text))
}

/// The limits that are missed, and the promise of the bands if it is broken.
fn limits(material: &Material, result: &SubjectResult, words: &Vocabulary) -> Vec<Finding> {
    let mut list = vec![];
    if let Some(results) = material.flights {
        let limits = flights::limits(material.study, results, words);
        let missed = limits.iter().filter(|limit| limit.is_missed());
        let missed: Vec<String> = missed.map(flights::Limit::in_words).collect();
        let text = match missed.as_slice() {
            [] => "None of the limits at work is missed for certain.".to_owned(),
            missed => format!("{}.", missed.join("; ")),
        };
        list.push(("Limits missed".to_owned(), text));
    }
    let broken = bands::broken_promise(result);
    list.extend(broken.map(|text| ("Bands".to_owned(), text)));
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_of_nothing_is_no_finding() {
        assert_eq!(both(&|_| Some(Rate::new(0, 0))), None);
        assert_eq!(both(&|_| None), None);
        let trees = both(&|who| (who == Who::Trees).then(|| Rate::new(99, 100)));
        assert_eq!(trees.unwrap(), "99.00 % [94.55 … 99.82] (trees)");
    }

    #[test]
    fn the_kind_seen_least_is_spoken_of_where_any_is_missed() {
        let seen = |count| Seen {
            kind: "leak",
            command: String::new(),
            rate: Rate::new(count, 100),
            never: vec![],
            cases: 2,
            from: 0.0,
        };
        assert_eq!(of_every_kind(&[seen(100), seen(100)]), ".");
        let two = of_every_kind(&[seen(93), seen(100)]);
        assert_eq!(two, "; every one of the 2 kinds in at least 93.00 % of its tests.");
        assert_eq!(of_every_kind(&[]), ".");
    }

    #[test]
    fn a_fault_that_is_hard_to_see_says_where() {
        let seen = Seen {
            kind: "servo_valve.gain_low",
            command: "shut_down".into(),
            rate: Rate::new(1, 4),
            never: vec!["S1/50"],
            cases: 2,
            from: 0.75,
        };
        assert_eq!(
            seen.in_words(),
            "servo valve: gain low (shut down): 25.00 % [4.56 … 69.94], never in S1/50, only from \
             intensity 0.75 on"
        );
        let names: Vec<String> = (0..6).map(|n| n.to_string()).collect();
        assert_eq!(named(names, "kinds"), "0; 1; 2; 3; and 2 more kinds");
    }
}
