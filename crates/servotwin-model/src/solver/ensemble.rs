//! Many variants, one after the other in each lane.

use super::batch::{Batch, MOST_LANES};
use super::{Cause, Control, Failure, SAME_TIME_S, SMALLEST_STEP_S, Settings, Statistics};
use crate::lanes::{Kernel, Level, dispatch};
use crate::math;
use crate::program::{Program, Slot};
use crate::scalar::Lanes;
use crate::signal::Piecewise;
use alloc::vec;
use alloc::vec::Vec;

/// A variant, ready to run.
#[derive(Clone)]
pub struct Case<'a> {
    /// Its number, given back with every result.
    pub job: usize,
    /// Constants of all blocks: [`Program::block_constants`].
    pub constants: Vec<f64>,
    /// Values of the stand-ins: [`Program::stand_in_values`].
    pub stand_ins: Vec<f64>,
    /// One signal per external input.
    pub inputs: Vec<&'a Piecewise>,
    /// The states at time zero.
    pub start: Vec<f64>,
    /// Whether to search the steady state at the inputs of time zero first,
    /// from `start`.
    pub settle: bool,
    /// How long, s.
    pub duration_s: f64,
    /// Time between samples, s.
    pub sample_period_s: f64,
}

/// Where variants come from and results go.
pub trait Feed<'a> {
    /// The next variant; `None` when there are no more.
    fn next(&mut self) -> Option<Case<'a>>;
    /// A sample of the recorded slots.
    fn sample(&mut self, job: usize, index: usize, values: &[f64]);
    /// A variant has ended.
    fn finish(&mut self, job: usize, outcome: Result<Statistics, Failure>);
    /// Whether to stop now: variants in the lanes are dropped without a result.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Runs everything that the feed gives, with the lanes of a level.
pub fn run<'a>(
    program: &Program,
    settings: Settings,
    record: &[Slot],
    level: Level,
    feed: &mut dyn Feed<'a>,
) {
    struct All<'w, 'a> {
        program: &'w Program,
        settings: Settings,
        record: &'w [Slot],
        feed: &'w mut dyn Feed<'a>,
        under_way: Vec<UnderWay<'a>>,
        /// The number of lanes that do as well when no more are needed.
        narrower: usize,
    }
    impl<'a> Kernel for All<'_, 'a> {
        type Output = Vec<UnderWay<'a>>;
        #[inline(always)]
        fn run<V: Lanes>(self) -> Vec<UnderWay<'a>> {
            Ensemble::<V>::new(self.program, self.settings, self.record, self.feed)
                .run(self.under_way, self.narrower)
        }
    }
    let mut under_way = Vec::new();
    for level in [Some(level), level.narrower()].into_iter().flatten() {
        let narrower = level.narrower().map_or(0, Level::width);
        let feed = &mut *feed;
        under_way = dispatch(level, All { program, settings, record, feed, under_way, narrower });
        if under_way.is_empty() {
            return;
        }
    }
}

/// A variant between two steps, to go on in another lane.
struct UnderWay<'a> {
    lane: Lane<'a>,
    states: Vec<f64>,
    /// The external inputs, the stand-ins and what clocks hold.
    held: Vec<f64>,
}

/// What one lane is doing.
struct Lane<'a> {
    case: Case<'a>,
    phase: Phase,
    time_s: f64,
    /// The step that the error control wants.
    wanted_s: f64,
    /// The step being taken, and where it ends.
    step_s: f64,
    end_s: f64,
    /// The external inputs that move, each with the piece that holds.
    moving: Vec<(usize, usize)>,
    next_sample: usize,
    /// For each clock, the number of its next tick.
    next_tick: Vec<usize>,
    rejections: u32,
    /// Steps of the search for the steady state.
    settling: u32,
    statistics: Statistics,
}

#[derive(Clone, Copy, PartialEq)]
enum Phase {
    /// Nothing to do; the numbers in the lane are stale.
    Idle,
    /// On the way to the steady state, with the inputs of time zero.
    Settling,
    /// At rest; runs from the next evaluation on, which has the inputs' slopes.
    Settled,
    Running,
}

