//! The first screen: figures of merit with their targets, the faults that need attention, and the share detected of each
//! kind of fault. One tab for each scenario; the hardest is in front.

use crate::Material;
use crate::lines::{self, Who};
use crate::vocabulary::Vocabulary;
use crate::words::{begun, chosen, count_of, distinct, percent, spoken};
use servotwin::job::Subject;
use servotwin::job::results::SubjectResult;
use servotwin::learn::detection::Curve;
use servotwin::learn::metrics::Rate;
use servotwin::measure;
use servotwin::study::{Purpose, Scenario};
use servotwin_view::document::{Call, Document, Fact, Form, Value, fact};
use servotwin_view::value_map::ValueMap;

/// The target share of detected and isolated faults. The flight study has the same target for strong shutdown faults.
const TARGET: f64 = 0.95;

/// The maximum number of weak faults listed.
const WEAKEST: usize = 5;

/// The target of a figure of merit.
#[derive(Clone, Copy, PartialEq)]
enum Target {
    /// The event should never happen.
    Never,
    /// At least this share.
    AtLeast(f64),
}

/// A share beside its target. If the interval contains the target, the verdict stays open.
fn card(name: String, rate: Rate, target: Target) -> Fact {
    let (call, verdict) = match target {
        Target::Never if rate.count == 0 => (Call::Good, "target: never · none seen"),
        Target::Never => (Call::Act, "target: never · missed"),
        Target::AtLeast(share) if rate.low >= share => (Call::Good, "target: 95 % · met"),
        Target::AtLeast(share) if rate.high < share => (Call::Act, "target: 95 % · missed"),
        Target::AtLeast(_) => (Call::Neutral, "target: 95 % · not certain"),
    };
    let text = format!(
        "{}\n{}, {:.2} … {:.2} %\n{verdict}",
        percent(rate.share),
        count_of(rate),
        100.0 * rate.low,
        100.0 * rate.high
    );
    fact("", name, Value { call: Some(call), ..Value::of(text, &rate) })
}

/// Writes the first screen, or nothing if there are no results.
pub fn write(material: &Material, page: &mut Document) {
    if let Some(missing) = missing(material) {
        page.note(missing);
    }
    let words = material.words();
    let mut tabs = Document::section("scenario", "").formed(Form::Choices);
    for result in lines::scenarios(material.results).into_iter().rev() {
        let name = format!("scenario-{}", result.subject.name());
        let mut section = Document::section(name, result.title.as_str());
        scenario(material, result, &words, &mut section);
        tabs.add(section);
    }
    page.add(tabs);
}

/// Reports results that a reader may expect and that this report lacks.
fn missing(material: &Material) -> Option<String> {
    let Material { study, results, flights, .. } = material;
    if study.is_on_ground() {
        return None;
    }
    let is_there = |scenario: Scenario| results.of(Subject::of(scenario)).is_some();
    let expected = Scenario::ALL.into_iter().filter(|scenario| scenario.is_usual());
    let mut missing: Vec<String> = expected
        .filter(|scenario| scenario.is_possible(study) && !is_there(*scenario))
        .map(|scenario| scenario.name().to_owned())
        .collect();
    if study.is_full && study.flights.is_some() && flights.is_none() {
        missing.push(format!("{}s in which faults begin", material.words().run()));
    }
    if !missing.is_empty() {
        let missing = missing.join(", ");
        return Some(format!(
            "Not in this report yet: {missing}. servotwin study adds what is missing."
        ));
    }
    (!study.is_full).then(|| {
        format!(
            "Quick study: records of {} s, {} training commands. servotwin study --full runs everything.",
            study.duration_s,
            study.cases_of(Purpose::Train).len(),
        )
    })
}

fn scenario(
    material: &Material,
    result: &SubjectResult,
    words: &Vocabulary,
    section: &mut Document,
) {
    let flown = in_flight(material, result, words);
    let covered = lines::flown_ranges(material.study).filter(|_| !flown.is_empty());
    section.facts("", cards(result, words).into_iter().chain(flown));
    if let Some(ranges) = covered {
        section.note(format!("{}s cover {ranges}.", begun(words.run())));
    }
    weakest(material, result, section);
    let map = share_detected(result);
    section.figure(
        format!("detected_{}", result.subject.name()),
        map.draw(),
        "Share detected of each kind of fault at each intensity, the least detected first.",
    );
}

