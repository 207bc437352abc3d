//! Dependencies and directional derivatives of traced values.

use super::{Binary, Expression, Function, Graph, Operand, Symbol, Truth, Unary};
use crate::scalar::Scalar;
use alloc::collections::BTreeSet;
use alloc::vec::Vec;

/// For each value, the entries of external arrays that it depends on, by the numbers that `number` gives them.
pub(crate) fn dependencies(
    graph: &Graph,
    values: &[Symbol],
    number: impl Fn(&'static str, u32) -> Option<usize>,
) -> Vec<BTreeSet<usize>> {
    let mut of_nodes: Vec<BTreeSet<usize>> = Vec::new();
    for expression in graph.expressions() {
        let own = match expression {
            Expression::Variable(array, index) => number(array, index).into_iter().collect(),
            _ => expression.needs().flat_map(|node| of_nodes[node as usize].clone()).collect(),
        };
        of_nodes.push(own);
    }
    let of = |value: &Symbol| match value.operand() {
        Operand::Node(node) => of_nodes[node as usize].clone(),
        Operand::Constant(_) => BTreeSet::new(),
    };
    values.iter().map(of).collect()
}

/// The directional derivatives of values, as further symbols of the graph. `seed` is the derivative of an entry of an
/// external array; `None` stands for zero.
pub(crate) fn tangents<'g>(
    graph: &'g Graph,
    values: &[Symbol<'g>],
    seed: impl Fn(&'static str, u32) -> Option<Symbol<'g>>,
) -> Vec<Symbol<'g>> {
    let mut known = Tangents { graph, of_nodes: Vec::new() };
    for (node, expression) in graph.expressions().into_iter().enumerate() {
        let tangent = match expression {
            Expression::Variable(array, index) => seed(array, index),
            _ => known.of_expression(Symbol::Node(graph, node as u32), expression),
        };
        known.of_nodes.push(tangent);
    }
    values.iter().map(|value| known.of(value.operand()).unwrap_or(Symbol::constant(0.0))).collect()
}

struct Tangents<'g> {
    graph: &'g Graph,
    /// `None` for zero.
    of_nodes: Vec<Option<Symbol<'g>>>,
}

impl<'g> Tangents<'g> {
    fn of(&self, operand: Operand) -> Option<Symbol<'g>> {
        match operand {
            Operand::Node(node) => self.of_nodes[node as usize],
            Operand::Constant(_) => None,
        }
    }

    fn symbol(&self, operand: Operand) -> Symbol<'g> {
        match operand {
            Operand::Node(node) => Symbol::Node(self.graph, node),
            Operand::Constant(bits) => Symbol::constant(f64::from_bits(bits)),
        }
    }

    fn of_expression(&self, value: Symbol<'g>, expression: Expression) -> Option<Symbol<'g>> {
        match expression {
            Expression::Unary(operation, a) => {
                self.of(a).and_then(|change| of_unary(operation, value, self.symbol(a), change))
            }
            Expression::Binary(operation, a, b) => self.of_binary(operation, value, a, b),
            Expression::Select(truth, a, b) => self.chosen(Truth::Node(self.graph, truth), a, b),
            Expression::Variable(..) | Expression::Less(..) => None,
        }
    }

    /// The change of the operand that was chosen.
    fn chosen(&self, truth: Truth<'g>, yes: Operand, no: Operand) -> Option<Symbol<'g>> {
        let (yes, no) = (self.of(yes), self.of(no));
        let zero = Symbol::constant(0.0);
        (yes.is_some() || no.is_some())
            .then(|| Symbol::select(truth, yes.unwrap_or(zero), no.unwrap_or(zero)))
    }

    fn of_binary(
        &self,
        operation: Binary,
        value: Symbol<'g>,
        a: Operand,
        b: Operand,
    ) -> Option<Symbol<'g>> {
        let (of_a, of_b) = (self.of(a), self.of(b));
        let (left, right) = (self.symbol(a), self.symbol(b));
        match operation {
            Binary::Sum => sum(of_a, of_b),
            Binary::Difference => sum(of_a, of_b.map(|change| -change)),
            Binary::Product => {
                sum(of_a.map(|change| change * right), of_b.map(|change| left * change))
            }
            Binary::Quotient => {
                let change = sum(of_a, of_b.map(|change| -(value * change)));
                change.map(|change| change / right)
            }
            Binary::Smaller => self.chosen(left.less(right), a, b),
            Binary::Larger => self.chosen(right.less(left), a, b),
            // Powers of two stand inside of functions only.
            Binary::Scaled => None,
        }
    }
}

fn sum<'g>(a: Option<Symbol<'g>>, b: Option<Symbol<'g>>) -> Option<Symbol<'g>> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    }
}

