//! Defines the windows that a diagnosis examines.

use crate::learn::bands;
use crate::study::{Flights, Plants, Scenario, Study};
use servotwin_diagnosis::baseline;
use servotwin_diagnosis::diagnoser::Tuning;
use servotwin_diagnosis::sliding::WindowSpan;
use servotwin_diagnosis::spread::{Spread, Spreads};
use servotwin_diagnosis::windows::{WindowKind, Windows};

/// The largest share of the time before the earliest fault that the settling of a baseline may take.
const SETTLE_SHARE: f64 = 0.8;

/// The windows of a diagnosis in a scenario of a study.
#[derive(Clone)]
pub(crate) struct WindowDesign<'s> {
    /// The study.
    pub(crate) study: &'s Study,
    /// Its flights.
    pub(crate) flights: &'s Flights,
    /// The scenario.
    pub(crate) scenario: Scenario,
    /// How the spread of the healthy residual of each watched sensor grows; see [`super::spreads`].
    pub(crate) spreads: Vec<Option<Spread>>,
}

impl WindowDesign<'_> {
    /// The kinds of windows: of absolute residuals, and where specimens differ from their twins, the shortest also of
    /// baseline-corrected residuals. A longer baseline-corrected window would hold a single sudden motion, to which every
    /// specimen responds differently, in all of its panes. Counting it five times would shut down healthy actuators. The
    /// window of a test is judged once, at its end.
    pub(crate) fn kinds(&self) -> Vec<WindowKind> {
        let panes = if self.study.is_on_ground() { 1 } else { Tuning::default().panes };
        let kind = |window_s: f64, is_baseline_corrected: bool| WindowKind {
            span: span(window_s, self.study.sample_period_s, panes),
            is_baseline_corrected,
        };
        let absolute = self.flights.windows_s.iter().map(|&window_s| kind(window_s, false));
        let corrected = self.has_specimens().then(|| kind(self.shortest_s(), true));
        absolute.chain(corrected).collect()
    }

    fn shortest_s(&self) -> f64 {
        self.flights.windows_s.iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn has_specimens(&self) -> bool {
        self.scenario.plants() == Plants::Specimens
    }

    /// The share of the healthy windows that may leave a band.
    pub(super) fn alarms(&self) -> f64 {
        if self.has_specimens() { bands::SPECIMEN_ALARMS } else { bands::ALARMS }
    }

    /// The settings of the baseline; `None` if windows are not baseline-corrected.
    pub(crate) fn baseline(&self) -> Option<baseline::BaselineSettings> {
        let period_s = self.study.sample_period_s;
        let Tuning { baseline_settle_s, baseline_memory_s, panes, .. } = Tuning::default();
        let pane = span(self.shortest_s(), period_s, panes).pane_samples;
        let settle_s = baseline_settle_s.min(SETTLE_SHARE * self.flights.onset_s[0]);
        // Half a pane later than the others, so that no sample completes windows of both.
        let panes = (settle_s / period_s) as u32 / pane;
        let settle_samples = (panes * pane + pane / 2).max(1);
        let memory_samples = ((baseline_memory_s / period_s) as u32).max(settle_samples);
        self.has_specimens()
            .then_some(baseline::BaselineSettings { settle_samples, memory_samples })
    }

    /// Empty windows.
    pub(super) fn empty(&self) -> Windows {
        let spreads = Spreads::new(self.spreads.clone(), self.study.sample_period_s);
        Windows::new((spreads, self.spreads.len()), &self.kinds(), self.baseline())
            .expect("usual settings")
    }
}

/// The panes of a window with a given length.
fn span(window_s: f64, period_s: f64, panes: u32) -> WindowSpan {
    let samples = (window_s / period_s).round() as u32;
    WindowSpan { pane_samples: (samples / panes).max(1), panes }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn design(study: &Study, scenario: Scenario) -> WindowDesign<'_> {
        let flights = study.flights.as_ref().unwrap();
        WindowDesign { study, flights, scenario, spreads: vec![None; study.base_sensors()] }
    }

    #[test]
    fn beyond_a_reference_is_looked_at_where_specimens_differ_from_their_twins() {
        let study = Study::default();
        for scenario in Scenario::ALL {
            let design = design(&study, scenario);
            let (kinds, baseline) = (design.kinds(), design.baseline());
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
        let usual = design(&study, Scenario::Realistic);
        for (earliest_s, samples) in [(5.0, 405), (50.0, 405), (1.5, 125), (0.01, 5)] {
            let mut flights = usual.flights.clone();
            flights.onset_s = [earliest_s, 60.0];
            let baseline = WindowDesign { flights: &flights, ..usual.clone() }.baseline().unwrap();
            assert_eq!(baseline.settle_samples, samples, "{earliest_s}");
            assert_eq!(baseline.memory_samples, 6000);
        }
    }
}
