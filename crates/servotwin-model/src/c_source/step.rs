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
//! On some processors with AVX-512 the derivatives wait for the only unit for roots and divisions. `-DITERATE_ROOTS`
//! computes every second root by iteration. Its result is correctly rounded too, so the bits stay equal.
//!
//! Some expressions depend only on constants, on parameters that replace signals and on external inputs. These
//! expressions are *cached*: they keep their values as long as their sources do. `update` recomputes them and stores
//! them in the array `cached`, where `begin` and `motion` read them. Its argument `changed` has one bit per input
//! (`input_bit`) and one for everything else (`NUMBERS`). `update` is a separate function because its branches would
//! split the straight-line code of `begin` and `motion`; the compiler schedules only between branches.

use super::parameter_symbols;
use super::printer::{Body, Dialect, Printer, Stores, line};
use crate::program::Program;
use crate::scalar::Scalar;
use crate::solver::Method;
use crate::solver::step::{NUMBERS, input_bit};
use crate::solver::tableau::Tableau;
use crate::symbol::{self, Binary, Expression, Function, Graph, Operand, Symbol, Unary};
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
    factor(&mut c, program);
    solve_first(&mut c, program);
    solve(&mut c, program);
    for stage in 1..tableau.stages() {
        sums(&mut c, program, tableau, stage);
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

/// A function that writes entries of arrays.
struct CFunction<'g> {
    head: String,
    /// (array, index, value).
    stores: Vec<(&'static str, usize, Symbol<'g>)>,
}

impl CFunction<'_> {
    /// The entries that receive each value.
    fn stores(&self) -> Stores {
        let mut stores = Stores::new();
        for &(array, place, value) in &self.stores {
            // An entry that keeps its value needs no store.
            if value.expression() != Some(Expression::Variable(array, place as u32)) {
                stores.entry(value.operand()).or_default().push((array, place));
            }
        }
        stores
    }

    fn write(self, c: &mut String, graph: &Graph) {
        self.write_beside(c, &graph.expressions(), &Cached::default());
    }

    /// Writes the function, which reads cached values from their array.
    fn write_beside(self, c: &mut String, expressions: &[Expression], cached: &Cached) {
        let dialect = Lanes::new(cached, None);
        function(c, &self.head, |c| print_stores(c, expressions, dialect, &self.stores()));
    }
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

/// The entries of an external array.
fn array<'g>(graph: &'g Graph, name: &'static str, length: usize) -> Vec<Symbol<'g>> {
    (0..length).map(|index| graph.variable(name, index)).collect()
}

/// The variable array before an evaluation: all entries before the sums are external.
fn variables<'g>(graph: &'g Graph, program: &Program) -> Vec<Symbol<'g>> {
    let mut variables = vec![Symbol::constant(0.0); program.memory()];
    let given = array(graph, "variables", program.sums().start);
    variables[..given.len()].copy_from_slice(&given);
    variables
}

/// External gradients, and the two entries that never change.
fn gradients<'g>(graph: &'g Graph, program: &Program) -> Vec<Symbol<'g>> {
    let mut gradients = array(graph, "gradients", program.jacobian().slots());
    program.jacobian().set_fixed(&mut gradients);
    gradients
}

/// The constants. Those that no parameter changes become numbers. Among constants with the same formula of the same
/// parameters only the first is read, because eight lanes of a number take eight times its space in the nearest cache.
fn constants<'g>(graph: &'g Graph, program: &Program) -> Vec<Symbol<'g>> {
    let of_parameters = Graph::new();
    let values = program.block_constants(&parameter_symbols(program, &of_parameters));
    let mut first = BTreeMap::new();
    let constant = |(place, value): (usize, &Symbol)| match value.operand() {
        Operand::Constant(bits) => Symbol::constant(f64::from_bits(bits)),
        node => graph.variable("constants", *first.entry(node).or_insert(place)),
    };
    values.iter().enumerate().map(constant).collect()
}

/// Prints `begin` and `motion`, which share the cached values, and `update`.
fn evaluations(c: &mut String, program: &Program) {
    let graph = Graph::new();
    let constants = constants(&graph, program);
    let (begin, motion) = (begin(&graph, program, &constants), motion(&graph, program, &constants));
    let values: Vec<Operand> =
        begin.stores().into_keys().chain(motion.stores().into_keys()).collect();
    let expressions = graph.expressions();
    let cached = Cached::new(program, &expressions, &values);
    line(c, format_args!("unsigned long cached_length(void)\n{{"));
    line(c, format_args!("    return {};\n}}\n", cached.places.len()));
    cached.update(c, &expressions);
    begin.write_beside(c, &expressions, &cached);
    motion.write_beside(c, &expressions, &cached);
}

