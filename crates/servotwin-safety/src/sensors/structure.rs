//! Structural isolability: which faults no classifier could separate with a set of sensors.
//!
//! A run becomes a point: mean, deviation and gain of the residual of every kept sensor. Healthy specimens of a case
//! scatter around their mean with covariance Σ, by sensor noise and tolerances. Points are whitened by Σ, so that one
//! unit is one standard deviation of a specimen in every direction. D holds the inverse deviations of the columns:
//!
//! ```text
//! w = Λ^(-1/2) Vᵀ D (z − mean of healthy runs of the case),   D Σ D = V Λ Vᵀ       (1)
//! ```
//!
//! The runs of a fault in a case, from the weakest to the strongest, form a polyline that begins at the healthy mean:
//! what the fault can look like at any intensity. A run is *within the noise* of another fault if noise alone explains
//! its distance d to some segment of that fault's polyline. The run has the unit covariance, and the point at share t
//! of a segment between two runs has ((1 − t)² + t²) times that. So the test in a space of m dimensions is
//!
//! ```text
//! d² / (1 + (1 − t)² + t²) ≤ χ²(m) at 95 %                                      (2)
//! ```
//!
//! It is made in the whole space, and in the plane of the two faults' strongest runs, where it has the most power.
//! Both must call the run alike.
//!
//! Σ is estimated with n degrees of freedom in p dimensions; dividing by n − p − 1 instead of n makes its inverse
//! unbiased (Anderson, An Introduction to Multivariate Statistical Analysis, 2003, section 7.7). χ² is that of Wilson
//! and Hilferty (Proceedings of the National Academy of Sciences 17, 1931), within 1 % from 2 dimensions on.
//!
//! A faulty plant scatters at least as much as a healthy one, so the test finds too few faults alike rather than too
//! many. A record holds more than these numbers, and a classifier with other features may separate more.

use super::candidates::{Candidates, SensorMask};
use super::runs::{FaultClass, SensorRuns};
use servotwin::fit::linear::Symmetric;
use std::collections::BTreeMap;

/// The 95 % quantile of the normal distribution.
const NORMAL_QUANTILE: f64 = 1.644_853_627;

/// The feature families of mean, deviation and gain.
const FAMILIES: [&str; 3] = ["moments", "deviation", "gain"];

/// Directions in which standardized columns have less variance are rounding.
const LEAST_VARIANCE: f64 = 1e-12;

/// The least part of a vector that is not rounding.
const LEAST_PART: f64 = 1e-12;

/// For every judged fault, the faults within whose noise it is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Isolability {
    /// For each of [`SensorRuns::faults`], the other faults that look like it, ascending.
    pub alike: Vec<Vec<FaultClass>>,
}

impl Isolability {
    /// Whether a group of at most `size` faults holds all that look like a run.
    pub(crate) fn is_isolable(&self, run: usize, size: usize) -> bool {
        self.alike[run].len() < size
    }
}

/// Compares every judged fault with all others; `None` without enough healthy specimens.
pub(crate) fn isolability(
    runs: &SensorRuns,
    candidates: &Candidates,
    set: SensorMask,
) -> Option<Isolability> {
    let columns = residual_columns(runs, candidates, set);
    let whitening = Whitening::new(runs, &columns)?;
    let curves = Curves::new(runs, &columns, &whitening);
    let alike = runs.faults().into_iter().map(|row| curves.alike(runs, row)).collect();
    Some(Isolability { alike })
}

/// The columns of mean, deviation and gain of every kept sensor.
fn residual_columns(runs: &SensorRuns, candidates: &Candidates, set: SensorMask) -> Vec<usize> {
    let mut columns = runs.columns_of(candidates, set);
    columns.retain(|&column| FAMILIES.contains(&runs.data.features[column].family));
    columns
}

/// The value of χ² that noise in so many dimensions exceeds with the probability 5 %.
fn chi_squared(dimensions: usize) -> f64 {
    let (m, part) = (dimensions as f64, 2.0 / (9.0 * dimensions as f64));
    m * (1.0 - part + NORMAL_QUANTILE * part.sqrt()).powi(3)
}