/// The cards of the flights in a scenario.
fn in_flight(material: &Material, result: &SubjectResult, words: &Vocabulary) -> Vec<Fact> {
    let scenario = result.subject.scenario().name();
    let flights = material.flights.into_iter().flat_map(|flights| flights.judged());
    let Some(metrics) = flights.into_iter().find(|own| own.group.scenario == scenario) else {
        return vec![];
    };
    let run = words.run();
    let rates = lines::in_flight(metrics, words).into_iter().map(|(title, rate)| {
        let (share, count) = (percent(rate.share), count_of(rate));
        let text = format!(
            "{share}\n{count} {run}s, {:.2} … {:.2} %",
            100.0 * rate.low,
            100.0 * rate.high
        );
        fact("", format!("In {run}: {title}"), Value::of(text, &rate))
    });
    let mut cards: Vec<Fact> = rates.collect();
    if metrics.healthy.hours > 0.0 {
        let text = lines::alarms_per_hour(&metrics.healthy).join("\n");
        cards.push(fact("", format!("In {run}: false alarms"), text));
    }
    cards
}

fn cards(result: &SubjectResult, words: &Vocabulary) -> Vec<Fact> {
    let evaluation = &result.evaluation;
    let who =
        if Who::Committee.headline(evaluation).is_some() { Who::Committee } else { Who::Trees };
    let headline = who.headline(evaluation);
    let mut cards = vec![];
    let mut push = |name: String, rate: Option<Rate>, target| {
        let rate = rate.filter(|rate| rate.of > 0);
        cards.extend(rate.map(|rate| card(name, rate, target)));
    };
    let rate = |measure| headline.and_then(|headline| headline.rates.counted(measure));
    push(
        format!("Healthy {} {} beside a listed fault", words.actuator(), words.switched_off()),
        rate(&measure::WRONG_SHUTDOWN),
        Target::Never,
    );
    push(
        format!("Missed {}, of all faults that need one", words.off()),
        rate(&measure::SHUTDOWN_MISSED_OF_ALL),
        Target::Never,
    );
    push(
        "False alarms: healthy specimens taken for faulty".into(),
        who.of_healthy(evaluation).counted(&measure::FALSE_ALARM),
        Target::Never,
    );
    push(
        "Faults detected".into(),
        evaluation.in_band.counted(&measure::VISIBLE),
        Target::AtLeast(TARGET),
    );
    push(
        format!("Isolated by the {}, of the detected faults", who.title()),
        rate(&measure::END_TO_END),
        Target::AtLeast(TARGET),
    );
    push(
        format!("{} right, of the detected faults", begun(&words.action())),
        rate(&measure::RIGHT_ACTION),
        Target::AtLeast(TARGET),
    );
    cards
}

/// A kind of fault with its detection rate, and the cases in which it is not detected.
struct Seen<'r> {
    /// The kind of fault.
    kind: &'r str,
    /// The detection rate over all intensities and cases.
    rate: Rate,
    /// The cases in which it is never detected.
    never: Vec<&'r str>,
    /// The number of cases in which it was tested.
    cases: usize,
    /// The intensity from which it is detected in the worst of the other cases.
    from: f64,
}

/// The detection rate of a kind of fault over all its intensities.
fn whole(curve: &Curve) -> Rate {
    let sum = |of: fn(&Rate) -> u64| curve.points.iter().map(|(_, rate)| of(rate)).sum();
    Rate::new(sum(|rate| rate.count), sum(|rate| rate.of))
}

/// Lists every kind of fault, the least detected first.
fn seen<'r>(result: &'r SubjectResult) -> Vec<Seen<'r>> {
    let detection = &result.evaluation.detection;
    let of_curve = |curve: &'r Curve| {
        let own = || {
            let is_own =
                |fault: &str| fault == curve.kind || fault.ends_with(&format!(".{}", curve.kind));
            detection.least.iter().filter(move |least| is_own(&least.fault))
        };
        let never = own().filter(|least| least.intensity.is_none());
        Seen {
            kind: &curve.kind,
            rate: whole(curve),
            never: distinct(never.map(|least| least.case.as_str())),
            cases: distinct(own().map(|least| least.case.as_str())).len(),
            from: own().filter_map(|least| least.intensity).fold(0.0, f64::max),
        }
    };
    let mut all: Vec<Seen> = detection.curves.iter().map(of_curve).collect();
    all.retain(|seen| seen.rate.of > 0);
    let share = |seen: &Seen| seen.rate.share.unwrap_or(1.0);
    all.sort_by(|a, b| share(a).total_cmp(&share(b)).then(a.kind.cmp(b.kind)));
    all
}

