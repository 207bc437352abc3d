//! The functions of a twin in C99.

use super::super::functions::Traced;
use super::super::helpers::Frame;
use super::super::printer::line;
use super::super::statements::{PREFIX, Statements};
use super::{Choice, TwinLanguage, is_one_of_several};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// C99; the functions begin with `servotwin_twin_`.
#[derive(Clone, Copy)]
pub(super) struct C;

const HEADING: &str = "/* Written by servotwin; do not edit. One operation per statement, so that no compiler may fuse two. */
#include \"servotwin_equations.h\"

#include <math.h>
#include <string.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

";

const POWER: &str = "double servotwin_twin_power(double x, double exponent)
{
    const double logarithm = servotwin_twin_log2(x);
    const double product = logarithm * exponent;
    return servotwin_twin_exp2(product);
}
";

/// The arguments of a function.
fn arguments(reads: &[&str], writes: &[&str]) -> String {
    let reads = reads.iter().map(|name| format!("const double *{name}"));
    let writes = writes.iter().map(|name| format!("double *{name}"));
    reads.chain(writes).collect::<Vec<_>>().join(", ")
}

impl TwinLanguage for C {
    type Statements = Statements;

    fn statements(self) -> Statements {
        Statements
    }

    fn heading(self, _most_held: Option<usize>) -> String {
        HEADING.into()
    }

    fn frame(self) -> Frame<'static> {
        Frame::C { kind: "double", prefix: PREFIX }
    }

    fn power(self) -> &'static str {
        POWER
    }

    fn begin(self, traced: &Traced) -> String {
        let linkage = if is_one_of_several(traced) { "static " } else { "" };
        let (name, arguments) = (&traced.name, arguments(traced.reads, traced.writes));
        let names = traced.reads.iter().chain(traced.writes);
        let unused: String = names.map(|name| format!("\n    (void){name};")).collect();
        format!("{linkage}void {PREFIX}_{name}({arguments})\n{{{unused}")
    }

    fn print_choice(self, c: &mut String, choice: &Choice) {
        let &Choice { name, number, reads, writes, own, .. } = choice;
        let head = arguments(reads, writes);
        line(c, format_args!("void {PREFIX}_{name}(int32_t {number}, {head})\n{{"));
        let given = || reads.iter().chain(writes).copied();
        let arrays = given().chain(own.map(|(name, _)| name)).collect::<Vec<_>>().join(", ");
        if let Some((own, length)) = own {
            line(c, format_args!("    double {own}[{length}];"));
        } else if choice.cases.is_empty() {
            given().for_each(|array| line(c, format_args!("    (void){array};")));
        }
        line(c, format_args!("    switch ({number}) {{"));
        for case in &choice.cases {
            let stores: String =
                case.stores.iter().map(|store| format!("\n        {store}")).collect();
            let case = case.number;
            line(c, format_args!("    case {case}:"));
            line(c, format_args!("        {PREFIX}_{name}_{case}({arrays});{stores}"));
            line(c, format_args!("        break;"));
        }
        line(c, format_args!("    default:\n        break;\n    }}\n}}\n"));
    }
}
