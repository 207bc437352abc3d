//! One variant, stepped from sample to sample by its user: the twin that runs beside an actuator.
//!
//! ```text
//! let mut twin = Twin::new(&program, Settings::campaign(), 0.01, between);
//! twin.load(&program.parameters(&[]));
//! twin.settle(&inputs_at_rest)?;          // stands on sample 0
//! loop { twin.step(&inputs)?; twin.value(slot); }
//! ```
//!
//! It is the object of which a campaign keeps many in its lanes, so its values are those of a
//! campaign with the same inputs, bit for bit. After [`Twin::new`] nothing is allocated by
//! [`Twin::step`].

use super::bank::{Bank, Numbers};
use super::course::{Course, Moving, Phase};
use super::kernels::Kernels;
use super::{Failure, SMALLEST_STEP_S, Settings, Statistics};
use crate::program::{Program, Slot};
use crate::signal::hermite_piece;
use alloc::vec::Vec;

/// How an input goes from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// It keeps the value of the sample before.
    Hold,
    /// Straight.
    Line,
    /// A cubic with the slopes that are given at the samples.
    Cubic,
}

/// An input at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Knot {
    /// In the input's SI unit.
    pub value: f64,
    /// Its slope, per second; read for [`Between::Cubic`] only.
    pub slope_per_s: f64,
}

impl From<f64> for Knot {
    /// A value without a slope.
    fn from(value: f64) -> Self {
        Knot { value, slope_per_s: 0.0 }
    }
}

/// Everything that a twin remembers, to go on later with the same bits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Number of the sample that it stands on.
    pub sample: u64,
    /// The step that the error control wants, s.
    pub wanted_s: f64,
    /// How much work it took lately.
    pub effort: f64,
    /// The states.
    pub states: Vec<f64>,
    /// The external inputs, the stand-ins and what clocks hold.
    pub held: Vec<f64>,
    /// For each clock, the number of its next tick.
    pub next_tick: Vec<u64>,
    /// The inputs at the sample.
    pub inputs: Vec<Knot>,
}

/// A virtual twin in real time; see the module.
pub struct Twin<'p> {
    bank: Bank<'p, f64>,
    between: Vec<Between>,
    period_s: f64,
    /// The inputs at the sample it stands on.
    inputs: Vec<Knot>,
    /// Constants and stand-ins that hold from the next sample on.
    loaded: Option<(Vec<f64>, Vec<f64>)>,
}

/// Its only lane.
const LANE: usize = 0;

/// The latest time of a snapshot, s: thirty years.
const LONGEST_TIME_S: f64 = 1e9;
/// The longest step of a snapshot, s.
const LONGEST_STEP_S: f64 = 1e4;
/// The most attempts of a snapshot within a second.
const MOST_EFFORT: f64 = 1e12;

impl<'p> Twin<'p> {
    /// A twin with samples every `period_s` seconds; `between` for each external input of the
    /// program. Steps end on samples, whatever the settings say.
    ///
    /// # Panics
    /// If `between` is of another length than the program's inputs, the period is not positive, or the
    /// method is explicit: it cannot search the rest that a run starts from.
    pub fn new(
        program: &'p Program,
        settings: Settings,
        period_s: f64,
        between: Vec<Between>,
    ) -> Self {
        assert_eq!(between.len(), program.externals().len(), "one way for each input");
        assert!(period_s > 0.0, "samples are apart");
        assert!(settings.method.tableau().is_some(), "the method is implicit");
        let settings = Settings { land_on_samples: true, ..settings };
        let inputs = alloc::vec![Knot::default(); between.len()];
        let bank = Bank::new(program, settings, None);
        let mut twin = Self { bank, between, period_s, inputs, loaded: None };
        twin.restart(false);
        twin
    }

