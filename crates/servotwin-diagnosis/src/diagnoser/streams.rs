//! The windows of all lengths, of uncorrected and of baseline-corrected residuals.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Diagnoser;
use crate::baseline::{self, Baseline};
use crate::error::Error;
use crate::residual::Window;
use crate::sliding::{self, Sliding, WindowSpan};

/// One sample.
pub(super) struct StreamSample<'s> {
    pub measured: &'s [f64],
    pub twin: &'s [f64],
    pub scales: &'s [f64],
    /// Of the conditional band; empty without one.
    pub half_widths: &'s [f64],
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
    /// The measured values minus the baseline.
    measured: Vec<f64>,
}

/// The windows of all lengths.
#[derive(Debug, Clone)]
pub(super) struct Streams {
    /// For each length, whether it is baseline-corrected, and its index among its kind.
    places: Vec<(bool, usize)>,
    absolute: Sliding,
    baseline_corrected: Option<BaselineCorrected>,
}

/// The stored baseline-corrected part of [`Streams`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredBaselineCorrected {
    baseline: baseline::Stored,
    windows: sliding::Stored,
}

impl Streams {
    /// Empty windows.
    ///
    /// # Errors
    /// As [`Sliding::new`] and [`Baseline::new`]; [`Error::CorruptModel`] for baseline-corrected lengths without a
    /// baseline, or vice versa.
    pub fn new(diagnoser: &Diagnoser) -> Result<Self, Error> {
        let spans = |is_baseline_corrected: bool| -> Vec<WindowSpan> {
            let lengths = diagnoser.lengths.iter();
            lengths
                .filter(|l| l.baseline_corrected.is_some() == is_baseline_corrected)
                .map(|l| l.span)
                .collect()
        };
        let (sensors, watched) = (diagnoser.sensors.len(), diagnoser.watched());
        let absolute = Sliding::new(sensors, watched, &spans(false))?;
        let baseline_corrected = match (diagnoser.baseline, &spans(true)[..]) {
            (None, []) => None,
            (Some(settings), spans @ [_, ..]) => Some(BaselineCorrected {
                baseline: Baseline::new(settings, sensors)?,
                sliding: Sliding::new(sensors, watched, spans)?,
                measured: vec![0.0; sensors],
            }),
            _ => {
                let broken = "a reference and the window lengths beyond it need each other";
                return Err(Error::CorruptModel { broken });
            }
        };
        let mut counts = [0; 2];
        let place = |length: &super::Length| {
            let is_baseline_corrected = length.baseline_corrected.is_some();
            let count = &mut counts[usize::from(is_baseline_corrected)];
            *count += 1;
            (is_baseline_corrected, *count - 1)
        };
        let places = diagnoser.lengths.iter().map(place).collect();
        let has_conditional_band = diagnoser.conditional_band.is_some();
        let absolute =
            if has_conditional_band { absolute.within_a_conditional_band() } else { absolute };
        Ok(Streams { places, absolute, baseline_corrected })
    }

    /// Takes a sample; returns whether it completed a window of any length. Does not allocate.
    pub fn add(&mut self, sample: &StreamSample) -> bool {
        let StreamSample { measured, twin, scales, half_widths, .. } = *sample;
        let has_absolute = self.absolute.add(measured, twin, scales, half_widths);
        let has_relative = self
            .baseline_corrected
            .as_mut()
            .is_some_and(|baseline_corrected| baseline_corrected.add(sample));
        has_absolute || has_relative
    }

    fn of(&self, length: usize) -> (&Sliding, usize) {
        let (is_baseline_corrected, place) = self.places[length];
        let baseline_corrected = self.baseline_corrected.as_ref().filter(|_| is_baseline_corrected);
        (
            baseline_corrected
                .map_or(&self.absolute, |baseline_corrected| &baseline_corrected.sliding),
            place,
        )
    }

    /// Here and below, as the method of the same name of [`Sliding`].
    pub fn has_ended(&self, length: usize) -> bool {
        let (sliding, span) = self.of(length);
        sliding.has_ended(span)
    }

    pub fn is_full(&self, length: usize) -> bool {
        let (sliding, span) = self.of(length);
        sliding.is_full(span)
    }

    pub fn window(&self, length: usize) -> &Window {
        let (sliding, span) = self.of(length);
        sliding.window(span)
    }

    pub fn share_of_newest(&self, length: usize) -> f64 {
        let (sliding, span) = self.of(length);
        sliding.share_of_newest(span)
    }

    /// Clears all samples and the baseline, for another mode or specimen.
    pub fn clear(&mut self) {
        self.absolute.clear();
        if let Some(baseline_corrected) = &mut self.baseline_corrected {
            baseline_corrected.baseline.clear();
            baseline_corrected.sliding.clear();
        }
    }

    pub fn store(&self) -> (sliding::Stored, Option<StoredBaselineCorrected>) {
        let baseline_corrected =
            self.baseline_corrected.as_ref().map(|baseline_corrected| StoredBaselineCorrected {
                baseline: baseline_corrected.baseline.store(),
                windows: baseline_corrected.sliding.store(),
            });
        (self.absolute.store(), baseline_corrected)
    }

    /// Restores the state of the same lengths.
    ///
    /// # Errors
    /// As [`Sliding::restore`].
    pub fn restore(
        &mut self,
        absolute: &sliding::Stored,
        baseline_corrected: Option<&StoredBaselineCorrected>,
    ) -> Result<(), Error> {
        self.absolute.restore(absolute)?;
        match (&mut self.baseline_corrected, baseline_corrected) {
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
    fn add(&mut self, sample: &StreamSample) -> bool {
        let is_settled = self.baseline.is_settled();
        if !is_settled || sample.is_trusted {
            self.baseline.learn(sample.measured, sample.twin, sample.scales);
        }
        if !is_settled {
            return false;
        }
        self.baseline.subtract(sample.measured, sample.stands_in, &mut self.measured);
        self.sliding.add(&self.measured, sample.twin, sample.scales, &[])
    }
}
