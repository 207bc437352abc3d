//! The panel joins bands, the nine trees and the committee into one answer.
//!
//! While every residual stays in its band, the answer is healthy. Otherwise the trees give the explainable answer. If
//! the committee chooses another actuator or action, or its confidence is too low, the fault counts as detected but not
//! isolated.

use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::error::{Error, require_sound};
use crate::hierarchy::{Diagnosis, Hierarchy, Scratch};

/// The tolerance band of one residual.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorBand {
    /// Name of the sensor.
    pub sensor: String,
    /// Half width, in parts of the sensor's scale.
    pub half_width: f64,
}

/// Bands, trees and committee, a part of a stored diagnoser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Panel {
    /// One band for each watched sensor.
    pub bands: Vec<SensorBand>,
    /// Minimum confidence of the committee for an answer; `None` for no minimum.
    pub least_confidence: Option<f64>,
    /// The nine trees.
    pub trees: Hierarchy,
    /// Boosted trees at the same places, calibrated.
    pub committee: Hierarchy,
}

/// The rule of the committee: trees and committee choose the same fault, and the committee's confidence reaches the
/// minimum, if there is one.
pub fn agree<T: PartialEq>(
    trees: T,
    committee: T,
    confidence: f64,
    least_confidence: Option<f64>,
) -> bool {
    trees == committee && least_confidence.is_none_or(|least| confidence >= least)
}

/// The answer of a panel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PanelVerdict {
    /// Every residual is in its band, or trees and committee agree that there is no fault.
    Healthy,
    /// A residual left its band, but trees and committee do not isolate a fault. Holds the committee's answer.
    NotIsolated(Diagnosis),
    /// Trees and committee agree on actuator and action.
    Isolated(Diagnosis),
}

impl Panel {
    /// Whether a residual left its band. `largest` holds the largest magnitude of each watched residual, in parts of
    /// scale.
    pub fn is_detected(&self, largest: &[f64]) -> bool {
        largest.iter().zip(&self.bands).any(|(size, band)| *size > band.half_width)
    }

    /// Judges a row, given in every view.
    ///
    /// # Errors
    /// As [`Hierarchy::diagnose`].
    pub fn diagnose<V: AsRef<[f64]>>(
        &self,
        largest: &[f64],
        views: &[V],
        scratch: &mut [Scratch; 2],
    ) -> Result<PanelVerdict, Error> {
        if !self.is_detected(largest) {
            return Ok(PanelVerdict::Healthy);
        }
        let [of_trees, of_committee] = scratch;
        let trees = self.trees.diagnose(views, of_trees)?;
        let committee = self.committee.diagnose(views, of_committee)?;
        let confidence = committee.confidence;
        Ok(
            match agree(
                trees.actuator_and_action(),
                committee.actuator_and_action(),
                confidence,
                self.least_confidence,
            ) {
                true if committee.actuator.is_none() => PanelVerdict::Healthy,
                true => PanelVerdict::Isolated(Diagnosis { confidence, ..trees }),
                false => PanelVerdict::NotIsolated(committee),
            },
        )
    }

    /// Allocates the memory for [`Panel::diagnose`].
    pub fn scratch(&self) -> [Scratch; 2] {
        [self.trees.scratch(), self.committee.scratch()]
    }

    /// Checks that the parts of a loaded panel fit together.
    ///
    /// # Errors
    /// [`Error::CorruptModel`] and the errors of [`Hierarchy::check`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        require_sound(
            self.trees.names == self.committee.names,
            "trees and committee read other features",
        )?;
        let sound = |band: &SensorBand| band.half_width.is_finite() && band.half_width >= 0.0;
        require_sound(self.bands.iter().all(sound), "a band is negative or not finite")?;
        self.trees.check()?;
        self.committee.check()
    }
}