    /// The system.
    pub fn program(&self) -> &'p Program {
        self.bank.program
    }

    /// Takes steps by compiled functions from now on, of [`Level::Single`](crate::lanes::Level): the same bits, sooner.
    /// Whether they are of that level, and are taken.
    pub fn use_kernels(&mut self, kernels: &'p Kernels) -> bool {
        self.bank.use_kernels(kernels)
    }

    /// Puts the parameters of a variant in ([`Program::parameters`]). On the way they hold from the
    /// next sample on that it comes to.
    pub fn load(&mut self, parameters: &[Vec<f64>]) {
        let program = self.bank.program;
        let constants = program.block_constants(parameters);
        self.loaded = Some((constants, program.stand_in_values(parameters)));
    }

    /// Searches the steady state at constant inputs, from a first guess
    /// ([`Program::first_guess`]), and stands on sample 0 there.
    ///
    /// # Errors
    /// Where the search met numbers that are not finite.
    pub fn settle(&mut self, inputs: &[Knot], guess: &[f64]) -> Result<(), Failure> {
        self.inputs.copy_from_slice(inputs);
        self.restart(true);
        self.take_loaded();
        self.bank.set_states(LANE, guess);
        self.bank.reset_held(LANE);
        for (external, knot) in self.inputs.iter().enumerate() {
            self.bank.set_input(LANE, external, knot.value);
        }
        while self.course().seeks_rest() {
            self.bank.begin();
            if self.course().seeks_rest() {
                self.attempt()?;
            }
        }
        self.stand();
        Ok(())
    }

    /// Goes on to the next sample, where the inputs are `inputs`.
    ///
    /// # Errors
    /// Where the solver could not go on; only [`Twin::settle`] and [`Twin::restore`] help then.
    pub fn step(&mut self, inputs: &[Knot]) -> Result<(), Failure> {
        if let Some(failure) = self.course().failure {
            return Err(failure);
        }
        self.lead_to(inputs);
        while !self.bank.courses[LANE].is_at_sample() {
            self.attempt()?;
            if !self.bank.courses[LANE].is_at_sample() {
                self.bank.begin();
            }
        }
        self.inputs.copy_from_slice(inputs);
        self.stand();
        Ok(())
    }

    /// A variable at the sample it stands on.
    pub fn value(&self, slot: Slot) -> f64 {
        self.bank.variable(LANE, slot)
    }

    /// The number of the sample it stands on.
    pub fn sample(&self) -> u64 {
        self.course().next_sample - 1
    }

    /// Time since rest, s.
    pub fn time_s(&self) -> f64 {
        self.course().time_s
    }

    /// The work that it took so far.
    pub fn statistics(&self) -> Statistics {
        self.course().statistics
    }

    /// What it remembers; `snapshot`'s memory is used again.
    pub fn save(&self, snapshot: &mut Snapshot) {
        let course = self.course();
        snapshot.sample = self.sample();
        snapshot.wanted_s = course.wanted_s;
        snapshot.effort = course.effort;
        snapshot.states.clear();
        snapshot.states.extend(self.bank.states(LANE));
        snapshot.held.clear();
        snapshot.held.extend(self.bank.held(LANE));
        snapshot.next_tick.clone_from(&course.next_tick);
        snapshot.inputs.clone_from(&self.inputs);
    }

    /// Goes on from what a twin of the same program, settings and parameters remembered.
    ///
    /// # Errors
    /// What does not fit: a list of another length, or a number with which no twin ever stood on a sample.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), &'static str> {
        let held = self.bank.held(LANE).count();
        let fits = |fits: bool, what| if fits { Ok(()) } else { Err(what) };
        fits(snapshot.states.len() == self.bank.program.states().len(), "states")?;
        fits(snapshot.held.len() == held, "held values")?;
        fits(snapshot.next_tick.len() == self.bank.clocks(), "clocks")?;
        fits(snapshot.inputs.len() == self.inputs.len(), "inputs")?;
        self.check_numbers(snapshot)?;
        self.inputs.copy_from_slice(&snapshot.inputs);
        self.take_loaded();
        self.restart(false);
        let course = &mut self.bank.courses[LANE];
        course.wanted_s = snapshot.wanted_s;
        course.effort = snapshot.effort;
        course.next_sample = snapshot.sample;
        course.time_s = course.sample_time_s();
        course.next_tick.copy_from_slice(&snapshot.next_tick);
        self.bank.set_states(LANE, &snapshot.states);
        self.bank.set_held(LANE, &snapshot.held);
        self.stand();
        Ok(())
    }

    /// That the numbers of a snapshot are such that the way goes on from them: a step of zero, or one that is too short
    /// to change the time, would never end.
    fn check_numbers(&self, snapshot: &Snapshot) -> Result<(), &'static str> {
        let fits = |fits: bool, what| if fits { Ok(()) } else { Err(what) };
        let time_s = snapshot.sample as f64 * self.period_s;
        let is_finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
        let mut inputs = snapshot.inputs.iter().flat_map(|knot| [knot.value, knot.slope_per_s]);
        // A clock has ticked up to the sample, and not beyond its next tick.
        let is_next = |(&tick, &period_s): (&u64, &f64)| {
            let next_s = tick as f64 * period_s;
            (time_s - period_s..=time_s + 2.0 * period_s).contains(&next_s)
        };
        fits(time_s <= LONGEST_TIME_S, "time")?;
        fits((SMALLEST_STEP_S..=LONGEST_STEP_S).contains(&snapshot.wanted_s), "step")?;
        fits((0.0..=MOST_EFFORT).contains(&snapshot.effort), "effort")?;
        fits(is_finite(&snapshot.states), "states")?;
        fits(is_finite(&snapshot.held), "held values")?;
        fits(inputs.all(f64::is_finite), "inputs")?;
        fits(snapshot.next_tick.iter().zip(self.bank.periods_s()).all(is_next), "clocks")
    }

    fn course(&self) -> &Course {
        &self.bank.courses[LANE]
    }

    /// A new way, with inputs that all move.
    fn restart(&mut self, settle: bool) {
        let moving = self.inputs.iter().enumerate().map(|(external, knot)| Moving {
            external,
            from_s: 0.0,
            until_s: f64::INFINITY,
            piece: [knot.value, 0.0, 0.0, 0.0],
        });
        let clocks = self.bank.clocks();
        self.bank.courses[LANE] = Course::new(settle, moving.collect(), self.period_s, clocks);
        self.bank.find_moving();
    }

    fn take_loaded(&mut self) {
        if let Some((constants, stand_ins)) = self.loaded.take() {
            let numbers = Numbers { constants: &constants, stand_ins: &stand_ins };
            self.bank.set_numbers(LANE, numbers);
        }
    }

    /// Evaluates at the sample that it has come to, as far as the inputs are known: values and
    /// slopes.
    fn stand(&mut self) {
        self.take_loaded();
        let course = &mut self.bank.courses[LANE];
        if course.phase == Phase::Settled {
            course.begin_running();
        }
        let from_s = course.sample_time_s();
        for ((moving, knot), between) in
            course.moving.iter_mut().zip(&self.inputs).zip(&self.between)
        {
            let slope = if *between == Between::Cubic { knot.slope_per_s } else { 0.0 };
            moving.from_s = from_s;
            moving.piece = [knot.value, slope, 0.0, 0.0];
        }
        self.bank.begin();
        self.bank.courses[LANE].next_sample += 1;
    }

    /// The pieces of the inputs up to the next sample. What the evaluation at this one knew of them
    /// stays true, except that a straight line's slope was not known.
    fn lead_to(&mut self, next: &[Knot]) {
        let course = &mut self.bank.courses[LANE];
        let to_s = course.sample_time_s();
        let mut surprise = false;
        for (((moving, from), to), between) in
            course.moving.iter_mut().zip(&self.inputs).zip(next).zip(&self.between)
        {
            let length_s = to_s - moving.from_s;
            let before = moving.piece;
            moving.piece = match between {
                Between::Hold => [from.value, 0.0, 0.0, 0.0],
                Between::Line => [from.value, (to.value - from.value) / length_s, 0.0, 0.0],
                Between::Cubic => hermite_piece(
                    length_s,
                    [from.value, to.value],
                    [from.slope_per_s, to.slope_per_s],
                ),
            };
            surprise |= before[..2] != moving.piece[..2];
        }
        if surprise {
            self.bank.begin();
        } else {
            self.bank.load_inputs();
        }
    }

    fn attempt(&mut self) -> Result<(), Failure> {
        let (_, error) = self.bank.attempt();
        self.bank.conclude(error);
        self.course().failure.map_or(Ok(()), Err)
    }
}
