//! A cross-entropy search: points are drawn from a distribution, which moves towards the worst of them.
//!
//! ```text
//! q ← α q_elite + (1 − α) q                                     (1)
//! ```
//!
//! for the probabilities of a choice, and for mean and standard deviation of every other number; q_elite are those of
//! the worst points so far. Values beyond the ends of a range fall on the ends, where the worst case often is. The
//! standard deviation has a floor, so that a search goes on around what it found.
//!
//! The first points have the distributions of the study, and so has a share of all later ones: the worst of a few points
//! have a few of the faults, and a search that learned from these alone would not meet the others any more.
//!
//! Much of a margin is chance: noise, and the random part of a command. It follows from the number of a point, so half
//! of the points are *offspring*: they keep the number of one of the worst points, and most of its values.
//!
//! Sources: Rubinstein, Kroese, "The Cross-Entropy Method", Springer 2004, chapters 2 and 5 (smoothing α); defensive
//! mixtures: Hesterberg, Technometrics 37, 1995; uniform crossover with a share of new values: Syswerda, Proc. 3rd Int.
//! Conf. Genetic Algorithms, 1989.

use super::space::{Distribution, SearchPoint, SearchSpace};
use crate::signal::random::NormalDeviates;

/// Number of points of a generation.
pub(crate) const GENERATION: usize = 16;
/// Number of the worst points from which the next generation learns.
const ELITE: usize = 6;
/// Number of points with the distributions of the study before the search learns.
const FIRST: usize = 4 * GENERATION;
/// Share of the later points with the distributions of the study.
const DEFENSIVE: f64 = 0.25;
/// α of equation (1).
const SMOOTHING: f64 = 0.7;
/// Share of the other points that are offspring.
const OFFSPRING: f64 = 0.5;
/// Share of the values of offspring that are drawn anew.
const NEW_VALUES: f64 = 0.3;
/// The smallest standard deviation, in parts of the distance between the ends.
const MIN_DEVIATION: f64 = 0.05;

/// The order of points by [`SearchObjective::rank`](crate::flight::margin::SearchObjective::rank).
pub(crate) type Rank = (bool, f64);

/// From what a number of the next points is drawn.
#[derive(Debug, Clone, PartialEq)]
enum Law {
    /// The distribution of the study.
    OfStudy,
    /// A normal distribution.
    Normal { mean: f64, deviation: f64 },
    /// The probability of each choice.
    Choice(Vec<f64>),
}

/// A running search.
pub(crate) struct CrossEntropy<'s> {
    space: &'s SearchSpace,
    laws: Vec<Law>,
    /// The worst points so far with their ranks, the worst first.
    elite: Vec<(SearchPoint, Rank)>,
    random: NormalDeviates,
    /// Number of points from which it learned.
    flown: usize,
}

impl<'s> CrossEntropy<'s> {
    /// A search that begins with the distributions of the study, and keeps to them if it never learns.
    pub(crate) fn new(space: &'s SearchSpace, random: NormalDeviates) -> Self {
        let laws = vec![Law::OfStudy; space.dimensions.len()];
        CrossEntropy { space, laws, elite: vec![], random, flown: 0 }
    }

    /// Draws a point. Offspring keep the number of their parent, others get this one.
    pub(crate) fn draw(&mut self, number: usize) -> SearchPoint {
        if self.flown < FIRST || self.random.unit() < DEFENSIVE {
            return self.space.draw(number, &mut self.random);
        }
        let place = (self.random.unit() * self.elite.len() as f64 / OFFSPRING) as usize;
        let parent = self.elite.get(place).map(|(point, _)| point);
        let mut values = vec![];
        for (place, (law, dimension)) in self.laws.iter().zip(&self.space.dimensions).enumerate() {
            if let Some(parent) = parent
                && self.random.unit() >= NEW_VALUES
            {
                values.push(parent.values[place]);
                continue;
            }
            let distribution = dimension.distribution;
            let value = match law {
                Law::OfStudy => distribution.draw(&mut self.random),
                Law::Normal { mean, deviation } => mean + deviation * self.random.normal(),
                Law::Choice(shares) => chosen(shares, self.random.unit()) as f64,
            };
            values.push(distribution.rounded(value));
        }
        SearchPoint { number: parent.map_or(number, |parent| parent.number), values }
    }

