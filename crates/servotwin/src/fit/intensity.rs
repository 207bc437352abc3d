//! How strong a fault is: its intensity as one more unknown beside the tolerances, with an interval;
//! and which of several candidates it is, by their likelihood.
//!
//! (FN1)  ln p(record | fault) ≈ −F − ½ ln det A + const
//!
//! F and A of the fit with this fault: how well it explains the record, and how much it had to be tuned
//! for it. The candidates' shares sum to one; that none of them is right is not among them.

use super::unknown::Unknown;
use super::{FitError, Fitted, Problem};

/// 95 % of a normal distribution lie within so many deviations.
const NORMAL_95: f64 = 1.96;
/// The intensities from which a fit may begin: the likeliest of them is the first guess.
const FIRST_GUESSES: [f64; 8] = [0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9];

/// A fault as a record shows it.
#[derive(Clone, Debug)]
pub struct Diagnosed {
    /// The fault: (component, fault).
    pub fault: (usize, usize),
    /// Its full name.
    pub name: String,
    /// Its intensity.
    pub intensity: f64,
    /// The interval that holds it with 95 %.
    pub interval: (f64, f64),
    /// (FN1).
    pub log_likelihood: f64,
    /// Its share among the candidates.
    pub probability: f64,
    /// The whole fit, the fault's intensity last.
    pub fitted: Fitted,
}

/// Estimates the intensity of every candidate, the likeliest first.
///
/// # Errors
/// As [`Problem::solve`]; a candidate with which the twin cannot be simulated.
pub fn intensity(
    problem: &Problem,
    candidates: &[(usize, usize)],
) -> Result<Vec<Diagnosed>, FitError> {
    let each = candidates.iter().map(|&fault| of_candidate(problem, fault));
    let mut all = each.collect::<Result<Vec<_>, _>>()?;
    let most = all.iter().map(|one| one.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = all.iter().map(|one| (one.log_likelihood - most).exp()).sum();
    for one in &mut all {
        one.probability = (one.log_likelihood - most).exp() / sum;
    }
    all.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
    Ok(all)
}

fn of_candidate(problem: &Problem, fault: (usize, usize)) -> Result<Diagnosed, FitError> {
    let unknown = Unknown::fault(problem.system, fault.0, fault.1);
    let name = unknown.name.clone();
    let unknowns: Vec<Unknown> = problem.unknowns.iter().cloned().chain([unknown]).collect();
    let priors: Vec<f64> = unknowns.iter().map(|unknown| unknown.prior).collect();
    let own =
        Problem { unknowns, records: problem.records.clone(), suspects: Vec::new(), ..*problem };
    let last = priors.len() - 1;
    let point = |intensity: &f64| {
        let mut z = vec![0.0; priors.len()];
        z[last] = *intensity;
        z
    };
    let points: Vec<Vec<f64>> = FIRST_GUESSES.iter().map(point).collect();
    let found = own.residuals(&points)?;
    let mut first = (f64::INFINITY, points[0].clone());
    for (point, found) in points.into_iter().zip(found) {
        let cost = found.map_or(f64::INFINITY, |residuals| own.cost(&point, &residuals));
        if cost < first.0 {
            first = (cost, point);
        }
    }
    let minimum = own.minimum(&first.1)?;
    let curvature = minimum.linear.information.plus_diagonal(&priors);
    let volume: f64 = curvature.eigen().iter().map(|(value, _)| value.max(1e-12).ln()).sum();
    let fitted = own.judged(minimum)?;
    let (z, error) = (fitted.z[last], fitted.known.error(last));
    let ends = [z - NORMAL_95 * error, z + NORMAL_95 * error].map(|end| end.clamp(0.0, 1.0));
    Ok(Diagnosed {
        fault,
        name,
        intensity: z,
        interval: (ends[0], ends[1]),
        log_likelihood: -fitted.cost - 0.5 * volume,
        probability: 0.0,
        fitted,
    })
}
