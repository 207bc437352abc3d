//! The numbers of fault trees: probability and rate per flight hour, each with a band, cut sets and importance.
//!
//! The band is an interval propagation, not a sampling. All trees are coherent, so a top event is least probable if every
//! counted number is at its lower end, and most probable if every one is at its upper end. Both bounds are exact, need no
//! random numbers, and hold together with the joint confidence of the counts, whatever their dependence. Sampling would
//! need a prior for events that were never seen, and that prior would decide the upper end.

use super::decision_diagram::{CutSets, DecisionDiagram};
use super::lanes::{LaneTrees, TreeParameter};
use super::structure::{EventLaw, Exposure, TopEvent, TreeInput};
use crate::error::SafetyError;
use crate::interval::CountedValue;
use serde::Serialize;

/// How long failures may have been there, h.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ExposureHours {
    /// Duration of a flight.
    pub flight_h: f64,
    /// From the report of a fault to its repair.
    pub repair_h: f64,
    /// Between two checks that find every hidden fault.
    pub check_h: f64,
    /// Between two tests on the ground, which find some of them; `None` without tests.
    pub test_h: Option<f64>,
}

impl ExposureHours {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The first number outside of its range.
    pub(crate) fn checked(self) -> Result<Self, SafetyError> {
        let ExposureHours { flight_h, repair_h, check_h, test_h } = self;
        let wrong = |name, given, range| Err(SafetyError::Hours { name, given, range });
        match () {
            () if !(flight_h > 0.0 && flight_h <= 1000.0) => {
                wrong("--flight-hours", flight_h, "above 0, at most 1000")
            }
            () if !(0.0..=1e5).contains(&repair_h) => {
                wrong("--repair-hours", repair_h, "0 … 100,000")
            }
            () if !(check_h >= flight_h && check_h <= 1e6) => wrong(
                "--check-hours",
                check_h,
                "at least the duration of a flight, at most 1,000,000",
            ),
            () if !test_h.is_none_or(|test_h| (flight_h..=check_h).contains(&test_h)) => wrong(
                "--test-hours",
                test_h.unwrap_or_default(),
                "at least the duration of a flight, at most --check-hours",
            ),
            () => Ok(self),
        }
    }

    /// The hours of an exposure.
    pub(super) fn of(&self, exposure: Exposure) -> f64 {
        match exposure {
            Exposure::Flight => self.flight_h,
            Exposure::Repair => self.repair_h,
            Exposure::Test => self.test_h.unwrap_or(self.check_h),
            Exposure::Check => self.check_h,
        }
    }
}

/// The end of every interval at which a tree is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BandEnd {
    /// The estimates.
    Point,
    /// The lower ends.
    Low,
    /// The upper ends.
    High,
}

impl BandEnd {
    /// All ends.
    pub const ALL: [BandEnd; 3] = [BandEnd::Point, BandEnd::Low, BandEnd::High];

    /// The value at this end.
    pub(crate) fn of(self, value: CountedValue) -> f64 {
        match self {
            BandEnd::Point => value.point,
            BandEnd::Low => value.low,
            BandEnd::High => value.high,
        }
    }

    /// The end of a file's name.
    pub(crate) fn suffix(self) -> &'static str {
        match self {
            BandEnd::Point => "",
            BandEnd::Low => "-low",
            BandEnd::High => "-high",
        }
    }
}

/// The probability of every basic event at one end of all intervals.
pub fn event_probabilities(trees: &LaneTrees, hours: &ExposureHours, end: BandEnd) -> Vec<f64> {
    probabilities_with(trees, hours, &|parameter| end.of(parameter.value))
}

/// The probability of every basic event for these values of the parameters: 1 − exp(−λ t), or a constant.
fn probabilities_with(
    trees: &LaneTrees,
    hours: &ExposureHours,
    value: &dyn Fn(&TreeParameter) -> f64,
) -> Vec<f64> {
    let probability = |law: EventLaw| match law {
        EventLaw::Constant(place) => value(&trees.constants[place]),
        EventLaw::Exponential(place, exposure) => {
            -(-value(&trees.rates[place]) * hours.of(exposure)).exp_m1()
        }
    };
    trees.tree.events.iter().map(|event| probability(event.law)).collect()
}

