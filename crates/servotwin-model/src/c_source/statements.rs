//! Any traced expressions as plain statements of C99 or Rust, for code that is to be proven.
//!
//! One operation per statement, so that no compiler may fuse two. C has numbers as hexadecimal literals, and its statements
//! need `sqrt`, `fabs` and the functions of [`helpers`](super::helpers).

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
    write(Statements, graph, stored)
}

/// The same in single precision: constants become the nearest singles, and the functions of C those for `float`.
pub fn write_single_statements(graph: &Graph, stored: &Stored) -> String {
    write(SingleStatements, graph, stored)
}

/// The same in Rust, with `libm` for square roots.
pub fn write_rust_statements(graph: &Graph, stored: &Stored) -> String {
    write(RustStatements, graph, stored)
}

fn write(dialect: impl Dialect, graph: &Graph, stored: &Stored) -> String {
    let mut stores = Stores::new();
    for &(symbol, array, index) in stored {
        stores.entry(symbol.operand()).or_default().push((array, index));
    }
    let mut text = String::new();
    print_statements(&mut text, dialect, &graph.expressions(), &stores);
    text
}

/// Prints the statements that compute the stored values.
pub(super) fn print_statements(
    text: &mut String,
    dialect: impl Dialect,
    expressions: &[Expression],
    stores: &Stores,
) {
    let values: Vec<_> = stores.keys().copied().collect();
    Printer { dialect, expressions }.statements(text, &values, stores);
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

/// The single nearest to a finite number as a hexadecimal literal of type `float`, which C reads back to the same bits. A
/// number beyond all singles becomes the largest.
///
/// # Panics
/// If the number is not finite.
pub fn hexadecimal_single(number: f64) -> String {
    assert!(number.is_finite(), "{number} has no literal");
    let single = (number as f32).clamp(f32::MIN, f32::MAX);
    let literal = hexadecimal(f64::from(single));
    // Of the 13 digits of a double's fraction, a single needs the first six.
    match literal.split_once('p') {
        Some((digits, exponent)) if digits.contains('.') => {
            format!("{}p{exponent}F", &digits[..digits.len() - 7])
        }
        _ => literal + "F",
    }
}

/// Plain C99 for one number of type `double`.
pub(super) struct Statements;

/// Before the names of functions that C's library lacks.
pub(super) const PREFIX: &str = "servotwin_twin";

impl Dialect for Statements {
    const NUMBER: &'static str = "const double";
    const TRUTH: &'static str = "const int";

    fn literal(&self, value: f64) -> String {
        match value.is_sign_negative() {
            true => format!("({})", hexadecimal(value)),
            false => hexadecimal(value),
        }
    }

    fn unary(&mut self, operation: Unary, a: &str) -> String {
        match operation {
            Unary::Negative => format!("-{a}"),
            Unary::SquareRoot => format!("sqrt({a})"),
            Unary::Absolute => format!("fabs({a})"),
            Unary::Round => format!("{PREFIX}_rounded({a})"),
            Unary::Mantissa => format!("{PREFIX}_mantissa({a})"),
            Unary::Exponent => format!("{PREFIX}_exponent({a})"),
            Unary::Call(function) => format!("{PREFIX}_{}({a})", function.name()),
        }
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

/// Plain C99 for one number of type `float`.
struct SingleStatements;

impl Dialect for SingleStatements {
    const NUMBER: &'static str = "const float";
    const TRUTH: &'static str = Statements::TRUTH;

    fn literal(&self, value: f64) -> String {
        match value.is_sign_negative() {
            true => format!("({})", hexadecimal_single(value)),
            false => hexadecimal_single(value),
        }
    }

    fn unary(&mut self, operation: Unary, a: &str) -> String {
        match operation {
            Unary::SquareRoot => format!("sqrtf({a})"),
            Unary::Absolute => format!("fabsf({a})"),
            _ => Statements.unary(operation, a),
        }
    }

    fn call(&self, operation: Binary, a: &str, b: &str) -> String {
        Statements.call(operation, a, b)
    }

    fn less(&self, a: &str, b: &str) -> String {
        Statements.less(a, b)
    }

    fn select(&self, truth: &str, yes: &str, no: &str) -> String {
        Statements.select(truth, yes, no)
    }

    fn has_statement(&self, node: usize, expression: Expression) -> bool {
        Statements.has_statement(node, expression)
    }

    fn held_entry(&self, node: usize) -> String {
        Statements.held_entry(node)
    }
}

/// Rust for one number of type `f64`.
pub(super) struct RustStatements;

impl Dialect for RustStatements {
    const NUMBER: &'static str = "let";
    const TRUTH: &'static str = "let";
    const MOST_IN_SCOPE: usize = 64;

    fn literal(&self, value: f64) -> String {
        assert!(value.is_finite(), "{value} has no literal");
        format!("{value:?}")
    }

    fn unary(&mut self, operation: Unary, a: &str) -> String {
        match operation {
            Unary::Negative => format!("-{a}"),
            Unary::SquareRoot => format!("libm::sqrt({a})"),
            Unary::Absolute => format!("f64::abs({a})"),
            Unary::Round => format!("rounded({a})"),
            Unary::Mantissa => format!("mantissa({a})"),
            Unary::Exponent => format!("exponent({a})"),
            Unary::Call(function) => format!("{}({a})", function.name()),
        }
    }

    fn call(&self, operation: Binary, a: &str, b: &str) -> String {
        match operation {
            Binary::Smaller => format!("if {a} < {b} {{ {a} }} else {{ {b} }}"),
            Binary::Larger => format!("if {b} < {a} {{ {a} }} else {{ {b} }}"),
            _ => format!("scaled({a}, {b})"),
        }
    }

    fn less(&self, a: &str, b: &str) -> String {
        format!("{a} < {b}")
    }

    fn select(&self, truth: &str, yes: &str, no: &str) -> String {
        format!("if {truth} {{ {yes} }} else {{ {no} }}")
    }

    fn has_statement(&self, node: usize, expression: Expression) -> bool {
        Statements.has_statement(node, expression)
    }

    fn held_entry(&self, node: usize) -> String {
        Statements.held_entry(node)
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
    fn a_literal_of_a_single_has_the_bits_of_the_nearest_one() {
        for (number, literal) in [
            (1.0, "0x1.000000p+0F"),
            (-0.1, "-0x1.99999ap-4F"),
            (0.0, "0x0p+0F"),
            (f64::from(f32::from_bits(1)), "0x1.000000p-149F"),
            (1e300, "0x1.fffffep+127F"),
        ] {
            assert_eq!(hexadecimal_single(number), literal);
        }
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
        let single = write_single_statements(&graph, &[((x - y).sqrt() * larger, "into", 3)]);
        assert!(single.contains("const float v4 = (-0x1.000000p+1F) + v3;"), "{single}");
        assert!(single.contains(" = sqrtf(v4);") && !single.contains("double"), "{single}");
        let rust = write_rust_statements(&graph, &[(larger, "into", 3)]);
        let expected = "    let v2 = a[0] < a[1];
    let v3 = a[0] * a[1];
    let v4 = -2.0 + v3;
    let v5 = libm::sqrt(v4);
    let v6 = if v2 { a[1] } else { v5 };
    into[3] = v6;
";
        assert_eq!(rust, expected);
    }
}
