//! The diagnosis in operation: its latency, certainty and error rates beside a running system, compared
//! with the limits.

use crate::Material;
use crate::vocabulary::Vocabulary;
use crate::words::{
    NONE, begun, by_environment, chosen, count_of, fitted_twins, healthy_flights, spoken, stacked,
    three_digits,
};
use servotwin::job::flights::FlightResults;
use servotwin::job::outcomes::FlownSuite;
use servotwin::learn::metrics::{Rate, poisson_mean};
use servotwin::measure::flights::{FlightMetrics, Latency, STRONG};
use servotwin::measure::unseen::{SHUTDOWN_HEALTHY, SHUTDOWN_MISINFORMED};
use servotwin::measure::{self, Measure};
use servotwin::study::flights::Limits;
use servotwin::study::suites::{
    HARD_NEGATIVES, JUDGE, LEARN, OTHER_STRUCTURE, OTHER_STRUCTURE_FITTED,
};
use servotwin::study::{Scenario, Study, Suite};
use servotwin_view::document::{Document, Table};

/// The share of faults that a latency limit applies to.
const SHARE: f64 = 0.95;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let Some(results) = material.flights else {
        return;
    };
    let words = &material.words();
    page.text(about(material.study, results, words));
    page.table("", limits_grid(material.study, results, words).captioned(format!(
            "What is asked of the diagnosis at work, and what was measured. {} “Met” is said only where \
             the interval is on the right side of the limit; that something never happens cannot be \
             shown by counting, only how often at most.",
            match own_limits(material.study).as_slice() {
                [] => "The study file sets no limits of its own ([flights.limits]): these are \
                       servotwin's.",
                _ => "Limits that the study file does not set are servotwin's, marked as default.",
            }
        )));
    page.note(sizes(material.study, results, words));
    page.table("", all_measures(results, words).captioned(format!(
            "Every measure of these flights, after the faults in which it is counted, with 95 % intervals from drawing \
             kinds of fault at their intensities. The limit is {}.",
            latency_limits(results)
        )));
    if let Some(sealed) = material.sealed {
        page.heading("In sealed environments");
        page.text(format!(
                "The same diagnosers were judged again in environments of a seed that was drawn after they were \
                 finished. {}",
                sealed.in_words(None)
            ));
        page.table(
            "",
            limits_grid(material.study, &sealed.results, words).captioned(
                "The same limits in \
                 sealed environments. Every opening is on record, also those without a result.",
            ),
        );
    }
    in_own_environments(material.healthy, page);
    page.heading("How soon a fault is isolated");
    page.text(format!(
            "A fault is visible once windows leave the bands for longer than one is, so that no single sample \
             makes it so by chance; it is isolated when the right action{} is raised.",
            match words.has_several() {
                true => format!(" for the right {}", words.actuator()),
                false => String::new(),
            }
        ));
    for metrics in results.judged().chain(results.of_other_plants()) {
        page.table("", by_action(metrics, words).captioned(format!(
                "Scenario {}: what became of the {}s, by the action that it needs. Shares are \
                 of the visible faults, with 95 % intervals from drawing kinds of fault at their \
                 intensities; times are the median, and below it 95 % and the longest of those that \
                 were isolated.",
                metrics.title(),
                words.run()
            )));
    }
    if !words.has_off() {
        return;
    }
    page.heading("By the way in which a fault begins");
    page.table("", by_onset(results, words).captioned(format!(
            "Faults that call for a {} of intensity {STRONG} and more. A drift reaches its intensity in 4 s; an \
             intermittent fault is there for 1 s and away for 1 s.",
            words.off()
        )));
    wrong_kinds(results, words, page);
}

