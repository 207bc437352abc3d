//! The equations and the linear algebra of a twin as plain C99 or Rust, for exported code that is to be proven.
//!
//! The control of the steps is the same for every system, so it is written by hand (`servotwin-export`). This module
//! prints what depends on the system, here with the names of C; in Rust they have no prefix:
//!
//! | function | reads | fills |
//! |---|---|---|
//! | `servotwin_twin_faults` | intensities | parameters, which hold those without a fault |
//! | `servotwin_twin_constants` | parameters | constants of a variant |
//! | `servotwin_twin_stand_ins` | parameters | variables that stand in for open signal inputs |
//! | `servotwin_twin_evaluate` | constants, variables | sums and derivatives |
//! | `servotwin_twin_begin` | the same | these and the gradients |
//! | `servotwin_twin_motion` | the same | derivatives |
//! | `servotwin_twin_factor`, `servotwin_twin_solve_first`, `servotwin_twin_solve` | | the stages of a step |
//! | `servotwin_twin_sums` | stage | argument and right-hand side of the stage |
//! | `servotwin_twin_tick` | clock | what a clock computes and holds |
//! | `servotwin_twin_power` | x > 0, exponent | |
//!
//! The statements of both languages come from one printer; a [`TwinLanguage`] spells what stands around them.

mod c;
mod rust;

use super::functions::{self, Traced};
use super::helpers::{Frame, Helper, print_helpers};
use super::printer::{Dialect, line};
use super::statements::print_statements;
use crate::program::Program;
use crate::solver::Method;
use crate::symbol::{Function, Graph};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use c::C;
use rust::Rust;

/// What stands around the statements of a twin's functions.
trait TwinLanguage: Copy {
    /// The dialect of the statements.
    type Statements: Dialect;

    fn statements(self) -> Self::Statements;

    /// The beginning of the file. A clock passes on at most `most_held` values; without clocks there are none.
    fn heading(self, most_held: Option<usize>) -> String;

    fn frame(self) -> Frame<'static>;

    /// The function that takes a power.
    fn power(self) -> &'static str;

    /// Everything before the statements of a function, up to and including its brace.
    fn begin(self, traced: &Traced) -> String;

    /// Prints a function that calls one of several.
    fn print_choice(self, c: &mut String, choice: &Choice);
}

/// A function that calls one of several by their number.
struct Choice {
    name: &'static str,
    /// The argument with the number.
    number: &'static str,
    /// Arrays that it only reads.
    reads: &'static [&'static str],
    /// Arrays that it writes.
    writes: &'static [&'static str],
    /// An array of its own with its length, which the called functions write last.
    own: Option<(&'static str, usize)>,
    cases: Vec<Case>,
}

/// One of the functions.
struct Case {
    number: usize,
    /// Statements after the call.
    stores: Vec<String>,
}

/// Returns the C source for a method; `None` for an explicit method.
pub fn write_twin(program: &Program, method: Method) -> Option<String> {
    write(C, program, method)
}

/// The same in Rust: a module beside `twin_sizes` with the lengths of the arrays.
pub fn write_rust_twin(program: &Program, method: Method) -> Option<String> {
    write(Rust, program, method)
}

fn write(language: impl TwinLanguage, program: &Program, method: Method) -> Option<String> {
    let tableau = method.tableau()?;
    let mut c = language.heading(most_held(program));
    let helpers = Function::ALL.into_iter().map(Helper::Function).collect();
    print_helpers(&mut c, language.frame(), helpers, || language.statements());
    line(&mut c, format_args!("{}", language.power()));
    for traced in [
        functions::faults,
        functions::block_constants,
        functions::stand_ins,
        functions::evaluate,
        functions::begin,
        functions::motion,
        functions::factor,
        functions::solve_first,
        functions::solve,
    ] {
        print_function(&mut c, language, |graph| traced(graph, program));
    }
    for clock in 0..program.clocks().len() {
        print_function(&mut c, language, |graph| functions::tick(graph, program, clock));
    }
    for stage in 1..tableau.stages() {
        print_function(&mut c, language, |graph| functions::sums(graph, program, tableau, stage));
    }
    language.print_choice(&mut c, &sums(tableau.stages()));
    language.print_choice(&mut c, &ticks(program));
    Some(c)
}

/// Returns the C source of the directional derivatives, with the derivatives of states and inputs in `seeds`:
/// `servotwin_twin_tangent`. It needs the functions of [`write_twin`].
pub fn write_tangent(program: &Program) -> String {
    let mut c = C.heading(most_held(program));
    print_function(&mut c, C, |graph| functions::tangent(graph, program));
    c
}

fn print_function(
    c: &mut String,
    language: impl TwinLanguage,
    trace: impl for<'g> FnOnce(&'g Graph) -> Traced<'g>,
) {
    let graph = Graph::new();
    let traced = trace(&graph);
    line(c, format_args!("{}", language.begin(&traced)));
    print_statements(c, language.statements(), &graph.expressions(), &traced.stores());
    line(c, format_args!("}}\n"));
}

/// Whether a function is called by a [`Choice`] alone: its name ends with a number.
fn is_one_of_several(traced: &Traced) -> bool {
    traced.name.ends_with(|c: char| c.is_ascii_digit())
}

fn sums(stages: usize) -> Choice {
    Choice {
        name: "sums",
        number: "stage",
        reads: &["reciprocal", "y", "stages"],
        writes: &["variables", "right"],
        own: None,
        cases: (1..stages).map(|number| Case { number, stores: vec![] }).collect(),
    }
}

fn ticks(program: &Program) -> Choice {
    let cases = program.clocks().iter().enumerate().map(|(number, clock)| {
        let exchanges = clock.exchanges.iter().enumerate();
        let stores = exchanges.map(|(place, (_, to))| format!("variables[{to}] = next[{place}];"));
        Case { number, stores: stores.collect() }
    });
    Choice {
        name: "tick",
        number: "clock",
        reads: &["constants"],
        writes: &["variables"],
        own: most_held(program).map(|length| ("next", length)),
        cases: cases.collect(),
    }
}

/// The most values that a clock passes on, at least one; `None` without clocks.
fn most_held(program: &Program) -> Option<usize> {
    program.clocks().iter().map(|clock| clock.exchanges.len().max(1)).max()
}
