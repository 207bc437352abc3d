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

use crate::tree::numbers::ExposureHours;

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
    /// The part of these that a test on the ground passes.
    pub passed: f64,
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

/// How often the function fails. What begins is a rate; what is there in a flight is a probability, because a fault that
/// was hidden before it is there however long the flight is.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct FunctionFailure {
    /// Probability that the function is failed in a flight: a fault that needs a shutdown acts without one, or no lane
    /// is on.
    pub failed: f64,
    /// The part in which a fault that needs a shutdown acts without one.
    pub uncontained: f64,
    /// Failures that begin, per flight hour: those of flights without a hidden fault, 1/h.
    pub begins_per_h: f64,
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
    /// How long failures may have been there.
    pub hours: ExposureHours,
}

impl FlightModel {
    /// How often the function fails, as a mean over flights that begin at any time since the last check.
    pub fn function_failure(&self) -> FunctionFailure {
        let sum = |of: fn(&LaneOnsets) -> f64| self.lanes.iter().map(of).sum::<f64>();
        let share = |rate: f64, hours: f64| mean_share(rate * (hours - self.hours.flight_h));
        let before = match self.hours.test_h {
            None => share(sum(|lane| lane.hidden), self.hours.check_h),
            // What the test passes stays until the check, and the rest until the next test.
            Some(test_h) => {
                let passed = share(sum(|lane| lane.passed), self.hours.check_h);
                let found = share(sum(|lane| lane.hidden - lane.passed), test_h);
                passed + (1.0 - passed) * found
            }
        };
        let now = self.flight();
        let either = |now: f64| before + (1.0 - before) * now;
        FunctionFailure {
            failed: either(now.failure),
            uncontained: either(now.uncontained),
            begins_per_h: (1.0 - before) * now.failure / self.hours.flight_h,
        }
    }

    /// The probabilities of a flight without a hidden fault. A lane may wait for its repair.
    fn flight(&self) -> FlightFailure {
        let last = |lane: usize| self.of_last(lane, self.hours.flight_h);
        let &[first, second] = self.lanes.as_slice() else { return last(0) };
        // A lane that was shut down leaves the other one.
        let lost = [second, first].map(|other| other.contained + other.needless);
        let waits = -(-(lost[0] + lost[1]) * self.hours.repair_h).exp_m1();
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
        let step = self.hours.flight_h.min(LAST_EXPONENT / all) / PANELS as f64;
        let mut sum = FlightFailure::default();
        for node in 0..=PANELS {
            let weight = match node {
                0 | PANELS => 1.0,
                odd if odd % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let begins = node as f64 * step;
            let weight = weight * step / 3.0 * (-all * begins).exp();
            let later = [0, 1].map(|lane| self.of_last(lane, self.hours.flight_h - begins));
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
