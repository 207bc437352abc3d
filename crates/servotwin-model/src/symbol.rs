//! Numbers that record the operations on them.
//!
//! Evaluating an equation with [`Symbol`]s leaves its text in a [`Graph`]: one
//! expression per operation, each stored once however often it is used. The
//! graph becomes the C source of a system ([`crate::c_source`]).
//!
//! A symbol carries a constant itself, without a graph. Operations on
//! constants are done at once, in `f64` arithmetic. The other
//! simplifications change no number:
//!
//! ```text
//! −0 + x = x,   −0 − x = −x,   x − 0 = x,   1 x = x,   x/1 = x             (Y1)
//! −(−x) = x,   (−x) + y = y − x,   x − (−y) = x + y                        (Y2)
//! ```
//!
//! The neutral element of a sum is −0, because adding +0 changes the sign of `x = −0`.

pub(crate) mod tangent;

use crate::math;
use crate::scalar::{Primitive, Scalar};
use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// An operation on one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Unary {
    /// `−x`.
    Negative,
    /// `√x`.
    SquareRoot,
    /// `|x|`.
    Absolute,
    /// [`Primitive::round`].
    Round,
    /// The first part of [`Primitive::split_exponent`].
    Mantissa,
    /// The second part of [`Primitive::split_exponent`].
    Exponent,
    /// A transcendental function.
    Call(Function),
}

/// A transcendental function of [`crate::math`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Function {
    /// `e^x`.
    Exp,
    /// `2^x`.
    Exp2,
    /// Binary logarithm.
    Log2,
    /// Hyperbolic tangent.
    Tanh,
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
}

impl Function {
    /// Every function.
    pub(crate) const ALL: [Function; 6] = [
        Function::Exp,
        Function::Exp2,
        Function::Log2,
        Function::Tanh,
        Function::Sin,
        Function::Cos,
    ];

    /// The usual name, for example `exp2`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Function::Exp => "exp",
            Function::Exp2 => "exp2",
            Function::Log2 => "log2",
            Function::Tanh => "tanh",
            Function::Sin => "sin",
            Function::Cos => "cos",
        }
    }

    /// The function's value, computed from primitives.
    pub(crate) fn kernel<P: Primitive>(self, x: P) -> P {
        match self {
            Function::Exp => math::exp(x),
            Function::Exp2 => math::exp2(x),
            Function::Log2 => math::log2(x),
            Function::Tanh => math::tanh(x),
            Function::Sin => math::sin_cos(x).0,
            Function::Cos => math::sin_cos(x).1,
        }
    }
}

/// An operation on two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Binary {
    /// `x + y`.
    Sum,
    /// `x − y`.
    Difference,
    /// `x · y`.
    Product,
    /// `x / y`.
    Quotient,
    /// [`Primitive::scale_by_power_of_two`].
    Scaled,
    /// [`Scalar::min`].
    Smaller,
    /// [`Scalar::max`].
    Larger,
}

/// An argument of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Operand {
    /// The bits of an `f64`.
    Constant(u64),
    /// The index of an expression in the graph.
    Node(u32),
}

/// One entry of a graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Expression {
    /// An entry of a named external array.
    Variable(&'static str, u32),
    /// An operation on one number.
    Unary(Unary, Operand),
    /// An operation on two numbers.
    Binary(Binary, Operand, Operand),
    /// A truth value: the first operand is less than the second.
    Less(Operand, Operand),
    /// The first operand if the expression with that index is true, else the second.
    Select(u32, Operand, Operand),
}

impl Expression {
    /// Whether it is a truth value and not a number.
    pub(crate) fn is_truth(self) -> bool {
        matches!(self, Expression::Less(..))
    }

    /// The indices of the expressions that this one uses.
    pub(crate) fn needs(self) -> impl Iterator<Item = u32> {
        let none = Operand::Constant(0);
        let (truth, a, b) = match self {
            Expression::Variable(..) => (None, none, none),
            Expression::Unary(_, a) => (None, a, none),
            Expression::Binary(_, a, b) | Expression::Less(a, b) => (None, a, b),
            Expression::Select(truth, a, b) => (Some(truth), a, b),
        };
        let node = |operand| match operand {
            Operand::Node(node) => Some(node),
            Operand::Constant(_) => None,
        };
        truth.into_iter().chain(node(a)).chain(node(b))
    }
}

