//! Repairs within a history: flights before which an intensity dropped.
//!
//! Wear does not heal. Within one wear the level may grow in any way but never drops, so a non-decreasing series
//! explains its flights. A repair begins another such series. With the flights divided into stretches,
//!
//! (FP1)  G = Σ over stretches of min Σ (y − m)²/(s e²),  m non-decreasing within its stretch
//!
//! where e is the standard error of a flight and s scales all errors to the observed scatter. Each m comes from the
//! pool-adjacent-violators algorithm. The stretches minimize G + β (stretches − 1), found by dynamic programming
//! (optimal partitioning: Jackson et al., IEEE Signal Processing Letters 12, 2005).
//!
//! (FP2)  β = 10 + 4 ln n
//!
//! is what a drop must explain. Less than 1 % of histories of 4 to 300 flights without wear then contain a repair
//! (measured by the test below; ongoing wear gives fewer). Two flights confirm a repair. If only the last flight is
//! lower, it is set aside: it may be a repair or a bad fit.

use super::trend::Point;

/// The gain that a repair needs in a history of one flight, ...
const LEAST_GAIN: f64 = 10.0;
/// ... and for each e-fold increase of flights.
const GAIN_PER_LOG: f64 = 4.0;
/// A flight confirms a repair if it lies below the one before it by this many standard errors of the difference.
const LOWER: f64 = 3.0;
/// The standard deviation of a normal distribution relative to its median absolute deviation.
const PER_MEDIAN: f64 = 1.4826;

/// A drop of an intensity that wear does not explain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repair {
    /// The index of the first point after it.
    pub(super) place: usize,
    /// The flight number of that point.
    pub at: f64,
    /// The drop of the level.
    pub fall: f64,
    /// Whether a second flight confirms it.
    pub is_confirmed: bool,
}

/// The repairs in a series, ordered by time. Only the last may be unconfirmed, if it is at the last flight.
pub(super) fn repairs(points: &[Point]) -> Vec<Repair> {
    let errors = scaled_errors(points);
    let starts = starts(points, &errors);
    let repair = |place: usize| Repair {
        place,
        at: points[place].at,
        fall: points[place - 1].level - points[place].level,
        is_confirmed: place + 1 < points.len(),
    };
    starts.into_iter().map(repair).collect()
}

/// Standard errors, scaled to the scatter between flights. The scale is the median deviation of a flight from the mean
/// of its neighbors, which a few repairs do not move.
fn scaled_errors(points: &[Point]) -> Vec<f64> {
    let beside = |three: &[Point]| {
        let share = (three[1].at - three[0].at) / (three[2].at - three[0].at);
        let expected = three[0].level + share * (three[2].level - three[0].level);
        let variance = three[1].error.powi(2)
            + ((1.0 - share) * three[0].error).powi(2)
            + (share * three[2].error).powi(2);
        (three[1].level - expected).abs() / variance.sqrt().max(f64::MIN_POSITIVE)
    };
    let mut sizes: Vec<f64> = points.windows(3).map(beside).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    let scale = (PER_MEDIAN * median).max(1.0);
    points.iter().map(|point| scale * point.error).collect()
}

/// The indices where new stretches begin, by (FP1) and (FP2).
fn starts(points: &[Point], errors: &[f64]) -> Vec<usize> {
    let count = points.len();
    let price = LEAST_GAIN + GAIN_PER_LOG * (count.max(1) as f64).ln();
    // For each number of leading flights: the lowest sum, and where its last stretch begins.
    let mut best = vec![(f64::INFINITY, 0); count + 1];
    best[0] = (-price, 0);
    for start in 0..count {
        if start > 0 && !is_lower(points, errors, start) {
            continue;
        }
        let before = best[start].0 + price;
        for (length, cost) in non_decreasing(&points[start..], &errors[start..]).enumerate() {
            let end = start + length + 1;
            if before + cost < best[end].0 {
                best[end] = (before + cost, start);
            }
        }
    }
    let mut found = Vec::new();
    let mut end = count;
    while end > 0 {
        let start = best[end].1;
        if start > 0 {
            found.push(start);
        }
        end = start;
    }
    found.reverse();
    found
}

