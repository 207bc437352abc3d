//! The windows of all lengths: of residuals as they are, and of what they are beyond a reference.

use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use super::Diagnoser;
use crate::error::Error;
use crate::reference::{self, Reference};
use crate::residual::Window;
use crate::sliding::{self, Sliding, Span};

/// One sample.
pub(super) struct Sample<'s> {
    pub measured: &'s [f64],
    pub twin: &'s [f64],
    pub scales: &'s [f64],
    /// Of the field; empty without one.
    pub half_widths: &'s [f64],
    /// In whose place something stands that looks healthy.
    pub stands_in: &'s [bool],
    /// Whether nothing is suspected, so that the reference may follow.
    pub is_trusted: bool,
}

/// Windows beyond a reference.
#[derive(Debug, Clone)]
struct Relative {
    reference: Reference,
    sliding: Sliding,
    /// The measured values without the reference.
    measured: Vec<f64>,
}

/// The windows of all lengths.
#[derive(Debug, Clone)]
pub(super) struct Streams {
    /// Of each length, whether it is relative and its place among those that are like it.
    places: Vec<(bool, usize)>,
    absolute: Sliding,
    relative: Option<Relative>,
}

/// Stored [`Streams`] beside what the absolute ones are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredRelative {
    reference: reference::Stored,
    windows: sliding::Stored,
}

impl Streams {
    /// Empty windows.
    ///
    /// # Errors
    /// As [`Sliding::new`] and [`Reference::new`]; [`Error::CorruptModel`] where there are relative lengths and no
    /// reference, or the other way round.
    pub fn new(diagnoser: &Diagnoser) -> Result<Self, Error> {
        let spans = |is_relative: bool| -> Vec<Span> {
            let lengths = diagnoser.lengths.iter();
            lengths.filter(|l| l.relative.is_some() == is_relative).map(|l| l.span).collect()
        };
        let (sensors, watched) = (diagnoser.sensors.len(), diagnoser.watched());
        let absolute = Sliding::new(sensors, watched, &spans(false))?;
        let relative = match (diagnoser.reference, &spans(true)[..]) {
            (None, []) => None,
            (Some(settings), spans @ [_, ..]) => Some(Relative {
                reference: Reference::new(settings, sensors)?,
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
            let is_relative = length.relative.is_some();
            let count = &mut counts[usize::from(is_relative)];
            *count += 1;
            (is_relative, *count - 1)
        };
        let places = diagnoser.lengths.iter().map(place).collect();
        let is_in_field = diagnoser.field.is_some();
        let absolute = if is_in_field { absolute.within_a_field() } else { absolute };
        Ok(Streams { places, absolute, relative })
    }

    /// Takes a sample; says whether it brought a window of any length. Does not allocate.
    pub fn add(&mut self, sample: &Sample) -> bool {
        let Sample { measured, twin, scales, half_widths, .. } = *sample;
        let has_absolute = self.absolute.add(measured, twin, scales, half_widths);
        let has_relative = self.relative.as_mut().is_some_and(|relative| relative.add(sample));
        has_absolute || has_relative
    }

    fn of(&self, length: usize) -> (&Sliding, usize) {
        let (is_relative, place) = self.places[length];
        let relative = self.relative.as_ref().filter(|_| is_relative);
        (relative.map_or(&self.absolute, |relative| &relative.sliding), place)
    }

    /// As [`Sliding::has_ended`], here and below.
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

    /// Forgets all samples, and the reference: what comes is another mode, or another specimen.
    pub fn clear(&mut self) {
        self.absolute.clear();
        if let Some(relative) = &mut self.relative {
            relative.reference.clear();
            relative.sliding.clear();
        }
    }

    pub fn store(&self) -> (sliding::Stored, Option<StoredRelative>) {
        let relative = self.relative.as_ref().map(|relative| StoredRelative {
            reference: relative.reference.store(),
            windows: relative.sliding.store(),
        });
        (self.absolute.store(), relative)
    }

    /// Takes over what was stored of the same lengths.
    ///
    /// # Errors
    /// As [`Sliding::restore`].
    pub fn restore(
        &mut self,
        absolute: &sliding::Stored,
        relative: Option<&StoredRelative>,
    ) -> Result<(), Error> {
        self.absolute.restore(absolute)?;
        match (&mut self.relative, relative) {
            (None, None) => Ok(()),
            (Some(own), Some(stored)) => {
                own.reference.restore(&stored.reference)?;
                own.sliding.restore(&stored.windows)
            }
            _ => Err(Error::CorruptModel { broken: "a stored state has another reference" }),
        }
    }
}

impl Relative {
    fn add(&mut self, sample: &Sample) -> bool {
        let is_settled = self.reference.is_settled();
        if !is_settled || sample.is_trusted {
            self.reference.learn(sample.measured, sample.twin, sample.scales);
        }
        if !is_settled {
            return false;
        }
        self.reference.subtract(sample.measured, sample.stands_in, &mut self.measured);
        self.sliding.add(&self.measured, sample.twin, sample.scales, &[])
    }
}