fn begin<'g>(graph: &'g Graph, program: &Program, constants: &[Symbol<'g>]) -> CFunction<'g> {
    let mut variables = variables(graph, program);
    let mut gradients = gradients(graph, program);
    program.trace_with_jacobian(constants, &mut variables, &mut gradients);
    // Variables that only clocks write are not stored.
    let untouched = Symbol::constant(0.0).operand();
    let sums = program.sums().filter(|&place| variables[place].operand() != untouched);
    let sums = sums.map(|place| ("variables", place, variables[place]));
    let rows = program.jacobian().read_places();
    let rows = rows.into_iter().map(|place| ("gradients", place, gradients[place]));
    CFunction {
        head: "begin(IN constants, IN cached, OUT variables, OUT gradients)".into(),
        stores: sums.chain(rows).collect(),
    }
}

fn motion<'g>(graph: &'g Graph, program: &Program, constants: &[Symbol<'g>]) -> CFunction<'g> {
    let mut variables = variables(graph, program);
    program.motion().trace(constants, &mut variables);
    let stores = program.derivatives().map(|place| ("variables", place, variables[place]));
    CFunction {
        head: "motion(IN constants, IN cached, OUT variables)".into(),
        stores: stores.collect(),
    }
}

fn factor(c: &mut String, program: &Program) {
    let graph = Graph::new();
    let gradients = gradients(&graph, program);
    let mut factors = vec![Symbol::constant(0.0); program.lu().slots()];
    program.lu().factor(graph.variable("diagonal", 0), &gradients, &mut factors);
    let stores = factors.into_iter().enumerate().map(|(place, value)| ("factors", place, value));
    CFunction {
        head: "factor(IN diagonal, IN gradients, OUT factors)".into(),
        stores: stores.collect(),
    }
    .write(c, &graph);
}

/// The first stage, whose right-hand side starts at zero.
fn solve_first(c: &mut String, program: &Program) {
    let graph = Graph::new();
    let right = vec![Symbol::constant(0.0); program.states().len()];
    solution(c, program, &graph, "solve_first", right);
}

fn solve(c: &mut String, program: &Program) {
    let graph = Graph::new();
    let right = array(&graph, "right", program.states().len());
    solution(c, program, &graph, "solve", right);
}

fn solution<'g>(
    c: &mut String,
    program: &Program,
    graph: &'g Graph,
    name: &str,
    mut right: Vec<Symbol<'g>>,
) {
    let derivatives = derivatives(graph, program);
    let factors = array(graph, "factors", program.lu().slots());
    let slope_factor = graph.variable("slope_factor", 0);
    let gradients = gradients(graph, program);
    program.solve_stage(&derivatives, slope_factor, &gradients, &factors, &mut right);
    let stores = right.into_iter().enumerate().map(|(place, value)| ("right", place, value));
    CFunction {
        head: format!("{name}(IN variables, IN slope_factor, IN gradients, IN factors, OUT right)"),
        stores: stores.collect(),
    }
    .write(c, graph);
}

/// The derivatives of the states, as external variables.
fn derivatives<'g>(graph: &'g Graph, program: &Program) -> Vec<Symbol<'g>> {
    program.derivatives().map(|place| graph.variable("variables", place)).collect()
}

fn sums(c: &mut String, program: &Program, tableau: &Tableau, stage: usize) {
    let graph = Graph::new();
    let n = program.states().len();
    let mut states = array(&graph, "variables", n);
    let mut right = vec![Symbol::constant(0.0); n];
    let stages = array(&graph, "stages", stage * n);
    let y = array(&graph, "y", n);
    tableau.sum_stages(
        stage,
        &mut states,
        &y,
        &mut right,
        graph.variable("reciprocal", 0),
        &stages,
    );
    let states = states.into_iter().enumerate().map(|(place, value)| ("variables", place, value));
    let right = right.into_iter().enumerate().map(|(place, value)| ("right", place, value));
    let stores = states.chain(right).collect();
    let head = format!("sums_{stage}(IN reciprocal, IN y, IN stages, OUT variables, OUT right)");
    CFunction { head, stores }.write(c, &graph);
}

/// The macros of `step.h`, for the lanes of a register.
struct Lanes<'a> {
    cached: &'a Cached,
    /// The part of the cached expressions to print; `None` for the uncached rest.
    part: Option<u64>,
    /// Whether the last root was an iterated one; iterated and plain roots alternate.
    is_root_iterated: bool,
}

impl<'a> Lanes<'a> {
    fn new(cached: &'a Cached, part: Option<u64>) -> Self {
        Self { cached, part, is_root_iterated: false }
    }
}

impl Dialect for Lanes<'_> {
    const NUMBER: &'static str = "LANES";
    const TRUTH: &'static str = "TRUTH";

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
            Unary::SquareRoot => {
                self.is_root_iterated = !self.is_root_iterated;
                format!("{}root({a})", if self.is_root_iterated { "iterated_" } else { "" })
            }
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
