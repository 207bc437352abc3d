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
use alloc::vec::Vec;

/// Returns the C source for a method; `None` for an explicit method.
pub fn write_twin(program: &Program, method: Method) -> Option<String> {
    let tableau = method.tableau()?;
    let mut c = String::from(HEADING);
    let helpers = Function::ALL.into_iter().map(Helper::Function).collect();
    print_helpers(&mut c, ("double", PREFIX), helpers, || Statements);
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
    print_sums(&mut c, tableau.stages());
    print_tick(&mut c, program);
    Some(c)
}

/// Returns the C source of the directional derivatives, with the derivatives of states and inputs in `seeds`:
/// `servotwin_twin_tangent`. It needs the functions of [`write_twin`].
pub fn write_tangent(program: &Program) -> String {
    let mut c = String::from(HEADING);
    print_function(&mut c, |graph| functions::tangent(graph, program));
    c
}

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

fn print_function(c: &mut String, trace: impl for<'g> FnOnce(&'g Graph) -> Traced<'g>) {
    let graph = Graph::new();
    let traced = trace(&graph);
    let reads = traced.reads.iter().map(|name| format!("const double *{name}"));
    let writes = traced.writes.iter().map(|name| format!("double *{name}"));
    let arguments: Vec<String> = reads.chain(writes).collect();
    // Functions with a number have a dispatcher.
    let linkage = if traced.name.ends_with(|c: char| c.is_ascii_digit()) { "static " } else { "" };
    let (name, arguments) = (&traced.name, arguments.join(", "));
    line(c, format_args!("{linkage}void {PREFIX}_{name}({arguments})\n{{"));
    for name in traced.reads.iter().chain(traced.writes) {
        line(c, format_args!("    (void){name};"));
    }
    print_statements(c, Statements, &graph.expressions(), &traced.stores());
    line(c, format_args!("}}\n"));
}

fn print_sums(c: &mut String, stages: usize) {
    let head = "void servotwin_twin_sums(int32_t stage, const double *reciprocal, const double *y, const double *stages,
    double *variables, double *right)";
    let cases = (1..stages)
        .map(|stage| format!("{PREFIX}_sums_{stage}(reciprocal, y, stages, variables, right);"));
    print_dispatcher(c, head, "stage", cases.enumerate().map(|(i, call)| (i + 1, call)), "");
}

fn print_tick(c: &mut String, program: &Program) {
    let head =
        "void servotwin_twin_tick(int32_t clock, const double *constants, double *variables)";
    let most = program.clocks().iter().map(|clock| clock.exchanges.len()).max();
    let cases = program.clocks().iter().enumerate().map(|(index, clock)| {
        let mut call = format!("{PREFIX}_tick_{index}(constants, variables, next);");
        for (place, (_, to)) in clock.exchanges.iter().enumerate() {
            call += &format!("\n        variables[{to}] = next[{place}];");
        }
        (index, call)
    });
    let next = most.map_or(String::from("    (void)constants;\n    (void)variables;\n"), |most| {
        format!("    double next[{}];\n", most.max(1))
    });
    print_dispatcher(c, head, "clock", cases, &next);
}

fn print_dispatcher(
    c: &mut String,
    head: &str,
    number: &str,
    cases: impl Iterator<Item = (usize, String)>,
    before: &str,
) {
    line(c, format_args!("{head}\n{{\n{before}    switch ({number}) {{"));
    for (case, call) in cases {
        line(c, format_args!("    case {case}:\n        {call}\n        break;"));
    }
    line(c, format_args!("    default:\n        break;\n    }}\n}}\n"));
}
