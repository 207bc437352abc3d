//! Explained actions: whether training rows with an action resemble a new row.
//!
//! A classifier that never saw a kind of fault still answers with one of its classes. The rows of the training set
//! answer a second question: does a known fault with this action lie that far from them?
//!
//! ```text
//! d_a = min over training rows r of action a of |L⁻¹ (x − r)|                (1)
//! action a explains x where d_a ≤ limit                                      (2)
//! ```
//!
//! L is the Cholesky factor of the scatter of the features within one kind of fault at one intensity. Specimens,
//! commands and noise cause that scatter, which is the unit of (1). The limit is the ⌈(1 − α)(n + 1)⌉-th smallest
//! distance of n held-out rows from the training rows of their own action (split conformal prediction: Vovk, Gammerman,
//! Shafer, "Algorithmic Learning in a Random World", 2005; folds instead of one split: Vovk, "Cross-conformal
//! predictors", Annals of Mathematics and Artificial Intelligence 74, 2015). For exchangeable rows, a known fault is not
//! explained by its own action with a probability of about the level α. No limit is tuned.
//!
//! Folds of whole groups are held out in turn. A group is what new rows do not share with the training rows: a command
//! where new commands are judged, one variant where all commands are known. The scatter comes from all training rows, so
//! a held-out row takes part in the metric. With many rows for each feature this matters little.
//!
//! The rows themselves are kept. A session, which cannot, asks for ranges of single features instead ([`crate::novelty`]).

use alloc::vec;
use alloc::vec::Vec;

use crate::hierarchy::Examples;
use crate::numeric::cholesky;
use crate::splits::grouped_k_fold;
use servotwin_diagnosis::error::{Error, require, same_length};
use servotwin_diagnosis::hierarchy::StagePlace;
use servotwin_diagnosis::numeric::{add_scaled, dot};

/// The level α: the share of known rows that their own action does not explain.
pub const LEVEL: f64 = 0.01;

/// The largest number of folds.
const FOLDS: usize = 5;

/// Part of a feature's overall variance that its variance within a cluster gets in addition. It keeps the scatter
/// regular where noise is absent.
const RIDGE: f64 = 1e-3;

/// The features that [`nearest`] adds between two comparisons.
const FEATURES_AT_ONCE: usize = 4;

/// The origins of the rows of examples.
#[derive(Debug, Clone, Copy)]
pub struct Origins<'o> {
    /// For each row of the examples, its kind of fault at its intensity.
    pub clusters: &'o [u32],
    /// For each row of the examples, the group that stays in one fold.
    pub groups: &'o [u32],
}

/// The training rows of every action, in the metric of (1).
#[derive(Debug, Clone, PartialEq)]
pub struct ExplainedActions {
    /// The features in use, as columns of a row.
    columns: Vec<usize>,
    /// Row-major lower triangle of L, square.
    factor: Vec<f64>,
    /// For each action, its training rows multiplied by L⁻¹, row after row.
    rows: Vec<Vec<f64>>,
    /// The largest distance at which an action explains a row; infinite if there were too few held-out rows.
    limit: f64,
}

impl ExplainedActions {
    /// Whether an action explains a row, which holds all features in the actuator's view. NaN explains nothing.
    ///
    /// # Panics
    /// If the row lacks a column, or the action was not known in training.
    pub fn explains(&self, row: &[f64], action: usize) -> bool {
        let mut own: Vec<f64> = self.columns.iter().map(|&column| row[column]).collect();
        whiten(&self.factor, &mut own);
        nearest(&own, &self.rows[action]) <= self.limit
    }
}

/// Learns from faults of a stage that decides the action, at a level between 0 and 1. `None` if there are no rows or no
/// columns.
///
/// # Errors
/// [`Error::LengthMismatch`], [`Error::SettingOutOfRange`], [`Error::NotFinite`].
pub fn learn(
    examples: &Examples,
    place: &StagePlace,
    rows: &[usize],
    origins: Origins,
    level: f64,
) -> Result<Option<ExplainedActions>, Error> {
    same_length("clusters", examples.labels().len(), origins.clusters.len())?;
    same_length("groups", examples.labels().len(), origins.groups.len())?;
    require(level > 0.0 && level < 1.0, "level", level, "between 0 and 1")?;
    let Some((samples, rows)) = examples.samples(place, rows, false)? else { return Ok(None) };
    let size = samples.features();
    let mut table = vec![0.0; rows.len() * size];
    for (row, values) in table.chunks_exact_mut(size).enumerate() {
        samples.row_into(row, values);
    }
    let of_rows = |all: &[u32]| -> Vec<u32> { rows.iter().map(|&row| all[row]).collect() };
    let factor = scatter(&table, size, &of_rows(origins.clusters));
    table.chunks_exact_mut(size).for_each(|row| whiten(&factor, row));
    let labels: Vec<u32> = rows.iter().map(|&row| examples.labels()[row].action).collect();
    let mut known = ExplainedActions {
        columns: examples.columns(place),
        factor,
        rows: vec![vec![]; examples.names().actions.len()],
        limit: limit(&table, size, &labels, &of_rows(origins.groups), level),
    };
    for (row, &action) in table.chunks_exact(size).zip(&labels) {
        known.rows[action as usize].extend_from_slice(row);
    }
    Ok(Some(known))
}

