//! The probability that the function fails in a flight, conditional on the moment at which something happens first.
//!
//! Hu and Seiler condition on the moments of faults and integrate over them (*Pivotal decomposition for reliability
//! analysis of fault tolerant control systems on unmanned aerial vehicles*; *Probability bounds for false alarm analysis
//! of fault detection systems*). Here that is done for one or two lanes whose answers have constant probabilities.
//!
//! All lanes are on at first. A fault that needs a shutdown begins in lane i with the rate λ_i. It is *contained* (its
//! lane is shut down), *reported* (another action is raised, or another lane is shut down), or *hidden* (nothing is
//! raised). A lane is also shut down without need, with the rate s_i. With the total rate a, the rate b_j to the state
//! in which only lane j is on, the rate g of faults that are not contained, and the rate r_j at which the last lane j
//! fails, the function fails in a flight of duration T with the probability
//!
//! ```text
//! P = ∫₀ᵀ exp(−a t) [ g + Σ_j b_j (1 − exp(−r_j (T − t))) ] dt                    (1)
//! a = Σ_i (λ_i + s_i),  b_j = contained_i + s_i with i ≠ j,  g = Σ_i (reported_i + hidden_i)
//! ```
//!
//! Every term is positive, so nothing cancels even where two rare faults must meet.

/// Number of panels of Simpson's rule; an even number.
const PANELS: usize = 1024;

/// The integral ends where exp(−a t) has this exponent: nothing worth counting begins later.
const LAST_EXPONENT: f64 = 40.0;

/// The rates at which something begins in a lane, 1/h.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LaneOnsets {
    /// Faults that need a shutdown and get it.
    pub contained: f64,
    /// Faults that need a shutdown; something else is reported.
    pub reported: f64,
    /// Faults that need a shutdown; nothing is reported.
    pub hidden: f64,
    /// Shutdowns without need.
    pub needless: f64,
}

impl LaneOnsets {
    /// Faults that need a shutdown.
    fn faults(&self) -> f64 {
        self.contained + self.reported + self.hidden
    }

    fn uncontained(&self) -> f64 {
        self.reported + self.hidden
    }
}

/// Rates per flight hour.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct FunctionFailure {
    /// The function fails: a fault that needs a shutdown acts without one, or no lane is on.
    pub failure: f64,
    /// The part in which a fault that needs a shutdown acts without one.
    pub uncontained: f64,
    /// The part that begins in the flight; the rest has been hidden since before it.
    pub begins: f64,
}

/// The probabilities of [`FunctionFailure`] in a flight that begins without a hidden fault.
#[derive(Debug, Clone, Copy, Default)]
struct FlightFailure {
    failure: f64,
    uncontained: f64,
}

/// One or two lanes.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightModel {
    /// The lanes.
    pub lanes: Vec<LaneOnsets>,
    /// Whether the last lane that is on is never shut down.
    pub keeps_last: bool,
    /// Duration of a flight, h.
    pub flight_h: f64,
    /// From the report of a fault to its repair, h.
    pub repair_h: f64,
    /// Between two checks that find every hidden fault, h.
    pub check_h: f64,
}

impl FlightModel {
    /// Rates per flight hour, as a mean over flights that begin at any time since the last check.
    pub fn per_hour(&self) -> FunctionFailure {
        let hidden: f64 = self.lanes.iter().map(|lane| lane.hidden).sum();
        let before = mean_share(hidden * (self.check_h - self.flight_h));
        let now = self.flight();
        let either = |now: f64| (before + (1.0 - before) * now) / self.flight_h;
        FunctionFailure {
            failure: either(now.failure),
            uncontained: either(now.uncontained),
            begins: (1.0 - before) * now.failure / self.flight_h,
        }
    }