struct Ensemble<'p, 'f, 'a, V> {
    program: &'p Program,
    settings: Settings,
    record: &'p [Slot],
    feed: &'f mut dyn Feed<'a>,
    batch: Batch<'p, V>,
    lanes: Vec<Lane<'a>>,
    /// The external inputs that move in any lane.
    moving: Vec<usize>,
    values: Vec<f64>,
    periods_s: Vec<f64>,
}

/// Rejections in a row before a variant is given up.
const MOST_REJECTIONS: u32 = 60;
/// Steps of the steady-state search.
const MOST_SETTLING_STEPS: u32 = 400;
/// Change over scale in one step that is accepted on the way to rest, and the
/// one that steps grow or shrink towards.
const LARGEST_SETTLING_CHANGE: f64 = 0.5;
const WANTED_SETTLING_CHANGE: f64 = 0.1;
/// The system is at rest when no state moves faster than this part of its
/// scale, 1/s.
const AT_REST_PER_S: f64 = 1e-9;
/// Simulated time after which the search for rest is ended, s: a limit cycle
/// has none.
const LONGEST_SETTLING_S: f64 = 1e5;

impl<'p, 'f, 'a, V: Lanes> Ensemble<'p, 'f, 'a, V> {
    fn new(
        program: &'p Program,
        settings: Settings,
        record: &'p [Slot],
        feed: &'f mut dyn Feed<'a>,
    ) -> Self {
        Self {
            program,
            settings,
            record,
            feed,
            batch: Batch::new(program),
            lanes: Vec::with_capacity(V::WIDTH),
            moving: Vec::new(),
            values: vec![0.0; record.len()],
            periods_s: program.clock_periods_s().collect(),
        }
    }

    /// Goes on with what is under way, then runs what the feed gives. When that is
    /// all and `narrower` lanes are enough for the rest, gives the rest back.
    #[inline(always)]
    fn run(mut self, under_way: Vec<UnderWay<'a>>, narrower: usize) -> Vec<UnderWay<'a>> {
        if !self.fill(under_way) {
            return Vec::new();
        }
        loop {
            for lane in 0..V::WIDTH {
                if self.lanes[lane].phase == Phase::Idle {
                    self.load(lane);
                }
            }
            let busy = self.lanes.iter().filter(|lane| lane.phase != Phase::Idle).count();
            if self.feed.cancelled() || busy == 0 {
                return Vec::new();
            }
            if busy <= narrower {
                return self.give_back();
            }
            self.start_step();
            self.take_samples();
            self.step();
        }
    }

    /// Fills the lanes for the first time; lanes without a variant of their own
    /// get a copy of the first, which runs along unseen.
    fn fill(&mut self, under_way: Vec<UnderWay<'a>>) -> bool {
        for UnderWay { lane, states, held } in under_way {
            let index = self.lanes.len();
            self.lanes.push(lane);
            self.put(index, index);
            self.batch.set_states(index, &states);
            for (offset, &value) in held.iter().enumerate() {
                self.batch.set_variable(index, states.len() + offset, value);
            }
        }
        while self.lanes.len() < V::WIDTH {
            let Some(case) = self.feed.next() else { break };
            let lane = self.lanes.len();
            self.lanes.push(Lane::new(case, self.periods_s.len()));
            self.put(lane, lane);
        }
        let filled = self.lanes.len();
        if filled == 0 {
            return false;
        }
        for lane in filled..V::WIDTH {
            let mut copy = self.lanes[0].copy();
            copy.phase = Phase::Idle;
            self.lanes.push(copy);
            self.put(lane, 0);
        }
        true
    }

    /// The variants in the lanes, between two steps.
    fn give_back(mut self) -> Vec<UnderWay<'a>> {
        let held = self.program.externals().start..self.program.stand_ins().end;
        let lanes = core::mem::take(&mut self.lanes).into_iter().enumerate();
        let busy = lanes.filter(|(_, lane)| lane.phase != Phase::Idle);
        busy.map(|(index, lane)| UnderWay {
            lane,
            states: self.batch.states(index),
            held: held.clone().map(|slot| self.batch.variable(index, slot)).collect(),
        })
        .collect()
    }