/// Healthy flights, each in an environment of its own.
fn in_own_environments(runs: &[FlownSuite], page: &mut Document) {
    if runs.is_empty() {
        return;
    }
    page.heading("False alarms by environment");
    page.text(
        "What raises one false alarm in an environment raises others there, so hours in one environment do not \
         count like hours in many. Here every healthy flight has an environment and a specimen of its own. Beside \
         the count stands an extrapolation: the largest evidence of each flight is a part of the limit at which an \
         action may be raised, and the tail of these values says how often it would reach that limit.",
    );
    for (flown, lines) in runs.iter().map(healthy_flights) {
        page.note(format!("{}. {}.", begun(&flown), begun(&lines.join("; "))));
    }
}

fn about(study: &Study, results: &FlightResults, words: &Vocabulary) -> String {
    let windows = study.flights.iter().flat_map(|flights| &flights.windows_s);
    let windows: Vec<String> = windows.map(|&w| format!("{} s", chosen(w))).collect();
    let run = words.run();
    format!(
        "Here the twin runs along, and the diagnosis sample by sample, with windows of {} that slide. \
         A fault begins during the {run}. An action is raised only when the evidence for it beats every \
         other explanation in a sequential test{}. Trees, committee and bands were learned in other \
         {run}s, of other commands, specimens and surroundings. The scenarios differ in the specimen: with \
         noise only, the specimen is exactly its twin (as if the twin had been fitted to it); in the \
         realistic scenario it has its tolerances and the twin knows nothing of them. There windows are looked at \
         a second time, without the means that its own residuals had in the first seconds.{}",
        windows.join(" and "),
        words.kept_on(study.least_on()),
        match results.of_suite(OTHER_STRUCTURE).next() {
            Some(_) => format!(
                " In the suite {OTHER_STRUCTURE} the specimens also differ from the twin in structure, as \
                 [flights.other_plant] of the study says. Nothing is learned there: the diagnosis is the one of \
                 the realistic scenario.{}",
                fitted_plants(results)
            ),
            None => String::new(),
        }
    )
}

/// The names of the limits that a study file sets.
fn own_limits(study: &Study) -> Vec<String> {
    section(study, "limits").map_or_else(Vec::new, |limits| limits.keys().cloned().collect())
}

/// Returns a section below `[flights]` as written in the study file.
fn section(study: &Study, name: &str) -> Option<toml::Table> {
    let text: toml::Table = study.text.parse().ok()?;
    text.get("flights")?.get(name)?.as_table().cloned()
}

/// A limit with the measured value.
pub(super) struct Limit {
    title: String,
    scenario: String,
    /// The limit; empty for a row that only explains another.
    limit: String,
    /// The measured value in one line, with details in small type below.
    measured: String,
    verdict: &'static str,
}

impl Limit {
    /// Whether the measured value violates the limit.
    pub(super) fn is_missed(&self) -> bool {
        [MISSED, PROBABLY_MISSED].contains(&self.verdict)
    }

    /// Returns the limit and the measured value in one sentence.
    pub(super) fn in_words(&self) -> String {
        let measured = self.measured.replacen('\n', " [", 1).replace('\n', ", ");
        let end = if self.measured.contains('\n') { "]" } else { "" };
        let limit = self.limit.replace('\n', ", ");
        format!(
            "{}: {measured}{end}, asked for is {limit} ({}, {})",
            self.title, self.scenario, self.verdict
        )
    }
}

/// Lists the limits scenario by scenario. A limit on something that was not counted is left out.
pub(super) fn limits(study: &Study, results: &FlightResults, words: &Vocabulary) -> Vec<Limit> {
    let own = own_limits(study);
    let Some(asked) = study.flights.as_ref().map(|flights| flights.limits) else { return vec![] };
    let of_scenario = |metrics| {
        let mut limits = SettingLimits { own: &own, asked, results, words, metrics, list: vec![] };
        if words.has_off() {
            limits.latency();
        }
        limits.false_alarms();
        limits.alarmed_flights();
        if words.has_off() {
            limits.healthy_shutdowns();
            limits.wrong_shutdowns();
        }
        limits.list
    };
    results.judged().chain(results.of_other_plants()).flat_map(of_scenario).collect()
}