    /// The probabilities of a flight without a hidden fault. A lane may wait for its repair.
    fn flight(&self) -> FlightFailure {
        let last = |lane: usize| self.of_last(lane, self.flight_h);
        let &[first, second] = self.lanes.as_slice() else { return last(0) };
        // A lane that was shut down leaves the other one.
        let lost = [second, first].map(|other| other.contained + other.needless);
        let waits = -(-(lost[0] + lost[1]) * self.repair_h).exp_m1();
        let mut sum = self.of_both(lost);
        sum.failure *= 1.0 - waits;
        sum.uncontained *= 1.0 - waits;
        for lane in (0..2).filter(|&lane| lost[lane] > 0.0) {
            let share = waits * lost[lane] / (lost[0] + lost[1]);
            let own = last(lane);
            sum.failure += share * own.failure;
            sum.uncontained += share * own.uncontained;
        }
        sum
    }

    /// Equation (1) for two lanes; `lost[j]` is b_j.
    fn of_both(&self, lost: [f64; 2]) -> FlightFailure {
        let all: f64 = self.lanes.iter().map(|lane| lane.faults() + lane.needless).sum();
        let uncontained: f64 = self.lanes.iter().map(LaneOnsets::uncontained).sum();
        let step = self.flight_h.min(LAST_EXPONENT / all) / PANELS as f64;
        let mut sum = FlightFailure::default();
        for node in 0..=PANELS {
            let weight = match node {
                0 | PANELS => 1.0,
                odd if odd % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let begins = node as f64 * step;
            let weight = weight * step / 3.0 * (-all * begins).exp();
            let later = [0, 1].map(|lane| self.of_last(lane, self.flight_h - begins));
            let second =
                |of: fn(&FlightFailure) -> f64| lost[0] * of(&later[0]) + lost[1] * of(&later[1]);
            sum.failure += weight * (uncontained + second(|own| own.failure));
            sum.uncontained += weight * (uncontained + second(|own| own.uncontained));
        }
        sum
    }

    /// The last lane that is on, over some hours.
    fn of_last(&self, lane: usize, hours: f64) -> FlightFailure {
        let lane = &self.lanes[lane];
        // Where the last lane stays on, its faults act.
        let (fails, acts) = match self.keeps_last {
            true => (lane.faults(), lane.faults()),
            false => (lane.faults() + lane.needless, lane.uncontained()),
        };
        let failure = -(-fails * hours).exp_m1();
        let uncontained = if fails > 0.0 { failure * acts / fails } else { 0.0 };
        FlightFailure { failure, uncontained }
    }
}

/// The mean of 1 − exp(−x u) over u from 0 to 1.
fn mean_share(x: f64) -> f64 {
    // The closed form cancels for small x; the series is exact to the last digit there.
    if x < 1e-4 { x * (0.5 - x / 6.0) } else { 1.0 + (-x).exp_m1() / x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin_diagnosis::random::Random;

    fn model(lanes: &[LaneOnsets]) -> FlightModel {
        FlightModel {
            lanes: lanes.to_vec(),
            keeps_last: true,
            flight_h: 2.0,
            repair_h: 0.0,
            check_h: 100.0,
        }
    }

    fn assert_close(found: f64, wanted: f64, relative: f64) {
        assert!((found / wanted - 1.0).abs() < relative, "{found} instead of {wanted}");
    }

    #[test]
    fn with_perfect_detection_both_lanes_must_fail_in_a_flight() {
        for rate in [1e-9, 1e-3, 0.7, 300.0] {
            let lane = LaneOnsets { contained: rate, ..Default::default() };
            let found = model(&[lane, lane]).per_hour();
            let one = -(-2.0 * rate).exp_m1();
            assert_close(found.failure, one * one / 2.0, 1e-7);
        }
    }

    #[test]
    fn without_detection_a_fault_fails_every_flight_until_the_check() {
        let lane = LaneOnsets { hidden: 2e-3, ..Default::default() };
        let found = model(&[lane, lane]).per_hour();
        // The mean over flights k of the probability that a fault began since the check or in the flight.
        let steps = 100_000;
        let since = |k: usize| 2.0 + 98.0 * (k as f64 + 0.5) / f64::from(steps);
        let mean: f64 = (0..steps as usize).map(|k| -(-4e-3 * since(k)).exp_m1()).sum();
        assert_close(found.failure, mean / f64::from(steps) / 2.0, 1e-8);
        assert_eq!(found.failure, found.uncontained);
        // What begins in a flight is the other part.
        let before: f64 = (0..steps as usize).map(|k| -(-4e-3 * (since(k) - 2.0)).exp_m1()).sum();
        assert_close(found.failure - found.begins, before / f64::from(steps) / 2.0, 1e-8);
        assert_close(model(&[lane]).per_hour().failure, found.failure / 2.0, 0.1);
    }

    #[test]
    fn a_series_continues_the_mean_share() {
        assert_close(mean_share(0.999_999e-4), mean_share(1.000_001e-4), 3e-6);
        assert_close(mean_share(2.0), 1.0 - (1.0 - (-2.0_f64).exp()) / 2.0, 1e-12);
    }

    /// A flight as it happens, event by event. A fault or shutdown comes at its own moment.
    fn fly(model: &FlightModel, random: &mut Random) -> FlightFailure {
        let exponential = |random: &mut Random, rate: f64| -(1.0 - random.unit()).ln() / rate;
        let of = |holds: bool| f64::from(u8::from(holds));
        let since_check = (model.check_h - model.flight_h) * random.unit();
        let hidden = model.lanes.iter().map(|lane| exponential(random, lane.hidden));
        if hidden.collect::<Vec<_>>().into_iter().any(|moment| moment < since_check) {
            return FlightFailure { failure: 1.0, uncontained: 1.0 };
        }
        let mut events = vec![];
        for (lane, own) in model.lanes.iter().enumerate() {
            for (kind, rate) in [own.contained, own.uncontained(), own.needless].iter().enumerate()
            {
                events.push((exponential(random, *rate), lane, kind));
            }
        }
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut on = vec![true; model.lanes.len()];
        for (_, lane, kind) in events.into_iter().take_while(|event| event.0 < model.flight_h) {
            let is_last = on.iter().filter(|on| **on).count() == 1;
            let stays_on = kind == 1 || (is_last && model.keeps_last && kind == 0);
            if !on[lane] || (kind == 2 && is_last && model.keeps_last) {
                continue;
            }
            if stays_on || is_last {
                return FlightFailure { failure: 1.0, uncontained: of(stays_on) };
            }
            on[lane] = false;
        }
        FlightFailure::default()
    }

    #[test]
    fn an_independent_simulation_of_flights_agrees() {
        let first = LaneOnsets { contained: 0.08, reported: 0.01, hidden: 0.002, needless: 0.1 };
        let second = LaneOnsets { contained: 0.15, reported: 0.02, hidden: 0.001, needless: 0.03 };
        let mut random = Random::new(6);
        for (lanes, keeps_last) in
            [(vec![first, second], true), (vec![first, second], false), (vec![second], false)]
        {
            let model = FlightModel { keeps_last, ..model(&lanes) };
            let flights = 400_000;
            let (mut failed, mut uncontained) = (0.0, 0.0);
            for _ in 0..flights {
                let flight = fly(&model, &mut random);
                failed += flight.failure;
                uncontained += flight.uncontained;
            }
            let found = model.per_hour();
            for (count, rate) in [(failed, found.failure), (uncontained, found.uncontained)] {
                let share = rate * model.flight_h;
                let deviation = (share * (1.0 - share) / f64::from(flights)).sqrt();
                let seen = count / f64::from(flights);
                assert!((seen - share).abs() < 4.0 * deviation, "{seen} instead of {share}");
            }
        }
    }

    #[test]
    fn a_lane_that_waits_for_its_repair_leaves_the_other_alone() {
        let lane = LaneOnsets { contained: 1e-4, ..Default::default() };
        let waiting = FlightModel { repair_h: 50.0, ..model(&[lane, lane]) };
        let waits = -(-2e-4_f64 * 50.0).exp_m1();
        let one = -(-2e-4_f64).exp_m1();
        let wanted = (1.0 - waits) * one * one + waits * one;
        assert_close(waiting.per_hour().failure, wanted / 2.0, 1e-7);
    }
}
