//! The equations of a system as plain C99, for simulators without Rust.
//!
//! The text comes from a trace of the compiled program, so its arithmetic is that of all other evaluations.
//! The trace includes the transcendental functions; `helpers` adds rounding, scaling and splitting by powers of two.
//! Compiled without fused or reassociated arithmetic (`-ffp-contract=off`, no `-ffast-math`), the C returns the same
//! bits as [`Program::evaluate`].
//!
//! The functions that [`write_equations`] prints, here with the prefix `p`:
//!
//! | function | reads | fills |
//! |---|---|---|
//! | `p_constants` | effective parameters | constants of a variant |
//! | `p_held` | effective parameters | stand-ins of open signal inputs, zero for held values |
//! | `p_derivatives` | constants, states, inputs, held | derivatives of the states |
//! | `p_outputs` | the same | requested outputs |
//! | `p_tick_0` … | the same | held values after a tick of clock 0 … |
//!
//! The array of parameters lists the components one after the other, with faults applied ([`Program::parameters`]).

use super::helpers::{Helper, print_helpers, unary_text};
use super::printer::{Dialect, Printer, Stores, line, needed_expressions};
use super::{described, parameter_symbols};
use crate::program::{Observable, Program};
use crate::scalar::Scalar;
use crate::symbol::{Binary, Expression, Graph, Operand, Symbol, Unary};
use alloc::collections::BTreeSet;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

/// The prefix is not a C identifier.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadPrefix(pub String);

impl core::fmt::Display for BadPrefix {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "'{}' is no C identifier: letters, digits and '_', no digit first", self.0)
    }
}

impl core::error::Error for BadPrefix {}

/// Returns the C source of a program. `p_outputs` returns `outputs`; without outputs the function is missing.
///
/// # Errors
/// The prefix is not a C identifier.
pub fn write_equations(
    program: &Program,
    prefix: &str,
    outputs: &[Observable],
) -> Result<String, BadPrefix> {
    let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    let valid =
        prefix.starts_with(letter) && prefix.chars().all(|c| letter(c) || c.is_ascii_digit());
    if !valid {
        return Err(BadPrefix(prefix.to_string()));
    }
    let names = Names::new(program);
    let mut functions = vec![constants(program), held(program)];
    functions.extend(evaluations(program, outputs));
    let called: BTreeSet<Helper> = functions.iter().flat_map(|f| f.helpers()).collect();
    let mut c = String::new();
    heading(&mut c, program, prefix, &names, outputs);
    let head = format!("static double {prefix}");
    print_helpers(&mut c, &head, called, || Equations { prefix, names: &names });
    for function in &functions {
        function.print(&mut c, prefix, &names);
    }
    Ok(c)
}

/// A function that fills one array.
struct CFunction {
    name: String,
    summary: &'static str,
    /// Names of the arrays it reads.
    arguments: &'static [&'static str],
    /// The array it fills.
    result: &'static str,
    expressions: Vec<Expression>,
    values: Vec<Operand>,
}

/// The arrays that all evaluations read.
const ARRAYS: &[&str] = &["constants", "states", "inputs", "held"];

impl CFunction {
    fn new(
        name: String,
        summary: &'static str,
        arguments: &'static [&'static str],
        result: &'static str,
        graph: &Graph,
        values: &[Symbol],
    ) -> Self {
        let values = values.iter().map(|v| v.operand()).collect();
        Self { name, summary, arguments, result, expressions: graph.expressions(), values }
    }

    fn needed(&self) -> impl Iterator<Item = Expression> {
        needed_expressions(&self.expressions, &self.values)
    }

    fn helpers(&self) -> impl Iterator<Item = Helper> {
        self.needed().filter_map(Helper::called_by)
    }

    fn reads(&self, array: &str) -> bool {
        self.needed().any(|e| matches!(e, Expression::Variable(read, _) if read == array))
    }

    fn print(&self, c: &mut String, prefix: &str, names: &Names) {
        let arguments: Vec<String> =
            self.arguments.iter().map(|a| format!("const double *{a}, ")).collect();
        let arguments = arguments.concat();
        line(c, format_args!("/* {} */", self.summary));
        let head = format!("void {prefix}_{}({arguments}double *{})", self.name, self.result);
        line(c, format_args!("{head};"));
        line(c, format_args!("{head}\n{{"));
        for unread in self.arguments.iter().filter(|a| !self.reads(a)) {
            line(c, format_args!("    (void){unread};"));
        }
        let dialect = Equations { prefix, names };
        let mut printer = Printer { dialect, expressions: &self.expressions };
        // The caller may pass one array as argument and result, so every value is known before the first store.
        printer.statements(c, &self.values, &Stores::new());
        for (index, &value) in self.values.iter().enumerate() {
            let store = printer.dialect.store(self.result, index, &printer.operand(value));
            line(c, format_args!("    {store};"));
        }
        line(c, format_args!("}}\n"));
    }
}