/// The Cholesky factor of the scatter within clusters, with the divisor rows − clusters.
fn scatter(table: &[f64], size: usize, clusters: &[u32]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..clusters.len()).collect();
    order.sort_by_key(|&row| clusters[row]);
    let row = |row: usize| &table[row * size..(row + 1) * size];
    let mut covariance = vec![0.0; size * size];
    let mut freedom = 0;
    for cluster in order.chunk_by(|&a, &b| clusters[a] == clusters[b]) {
        let mean = mean(cluster.iter().map(|&place| row(place)), size);
        for &place in cluster {
            let mut rest = row(place).to_vec();
            add_scaled(&mut rest, -1.0, &mean);
            for feature in 0..size {
                add_scaled(&mut covariance[feature * size..][..size], rest[feature], &rest);
            }
        }
        freedom += cluster.len() - 1;
    }
    covariance.iter_mut().for_each(|sum| *sum /= freedom.max(1) as f64);
    let overall = mean(table.chunks_exact(size), size);
    for feature in 0..size {
        let square =
            |row: &[f64]| (row[feature] - overall[feature]) * (row[feature] - overall[feature]);
        let variance = table.chunks_exact(size).map(square).sum::<f64>() / clusters.len() as f64;
        // A constant feature has distance 0 whatever its scale.
        let ridge = if variance > 0.0 { RIDGE * variance } else { 1.0 };
        covariance[feature * size + feature] += ridge;
    }
    cholesky(&mut covariance, size, |_| 0.0, dot);
    covariance
}

fn mean<'r>(rows: impl ExactSizeIterator<Item = &'r [f64]>, size: usize) -> Vec<f64> {
    let share = 1.0 / rows.len().max(1) as f64;
    let mut mean = vec![0.0; size];
    rows.for_each(|row| add_scaled(&mut mean, share, row));
    mean
}

/// The quantile of the distances of held-out rows; infinite if there are too few of them for the level.
fn limit(table: &[f64], size: usize, labels: &[u32], groups: &[u32], level: f64) -> f64 {
    let mut names = groups.to_vec();
    names.sort_unstable();
    names.dedup();
    let Ok(folds) = grouped_k_fold(groups, FOLDS.min(names.len()), 1) else {
        return f64::INFINITY;
    };
    let row = |row: usize| &table[row * size..(row + 1) * size];
    let mut distances = vec![];
    for fold in &folds {
        let classes = labels.iter().max().map_or(0, |&last| last as usize + 1);
        let mut rows = vec![vec![]; classes];
        fold.train.iter().for_each(|&r| rows[labels[r] as usize].extend_from_slice(row(r)));
        let own = |&r: &usize| nearest(row(r), &rows[labels[r] as usize]);
        distances.extend(fold.test.iter().map(own));
    }
    distances.sort_unstable_by(f64::total_cmp);
    let place = libm::ceil((1.0 - level) * (distances.len() + 1) as f64) as usize;
    distances.get(place.max(1) - 1).copied().unwrap_or(f64::INFINITY)
}

/// Replaces x by L⁻¹ x, with the row-major lower triangle of L.
fn whiten(factor: &[f64], x: &mut [f64]) {
    let size = x.len();
    for place in 0..size {
        let row = &factor[place * size..];
        x[place] = (x[place] - dot(&row[..place], &x[..place])) / row[place];
    }
}

