//! Prints traced expressions as C; a [`Dialect`] spells each operation.

use crate::symbol::{self, Binary, Expression, Function, Graph, Operand, Unary};
use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt::Write;

/// The argument of a transcendental function. It is a number, not an array.
const ARGUMENT: &str = "x";

/// For each value, the array entries that receive it.
pub(super) type Stores = BTreeMap<Operand, Vec<(&'static str, usize)>>;

/// The spelling of operations for one kind of number.
pub(super) trait Dialect {
    /// What stands before the name of a truth value.
    const TRUTH: &'static str = "const int";

    /// What stands before the name of a number.
    const NUMBER: &'static str = "const double";

    fn entry(&self, array: &str, index: usize) -> String {
        format!("{array}[{index}]")
    }

    fn store(&self, array: &str, index: usize, value: &str) -> String {
        format!("{array}[{index}] = {value}")
    }

    fn literal(&self, value: f64) -> String;
    fn unary(&mut self, operation: Unary, a: &str) -> String;
    /// An operation without an operator.
    fn call(&self, operation: Binary, a: &str, b: &str) -> String;
    fn less(&self, a: &str, b: &str) -> String;
    fn select(&self, truth: &str, yes: &str, no: &str) -> String;
    /// Whether an expression gets its own variable `v…`.
    fn has_statement(&self, node: usize, expression: Expression) -> bool;
    /// The entry that holds an expression without its own variable.
    fn held_entry(&self, node: usize) -> String;

    /// A comment after the statement of an expression.
    fn comment(&self, _expression: Expression) -> String {
        String::new()
    }
}

/// Prints the expressions of one graph.
pub(super) struct Printer<'a, D> {
    pub(crate) dialect: D,
    pub(crate) expressions: &'a [Expression],
}

impl<D: Dialect> Printer<'_, D> {
    /// Prints the statements that the values need, and stores each value as soon as it is known.
    pub(crate) fn statements(&mut self, c: &mut String, values: &[Operand], stores: &Stores) {
        let needed = symbol::needed(self.expressions, values);
        for value in values.iter().filter(|value| matches!(value, Operand::Constant(_))) {
            self.store(c, *value, stores);
        }
        for node in (0..self.expressions.len()).filter(|&node| needed[node]) {
            self.statement(c, node);
            self.store(c, Operand::Node(node as u32), stores);
        }
    }

    fn statement(&mut self, c: &mut String, node: usize) {
        let expression = self.expressions[node];
        if !is_argument(expression) && self.dialect.has_statement(node, expression) {
            let kind = if expression.is_truth() { D::TRUTH } else { D::NUMBER };
            let value = self.value(expression);
            let comment = self.dialect.comment(expression);
            line(c, format_args!("    {kind} v{node} = {value};{comment}"));
        }
    }

    fn store(&self, c: &mut String, value: Operand, stores: &Stores) {
        for &(array, index) in stores.get(&value).into_iter().flatten() {
            let store = self.dialect.store(array, index, &self.operand(value));
            line(c, format_args!("    {store};"));
        }
    }

    fn value(&mut self, expression: Expression) -> String {
        match expression {
            Expression::Variable(array, index) => self.dialect.entry(array, index as usize),
            Expression::Unary(operation, a) => {
                let a = self.operand(a);
                self.dialect.unary(operation, &a)
            }
            Expression::Binary(operation, a, b) => {
                let (a, b) = (self.operand(a), self.operand(b));
                match operation {
                    Binary::Sum => format!("{a} + {b}"),
                    Binary::Difference => format!("{a} - {b}"),
                    Binary::Product => format!("{a} * {b}"),
                    Binary::Quotient => format!("{a} / {b}"),
                    _ => self.dialect.call(operation, &a, &b),
                }
            }
            Expression::Less(a, b) => self.dialect.less(&self.operand(a), &self.operand(b)),
            Expression::Select(truth, a, b) => {
                self.dialect.select(&format!("v{truth}"), &self.operand(a), &self.operand(b))
            }
        }
    }

    /// The text of a value where it is used.
    pub(crate) fn operand(&self, operand: Operand) -> String {
        match operand {
            Operand::Constant(bits) => self.dialect.literal(f64::from_bits(bits)),
            Operand::Node(node) => self.node(node as usize),
        }
    }

    fn node(&self, node: usize) -> String {
        let expression = self.expressions[node];
        match expression {
            _ if is_argument(expression) => ARGUMENT.to_string(),
            _ if self.dialect.has_statement(node, expression) => format!("v{node}"),
            Expression::Variable(array, index) => self.dialect.entry(array, index as usize),
            _ => self.dialect.held_entry(node),
        }
    }
}

fn is_argument(expression: Expression) -> bool {
    matches!(expression, Expression::Variable(ARGUMENT, _))
}

/// The trace of a transcendental function.
pub(super) struct Body {
    pub(crate) expressions: Vec<Expression>,
    value: Operand,
}

impl Body {
    pub(crate) fn new(function: Function) -> Self {
        let graph = Graph::new();
        let value = function.kernel(graph.variable(ARGUMENT, 0)).operand();
        Self { expressions: graph.expressions(), value }
    }

    /// The expressions that the result needs.
    pub(crate) fn needed(&self) -> impl Iterator<Item = Expression> {
        needed_expressions(&self.expressions, &[self.value])
    }

    /// Prints the function with the given head.
    pub(crate) fn print(&self, c: &mut String, head: &str, dialect: impl Dialect) {
        line(c, format_args!("{head}\n{{"));
        let mut printer = Printer { dialect, expressions: &self.expressions };
        printer.statements(c, &[self.value], &Stores::new());
        line(c, format_args!("    return {};\n}}\n", printer.operand(self.value)));
    }
}

/// The expressions that some values need.
pub(super) fn needed_expressions<'a>(
    expressions: &'a [Expression],
    values: &[Operand],
) -> impl Iterator<Item = Expression> + use<'a> {
    let needed = symbol::needed(expressions, values);
    expressions.iter().zip(needed).filter_map(|(&expression, needed)| needed.then_some(expression))
}

pub(super) fn line(c: &mut String, text: core::fmt::Arguments) {
    writeln!(c, "{text}").expect("a string takes any text");
}
