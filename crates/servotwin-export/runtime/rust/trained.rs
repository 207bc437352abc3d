//! The types of everything that was trained or configured. [`tables`](crate::tables) holds the values.

use crate::models::Hierarchy;

/// A sensor.
pub struct Sensor {
    /// Scale of its residual, SI.
    pub scale: f64,
    /// Standard deviation of a sample, parts of scale.
    pub noise: f64,
    /// That of a value that stands in for it.
    pub stand_in_noise: f64,
    pub actuator: Option<u8>,
}

/// The plausible values of an input, SI.
pub struct Input {
    pub least: f64,
    pub largest: f64,
    /// Samples with the same bits after which it is frozen; 0 for no limit.
    pub frozen_after: u32,
}

/// The plausible values of a difference of two inputs, SI.
pub struct Difference {
    pub of: usize,
    pub minus: usize,
    pub least: f64,
    pub largest: f64,
}

/// Corresponding sensors of two actuators.
pub struct CommonPair {
    pub first: usize,
    pub second: usize,
    pub of_first: &'static [u8],
    pub of_second: &'static [u8],
}

/// The ranges of the features of a class in training; empty for a class without rows.
pub struct Known {
    pub lows: &'static [f64],
    pub highs: &'static [f64],
    pub widths: &'static [f64],
    pub limit: f64,
}

/// What a wrong reading of an input does to the sensors of its actuator, in parts of scale for one SI unit.
pub struct Boundary {
    pub input: usize,
    /// The sensor next to the boundary, and its change.
    pub sensor: usize,
    pub own_change: f64,
    pub sensors: &'static [u8],
    pub changes: &'static [f64],
}

/// Which window lengths share samples.
pub struct StreamPlan {
    pub base_samples: u32,
    /// Places of the lengths among all.
    pub places: &'static [u8],
}

/// The length of a window.
pub struct Span {
    pub pane_samples: u32,
    pub panes: usize,
}

/// A window length with its models and limits.
pub struct Length {
    pub span: Span,
    /// Share of the newest pane in the window.
    pub share: f64,
    pub views: usize,
    /// Half widths, parts of scale.
    pub bands: &'static [f64],
    pub trees: &'static Hierarchy,
    /// Boosted trees.
    pub committee: &'static Hierarchy,
    pub least_confidence: f64,
    /// Healthy, then the actions.
    pub known: &'static [Known],
    /// Weight of the evidence of a window.
    pub weight: f64,
    /// For each hypothesis against each other, nats.
    pub limits: &'static [f64],
    pub allowances: &'static [f64],
    /// nats
    pub limit_of_change: f64,
    pub allowance: f64,
    pub allowed_change: f64,
    /// Evidence of a novel window for an unknown change, and of any other, nats.
    pub novel_nats: f64,
    pub known_nats: f64,
}

/// The constants of the decision.
pub struct Constants {
    pub period_s: f64,
    pub least_on: usize,
    pub clip_nats: f64,
    pub evidence_cap: f64,
    pub in_band_nats: f64,
    pub in_band_share: f64,
    pub pending_share: f64,
    pub least_detail_confidence: f64,
    pub max_common_mode: f64,
    pub most_lost: f64,
    pub recover_samples: u64,
    pub settle_samples: u32,
    pub until_lost_samples: u32,
    pub until_back_samples: u32,
    pub fault_needed_nats: f64,
    pub boundary_memory_s: f64,
    /// Part that a sample forgets of the healthy line.
    pub healthy_forgotten: f64,
    /// 1 over the variance of the slopes of healthy lines.
    pub information_of_lines: f64,
    /// Parts of scale.
    pub largest_boundary_error: f64,
}
