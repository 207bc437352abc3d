//! The measured results of a study on one page: safety, detection and isolation of the campaign's variants, and the
//! figures of merit of the flights. Each has its count and interval.
//!
//! The page contains nothing that depends on the machine, so the same study gives the same page everywhere.

use crate::lines::{self, Measure, Who};
use crate::vocabulary::Vocabulary;
use crate::words::{
    NONE, begun, by_environment, by_environment_and_tail, chosen, number, percent, spoken,
};
use serde::Serialize;
use servotwin::evaluation::Evaluation;
use servotwin::evaluation::metrics::Rate;
use servotwin::evaluation::protocol::Protocol;
use servotwin::flight::judge::{ClassMetrics, FlightMetrics, HealthyMetrics, STRONG};
use servotwin::flight::measure;
use servotwin::flight::unseen_faults::UnseenFaultMetrics;
use servotwin::job::Results;
use servotwin::job::flights::{FlightResults, SealedResults};
use servotwin::job::outcomes::FlownSuite;
use servotwin::job::sealed::Openings;
use servotwin::study::Study;
use servotwin::study::suites::OTHER_STRUCTURE;

/// The measured results of a study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The study's name.
    pub study: String,
    /// The version of servotwin that wrote the page.
    pub version: &'static str,
    /// The commands that reproduce the results.
    pub commands: Vec<String>,
    /// The scenarios of the campaign.
    pub variants: Vec<MeasuredScenario>,
    /// The scenarios of the flights; none for a study without flights.
    pub flights: Vec<MeasuredFlights>,
    /// The same in sealed environments; `None` if none were opened.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sealed: Option<MeasuredSealed>,
    /// Healthy flights, each in an environment of its own; empty if none were flown.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub healthy: Vec<MeasuredHealthy>,
}

/// The measures of healthy flights, each in an environment of its own.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredHealthy {
    /// The scenario.
    pub scenario: String,
    /// The number of flights.
    pub flown: u64,
    /// Duration of a flight, s.
    pub duration_s: f64,
    /// The seed of the environments.
    pub seed: u64,
    /// The counts, and the extrapolated rates.
    pub summary: HealthyMetrics,
}

/// The measures in sealed environments.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredSealed {
    /// Which opening of how many, in a sentence.
    pub opening: String,
    /// The scenarios.
    pub flights: Vec<MeasuredFlights>,
}

/// The measures of one scenario of the campaign.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredScenario {
    /// The scenario with its sensors.
    pub scenario: String,
    /// The measures; detection comes first.
    pub rates: Vec<MeasuredRate>,
}

/// One measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredRate {
    /// What the rate counts.
    pub measure: String,
    /// The part of the diagnosis that answers: bands, trees or committee.
    pub by: &'static str,
    /// How rows were held out; for flights, which faults the rate covers.
    pub protocol: String,
    /// The share with its count and 95 % interval.
    #[serde(flatten)]
    pub rate: Rate,
}

/// The measures of one scenario of the flights.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredFlights {
    /// The scenario.
    pub scenario: String,
    /// The number of flights with a fault.
    pub flights: u64,
    /// Shares with their count and 95 % interval.
    pub rates: Vec<MeasuredRate>,
    /// Strong faults, by the action that they call for.
    pub actions: Vec<ClassMetrics>,
    /// Healthy flights, and the time before a fault begins.
    pub healthy: HealthyMetrics,
}

/// A share of independent cases, or `None` for no cases.
fn counted(count: u64, of: u64) -> Option<Rate> {
    (of > 0).then(|| Rate::new(count, of))
}

impl Measured {
    /// Collects the results of a study.
    pub fn new(study: &Study, results: &Results, flights: Option<&FlightResults>) -> Self {
        let words = Vocabulary::of(study);
        let variants = results.subjects.iter().map(|result| MeasuredScenario {
            scenario: result.title.clone(),
            rates: of_variants(&result.evaluation, &words),
        });
        Measured {
            study: study.name.clone(),
            version: env!("CARGO_PKG_VERSION"),
            commands: commands(study, results, flights),
            variants: variants.collect(),
            flights: flights.map_or_else(Vec::new, |flights| all_scenarios(flights, &words)),
            sealed: None,
            healthy: vec![],
        }
    }