    fn load(&mut self, lane: usize) {
        if let Some(case) = self.feed.next() {
            self.lanes[lane] = Lane::new(case, self.periods_s.len());
            self.put(lane, lane);
        }
    }

    /// Copies the case of lane `from` into the memory of lane `lane`.
    fn put(&mut self, lane: usize, from: usize) {
        let case = &self.lanes[from].case;
        self.batch.set_constants(lane, &case.constants);
        self.batch.set_states(lane, &case.start);
        let first = self.program.externals().end;
        for (index, &value) in case.stand_ins.iter().enumerate() {
            self.batch.set_variable(lane, first + index, value);
        }
        let first = self.program.externals().start;
        for (external, input) in case.inputs.iter().enumerate() {
            self.batch.set_variable(lane, first + external, input.pieces()[0][0]);
        }
        let moving = self.lanes.iter().flat_map(|lane| lane.moving.iter().map(|m| m.0));
        self.moving = moving.collect();
        self.moving.sort_unstable();
        self.moving.dedup();
    }

    /// Ticks clocks that are due, chooses every lane's step and evaluates.
    #[inline(always)]
    fn start_step(&mut self) {
        for lane in self.lanes.iter_mut() {
            if lane.phase == Phase::Settled {
                lane.begin_running();
            }
            lane.find_pieces();
        }
        self.set_inputs();
        if !self.periods_s.is_empty() {
            self.tick_due_clocks();
        }
        for lane in self.lanes.iter_mut() {
            lane.choose_step(&self.settings, &self.periods_s);
        }
        if self.settings.method.tableau().is_some() {
            self.batch.begin();
        } else {
            self.batch.evaluate();
        }
    }

    #[inline(always)]
    fn set_inputs(&mut self) {
        self.batch.clear_inputs();
        let lanes = &self.lanes;
        for &external in &self.moving {
            self.batch.set_input(external, |lane| lanes[lane].cubic(external));
        }
    }

    fn tick_due_clocks(&mut self) {
        for clock in 0..self.periods_s.len() {
            let period = self.periods_s[clock];
            let due = |lane: &Lane| match lane.phase {
                Phase::Idle | Phase::Settled => false,
                Phase::Settling => true,
                Phase::Running => {
                    lane.next_tick[clock] as f64 * period <= lane.time_s + SAME_TIME_S
                }
            };
            if !self.lanes.iter().any(due) {
                continue;
            }
            self.batch.evaluate();
            let zero = V::constant(0.0);
            let lanes = V::from_fn(|i| if due(&self.lanes[i]) { 1.0 } else { 0.0 });
            self.batch.tick(clock, zero.less(lanes));
            for lane in &mut self.lanes {
                lane.statistics.evaluations += 1;
                if lane.phase == Phase::Running && due(lane) {
                    lane.next_tick[clock] += 1;
                }
            }
        }
    }

    /// Records the lanes that stand on a sample; ends those that are through.
    #[inline(always)]
    fn take_samples(&mut self) {
        for index in 0..V::WIDTH {
            let lane = &mut self.lanes[index];
            if lane.phase == Phase::Settling {
                let rate = self.batch.largest_rate_per_s(index);
                if rate < AT_REST_PER_S
                    || lane.settling >= MOST_SETTLING_STEPS
                    || lane.time_s > LONGEST_SETTLING_S
                {
                    lane.phase = Phase::Settled;
                }
            }
            if lane.phase != Phase::Running {
                continue;
            }
            while lane.sample_time_s() <= lane.time_s + SAME_TIME_S {
                for (value, &slot) in self.values.iter_mut().zip(self.record) {
                    *value = self.batch.variable(index, slot as usize);
                }
                self.feed.sample(lane.case.job, lane.next_sample, &self.values);
                lane.next_sample += 1;
            }
            if lane.time_s + SAME_TIME_S >= lane.case.duration_s {
                lane.phase = Phase::Idle;
                self.feed.finish(lane.case.job, Ok(lane.statistics));
            }
        }
    }