fn constants(program: &Program) -> CFunction {
    let graph = Graph::new();
    let values = program.block_constants(&parameter_symbols(program, &graph));
    let summary = "the constants of a variant, from its parameters with the faults applied";
    CFunction::new("constants".into(), summary, &["parameters"], "constants", &graph, &values)
}

fn held(program: &Program) -> CFunction {
    let graph = Graph::new();
    let values = program.stand_in_values(&parameter_symbols(program, &graph));
    let summary = "what stands in for open signal inputs, and zero for values held by clocks";
    CFunction::new("held".into(), summary, &["parameters"], "held", &graph, &values)
}

/// The functions that evaluate the equations: derivatives, outputs, ticks.
fn evaluations(program: &Program, outputs: &[Observable]) -> Vec<CFunction> {
    let graph = Graph::new();
    let constants: Vec<Symbol> =
        (0..program.constants()).map(|i| graph.variable("constants", i)).collect();
    let stand_ins = program.stand_ins();
    let variables = traced(program, &graph, &constants);
    let function = |name: String, summary, result, values: &[Symbol]| {
        CFunction::new(name, summary, ARRAYS, result, &graph, values)
    };
    let derivatives = &variables[program.derivatives()];
    let summary = "the derivatives of the states";
    let mut functions = vec![function("derivatives".into(), summary, "derivatives", derivatives)];
    if !outputs.is_empty() {
        let values: Vec<Symbol> = outputs.iter().map(|o| variables[o.slot as usize]).collect();
        functions.push(function("outputs".into(), "what was asked for", "outputs", &values));
    }
    for (index, clock) in program.clocks().iter().enumerate() {
        let mut ticked = variables.clone();
        clock.sequence.trace(&constants, &mut ticked);
        for &(from, to) in &clock.exchanges {
            ticked[to as usize] = ticked[from as usize];
        }
        let summary = "the held values after a tick of this clock";
        let values = &ticked[stand_ins.clone()];
        functions.push(function(format!("tick_{index}"), summary, "held_next", values));
    }
    functions
}

