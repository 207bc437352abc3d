//! Many variants, one after the other in each lane.

use super::bank::{Bank, Numbers};
use super::course::{Course, Moving, Phase};
use super::kernels::Kernels;
use super::tableau::Tableau;
use super::{Failure, SAME_TIME_S, Settings, Statistics};
use crate::lanes::{Kernel, Level, dispatch};
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
    /// What changes on the way, in the order of time.
    pub changes: Vec<Change>,
}

/// Other parameters from a moment on: a fault that begins, grows or goes away. Steps end there.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// When, s.
    pub time_s: f64,
    /// As in [`Case`].
    pub constants: Vec<f64>,
    /// As in [`Case`].
    pub stand_ins: Vec<f64>,
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

/// Runs everything that the feed gives, with the lanes of a level, and with compiled functions where there are some.
pub fn run<'a>(
    program: &Program,
    kernels: Option<&Kernels>,
    settings: Settings,
    record: &[Slot],
    level: Level,
    feed: &mut dyn Feed<'a>,
) {
    struct All<'w, 'a> {
        program: &'w Program,
        kernels: Option<&'w Kernels>,
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
            let bank = Bank::new(self.program, self.settings, self.kernels);
            Ensemble::<V>::new(bank, self.record, self.feed).run(self.under_way, self.narrower)
        }
    }
    let mut under_way = Vec::new();
    for level in core::iter::successors(Some(level), |level| level.narrower()) {
        let narrower = level.narrower().map_or(0, Level::width);
        let feed = &mut *feed;
        let all = All { program, kernels, settings, record, feed, under_way, narrower };
        under_way = dispatch(level, all);
        if under_way.is_empty() {
            return;
        }
    }
}

/// A variant between two steps, to go on in another lane.
struct UnderWay<'a> {
    job: Job<'a>,
    course: Course,
    states: Vec<f64>,
    held: Vec<f64>,
}

/// The variant in a lane, and how much of its inputs and changes lies behind it.
struct Job<'a> {
    case: Case<'a>,
    /// For each input that moves, the number of its piece.
    pieces: Vec<usize>,
    changed: usize,
}

impl<'a> Job<'a> {
    fn new(case: Case<'a>) -> Self {
        let moving = case.inputs.iter().enumerate();
        let moving = moving.filter_map(|(external, input)| Moving::first(external, input)).count();
        Self { case, pieces: vec![0; moving], changed: 0 }
    }

    /// The way before it.
    fn course(&self, clocks: usize) -> Course {
        let case = &self.case;
        let inputs = case.inputs.iter().enumerate();
        let moving = inputs.filter_map(|(external, input)| Moving::first(external, input));
        let moving = moving.collect();
        let mut course = Course::new(case.settle, moving, case.sample_period_s, clocks);
        course.halt_s = self.halt_s();
        course
    }

    /// What the variant is made of now.
    fn numbers(&self) -> Numbers<'_> {
        let changes = &self.case.changes[..self.changed];
        match changes.last() {
            Some(Change { constants, stand_ins, .. }) => Numbers { constants, stand_ins },
            None => Numbers { constants: &self.case.constants, stand_ins: &self.case.stand_ins },
        }
    }

    /// The time of the next change, or the end.
    fn halt_s(&self) -> f64 {
        let change = self.case.changes.get(self.changed).map_or(f64::INFINITY, |c| c.time_s);
        change.min(self.case.duration_s)
    }

    /// The pieces of the inputs that hold where the course stands.
    #[inline(always)]
    fn find_pieces(&mut self, course: &mut Course) {
        let running = matches!(course.phase, Phase::Running);
        let time = if running { course.time_s } else { 0.0 } + SAME_TIME_S;
        if time < course.next_break_s {
            return;
        }
        course.next_break_s = f64::INFINITY;
        for (piece, moving) in self.pieces.iter_mut().zip(&mut course.moving) {
            let input = self.case.inputs[moving.external];
            while moving.until_s <= time {
                *piece += 1;
                *moving = Moving::nth(moving.external, input, *piece);
            }
            let begins_later = moving.from_s > time;
            let next_break_s = if begins_later { moving.from_s } else { moving.until_s };
            course.next_break_s = course.next_break_s.min(next_break_s);
        }
    }
}

struct Ensemble<'p, 'f, 'a, V> {
    record: &'p [Slot],
    feed: &'f mut dyn Feed<'a>,
    bank: Bank<'p, V>,
    /// One for each lane; lanes that never had a variant have the first one's.
    jobs: Vec<Job<'a>>,
    values: Vec<f64>,
}