    /// Adds healthy flights, each in an environment of its own.
    pub fn add_healthy(&mut self, run: &FlownSuite) {
        self.healthy.push(MeasuredHealthy {
            scenario: run.title(),
            flown: run.outcomes.len() as u64,
            duration_s: run.longest_s(),
            seed: run.seed,
            summary: run.healthy(),
        });
    }

    /// Adds the results in sealed environments. `known` are the openings on record now, where the record is at hand.
    pub fn add_sealed(&mut self, study: &Study, sealed: &SealedResults, known: Option<Openings>) {
        let mut flights = all_scenarios(&sealed.results, &Vocabulary::of(study));
        flights.iter_mut().for_each(|flights| flights.scenario += ", sealed environments");
        self.sealed = Some(MeasuredSealed { opening: sealed.in_words(known), flights });
    }

    /// Returns the page as Markdown.
    pub fn markdown(&self) -> String {
        let mut page = format!(
            "# Measured results\n\n\
             These numbers come from simulated faults of simulated actuators, not from hardware.\n\
             `servotwin report --markdown` wrote this page from the results of the study `{}`; do not edit it.\n\
             Version {} gives the same numbers on every machine with these commands:\n\n\
             ```sh long\n{}\n```\n\n{TERMS}",
            self.study,
            self.version,
            self.commands.join("\n"),
        );
        for scenario in &self.variants {
            page += &format!("\n## Variants, scenario {}\n", scenario.scenario);
            page += &rate_tables(&scenario.rates);
        }
        for flights in &self.flights {
            page += &flights.markdown();
        }
        self.healthy.iter().for_each(|healthy| page += &healthy.markdown());
        if let Some(sealed) = &self.sealed {
            page += &format!("\n## Sealed environments\n\n{}\n{SEALED}", sealed.opening);
            sealed.flights.iter().for_each(|flights| page += &flights.markdown());
        }
        page
    }
}

impl MeasuredHealthy {
    fn markdown(&self) -> String {
        let MeasuredHealthy { scenario, flown, duration_s, seed, summary } = self;
        let lines = by_environment_and_tail(summary).into_iter();
        let lines: String = lines.map(|line| format!("- {}.\n", begun(&line))).collect();
        format!(
            "\n## Healthy flights, scenario {scenario}\n\n{flown} healthy flights of {} s, each in an environment of \
             its own (seed {seed}); {:.1} hours.\n\n{lines}",
            chosen(*duration_s),
            summary.hours
        )
    }
}

/// Explains what sealed environments are.
const SEALED: &str = "\
Nobody tuned anything on these environments: their seed was drawn after the diagnosers were finished.\n\
Every opening is on record, also those without a result.\n";