/// The variables of the program after an evaluation.
fn traced<'g>(program: &Program, graph: &'g Graph, constants: &[Symbol<'g>]) -> Vec<Symbol<'g>> {
    let mut variables = vec![Symbol::constant(0.0); program.memory()];
    let places = [
        ("states", 0..program.states().len()),
        ("inputs", program.externals()),
        ("held", program.stand_ins()),
    ];
    for (array, range) in places {
        for (index, variable) in variables[range].iter_mut().enumerate() {
            *variable = graph.variable(array, index);
        }
    }
    program.trace(constants, &mut variables);
    variables
}

/// The names of the array entries, with units, for comments.
struct Names {
    parameters: Vec<String>,
    states: Vec<String>,
    inputs: Vec<String>,
    held: Vec<String>,
}

impl Names {
    fn new(program: &Program) -> Self {
        let network = program.network();
        let parameters: Vec<String> = (network.components.iter())
            .flat_map(|c| c.parameter_names().zip(c.component.parameters))
            .map(|(name, declared)| described(&name, declared.unit.symbol()))
            .collect();
        let states = program.states().iter().map(|s| described(&s.name, s.unit.symbol()));
        let inputs = network.inputs.iter().map(|i| described(&i.id, i.unit.symbol()));
        let graph = Graph::new();
        let stand_ins = program.stand_in_values(&parameter_symbols(program, &graph));
        let held = stand_ins.iter().map(|value| match value.expression() {
            Some(Expression::Variable(_, parameter)) => parameters[parameter as usize].clone(),
            _ => "held by a clock".to_string(),
        });
        let (states, inputs, held) = (states.collect(), inputs.collect(), held.collect());
        Self { parameters, states, inputs, held }
    }

    fn of(&self, array: &str, index: usize) -> Option<&str> {
        let names = match array {
            "parameters" => &self.parameters,
            "states" => &self.states,
            "inputs" => &self.inputs,
            "held" => &self.held,
            _ => return None,
        };
        names.get(index).map(String::as_str)
    }
}

fn heading(c: &mut String, program: &Program, prefix: &str, names: &Names, outputs: &[Observable]) {
    line(c, format_args!("/* Equations of a system, written by servotwin. C99."));
    line(c, format_args!(" *"));
    line(c, format_args!(" * Compile without fused or reassociated arithmetic, for example"));
    line(c, format_args!(" *     cc -std=c99 -O2 -ffp-contract=off"));
    line(c, format_args!(" * and the numbers are those of servotwin to the last bit."));
    let outputs: Vec<String> =
        outputs.iter().map(|o| described(&o.name, o.unit.symbol())).collect();
    let lists = [
        ("parameters", &names.parameters),
        ("states", &names.states),
        ("inputs", &names.inputs),
        ("held", &names.held),
        ("outputs", &outputs),
    ];
    for (array, list) in lists {
        line(c, format_args!(" *\n * {array}:"));
        for (index, name) in list.iter().enumerate() {
            line(c, format_args!(" *   [{index}] {name}"));
        }
    }
    let periods: Vec<f64> = program.clock_periods_s().collect();
    for (index, period) in periods.iter().enumerate() {
        line(c, format_args!(" *\n * {prefix}_tick_{index} is due every {period:?} s."));
    }
    line(c, format_args!(" */\n"));
    line(c, format_args!("#include <math.h>\n#include <stdint.h>\n#include <string.h>\n"));
    let sizes = lists.map(|(array, list)| (array, list.len()));
    for (array, size) in sizes.into_iter().chain([("constants", program.constants())]) {
        let (prefix, array) = (prefix.to_uppercase(), array.to_uppercase());
        line(c, format_args!("#define {prefix}_{array} {size}"));
    }
    line(c, format_args!(""));
}

/// C99 for one number of type `double`.
struct Equations<'a> {
    prefix: &'a str,
    names: &'a Names,
}

impl Dialect for Equations<'_> {
    fn literal(&self, value: f64) -> String {
        literal(value)
    }

    fn unary(&mut self, operation: Unary, a: &str) -> String {
        unary_text(self.prefix, operation, a)
    }

    fn call(&self, operation: Binary, a: &str, b: &str) -> String {
        match operation {
            Binary::Smaller => format!("{a} < {b} ? {a} : {b}"),
            Binary::Larger => format!("{b} < {a} ? {a} : {b}"),
            _ => format!("{}_scaled({a}, {b})", self.prefix),
        }
    }

    fn less(&self, a: &str, b: &str) -> String {
        format!("{a} < {b}")
    }

    fn select(&self, truth: &str, yes: &str, no: &str) -> String {
        format!("{truth} ? {yes} : {no}")
    }

    /// No function writes constants, so each is read where it is used.
    fn has_statement(&self, _node: usize, expression: Expression) -> bool {
        !matches!(expression, Expression::Variable("constants", _))
    }

    fn held_entry(&self, node: usize) -> String {
        unreachable!("expression {node} has a statement")
    }

    fn comment(&self, expression: Expression) -> String {
        let name = match expression {
            Expression::Variable(array, index) => self.names.of(array, index as usize),
            _ => None,
        };
        name.map_or(String::new(), |name| format!(" /* {name} */"))
    }
}

/// The shortest decimal number that C reads back to the same bits.
fn literal(value: f64) -> String {
    if value.is_nan() {
        "NAN".to_string()
    } else if value.is_infinite() {
        let sign = if value < 0.0 { "-" } else { "" };
        format!("({sign}INFINITY)")
    } else if value.is_sign_negative() {
        format!("({value:?})")
    } else {
        format!("{value:?}")
    }
}
