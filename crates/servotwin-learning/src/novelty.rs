//! Learns the ranges of each class's training rows, [`Novelty`].
//!
//! The limit is a quantile of the score over held-out rows. The ranges come from one half of the groups and the scores
//! from the other, and vice versa.
//!
//! The classes are healthy and the actions. A fault is scored in the view of its actuator, so that identical actuators
//! share the learned ranges.

use crate::hierarchy::Examples;
use alloc::vec;
use alloc::vec::Vec;
use servotwin_diagnosis::diagnoser::novelty::{KnownRanges, Novelty};
use servotwin_diagnosis::error::{Error, require, same_length};

/// Minimum width of a range, as a part of the feature's range over all classes.
const LEAST_WIDTH: f64 = 0.05;

/// Minimum limit: a row is never unknown while the distances of its features sum to less than half a feature.
const LEAST_LIMIT: f64 = 0.5;

/// Learns from rows of examples. `groups` holds the origin of each row of the examples (a flight), so that similar rows
/// stay in one half.
///
/// # Errors
/// [`Error::LengthMismatch`], [`Error::SettingOutOfRange`].
pub fn learn(
    examples: &Examples,
    rows: &[usize],
    groups: &[u32],
    quantile: f64,
) -> Result<Novelty, Error> {
    same_length("groups", examples.labels().len(), groups.len())?;
    require(quantile > 0.0 && quantile < 1.0, "quantile", quantile, "between 0 and 1")?;
    let names = examples.names();
    let all: Vec<(u32, Vec<f64>)> =
        rows.iter().map(|&row| (groups[row], own_view(examples, row))).collect();
    let class_of = |row: usize| class_of(examples, row);
    let overall = Ranges::of(all.iter().map(|(_, values)| values), names.features.len());
    let learn_own = |class: usize| {
        let own = rows.iter().zip(&all).filter(|(row, _)| class_of(**row) == class);
        let own: Vec<&(u32, Vec<f64>)> = own.map(|(_, values)| values).collect();
        learn_class(&own, &overall, quantile)
    };
    Ok(Novelty { quantile, classes: (0..=names.actions.len()).map(learn_own).collect() })
}

struct Ranges {
    lows: Vec<f64>,
    highs: Vec<f64>,
}

impl Ranges {
    fn of<'r>(rows: impl Iterator<Item = &'r Vec<f64>>, features: usize) -> Self {
        let mut ranges = Ranges { lows: vec![f64::MAX; features], highs: vec![f64::MIN; features] };
        for row in rows {
            for ((low, high), &x) in ranges.lows.iter_mut().zip(&mut ranges.highs).zip(row) {
                *low = low.min(x);
                *high = high.max(x);
            }
        }
        ranges
    }

    /// The learned ranges, with each width at least a part of the overall one.
    fn known(self, overall: &Ranges, limit: f64) -> KnownRanges {
        let widths = (0..self.lows.len()).map(|j| {
            let all = overall.highs[j] - overall.lows[j];
            (self.highs[j] - self.lows[j]).max(LEAST_WIDTH * all).max(1e-9)
        });
        KnownRanges { widths: widths.collect(), lows: self.lows, highs: self.highs, limit }
    }
}

fn own_view(examples: &Examples, row: usize) -> Vec<f64> {
    let label = examples.labels()[row];
    let is_fault = label.actuator != examples.names().healthy();
    let view = if is_fault && examples.views() > 1 { label.actuator as usize } else { 0 };
    let mut values = vec![0.0; examples.names().features.len()];
    examples.row_into(view, row, &mut values);
    values
}

fn class_of(examples: &Examples, row: usize) -> usize {
    let label = examples.labels()[row];
    let is_fault = label.actuator != examples.names().healthy();
    if is_fault { label.action as usize + 1 } else { 0 }
}

