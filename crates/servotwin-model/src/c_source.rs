//! The C source of a system: its equations as plain C99, for a simulator that
//! has no Rust.
//!
//! Made by tracing the compiled program with [`Symbol`]s, so it is the same
//! text as everything else runs. The transcendental functions are traced too;
//! only rounding, scaling and splitting by powers of two are written out below.
//! Compiled without fused or reassociated arithmetic (`-ffp-contract=off`, no
//! `-ffast-math`) it gives the same numbers as [`Program::evaluate`] to the last
//! bit.
//!
//! The functions that [`write`] makes, named after a prefix, here `p`:
//!
//! | function | from | to |
//! |---|---|---|
//! | `p_constants` | effective parameters | constants of a variant |
//! | `p_held` | effective parameters | stand-ins of open signal inputs, zero for held values |
//! | `p_derivatives` | constants, states, inputs, held | derivatives of the states |
//! | `p_outputs` | the same | what was asked for |
//! | `p_tick_0` … | the same | held values after a tick of clock 0 … |
//!
//! Parameters are those of all components one after the other, faults applied
//! ([`Program::parameters`]).

use crate::program::{Observable, Program};
use crate::scalar::Scalar;
use crate::symbol::{self, Binary, Expression, Function, Graph, Operand, Symbol, Unary};
use alloc::collections::BTreeSet;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;
use core::fmt::Write;

/// A prefix that is no C identifier.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadPrefix(pub String);

impl core::fmt::Display for BadPrefix {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "'{}' is no C identifier: letters, digits and '_', no digit first", self.0)
    }
}

impl core::error::Error for BadPrefix {}

/// Writes the C source of a program. `outputs` are what `p_outputs` gives; with
/// none there is no such function.
///
/// # Errors
/// Where the prefix is no C identifier.
pub fn write(program: &Program, prefix: &str, outputs: &[Observable]) -> Result<String, BadPrefix> {
    let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    let valid =
        prefix.starts_with(letter) && prefix.chars().all(|c| letter(c) || c.is_ascii_digit());
    if !valid {
        return Err(BadPrefix(prefix.to_string()));
    }
    let names = Names::new(program);
    let mut functions = vec![constants(program), held(program)];
    functions.extend(evaluations(program, outputs));
    let calls = functions.iter().flat_map(|f| f.used()).collect();
    let mut c = String::new();
    heading(&mut c, program, prefix, &names, outputs);
    prelude(&mut c, prefix, &calls);
    for function in &functions {
        function.write(&mut c, prefix, &names);
    }
    Ok(c)
}

/// A function to be written: its graph and what it stores.
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

    /// The needed expressions with their numbers.
    fn live(&self) -> impl Iterator<Item = (usize, Expression)> {
        let needed = symbol::needed(&self.expressions, &self.values);
        let all = self.expressions.iter().copied().enumerate();
        all.filter(move |(node, _)| needed[*node])
    }

    /// The operations that need something of the prelude.
    fn used(&self) -> BTreeSet<Helper> {
        self.live().filter_map(|(_, expression)| Helper::of(expression)).collect()
    }

    fn phrases<'a>(&'a self, prefix: &'a str) -> Phrases<'a> {
        Phrases { prefix, expressions: &self.expressions }
    }

    fn write(&self, c: &mut String, prefix: &str, names: &Names) {
        let live: Vec<_> = self.live().collect();
        let reads = |array: &str| {
            let read = |&(_, e): &_| matches!(e, Expression::Variable(a, _) if a == array);
            live.iter().any(read)
        };
        let arguments: Vec<String> =
            self.arguments.iter().map(|a| format!("const double *{a}, ")).collect();
        let arguments = arguments.concat();
        line(c, format_args!("/* {} */", self.summary));
        let head = format!("void {prefix}_{}({arguments}double *{})", self.name, self.result);
        line(c, format_args!("{head};"));
        line(c, format_args!("{head}\n{{"));
        for unread in self.arguments.iter().filter(|a| !reads(a)) {
            line(c, format_args!("    (void){unread};"));
        }
        let phrases = self.phrases(prefix);
        for &(node, expression) in &live {
            let name = match expression {
                Expression::Variable(array, index) => names.of(array, index as usize),
                _ => None,
            };
            let comment = name.map_or(String::new(), |n| format!(" /* {n} */"));
            phrases.statement(c, node, &comment);
        }
        for (index, &value) in self.values.iter().enumerate() {
            line(c, format_args!("    {}[{index}] = {};", self.result, phrases.operand(value)));
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

/// The parameters of all components as variables.
pub(crate) fn parameter_symbols<'g>(program: &Program, graph: &'g Graph) -> Vec<Vec<Symbol<'g>>> {
    let mut index = 0;
    let components = program.network().components.iter();
    let mut next = |_: &f64| {
        index += 1;
        graph.variable("parameters", index - 1)
    };
    components.map(|c| c.parameters.iter().map(&mut next).collect()).collect()
}

