//! The first screen: figures of merit with their targets, the intensity at which each fault becomes detectable, and the
//! faults that need attention. One tab for each scenario; the hardest is in front.

use crate::Material;
use crate::lines::{self, Who};
use crate::page::{Page, counted};
use crate::vocabulary::Vocabulary;
use crate::words::{begun, chosen, percent, spoken};
use servotwin::evaluation::detection::Curve;
use servotwin::evaluation::metrics::Rate;
use servotwin::job::Subject;
use servotwin::job::results::SubjectResult;
use servotwin::study::{Purpose, Scenario};
use servotwin_io::text::escaped;
use std::fmt::Write;

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

/// A figure of merit.
struct Card {
    name: String,
    rate: Rate,
    target: Target,
}

/// A card; `value`, `note` and `verdict` are HTML. A figure without a target has no verdict.
fn card(class: &str, name: &str, [value, note]: [&str; 2], verdict: Option<&str>) -> String {
    let verdict = verdict.map_or(String::new(), |text| format!("<p class=\"verdict\">{text}</p>"));
    format!(
        "<div class=\"card {class}\"><p>{}</p><p class=\"value\">{value}</p><p class=\"note\">{note}</p>{verdict}</div>\n",
        escaped(name)
    )
}

impl Card {
    /// Whether the target is met. If the interval contains the target, the verdict stays open.
    fn verdict(&self) -> (&'static str, &'static str) {
        match self.target {
            Target::Never if self.rate.count == 0 => ("met", "target: never · none seen"),
            Target::Never => ("missed", "target: never · missed"),
            Target::AtLeast(share) if self.rate.low >= share => ("met", "target: 95 % · met"),
            Target::AtLeast(share) if self.rate.high < share => ("missed", "target: 95 % · missed"),
            Target::AtLeast(_) => ("open", "target: 95 % · not certain"),
        }
    }

    fn html(&self) -> String {
        let (class, verdict) = self.verdict();
        let interval = format!("{:.2} … {:.2} %", 100.0 * self.rate.low, 100.0 * self.rate.high);
        let value = counted(&percent(self.rate.share), self.rate);
        card(class, &self.name, [&value, &interval], Some(verdict))
    }
}

