//! diffsol's BDF on the same Rust equations, as `f64`, with the exact Jacobian.

use crate::{Task, Work, processor_seconds};
use diffsol::{NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};
use servotwin_model::program::Program;
use servotwin_model::signal::Piecewise;
use std::cell::RefCell;

/// One variant's equations.
struct Equations<'a> {
    program: &'a Program,
    command: &'a Piecewise,
    /// Its place among the inputs.
    moving: usize,
    constants: Vec<f64>,
    variables: Vec<f64>,
    gradients: Vec<f64>,
    /// Where the gradients were taken: states and time.
    at: Vec<f64>,
    piece: usize,
}

impl Equations<'_> {
    fn load(&mut self, states: &[f64], time: f64) {
        let breaks = self.command.breaks_s();
        while self.piece + 1 < self.command.pieces().len() && breaks[self.piece + 1] <= time {
            self.piece += 1;
        }
        while self.piece > 0 && breaks[self.piece] > time {
            self.piece -= 1;
        }
        let [a, b, c, d] = self.command.pieces()[self.piece];
        let t = time - breaks[self.piece];
        self.variables[..states.len()].copy_from_slice(states);
        self.variables[self.program.externals().start + self.moving] =
            a + t * (b + t * (c + t * d));
    }

    fn rates(&mut self, states: &[f64], time: f64, rates: &mut [f64]) {
        self.load(states, time);
        self.program.evaluate(&self.constants, &mut self.variables);
        rates.copy_from_slice(&self.variables[self.program.derivatives()]);
    }

    /// The Jacobian times a vector; the Jacobian is kept for the next vector.
    fn product(&mut self, states: &[f64], time: f64, vector: &[f64], result: &mut [f64]) {
        let (old, old_time) = self.at.split_at(states.len());
        if old != states || old_time != [time] {
            self.load(states, time);
            self.program.evaluate_with_jacobian(
                &self.constants,
                &mut self.variables,
                &mut self.gradients,
            );
            self.at = [states, &[time]].concat();
        }
        result.fill(0.0);
        for (row, column, value) in self.program.jacobian().values(&self.gradients) {
            result[row] += value * vector[column];
        }
    }
}

/// Runs all variants, one after the other.
pub(crate) fn solve(task: &Task, tolerance: f64) -> Work {
    let mut work = Work { runs: Vec::new(), seconds: 0.0, steps: 0.0 };
    for variant in 0..task.faults.len() {
        let begin = processor_seconds();
        let (run, steps) = solve_one(task, variant, tolerance);
        work.seconds += processor_seconds() - begin;
        work.runs.push(run);
        work.steps += steps as f64;
    }
    work
}

fn equations<'a>(task: &Task<'a>, variant: usize) -> Equations<'a> {
    let program = task.program;
    let parameters = program.parameters(&[task.faults[variant]]);
    let mut variables = task.starts[variant].clone();
    variables.extend(task.inputs.iter().map(|input| input.pieces()[0][0]));
    variables.extend(program.stand_in_values(&parameters));
    variables.resize(program.memory(), 0.0);
    Equations {
        program,
        command: task.inputs[task.moving],
        moving: task.moving,
        constants: program.block_constants(&parameters),
        variables,
        gradients: vec![0.0; program.jacobian().slots()],
        at: vec![f64::NAN; program.states().len() + 1],
        piece: 0,
    }
}

fn solve_one(task: &Task, variant: usize, tolerance: f64) -> (Vec<f64>, usize) {
    let equations = RefCell::new(equations(task, variant));
    let start = &task.starts[variant];
    let mut problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tolerance)
        .atol(task.program.states().iter().map(|s| tolerance * s.scale))
        .rhs_implicit(
            |x, _p, t, y| equations.borrow_mut().rates(x, t, y),
            |x, _p, t, v, y| equations.borrow_mut().product(x, t, v, y),
        )
        .init(|_p, _t, y| y.copy_from_slice(start), start.len())
        .build()
        .expect("a good problem");
    problem.ode_options.max_nonlinear_solver_failures = 10_000_000;
    problem.ode_options.max_error_test_failures = 10_000_000;
    let mut solver = problem.bdf::<NalgebraLU<f64>>().expect("a solver");
    let mut run = Vec::with_capacity(task.samples() * start.len());
    run.extend_from_slice(start);
    let mut steps = 0;
    let mut next = 1;
    solver.set_stop_time(task.duration_s).expect("a time to come");
    loop {
        let reason = match solver.step() {
            Ok(reason) => reason,
            Err(error) => {
                println!("  diffsol, variant {variant}: {error}");
                run.resize(task.samples() * start.len(), f64::INFINITY);
                return (run, steps);
            }
        };
        steps += 1;
        let ended = matches!(reason, OdeSolverStopReason::TstopReached);
        while next < task.samples() {
            let time = (next as f64 * task.period_s).min(task.duration_s);
            if time > solver.state().t && !ended {
                break;
            }
            let states = solver.interpolate(time.min(solver.state().t)).expect("inside the step");
            run.extend_from_slice(states.batch_as_slice(0));
            next += 1;
        }
        if ended {
            return (run, steps);
        }
    }
}