/// Whether the two flights from an index on are lower than the one before it; at the end, one flight suffices.
fn is_lower(points: &[Point], errors: &[f64], place: usize) -> bool {
    let before = place - 1;
    (place..points.len().min(place + 2)).all(|after| {
        let error = errors[before].hypot(errors[after]);
        points[before].level - points[after].level > LOWER * error
    })
}

/// For each number of leading points, the least squares of a non-decreasing series (pool adjacent violators).
fn non_decreasing<'p>(
    points: &'p [Point],
    errors: &'p [f64],
) -> impl Iterator<Item = f64> + use<'p> {
    // Each pool has a weight, a mean, and the sum of squares around that mean.
    let mut pools: Vec<[f64; 3]> = Vec::new();
    let mut total = 0.0;
    points.iter().zip(errors).map(move |(point, error)| {
        let mut own = [error.powi(-2), point.level, 0.0];
        while let Some(last) = pools.last().copied().filter(|last| last[1] >= own[1]) {
            pools.pop();
            total -= last[2];
            let weight = last[0] + own[0];
            let apart = last[1] - own[1];
            let squares = last[2] + own[2] + last[0] * own[0] / weight * apart * apart;
            own = [weight, own[1] + last[0] / weight * apart, squares];
        }
        total += own[2];
        pools.push(own);
        total
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::trend::tests::series;

    #[test]
    fn pure_noise_has_a_repair_in_less_than_one_history_of_a_hundred() {
        for (count, histories) in [(4, 2000), (6, 2000), (12, 2000), (50, 1000), (300, 200)] {
            let found = |seed: &u64| !repairs(&series(count, *seed, 0.02, |_| 0.1)).is_empty();
            let with = (0..histories).filter(found).count() as f64;
            assert!(with < 0.01 * histories as f64, "{count} flights: {with} of {histories}");
        }
    }

    #[test]
    fn errors_that_are_too_small_make_no_repairs() {
        let with = (0..500)
            .filter(|&seed| {
                let mut points = series(40, 1000 + seed, 0.03, |n| 0.002 * n);
                points.iter_mut().for_each(|point| point.error = 0.003);
                !repairs(&points).is_empty()
            })
            .count();
        assert!(with < 15, "{with}");
    }

    #[test]
    fn wear_that_grows_faster_or_stands_still_has_no_repair() {
        let shapes: [fn(f64) -> f64; 3] = [
            |n| 0.5 * (n / 100.0).powi(3),
            |n| if n < 50.0 { 0.0 } else { 0.3 },
            |n| 0.3 * (1.0 - (-n / 10.0).exp()),
        ];
        for shape in shapes {
            let found =
                (0..200).filter(|&seed| !repairs(&series(100, seed, 0.01, shape)).is_empty());
            assert_eq!(found.count(), 0);
        }
    }

    #[test]
    fn every_repair_is_found_at_its_flight() {
        let wear = |n: f64| 0.02 * (n % 15.0);
        let found = (0..100).filter(|&seed| {
            let places: Vec<usize> =
                repairs(&series(45, seed, 0.01, wear)).iter().map(|one| one.place).collect();
            places == [15, 30]
        });
        let found = found.count();
        assert!(found >= 97, "{found}");
    }

    #[test]
    fn a_single_flight_that_falls_is_no_repair_and_the_last_one_is_unconfirmed() {
        let mut points = series(20, 3, 0.002, |n| 0.02 * n);
        points[10].level = 0.0;
        assert_eq!(repairs(&points), []);
        points[10].level = 0.2;
        points[19].level = 0.0;
        let found = repairs(&points);
        assert!(matches!(found[..], [Repair { place: 19, is_confirmed: false, .. }]), "{found:?}");
    }
}