/// How far a counted parameter alone widens the band of a top event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BandDriver {
    /// The parameter's identifier.
    pub parameter: String,
    /// Where its counts stand.
    pub evidence: String,
    /// The probability in the last flight with this parameter at its upper end and all others at their estimates.
    pub(crate) probability: f64,
}

/// The counted parameters, the one that widens the band most first.
fn band_drivers(
    diagram: &DecisionDiagram,
    trees: &LaneTrees,
    hours: &ExposureHours,
) -> Vec<BandDriver> {
    let all = trees.rates.iter().chain(&trees.constants);
    let driver = |driver: &TreeParameter| {
        let value = |parameter: &TreeParameter| match parameter.id == driver.id {
            true => parameter.value.high,
            false => parameter.value.point,
        };
        let probability = diagram.probability(&probabilities_with(trees, hours, &value));
        BandDriver { parameter: driver.id.clone(), evidence: driver.evidence.clone(), probability }
    };
    let counted = all.filter(|parameter| parameter.value.high > parameter.value.point);
    let mut drivers: Vec<BandDriver> = counted.map(driver).collect();
    drivers.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    drivers
}

/// The importance of a basic event for a top event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventImportance {
    /// The event's identifier.
    pub(crate) event: String,
    /// The event in words.
    pub title: String,
    /// Its probability.
    pub(crate) probability: f64,
    /// The upper end of its interval; the bound of an event that was never seen.
    pub(crate) upper: f64,
    /// ∂P/∂q.
    pub(crate) birnbaum: f64,
    /// The share of the top event's probability that disappears if the event never happens: 1 − P(q = 0)/P.
    pub fussell_vesely: f64,
}

/// A minimal cut set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CutSet {
    /// The product of its events' probabilities.
    pub(crate) probability: f64,
    /// The same at the upper ends of their intervals.
    pub(crate) upper: f64,
    /// The identifiers of its events.
    pub events: Vec<String>,
}

/// The numbers of a top event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopNumbers {
    /// The identifier of its gate.
    pub id: String,
    /// The event in words.
    pub title: String,
    /// Its probability in the last flight before a check, where hidden faults are most probable.
    pub probability: CountedValue,
    /// The mean over all flights between two checks.
    pub mean_probability: CountedValue,
    /// That mean divided by the duration of a flight, 1/h. `None` for an event that may be there since before the flight:
    /// its probability does not grow with the flight's duration.
    pub per_flight_hour: Option<CountedValue>,
    /// Number of minimal cut sets with one event, two events and so on.
    pub cut_set_orders: Vec<u64>,
    /// The most probable minimal cut sets.
    pub cut_sets: Vec<CutSet>,
    /// All events of the tree, those with the largest share first.
    pub importances: Vec<EventImportance>,
    /// What widens the band most.
    pub band_drivers: Vec<BandDriver>,
    /// The number of nodes of its decision diagram.
    pub(crate) diagram_nodes: usize,
}

/// The number of listed cut sets.
const LISTED_CUT_SETS: usize = 200;

/// The most flights between two checks that the mean is taken over; more are represented by this many.
const MAX_FLIGHTS: f64 = 1000.0;

/// Evaluates every top event.
pub fn evaluate(trees: &LaneTrees, hours: &ExposureHours) -> Vec<TopNumbers> {
    let tops = trees.tree.tops.iter();
    tops.map(|top| top_numbers(trees, hours, top)).collect()
}

