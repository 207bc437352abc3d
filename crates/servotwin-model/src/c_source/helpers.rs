//! Functions that the equations call and the libraries of C and Rust lack.

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
    pub fn called_by(expression: Expression) -> Option<Self> {
        match expression {
            Expression::Unary(Unary::Round, _) => Some(Helper::Round),
            Expression::Unary(Unary::Mantissa, _) => Some(Helper::Mantissa),
            Expression::Unary(Unary::Exponent, _) => Some(Helper::Exponent),
            Expression::Unary(Unary::Call(function), _) => Some(Helper::Function(function)),
            Expression::Binary(Binary::Scaled, ..) => Some(Helper::Scaled),
            _ => None,
        }
    }

    /// The text of a function that cannot be traced, in C and in Rust; see `lanes/single.rs`.
    fn texts(self) -> Option<[&'static str; 2]> {
        match self {
            Helper::Round => Some([ROUND, RUST_ROUND]),
            Helper::Scaled => Some([SCALED, RUST_SCALED]),
            Helper::Mantissa => Some([MANTISSA, RUST_MANTISSA]),
            Helper::Exponent => Some([EXPONENT, RUST_EXPONENT]),
            Helper::Function(_) => None,
        }
    }
}

/// The frame of a helper: what stands around its statements.
#[derive(Clone, Copy)]
pub(super) enum Frame<'a> {
    /// C99, with what stands before the name, for example `static double` and `p`.
    C { kind: &'a str, prefix: &'a str },
    /// A function of a Rust module.
    Rust,
}

impl Frame<'_> {
    /// Prints a function that cannot be traced.
    fn print_text(self, c: &mut String, [of_c, of_rust]: [&str; 2]) {
        match self {
            Frame::C { kind, prefix } => line(c, format_args!("{kind} {prefix}_{of_c}")),
            Frame::Rust => line(c, format_args!("pub fn {of_rust}")),
        }
    }

    /// Prints a traced function.
    fn print<D: Dialect>(self, c: &mut String, (function, body): &(Function, Body), dialect: D) {
        let name = function.name();
        match self {
            Frame::C { kind, prefix } => {
                body.print(c, &format!("{kind} {prefix}_{name}(double x)"), dialect);
            }
            Frame::Rust => {
                line(c, format_args!("pub fn {name}(x: f64) -> f64 {{"));
                let value = body.statements(c, dialect);
                line(c, format_args!("    {value}\n}}\n"));
            }
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

const RUST_ROUND: &str = "rounded(x: f64) -> f64 {
    (x + 6755399441055744.0) - 6755399441055744.0
}
";

const RUST_SCALED: &str = "scaled(x: f64, exponent: f64) -> f64 {
    let shifted = exponent + 6755399441055744.0;
    let bits = (shifted.to_bits() << 52).wrapping_add(0x3ff0000000000000);
    x * f64::from_bits(bits)
}
";

const RUST_MANTISSA: &str = "mantissa(x: f64) -> f64 {
    let bits = x.to_bits().wrapping_add(0x3ff0000000000000 - 0x3fe6a09e667f3bcd);
    f64::from_bits((bits & 0x000fffffffffffff) + 0x3fe6a09e667f3bcd)
}
";

const RUST_EXPONENT: &str = "exponent(x: f64) -> f64 {
    let bits = x.to_bits().wrapping_add(0x3ff0000000000000 - 0x3fe6a09e667f3bcd);
    f64::from_bits((bits >> 52) | 0x4330000000000000) - 4503599627371519.0
}
";

/// Prints the called functions, and the functions that these call.
pub(super) fn print_helpers<D: Dialect>(
    c: &mut String,
    frame: Frame,
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
    for texts in all.iter().filter_map(|helper| helper.texts()) {
        frame.print_text(c, texts);
    }
    for function in &functions {
        frame.print(c, function, dialect());
    }
}
