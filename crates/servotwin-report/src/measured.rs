//! The measured results of a study on one page: safety, detection and isolation of records, and the
//! figures of merit of the flights. Each has its count and interval.
//!
//! The page contains nothing that depends on the machine, so the same study gives the same page everywhere.

use crate::lines::{self, Who};
use crate::vocabulary::Vocabulary;
use crate::words::{
    NONE, begun, by_environment, count_of, distinct, healthy_flights, percent, spoken, three_digits,
};
use servotwin::flight::unseen_faults::UnseenFaultMetrics;
use servotwin::job::Results;
use servotwin::job::flights::{FlightResults, SealedResults};
use servotwin::job::outcomes::FlownSuite;
use servotwin::job::sealed::Openings;
use servotwin::learn::Evaluation;
use servotwin::learn::metrics::Rate;
use servotwin::learn::protocol::Protocol;
use servotwin::measure;
use servotwin::measure::flights::{ClassMetrics, FlightMetrics, HealthyMetrics, STRONG};
use servotwin::measure::unseen::{SHUTDOWN_HEALTHY, SHUTDOWN_MISINFORMED};
use servotwin::study::Study;
use servotwin::study::suites::OTHER_STRUCTURE;
use servotwin_view::document::{Document, Table, Value};
use servotwin_view::row;

/// What was measured of a study.
pub struct Measured<'r> {
    /// The study.
    pub study: &'r Study,
    /// The results of the records.
    pub results: &'r Results,
    /// The results of the flights, if the study has any.
    pub flights: Option<&'r FlightResults>,
    /// Healthy flights, each in an environment of its own.
    pub healthy: &'r [FlownSuite],
    /// The results in sealed environments, with the openings on record now, where the record is at hand.
    pub sealed: Option<(&'r SealedResults, Option<Openings>)>,
}

/// One measure.
struct MeasuredRate {
    /// What the rate counts.
    measure: String,
    /// The part of the diagnosis that answers: bands, trees or committee.
    by: &'static str,
    /// How rows were held out; for flights, which faults the rate covers.
    protocol: String,
    /// The share with its count and 95 % interval.
    rate: Rate,
}

impl MeasuredRate {
    /// A measure; `None` if nothing was counted.
    fn of(measure: String, by: &'static str, protocol: &str, rate: Option<Rate>) -> Option<Self> {
        let rate = rate.filter(|rate| rate.of > 0)?;
        Some(MeasuredRate { measure, by, protocol: protocol.into(), rate })
    }
}

impl Measured<'_> {
    /// The page.
    pub fn document(&self) -> Document {
        let Measured { study, results, flights, healthy, sealed } = self;
        let words = Vocabulary::of(study);
        let mut page = Document::section("measured", "Measured results");
        let (name, version) = (&study.name, env!("CARGO_PKG_VERSION"));
        page.text(
            "These numbers come from simulated faults of simulated actuators, not from hardware.",
        );
        page.text(format!(
            "`servotwin report --markdown` wrote this page from the results of the study `{name}`; do not edit it."
        ));
        page.text(format!(
            "Version {version} gives the same numbers on every machine with these commands:"
        ));
        let commands = self.commands();
        page.text(format!("\n```sh long\n{}\n```\n", commands.join("\n")));
        TERMS.lines().for_each(|line| _ = page.text(line));
        page.fact("study", "", name);
        page.fact("commands", "", Value::list(commands));
        for result in &results.subjects {
            let title = format!("Variants, scenario {}", result.title);
            let mut section = Document::section(format!("variants:{}", result.title), title);
            rate_tables(&of_variants(&result.evaluation, &words), &mut section);
            page.add(section);
        }
        flights.iter().for_each(|own| all_scenarios(own, &words, "", &mut page));
        healthy.iter().for_each(|run| page.add(self::healthy(run)));
        if let Some((sealed, known)) = sealed {
            let mut section = Document::section("sealed", "Sealed environments");
            section.text(sealed.in_words(*known));
            SEALED.lines().for_each(|line| _ = section.text(line));
            page.add(section);
            all_scenarios(&sealed.results, &words, ", sealed environments", &mut page);
        }
        page
    }

    /// The commands that reproduce the results.
    fn commands(&self) -> Vec<String> {
        let Measured { study, results, flights, healthy, .. } = self;
        if study.is_on_ground() {
            let test = format!("servotwin test {} --out out", study.name);
            return vec![test, "servotwin report out/ground_test --markdown".into()];
        }
        let full = if study.is_full && study.has_quick_size() { " --full" } else { "" };
        let study = &study.name;
        let has_fitted =
            results.subjects.iter().any(|result| result.subject == servotwin::job::Subject::Fitted);
        let fitted = if has_fitted { " --fitted" } else { "" };
        let mut commands = vec![];
        if !results.subjects.is_empty() {
            commands.push(format!("servotwin study {study}{full}{fitted} --out out"));
        }
        if flights.is_some() && (results.subjects.is_empty() || full.is_empty()) {
            commands.push(format!("servotwin study {study} --suite flights --out out"));
        }
        for FlownSuite { suite, scenario, seed, outcomes, .. } in *healthy {
            let environments = outcomes.len();
            commands.push(format!(
                "servotwin study {study} --suite {suite} --scenario {scenario} --environments {environments} --seed \
                 {seed} --out out"
            ));
        }
        commands.push("servotwin report out --markdown".into());
        commands
    }
}