/// Marks, for each expression, whether the values depend on it.
pub(crate) fn needed(expressions: &[Expression], values: &[Operand]) -> Vec<bool> {
    let mut needed = vec![false; expressions.len()];
    for value in values {
        if let Operand::Node(node) = *value {
            needed[node as usize] = true;
        }
    }
    for node in (0..needed.len()).rev() {
        if needed[node] {
            for other in expressions[node].needs() {
                needed[other as usize] = true;
            }
        }
    }
    needed
}

#[derive(Default)]
struct Store {
    expressions: Vec<Expression>,
    known: BTreeMap<Expression, u32>,
}

/// The expressions of a trace. Each stands after those that it uses.
#[derive(Default)]
pub struct Graph(RefCell<Store>);

impl Graph {
    /// An empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// A symbol for an entry of an external array.
    pub fn variable(&self, array: &'static str, index: usize) -> Symbol<'_> {
        self.symbol(Expression::Variable(array, index as u32))
    }

    /// All expressions so far.
    pub(crate) fn expressions(&self) -> Vec<Expression> {
        self.0.borrow().expressions.clone()
    }

    fn expression(&self, node: u32) -> Expression {
        self.0.borrow().expressions[node as usize]
    }

    /// The index of an expression; adds the expression if it is new.
    fn node(&self, expression: Expression) -> u32 {
        let Store { expressions, known } = &mut *self.0.borrow_mut();
        *known.entry(expression).or_insert_with(|| {
            expressions.push(expression);
            expressions.len() as u32 - 1
        })
    }

    fn symbol(&self, expression: Expression) -> Symbol<'_> {
        Symbol::Node(self, self.node(expression))
    }
}

/// A number in a trace.
#[derive(Clone, Copy)]
pub enum Symbol<'g> {
    /// A known number.
    Constant(f64),
    /// An expression of a graph.
    Node(&'g Graph, u32),
}

/// A truth value in a trace.
#[derive(Clone, Copy)]
pub enum Truth<'g> {
    /// A known truth value.
    Constant(bool),
    /// An expression of a graph.
    Node(&'g Graph, u32),
}

impl<'g> Symbol<'g> {
    /// This symbol as an operand of an expression.
    pub fn operand(self) -> Operand {
        match self {
            Symbol::Constant(value) => Operand::Constant(value.to_bits()),
            Symbol::Node(_, node) => Operand::Node(node),
        }
    }

    /// The symbol's expression; `None` for a constant.
    pub(crate) fn expression(self) -> Option<Expression> {
        match self {
            Symbol::Constant(_) => None,
            Symbol::Node(graph, node) => Some(graph.expression(node)),
        }
    }

    fn is(self, number: f64) -> bool {
        matches!(self, Symbol::Constant(value) if value.to_bits() == number.to_bits())
    }

    /// `x` if this is `−x`.
    fn negated(self) -> Option<Self> {
        let Symbol::Node(graph, node) = self else {
            return None;
        };
        match graph.expression(node) {
            Expression::Unary(Unary::Negative, Operand::Node(inner)) => {
                Some(Symbol::Node(graph, inner))
            }
            _ => None,
        }
    }

    fn unary(self, operation: Unary, fold: impl FnOnce(f64) -> f64) -> Self {
        match self {
            Symbol::Constant(value) => Symbol::Constant(fold(value)),
            Symbol::Node(graph, node) => {
                graph.symbol(Expression::Unary(operation, Operand::Node(node)))
            }
        }
    }

    fn call(self, function: Function) -> Self {
        self.unary(Unary::Call(function), |x| function.kernel(x))
    }

    fn binary(self, operation: Binary, other: Self, fold: impl FnOnce(f64, f64) -> f64) -> Self {
        let Some(graph) = self.graph().or(other.graph()) else {
            return Symbol::Constant(fold(self.known(), other.known()));
        };
        let (mut a, mut b) = (self.operand(), other.operand());
        // Sums and products commute: keep one order.
        if matches!(operation, Binary::Sum | Binary::Product) && b < a {
            (a, b) = (b, a);
        }
        graph.symbol(Expression::Binary(operation, a, b))
    }

    fn graph(self) -> Option<&'g Graph> {
        match self {
            Symbol::Constant(_) => None,
            Symbol::Node(graph, _) => Some(graph),
        }
    }

    /// The number of a constant.
    fn known(self) -> f64 {
        match self {
            Symbol::Constant(value) => value,
            Symbol::Node(..) => unreachable!("asked only where there is no graph"),
        }
    }
}

impl Add for Symbol<'_> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        if self.is(-0.0) {
            return other;
        }
        if other.is(-0.0) {
            return self;
        }
        match (self.negated(), other.negated()) {
            (_, Some(y)) => self - y,
            (Some(x), None) => other - x,
            (None, None) => self.binary(Binary::Sum, other, |x, y| x + y),
        }
    }
}