    /// Learns from a generation.
    pub(crate) fn learn(&mut self, flown: Vec<(SearchPoint, Rank)>) {
        self.flown += flown.len();
        self.elite.extend(flown);
        self.elite.sort_by(|(_, a), (_, b)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        self.elite.truncate(ELITE);
        if self.flown < FIRST {
            return;
        }
        for (place, law) in self.laws.iter_mut().enumerate() {
            let values: Vec<f64> =
                self.elite.iter().map(|(point, _)| point.values[place]).collect();
            *law = learned(law, self.space.dimensions[place].distribution, &values);
        }
    }
}

/// Equation (1) for one number.
fn learned(law: &Law, distribution: Distribution, values: &[f64]) -> Law {
    let blend = |elite: f64, before: f64| SMOOTHING * elite + (1.0 - SMOOTHING) * before;
    if let Distribution::Choice(count) = distribution {
        let even = vec![1.0 / count as f64; count];
        let before = if let Law::Choice(before) = law { before } else { &even };
        let share = |choice: usize| {
            values.iter().filter(|&&value| value as usize == choice).count() as f64
                / values.len() as f64
        };
        return Law::Choice(
            (0..count).map(|choice| blend(share(choice), before[choice])).collect(),
        );
    }
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance =
        values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
    let [low, high] = distribution.ends();
    let deviation = variance.sqrt().max(MIN_DEVIATION * (high - low));
    match *law {
        Law::Normal { mean: before, deviation: spread } => {
            Law::Normal { mean: blend(mean, before), deviation: blend(deviation, spread) }
        }
        _ => Law::Normal { mean, deviation },
    }
}

/// The choice at a place of the sum of all shares, from 0 to 1.
fn chosen(shares: &[f64], place: f64) -> usize {
    let mut sum = 0.0;
    let found = shares.iter().position(|share| {
        sum += share;
        place < sum
    });
    found.unwrap_or(shares.len() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::margin::SearchObjective;
    use crate::study::{Scenario, Study};

    #[test]
    fn laws_move_towards_the_elite_and_keep_a_spread() {
        let choice = Distribution::Choice(4);
        let once = learned(&Law::OfStudy, choice, &[2.0, 2.0]);
        let Law::Choice(shares) = once else { panic!("a choice has shares") };
        for (share, expected) in shares.into_iter().zip([0.075, 0.075, 0.775, 0.075]) {
            assert!((share - expected).abs() < 1e-12, "{share}");
        }
        let first = learned(&Law::OfStudy, Distribution::Share, &[0.5, 0.5]);
        assert_eq!(first, Law::Normal { mean: 0.5, deviation: MIN_DEVIATION });
        let Law::Normal { mean, deviation } = learned(&first, Distribution::Share, &[0.9, 1.0])
        else {
            panic!("a share is no choice")
        };
        assert!((mean - 0.815).abs() < 1e-12 && (deviation - MIN_DEVIATION).abs() < 1e-12);
    }

    /// A departure that depends on the fault most, on the onset and the numbers of the command, and on chance.
    fn departure(space: &SearchSpace, point: &SearchPoint) -> f64 {
        let values = &point.values;
        let fault = values[0] as usize * 7919 % space.dimensions[0].choices.len();
        let chance = NormalDeviates::stream(point.number as u64, 9).unit();
        let near = |place: usize, best: f64| 1.0 - (values[place] - best).abs();
        (1.0 + fault as f64).powi(2) * near(1, 0.9) * near(3, 0.2) * near(4, 0.8) * (1.0 + chance)
    }

    #[test]
    fn a_search_finds_larger_departures_than_random_flights() {
        let study = Study::default();
        let space = SearchSpace::new(&study, Scenario::Noise, SearchObjective::Transient).unwrap();
        let runs = 256;
        let largest = |points: &[SearchPoint]| {
            points.iter().map(|point| departure(&space, point)).fold(0.0, f64::max)
        };
        let mut won = 0;
        for seed in 0..20 {
            let mut search = CrossEntropy::new(&space, NormalDeviates::stream(seed, 1));
            let mut searched = vec![];
            for first in (0..runs).step_by(GENERATION) {
                let points = (first..first + GENERATION).map(|number| search.draw(number));
                let points: Vec<SearchPoint> = points.collect();
                let rank = |point: &SearchPoint| (true, -departure(&space, point));
                search.learn(points.iter().map(|point| (point.clone(), rank(point))).collect());
                searched.extend(points);
            }
            let mut random = NormalDeviates::stream(seed, 2);
            let drawn: Vec<_> = (0..runs).map(|n| space.draw(runs + n, &mut random)).collect();
            won += usize::from(largest(&searched) > largest(&drawn));
        }
        assert!(won >= 16, "the search found more in {won} of 20");
    }

    #[test]
    fn a_choice_is_drawn_by_its_share() {
        let shares = [0.25, 0.5, 0.25];
        assert_eq!(
            [0.0, 0.2, 0.25, 0.74, 0.76, 1.0].map(|place| chosen(&shares, place)),
            [0, 0, 1, 1, 2, 2]
        );
    }
}