fn top_numbers(trees: &LaneTrees, hours: &ExposureHours, event: &TopEvent) -> TopNumbers {
    let gate = event.gate;
    let top = TreeInput::Gate(gate);
    let diagram = DecisionDiagram::new(&trees.tree, top);
    let of_ends = |value: &dyn Fn(BandEnd) -> f64| CountedValue {
        point: value(BandEnd::Point),
        low: value(BandEnd::Low),
        high: value(BandEnd::High),
    };
    let probability = of_ends(&|end| diagram.probability(&event_probabilities(trees, hours, end)));
    let mean = of_ends(&|end| mean_probability(&diagram, trees, hours, end));
    let cut_sets = diagram.cut_sets();
    TopNumbers {
        id: trees.tree.gates[gate].id.clone(),
        title: trees.tree.gates[gate].title.clone(),
        per_flight_hour: event.begins.then(|| of_ends(&|end| end.of(mean) / hours.flight_h)),
        mean_probability: mean,
        probability,
        cut_set_orders: cut_sets.count_by_order(),
        cut_sets: listed_cut_sets(&cut_sets, trees, hours),
        importances: importances(&diagram, trees, hours, top),
        band_drivers: band_drivers(&diagram, trees, hours),
        diagram_nodes: diagram.size(),
    }
}

/// The mean over the flights between two checks. Before the first of them nothing is hidden.
fn mean_probability(
    diagram: &DecisionDiagram,
    trees: &LaneTrees,
    hours: &ExposureHours,
    end: BandEnd,
) -> f64 {
    let flights = (hours.check_h / hours.flight_h).round().clamp(1.0, MAX_FLIGHTS);
    let of_flight = |flight: usize| {
        // The middle of the flights that this one represents, less half a flight: the time before it.
        let before_h =
            (hours.check_h * (flight as f64 + 0.5) / flights - 0.5 * hours.flight_h).max(0.0);
        // Tests begin with a check.
        let test_h = hours.test_h.map(|test_h| before_h % test_h);
        let hours = ExposureHours { check_h: before_h, test_h, ..*hours };
        diagram.probability(&event_probabilities(trees, &hours, end))
    };
    (0..flights as usize).map(of_flight).sum::<f64>() / flights
}

fn listed_cut_sets(sets: &CutSets, trees: &LaneTrees, hours: &ExposureHours) -> Vec<CutSet> {
    let probabilities = event_probabilities(trees, hours, BandEnd::Point);
    let uppers = event_probabilities(trees, hours, BandEnd::High);
    let found = sets.most_probable(&probabilities, LISTED_CUT_SETS);
    let id = |event: &usize| trees.tree.events[*event].id.clone();
    let set = |(probability, events): (f64, Vec<usize>)| CutSet {
        probability,
        upper: events.iter().map(|&event| uppers[event]).product(),
        events: events.iter().map(id).collect(),
    };
    found.into_iter().map(set).collect()
}

fn importances(
    diagram: &DecisionDiagram,
    trees: &LaneTrees,
    hours: &ExposureHours,
    top: TreeInput,
) -> Vec<EventImportance> {
    let probabilities = event_probabilities(trees, hours, BandEnd::Point);
    let uppers = event_probabilities(trees, hours, BandEnd::High);
    let whole = diagram.probability(&probabilities);
    let birnbaum = diagram.birnbaum(&probabilities);
    let importance = |event: usize| EventImportance {
        event: trees.tree.events[event].id.clone(),
        title: trees.tree.events[event].title.clone(),
        probability: probabilities[event],
        upper: uppers[event],
        birnbaum: birnbaum[event],
        // P is linear in every q, so q · ∂P/∂q is what disappears.
        fussell_vesely: match whole > 0.0 {
            true => probabilities[event] * birnbaum[event] / whole,
            false => 0.0,
        },
    };
    let events = trees.tree.events_below(top);
    let mut list: Vec<EventImportance> = events.into_iter().map(importance).collect();
    list.sort_by(|a, b| {
        let largest = b.fussell_vesely.total_cmp(&a.fussell_vesely);
        largest.then_with(|| b.birnbaum.total_cmp(&a.birnbaum))
    });
    list
}