/// The faults with the lowest detection rates, each with advice.
fn weakest(material: &Material, result: &SubjectResult, section: &mut Document) {
    let all = seen(result);
    let weak = all.iter().filter(|seen| seen.rate.count < seen.rate.of).take(WEAKEST);
    let lines = weak.map(|seen| {
        format!(
            "{} is detected in {} of its tests ({}). {}",
            begun(&spoken(seen.kind)),
            percent(seen.rate.share),
            count_of(seen.rate),
            advice(material, result, seen)
        )
    });
    let lines: Vec<String> = lines.collect();
    section.heading("Faults that are detected least");
    if lines.is_empty() {
        section.text("Every fault is detected in each of its tests.");
    } else {
        section.list("weakest", lines);
    }
}

/// One sentence about how to make the fault visible.
fn advice(material: &Material, result: &SubjectResult, weak: &Seen) -> String {
    // Only specimens that differ from their twin have something to fit.
    let has_tolerances = result.subject.scenario() == Scenario::Realistic;
    let perfect = material.results.of(Subject::Noise).filter(|_| has_tolerances);
    let of_perfect = perfect.and_then(|perfect| {
        let all = seen(perfect);
        all.into_iter().find(|seen| seen.kind == weak.kind).map(|seen| seen.rate)
    });
    // Different bands detect differently, so only a difference beyond both intervals counts.
    if let Some(rate) = of_perfect.filter(|rate| rate.low > weak.rate.high) {
        let measure = match Scenario::Fitted.is_possible(material.study) {
            true => "; servotwin study --fitted measures what twins fitted to their specimens show",
            false => "",
        };
        return format!(
            "In the scenario noise, without tolerances and with its own bands, it is detected in {}{measure}.",
            percent(rate.share)
        );
    }
    if weak.rate.count == 0 {
        return "Add a command that moves the part, or a sensor nearer to it ([extra_sensor] measures the gain)."
            .into();
    }
    if !weak.never.is_empty() && weak.never.len() < weak.cases {
        return format!(
            "It never shows in {}: test it with the other commands, and from intensity {} on.",
            weak.never.join(" and "),
            chosen(weak.from)
        );
    }
    match weak.from {
        from if from > 0.0 => format!(
            "It shows in every case from intensity {} on: inspect the part at intervals for weaker faults.",
            chosen(from)
        ),
        _ => "Test it with a command that asks more of the part.".into(),
    }
}

/// The share detected for every kind of fault and intensity, the hardest kind first.
fn share_detected(result: &SubjectResult) -> ValueMap {
    let mut curves: Vec<&Curve> = result.evaluation.detection.curves.iter().collect();
    let share = |curve: &Curve| whole(curve).share.unwrap_or(0.0);
    curves.sort_by(|a, b| share(a).total_cmp(&share(b)));
    let points = curves.iter().flat_map(|curve| &curve.points);
    let mut intensities: Vec<f64> =
        points.filter(|(_, rate)| rate.of > 0).map(|(intensity, _)| *intensity).collect();
    intensities.sort_by(f64::total_cmp);
    intensities.dedup();
    let value = |curve: &Curve, intensity: f64| {
        let found = curve.points.iter().find(|(own, rate)| *own == intensity && rate.of > 0);
        found.and_then(|(_, rate)| rate.share).map(|share| 100.0 * share)
    };
    ValueMap {
        rows: curves.iter().map(|curve| spoken(&curve.kind)).collect(),
        columns: intensities.iter().map(|intensity| chosen(*intensity)).collect(),
        values: curves
            .iter()
            .map(|curve| intensities.iter().map(|own| value(curve, *own)).collect())
            .collect(),
        range: (0.0, 100.0),
        meaning: "detected / %, by intensity".into(),
        ..ValueMap::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_met_missed_or_open_by_the_interval() {
        let card = |count, of, target| card("a".into(), Rate::new(count, of), target).2;
        let call = |count, of, target| card(count, of, target).call;
        assert_eq!(call(0, 100, Target::Never), Some(Call::Good));
        assert_eq!(call(1, 100, Target::Never), Some(Call::Act));
        assert_eq!(call(999, 1000, Target::AtLeast(TARGET)), Some(Call::Good));
        assert_eq!(call(50, 100, Target::AtLeast(TARGET)), Some(Call::Act));
        assert_eq!(call(96, 100, Target::AtLeast(TARGET)), Some(Call::Neutral));
        let text = card(96, 100, Target::AtLeast(TARGET)).text;
        assert!(text.contains("96 of 100, 90.16 … 98.43"), "{text}");
    }
}