/// Explains what sealed environments are.
const SEALED: &str = "\
Nobody tuned anything on these environments: their seed was drawn after the diagnosers were finished.\n\
Every opening is on record, also those without a result.";

fn healthy(run: &FlownSuite) -> Document {
    let (scenario, (flown, lines)) = (run.title(), healthy_flights(run));
    let title = format!("Healthy flights, scenario {scenario}");
    let mut section = Document::section(format!("healthy:{scenario}"), title);
    section.text(format!("{}.", begun(&flown)));
    section.list("lines", lines.into_iter().map(|line| format!("{}.", begun(&line))));
    section.data("summary", &run.healthy());
    section
}

/// The measures of every scenario of the flights.
fn all_scenarios(flights: &FlightResults, words: &Vocabulary, where_: &str, page: &mut Document) {
    let judged = flights.judged().map(|own| (own, flights.unseen_in(&own.group.scenario)));
    let others = flights.of_suite(OTHER_STRUCTURE).map(|own| (own, None));
    for (metrics, unseen) in judged.chain(others) {
        page.add(scenario(metrics, unseen, words, where_));
    }
}

/// Trees, committee and training rows together, where a fault may stay not isolated.
const BOTH: &str = "trees and committee";

/// The protocol's name for measures that hold nothing out.
const ALL: &str = "all variants";

/// Explains how to read the tables.
const TERMS: &str = "\
An interval covers 95 %.\n\
Cases of one fault are not independent, so the intervals of faults come from a bootstrap over clusters (kind of fault × \
intensity).\n\
Shares without such clusters, as of healthy specimens, have Wilson's interval.\n\
The trees always answer, and the committee may stay silent.";

/// The measures of a scenario: first detection, then trees and committee under each protocol.
fn of_variants(evaluation: &Evaluation, words: &Vocabulary) -> Vec<MeasuredRate> {
    let mut rates = vec![];
    let mut push = |measure: &str, by, protocol: &str, rate: Option<Rate>| {
        rates.extend(MeasuredRate::of(measure.to_owned(), by, protocol, rate));
    };
    for measure in [&measure::VISIBLE, &measure::VISIBLE_BY_CHANCE] {
        push(&words.measure(measure), "bands", ALL, evaluation.in_band.counted(measure));
    }
    for who in Who::ALL {
        let rate = who.of_healthy(evaluation).counted(&measure::FALSE_SHUTDOWN);
        push(&words.measure(&measure::FALSE_SHUTDOWN), who.title(), ALL, rate);
    }
    for protocol in protocols(evaluation) {
        for measure in lines::RIGHT.into_iter().chain(lines::SAFETY) {
            for who in Who::ALL {
                let result = who.under(evaluation, protocol);
                let rate = result.and_then(|result| result.rates.counted(measure));
                push(&words.measure(measure), who.title(), protocol.title(), rate);
            }
        }
    }
    for isolation in &evaluation.isolation {
        for measure in measure::OF_ISOLATED.into_iter().chain(lines::SAFETY) {
            let rate = isolation.rates.counted(measure);
            push(&words.measure(measure), BOTH, &isolation.title, rate);
        }
    }
    rates
}

/// The hardest protocol that the study allows, and the one that also holds the fault out.
fn protocols(evaluation: &Evaluation) -> Vec<Protocol> {
    let headline = evaluation.headline().map(|result| result.protocol);
    let held_out = evaluation.protocol(Protocol::UnseenIntensity).map(|result| result.protocol);
    let held_out = held_out.filter(|protocol| Some(*protocol) != headline);
    headline.into_iter().chain(held_out).collect()
}

