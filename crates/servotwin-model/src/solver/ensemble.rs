//! Many variants in lanes; each lane runs one after another.

use super::compiled_step::CompiledSteps;
use super::lane_state::{LaneState, Moving, Phase};
use super::lane_stepper::{LaneStepper, Numbers};
use super::tableau::Tableau;
use super::{SAME_TIME_S, SolverFailure, SolverSettings, Statistics};
use crate::lanes::{Kernel, Level, dispatch};
use crate::program::{Program, Slot};
use crate::scalar::Lanes;
use crate::signal::Piecewise;
use alloc::vec;
use alloc::vec::Vec;

/// A variant, ready to run.
#[derive(Clone)]
pub struct Job<'a> {
    /// Its number, which is returned with every result.
    pub number: usize,
    /// Constants of all blocks: [`Program::block_constants`].
    pub constants: Vec<f64>,
    /// Values of the stand-ins: [`Program::stand_in_values`].
    pub stand_ins: Vec<f64>,
    /// One signal per external input.
    pub inputs: Vec<&'a Piecewise>,
    /// The states at time zero.
    pub start: Vec<f64>,
    /// Whether to search for the steady state first, from `start` and with the
    /// inputs of time zero.
    pub settle: bool,
    /// Duration of the run, s.
    pub duration_s: f64,
    /// Time between samples, s.
    pub sample_period_s: f64,
    /// Changes of parameters during the run, ordered by time.
    pub changes: Vec<Change>,
}

/// Changes the parameters at a time: a fault begins, grows or disappears. A step ends there.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Time of the change, s.
    pub time_s: f64,
    /// Constants of all blocks, as in [`Job`].
    pub constants: Vec<f64>,
    /// Values of the stand-ins, as in [`Job`].
    pub stand_ins: Vec<f64>,
}

/// Supplies variants and receives their results.
pub trait JobSource<'a> {
    /// The next variant; `None` when there are no more.
    fn next(&mut self) -> Option<Job<'a>>;
    /// Receives a sample of the recorded slots.
    fn sample(&mut self, job: usize, index: usize, values: &[f64]);
    /// Receives the outcome of a variant.
    fn finish(&mut self, job: usize, outcome: Result<Statistics, SolverFailure>);
    /// Whether to stop now and drop the variants in the lanes without a result.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Runs all variants of the source with the lanes of a level, and with compiled functions where available.
pub fn run<'a>(
    program: &Program,
    compiled: Option<&CompiledSteps>,
    settings: SolverSettings,
    record: &[Slot],
    level: Level,
    source: &mut dyn JobSource<'a>,
) {
    struct All<'w, 'a> {
        program: &'w Program,
        compiled: Option<&'w CompiledSteps>,
        settings: SolverSettings,
        record: &'w [Slot],
        source: &'w mut dyn JobSource<'a>,
        under_way: Vec<UnderWay<'a>>,
        /// The number of lanes of the next narrower level; 0 if there is none.
        narrower: usize,
    }
    impl<'a> Kernel for All<'_, 'a> {
        type Output = Vec<UnderWay<'a>>;
        #[inline(always)]
        fn run<V: Lanes>(self) -> Vec<UnderWay<'a>> {
            let stepper = LaneStepper::new(self.program, self.settings, self.compiled);
            Ensemble::<V>::new(stepper, self.record, self.source).run(self.under_way, self.narrower)
        }
    }
    let mut under_way = Vec::new();
    for level in core::iter::successors(Some(level), |level| level.narrower()) {
        let narrower = level.narrower().map_or(0, Level::width);
        let source = &mut *source;
        let all = All { program, compiled, settings, record, source, under_way, narrower };
        under_way = dispatch(level, all);
        if under_way.is_empty() {
            return;
        }
    }
}

/// A variant between two steps that will continue in another lane.
struct UnderWay<'a> {
    active: ActiveJob<'a>,
    lane_state: LaneState,
    states: Vec<f64>,
    held: Vec<f64>,
}

/// The variant in a lane, with its current input pieces and parameter changes.
struct ActiveJob<'a> {
    job: Job<'a>,
    /// For each input that changes with time, the index of its piece.
    pieces: Vec<usize>,
    changed: usize,
}

impl<'a> ActiveJob<'a> {
    fn new(job: Job<'a>) -> Self {
        let moving = job.inputs.iter().enumerate();
        let moving = moving.filter_map(|(external, input)| Moving::first(external, input)).count();
        Self { job, pieces: vec![0; moving], changed: 0 }
    }

    /// The initial lane state.
    fn lane_state(&self, clocks: usize) -> LaneState {
        let job = &self.job;
        let inputs = job.inputs.iter().enumerate();
        let moving = inputs.filter_map(|(external, input)| Moving::first(external, input));
        let moving = moving.collect();
        let mut lane_state = LaneState::new(job.settle, moving, job.sample_period_s, clocks);
        lane_state.halt_s = self.halt_s();
        lane_state
    }

