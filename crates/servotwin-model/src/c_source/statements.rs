//! Any traced expressions as plain statements of C99, for code that is to be proven.
//!
//! One operation per statement, so that no compiler may fuse two. Numbers are hexadecimal literals. The statements call
//! `sqrt`, `fabs` and the functions of [`helpers`](super::helpers).

use super::helpers::unary_text;
use super::printer::{Dialect, Printer, Stores};
use crate::symbol::{Binary, Expression, Graph, Symbol, Unary};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// The entries of arrays that receive symbols.
type Stored<'g> = [(Symbol<'g>, &'static str, usize)];

/// Returns the statements that compute symbols and store each in an entry of an array.
///
/// Transcendental functions of this crate are called by the names that [`write_twin`](super::write_twin) gives them.
pub fn write_statements(graph: &Graph, stored: &Stored) -> String {
    let mut stores = Stores::new();
    for &(symbol, array, index) in stored {
        stores.entry(symbol.operand()).or_default().push((array, index));
    }
    let mut text = String::new();
    print_statements(&mut text, &graph.expressions(), &stores);
    text
}

/// Prints the statements that compute the stored values.
pub(super) fn print_statements(text: &mut String, expressions: &[Expression], stores: &Stores) {
    let values: Vec<_> = stores.keys().copied().collect();
    Printer { dialect: Statements, expressions }.statements(text, &values, stores);
}

/// A finite number as a hexadecimal literal, which C reads back to the same bits.
///
/// # Panics
/// If the number is not finite.
pub fn hexadecimal(number: f64) -> String {
    assert!(number.is_finite(), "{number} has no literal");
    let bits = number.to_bits();
    let sign = if number.is_sign_negative() { "-" } else { "" };
    let (exponent, fraction) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
    match (exponent, fraction) {
        (0, 0) => format!("{sign}0x0p+0"),
        (0, _) => format!("{sign}0x0.{fraction:013x}p-1022"),
        _ => format!("{sign}0x1.{fraction:013x}p{:+}", exponent - 1023),
    }
}

/// Before the names of functions that C's library lacks.
pub(super) const PREFIX: &str = "servotwin_twin";

/// Plain C99 for one number of type `double`.
#[derive(Clone, Copy)]
pub(super) struct Statements;

impl Dialect for Statements {
    fn literal(&self, value: f64) -> String {
        let literal = hexadecimal(value);
        if value.is_sign_negative() { format!("({literal})") } else { literal }
    }

    fn unary(&mut self, operation: Unary, a: &str) -> String {
        unary_text(PREFIX, operation, a)
    }

    fn call(&self, operation: Binary, a: &str, b: &str) -> String {
        match operation {
            Binary::Smaller => format!("({a} < {b}) ? {a} : {b}"),
            Binary::Larger => format!("({b} < {a}) ? {a} : {b}"),
            _ => format!("{PREFIX}_scaled({a}, {b})"),
        }
    }

    fn less(&self, a: &str, b: &str) -> String {
        format!("({a} < {b})")
    }

    fn select(&self, truth: &str, yes: &str, no: &str) -> String {
        format!("({truth} != 0) ? {yes} : {no}")
    }

    fn has_statement(&self, _node: usize, expression: Expression) -> bool {
        !matches!(expression, Expression::Variable(..))
    }

    fn held_entry(&self, node: usize) -> String {
        unreachable!("expression {node} has a statement")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Scalar;

    #[test]
    fn a_literal_has_the_bits_of_its_number() {
        assert_eq!(hexadecimal(1.0), "0x1.0000000000000p+0");
        assert_eq!(hexadecimal(-0.1), "-0x1.999999999999ap-4");
        assert_eq!(hexadecimal(0.0), "0x0p+0");
        assert_eq!(hexadecimal(f64::from_bits(1)), "0x0.0000000000001p-1022");
        assert_eq!(hexadecimal(f64::MAX), "0x1.fffffffffffffp+1023");
    }

    #[test]
    fn a_statement_has_one_operation() {
        let graph = Graph::new();
        let (x, y) = (graph.variable("a", 0), graph.variable("a", 1));
        let larger = Symbol::select(x.less(y), y, (x * y + Symbol::constant(-2.0)).sqrt());
        let c = write_statements(&graph, &[(larger, "into", 3)]);
        let expected = "    const int v2 = (a[0] < a[1]);
    const double v3 = a[0] * a[1];
    const double v4 = (-0x1.0000000000000p+1) + v3;
    const double v5 = sqrt(v4);
    const double v6 = (v2 != 0) ? a[1] : v5;
    into[3] = v6;
";
        assert_eq!(c, expected);
    }
}