/// What the flights of a scenario show.
fn scenario(
    metrics: &FlightMetrics,
    unseen: Option<&UnseenFaultMetrics>,
    words: &Vocabulary,
    where_: &str,
) -> Document {
    let HealthyMetrics { hours, alarms, shutdowns, alarms_per_h_upper, environments, .. } =
        metrics.healthy;
    let scenario = metrics.title() + where_;
    let title = format!("Flights, scenario {scenario}");
    let mut section = Document::section(format!("flights:{scenario}"), title);
    section.text(format!("A fault begins in {} flights.", metrics.flights));
    if hours > 0.0 {
        section.text(format!(
            "In {hours:.1} hours without a fault the diagnosis raised {alarms} false alarms, {shutdowns} of them \
             shutdowns."
        ));
        section.text(format!(
            "The rate of false alarms is at most {} in 1,000 hours, with a confidence of 95 %.",
            three_digits(1000.0 * alarms_per_h_upper)
        ));
    }
    let by_environment = by_environment(environments);
    section.text(format!("Alarms cluster by environment: there were any {by_environment}."));
    rate_tables(&of_flights(metrics, unseen, words), &mut section);
    if !metrics.strong_classes.is_empty() {
        let by_action = "by the action that they call for.";
        section.text(format!("Faults of intensity {STRONG} and more, {by_action}"));
        section.text("The latency runs from the onset to the right action, for the faults that were isolated.");
        section.table("actions", action_table(&metrics.strong_classes));
    }
    section.data("healthy", &metrics.healthy);
    section
}

/// The rates counted in flights.
fn of_flights(
    metrics: &FlightMetrics,
    unseen: Option<&UnseenFaultMetrics>,
    words: &Vocabulary,
) -> Vec<MeasuredRate> {
    let mut rates = vec![];
    let mut push = |measure: String, faults: &str, rate: Option<Rate>| {
        rates.extend(MeasuredRate::of(measure, "diagnosis", faults, rate));
    };
    for measure in measure::OF_FLIGHTS {
        let [sentence, faults] = words.describe_measure(measure, &[metrics.limit_s]);
        push(sentence, &faults, Some(metrics.rates.of(measure)));
    }
    let (actuator, off) = (words.actuator(), words.switched_off());
    let Some(unseen) = unseen.filter(|_| words.has_off()) else { return rates };
    let healthy = unseen.rates.counted(&SHUTDOWN_HEALTHY);
    push(format!("healthy {actuator} {off}"), "faults unknown to training", healthy);
    for fault in &unseen.faults {
        let measure = format!("healthy {actuator} {off}: {}", fault.title);
        let rate = fault.rates.counted(&SHUTDOWN_MISINFORMED);
        push(measure, SHUTDOWN_MISINFORMED.of.words, rate);
    }
    rates
}

/// Adds a table for each protocol: one row for each measure, one column for each part of the diagnosis.
fn rate_tables(rates: &[MeasuredRate], section: &mut Document) {
    for group in rates.chunk_by(|rate, next| rate.protocol == next.protocol) {
        let parts = distinct(group.iter().map(|rate| rate.by));
        let columns = std::iter::once("measure").chain(parts.iter().copied());
        let mut table = Table::new(columns.map(|name| (name.to_owned(), name.to_owned())));
        for measure in distinct(group.iter().map(|rate| rate.measure.as_str())) {
            let of =
                |by: &&str| group.iter().find(|rate| rate.measure == measure && rate.by == *by);
            let cells = parts.iter().map(|by| of(by).map(|found| full_rate(&found.rate)).into());
            table.push(std::iter::once(Value::from(measure)).chain(cells));
        }
        let protocol = &group[0].protocol;
        // Trees and committee have tables of their own, and may share a protocol.
        let id = format!("{protocol}, {}", parts.join(", "));
        section.table(id, table.captioned(begun(protocol)));
    }
}

/// A rate with its interval and count: `97.38 % (96.50 … 98.12), 4049 of 4158`.
fn full_rate(rate: &Rate) -> Value {
    let [low, high] = [rate.low, rate.high].map(|part| 100.0 * part);
    let (share, count) = (percent(rate.share), count_of(*rate));
    Value::of(format!("{share} ({low:.2} … {high:.2}), {count}"), rate)
}

fn action_table(classes: &[ClassMetrics]) -> Table {
    let shares = [
        &measure::RIGHT_ACTION,
        &measure::OTHER_ACTION,
        &measure::WRONG_ACTUATOR,
        &measure::SILENT,
    ];
    let mut table = Table::of(
        "action | visible | :never visible | isolated | another_action | wrong_actuator | silent | median_latency | p95_latency:95 % | longest_latency:longest",
    );
    let counts = |rate: Rate| Value::of(count_of(rate), &rate);
    for class in classes {
        let visible = class.rates.of(&measure::VISIBLE);
        let never = format!("{} of {}", visible.of - visible.count, visible.of);
        let action = Value::of(begun(&spoken(&class.action)), &class.action);
        let mut row = row![action, counts(visible), never];
        row.extend(shares.map(|measure| counts(class.rates.of(measure))));
        let times = class.isolation.as_ref();
        let times = times.map(|own| [own.median_s, own.p95_s, own.longest_s]);
        row.extend([0, 1, 2].map(|place| {
            let time = times.map(|times| times[place]);
            Value {
                suffix: "_s",
                ..Value::of(time.map_or(NONE.into(), |t| format!("{t:.2} s")), &time)
            }
        }));
        table.push(row);
    }
    table
}