/// The limits of one scenario, one after the other.
struct SettingLimits<'m> {
    /// The keys that the study sets itself.
    own: &'m [String],
    asked: Limits,
    results: &'m FlightResults,
    words: &'m Vocabulary,
    metrics: &'m FlightMetrics,
    list: Vec<Limit>,
}

impl SettingLimits<'_> {
    fn push(&mut self, title: String, limit: String, measured: String, verdict: &'static str) {
        self.list.push(Limit { title, scenario: self.metrics.title(), limit, measured, verdict });
    }

    /// A row that explains the one above it.
    fn explain(&mut self, title: String, measured: Rate) {
        self.push(title, String::new(), stacked(Some(measured)), "");
    }

    /// A limit, marked where it is servotwin's.
    fn marked(&self, text: String, key: &str) -> String {
        match self.own.iter().any(|known| known == key) {
            true => text,
            false => format!("{text}\ndefault"),
        }
    }

    fn latency(&mut self) {
        let FlightMetrics { group, limit_s, .. } = self.metrics;
        let in_time = self.metrics.rates.of(&measure::ISOLATED_IN_TIME);
        if in_time.of == 0 {
            return;
        }
        let off = self.words.off();
        let key = match Scenario::named(&group.scenario).is_some_and(Scenario::has_tolerances) {
            true => "latency_unfitted_s",
            false => "latency_s",
        };
        let limit = format!("{} % within {} s", chosen(100.0 * SHARE), chosen(*limit_s));
        let verdict = match in_time {
            rate if rate.low >= SHARE => MET,
            rate if rate.high < SHARE => MISSED,
            rate if rate.share.is_some_and(|share| share < SHARE) => PROBABLY_MISSED,
            _ => NOT_SHOWN,
        };
        self.push(
            format!("visible {off} faults of intensity {STRONG} and more, isolated in time"),
            self.marked(limit, key),
            stacked(Some(in_time)),
            verdict,
        );
        for measure in
            [&measure::VISIBLE_IN_TIME, &measure::ISOLATED_SINCE_VISIBLE, &measure::NEVER_ISOLATED]
        {
            let [sentence, _] = self.words.describe_measure(measure, &[*limit_s]);
            self.explain(format!("the same faults, {sentence}"), self.metrics.rates.of(measure));
        }
        let of_all = &measure::ISOLATED_IN_TIME_OF_ALL;
        let [sentence, faults] = self.words.describe_measure(of_all, &[*limit_s]);
        self.explain(format!("{faults}: {sentence}"), self.metrics.rates.of(of_all));
    }

    fn false_alarms(&mut self) {
        let healthy = &self.metrics.healthy;
        if healthy.hours <= 0.0 {
            return;
        }
        let limit = self.asked.false_alarms_per_h;
        self.push(
            "false alarms per hour".into(),
            self.marked(chosen(limit), "false_alarms_per_h"),
            format!(
                "{} in {:.1} h\nat most {} per hour (95 %)\n{}",
                healthy.alarms,
                healthy.hours,
                three_digits(healthy.alarms_per_h_upper),
                by_environment(healthy.environments)
            ),
            match healthy {
                h if h.alarms_per_h_upper <= limit => MET,
                h if h.alarms_per_h > limit => MISSED,
                _ => NOT_SHOWN,
            },
        );
    }

    /// Explains the false alarms of plants that differ in structure, where alarms are less rare than elsewhere.
    fn alarmed_flights(&mut self) {
        let metrics = self.metrics;
        let strong = metrics.rates.of(&measure::RIGHT_ACTION_OF_STRONG);
        if ![OTHER_STRUCTURE, OTHER_STRUCTURE_FITTED].contains(&metrics.group.suite.as_str()) {
            return;
        }
        if let Some(alarmed) = metrics.rates.counted(&measure::FALSE_ALARM) {
            let title = format!("{}s without a fault that have an alarm", self.words.run());
            self.explain(title, alarmed);
        }
        if strong.of > 0 {
            let title =
                format!("visible faults of intensity {STRONG} and more with the right action");
            self.explain(title, strong);
        }
    }

    fn healthy_shutdowns(&mut self) {
        let healthy = &self.metrics.healthy;
        if healthy.hours <= 0.0 {
            return;
        }
        let most = three_digits(poisson_mean(healthy.shutdowns, 0.05) / healthy.hours);
        let (actuator, off) = (self.words.actuator(), self.words.switched_off());
        self.push(
            format!("a healthy {actuator} {off}, nothing being wrong"),
            "0".into(),
            format!(
                "{} in {:.1} h\nat most {most} per hour (95 %)",
                healthy.shutdowns, healthy.hours
            ),
            none_allowed(healthy.shutdowns, 0.0),
        );
    }

    fn wrong_shutdowns(&mut self) {
        let (actuator, off) = (self.words.actuator(), self.words.switched_off());
        let metrics = self.metrics;
        if self.words.has_several() && metrics.flights > 0 {
            let title = format!("the wrong {actuator} {off}, all trained faults");
            let wrong = metrics.rates.of(&measure::WRONG_SHUTDOWN);
            self.wrong(title, wrong);
        }
        let is_judged = metrics.group.suite == JUDGE;
        let unseen = self.results.unseen_in(&metrics.group.scenario).filter(|_| is_judged);
        let Some(unseen) = unseen else { return };
        let never_trained = format!("a healthy {actuator} {off}, faults never trained on");
        self.wrong(never_trained, unseen.rates.of(&SHUTDOWN_HEALTHY));
        let wrong_sensor = format!("a healthy {actuator} {off} behind a wrong boundary sensor");
        self.wrong(wrong_sensor, unseen.rates.of(&SHUTDOWN_MISINFORMED));
    }

    /// A limit on wrong shutdowns in runs.
    fn wrong(&mut self, title: String, rate: Rate) {
        let Rate { count: wrong, of, .. } = rate;
        if of == 0 {
            return;
        }
        let (limit, run) = (self.asked.wrong_shutdowns, self.words.run());
        self.push(
            title,
            self.marked(chosen(limit), "wrong_shutdowns"),
            format!("{wrong} in {of} {run}s\n{}", at_most(rate)),
            none_allowed(wrong, limit),
        );
    }
}