/// Everything that evaluates the equations.
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

/// All variables of the program after an evaluation.
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

/// What people call the entries of the arrays.
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
            .flat_map(|c| {
                let declared = c.component.spec().parameters.iter();
                declared.map(move |p| described(&format!("{}.{}", c.id, p.name), p.unit.symbol()))
            })
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

/// A name with its unit, safe inside a comment.
fn described(name: &str, unit: &str) -> String {
    let name = name.replace("*/", "* /");
    if unit.is_empty() { name } else { format!("{name}, {unit}") }
}

fn line(c: &mut String, text: core::fmt::Arguments) {
    writeln!(c, "{text}").expect("a string takes any text");
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

/// Something of the prelude.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Helper {
    Round,
    Scaled,
    Mantissa,
    Exponent,
    Function(Function),
}

impl Helper {
    fn of(expression: Expression) -> Option<Self> {
        match expression {
            Expression::Unary(Unary::Round, _) => Some(Helper::Round),
            Expression::Unary(Unary::Mantissa, _) => Some(Helper::Mantissa),
            Expression::Unary(Unary::Exponent, _) => Some(Helper::Exponent),
            Expression::Unary(Unary::Call(function), _) => Some(Helper::Function(function)),
            Expression::Binary(Binary::Scaled, ..) => Some(Helper::Scaled),
            _ => None,
        }
    }

    /// The body of a helper that is written by hand; see `lanes/single.rs`.
    fn by_hand(self) -> Option<&'static str> {
        match self {
            Helper::Round => Some(ROUND),
            Helper::Scaled => Some(SCALED),
            Helper::Mantissa => Some(MANTISSA),
            Helper::Exponent => Some(EXPONENT),
            Helper::Function(_) => None,
        }
    }
}

const ROUND: &str = "rounded(double x)
{
    return (x + 6755399441055744.0) - 6755399441055744.0;
}
";

const SCALED: &str = "scaled(double x, double exponent)
{
    const double shifted = exponent + 6755399441055744.0;
    uint64_t bits;
    double power;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits << 52) + UINT64_C(0x3ff0000000000000);
    memcpy(&power, &bits, sizeof power);
    return x * power;
}
";

const MANTISSA: &str = "mantissa(double x)
{
    uint64_t bits;
    double mantissa;
    memcpy(&bits, &x, sizeof bits);
    bits += UINT64_C(0x3ff0000000000000) - UINT64_C(0x3fe6a09e667f3bcd);
    bits = (bits & UINT64_C(0x000fffffffffffff)) + UINT64_C(0x3fe6a09e667f3bcd);
    memcpy(&mantissa, &bits, sizeof mantissa);
    return mantissa;
}
";

const EXPONENT: &str = "exponent(double x)
{
    uint64_t bits;
    double exponent;
    memcpy(&bits, &x, sizeof bits);
    bits += UINT64_C(0x3ff0000000000000) - UINT64_C(0x3fe6a09e667f3bcd);
    bits = (bits >> 52) | UINT64_C(0x4330000000000000);
    memcpy(&exponent, &bits, sizeof exponent);
    return exponent - 4503599627371519.0;
}
";

