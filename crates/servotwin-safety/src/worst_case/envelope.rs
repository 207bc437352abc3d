//! What a search did not search: the flights in each cell of the envelope, and what random flights say about it.

use super::log::SearchRow;
use servotwin::flight::worst_case::space::{Dimension, Distribution, SearchSpace};
use servotwin_learning::metrics::clopper_pearson_upper;
use std::collections::BTreeSet;

/// Number of parts into which every range is cut.
const PARTS: usize = 3;

/// The ends of the parts of a tolerance, in standard deviations: a third of the specimens in each.
const THIRD_OF_NORMAL: f64 = 0.430_727;

/// The confidence of the bounds.
pub(crate) const CONFIDENCE: f64 = 0.95;

/// A part of the range of one dimension, or one choice.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvelopeCell {
    /// The dimension.
    pub dimension: String,
    /// The part: a choice, or the ends in SI units or standard deviations.
    pub part: String,
    /// Number of flights of the search.
    pub searched: u64,
    /// Number of random flights.
    pub random: u64,
    /// Number of errors in the random flights.
    pub random_errors: u64,
    /// The upper end of the one-sided 95 % interval of the share of errors, from the random flights alone.
    pub share_upper: f64,
}

/// The cells of a space.
pub(crate) fn cells(
    space: &SearchSpace,
    searched: &[&SearchRow],
    random: &[&SearchRow],
) -> Vec<EnvelopeCell> {
    let mut cells = vec![];
    for (place, dimension) in space.dimensions.iter().enumerate() {
        for part in 0..part_count(dimension) {
            let is_in = |row: &&&SearchRow| {
                is_flown(row) && part_of(dimension, row.line.point.values[place]) == part
            };
            let flown: Vec<&&SearchRow> = random.iter().filter(is_in).collect();
            let errors = flown.iter().filter(|row| row.outcome.is_error).count() as u64;
            cells.push(EnvelopeCell {
                dimension: dimension.name.clone(),
                part: part_name(dimension, part),
                searched: searched.iter().filter(is_in).count() as u64,
                random: flown.len() as u64,
                random_errors: errors,
                share_upper: clopper_pearson_upper(errors, flown.len() as u64, CONFIDENCE),
            });
        }
    }
    cells
}

/// How many joint cells there are, and how many of them have a flight: the command, and the lower or upper half of each
/// range of the environment.
pub(crate) fn joint_cells(space: &SearchSpace, rows: &[&SearchRow]) -> (f64, usize) {
    let command = space.dimensions.iter().position(|dimension| dimension.name == "command");
    let ranges: Vec<usize> = space.environment().map(|(place, _)| place).collect();
    let commands = command.map_or(1, |place| space.dimensions[place].choices.len());
    let cell = |row: &&&SearchRow| -> Vec<usize> {
        let values = &row.line.point.values;
        let halves = ranges.iter().map(|&place| usize::from(values[place] >= 0.5));
        command.map(|place| values[place] as usize).into_iter().chain(halves).collect()
    };
    let visited: BTreeSet<Vec<usize>> =
        rows.iter().filter(|row| is_flown(row)).map(|row| cell(&row)).collect();
    (commands as f64 * 2_f64.powi(ranges.len() as i32), visited.len())
}

/// Whether a flight was simulated to the end.
pub(crate) fn is_flown(row: &SearchRow) -> bool {
    !row.outcome.margin.is_nan()
}

fn part_count(dimension: &Dimension) -> usize {
    match dimension.distribution {
        Distribution::Choice(count) => count,
        Distribution::Share | Distribution::Deviation => PARTS,
    }
}

/// The cuts between the parts of a range.
fn cuts(dimension: &Dimension) -> [f64; PARTS - 1] {
    match dimension.distribution {
        Distribution::Deviation => [-THIRD_OF_NORMAL, THIRD_OF_NORMAL],
        _ => [1.0 / 3.0, 2.0 / 3.0],
    }
}

fn part_of(dimension: &Dimension, value: f64) -> usize {
    match dimension.distribution {
        Distribution::Choice(_) => value as usize,
        _ => cuts(dimension).iter().filter(|cut| value >= **cut).count(),
    }
}

fn part_name(dimension: &Dimension, part: usize) -> String {
    if matches!(dimension.distribution, Distribution::Choice(_)) {
        return dimension.in_words(part as f64);
    }
    let ([low, high], cuts) = (dimension.distribution.ends(), cuts(dimension));
    let ends = [low, cuts[0], cuts[1], high];
    format!("{} … {}", dimension.in_words(ends[part]), dimension.in_words(ends[part + 1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_a_range_and_have_the_ends_of_its_unit() {
        let dimension = |distribution, range| Dimension {
            name: "air_speed".into(),
            distribution,
            range,
            choices: vec![],
        };
        let speed = dimension(Distribution::Share, Some([110.0, 170.0]));
        assert_eq!(
            [0.0, 0.33, 0.34, 0.67, 1.0].map(|value| part_of(&speed, value)),
            [0, 0, 1, 2, 2]
        );
        assert_eq!(part_name(&speed, 0), "110 … 130");
        let tolerance = dimension(Distribution::Deviation, None);
        assert_eq!([-3.0, 0.0, 0.5].map(|value| part_of(&tolerance, value)), [0, 1, 2]);
        assert_eq!(part_name(&tolerance, 2), "0.430727 … 3");
    }
}
