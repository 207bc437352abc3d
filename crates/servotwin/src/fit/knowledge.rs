//! How well a fit knows each unknown, in numbers and in words.
//!
//! With information I = JᵀJ and the prior Q, the covariance of the unknowns is C = (I + Q)⁻¹. Its diagonal gives
//! standard errors, its off-diagonal elements trade-offs. An unknown whose error stays near its prior's is *not seen*
//! if the error stays so even with all others known; otherwise it *trades off*. If another unknown is at its bound, C
//! without that unknown shows how much knowledge comes only from the bound.

use super::linear::Symmetric;
use super::unknown::{Moved, Unknown};

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
pub enum Knowledge {
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
    /// It looks well known, but only because another one is at its bound.
    KnownByBound {
        /// The other unknown.
        with: usize,
    },
}

/// A direction in the space of unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// The records' information along it, relative to the prior's.
    pub information: f64,
    /// The unit vector, in standard deviations of the tolerances.
    pub weights: Vec<f64>,
}

/// The knowledge about all unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct FitKnowledge {
    /// The covariance of the unknowns.
    pub covariance: Symmetric,
    /// The verdict for each unknown.
    pub each: Vec<Knowledge>,
    /// The directions, best known first.
    pub directions: Vec<Direction>,
}

impl FitKnowledge {
    /// From the information of the records and the values of the unknowns; `None` if an unknown without a prior is not
    /// determined at all.
    pub(crate) fn new(unknowns: &[Unknown], z: &[f64], information: &Symmetric) -> Option<Self> {
        let priors: Vec<f64> = unknowns.iter().map(|unknown| unknown.prior).collect();
        let curvature = information.plus_diagonal(&priors);
        let covariance = curvature.inverse()?;
        let at_bound = |k: usize| {
            let (low, high) = unknowns[k].range;
            z[k] - low < AT_BOUND || high - z[k] < AT_BOUND
        };
        let free: Vec<usize> = (0..z.len()).filter(|&k| !at_bound(k)).collect();
        let held: Vec<usize> = (0..z.len()).filter(|&k| at_bound(k)).collect();
        let without = curvature.part(&free).inverse()?;
        let of = |k: usize| match free.iter().position(|&other| other == k) {
            None => Knowledge::AtBound,
            Some(place) => {
                let held_error = without.at(place, place).sqrt();
                judged(unknowns, &curvature, &covariance, k, &held, held_error)
            }
        };
        let each = (0..z.len()).map(of).collect();
        let directions = information.eigen().into_iter();
        let directions =
            directions.map(|(value, weights)| Direction { information: value.max(0.0), weights });
        Some(Self { each, directions: directions.collect(), covariance })
    }

    /// The standard error of an unknown.
    pub fn error(&self, unknown: usize) -> f64 {
        self.covariance.at(unknown, unknown).sqrt()
    }

    /// The correlation of the errors of two unknowns.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        self.covariance.at(a, b) / (self.error(a) * self.error(b))
    }

    /// A sentence about how well a record determines an unknown.
    pub fn sentence(&self, unknowns: &[Unknown], k: usize) -> String {
        self.sentence_of("record", unknowns, k)
    }

    /// The same sentence about a planned flight.
    pub fn forecast(&self, unknowns: &[Unknown], k: usize) -> String {
        self.sentence_of("flight", unknowns, k)
    }

    fn sentence_of(&self, source: &str, unknowns: &[Unknown], k: usize) -> String {
        let name = |k: usize| unknowns[k].name.as_str();
        match &self.each[k] {
            Knowledge::Known => format!("well known from the {source}"),
            Knowledge::Partly => {
                format!("partly known: the {source} narrows its tolerance, by less than half")
            }
            Knowledge::NotSeen => {
                format!("not seen in this {source}: only its tolerance limits it")
            }
            Knowledge::AtBound => "stands at the bound of its tolerance".into(),
            Knowledge::TradesOff { with, correlation } => {
                let name = name(*with);
                format!(
                    "trades off against {name} (correlation {correlation:.2}): only together are they known"
                )
            }
            Knowledge::KnownByBound { with } => {
                format!("looks well known only because {} stands at its bound", name(*with))
            }
        }
    }
}

/// How well an unknown is known. `held_error` is its standard error with the unknowns at bounds held there.
fn judged(
    unknowns: &[Unknown],
    curvature: &Symmetric,
    covariance: &Symmetric,
    k: usize,
    held: &[usize],
    held_error: f64,
) -> Knowledge {
    let error = covariance.at(k, k).sqrt();
    let alone = curvature.at(k, k).sqrt().recip();
    // A fault has no prior knowledge: its whole range is the measure.
    let prior = match unknowns[k].moved {
        Moved::Parameters { .. } => unknowns[k].prior.sqrt().recip(),
        Moved::Fault(..) => 0.5,
    };
    let correlation =
        |other: usize| covariance.at(k, other) / (error * covariance.at(other, other).sqrt());
    let strongest = |among: &mut dyn Iterator<Item = usize>| {
        let others = among.filter(|&other| other != k);
        others.max_by(|&a, &b| correlation(a).abs().total_cmp(&correlation(b).abs()))
    };
    if error <= WELL_KNOWN * prior {
        return Knowledge::Known;
    }
    if held_error <= WELL_KNOWN * prior
        && let Some(with) = strongest(&mut held.iter().copied())
    {
        return Knowledge::KnownByBound { with };
    }
    if alone <= WELL_KNOWN * prior {
        let trades = |with: &usize| correlation(*with).abs() >= TRADES;
        if let Some(with) = strongest(&mut (0..unknowns.len())).filter(trades) {
            return Knowledge::TradesOff { with, correlation: correlation(with) };
        }
    }
    if error > NOT_SEEN * prior { Knowledge::NotSeen } else { Knowledge::Partly }
}