/// Writes the first screen, or nothing if there are no results.
pub fn write(material: &Material, page: &mut Page) {
    if let Some(missing) = missing(material) {
        page.note(&missing);
    }
    let words = material.words();
    let scenarios = lines::scenarios(material.results);
    let tabs: Vec<(String, String)> = scenarios
        .iter()
        .map(|result| (result.title.clone(), scenario(material, result, &words)))
        .collect();
    page.tabs("scenario", &tabs);
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

fn scenario(material: &Material, result: &SubjectResult, words: &Vocabulary) -> String {
    let mut cards: String = cards(result, words).iter().map(Card::html).collect();
    let flown = in_flight(material, result, words);
    cards += flown.as_deref().unwrap_or_default();
    let covered = flown.and_then(|_| lines::flown_ranges(material.study)).map(|ranges| {
        let run = begun(words.run());
        format!("<p class=\"note\">{run}s cover {}.</p>\n", escaped(&ranges))
    });
    format!(
        "<div class=\"overview\">\n<div><div class=\"cards\">\n{cards}</div>\n{}{}</div>\n{}</div>\n",
        covered.unwrap_or_default(),
        weakest(material, result),
        heat_map(result),
    )
}

/// The cards of the flights in a scenario; `None` without any.
fn in_flight(material: &Material, result: &SubjectResult, words: &Vocabulary) -> Option<String> {
    let scenario = result.subject.scenario().name();
    let metrics = material.flights?.judged().find(|metrics| metrics.group.scenario == scenario)?;
    let run = words.run();
    let rates = lines::in_flight(metrics, words).into_iter().map(|(title, rate)| {
        let interval = format!("{:.2} … {:.2} %", 100.0 * rate.low, 100.0 * rate.high);
        let note = format!("{} of {} {run}s, {interval}", rate.count, rate.of);
        card("open", &format!("In {run}: {title}"), [&percent(rate.share), &note], None)
    });
    let mut cards: String = rates.collect();
    if metrics.healthy.hours > 0.0 {
        let [value, limit, counts] = lines::alarms_per_hour(&metrics.healthy);
        let note = format!("{limit}, {counts}");
        cards += &card("open", &format!("In {run}: false alarms"), [&value, &note], None);
    }
    Some(cards)
}

fn cards(result: &SubjectResult, words: &Vocabulary) -> Vec<Card> {
    let evaluation = &result.evaluation;
    let who =
        if Who::Committee.headline(evaluation).is_some() { Who::Committee } else { Who::Trees };
    let headline = who.headline(evaluation);
    let mut cards = vec![];
    let mut push = |name: String, rate: Option<Rate>, target| {
        let rate = rate.filter(|rate| rate.of > 0);
        cards.extend(rate.map(|rate| Card { name, rate, target }));
    };
    let safety = headline.and_then(|headline| headline.safety.as_ref()).filter(|_| words.has_off());
    if words.has_several() {
        push(
            format!("Healthy {} {} beside a listed fault", words.unit(), words.switched_off()),
            safety.map(|safety| safety.wrong_actuator_shutdown),
            Target::Never,
        );
    }
    // Undetected faults count, too, where every fault was tested.
    let missed = safety.map(|safety| match safety.missed_shutdown_of_all {
        Some(of_all) => (of_all, "all"),
        None => (safety.missed_shutdown, "the detected"),
    });
    push(
        format!(
            "Missed {}, of {} faults that need one",
            words.off(),
            missed.map_or("all", |(_, which)| which)
        ),
        missed.map(|(rate, _)| rate),
        Target::Never,
    );
    push(
        "False alarms: healthy specimens taken for faulty".into(),
        evaluation.false_alarms.as_ref().map(|alarms| match who {
            Who::Trees => alarms.trees,
            Who::Committee => alarms.committee,
        }),
        Target::Never,
    );
    push("Faults detected".into(), Some(evaluation.detection.detected), Target::AtLeast(TARGET));
    push(
        format!("Isolated by the {}, of the detected faults", who.title()),
        headline.and_then(|headline| headline.end_to_end),
        Target::AtLeast(TARGET),
    );
    push(
        format!("{} right, of the detected faults", begun(&words.action())),
        headline.and_then(|headline| headline.right_action),
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

/// Lists every kind of fault, the least detected first.
fn seen<'r>(result: &'r SubjectResult) -> Vec<Seen<'r>> {
    let detection = &result.evaluation.detection;
    let of_curve = |curve: &'r Curve| {
        let sum = |of: fn(&Rate) -> u64| curve.points.iter().map(|(_, rate)| of(rate)).sum();
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

/// The faults with the lowest detection rates, each with advice.
fn weakest(material: &Material, result: &SubjectResult) -> String {
    let all = seen(result);
    let weak = all.iter().filter(|seen| seen.rate.count < seen.rate.of).take(WEAKEST);
    let mut html =
        String::from("<h3>Faults that are detected least</h3>\n<ol class=\"weakest\">\n");
    let mut any = false;
    for seen in weak {
        any = true;
        let _ = writeln!(
            html,
            "<li><b>{}</b> is detected in {} of its tests. {}</li>",
            escaped(&begun(&spoken(seen.kind))),
            counted(&percent(seen.rate.share), seen.rate),
            escaped(&advice(material, result, seen))
        );
    }
    html += "</ol>\n";
    if any { html } else { "<p>Every fault is detected in each of its tests.</p>\n".into() }
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
fn heat_map(result: &SubjectResult) -> String {
    let mut curves: Vec<_> = result.evaluation.detection.curves.iter().collect();
    let share = |curve: &&Curve| {
        let (count, of) = curve
            .points
            .iter()
            .fold((0, 0), |(count, of), (_, rate)| (count + rate.count, of + rate.of));
        count as f64 / of.max(1) as f64
    };
    curves.sort_by(|a, b| share(a).total_cmp(&share(b)));
    let mut html = String::from(
        "<figure class=\"heat\"><figcaption>Share detected of each kind of fault: one cell for each intensity, \
         weak to strong; blue for all, orange for none</figcaption>\n",
    );
    for curve in curves {
        let kind = spoken(&curve.kind);
        let _ = write!(html, "<div><span>{}</span>", escaped(&kind));
        for (intensity, rate) in curve.points.iter().filter(|(_, rate)| rate.of > 0) {
            let share = rate.count as f64 / rate.of as f64;
            let _ = write!(
                html,
                "<i style=\"--share:{:.0}%\" title=\"{}, intensity {}: {} of {} detected\"></i>",
                100.0 * share,
                escaped(&kind),
                chosen(*intensity),
                rate.count,
                rate.of
            );
        }
        html += "</div>\n";
    }
    html + "</figure>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_met_missed_or_open_by_the_interval() {
        let card =
            |count, of, target| Card { name: "a".into(), rate: Rate::new(count, of), target };
        let verdict = |count, of, target| card(count, of, target).verdict().0;
        assert_eq!(verdict(0, 100, Target::Never), "met");
        assert_eq!(verdict(1, 100, Target::Never), "missed");
        assert_eq!(verdict(999, 1000, Target::AtLeast(TARGET)), "met");
        assert_eq!(verdict(50, 100, Target::AtLeast(TARGET)), "missed");
        assert_eq!(verdict(96, 100, Target::AtLeast(TARGET)), "open");
        let html = card(96, 100, Target::AtLeast(TARGET)).html();
        assert!(html.contains("title=\"96 of 100\"") && html.contains("90.16 … 98.43"), "{html}");
    }
}