/// The measures in all scenarios.
fn all_measures(results: &FlightResults, words: &Vocabulary) -> Table {
    let suites: Vec<&FlightMetrics> = results.judged().chain(results.of_other_plants()).collect();
    let limits_s: Vec<f64> = suites.iter().map(|metrics| metrics.limit_s).collect();
    let left = ["of", "measure"].map(String::from);
    let scenarios = suites.iter().map(|metrics| metrics.title());
    let mut grid = Table::headed(left.into_iter().chain(scenarios));
    let mut last = String::new();
    for measure in measure::OF_FLIGHTS {
        let rates: Vec<Rate> = suites.iter().map(|metrics| metrics.rates.of(measure)).collect();
        if rates.iter().all(|rate| rate.of == 0) {
            continue;
        }
        let [sentence, faults] = words.describe_measure(measure, &limits_s);
        let of = if faults == last { String::new() } else { faults.clone() };
        last = faults;
        let cells = rates.iter().map(|rate| stacked(Some(*rate)));
        grid.push([of, sentence].into_iter().chain(cells));
    }
    grid
}

/// The limits on latency in words: each with its scenarios.
fn latency_limits(results: &FlightResults) -> String {
    let mut limits: Vec<(f64, Vec<String>)> = vec![];
    for metrics in results.judged().chain(results.of_other_plants()) {
        match limits.iter_mut().find(|(limit_s, _)| *limit_s == metrics.limit_s) {
            Some((_, scenarios)) => scenarios.push(metrics.title()),
            None => limits.push((metrics.limit_s, vec![metrics.title()])),
        }
    }
    let each = limits.iter().map(|(limit_s, scenarios)| {
        format!("{} s in {}", chosen(*limit_s), scenarios.join(" and "))
    });
    each.collect::<Vec<_>>().join(", ")
}