    /// The variant's current numbers.
    fn numbers(&self) -> Numbers<'_> {
        let changes = &self.job.changes[..self.changed];
        match changes.last() {
            Some(Change { constants, stand_ins, .. }) => Numbers { constants, stand_ins },
            None => Numbers { constants: &self.job.constants, stand_ins: &self.job.stand_ins },
        }
    }

    /// The time of the next change, or the end.
    fn halt_s(&self) -> f64 {
        let change = self.job.changes.get(self.changed).map_or(f64::INFINITY, |c| c.time_s);
        change.min(self.job.duration_s)
    }

    /// Updates the input pieces to the lane's current time.
    #[inline(always)]
    fn find_pieces(&mut self, lane_state: &mut LaneState) {
        // The steady state is that before the run: an input that jumps at time zero moves the system.
        let running = matches!(lane_state.phase, Phase::Running);
        let time = if running { lane_state.time_s + SAME_TIME_S } else { -SAME_TIME_S };
        if time < lane_state.next_break_s {
            return;
        }
        lane_state.next_break_s = f64::INFINITY;
        for (piece, moving) in self.pieces.iter_mut().zip(&mut lane_state.moving) {
            let input = self.job.inputs[moving.external];
            while moving.until_s <= time {
                *piece += 1;
                *moving = Moving::nth(moving.external, input, *piece);
            }
            let begins_later = moving.from_s > time;
            let next_break_s = if begins_later { moving.from_s } else { moving.until_s };
            lane_state.next_break_s = lane_state.next_break_s.min(next_break_s);
        }
    }
}

struct Ensemble<'p, 'f, 'a, V> {
    record: &'p [Slot],
    source: &'f mut dyn JobSource<'a>,
    stepper: LaneStepper<'p, V>,
    /// One for each lane; lanes that never had a variant hold a copy of the first lane's.
    active_jobs: Vec<ActiveJob<'a>>,
    values: Vec<f64>,
}

impl<'p, 'f, 'a, V: Lanes> Ensemble<'p, 'f, 'a, V> {
    fn new(
        stepper: LaneStepper<'p, V>,
        record: &'p [Slot],
        source: &'f mut dyn JobSource<'a>,
    ) -> Self {
        let values = vec![0.0; record.len()];
        let active_jobs = Vec::with_capacity(V::WIDTH);
        Self { record, source, stepper, active_jobs, values }
    }

    /// Continues the variants under way, then runs those of the source. When the source is
    /// exhausted and `narrower` lanes suffice, returns the remaining variants.
    #[inline(always)]
    fn run(mut self, under_way: Vec<UnderWay<'a>>, narrower: usize) -> Vec<UnderWay<'a>> {
        if !self.fill(under_way) {
            return Vec::new();
        }
        loop {
            for lane in 0..V::WIDTH {
                if self.stepper.lane_states[lane].phase == Phase::Idle {
                    self.load(lane);
                }
            }
            let occupied =
                self.stepper.lane_states.iter().filter(|c| c.phase != Phase::Idle).count();
            if self.source.cancelled() || occupied == 0 {
                return Vec::new();
            }
            if occupied <= narrower {
                return self.give_back();
            }
            self.change();
            self.stepper.begin();
            self.take_samples();
            self.step();
        }
    }

    /// Fills the lanes for the first time. Lanes without a variant copy the first one;
    /// their results are not used.
    fn fill(&mut self, under_way: Vec<UnderWay<'a>>) -> bool {
        for UnderWay { active, lane_state, states, held } in under_way {
            let lane = self.active_jobs.len();
            self.active_jobs.push(active);
            self.put(lane);
            self.stepper.lane_states[lane] = lane_state;
            self.stepper.set_states(lane, &states);
            self.stepper.set_held(lane, &held);
        }
        while self.active_jobs.len() < V::WIDTH {
            let Some(job) = self.source.next() else { break };
            let lane = self.active_jobs.len();
            self.active_jobs.push(ActiveJob::new(job));
            self.start(lane);
        }
        if self.active_jobs.is_empty() {
            return false;
        }
        for lane in self.active_jobs.len()..V::WIDTH {
            self.active_jobs.push(ActiveJob::new(self.active_jobs[0].job.clone()));
            self.put(lane);
        }
        self.stepper.find_moving();
        true
    }

    /// The variants in the lanes, between two steps.
    fn give_back(mut self) -> Vec<UnderWay<'a>> {
        let mut under_way = Vec::new();
        for (lane, active) in core::mem::take(&mut self.active_jobs).into_iter().enumerate() {
            let lane_state = self.stepper.lane_states[lane].clone();
            if lane_state.phase != Phase::Idle {
                let (states, held) = (self.stepper.states(lane), self.stepper.held(lane).collect());
                under_way.push(UnderWay { active, lane_state, states, held });
            }
        }
        under_way
    }