    #[inline(always)]
    fn step(&mut self) {
        let h = V::from_fn(|lane| self.lanes[lane].step_s);
        let Some(tableau) = self.settings.method.tableau() else {
            self.batch.runge_kutta(h);
            self.end_step(V::constant(0.0), 3, 0);
            return;
        };
        let mut error = self.batch.rosenbrock(tableau, h);
        if self.lanes.iter().any(|lane| lane.phase == Phase::Settling) {
            // Accuracy does not matter on the way to rest. The most stable method
            // also comes to rest where the system itself would swing for ever.
            let settling =
                |i: usize| if self.lanes[i].phase == Phase::Settling { 1.0 } else { 0.0 };
            let settling = V::constant(0.0).less(V::from_fn(settling));
            error = self.batch.keep_first_stage(settling, error);
        }
        if !self.settings.land_on_samples {
            self.interpolate_samples(tableau, h, error);
        }
        self.end_step(error, tableau.stages() as u64 - 1, 1);
    }

    /// Samples between the beginning and the end of an accepted step.
    #[inline(always)]
    fn interpolate_samples(&mut self, tableau: &super::tableau::Tableau, h: V, error: V) {
        loop {
            let fraction = V::from_fn(|i| self.pending_fraction(i, error.lane(i)).unwrap_or(0.0));
            let any = (0..V::WIDTH).any(|i| self.pending_fraction(i, error.lane(i)).is_some());
            if !any {
                return;
            }
            self.batch.interpolate(tableau, h, fraction);
            for index in 0..V::WIDTH {
                if self.pending_fraction(index, error.lane(index)).is_none() {
                    continue;
                }
                for (value, &slot) in self.values.iter_mut().zip(self.record) {
                    *value = self.batch.variable(index, slot as usize);
                }
                let lane = &mut self.lanes[index];
                lane.statistics.evaluations += 1;
                self.feed.sample(lane.case.job, lane.next_sample, &self.values);
                lane.next_sample += 1;
            }
        }
    }

    /// Where in the step the next sample of a lane lies, strictly before its
    /// end.
    #[inline(always)]
    fn pending_fraction(&self, index: usize, error: f64) -> Option<f64> {
        let lane = &self.lanes[index];
        let accepted = self.accepts(error);
        let time = lane.sample_time_s();
        let inside = lane.phase == Phase::Running && time < lane.end_s - SAME_TIME_S;
        (accepted && inside).then(|| (time - lane.time_s) / lane.step_s)
    }

    #[inline(always)]
    fn accepts(&self, error: f64) -> bool {
        match self.settings.control {
            Control::Adaptive { tolerance, .. } => error <= tolerance,
            Control::Fixed { .. } => error.is_finite(),
        }
    }

    /// The factor by which each lane's step could grow for its error; without
    /// meaning where that is not finite.
    #[inline(always)]
    fn growth(&self, error: V) -> V {
        let order = self.settings.method.tableau().map_or(4, |t| t.order);
        let allowed = |lane: &Lane| lane.allowed(&self.settings).map_or(1.0, |(error, _)| error);
        let tolerance = V::from_fn(|i| allowed(&self.lanes[i]));
        let ratio = (error / tolerance).max(V::constant(1e-6));
        math::power(ratio, V::constant(-1.0 / order as f64)) * V::constant(0.9)
    }