/// The measures of every scenario of the flights.
fn all_scenarios(flights: &FlightResults, words: &Vocabulary) -> Vec<MeasuredFlights> {
    let judged = flights.judged().map(|own| (own, flights.unseen_in(&own.group.scenario)));
    let others = flights.of_suite(OTHER_STRUCTURE).map(|own| (own, None));
    judged.chain(others).map(|(own, unseen)| MeasuredFlights::new(own, unseen, words)).collect()
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
The trees always answer, and the committee may stay silent.\n";

/// The commands that reproduce the results.
fn commands(study: &Study, results: &Results, flights: Option<&FlightResults>) -> Vec<String> {
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
    let are_full = flights.is_some_and(|flights| flights.is_full);
    if are_full {
        commands.push(format!("servotwin study {study} --suite flights --full --out out"));
    }
    if !results.subjects.is_empty() {
        commands.push(format!("servotwin study {study}{full}{fitted} --out out"));
    } else if !are_full {
        commands.push(format!("servotwin study {study} --suite flights --out out"));
    }
    commands.push("servotwin report out --markdown".into());
    commands
}

/// The measures of a scenario: first detection, then trees and committee under each protocol.
fn of_variants(evaluation: &Evaluation, words: &Vocabulary) -> Vec<MeasuredRate> {
    let mut rates = vec![];
    let mut push = |measure: &str, by, protocol: &str, rate: Option<Rate>| {
        if let Some(rate) = rate.filter(|rate| rate.of > 0) {
            let (measure, protocol) = (measure.to_owned(), protocol.to_owned());
            rates.push(MeasuredRate { measure, by, protocol, rate });
        }
    };
    push("fault detected", "bands", ALL, Some(evaluation.detection.detected));
    let healthy = evaluation.false_alarms.as_ref();
    push("healthy specimen alarms", "bands", ALL, healthy.map(|healthy| healthy.alarms));
    if words.has_off() {
        let measure = format!("healthy specimen {}", words.switched_off());
        push(&measure, Who::Trees.title(), ALL, healthy.map(|healthy| healthy.tree_shutdowns));
        let committee = healthy.map(|healthy| healthy.committee_shutdowns);
        push(&measure, Who::Committee.title(), ALL, committee);
    }
    let measures: Vec<Measure> =
        lines::right(words).into_iter().chain(lines::safety(words)).collect();
    for protocol in protocols(evaluation) {
        for measure in &measures {
            for who in Who::ALL {
                let result = who.under(evaluation, protocol);
                push(&measure.title, who.title(), protocol.title(), result.and_then(measure.rate));
            }
        }
    }
    for isolation in &evaluation.isolation {
        let mut push = |measure: &str, rate| push(measure, BOTH, &isolation.title, Some(rate));
        push("fault isolated", isolation.decided);
        push(&format!("{} right, of isolated", words.action()), isolation.right_action);
        push(&format!("{} right or not isolated", words.action()), isolation.right_or_not_isolated);
        if words.has_off() && words.has_several() {
            let measure = format!("wrong {} {}", words.unit(), words.switched_off());
            push(&measure, isolation.safety.wrong_actuator_shutdown);
        }
        if words.has_off() {
            push(
                &format!("{} missed (of detected)", words.off()),
                isolation.safety.missed_shutdown,
            );
            push(&format!("needless {}", words.off()), isolation.safety.needless_shutdown);
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

impl MeasuredFlights {
    fn new(
        metrics: &FlightMetrics,
        unseen: Option<&UnseenFaultMetrics>,
        words: &Vocabulary,
    ) -> Self {
        let actions = metrics.strong_classes.clone();
        MeasuredFlights {
            scenario: metrics.title(),
            flights: metrics.flights,
            rates: of_flights(metrics, unseen, words),
            actions,
            healthy: metrics.healthy.clone(),
        }
    }

    fn markdown(&self) -> String {
        let HealthyMetrics { hours, alarms, shutdowns, alarms_per_h_upper, environments, .. } =
            self.healthy;
        let mut page = format!(
            "\n## Flights, scenario {}\n\nA fault begins in {} flights.\n",
            self.scenario, self.flights
        );
        if hours > 0.0 {
            page += &format!(
                "In {hours:.1} hours without a fault the diagnosis raised {alarms} false alarms, {shutdowns} of them shutdowns.\n\
                 The rate of false alarms is at most {} in 1,000 hours, with a confidence of 95 %.\n",
                number(1000.0 * alarms_per_h_upper)
            );
        }
        page += &format!(
            "Alarms cluster by environment: there were any {}.\n",
            by_environment(environments)
        );
        page += &rate_tables(&self.rates);
        if !self.actions.is_empty() {
            page += &action_table(&self.actions);
        }
        page
    }
}

/// The rates counted in flights.
fn of_flights(
    metrics: &FlightMetrics,
    unseen: Option<&UnseenFaultMetrics>,
    words: &Vocabulary,
) -> Vec<MeasuredRate> {
    let mut rates = vec![];
    let mut push = |measure: String, faults: &str, rate: Option<Rate>| {
        if let Some(rate) = rate.filter(|rate| rate.of > 0) {
            rates.push(MeasuredRate {
                measure,
                by: "diagnosis",
                protocol: faults.to_owned(),
                rate,
            });
        }
    };
    for measure in measure::ALL {
        let [sentence, faults] = words.describe_measure(measure, &[metrics.limit_s]);
        push(sentence, &faults, Some(metrics.rates.of(measure)));
    }
    let (unit, off) = (words.unit(), words.switched_off());
    if metrics.group.suite == OTHER_STRUCTURE {
        let [flown, alarmed] = metrics.healthy.flights;
        let alarmed = counted(alarmed, flown);
        push(format!("{} with an alarm", words.run()), "healthy flights", alarmed);
    }
    let Some(unseen) = unseen.filter(|_| words.has_off()) else { return rates };
    let (count, of) = unseen.shutdowns_healthy();
    push(format!("healthy {unit} {off}"), "faults unknown to training", counted(count, of));
    for outcome in &unseen.outcomes {
        let count = outcome.shutdowns_behind_wrong_sensor;
        let measure = format!("healthy {unit} {off}: {}", outcome.title);
        push(
            measure,
            "boundary sensors that mislead the twin",
            count.and_then(|count| counted(count, outcome.flights)),
        );
    }
    rates
}

fn table(heads: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let heads: Vec<String> = heads.iter().map(|&head| head.to_owned()).collect();
    let rows: String = rows.map(|row| line(&row)).collect();
    format!("{}|{}\n{rows}", line(&heads), "---|".repeat(heads.len()))
}

/// Makes a table for each `protocol`: one row for each measure, one column for each part of the diagnosis.
fn rate_tables(rates: &[MeasuredRate]) -> String {
    let groups = rates.chunk_by(|rate, next| rate.protocol == next.protocol);
    groups
        .map(|group| format!("\n**{}**\n\n{}", begun(&group[0].protocol), rate_table(group)))
        .collect()
}

fn rate_table(rates: &[MeasuredRate]) -> String {
    let columns = distinct(rates.iter().map(|rate| rate.by));
    let row = |measure: &str| {
        let cell = |by: &&str| {
            let found = rates.iter().find(|rate| rate.measure == measure && rate.by == *by);
            found.map_or_else(|| NONE.into(), |found| rate_cell(&found.rate))
        };
        let cells = columns.iter().map(cell);
        std::iter::once(measure.to_owned()).chain(cells).collect()
    };
    let heads: Vec<&str> = std::iter::once("measure").chain(columns.iter().copied()).collect();
    table(&heads, distinct(rates.iter().map(|rate| rate.measure.as_str())).into_iter().map(row))
}

/// Returns each value once, in the order of first appearance.
fn distinct<'t>(values: impl Iterator<Item = &'t str>) -> Vec<&'t str> {
    values.fold(vec![], |mut known, value| {
        if !known.contains(&value) {
            known.push(value);
        }
        known
    })
}

/// A rate with its interval and count: `97.38 % (96.50 … 98.12), 4049 of 4158`.
fn rate_cell(rate: &Rate) -> String {
    let [low, high] = [rate.low, rate.high].map(|part| 100.0 * part);
    format!("{} ({low:.2} … {high:.2}), {} of {}", percent(rate.share), rate.count, rate.of)
}

fn action_table(actions: &[ClassMetrics]) -> String {
    let row = |class: &ClassMetrics| {
        let of = |rate: &Rate| format!("{} of {}", rate.count, rate.of);
        let visible = class.rates.of(&measure::VISIBLE);
        let never = format!("{} of {}", visible.of - visible.count, visible.of);
        let shares = [
            &measure::RIGHT_ACTION,
            &measure::OTHER_ACTION,
            &measure::WRONG_ACTUATOR,
            &measure::SILENT,
        ];
        let times = class
            .isolation
            .as_ref()
            .map(|latency| [latency.median_s, latency.p95_s, latency.longest_s]);
        let time =
            |place: usize| times.map_or(NONE.into(), |times| format!("{:.2} s", times[place]));
        let shares = shares.into_iter().map(|measure| of(&class.rates.of(measure)));
        let mut cells = vec![begun(&spoken(&class.command)), of(&visible), never];
        cells.extend(shares.chain([0, 1, 2].map(time)));
        cells
    };
    let heads = [
        "action",
        "visible",
        "never visible",
        "isolated",
        "another action",
        "wrong actuator",
        "silent",
        "median latency",
        "95 %",
        "longest",
    ];
    format!(
        "\nFaults of intensity {STRONG} and more, by the action that they call for.\n\
         The latency runs from the onset to the right action, for the faults that were isolated.\n\n{}",
        table(&heads, actions.iter().map(row))
    )
}
