//! Answers of the diagnosis to faults that it was never trained on.

use super::flights::at_most;
use crate::Material;
use crate::vocabulary::Vocabulary;
use crate::words::{NONE, count_of};
use servotwin::flight::unseen_faults::{UnseenFaultMetrics, UnseenFaultRates};
use servotwin::measure::outcome::Needed;
use servotwin::measure::unseen;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let suites = material.flights.map_or(&[][..], |results| &results.unseen);
    let suites: Vec<&UnseenFaultMetrics> = suites.iter().filter(|m| !m.faults.is_empty()).collect();
    if suites.is_empty() {
        return;
    }
    let words = &material.words();
    let (actuator, run) = (words.actuator(), words.run());
    page.text(format!(
            "Nothing in training was like these, so nobody expects the right name. What is expected is \
             that what is healthy stays on, and that what is said makes sense: the right {}, \
             “unknown”, or that an input is not to be believed. Sensors that stick, drift or oscillate \
             do so in the control loop; a reading that is missing or noisy is so for the diagnosis only.",
            words.actuator()
        ));
    for metrics in suites {
        if !metrics.sets.is_empty() {
            page.table("", challenges(&metrics.sets, words).captioned(format!(
                        "Scenario {}: challenge sets. The first action counts as right or other; where no action is right, \
                         {run}s without any count as right. A missed shutdown is one of the {run}s that need it. The \
                         latency runs from the onset to the first right action: the median, and below it the 95 % \
                         quantile.",
                        metrics.scenario
                    )));
        }
        let healthy = metrics.rates.of(&unseen::SHUTDOWN_HEALTHY);
        page.table("", table(metrics, words).captioned(format!(
                "Scenario {}: {run}s by the most that was said in them (each counts once), in several \
                 environments{}.{}",
                metrics.scenario,
                match words.has_several() {
                    true => format!(" and every {actuator}"),
                    false => String::new(),
                },
                match words.has_off() {
                    true => format!(
                        " A healthy {actuator} was to be {} in {} {run}s ({}).{}",
                        words.switched_off(),
                        count_of(healthy),
                        at_most(healthy),
                        behind_wrong_sensor(metrics, words)
                    ),
                    false => String::new(),
                }
            )));
        let told = metrics.faults.iter().filter(|fault| !fault.wrong.is_empty());
        let told: Vec<String> =
            told.map(|o| format!("{} ({})", words.adapted(&o.title), o.wrong.join("; "))).collect();
        if !told.is_empty() {
            page.note(format!("Where that happened: {}.", told.join(", ")));
        }
    }
    let off = words.off();
    page.note(format!(
            "The needed action is right for the fault as a whole: a {off} where the \
             {actuator} does not do what it should, anything but a {off} where only a sensor is wrong, \
             and none where no {actuator} is at fault. “Off” counts each {off}: of what is at fault, of what is healthy, \
             and of what is healthy while a boundary sensor is wrong, which is a supply or return pressure that its twin reads. \
             The first word is whatever the diagnosis said first after the onset other than “healthy”: \
             the median, and below it the last.",
        ));
}

/// How often a healthy actuator was switched off because its twin reads a wrong pressure; one sentence.
fn behind_wrong_sensor(metrics: &UnseenFaultMetrics, words: &Vocabulary) -> String {
    let Some(rate) = metrics.rates.counted(&unseen::SHUTDOWN_MISINFORMED) else {
        return String::new();
    };
    format!(
        " Healthy {} {} behind a wrong boundary sensor: {} {}s.",
        words.actuator(),
        words.switched_off(),
        count_of(rate),
        words.run()
    )
}

/// One row for each challenge set.
fn challenges(sets: &[UnseenFaultRates], words: &Vocabulary) -> Table {
    let columns = [
        format!("{}s", words.run()),
        "failed".into(),
        "right action first".into(),
        "other action first".into(),
        "no action".into(),
        format!("missed {}", words.off()),
        format!("{} of a healthy {}", words.off(), words.actuator()),
        "false alarm before the onset".into(),
        "latency".into(),
    ];
    let mut grid = Table::headed(["challenge set".to_owned()].into_iter().chain(columns));
    for set in sets {
        let missed = set.rates.counted(&unseen::NEVER_SHUT_DOWN);
        let (latency, wrong) = (set.latency.as_ref(), set.wrong.len());
        let row = vec![
            set.title.clone(),
            set.flights.to_string(),
            set.failed.to_string(),
            set.count(&unseen::RIGHT_RESPONSE).to_string(),
            set.count(&unseen::OTHER_RESPONSE).to_string(),
            set.count(&unseen::NO_RESPONSE).to_string(),
            missed.map_or(NONE.into(), count_of),
            wrong.to_string(),
            set.count(&unseen::EARLY_ALARM).to_string(),
            latency.map_or(NONE.into(), |l| format!("{:.2} s\n{:.2} s", l.median_s, l.p95_s)),
        ];
        grid.push_if(wrong > 0, row);
    }
    grid
}

fn table(metrics: &UnseenFaultMetrics, vocabulary: &Vocabulary) -> Table {
    let left = ["fault".to_owned(), format!("{}s", vocabulary.run())];
    let words = unseen::ANSWERS.map(|answer| vocabulary.said(answer.sentence));
    let right = [
        "off: at fault".to_owned(),
        "off: healthy".to_owned(),
        "off: healthy, sensor wrong".to_owned(),
        "first word".to_owned(),
    ];
    let mut grid = Table::headed(left.into_iter().chain(words).chain(right));
    for fault in &metrics.faults {
        let row = row(fault, vocabulary);
        grid.push_if(!fault.wrong.is_empty(), row);
    }
    grid
}

fn row(fault: &UnseenFaultRates, words: &Vocabulary) -> Vec<String> {
    let count = |count: u64| if count == 0 { NONE.into() } else { count.to_string() };
    let needed = match fault.needed {
        Some(Needed::Shutdown) => format!("needed: a {}", words.off()),
        Some(Needed::NoShutdown) => format!("needed: anything but a {}", words.off()),
        Some(Needed::Any | Needed::ItsAction) => "needed: any action".into(),
        Some(Needed::Nothing) => "needed: no action".into(),
        None => String::new(),
    };
    let small = match fault.strengths.as_str() {
        "" => needed,
        strengths => format!("{strengths}; {needed}"),
    };
    let mut row =
        vec![format!("{}\n{small}", words.adapted(&fault.title)), fault.flights.to_string()];
    row.extend(unseen::ANSWERS.map(|answer| count(fault.count(answer))));
    row.push(count(fault.count(&unseen::SHUTDOWN_AT_FAULT)));
    row.push(fault.count(&unseen::SHUTDOWN_HEALTHY).to_string());
    let misinformed = fault.rates.counted(&unseen::SHUTDOWN_MISINFORMED);
    row.push(misinformed.map_or(NONE.into(), |rate| rate.count.to_string()));
    let first = fault.first_word.as_ref();
    row.push(first.map_or(NONE.into(), |l| format!("{:.2} s\n{:.2} s", l.median_s, l.longest_s)));
    row
}
