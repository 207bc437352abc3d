//! The median of waiting times.

use super::rate::binomial_tail;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The median of times until an event, with the order-statistic interval of at least 95 %.
///
/// An observation that ended without the event counts as longer than every time, so a median or an end of the interval
/// may be `None`: not within the observation. With fewer than six observations the interval is the whole range.
///
/// The interval holds the middle order statistics: the l-th smallest and the l-th largest time, with the largest l for
/// which fewer than l of n fair coins show heads with a probability of at most 2.5 %. It assumes no distribution.
///
/// Source: David and Nagaraja, Order Statistics, 3rd edition, 2003, section 7.1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MedianTime {
    /// Number of observations.
    pub of: u64,
    /// Number of these with the event.
    pub events: u64,
    /// The median, s.
    pub median_s: Option<f64>,
    /// The lower end, s.
    pub low_s: Option<f64>,
    /// The upper end, s.
    pub high_s: Option<f64>,
}

impl MedianTime {
    /// The median of times, s; `None` stands for an observation without the event.
    pub fn of(times_s: impl IntoIterator<Item = Option<f64>>) -> Self {
        let times_s: Vec<Option<f64>> = times_s.into_iter().collect();
        let mut events: Vec<f64> = times_s.iter().flatten().copied().collect();
        events.sort_by(f64::total_cmp);
        let of = times_s.len() as u64;
        let smallest = |rank: u64| events.get(rank as usize - 1).copied();
        let (low_s, high_s) = match low_rank(of) {
            0 => (Some(0.0), None),
            rank => (smallest(rank), smallest(of + 1 - rank)),
        };
        let median_s = smallest(of.div_ceil(2).max(1));
        MedianTime { of, events: events.len() as u64, median_s, low_s, high_s }
    }
}

/// The rank of the lower end among so many times; 0 if there is none.
fn low_rank(of: u64) -> u64 {
    // Fewer than l heads are more than n − l tails.
    let is_covered = |rank: &u64| binomial_tail(of - rank + 1, of, 0.5) <= 0.025;
    (1..=of).take_while(is_covered).count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn ranks_are_those_of_tables() {
        // Conover, Practical Nonparametric Statistics, 1999, and the exact sums of the binomial distribution.
        let ranks = [(5, 0), (6, 1), (8, 1), (9, 2), (10, 2), (20, 6), (25, 8), (100, 40)];
        for (of, rank) in ranks {
            assert_eq!(low_rank(of), rank, "{of}");
        }
    }

    #[test]
    fn observations_without_the_event_are_longer_than_all_others() {
        let ten = MedianTime::of((1..=10).map(|time| Some(f64::from(time))));
        assert_eq!((ten.median_s, ten.low_s, ten.high_s), (Some(5.0), Some(2.0), Some(9.0)));
        let six = MedianTime::of((1..=10).map(|time| (time <= 6).then_some(f64::from(time))));
        assert_eq!((six.of, six.events, six.median_s), (10, 6, Some(5.0)));
        assert_eq!((six.low_s, six.high_s), (Some(2.0), None));
        let none = MedianTime::of(vec![None; 10]);
        assert_eq!((none.events, none.median_s, none.low_s, none.high_s), (0, None, None, None));
        let few = MedianTime::of([Some(3.0), Some(1.0)]);
        assert_eq!((few.median_s, few.low_s, few.high_s), (Some(1.0), Some(0.0), None));
    }

    #[test]
    fn the_interval_holds_the_median_as_often_as_promised() {
        let mut random = servotwin_diagnosis::random::Random::new(7);
        let mut held = 0;
        for _ in 0..2000 {
            // Exponential with the median ln 2; what lasts longer than 1.2 s is not seen.
            let times = (0..20).map(|_| -libm::log(1.0 - random.unit()));
            let found = MedianTime::of(times.map(|time| (time < 1.2).then_some(time)));
            let truth = core::f64::consts::LN_2;
            let is_below = found.low_s.is_some_and(|low| low <= truth);
            held += u32::from(is_below && found.high_s.is_none_or(|high| high >= truth));
        }
        // The exact probability is 95.9 %, with a deviation of 0.4 %.
        assert!((1890..=1945).contains(&held), "{held}");
    }
}
