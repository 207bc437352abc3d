//! The equations and the linear algebra of a twin as plain C99, for exported code that is to be proven.
//!
//! The control of the steps is the same for every system, so it is written by hand (`servotwin-export`). This module
//! prints what depends on the system:
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

use super::functions::{self, Traced};
use super::helpers::{Helper, print_helpers};
use super::printer::line;
use super::statements::{PREFIX, Statements, print_statements};
use crate::program::Program;
use crate::solver::Method;
use crate::symbol::{Function, Graph};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

const HEADING: &str = "/* Written by servotwin; do not edit. One operation per statement, so that no compiler may fuse two. */
#include \"servotwin_equations.h\"

#include <math.h>
#include <string.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

";

const POWER: &str = "double servotwin_twin_power(double x, double exponent)
{
    const double logarithm = servotwin_twin_log2(x);
    const double product = logarithm * exponent;
    return servotwin_twin_exp2(product);
}
";

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
    let tableau = method.tableau()?;
    let mut c = String::from(HEADING);
    let helpers = Function::ALL.into_iter().map(Helper::Function).collect();
    print_helpers(&mut c, &format!("double {PREFIX}"), helpers, || Statements);
    line(&mut c, format_args!("{POWER}"));
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
        print_function(&mut c, |graph| traced(graph, program));
    }
    for clock in 0..program.clocks().len() {
        print_function(&mut c, |graph| functions::tick(graph, program, clock));
    }
    for stage in 1..tableau.stages() {
        print_function(&mut c, |graph| functions::sums(graph, program, tableau, stage));
    }
    print_choice(&mut c, &sums(tableau.stages()));
    print_choice(&mut c, &ticks(program));
    Some(c)
}

/// Returns the C source of the directional derivatives, with the derivatives of states and inputs in `seeds`:
/// `servotwin_twin_tangent`. It needs the functions of [`write_twin`].
pub fn write_tangent(program: &Program) -> String {
    let mut c = String::from(HEADING);
    print_function(&mut c, |graph| functions::tangent(graph, program));
    c
}

fn print_function(c: &mut String, trace: impl for<'g> FnOnce(&'g Graph) -> Traced<'g>) {
    let graph = Graph::new();
    let traced = trace(&graph);
    let linkage = if is_one_of_several(&traced) { "static " } else { "" };
    let (name, arguments) = (&traced.name, arguments(traced.reads, traced.writes));
    line(c, format_args!("{linkage}void {PREFIX}_{name}({arguments})\n{{"));
    for array in traced.reads.iter().chain(traced.writes) {
        line(c, format_args!("    (void){array};"));
    }
    print_statements(c, &graph.expressions(), &traced.stores());
    line(c, format_args!("}}\n"));
}

/// The arguments of a function.
fn arguments(reads: &[&str], writes: &[&str]) -> String {
    let reads = reads.iter().map(|name| format!("const double *{name}"));
    let writes = writes.iter().map(|name| format!("double *{name}"));
    reads.chain(writes).collect::<Vec<_>>().join(", ")
}

/// Prints a function that calls one of several.
fn print_choice(c: &mut String, choice: &Choice) {
    let &Choice { name, number, reads, writes, own, .. } = choice;
    let head = arguments(reads, writes);
    line(c, format_args!("void {PREFIX}_{name}(int32_t {number}, {head})\n{{"));
    let given = || reads.iter().chain(writes).copied();
    let arrays = given().chain(own.map(|(name, _)| name)).collect::<Vec<_>>().join(", ");
    if let Some((own, length)) = own {
        line(c, format_args!("    double {own}[{length}];"));
    } else if choice.cases.is_empty() {
        given().for_each(|array| line(c, format_args!("    (void){array};")));
    }
    line(c, format_args!("    switch ({number}) {{"));
    for Case { number, stores } in &choice.cases {
        line(c, format_args!("    case {number}:"));
        line(c, format_args!("        {PREFIX}_{name}_{number}({arrays});"));
        stores.iter().for_each(|store| line(c, format_args!("        {store}")));
        line(c, format_args!("        break;"));
    }
    line(c, format_args!("    default:\n        break;\n    }}\n}}\n"));
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
