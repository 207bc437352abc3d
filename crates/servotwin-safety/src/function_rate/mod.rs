//! The artefact *function rate*: how often the function fails, with the hybrid twin and without. Failures that begin are
//! counted per flight hour. A failed function is counted by flight, also behind a fault that was hidden before it.
//!
//! Failure rates are the user's, and what the diagnosis answers was counted in judged flights. The function fails in a
//! flight if a fault that needs a shutdown acts without one, or no lane is on ([`flight`]). Three kinds of monitoring
//! are compared:
//!
//! | monitoring | a fault that needs a shutdown | another fault | healthy |
//! |---|---|---|---|
//! | hybrid twin | as counted | shutdowns as counted | false shutdowns as counted |
//! | comparison of two lanes | noticed if visible; every second time the wrong lane is shut down | shuts one of the lanes down if visible | no false alarm |
//! | none | acts until the next check | nothing | no false alarm |
//!
//! The comparison notices what is visible beside the twin, so it differs from the twin in isolation alone: it cannot know
//! the lane. That favors it, because two lanes differ more from each other than each from its twin, and because it
//! raises no false alarm.

pub mod flight;

use crate::counts::{Answer, FaultIntensities, JudgedFlights};
use crate::error::SafetyError;
use crate::interval::{CountedValue, confidence_of_each};
use crate::rated_flights::RatedFlights;
use crate::rates::FailureRates;
use crate::results::StudyResultsFolder;
use crate::tree::lanes::{TreeParameter, add};
use crate::tree::numbers::{BandEnd, ExposureHours};
use flight::{FlightModel, FunctionFailure, LaneOnsets};
use serde::Serialize;
use servotwin::measure::flights::STRONG;
use servotwin::study::Study;
use servotwin::table::{Column, Table};
use std::path::PathBuf;

/// Factors on all failure rates, as wear raises them.
const WEAR: [f64; 3] = [2.0, 5.0, 10.0];

/// The step of an elasticity, as a factor.
const STEP: f64 = 1.01;

/// Who notices faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Monitoring {
    /// The hybrid twin.
    Twin,
    /// A comparison of two lanes.
    Comparison,
    /// Nobody.
    Nobody,
}

/// How often the function fails under a condition, as [`FunctionFailure`] counts it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConditionRates {
    /// Which flights are counted, or what is changed.
    pub condition: String,
    /// Flights with a failed function, with the hybrid twin; the band covers the counts.
    pub twin_failed: CountedValue,
    /// The part in which a fault that needs a shutdown acts without one.
    pub twin_uncontained: CountedValue,
    /// Failures that begin, 1/h.
    pub twin_begins_per_h: CountedValue,
    /// With a comparison of two lanes; `None` for one lane.
    pub comparison: Option<FunctionFailure>,
    /// Without monitoring.
    pub nobody: FunctionFailure,
}

/// How the probability of a failed function with the twin depends on an input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InputSensitivity {
    /// The input.
    pub input: String,
    /// Its value, and the ends of its interval.
    pub(crate) value: CountedValue,
    /// Where it comes from.
    pub evidence: String,
    /// Relative change of the probability of a failed function in a flight per relative change of the input.
    pub elasticity: f64,
    /// The probability with the input at the lower end of its interval.
    pub(crate) at_low: f64,
    /// The probability with the input at the upper end of its interval.
    pub(crate) at_high: f64,
}

/// The failure rate of the function of a study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FunctionRate {
    /// The scenario of the flights.
    pub(crate) scenario: String,
    /// The exposure.
    pub(crate) exposure: ExposureHours,
    /// One entry for each condition; the first has the flights as counted.
    pub conditions: Vec<ConditionRates>,
    /// One entry for each input, the largest elasticity first.
    pub sensitivities: Vec<InputSensitivity>,
    /// What readers must know.
    pub notes: Vec<String>,
}

