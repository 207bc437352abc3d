//! How well a fit knows each unknown, in numbers and in words.
//!
//! With information I = JᵀJ and the prior Q, the covariance of the unknowns is C = (I + Q)⁻¹. Its diagonal gives
//! standard errors, its off-diagonal elements trade-offs. An unknown whose error stays near its prior's is *not seen*
//! if the error stays so even with all others known; otherwise it *trades off*.

use super::linear::Symmetric;
use super::response::Linear;
use super::unknown::Unknown;

/// Above this fraction of the prior's deviation, an unknown is not well known.
const WELL_KNOWN: f64 = 0.5;
/// Above this fraction, the record has no information about the unknown.
const NOT_SEEN: f64 = 0.95;
/// Distance within which a bound counts as reached, in standard deviations.
const AT_BOUND: f64 = 1e-6;
/// Below this correlation, an unknown does not trade off against a single other one.
const TRADES: f64 = 0.5;

/// How well an unknown is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Knowledge {
    /// The record determines it.
    Known,
    /// The record narrows it by less than half.
    Partly,
    /// It is known only together with another one: both can change together without effect.
    TradesOff {
        /// The other unknown.
        with: usize,
        /// The correlation of their errors.
        correlation: f64,
    },
    /// The record does not show it: it is no better known than before.
    NotSeen,
    /// It is at the bound of its range.
    AtBound,
}

/// The knowledge about all unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct FitKnowledge {
    /// The covariance of the unknowns.
    pub(super) covariance: Symmetric,
    /// The verdict for each unknown.
    pub(super) each: Vec<Knowledge>,
}

impl FitKnowledge {
    /// From the information of the records and the values of the unknowns; `None` if an unknown without a prior is not
    /// determined at all.
    pub(super) fn new(unknowns: &[Unknown], z: &[f64], linear: &Linear) -> Option<Self> {
        let covariance = linear.curvature.inverse()?;
        let is_at_bound = |k: usize| {
            let (low, high) = unknowns[k].range;
            z[k] - low < AT_BOUND || high - z[k] < AT_BOUND
        };
        let knowledge = |k: usize| match is_at_bound(k) {
            true => Knowledge::AtBound,
            false => judged(k, &linear.curvature, &covariance),
        };
        let each = (0..z.len()).map(knowledge).collect();
        Some(Self { each, covariance })
    }

    /// The standard error of an unknown.
    pub fn error(&self, unknown: usize) -> f64 {
        self.covariance.at(unknown, unknown).sqrt()
    }

    /// A sentence about how well a source, `record` or `flight`, determines an unknown.
    pub fn sentence(&self, source: &str, unknowns: &[Unknown], k: usize) -> String {
        match self.each[k] {
            Knowledge::Known => format!("well known from the {source}"),
            Knowledge::Partly => {
                format!("partly known: the {source} narrows its tolerance, by less than half")
            }
            Knowledge::NotSeen => {
                format!("not seen in this {source}: only its tolerance limits it")
            }
            Knowledge::AtBound => "stands at the bound of its tolerance".into(),
            Knowledge::TradesOff { with, correlation } => format!(
                "trades off against {} (correlation {correlation:.2}): only together are they known",
                unknowns[with].name
            ),
        }
    }
}

/// How well an unknown is known, relative to its prior's deviation of 1.
fn judged(k: usize, curvature: &Symmetric, covariance: &Symmetric) -> Knowledge {
    let error = covariance.at(k, k).sqrt();
    let alone = curvature.at(k, k).sqrt().recip();
    if error <= WELL_KNOWN {
        return Knowledge::Known;
    }
    let correlation =
        |other: usize| covariance.at(k, other) / (error * covariance.at(other, other).sqrt());
    let others = (0..covariance.size).filter(|&other| other != k);
    let strongest = others.map(|with| (with, correlation(with)));
    let strongest = strongest.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    match strongest.filter(|(_, correlation)| correlation.abs() >= TRADES) {
        Some((with, correlation)) if alone <= WELL_KNOWN => {
            Knowledge::TradesOff { with, correlation }
        }
        _ if error > NOT_SEEN => Knowledge::NotSeen,
        _ => Knowledge::Partly,
    }
}