fn limits_grid(study: &Study, results: &FlightResults, words: &Vocabulary) -> Table {
    let mut grid = Table::headed(["", "scenario", "limit", "measured", ""]);
    for limit in limits(study, results, words) {
        let is_strong = ![MET, NONE_SEEN, ""].contains(&limit.verdict);
        let Limit { title, scenario, limit, measured, verdict } = limit;
        let row = vec![title, scenario, limit, measured, verdict.into()];
        grid.push_if(is_strong, row);
    }
    grid
}

const MET: &str = "met";
const MISSED: &str = "missed";
const PROBABLY_MISSED: &str = "missed, within the interval";
const NOT_SHOWN: &str = "not shown: too few";
const NONE_SEEN: &str = "none seen";

fn none_allowed(count: u64, limit: f64) -> &'static str {
    match count {
        0 => NONE_SEEN,
        count if count as f64 <= limit => MET,
        _ => MISSED,
    }
}

/// The upper end of a share's interval as text.
pub(super) fn at_most(rate: Rate) -> String {
    format!("at most {:.2} % (95 %)", 100.0 * rate.high)
}

fn sizes(study: &Study, results: &FlightResults, words: &Vocabulary) -> String {
    let run = words.run();
    let runs = |count: u64| match count {
        1 => format!("1 {run}"),
        count => format!("{count} {run}s"),
    };
    let further = |count: u64| match count {
        0 => String::new(),
        count => format!(", and from {} in further ones without a fault", runs(count)),
    };
    let of = |suite: &str, number: fn(&Suite) -> usize| study.suite(suite).map_or(0, number);
    let judged = results.judged().next();
    let size = format!(
        "Learned in {} environments, with {} of every fault at each intensity{}; judged in {} other \
         environments, with {} with a fault and {:.1} healthy hours in each scenario.",
        of(LEARN, |suite| suite.environments),
        runs(of(LEARN, |suite| suite.repeats) as u64),
        further(of(HARD_NEGATIVES, |suite| suite.environments) as u64),
        judged.map_or(0, |_| of(JUDGE, |suite| suite.environments)),
        runs(judged.map_or(0, |metrics| metrics.flights)),
        judged.map_or(0.0, |metrics| metrics.healthy.hours),
    );
    let failed_to_learn: u64 = results.left_out.values().map(|left_out| left_out.failed).sum();
    let failed = failed_to_learn + results.judged().map(|metrics| metrics.failed).sum::<u64>();
    let size = match failed {
        0 => size,
        failed => format!(
            "{size} Left out are {failed} {run}s that could not be simulated to their end, {failed_to_learn} of them \
             to learn from."
        ),
    };
    let without = results.left_out.iter();
    let without = without.filter_map(|(scenario, own)| own.without_steady_state(scenario));
    without.fold(size, |text, line| format!("{text} {line}."))
}

/// The median, 95 % quantile and maximum of a latency, one in each line.
fn times(latency: &Option<Latency>) -> String {
    latency.as_ref().map_or(NONE.into(), |latency| {
        let Latency { median_s, p95_s, longest_s, .. } = latency;
        format!("{median_s:.2} s\n{p95_s:.2} s\n{longest_s:.2} s")
    })
}

