//! The features of a window: a trace of the same formulas that the diagnosis runs.
//!
//! Logarithms stand between two groups of statements. The first group computes what they are taken of, the second
//! computes the features from them.

use servotwin_diagnosis::features::{Sensors, features, values_into};
use servotwin_diagnosis::hierarchy::Names;
use servotwin_diagnosis::number::Number;
use servotwin_diagnosis::residual::Statistics;
use servotwin_model::c_source::write_statements;
use servotwin_model::scalar::Scalar;
use servotwin_model::symbol::{Graph, Symbol};
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// The expressions of a trace, and what logarithms are taken of.
#[derive(Default)]
struct Trace<'g> {
    logarithms: RefCell<Vec<Symbol<'g>>>,
}

/// A number of a trace.
#[derive(Clone, Copy)]
struct Traced<'t, 'g> {
    symbol: Symbol<'g>,
    /// `None` for a constant.
    of: Option<(&'t Trace<'g>, &'g Graph)>,
}

impl<'t, 'g> Traced<'t, 'g> {
    fn with(self, other: Self, symbol: Symbol<'g>) -> Self {
        Traced { symbol, of: self.of.or(other.of) }
    }
}

macro_rules! operators {
    ($($operator:ident $method:ident,)*) => {
        $(impl $operator for Traced<'_, '_> {
            type Output = Self;

            fn $method(self, other: Self) -> Self {
                self.with(other, self.symbol.$method(other.symbol))
            }
        })*
    };
}

operators! { Add add, Sub sub, Mul mul, Div div, }

impl Neg for Traced<'_, '_> {
    type Output = Self;

    fn neg(self) -> Self {
        Traced { symbol: -self.symbol, ..self }
    }
}

impl Number for Traced<'_, '_> {
    fn constant(value: f64) -> Self {
        Traced { symbol: Symbol::Constant(value), of: None }
    }

    fn sqrt(self) -> Self {
        Traced { symbol: Scalar::sqrt(self.symbol), ..self }
    }

    fn log10(self) -> Self {
        let (Symbol::Node(..), Some((trace, graph))) = (self.symbol, self.of) else {
            unreachable!("no formula takes the logarithm of a constant");
        };
        let mut logarithms = trace.logarithms.borrow_mut();
        let is_same = |known: &Symbol| known.operand() == self.symbol.operand();
        let place = logarithms.iter().position(is_same).unwrap_or(logarithms.len());
        if place == logarithms.len() {
            logarithms.push(self.symbol);
        }
        Traced { symbol: graph.variable("logarithm", place), ..self }
    }

    fn abs(self) -> Self {
        Traced { symbol: Scalar::abs(self.symbol), ..self }
    }

    fn if_less(self, other: Self, yes: Self, no: Self) -> Self {
        let chosen = Symbol::select(self.symbol.less(other.symbol), yes.symbol, no.symbol);
        self.with(other, chosen).with(yes.with(no, chosen), chosen)
    }
}

/// The statistics of a window of the export.
struct Variables<'t, 'g> {
    trace: &'t Trace<'g>,
    graph: &'g Graph,
    sensors: usize,
}

impl<'t, 'g> Variables<'t, 'g> {
    fn entry(&self, array: &'static str, index: usize) -> Traced<'t, 'g> {
        Traced { symbol: self.graph.variable(array, index), of: Some((self.trace, self.graph)) }
    }
}

impl<'t, 'g> Statistics for Variables<'t, 'g> {
    type Number = Traced<'t, 'g>;

    fn samples(&self) -> Self::Number {
        self.entry("samples", 0)
    }

    fn mean(&self, sensor: usize) -> Self::Number {
        self.entry("mean", sensor)
    }

    fn twin_mean(&self, sensor: usize) -> Self::Number {
        self.entry("mean", self.sensors + sensor)
    }

    fn covariance_of(&self, a: usize, b: usize) -> Self::Number {
        let (low, high) = (a.min(b), a.max(b));
        self.entry("moments", high * (high + 1) / 2 + low) / self.samples()
    }

    fn largest(&self, sensor: usize) -> Self::Number {
        self.entry("largest", sensor)
    }

    fn stands_in(&self, sensor: usize) -> Self::Number {
        self.entry("stands_in", sensor)
    }

    fn sensors(&self) -> usize {
        self.sensors
    }
}

/// The source that computes the named features in their order.
pub(crate) fn text(sensors: &Sensors, names: &Names) -> String {
    let (graph, trace) = (Graph::new(), Trace::default());
    let window = Variables { trace: &trace, graph: &graph, sensors: sensors.0.len() };
    let (known, mut values) = (features(sensors), Vec::new());
    values_into(sensors, &window, &mut values);
    let read: Vec<usize> = names
        .features
        .iter()
        .filter_map(|name| known.iter().position(|feature| &feature.name == name))
        .collect();
    let features = read.iter().enumerate().map(|(i, &place)| (values[place].symbol, "row", i));
    let features: Vec<_> = features.collect();
    let logarithms = trace.logarithms.borrow();
    let arguments = logarithms.iter().enumerate().map(|(i, &symbol)| (symbol, "argument", i));
    let arguments: Vec<_> = arguments.collect();
    let write_arguments = write_statements(&graph, &arguments);
    let write_row = write_statements(&graph, &features);
    let count = arguments.len().max(1);
    let head = "const servotwin_real *samples, const servotwin_real *mean, const servotwin_real *moments, const servotwin_real *largest,\n    \
                const servotwin_real *stands_in";
    let unused = "    (void)samples;\n    (void)mean;\n    (void)moments;\n    (void)largest;\n    (void)stands_in;\n";
    format!(
        "/* Written by servotwin; do not edit. One operation per statement, so that no compiler may fuse two. */
#include \"servotwin_features.h\"

#include \"servotwin_math.h\"

#include <math.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* What logarithms are taken of. */
static void write_arguments(
    {head}, servotwin_real *argument)
{{
{unused}{write_arguments}}}

static void write_row(
    {head}, const servotwin_real *logarithm, servotwin_real *row)
{{
{unused}    (void)logarithm;
{write_row}}}

void servotwin_features(const servotwin_window *window, const servotwin_real *stands_in, servotwin_real *row)
{{
    servotwin_real logarithm[{count}] = {{ 1.0 }};
    const servotwin_real samples[1] = {{ (servotwin_real)window->samples }};
    write_arguments(samples, window->mean, window->moments, window->largest, stands_in, logarithm);
    for (int32_t i = 0; i < {count}; i++) {{
        logarithm[i] = servotwin_log10(logarithm[i]);
    }}
    write_row(samples, window->mean, window->moments, window->largest, stands_in, logarithm, row);
}}

bool servotwin_features_keeps_rules(void)
{{
    return servotwin_keeps_rules();
}}
"
    )
}