impl FunctionRate {
    /// Computes the rates of a study.
    ///
    /// # Errors
    /// The study has more than two actuators, or no action that switches one off; a rate is missing.
    pub fn new(flights: &RatedFlights) -> Result<Self, SafetyError> {
        let RatedFlights { results, flights, rates, hours } = flights;
        let (study, exposure) = (&results.study, *hours);
        let wrong = |problem| Err(SafetyError::Study { study: study.name.clone(), problem });
        if study.actuators.len() > 2 {
            return wrong("a function of more than two actuators has no rate; see its fault trees");
        }
        if study.shutdowns().is_empty() {
            return wrong("no action switches an actuator off; declare one in [reactions]");
        }
        rates.check(study)?;
        let model = |judged: &JudgedFlights, intensities| {
            FunctionModel::new(study, (judged, flights), rates, intensities)
        };
        let whole = model(flights, FaultIntensities::All);
        let mut conditions = vec![whole.condition("all intensities".into(), &exposure, 1.0)];
        for (words, intensities) in [
            (format!("strong faults, intensity {STRONG} and more"), FaultIntensities::Strong),
            (format!("weak faults, intensity below {STRONG}"), FaultIntensities::Weak),
        ] {
            let flown = |action: &String| flights.count((action, intensities), Answer::Missed)[1];
            if study.shutdowns().iter().all(|action| flown(action) > 0) {
                let own = model(flights, intensities);
                conditions.push(own.condition(words, &exposure, 1.0));
            }
        }
        for other in results.flights.iter().flat_map(|flights| flights.of_other_plants()) {
            let other = JudgedFlights::read(&results.folder, other)?;
            let own = model(&other, FaultIntensities::All);
            let words = format!("plants that differ from their twin ({})", other.title);
            conditions.push(own.condition(words, &exposure, 1.0));
        }
        for factor in WEAR {
            let words = format!("wear: all failure rates times {factor}");
            conditions.push(whole.condition(words, &exposure, factor));
        }
        let sensitivities = whole.sensitivities(&exposure);
        let mut notes = vec![];
        if study.actuators.len() == 1 {
            notes.push(
                "one actuator: the twin cannot keep the function, it only keeps faults from acting unnoticed".into(),
            );
        }
        let scenario = flights.title.clone();
        Ok(FunctionRate { scenario, exposure, conditions, sensitivities, notes })
    }

    /// Writes all files and returns their paths.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, results: &StudyResultsFolder) -> Result<Vec<PathBuf>, SafetyError> {
        Ok(vec![
            results.write_table("function-rate.csv", &self.rates()?)?,
            results.write_table("function-rate-inputs.csv", &self.inputs()?)?,
        ])
    }

    fn rates(&self) -> Result<Table, SafetyError> {
        let rows = &self.conditions;
        let mut columns = vec![Column::of("condition", "", rows, |own| own.condition.clone())];
        let mut twin = |name: &str, unit: &str, of: fn(&ConditionRates) -> CountedValue| {
            columns.push(Column::of(format!("twin_{name}"), unit, rows, |own| of(own).point));
            columns.push(Column::of(format!("twin_low_{name}"), unit, rows, |own| of(own).low));
            columns.push(Column::of(format!("twin_high_{name}"), unit, rows, |own| of(own).high));
        };
        twin("begins_per_h", "1/h", |own| own.twin_begins_per_h);
        twin("failed_in_flight", "1", |own| own.twin_failed);
        twin("uncontained_in_flight", "1", |own| own.twin_uncontained);
        let mut other = |name: &str, of: fn(&ConditionRates) -> Option<FunctionFailure>| {
            let mut column = |what: &str, unit: &str, value: fn(FunctionFailure) -> f64| {
                let value = |own| of(own).map_or(f64::NAN, value);
                columns.push(Column::of(format!("{name}_{what}"), unit, rows, value));
            };
            column("begins_per_h", "1/h", |own| own.begins_per_h);
            column("failed_in_flight", "1", |own| own.failed);
            column("uncontained_in_flight", "1", |own| own.uncontained);
        };
        other("comparison", |own| own.comparison);
        other("none", |own| Some(own.nobody));
        Ok(Table::from_columns(columns)?)
    }

    fn inputs(&self) -> Result<Table, SafetyError> {
        let rows = &self.sensitivities;
        Ok(Table::from_columns(vec![
            Column::of("input", "", rows, |own| own.input.clone()),
            Column::of("value", "", rows, |own| own.value.point),
            Column::of("low", "", rows, |own| own.value.low),
            Column::of("high", "", rows, |own| own.value.high),
            Column::of("elasticity", "", rows, |own| own.elasticity),
            Column::of("failed_in_flight_at_low", "", rows, |own| own.at_low),
            Column::of("failed_in_flight_at_high", "", rows, |own| own.at_high),
            Column::of("evidence", "", rows, |own| own.evidence.clone()),
        ])?)
    }
}

/// The inputs of the answers to faults that need one action, as indices.
#[derive(Debug, Clone, Copy)]
struct AnswerInputs {
    needs_shutdown: bool,
    missed: usize,
    hidden: usize,
    /// Of the hidden ones, those that a test on the ground passes.
    passed: Option<usize>,
    invisible: usize,
    other_action: usize,
    wrong_shutdown: usize,
}

/// The inputs of a study, and how the rates of its lanes follow from them.
struct FunctionModel {
    inputs: Vec<TreeParameter>,
    /// For every lane, each fault as its rate and its action.
    faults: Vec<Vec<(usize, usize)>>,
    /// One entry for each action.
    answers: Vec<AnswerInputs>,
    false_shutdown: usize,
    keeps_last: bool,
}