fn by_action(metrics: &FlightMetrics, words: &Vocabulary) -> Table {
    let mut heads: Vec<String> =
        vec!["action".into(), "visible".into(), "isolated".into(), "another action".into()];
    if words.has_several() {
        heads.push(format!("wrong {}", words.actuator()));
    }
    let times_heads = ["silent", "until visible", "until isolated", "visible to isolated"];
    heads.extend(times_heads.map(String::from));
    let mut grid = Table::headed(heads);
    for class in metrics.classes.iter().chain(&metrics.strong_classes) {
        let [low, high] = class.intensities;
        let count = |rate: Rate| format!("{}\n{}", count_of(rate), stacked(Some(rate)));
        let action =
            format!("{}\nintensity {} … {}", spoken(&class.action), chosen(low), chosen(high));
        let cell = |measure: &Measure| count(class.rates.of(measure));
        let mut row = vec![action, cell(&measure::VISIBLE), cell(&measure::RIGHT_ACTION)];
        row.push(cell(&measure::OTHER_ACTION));
        row.extend(words.has_several().then(|| cell(&measure::WRONG_ACTUATOR)));
        row.push(cell(&measure::SILENT));
        row.extend([&class.detection, &class.isolation, &class.isolation_since_visible].map(times));
        grid.push(row);
    }
    grid
}

fn by_onset(results: &FlightResults, words: &Vocabulary) -> Table {
    let left = ["begins", "scenario"].map(String::from);
    let right = ["visible", "isolated", "silent", "until isolated: median, 95 %"];
    let right = right.map(String::from);
    let wrong = words.has_several().then(|| format!("wrong {} off", words.actuator()));
    let mut grid = Table::headed(left.into_iter().chain(right).chain(wrong));
    for metrics in results.judged() {
        for (name, class) in &metrics.onsets {
            let isolation = class.isolation.as_ref();
            let mut row = vec![
                name.clone(),
                metrics.title(),
                count_of(class.rates.of(&measure::VISIBLE)),
                stacked(Some(class.rates.of(&measure::RIGHT_ACTION))),
                stacked(Some(class.rates.of(&measure::SILENT))),
                isolation.map_or(NONE.into(), |l| format!("{:.2} s, {:.2} s", l.median_s, l.p95_s)),
            ];
            row.extend(
                words
                    .has_several()
                    .then(|| class.rates.of(&measure::WRONG_SHUTDOWN).count.to_string()),
            );
            grid.push(row);
        }
    }
    grid
}

fn wrong_kinds(results: &FlightResults, words: &Vocabulary, page: &mut Document) {
    let kinds = results.judged().flat_map(|metrics| {
        let name = |(kind, count): &(String, u64)| {
            format!("{} ({count}, {})", spoken(kind), metrics.title())
        };
        metrics.wrong_kinds.iter().map(name).collect::<Vec<_>>()
    });
    let kinds: Vec<String> = kinds.collect();
    if !kinds.is_empty() {
        page.note(format!(
            "Kinds of fault that switched the wrong {} off: {}.",
            words.actuator(),
            kinds.join(", ")
        ));
    }
}

/// A sentence on twins that are fitted to such plants; empty if there are none.
fn fitted_plants(results: &FlightResults) -> String {
    let fitted = results.of_suite(OTHER_STRUCTURE_FITTED).find_map(|metrics| metrics.calibration);
    fitted.map_or(String::new(), |fitted| {
        format!(
            " In the suite {OTHER_STRUCTURE_FITTED} each twin was fitted to a calibration flight of its plant: {}.",
            fitted_twins(&fitted)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_seen_is_not_called_met() {
        assert_eq!(none_allowed(0, 0.0), NONE_SEEN);
        assert_eq!(none_allowed(1, 0.0), MISSED);
        assert_eq!(none_allowed(1, 2.0), MET);
        let limit = Limit {
            title: "false alarms".into(),
            scenario: "noise".into(),
            limit: "0.001\ndefault".into(),
            measured: "3 in 0.1 h\nat most 90 per hour".into(),
            verdict: MISSED,
        };
        assert!(limit.is_missed());
        assert_eq!(
            limit.in_words(),
            "false alarms: 3 in 0.1 h [at most 90 per hour], asked for is 0.001, default (noise, missed)"
        );
    }

    #[test]
    fn a_study_without_limits_of_its_own_has_none() {
        assert!(own_limits(&Study::default()).is_empty());
    }
}