impl<'p, 'f, 'a, V: Lanes> Ensemble<'p, 'f, 'a, V> {
    fn new(bank: Bank<'p, V>, record: &'p [Slot], feed: &'f mut dyn Feed<'a>) -> Self {
        let values = vec![0.0; record.len()];
        let jobs = Vec::with_capacity(V::WIDTH);
        Self { record, feed, bank, jobs, values }
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
                if self.bank.courses[lane].phase == Phase::Idle {
                    self.load(lane);
                }
            }
            let busy = self.bank.courses.iter().filter(|c| c.phase != Phase::Idle).count();
            if self.feed.cancelled() || busy == 0 {
                return Vec::new();
            }
            if busy <= narrower {
                return self.give_back();
            }
            self.change();
            self.bank.begin();
            self.take_samples();
            self.step();
        }
    }

    /// Fills the lanes for the first time; lanes without a variant of their own
    /// get the numbers of the first, which run along unseen.
    fn fill(&mut self, under_way: Vec<UnderWay<'a>>) -> bool {
        for UnderWay { job, course, states, held } in under_way {
            let lane = self.jobs.len();
            self.jobs.push(job);
            self.put(lane);
            self.bank.courses[lane] = course;
            self.bank.set_states(lane, &states);
            self.bank.set_held(lane, &held);
        }
        while self.jobs.len() < V::WIDTH {
            let Some(case) = self.feed.next() else { break };
            let lane = self.jobs.len();
            self.jobs.push(Job::new(case));
            self.start(lane);
        }
        if self.jobs.is_empty() {
            return false;
        }
        for lane in self.jobs.len()..V::WIDTH {
            self.jobs.push(Job::new(self.jobs[0].case.clone()));
            self.put(lane);
        }
        self.bank.find_moving();
        true
    }

    /// The variants in the lanes, between two steps.
    fn give_back(mut self) -> Vec<UnderWay<'a>> {
        let mut under_way = Vec::new();
        for (lane, job) in core::mem::take(&mut self.jobs).into_iter().enumerate() {
            let course = self.bank.courses[lane].clone();
            if course.phase != Phase::Idle {
                let (states, held) = (self.bank.states(lane), self.bank.held(lane).collect());
                under_way.push(UnderWay { job, course, states, held });
            }
        }
        under_way
    }

    fn load(&mut self, lane: usize) {
        if let Some(case) = self.feed.next() {
            self.jobs[lane] = Job::new(case);
            self.start(lane);
            self.bank.find_moving();
        }
    }

    fn start(&mut self, lane: usize) {
        self.bank.courses[lane] = self.jobs[lane].course(self.bank.clocks());
        self.put(lane);
    }

    /// Copies the job of a lane into its memory.
    fn put(&mut self, lane: usize) {
        let job = &self.jobs[lane];
        let case = &job.case;
        self.bank.set_numbers(lane, job.numbers());
        self.bank.reset_held(lane);
        self.bank.set_states(lane, &case.start);
        for (external, input) in case.inputs.iter().enumerate() {
            self.bank.set_input(lane, external, input.pieces()[0][0]);
        }
    }

    /// What changes where the lanes stand: inputs, and in some of them parameters.
    #[inline(always)]
    fn change(&mut self) {
        for (lane, job) in self.jobs.iter_mut().enumerate() {
            let course = &mut self.bank.courses[lane];
            if course.phase == Phase::Settled {
                course.begin_running();
            }
            job.find_pieces(course);
            if course.phase != Phase::Running {
                continue;
            }
            let time_s = course.time_s;
            let before = job.changed;
            while job
                .case
                .changes
                .get(job.changed)
                .is_some_and(|c| c.time_s <= time_s + SAME_TIME_S)
            {
                job.changed += 1;
            }
            if job.changed > before {
                course.halt_s = job.halt_s();
                self.bank.set_numbers(lane, job.numbers());
            }
        }
    }

    /// Records the lanes that stand on a sample; ends those that are through.
    #[inline(always)]
    fn take_samples(&mut self) {
        for (lane, job) in self.jobs.iter().enumerate() {
            while self.bank.courses[lane].is_at_sample() {
                for (value, &slot) in self.values.iter_mut().zip(self.record) {
                    *value = self.bank.variable(lane, slot);
                }
                let course = &mut self.bank.courses[lane];
                self.feed.sample(job.case.job, course.next_sample as usize, &self.values);
                course.next_sample += 1;
            }
            let course = &mut self.bank.courses[lane];
            let ended = course.time_s + SAME_TIME_S >= job.case.duration_s;
            if course.phase == Phase::Running && ended {
                course.phase = Phase::Idle;
                self.feed.finish(job.case.job, Ok(course.statistics));
            }
        }
    }

    #[inline(always)]
    fn step(&mut self) {
        let (h, error) = self.bank.attempt();
        if let Some(tableau) = self.bank.settings.method.tableau()
            && !self.bank.settings.land_on_samples
        {
            self.interpolate_samples(tableau, h, error);
        }
        self.bank.conclude(error);
        for (job, course) in self.jobs.iter().zip(&mut self.bank.courses) {
            if let Some(failure) = course.failure.take() {
                self.feed.finish(job.case.job, Err(failure));
            }
        }
    }

    /// Samples between the beginning and the end of an accepted step.
    #[inline(always)]
    fn interpolate_samples(&mut self, tableau: &Tableau, h: V, error: V) {
        loop {
            let fraction = V::from_fn(|i| self.pending_fraction(i, error.lane(i)).unwrap_or(0.0));
            let any = (0..V::WIDTH).any(|i| self.pending_fraction(i, error.lane(i)).is_some());
            if !any {
                return;
            }
            self.bank.interpolate(tableau, h, fraction);
            for lane in 0..V::WIDTH {
                if self.pending_fraction(lane, error.lane(lane)).is_none() {
                    continue;
                }
                for (value, &slot) in self.values.iter_mut().zip(self.record) {
                    *value = self.bank.variable(lane, slot);
                }
                let course = &mut self.bank.courses[lane];
                course.statistics.evaluations += 1;
                let job = self.jobs[lane].case.job;
                self.feed.sample(job, course.next_sample as usize, &self.values);
                course.next_sample += 1;
            }
        }
    }

    /// Where in the step the next sample of a lane lies, strictly before its
    /// end.
    #[inline(always)]
    fn pending_fraction(&self, lane: usize, error: f64) -> Option<f64> {
        let course = &self.bank.courses[lane];
        let time = course.sample_time_s();
        let inside = course.phase == Phase::Running && time < course.end_s - SAME_TIME_S;
        (self.bank.accepts(lane, error) && inside).then(|| (time - course.time_s) / course.step_s)
    }
}
