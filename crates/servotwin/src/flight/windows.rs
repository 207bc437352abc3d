//! Defines the windows that a diagnosis examines.

use crate::study::{Flights, Plants, Scenario};
use servotwin_diagnosis::baseline;
use servotwin_diagnosis::diagnoser::Tuning;
use servotwin_diagnosis::sliding::WindowSpan;
use servotwin_diagnosis::windows::WindowKind;

/// The largest share of the time before the earliest fault that the settling of a baseline may take.
const SETTLE_SHARE: f64 = 0.8;

/// The kinds of windows in a scenario: of absolute residuals, and where specimens differ from their twins, the shortest
/// also of baseline-corrected residuals. A longer baseline-corrected window would hold a single sudden motion, to which
/// every specimen responds differently, in all of its panes. Counting it five times would shut down healthy actuators.
pub fn kinds(flights: &Flights, scenario: Scenario, period_s: f64) -> Vec<WindowKind> {
    let kind = |window_s: f64, is_baseline_corrected: bool| WindowKind {
        span: span(window_s, period_s),
        is_baseline_corrected,
    };
    let absolute = flights.windows_s.iter().map(|&window_s| kind(window_s, false));
    let corrected = is_baseline_corrected(scenario).then(|| kind(shortest_s(flights), true));
    absolute.chain(corrected).collect()
}

fn shortest_s(flights: &Flights) -> f64 {
    flights.windows_s.iter().copied().fold(f64::INFINITY, f64::min)
}

fn is_baseline_corrected(scenario: Scenario) -> bool {
    scenario.plants() == Plants::Specimens
}

/// The settings of the baseline; `None` if windows are not baseline-corrected.
pub fn baseline(
    flights: &Flights,
    scenario: Scenario,
    period_s: f64,
) -> Option<baseline::BaselineSettings> {
    let pane = span(shortest_s(flights), period_s).pane_samples;
    let Tuning { baseline_settle_s, baseline_memory_s, .. } = Tuning::default();
    let settle_s = baseline_settle_s.min(SETTLE_SHARE * flights.onset_s[0]);
    // Half a pane later than the others, so that no sample completes windows of both.
    let panes = (settle_s / period_s) as u32 / pane;
    let settle_samples = (panes * pane + pane / 2).max(1);
    let memory_samples = ((baseline_memory_s / period_s) as u32).max(settle_samples);
    is_baseline_corrected(scenario)
        .then_some(baseline::BaselineSettings { settle_samples, memory_samples })
}

/// The panes of a window with a given length.
fn span(window_s: f64, period_s: f64) -> WindowSpan {
    let samples = (window_s / period_s).round() as u32;
    let Tuning { panes, .. } = Tuning::default();
    WindowSpan { pane_samples: (samples / panes).max(1), panes }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Study;

    #[test]
    fn beyond_a_reference_is_looked_at_where_specimens_differ_from_their_twins() {
        let study = Study::default();
        let flights = study.flights.as_ref().unwrap();
        for scenario in Scenario::ALL {
            let kinds = kinds(flights, scenario, study.sample_period_s);
            let baseline = baseline(flights, scenario, study.sample_period_s);
            let baseline_corrected: Vec<bool> =
                kinds.iter().map(|kind| kind.is_baseline_corrected).collect();
            match scenario {
                Scenario::Realistic => assert_eq!(baseline_corrected, [false, false, true]),
                _ => assert_eq!(baseline_corrected, [false, false], "{}", scenario.name()),
            }
            assert_eq!(baseline.is_some(), scenario == Scenario::Realistic);
            assert!(baseline.is_none_or(|baseline| baseline.check().is_ok()));
        }
    }

    #[test]
    fn the_reference_is_there_before_the_earliest_fault_and_out_of_step() {
        let study = Study::default();
        let usual = study.flights.as_ref().unwrap();
        for (earliest_s, samples) in [(5.0, 405), (50.0, 405), (1.5, 125), (0.01, 5)] {
            let mut flights = usual.clone();
            flights.onset_s = [earliest_s, 60.0];
            let baseline = baseline(&flights, Scenario::Realistic, 0.01).unwrap();
            assert_eq!(baseline.settle_samples, samples, "{earliest_s}");
            assert_eq!(baseline.memory_samples, 6000);
        }
    }
}