    /// Accepts or rejects the step in every lane, and plans the next.
    #[inline(always)]
    fn end_step(&mut self, error: V, evaluations: u64, jacobians: u64) {
        let mut accepted = [false; MOST_LANES];
        let growth = self.growth(error);
        for (index, accepted) in accepted.iter_mut().enumerate().take(V::WIDTH) {
            let (error, growth) = (error.lane(index), growth.lane(index));
            // A poisoned value shows in the error, except without an estimate.
            let good = self.accepts(error) && (jacobians > 0 || self.batch.finite(index));
            let lane = &mut self.lanes[index];
            lane.statistics.evaluations += evaluations;
            lane.statistics.jacobians += jacobians;
            if matches!(lane.phase, Phase::Idle | Phase::Settled) {
                continue;
            }
            *accepted =
                if lane.phase == Phase::Settling { error <= LARGEST_SETTLING_CHANGE } else { good };
            if *accepted {
                lane.accept();
            } else {
                lane.statistics.rejected += 1;
                lane.rejections += 1;
            }
            lane.adapt(&self.settings, if error.is_finite() { growth } else { 0.1 });
            self.give_up_if_stuck(index, error);
        }
        let zero = V::constant(0.0);
        let mask = zero.less(V::from_fn(|i| if accepted[i] { 1.0 } else { 0.0 }));
        self.batch.accept(mask);
    }

    #[inline(always)]
    fn give_up_if_stuck(&mut self, index: usize, error: f64) {
        let fixed = matches!(self.settings.control, Control::Fixed { .. });
        let lane = &mut self.lanes[index];
        let stuck = lane.rejections > 0
            && (fixed || lane.rejections > MOST_REJECTIONS || lane.wanted_s < SMALLEST_STEP_S);
        if stuck {
            let cause = if error.is_finite() { Cause::StepTooSmall } else { Cause::NotFinite };
            let state = self.batch.worst_state(index);
            let failure = Failure { time_s: lane.time_s, state, cause };
            lane.phase = Phase::Idle;
            self.feed.finish(lane.case.job, Err(failure));
            // A lane with finite numbers again, until the next variant.
            let start = core::mem::take(&mut self.lanes[index].case.start);
            self.batch.set_states(index, &start);
            self.lanes[index].case.start = start;
        }
    }
}

/// The first step, s.
const FIRST_STEP_S: f64 = 1e-4;

impl<'a> Lane<'a> {
    fn new(case: Case<'a>, clocks: usize) -> Self {
        let phase = if case.settle { Phase::Settling } else { Phase::Running };
        let moves = |external: &usize| {
            let pieces = case.inputs[*external].pieces();
            pieces.len() > 1 || pieces[0][1..] != [0.0; 3]
        };
        Self {
            moving: (0..case.inputs.len()).filter(moves).map(|external| (external, 0)).collect(),
            phase,
            time_s: 0.0,
            wanted_s: FIRST_STEP_S,
            step_s: FIRST_STEP_S,
            end_s: 0.0,
            next_sample: 0,
            next_tick: vec![0; clocks],
            rejections: 0,
            settling: 0,
            statistics: Statistics::default(),
            case,
        }
    }

    fn copy(&self) -> Self {
        Self::new(self.case.clone(), self.next_tick.len())
    }

    fn begin_running(&mut self) {
        self.phase = Phase::Running;
        self.time_s = 0.0;
        self.wanted_s = FIRST_STEP_S;
        self.rejections = 0;
    }

    fn sample_time_s(&self) -> f64 {
        self.next_sample as f64 * self.case.sample_period_s
    }

    /// The time that inputs are taken at.
    fn input_time_s(&self) -> f64 {
        if self.phase == Phase::Running { self.time_s } else { 0.0 }
    }

    #[inline(always)]
    fn find_pieces(&mut self) {
        let time = self.input_time_s() + SAME_TIME_S;
        for (external, piece) in &mut self.moving {
            let breaks = self.case.inputs[*external].breaks_s();
            while breaks.get(*piece + 1).is_some_and(|&next| next <= time) {
                *piece += 1;
            }
        }
    }