/// The distance to the nearest of several rows, which follow one another; infinite without rows.
fn nearest(x: &[f64], rows: &[f64]) -> f64 {
    let mut least = f64::INFINITY;
    for row in rows.chunks_exact(x.len().max(1)) {
        let mut squared = 0.0;
        for (x, row) in x.chunks(FEATURES_AT_ONCE).zip(row.chunks(FEATURES_AT_ONCE)) {
            x.iter().zip(row).for_each(|(a, b)| squared += (a - b) * (a - b));
            // The sum only grows, so this row is not the nearest.
            if squared >= least {
                break;
            }
        }
        if squared < least {
            least = squared;
        }
    }
    libm::sqrt(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::Label;
    use alloc::format;
    use alloc::string::String;
    use servotwin_diagnosis::hierarchy::{Names, Question};
    use servotwin_diagnosis::random::Random;

    const FEATURES: usize = 6;
    const PLACE: StagePlace =
        StagePlace { question: Question::Action, actuator: None, action: None };

    /// Two kinds of fault whose signatures point along the first two features and grow with the intensity.
    struct Rows {
        examples: Examples,
        clusters: Vec<u32>,
        groups: Vec<u32>,
        all: Vec<usize>,
    }

    fn rows(count: usize, seed: u64) -> Rows {
        let mut random = Random::new(seed);
        let names = Names {
            features: (0..FEATURES).map(|j| format!("f{j}")).collect(),
            actuators: vec![String::from("a")],
            actions: ["shut_down", "warning"].map(String::from).to_vec(),
            details: vec![String::from("d")],
        };
        let action = |row: usize| (row % 2) as u32;
        let intensity = |row: usize| (row / 2 % 10) as u32;
        let labels = (0..count).map(|row| Label { actuator: 0, action: action(row), detail: 0 });
        let mut values = vec![];
        for column in 0..FEATURES {
            let signature = |row: usize| match action(row) as usize == column {
                true => f64::from(1 + intensity(row)),
                false => 0.0,
            };
            values.extend((0..count).map(|row| signature(row) + random.between(-0.3, 0.3)));
        }
        let labels = labels.collect();
        let read = vec![(0..FEATURES).collect()];
        Rows {
            examples: Examples::new(names, read, vec![values], labels).unwrap(),
            clusters: (0..count).map(|row| action(row) * 10 + intensity(row)).collect(),
            groups: (0..count as u32).collect(),
            all: (0..count).collect(),
        }
    }

    fn learn_at(rows: &Rows, level: f64) -> ExplainedActions {
        let origins = Origins { clusters: &rows.clusters, groups: &rows.groups };
        learn(&rows.examples, &PLACE, &rows.all, origins, level).unwrap().unwrap()
    }

    #[test]
    fn known_faults_stay_unexplained_no_more_often_than_the_level() {
        for level in [0.01, 0.05, 0.2] {
            for seed in 0..3 {
                let known = learn_at(&rows(1000, 2 * seed + 1), level);
                let new = rows(1000, 2 * seed + 2);
                let mut values = [0.0; FEATURES];
                let unexplained = new.all.iter().filter(|&&row| {
                    new.examples.row_into(0, row, &mut values);
                    let action = new.examples.labels()[row].action as usize;
                    !known.explains(&values, action)
                });
                let share = unexplained.count() as f64 / 1000.0;
                // Three standard deviations of both the limit and the count.
                let tolerance = 3.0 * libm::sqrt(2.0 * level * (1.0 - level) / 1000.0);
                assert!(share <= level + tolerance, "{share} of known rows at level {level}");
            }
        }
    }

    #[test]
    fn a_fault_that_moves_an_untrained_residual_is_unknown() {
        let known = learn_at(&rows(1000, 1), LEVEL);
        for intensity in 2..10 {
            let mut row = [0.0; FEATURES];
            row[3] = f64::from(intensity);
            assert!((0..2).all(|action| !known.explains(&row, action)), "{intensity}");
        }
        let strong_leak = [5.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!(known.explains(&strong_leak, 0) && !known.explains(&strong_leak, 1));
        assert!(!known.explains(&[f64::NAN; FEATURES], 0));
    }

    #[test]
    fn too_few_rows_for_a_level_set_no_limit() {
        let known = learn_at(&rows(60, 1), LEVEL);
        assert_eq!(known.limit, f64::INFINITY, "a hundredth of 60 rows is no row");
        assert!(learn_at(&rows(60, 1), 0.1).limit.is_finite());
    }

    #[test]
    fn rows_of_one_group_do_not_vouch_for_each_other() {
        let rows = rows(400, 1);
        let twins: Vec<u32> = rows.groups.iter().map(|row| row / 4).collect();
        let origins = Origins { clusters: &rows.clusters, groups: &twins };
        let known = learn(&rows.examples, &PLACE, &rows.all, origins, 0.1).unwrap().unwrap();
        assert!(known.limit >= learn_at(&rows, 0.1).limit * 0.9);
        let one = vec![0; 400];
        let origins = Origins { clusters: &rows.clusters, groups: &one };
        let known = learn(&rows.examples, &PLACE, &rows.all, origins, 0.1).unwrap().unwrap();
        assert_eq!(known.limit, f64::INFINITY, "nothing is held out of one group");
    }
}