fn of_unary<'g>(
    operation: Unary,
    value: Symbol<'g>,
    x: Symbol<'g>,
    change: Symbol<'g>,
) -> Option<Symbol<'g>> {
    let number = Symbol::constant;
    let slope = match operation {
        Unary::Negative => return Some(-change),
        Unary::Absolute => return Some(Symbol::select(x.less(number(0.0)), -change, change)),
        // These are constant between their steps, and stand inside of functions only.
        Unary::Round | Unary::Mantissa | Unary::Exponent => return None,
        Unary::SquareRoot => number(0.5) / value,
        Unary::Call(Function::Exp) => value,
        Unary::Call(Function::Exp2) => value * number(core::f64::consts::LN_2),
        Unary::Call(Function::Log2) => number(core::f64::consts::LOG2_E) / x,
        Unary::Call(Function::Tanh) => number(1.0) - value * value,
        Unary::Call(Function::Sin) => x.cos(),
        Unary::Call(Function::Cos) => -x.sin(),
    };
    Some(slope * change)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    /// Evaluates symbols of a graph for given numbers of the array `x` and tangents `dx`.
    fn evaluate(graph: &Graph, values: &[Symbol], x: &[f64], dx: &[f64]) -> Vec<f64> {
        let mut numbers: Vec<f64> = Vec::new();
        let of = |operand, numbers: &[f64]| match operand {
            Operand::Constant(bits) => f64::from_bits(bits),
            Operand::Node(node) => numbers[node as usize],
        };
        for expression in graph.expressions() {
            let number = match expression {
                Expression::Variable("x", i) => x[i as usize],
                Expression::Variable(_, i) => dx[i as usize],
                Expression::Less(a, b) => f64::from(of(a, &numbers) < of(b, &numbers)),
                Expression::Select(truth, a, b) => {
                    of(if numbers[truth as usize] > 0.5 { a } else { b }, &numbers)
                }
                Expression::Unary(operation, a) => {
                    let a = of(a, &numbers);
                    match operation {
                        Unary::Negative => -a,
                        Unary::SquareRoot => a.sqrt(),
                        Unary::Absolute => a.abs(),
                        Unary::Call(function) => function.kernel(a),
                        other => unreachable!("{other:?}"),
                    }
                }
                Expression::Binary(operation, a, b) => {
                    let (a, b) = (of(a, &numbers), of(b, &numbers));
                    match operation {
                        Binary::Sum => a + b,
                        Binary::Difference => a - b,
                        Binary::Product => a * b,
                        Binary::Quotient => a / b,
                        Binary::Smaller => a.min(b),
                        Binary::Larger => a.max(b),
                        Binary::Scaled => unreachable!(),
                    }
                }
            };
            numbers.push(number);
        }
        values.iter().map(|value| of(value.operand(), &numbers)).collect()
    }

    #[test]
    fn tangents_are_the_slopes_of_finite_differences() {
        let graph = Graph::new();
        let [x, y] = [0, 1].map(|i| graph.variable("x", i));
        let values = vec![
            x * y - x / y,
            (x * x + Symbol::constant(1.0)).sqrt(),
            (-x).exp() + y.exp2() * y.log2(),
            x.tanh() * y.sin() - x.cos(),
            Symbol::select(x.less(y), x * x, y),
            x.abs() + x.min(y) * x.max(y),
        ];
        let all = tangents(&graph, &values, |array, i| {
            (array == "x").then(|| graph.variable("dx", i as usize))
        });
        let (at, along, h) = ([-0.4, 1.3], [0.7, -0.2], 1e-6);
        let moved = |sign: f64| [0, 1].map(|i| at[i] + sign * h * along[i]);
        let (low, high) = (
            evaluate(&graph, &values, &moved(-1.0), &along),
            evaluate(&graph, &values, &moved(1.0), &along),
        );
        for (i, tangent) in evaluate(&graph, &all, &at, &along).into_iter().enumerate() {
            let slope = (high[i] - low[i]) / (2.0 * h);
            // The functions are polynomials with errors of 1e-12.
            assert!((slope - tangent).abs() < 1e-5, "value {i}: {tangent}, not {slope}");
        }
    }

    #[test]
    fn dependencies_go_through_choices() {
        let graph = Graph::new();
        let [x, y, z] = [0, 1, 2].map(|i| graph.variable("x", i));
        let values = [x * x, Symbol::select(x.less(y), z, Symbol::constant(1.0)), y - y];
        let found = dependencies(&graph, &values, |_, i| Some(i as usize));
        assert_eq!(found, [vec![0], vec![0, 1, 2], vec![1]].map(BTreeSet::from_iter));
    }
}