    /// The cubic of an input from the beginning of the step.
    #[inline(always)]
    fn cubic(&self, external: usize) -> [f64; 4] {
        let input = self.case.inputs[external];
        let held = self.moving.iter().find(|(moving, _)| *moving == external);
        let piece = held.map_or(0, |&(_, piece)| piece);
        let [a, b, c, d] = input.pieces()[piece];
        let t = self.input_time_s() - input.breaks_s()[piece];
        // Before the first break and while settling the first value holds.
        if self.phase != Phase::Running || t < -SAME_TIME_S {
            return [a, 0.0, 0.0, 0.0];
        }
        [a + t * (b + t * (c + t * d)), b + t * (2.0 * c + t * 3.0 * d), c + 3.0 * t * d, d]
    }

    /// The next time that a step must not pass.
    #[inline(always)]
    fn next_event_s(&self, settings: &Settings, periods_s: &[f64]) -> f64 {
        let mut event = self.case.duration_s;
        let mut consider = |time: f64| {
            if time > self.time_s + SAME_TIME_S && time < event {
                event = time;
            }
        };
        if settings.land_on_samples {
            consider(self.sample_time_s());
            consider((self.next_sample + 1) as f64 * self.case.sample_period_s);
        }
        for (tick, period) in self.next_tick.iter().zip(periods_s) {
            consider(*tick as f64 * period);
        }
        for &(external, piece) in &self.moving {
            let breaks = self.case.inputs[external].breaks_s();
            if let Some(&time) = breaks.get(piece + 1) {
                consider(time);
            }
            consider(breaks[piece]);
        }
        event
    }

    /// Chooses the step: what the error control wants, but ending on the next
    /// event without leaving a crumb before it.
    #[inline(always)]
    fn choose_step(&mut self, settings: &Settings, periods_s: &[f64]) {
        match self.phase {
            Phase::Idle | Phase::Settled => {
                self.step_s = FIRST_STEP_S;
                return;
            }
            Phase::Settling => {
                // Sampled controllers act once per step here.
                let longest = periods_s.iter().copied().fold(f64::INFINITY, f64::min);
                self.step_s = if self.wanted_s < longest { self.wanted_s } else { longest };
                self.end_s = self.time_s + self.step_s;
                return;
            }
            Phase::Running => {}
        }
        let wanted = match settings.control {
            Control::Fixed { step_s } => step_s,
            Control::Adaptive { .. } => self.wanted_s,
        };
        let event = self.next_event_s(settings, periods_s);
        let left = event - self.time_s;
        if wanted >= left * 0.999 {
            self.step_s = left;
            self.end_s = event;
        } else if wanted * 2.0 > left && !matches!(settings.control, Control::Fixed { .. }) {
            self.step_s = left * 0.5;
            self.end_s = self.time_s + self.step_s;
        } else {
            self.step_s = wanted;
            self.end_s = self.time_s + wanted;
        }
    }

    #[inline(always)]
    fn accept(&mut self) {
        self.statistics.steps += 1;
        self.time_s = self.end_s;
        self.rejections = 0;
        if self.phase == Phase::Settling {
            self.settling += 1;
        }
    }

    /// Error that a step may have, and the longest step, s; `None` for fixed
    /// steps.
    #[inline(always)]
    fn allowed(&self, settings: &Settings) -> Option<(f64, f64)> {
        match (self.phase, settings.control) {
            (Phase::Settling, _) => Some((WANTED_SETTLING_CHANGE, 1e4)),
            (_, Control::Adaptive { tolerance, max_step_s }) => Some((tolerance, max_step_s)),
            (_, Control::Fixed { .. }) => None,
        }
    }

    /// The step for the next time, by a factor from the error of this one.
    #[inline(always)]
    fn adapt(&mut self, settings: &Settings, factor: f64) {
        let Some((_, longest)) = self.allowed(settings) else {
            return;
        };
        let most = if self.rejections > 0 { 1.0 } else { 6.0 };
        let next = self.step_s * factor.clamp(0.1, most);
        // A step that was cut short by an event says little about longer ones.
        let next = if self.rejections == 0 && next < self.wanted_s && factor >= 1.0 {
            self.wanted_s
        } else {
            next
        };
        self.wanted_s = if next < longest { next } else { longest };
    }
}