/// The functions that are used, and those that they use.
fn prelude(c: &mut String, prefix: &str, used: &BTreeSet<Helper>) {
    let kernels: Vec<CFunction> = (used.iter())
        .filter_map(|helper| match helper {
            Helper::Function(function) => Some(kernel(*function)),
            _ => None,
        })
        .collect();
    let mut all = used.clone();
    all.extend(kernels.iter().flat_map(|k| k.used()));
    for body in all.iter().filter_map(|helper| helper.by_hand()) {
        line(c, format_args!("static double {prefix}_{body}"));
    }
    for kernel in &kernels {
        line(c, format_args!("static double {prefix}_{}(double x)\n{{", kernel.name));
        let phrases = kernel.phrases(prefix);
        for (node, _) in kernel.live() {
            phrases.statement(c, node, "");
        }
        line(c, format_args!("    return {};\n}}\n", phrases.operand(kernel.values[0])));
    }
}

fn kernel(function: Function) -> CFunction {
    let graph = Graph::new();
    let value = function.kernel(graph.variable(ARGUMENT, 0));
    let name = function.name().to_string();
    CFunction::new(name, "", &[], "", &graph, &[value])
}

/// The only argument of a kernel, which is no array.
const ARGUMENT: &str = "x";

/// Writes expressions as C.
struct Phrases<'a> {
    prefix: &'a str,
    expressions: &'a [Expression],
}

impl Phrases<'_> {
    /// An expression as a statement; nothing for one that is written where it
    /// is used.
    fn statement(&self, c: &mut String, node: usize, comment: &str) {
        let expression = self.expressions[node];
        if in_place(expression).is_some() {
            return;
        }
        let kind = if expression.is_truth() { "int" } else { "double" };
        let value = self.value(expression);
        line(c, format_args!("    const {kind} v{node} = {value};{comment}"));
    }

    fn value(&self, expression: Expression) -> String {
        match expression {
            Expression::Variable(array, index) => format!("{array}[{index}]"),
            Expression::Unary(operation, a) => self.unary(operation, &self.operand(a)),
            Expression::Binary(operation, a, b) => {
                self.binary(operation, &self.operand(a), &self.operand(b))
            }
            Expression::Less(a, b) => format!("{} < {}", self.operand(a), self.operand(b)),
            Expression::Select(truth, a, b) => {
                format!("v{truth} ? {} : {}", self.operand(a), self.operand(b))
            }
        }
    }

    fn unary(&self, operation: Unary, a: &str) -> String {
        let prefix = self.prefix;
        match operation {
            Unary::Negative => format!("-{a}"),
            Unary::SquareRoot => format!("sqrt({a})"),
            Unary::Absolute => format!("fabs({a})"),
            Unary::Round => format!("{prefix}_rounded({a})"),
            Unary::Mantissa => format!("{prefix}_mantissa({a})"),
            Unary::Exponent => format!("{prefix}_exponent({a})"),
            Unary::Call(function) => format!("{prefix}_{}({a})", function.name()),
        }
    }

    fn binary(&self, operation: Binary, a: &str, b: &str) -> String {
        match operation {
            Binary::Sum => format!("{a} + {b}"),
            Binary::Difference => format!("{a} - {b}"),
            Binary::Product => format!("{a} * {b}"),
            Binary::Quotient => format!("{a} / {b}"),
            Binary::Scaled => format!("{}_scaled({a}, {b})", self.prefix),
            Binary::Smaller => format!("{a} < {b} ? {a} : {b}"),
            Binary::Larger => format!("{b} < {a} ? {a} : {b}"),
        }
    }

    fn operand(&self, operand: Operand) -> String {
        match operand {
            Operand::Node(node) => {
                let short = in_place(self.expressions[node as usize]);
                short.unwrap_or_else(|| format!("v{node}"))
            }
            Operand::Constant(bits) => literal(f64::from_bits(bits)),
        }
    }
}

/// What needs no statement of its own: the argument of a kernel, and constants,
/// which no function both reads and writes.
fn in_place(expression: Expression) -> Option<String> {
    match expression {
        Expression::Variable(ARGUMENT, _) => Some(ARGUMENT.to_string()),
        Expression::Variable("constants", index) => Some(format!("constants[{index}]")),
        _ => None,
    }
}

/// The shortest decimal number that is read back to the same bits.
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