/// Equation (1).
struct Whitening {
    /// For each case, the mean of the healthy runs.
    means: BTreeMap<u32, Vec<f64>>,
    /// Unit directions, divided by the deviation along them.
    directions: Vec<Vec<f64>>,
}

impl Whitening {
    /// `None` if there are too few healthy specimens for a covariance.
    fn new(runs: &SensorRuns, columns: &[usize]) -> Option<Self> {
        let mut cases: BTreeMap<u32, Vec<Vec<f64>>> = BTreeMap::new();
        let healthy = runs.healthy();
        for &row in &healthy {
            cases.entry(runs.data.rows[row].case).or_default().push(point(runs, columns, row));
        }
        let size = columns.len();
        let freedoms = healthy.len().checked_sub(cases.len() + size + 1).filter(|&n| n > 0)?;
        let mean = |points: &Vec<Vec<f64>>| -> Vec<f64> {
            let sum = |place: usize| points.iter().map(|point| point[place]).sum::<f64>();
            (0..size).map(|place| sum(place) / points.len() as f64).collect()
        };
        let means: BTreeMap<u32, Vec<f64>> =
            cases.iter().map(|(case, points)| (*case, mean(points))).collect();
        let centered: Vec<Vec<f64>> = cases
            .iter()
            .flat_map(|(case, points)| points.iter().map(|point| difference(point, &means[case])))
            .collect();
        let covariance = |row: usize, column: usize| {
            let sum: f64 = centered.iter().map(|point| point[row] * point[column]).sum();
            sum / freedoms as f64
        };
        // Columns have different units, so rounding is measured in their deviations. A constant column has no information.
        let inverse = |variance: f64| if variance > 0.0 { 1.0 / variance.sqrt() } else { 0.0 };
        let scales: Vec<f64> =
            (0..size).map(|column| inverse(covariance(column, column))).collect();
        let correlation = Symmetric::new(size, |row, column| {
            scales[row] * scales[column] * covariance(row, column)
        });
        let kept =
            correlation.eigen().into_iter().filter(|(variance, _)| *variance > LEAST_VARIANCE);
        let scaled = |(variance, direction): (f64, Vec<f64>)| {
            direction
                .iter()
                .zip(&scales)
                .map(|(part, scale)| part * scale / variance.sqrt())
                .collect()
        };
        Some(Whitening { means, directions: kept.map(scaled).collect() })
    }

    fn apply(&self, case: u32, point: &[f64]) -> Option<Vec<f64>> {
        let centered = difference(point, self.means.get(&case)?);
        Some(self.directions.iter().map(|direction| dot(direction, &centered)).collect())
    }
}

/// A polyline of whitened points in each case.
type CaseCurves = BTreeMap<u32, Vec<(FaultClass, Vec<Vec<f64>>)>>;

/// What every fault looks like in every case.
struct Curves {
    points: BTreeMap<usize, Vec<f64>>,
    of_case: CaseCurves,
}

impl Curves {
    fn new(runs: &SensorRuns, columns: &[usize], whitening: &Whitening) -> Self {
        let mut rows = runs.faults();
        let key = |&row: &usize| {
            let own = &runs.data.rows[row];
            (own.case, runs.class(row), own.intensity)
        };
        rows.sort_by_key(key);
        let mut points = BTreeMap::new();
        let mut of_case = CaseCurves::new();
        for row in rows {
            let case = runs.data.rows[row].case;
            let Some(own) = whitening.apply(case, &point(runs, columns, row)) else { continue };
            let curves = of_case.entry(case).or_default();
            if curves.last().is_none_or(|(class, _)| *class != runs.class(row)) {
                curves.push((runs.class(row), vec![vec![0.0; own.len()]]));
            }
            if let Some((_, curve)) = curves.last_mut() {
                curve.push(own.clone());
            }
            points.insert(row, own);
        }
        Curves { points, of_case }
    }