fn learn_class(rows: &[&(u32, Vec<f64>)], overall: &Ranges, quantile: f64) -> KnownRanges {
    let features = overall.lows.len();
    if rows.is_empty() {
        return KnownRanges { lows: vec![], highs: vec![], widths: vec![], limit: 1.0 };
    }
    let mut groups: Vec<u32> = rows.iter().map(|(group, _)| *group).collect();
    groups.sort_unstable();
    groups.dedup();
    let half = |group: &u32| groups.binary_search(group).unwrap_or(0) % 2;
    let of = |wanted: usize| rows.iter().filter(move |(group, _)| half(group) == wanted);
    let mut distances = Vec::with_capacity(rows.len());
    for (learnt, judged) in [(0, 1), (1, 0)] {
        if of(learnt).next().is_some() {
            let known = Ranges::of(of(learnt).map(|(_, x)| x), features).known(overall, 1.0);
            distances.extend(of(judged).map(|(_, x)| known.distance(x)));
        }
    }
    distances.sort_unstable_by(f64::total_cmp);
    let place = (quantile * distances.len() as f64) as usize;
    let limit = distances.get(place).or(distances.last()).copied().unwrap_or(0.0);
    Ranges::of(rows.iter().map(|(_, x)| x), features).known(overall, limit.max(LEAST_LIMIT))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::Label;
    use alloc::format;
    use alloc::string::String;
    use servotwin_diagnosis::hierarchy::Names;
    use servotwin_diagnosis::random::Random;

    const FEATURES: usize = 20;

    /// Healthy rows around 0, faults around 1 in the first feature, in groups of five.
    fn examples(rows: usize, seed: u64) -> (Examples, Vec<u32>) {
        let mut random = Random::new(seed);
        let names = Names {
            features: (0..FEATURES).map(|j| format!("f{j}")).collect(),
            actuators: vec![String::from("a")],
            actions: vec![String::from("stop")],
            details: vec![String::from("d")],
        };
        let label = |row: usize| Label { actuator: (row % 2) as u32, action: 0, detail: 0 };
        let labels: Vec<Label> = (0..rows).map(label).collect();
        let mut values = vec![];
        for column in 0..FEATURES {
            let is_fault = |row: usize| labels[row].actuator == 0 && column == 0;
            let own = |row: usize| f64::from(u8::from(is_fault(row))) + random.between(-0.3, 0.3);
            values.extend((0..rows).map(own));
        }
        let all = vec![(0..FEATURES).collect()];
        let groups = (0..rows).map(|row| (row / 5) as u32).collect();
        (Examples::new(names, all, vec![values], labels).unwrap(), groups)
    }

    #[test]
    fn known_rows_are_known_and_others_are_not() {
        let (examples, groups) = examples(2000, 1);
        let rows: Vec<usize> = (0..2000).collect();
        let novelty = learn(&examples, &rows, &groups, 0.99).unwrap();
        novelty.check(1, FEATURES).unwrap();
        assert!(novelty.check(2, FEATURES).is_err() && novelty.check(1, 3).is_err());
        let (others, _) = self::examples(2000, 2);
        let score = |row: usize| {
            let action = (others.labels()[row].actuator == 0).then_some(0);
            novelty.score(action, &own_view(&others, row))
        };
        let unknown = rows.iter().filter(|&&row| score(row) > 1.0).count();
        assert!(unknown <= 40, "{unknown} of 2000 known rows");
        let strange: Vec<f64> = (0..FEATURES).map(|j| if j < 3 { 5.0 } else { 0.0 }).collect();
        assert!(novelty.score(None, &strange) > 1.0);
        assert!(novelty.score(Some(0), &strange) > 1.0);
        assert!(novelty.score(None, &[f64::NAN; FEATURES]) > 1.0, "what is no number is unknown");
        assert_eq!(Novelty::none().score(Some(0), &strange), 0.0);
    }

    #[test]
    fn rows_of_one_group_do_not_vouch_for_each_other() {
        let (examples, _) = examples(40, 3);
        let rows: Vec<usize> = (0..40).collect();
        let apart: Vec<u32> = (0..40).collect();
        let together = vec![0; 40];
        let limit = |groups: &[u32]| learn(&examples, &rows, groups, 0.9).unwrap().classes[0].limit;
        assert!(limit(&apart) > LEAST_LIMIT);
        assert_eq!(
            limit(&together),
            LEAST_LIMIT,
            "without another half nothing is known of chance"
        );
    }
}