impl Sub for Symbol<'_> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        if self.is(-0.0) {
            return -other;
        }
        if other.is(0.0) {
            return self;
        }
        match other.negated() {
            Some(y) => self + y,
            None => self.binary(Binary::Difference, other, |x, y| x - y),
        }
    }
}

impl Mul for Symbol<'_> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if self.is(1.0) {
            return other;
        }
        if other.is(1.0) {
            return self;
        }
        self.binary(Binary::Product, other, |x, y| x * y)
    }
}

impl Div for Symbol<'_> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if other.is(1.0) {
            return self;
        }
        self.binary(Binary::Quotient, other, |x, y| x / y)
    }
}

impl Neg for Symbol<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.negated().unwrap_or_else(|| self.unary(Unary::Negative, |x| -x))
    }
}

impl<'g> Scalar for Symbol<'g> {
    type Base = Self;
    type Mask = Truth<'g>;

    fn constant(value: f64) -> Self {
        Symbol::Constant(value)
    }
    fn from_base(value: Self) -> Self {
        value
    }
    fn base(self) -> Self {
        self
    }
    fn sqrt(self) -> Self {
        self.unary(Unary::SquareRoot, Scalar::sqrt)
    }
    fn abs(self) -> Self {
        self.unary(Unary::Absolute, Scalar::abs)
    }
    fn less(self, other: Self) -> Truth<'g> {
        let (a, b) = (self.operand(), other.operand());
        match self.graph().or(other.graph()) {
            None => Truth::Constant(self.known() < other.known()),
            Some(_) if a == b => Truth::Constant(false),
            Some(graph) => Truth::Node(graph, graph.node(Expression::Less(a, b))),
        }
    }
    fn select(mask: Truth<'g>, yes: Self, no: Self) -> Self {
        match mask {
            Truth::Constant(true) => yes,
            Truth::Constant(false) => no,
            Truth::Node(..) if yes.operand() == no.operand() => yes,
            Truth::Node(graph, truth) => {
                graph.symbol(Expression::Select(truth, yes.operand(), no.operand()))
            }
        }
    }
    fn min(self, other: Self) -> Self {
        match self.operand() == other.operand() {
            true => self,
            false => self.binary(Binary::Smaller, other, Scalar::min),
        }
    }
    fn max(self, other: Self) -> Self {
        match self.operand() == other.operand() {
            true => self,
            false => self.binary(Binary::Larger, other, Scalar::max),
        }
    }
    fn exp(self) -> Self {
        self.call(Function::Exp)
    }
    fn exp2(self) -> Self {
        self.call(Function::Exp2)
    }
    fn log2(self) -> Self {
        self.call(Function::Log2)
    }
    fn tanh(self) -> Self {
        self.call(Function::Tanh)
    }
    fn sin(self) -> Self {
        self.call(Function::Sin)
    }
    fn cos(self) -> Self {
        self.call(Function::Cos)
    }
}

impl Primitive for Symbol<'_> {
    fn round(self) -> Self {
        self.unary(Unary::Round, Primitive::round)
    }
    fn scale_by_power_of_two(self, exponent: Self) -> Self {
        self.binary(Binary::Scaled, exponent, Primitive::scale_by_power_of_two)
    }
    fn split_exponent(self) -> (Self, Self) {
        let mantissa = self.unary(Unary::Mantissa, |x| x.split_exponent().0);
        (mantissa, self.unary(Unary::Exponent, |x| x.split_exponent().1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expression_is_kept_once_and_constants_are_folded() {
        let graph = Graph::new();
        let (x, y) = (graph.variable("x", 0), graph.variable("x", 1));
        let two = Symbol::constant(2.0);
        assert_eq!((x + y).operand(), (y + x).operand());
        assert_ne!((x - y).operand(), (y - x).operand());
        assert_eq!((x + -y).operand(), (x - y).operand());
        assert_eq!((Symbol::constant(-0.0) + x).operand(), x.operand());
        assert_eq!((two * two).operand(), Symbol::constant(4.0).operand());
        assert_eq!(two.exp().operand(), Operand::Constant(math::exp(2.0).to_bits()));
        assert_eq!(x.clamp(x, x).operand(), x.operand());
        let before = graph.expressions().len();
        assert_eq!((x * y).sqrt().operand(), (x * y).sqrt().operand());
        assert_eq!(graph.expressions().len(), before + 2);
    }
}