impl FunctionModel {
    /// `tested` are the flights whose faults were tested on the ground, if any were.
    fn new(
        study: &Study,
        (flights, tested): (&JudgedFlights, &JudgedFlights),
        rates: &FailureRates,
        intensities: FaultIntensities,
    ) -> Self {
        let actions = study.actions();
        let of_action = 5 + usize::from(tested.passed.is_some());
        let confidence = confidence_of_each(1 + of_action * actions.len());
        let mut inputs: Vec<TreeParameter> = vec![];
        let mut answers = vec![];
        for action in &actions {
            let faults = (action.as_str(), intensities);
            let mut input = |what: &str, share: (CountedValue, String)| {
                add(&mut inputs, format!("{what}: {action}"), share)
            };
            let passed = tested.passed.is_some().then(|| {
                let share = tested.share(faults, Answer::Passed, confidence);
                input("passed by the test on the ground", share)
            });
            let mut share =
                |what: &str, answer: Answer| input(what, flights.share(faults, answer, confidence));
            answers.push(AnswerInputs {
                needs_shutdown: study.reactions.switches_off(action),
                missed: share("missed", Answer::Missed),
                hidden: share("missed and nothing reported", Answer::Hidden),
                passed,
                invisible: share("not visible", Answer::Invisible),
                other_action: share("another action", Answer::OtherAction),
                wrong_shutdown: share("wrong shutdown", Answer::WrongShutdown),
            });
        }
        let shutdowns = flights.false_shutdowns_per_h(study.actuators.len(), confidence);
        let false_shutdown = add(&mut inputs, "false shutdown".into(), shutdowns);
        let mut faults = vec![vec![]; study.actuators.len()];
        for (fault, rate) in rates.of_study(study) {
            let id = format!("failure rate: {}", rate.fault);
            let known = inputs.iter().position(|input| input.id == id);
            let place = known.unwrap_or_else(|| {
                add(&mut inputs, id, (CountedValue::given(rate.per_h), rate.source.clone()))
            });
            let action = &study.classes[fault.class].action;
            let action = actions.iter().position(|known| known == action);
            faults[fault.actuator].extend(action.map(|action| (place, action)));
        }
        let keeps_last = study.least_on() > 0;
        FunctionModel { inputs, faults, answers, false_shutdown, keeps_last }
    }

    /// The values of all inputs: shares of missed faults at one end, and all that shuts down without need at another.
    fn values(&self, missed: BandEnd, needless: BandEnd) -> Vec<f64> {
        let is_needless = |place: usize| {
            let own = |of: &AnswerInputs| [of.other_action, of.wrong_shutdown].contains(&place);
            place == self.false_shutdown || self.answers.iter().any(own)
        };
        let ends = self.inputs.iter().enumerate();
        ends.map(
            |(place, input)| {
                if is_needless(place) { needless.of(input.value) } else { missed.of(input.value) }
            },
        )
        .collect()
    }

    /// What begins in every lane.
    fn onsets(&self, monitoring: Monitoring, values: &[f64]) -> Vec<LaneOnsets> {
        let mut lanes = vec![LaneOnsets::default(); self.faults.len()];
        for (lane, faults) in self.faults.iter().enumerate() {
            let other = lanes.len() - 1 - lane;
            for &(rate, action) in faults {
                let (rate, answers) = (values[rate], self.answers[action]);
                let share = |place: usize| values[place].min(1.0);
                let own = &mut lanes[lane];
                match (monitoring, answers.needs_shutdown) {
                    (Monitoring::Twin, true) => {
                        let missed = share(answers.missed);
                        let hidden = share(answers.hidden).min(missed);
                        own.contained += rate * (1.0 - missed);
                        own.reported += rate * (missed - hidden);
                        own.hidden += rate * hidden;
                        own.passed += rate * hidden * answers.passed.map_or(1.0, share);
                    }
                    (Monitoring::Twin, false) => {
                        own.needless += rate * share(answers.other_action);
                        // One lane has no other that could be shut down.
                        if other != lane {
                            lanes[other].needless += rate * share(answers.wrong_shutdown);
                        }
                    }
                    (Monitoring::Comparison, true) => {
                        let hidden = share(answers.invisible);
                        own.hidden += rate * hidden;
                        own.contained += 0.5 * rate * (1.0 - hidden);
                        own.reported += 0.5 * rate * (1.0 - hidden);
                    }
                    (Monitoring::Comparison, false) => {
                        let each = 0.5 * rate * (1.0 - share(answers.invisible));
                        lanes.iter_mut().for_each(|lane| lane.needless += each);
                    }
                    (Monitoring::Nobody, true) => own.hidden += rate,
                    (Monitoring::Nobody, false) => {}
                }
            }
            if monitoring == Monitoring::Twin {
                lanes[lane].needless += values[self.false_shutdown];
            }
        }
        lanes
    }

