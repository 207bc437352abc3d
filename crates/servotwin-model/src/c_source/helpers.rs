//! Functions that the equations call and the C library lacks.

use super::printer::{Body, Dialect, line};
use crate::symbol::{Binary, Expression, Function, Unary};
use alloc::collections::BTreeSet;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// A function printed before the equations.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Helper {
    Round,
    Scaled,
    Mantissa,
    Exponent,
    Function(Function),
}

impl Helper {
    /// The function that an expression calls.
    pub(crate) fn called_by(expression: Expression) -> Option<Self> {
        match expression {
            Expression::Unary(Unary::Round, _) => Some(Helper::Round),
            Expression::Unary(Unary::Mantissa, _) => Some(Helper::Mantissa),
            Expression::Unary(Unary::Exponent, _) => Some(Helper::Exponent),
            Expression::Unary(Unary::Call(function), _) => Some(Helper::Function(function)),
            Expression::Binary(Binary::Scaled, ..) => Some(Helper::Scaled),
            _ => None,
        }
    }

    /// The text of a function that cannot be traced; see `lanes/single.rs`.
    fn text(self) -> Option<&'static str> {
        match self {
            Helper::Round => Some(ROUND),
            Helper::Scaled => Some(SCALED),
            Helper::Mantissa => Some(MANTISSA),
            Helper::Exponent => Some(EXPONENT),
            Helper::Function(_) => None,
        }
    }
}

/// An operation with one operand. The names of helpers begin with `prefix`.
pub(super) fn unary_text(prefix: &str, operation: Unary, a: &str) -> String {
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

/// Prints the called functions, and the functions that these call. `head` stands before their names, for example
/// `static double p`.
pub(super) fn print_helpers<D: Dialect>(
    c: &mut String,
    head: &str,
    called: BTreeSet<Helper>,
    dialect: impl Fn() -> D,
) {
    let functions: Vec<(Function, Body)> = (called.iter())
        .filter_map(|helper| match helper {
            Helper::Function(function) => Some((*function, Body::new(*function))),
            _ => None,
        })
        .collect();
    let mut all = called;
    let called_inside = functions.iter().flat_map(|(_, body)| body.needed());
    all.extend(called_inside.filter_map(Helper::called_by));
    for text in all.iter().filter_map(|helper| helper.text()) {
        line(c, format_args!("{head}_{text}"));
    }
    for (function, body) in &functions {
        body.print(c, &format!("{head}_{}(double x)", function.name()), dialect());
    }
}
