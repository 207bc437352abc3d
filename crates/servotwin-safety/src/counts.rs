//! What the judged flights counted, as fault trees and the failure rate of the function read it.

use crate::error::SafetyError;
use crate::interval::{CountedValue, poisson_rate_per_h};
use crate::rates::{FailureRates, RatedFault};
use servotwin::flight::judge::{ClassMetrics, FlightMetrics};
use servotwin::flight::measure::{self, Measure};

/// The faults whose flights are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultIntensities {
    All,
    /// From [`STRONG`](servotwin::flight::judge::STRONG) on.
    Strong,
    /// Below it.
    Weak,
}

/// What happened in the judged flights with faults of one action.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct ActionCounts {
    /// All of them.
    pub flown: u64,
    /// The right action was not the first one.
    pub missed: u64,
    /// Of the missed ones: nothing was raised, or nothing was visible.
    pub hidden: u64,
    /// Nothing was visible.
    pub invisible: u64,
    /// Another action was raised for the right actuator.
    pub other_action: u64,
    /// Another actuator was shut down.
    pub wrong_shutdown: u64,
}

impl ActionCounts {
    /// The counts of an action.
    pub(crate) fn of(metrics: &FlightMetrics, action: &str, intensities: FaultIntensities) -> Self {
        let own = |classes: &[ClassMetrics]| {
            let own = classes.iter().find(|class| class.command == action);
            own.map(Self::of_class).unwrap_or_default()
        };
        let (all, strong) = (own(&metrics.classes), own(&metrics.strong_classes));
        match intensities {
            FaultIntensities::All => all,
            FaultIntensities::Strong => strong,
            FaultIntensities::Weak => ActionCounts {
                flown: all.flown - strong.flown,
                missed: all.missed - strong.missed,
                hidden: all.hidden - strong.hidden,
                invisible: all.invisible - strong.invisible,
                other_action: all.other_action - strong.other_action,
                wrong_shutdown: all.wrong_shutdown - strong.wrong_shutdown,
            },
        }
    }

    fn of_class(class: &ClassMetrics) -> Self {
        let count = |measure: &Measure| class.rates.of(measure).count;
        let invisible = class.flown - count(&measure::VISIBLE);
        ActionCounts {
            flown: class.flown,
            missed: class.flown - count(&measure::RIGHT_ACTION_OF_ALL),
            hidden: invisible + count(&measure::SILENT),
            invisible,
            other_action: count(&measure::OTHER_ACTION),
            wrong_shutdown: count(&measure::WRONG_SHUTDOWN),
        }
    }
}

/// Shutdowns of healthy lanes by false alarms, per hour of a lane, with their evidence.
pub(crate) fn false_shutdowns_per_h(
    metrics: &FlightMetrics,
    lanes: usize,
    confidence: f64,
) -> (CountedValue, String) {
    let healthy = &metrics.healthy;
    // Every healthy hour was an hour of all lanes.
    let hours = healthy.hours * lanes as f64;
    let value = match hours > 0.0 {
        true => poisson_rate_per_h(healthy.shutdowns, hours, confidence),
        // Without hours nothing is known; a rate of 1/h stands for that.
        false => CountedValue { point: 1.0, low: 0.0, high: 1.0 },
    };
    let evidence = format!(
        "shutdowns of healthy lanes: {} in {hours:.3} h of lanes, flights.json, scenario {}",
        healthy.shutdowns,
        metrics.title()
    );
    (value, evidence)
}

/// Refuses rates that lack a fault.
pub(crate) fn check_rates(faults: &[RatedFault], rates: &FailureRates) -> Result<(), SafetyError> {
    let missing: Vec<String> =
        faults.iter().filter(|f| rates.of(f).is_none()).map(|f| f.id.clone()).collect();
    match missing.is_empty() {
        true => Ok(()),
        false => Err(SafetyError::NoRates { path: rates.path.clone(), missing }),
    }
}
