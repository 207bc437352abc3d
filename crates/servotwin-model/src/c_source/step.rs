//! A step of the solver as straight-line C, for [`CompiledStep`](crate::solver::CompiledStep).
//!
//! The interpreted step finds its numbers through lists, because the lists describe any system.
//! That costs half of its instructions. C for one system needs no lists: the compiler keeps numbers in registers, and
//! the step takes two thirds of the time. The text comes from a trace of the functions that walk the lists, so it does
//! the same arithmetic in the same order and returns the same bits.
//!
//! One text serves every width. `-DWIDTH` is the number of lanes in a register: 8 for AVX-512, 4 for AVX2, or 1.
//! `-DSTRIDE` is the number of lanes in the arrays. Fused and reassociated arithmetic must be off
//! (`-ffp-contract=off`).
//!
//! Some expressions depend only on constants, on parameters that replace signals and on external inputs. These
//! expressions are *cached*: they keep their values as long as their sources do. `update` recomputes them and stores
//! them in the array `cached`, where `begin` and `motion` read them. Its argument `changed` has one bit per input
//! (`input_bit`) and one for everything else (`NUMBERS`). `update` is a separate function because its branches would
//! split the straight-line code of `begin` and `motion`; the compiler schedules only between branches.

use super::functions::{self, Traced};
use super::printer::{Body, Dialect, Printer, Stores, line};
use crate::program::Program;
use crate::solver::Method;
use crate::solver::step::{NUMBERS, input_bit};
use crate::symbol::{self, Binary, Expression, Function, Graph, Operand, Unary};
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;
use core::num::FpCategory;

/// Returns the C source of the steps of a method; `None` for an explicit method.
pub fn write_step(program: &Program, method: Method) -> Option<String> {
    let tableau = method.tableau()?;
    let mut c = PRELUDE.to_string();
    for function in Function::ALL {
        let head = format!("INLINE LANES {}_of(LANES x)", function.name());
        Body::new(function).print(&mut c, &head, Lanes::new(&Cached::default(), None));
    }
    evaluations(&mut c, program);
    for traced in [functions::factor, functions::solve_first, functions::solve] {
        let graph = Graph::new();
        write(&mut c, &graph, &traced(&graph, program));
    }
    for stage in 1..tableau.stages() {
        let graph = Graph::new();
        write(&mut c, &graph, &functions::sums(&graph, program, tableau, stage));
    }
    let identity = program.identity();
    line(
        &mut c,
        format_args!("uint64_t program_identity(void) {{ return UINT64_C({identity:#x}); }}"),
    );
    Some(c)
}

/// The cached expressions of `begin` and `motion`, and their indices in the array `cached`.
#[derive(Default)]
struct Cached {
    /// The sources that change each expression, as bits; `None` if it is not cached.
    changes_with: Vec<Option<u64>>,
    /// Index in `cached` of each expression that is a result or that an expression with other sources uses.
    places: BTreeMap<u32, usize>,
}

impl Cached {
    /// Finds the cached part of the expressions that the values need.
    fn new(program: &Program, expressions: &[Expression], values: &[Operand]) -> Self {
        let mut changes_with: Vec<Option<u64>> = Vec::with_capacity(expressions.len());
        for &expression in expressions {
            let mut of_needed = expression.needs().map(|other| changes_with[other as usize]);
            changes_with.push(match expression {
                Expression::Variable(array, place) => source(program, array, place as usize),
                // A truth value is not a number and cannot be stored in the array.
                Expression::Less(..) => None,
                _ => of_needed.try_fold(0, |all, one| Some(all | one?)),
            });
        }
        let needed = symbol::needed(expressions, values);
        let mut kept: BTreeSet<u32> = values.iter().filter_map(|value| node(*value)).collect();
        for (user, expression) in expressions.iter().enumerate().filter(|(user, _)| needed[*user]) {
            let other = |&used: &u32| changes_with[used as usize] != changes_with[user];
            kept.extend(expression.needs().filter(other));
        }
        kept.retain(|&node| {
            let is_variable = matches!(expressions[node as usize], Expression::Variable(..));
            changes_with[node as usize].is_some() && !is_variable
        });
        let places = kept.into_iter().enumerate().map(|(place, node)| (node, place)).collect();
        Self { changes_with, places }
    }

    /// The sets of sources in order: each after those of the expressions that it uses.
    fn parts(&self) -> Vec<u64> {
        let parts = self.places.keys().filter_map(|&node| self.changes_with[node as usize]);
        let mut parts: Vec<u64> = parts.collect::<BTreeSet<u64>>().into_iter().collect();
        parts.sort_by_key(|part| part.count_ones());
        parts
    }

    /// Prints the function that recomputes the parts whose sources have changed.
    fn update(&self, c: &mut String, expressions: &[Expression]) {
        let head = "update(IN constants, IN variables, OUT cached, uint64_t changed)";
        function(c, head, |c| {
            for part in self.parts() {
                line(c, format_args!("    if (changed & UINT64_C({part:#x})) {{"));
                self.update_part(c, expressions, part);
                line(c, format_args!("    }}"));
            }
        });
    }

    fn update_part(&self, c: &mut String, expressions: &[Expression], part: u64) {
        let of_part = |node: u32| self.changes_with[node as usize] == Some(part);
        let kept = self.places.iter().filter(|(node, _)| of_part(**node));
        let stores = kept.map(|(&node, &place)| (Operand::Node(node), vec![("cached", place)]));
        print_stores(c, expressions, Lanes::new(self, Some(part)), &stores.collect());
    }
}

