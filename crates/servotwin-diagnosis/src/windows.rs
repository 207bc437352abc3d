//! The windows of all kinds: of several lengths, of uncorrected and of baseline-corrected residuals. A running diagnosis
//! judges these windows, and training takes the same ones out of its flights.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::baseline::{self, Baseline, BaselineSettings};
use crate::error::Error;
use crate::residual::{DividedSample, Window};
use crate::sliding::{self, Sliding, SpanWindow, WindowSpan};
use crate::spread::Spreads;

/// A kind of window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowKind {
    /// Its length, and how often a new one is complete.
    pub span: WindowSpan,
    /// Whether its residuals are baseline-corrected.
    pub is_baseline_corrected: bool,
}

/// One sample.
#[derive(Debug, Clone, Copy)]
pub struct WindowSample<'s> {
    /// The sensor values, here and below in the sensors' units and order.
    pub measured: &'s [f64],
    /// The values that the twin expects.
    pub twin: &'s [f64],
    /// The scale of each sensor.
    pub scales: &'s [f64],
    /// Sensors with a stand-in value that looks healthy.
    pub stands_in: &'s [bool],
    /// Whether there is no suspicion, so that the baseline may follow.
    pub is_trusted: bool,
}

/// Windows of baseline-corrected residuals.
#[derive(Debug, Clone)]
struct BaselineCorrected {
    baseline: Baseline,
    sliding: Sliding,
    /// The judged values minus the baseline.
    judged: Vec<f64>,
}

/// The windows of all kinds.
#[derive(Debug, Clone)]
pub struct Windows {
    /// For each kind, whether it is baseline-corrected, and its index among those that are or are not.
    places: Vec<(bool, usize)>,
    spreads: Spreads,
    absolute: Sliding,
    baseline_corrected: Option<BaselineCorrected>,
}

/// Stored [`Windows`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored {
    /// As [`Spreads::store`].
    twin: Vec<f64>,
    absolute: sliding::Stored,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    baseline_corrected: Option<StoredBaselineCorrected>,
}

/// The stored baseline-corrected part of [`Windows`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredBaselineCorrected {
    baseline: baseline::Stored,
    windows: sliding::Stored,
}

impl Windows {
    /// Empty windows of the sensors with these spreads. The first `watched` decide whether something deviates.
    ///
    /// # Errors
    /// As [`Sliding::new`] and `Baseline::new`; [`Error::CorruptModel`] for baseline-corrected kinds without a
    /// baseline, or vice versa.
    pub fn new(
        (spreads, watched): (Spreads, usize),
        kinds: &[WindowKind],
        baseline: Option<BaselineSettings>,
    ) -> Result<Self, Error> {
        let sensors = spreads.sensors();
        let spans = |is_baseline_corrected: bool| -> Vec<WindowSpan> {
            let own =
                kinds.iter().filter(|kind| kind.is_baseline_corrected == is_baseline_corrected);
            own.map(|kind| kind.span).collect()
        };
        let empty = Window::watching(sensors, watched).keeping_undivided();
        let absolute = Sliding::new(empty.clone(), &spans(false))?;
        let baseline_corrected = match (baseline, &spans(true)[..]) {
            (None, []) => None,
            (Some(settings), spans @ [_, ..]) => Some(BaselineCorrected {
                baseline: Baseline::new(settings, sensors)?,
                sliding: Sliding::new(empty, spans)?,
                judged: vec![0.0; sensors],
            }),
            _ => {
                let broken = "a reference and the window lengths beyond it need each other";
                return Err(Error::CorruptModel { broken });
            }
        };
        let mut counts = [0; 2];
        let place = |kind: &WindowKind| {
            let count = &mut counts[usize::from(kind.is_baseline_corrected)];
            *count += 1;
            (kind.is_baseline_corrected, *count - 1)
        };
        let places = kinds.iter().map(place).collect();
        Ok(Windows { places, spreads, absolute, baseline_corrected })
    }

    /// Takes a sample; returns whether it completed a window of any kind. Does not allocate.
    ///
    /// # Panics
    /// As [`Window::add`].
    pub fn add(&mut self, sample: &WindowSample) -> bool {
        let WindowSample { measured, twin, scales, .. } = *sample;
        let [judged, spreads] = self.spreads.divide(measured, twin, scales);
        let divided = DividedSample { judged, measured, twin, scales, spreads };
        let has_absolute = self.absolute.add(&divided);
        let has_relative = self
            .baseline_corrected
            .as_mut()
            .is_some_and(|baseline_corrected| baseline_corrected.add(sample, divided));
        has_absolute || has_relative
    }

    /// As [`Spreads::factor`].
    pub(crate) fn spread(&self, sensor: usize) -> f64 {
        self.spreads.factor(sensor)
    }

    /// The window of a kind.
    ///
    /// # Panics
    /// If there is no such kind.
    pub fn of(&self, kind: usize) -> &SpanWindow {
        let (is_baseline_corrected, place) = self.places[kind];
        let corrected = self.baseline_corrected.as_ref().filter(|_| is_baseline_corrected);
        corrected.map_or(&self.absolute, |corrected| &corrected.sliding).span(place)
    }

    /// Clears all samples and the baseline, for another mode or specimen.
    pub(crate) fn clear(&mut self) {
        self.spreads.clear();
        self.absolute.clear();
        if let Some(baseline_corrected) = &mut self.baseline_corrected {
            baseline_corrected.baseline.clear();
            baseline_corrected.sliding.clear();
        }
    }

    /// Returns the complete state.
    pub(crate) fn store(&self) -> Stored {
        let baseline_corrected =
            self.baseline_corrected.as_ref().map(|baseline_corrected| StoredBaselineCorrected {
                baseline: baseline_corrected.baseline.store(),
                windows: baseline_corrected.sliding.store(),
            });
        let (twin, absolute) = (self.spreads.store(), self.absolute.store());
        Stored { twin, absolute, baseline_corrected }
    }

    /// Restores the state of the same kinds.
    ///
    /// # Errors
    /// As [`Spreads::restore`], [`Sliding::restore`] and [`Baseline::restore`].
    pub(crate) fn restore(&mut self, stored: &Stored) -> Result<(), Error> {
        self.spreads.restore(&stored.twin)?;
        self.absolute.restore(&stored.absolute)?;
        match (&mut self.baseline_corrected, &stored.baseline_corrected) {
            (None, None) => Ok(()),
            (Some(own), Some(stored)) => {
                own.baseline.restore(&stored.baseline)?;
                own.sliding.restore(&stored.windows)
            }
            _ => Err(Error::CorruptModel { broken: "a stored state has another reference" }),
        }
    }
}

impl BaselineCorrected {
    fn add(&mut self, sample: &WindowSample, divided: DividedSample) -> bool {
        let is_settled = self.baseline.is_settled();
        if !is_settled || sample.is_trusted {
            self.baseline.learn(divided.judged, divided.twin, divided.scales);
        }
        if !is_settled {
            return false;
        }
        self.baseline.subtract(divided.judged, sample.stands_in, &mut self.judged);
        self.sliding.add(&DividedSample { judged: &self.judged, ..divided })
    }
}