    fn load(&mut self, lane: usize) {
        if let Some(job) = self.source.next() {
            self.active_jobs[lane] = ActiveJob::new(job);
            self.start(lane);
            self.stepper.find_moving();
        }
    }

    fn start(&mut self, lane: usize) {
        self.stepper.lane_states[lane] = self.active_jobs[lane].lane_state(self.stepper.clocks());
        self.put(lane);
    }

    /// Copies a lane's active job into its memory.
    fn put(&mut self, lane: usize) {
        let active = &self.active_jobs[lane];
        let job = &active.job;
        self.stepper.set_numbers(lane, active.numbers());
        self.stepper.reset_held(lane);
        self.stepper.set_states(lane, &job.start);
        for (external, input) in job.inputs.iter().enumerate() {
            self.stepper.set_input(lane, external, input.pieces()[0][0]);
        }
    }

    /// Applies the changes due at the lanes' current times: inputs and parameters.
    #[inline(always)]
    fn change(&mut self) {
        for (lane, active) in self.active_jobs.iter_mut().enumerate() {
            let lane_state = &mut self.stepper.lane_states[lane];
            if lane_state.phase == Phase::Settled {
                lane_state.begin_running();
            }
            active.find_pieces(lane_state);
            if lane_state.phase != Phase::Running {
                continue;
            }
            let time_s = lane_state.time_s;
            let before = active.changed;
            while active
                .job
                .changes
                .get(active.changed)
                .is_some_and(|c| c.time_s <= time_s + SAME_TIME_S)
            {
                active.changed += 1;
            }
            if active.changed > before {
                lane_state.halt_s = active.halt_s();
                self.stepper.set_numbers(lane, active.numbers());
            }
        }
    }

    /// Records the lanes that have reached a sample; ends those that are finished.
    #[inline(always)]
    fn take_samples(&mut self) {
        for (lane, active) in self.active_jobs.iter().enumerate() {
            while self.stepper.lane_states[lane].is_at_sample() {
                for (value, &slot) in self.values.iter_mut().zip(self.record) {
                    *value = self.stepper.variable(lane, slot);
                }
                let lane_state = &mut self.stepper.lane_states[lane];
                self.source.sample(
                    active.job.number,
                    lane_state.next_sample as usize,
                    &self.values,
                );
                lane_state.next_sample += 1;
            }
            let lane_state = &mut self.stepper.lane_states[lane];
            let ended = lane_state.time_s + SAME_TIME_S >= active.job.duration_s;
            if lane_state.phase == Phase::Running && ended {
                lane_state.phase = Phase::Idle;
                self.source.finish(active.job.number, Ok(lane_state.statistics));
            }
        }
    }

    #[inline(always)]
    fn step(&mut self) {
        let (h, error) = self.stepper.attempt();
        if let Some(tableau) = self.stepper.settings.method.tableau()
            && !self.stepper.settings.land_on_samples
        {
            self.interpolate_samples(tableau, h, error);
        }
        self.stepper.conclude(error);
        for (active, lane_state) in self.active_jobs.iter().zip(&mut self.stepper.lane_states) {
            if let Some(failure) = lane_state.failure.take() {
                self.source.finish(active.job.number, Err(failure));
            }
        }
    }

    /// Records samples between the beginning and the end of an accepted step.
    #[inline(always)]
    fn interpolate_samples(&mut self, tableau: &Tableau, h: V, error: V) {
        loop {
            let fraction = V::from_fn(|i| self.pending_fraction(i, error.lane(i)).unwrap_or(0.0));
            let any = (0..V::WIDTH).any(|i| self.pending_fraction(i, error.lane(i)).is_some());
            if !any {
                return;
            }
            self.stepper.interpolate(tableau, h, fraction);
            for lane in 0..V::WIDTH {
                if self.pending_fraction(lane, error.lane(lane)).is_none() {
                    continue;
                }
                for (value, &slot) in self.values.iter_mut().zip(self.record) {
                    *value = self.stepper.variable(lane, slot);
                }
                let lane_state = &mut self.stepper.lane_states[lane];
                lane_state.statistics.evaluations += 1;
                let active = self.active_jobs[lane].job.number;
                self.source.sample(active, lane_state.next_sample as usize, &self.values);
                lane_state.next_sample += 1;
            }
        }
    }

    /// The position of a lane's next sample as a fraction of the step; `None` if it
    /// is not strictly before the step's end.
    #[inline(always)]
    fn pending_fraction(&self, lane: usize, error: f64) -> Option<f64> {
        let lane_state = &self.stepper.lane_states[lane];
        let time = lane_state.sample_time_s();
        let inside = lane_state.phase == Phase::Running && time < lane_state.end_s - SAME_TIME_S;
        (self.stepper.accepts(lane, error) && inside)
            .then(|| (time - lane_state.time_s) / lane_state.step_s)
    }
}