/// The sources that change an entry of an array; `None` if it must not be cached.
fn source(program: &Program, array: &str, place: usize) -> Option<u64> {
    let (externals, stand_ins) = (program.externals(), program.stand_ins());
    match array {
        "constants" => Some(NUMBERS),
        "variables" if externals.contains(&place) => Some(input_bit(place - externals.start)),
        "variables" if stand_ins.contains(&place) => {
            (!program.is_held(place - stand_ins.start)).then_some(NUMBERS)
        }
        _ => None,
    }
}

/// The index of an expression; `None` for a constant.
fn node(value: Operand) -> Option<u32> {
    match value {
        Operand::Node(node) => Some(node),
        Operand::Constant(_) => None,
    }
}

/// Prints a function without cached values.
fn write(c: &mut String, graph: &Graph, traced: &Traced) {
    write_beside(c, &graph.expressions(), traced, &Cached::default(), "");
}

/// Prints a function, which reads cached values from their array.
fn write_beside(
    c: &mut String,
    expressions: &[Expression],
    traced: &Traced,
    cached: &Cached,
    cached_argument: &str,
) {
    let reads: Vec<String> = traced.reads.iter().map(|name| format!("IN {name}")).collect();
    let writes: Vec<String> = traced.writes.iter().map(|name| format!("OUT {name}")).collect();
    let (reads, writes) = (reads.join(", "), writes.join(", "));
    let head = format!("{}({reads}, {cached_argument}{writes})", traced.name);
    let dialect = Lanes::new(cached, None);
    function(c, &head, |c| print_stores(c, expressions, dialect, &traced.stores()));
}

/// Prints the expressions that the stored values need, and the stores.
fn print_stores(c: &mut String, expressions: &[Expression], dialect: Lanes, stores: &Stores) {
    let values: Vec<Operand> = stores.keys().copied().collect();
    Printer { dialect, expressions }.statements(c, &values, stores);
}

/// Prints a function that loops over all lanes.
fn function(c: &mut String, head: &str, body: impl FnOnce(&mut String)) {
    line(c, format_args!("void {head}\n{{"));
    line(c, format_args!("    for (int lane = 0; lane < STRIDE; lane += WIDTH) {{"));
    body(c);
    line(c, format_args!("    }}\n}}\n"));
}

/// Prints `begin` and `motion`, which share the cached values, and `update`.
fn evaluations(c: &mut String, program: &Program) {
    let graph = Graph::new();
    let begin = functions::begin(&graph, program);
    let motion = functions::motion(&graph, program);
    let values: Vec<Operand> =
        begin.stores().into_keys().chain(motion.stores().into_keys()).collect();
    let expressions = graph.expressions();
    let cached = Cached::new(program, &expressions, &values);
    line(c, format_args!("unsigned long cached_length(void)\n{{"));
    line(c, format_args!("    return {};\n}}\n", cached.places.len()));
    cached.update(c, &expressions);
    for traced in [begin, motion] {
        write_beside(c, &expressions, &traced, &cached, "IN cached, ");
    }
}

/// The macros of `step.h`, for the lanes of a register.
struct Lanes<'a> {
    cached: &'a Cached,
    /// The part of the cached expressions to print; `None` for the uncached rest.
    part: Option<u64>,
}

impl<'a> Lanes<'a> {
    fn new(cached: &'a Cached, part: Option<u64>) -> Self {
        Self { cached, part }
    }
}

impl Dialect for Lanes<'_> {
    const TRUTH: &'static str = "const TRUTH";
    const NUMBER: &'static str = "const LANES";

    fn entry(&self, array: &str, index: usize) -> String {
        format!("AT({array}, {index})")
    }

    fn store(&self, array: &str, index: usize, value: &str) -> String {
        format!("PUT({array}, {index}, {value})")
    }

    fn literal(&self, value: f64) -> String {
        let sign = if value.is_sign_negative() { "-" } else { "" };
        match value.classify() {
            FpCategory::Nan => "ALL(__builtin_nan(\"\"))".to_string(),
            FpCategory::Infinite => format!("ALL({sign}__builtin_inf())"),
            _ => format!("ALL({value:?})"),
        }
    }

    fn unary(&mut self, operation: Unary, a: &str) -> String {
        match operation {
            Unary::Negative => format!("negative({a})"),
            Unary::SquareRoot => format!("root({a})"),
            Unary::Absolute => format!("absolute({a})"),
            Unary::Round => format!("rounded({a})"),
            Unary::Mantissa => format!("mantissa({a})"),
            Unary::Exponent => format!("exponent({a})"),
            Unary::Call(function) => format!("{}_of({a})", function.name()),
        }
    }

    fn call(&self, operation: Binary, a: &str, b: &str) -> String {
        match operation {
            Binary::Smaller => format!("smaller({a}, {b})"),
            Binary::Larger => format!("larger({a}, {b})"),
            _ => format!("scaled({a}, {b})"),
        }
    }

    fn less(&self, a: &str, b: &str) -> String {
        format!("less({a}, {b})")
    }

    fn select(&self, truth: &str, yes: &str, no: &str) -> String {
        format!("chosen({truth}, {yes}, {no})")
    }

    fn has_statement(&self, node: usize, expression: Expression) -> bool {
        let part = self.cached.changes_with.get(node).copied().flatten();
        part == self.part && !matches!(expression, Expression::Variable(..))
    }

    fn held_entry(&self, node: usize) -> String {
        self.entry("cached", self.cached.places[&(node as u32)])
    }
}

/// The operations on lanes by width; they match those of the module `lanes`.
const PRELUDE: &str = include_str!("step.h");