    fn rate(
        &self,
        monitoring: Monitoring,
        values: &[f64],
        hours: &ExposureHours,
    ) -> FunctionFailure {
        let (lanes, keeps_last) = (self.onsets(monitoring, values), self.keeps_last);
        // The test on the ground is one of the twin.
        let test_h = hours.test_h.filter(|_| monitoring == Monitoring::Twin);
        let hours = ExposureHours { test_h, ..*hours };
        FlightModel { lanes, keeps_last, hours }.function_failure()
    }

    /// The rates of all kinds of monitoring; `wear` multiplies the failure rates.
    fn condition(&self, condition: String, hours: &ExposureHours, wear: f64) -> ConditionRates {
        let rate_at = |monitoring: Monitoring, [missed, needless]: [BandEnd; 2]| {
            let mut values = self.values(missed, needless);
            values[self.false_shutdown + 1..].iter_mut().for_each(|rate| *rate *= wear);
            self.rate(monitoring, &values, hours)
        };
        let points = [BandEnd::Point; 2];
        // Where most faults are missed, a needless shutdown may even help. So all corners bound the band.
        let ends = [BandEnd::Low, BandEnd::High];
        let corners = ends.iter().flat_map(|&missed| ends.map(|needless| [missed, needless]));
        let corners: Vec<FunctionFailure> =
            corners.map(|ends| rate_at(Monitoring::Twin, ends)).collect();
        let band = |of: fn(&FunctionFailure) -> f64| CountedValue {
            point: of(&rate_at(Monitoring::Twin, points)),
            low: corners.iter().map(of).fold(f64::INFINITY, f64::min),
            high: corners.iter().map(of).fold(0.0, f64::max),
        };
        ConditionRates {
            condition,
            twin_failed: band(|own| own.failed),
            twin_uncontained: band(|own| own.uncontained),
            twin_begins_per_h: band(|own| own.begins_per_h),
            comparison: (self.faults.len() == 2).then(|| rate_at(Monitoring::Comparison, points)),
            nobody: rate_at(Monitoring::Nobody, points),
        }
    }

    /// How the rate with the twin depends on every input and on the hours.
    fn sensitivities(&self, hours: &ExposureHours) -> Vec<InputSensitivity> {
        let points = self.values(BandEnd::Point, BandEnd::Point);
        let rate = |values: &[f64], hours: &ExposureHours| {
            self.rate(Monitoring::Twin, values, hours).failed
        };
        let mut found: Vec<InputSensitivity> = vec![];
        // Only the comparison of two lanes reads what is not visible.
        let is_read = |place: usize| self.answers.iter().all(|own| own.invisible != place);
        for (place, input) in self.inputs.iter().enumerate().filter(|(place, _)| is_read(*place)) {
            let with = |value: f64| {
                let mut values = points.clone();
                values[place] = value;
                rate(&values, hours)
            };
            found.push(sensitivity(&input.id, input.value, &input.evidence, &with));
        }
        type Change = fn(ExposureHours, f64) -> ExposureHours;
        let mut exposures: Vec<(&str, f64, Change)> = vec![
            ("flight, h", hours.flight_h, |own, flight_h| ExposureHours { flight_h, ..own }),
            ("repair interval, h", hours.repair_h, |own, repair_h| ExposureHours {
                repair_h,
                ..own
            }),
            ("check interval, h", hours.check_h, |own, check_h| ExposureHours { check_h, ..own }),
        ];
        if let Some(test_h) = hours.test_h {
            let change: Change = |own, test_h| ExposureHours { test_h: Some(test_h), ..own };
            exposures.push(("test interval, h", test_h, change));
        }
        for (name, value, change) in exposures {
            let with = |value: f64| {
                let own = change(*hours, value);
                // A check comes at the end of a flight at the soonest.
                let check_h = own.check_h.max(own.flight_h);
                let test_h = own.test_h.map(|test_h| test_h.clamp(own.flight_h, check_h));
                rate(&points, &ExposureHours { check_h, test_h, ..own })
            };
            found.push(sensitivity(name, CountedValue::given(value), "given", &with));
        }
        let size = |own: &InputSensitivity| own.elasticity.abs();
        found.sort_by(|a, b| size(b).total_cmp(&size(a)).then_with(|| a.input.cmp(&b.input)));
        found
    }
}

fn sensitivity(
    input: &str,
    value: CountedValue,
    evidence: &str,
    rate: &dyn Fn(f64) -> f64,
) -> InputSensitivity {
    let [less, more] = [value.point / STEP, value.point * STEP].map(rate);
    let elasticity = if less > 0.0 { (more / less).ln() / (2.0 * STEP.ln()) } else { 0.0 };
    InputSensitivity {
        input: input.into(),
        value,
        evidence: evidence.into(),
        elasticity,
        at_low: rate(value.low),
        at_high: rate(value.high),
    }
}