    /// The faults within whose noise a run is.
    fn alike(&self, runs: &SensorRuns, row: usize) -> Vec<FaultClass> {
        let class = runs.class(row);
        let curves = self.of_case.get(&runs.data.rows[row].case);
        let own = curves.and_then(|curves| curves.iter().find(|(known, _)| *known == class));
        let (Some(point), Some(curves), Some((_, own))) = (self.points.get(&row), curves, own)
        else {
            return vec![];
        };
        let is_alike = |other: &[Vec<f64>]| {
            is_near(point, other) && {
                let plane = basis(own.last().into_iter().chain(other.last()));
                let flat: Vec<Vec<f64>> = other.iter().map(|end| within(&plane, end)).collect();
                is_near(&within(&plane, point), &flat)
            }
        };
        let others = curves.iter().filter(|(known, _)| *known != class);
        others.filter(|(_, other)| is_alike(other)).map(|(known, _)| *known).collect()
    }
}

/// Whether a point is within the noise of a polyline.
fn is_near(point: &[f64], curve: &[Vec<f64>]) -> bool {
    let limit = chi_squared(point.len());
    curve.windows(2).any(|ends| scaled_distance(point, &ends[0], &ends[1]) <= limit)
}

/// The left side of equation (2) for the nearest point of a segment.
fn scaled_distance(point: &[f64], from: &[f64], to: &[f64]) -> f64 {
    let (mut along, mut both, mut offset) = (0.0, 0.0, 0.0);
    for ((point, from), to) in point.iter().zip(from).zip(to) {
        let (a, o) = (to - from, point - from);
        along += a * a;
        both += a * o;
        offset += o * o;
    }
    let share = if along > 0.0 { (both / along).clamp(0.0, 1.0) } else { 0.0 };
    let squared = offset - 2.0 * share * both + share * share * along;
    squared / (1.0 + (1.0 - share).powi(2) + share.powi(2))
}

/// Orthogonal unit directions of the space that points span (Gram and Schmidt).
fn basis<'p>(points: impl Iterator<Item = &'p Vec<f64>>) -> Vec<Vec<f64>> {
    let mut found: Vec<Vec<f64>> = vec![];
    for point in points {
        let mut rest = point.clone();
        for direction in &found {
            let along = dot(direction, &rest);
            rest.iter_mut().zip(direction).for_each(|(rest, part)| *rest -= along * part);
        }
        let length = dot(&rest, &rest).sqrt();
        if length > LEAST_PART * dot(point, point).sqrt() {
            found.push(rest.into_iter().map(|part| part / length).collect());
        }
    }
    found
}

/// The coordinates of a point in a space.
fn within(basis: &[Vec<f64>], point: &[f64]) -> Vec<f64> {
    basis.iter().map(|direction| dot(direction, point)).collect()
}

fn point(runs: &SensorRuns, columns: &[usize], row: usize) -> Vec<f64> {
    let mut values = vec![0.0; runs.data.features.len()];
    runs.data.examples.row_into(0, row, &mut values);
    columns.iter().map(|&column| values[column]).collect()
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_is_that_of_tables() {
        for (dimensions, value) in [(2, 5.991), (10, 18.307), (60, 79.082)] {
            let found = chi_squared(dimensions);
            assert!((found / value - 1.0).abs() < 0.01, "{dimensions}: {found}");
        }
    }

    #[test]
    fn the_noise_of_both_points_scales_the_distance() {
        // Beside the middle of a segment the variance is 1 + 1/4 + 1/4, beyond an end it is 2.
        let (from, to) = ([0.0, 0.0], [10.0, 0.0]);
        assert!((scaled_distance(&[5.0, 3.0], &from, &to) - 9.0 / 1.5).abs() < 1e-12);
        assert!((scaled_distance(&[13.0, 4.0], &from, &to) - 25.0 / 2.0).abs() < 1e-12);
        assert!((scaled_distance(&[3.0, 4.0], &from, &from) - 25.0 / 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_plane_keeps_distances_within_it() {
        let points = [vec![3.0, 0.0, 4.0], vec![0.0, 2.0, 0.0]];
        let plane = basis(points.iter());
        let flat = within(&plane, &[3.0, 2.0, 4.0]);
        assert!((dot(&flat, &flat) - 29.0).abs() < 1e-12 && plane.len() == 2);
        assert_eq!(basis([&points[0], &points[0]].into_iter()).len(), 1);
    }
}
