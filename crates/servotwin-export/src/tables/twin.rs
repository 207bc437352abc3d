//! The virtual twin in any language: the sizes of its arrays, the tables of its steps, and its equations.

use crate::error::ExportError;
use crate::language::Language;
use crate::notation::Notation;
use crate::twin::ExportedTwin;
use servotwin_model::c_source::{described, write_rust_twin, write_twin};
use servotwin_model::program::Program;
use servotwin_model::solver::tableau::Tableau;
use servotwin_model::solver::{Between, Control};
use servotwin_model::spec::Start;

/// The head of the sizes, and of the tables.
fn heads(notation: Notation) -> [&'static str; 2] {
    match notation.language {
        Language::C => [
            "/* Written by servotwin; do not edit. */\n",
            "/* Written by servotwin; do not edit. */\n#include \"servotwin_twin.h\"\n",
        ],
        Language::Rust => [
            "//! Sizes of the twin, written by servotwin; do not edit.\n",
            "//! Tables of the twin, written by servotwin; do not edit. Values are in SI units.\n\nuse crate::course::{Between, Knot};\n\
             use crate::twin::{Guess, StepControl};\nuse crate::twin_sizes;\n",
        ],
    }
}

/// The texts of three files: sizes, tables and equations.
pub(crate) fn texts(twin: &ExportedTwin, notation: Notation) -> Result<[String; 3], ExportError> {
    let method = twin.settings.method;
    let equations = match notation.language {
        Language::C => write_twin(twin.program, method),
        Language::Rust => write_rust_twin(twin.program, method),
    };
    let explicit = ExportError::Unsupported("an explicit method has no counterpart in an export");
    let (tableau, equations) = method.tableau().zip(equations).ok_or(explicit)?;
    let [head_of_sizes, head] = heads(notation);
    let sizes = notation.sizes(head_of_sizes, "SERVOTWIN_TWIN", &sizes(twin.program, tableau));
    let mut tables = Tables { text: head.into(), notation };
    tables.write(twin, tableau);
    Ok([sizes, tables.text, equations])
}

/// Parameters without a fault, with their names and units.
fn parameters(program: &Program) -> impl Iterator<Item = (String, f64)> {
    let values = program.parameters(&[]);
    let components = program.network().components.iter().zip(values);
    components.flat_map(|(instance, values)| {
        let declared = instance.component.spec().parameters.iter();
        let named =
            declared.map(|p| described(&format!("{}.{}", instance.id, p.name), p.unit.symbol()));
        named.zip(values).collect::<Vec<_>>()
    })
}

fn sizes(program: &Program, tableau: &Tableau) -> [(&'static str, usize); 13] {
    let clocks = program.clock_periods_s().count();
    [
        ("STATES", program.states().len()),
        ("INPUTS", program.externals().len()),
        ("HELD", program.stand_ins().end - program.externals().start),
        ("SUMS_END", program.derivatives().end),
        ("VARIABLES", program.memory()),
        ("PARAMETERS", parameters(program).count()),
        ("FAULTS", program.faults().count()),
        ("CONSTANTS", program.constants()),
        ("GRADIENTS", program.jacobian().slots()),
        ("FACTORS", program.lu().slots()),
        ("STAGES", tableau.stages()),
        ("CLOCKS", clocks),
        ("MOST_CLOCKS", clocks.max(1)),
    ]
}

/// The text of the tables.
struct Tables {
    text: String,
    notation: Notation,
}

impl Tables {
    fn write(&mut self, twin: &ExportedTwin, tableau: &Tableau) {
        let notation = self.notation;
        let control = control(twin, tableau, notation);
        self.text.push('\n');
        let name = self.name("control");
        notation.write_public(&mut self.text, "StepControl", &name, &control);
        self.states(twin.program);
        self.inputs(twin);
        // C has no empty arrays.
        let clocks = if notation.language == Language::C { "MOST_CLOCKS" } else { "CLOCKS" };
        let periods = twin.program.clock_periods_s().map(|period_s| self.plain(period_s));
        let periods = periods.collect();
        self.entries("f64", "clock_periods_s", clocks, periods);
        let parameters = parameters(twin.program);
        let parameters = parameters.map(|(name, value)| (notation.number(value), name)).collect();
        self.entries("f64", "parameters", "PARAMETERS", parameters);
        self.sensors(twin);
    }

    /// A number without a comment.
    fn plain(&self, value: f64) -> (String, String) {
        (self.notation.number(value), String::new())
    }

    /// Adds an array, one line for each entry, with its comment if it has one. Its length is a size of the twin.
    fn entries(&mut self, kind: &str, name: &str, length: &str, entries: Vec<(String, String)>) {
        let prefix =
            if self.notation.language == Language::C { "SERVOTWIN_TWIN_" } else { "twin_sizes::" };
        self.array(kind, name, &format!("{prefix}{length}"), entries);
    }

    fn array(&mut self, kind: &str, name: &str, length: &str, entries: Vec<(String, String)>) {
        let name = self.name(name);
        self.notation.write_commented_list(&mut self.text, kind, (&name, length), &entries);
    }

    /// The name of a constant: in Rust these tables are a module of their own.
    fn name(&self, name: &str) -> String {
        let prefix = if self.notation.language == Language::C { "twin_" } else { "" };
        format!("{prefix}{name}")
    }

    /// The variables that the sensors show. The header of the hybrid twin declares them in C.
    fn sensors(&mut self, twin: &ExportedTwin) {
        let sensors = twin.sensors.iter().map(|slot| (slot.to_string(), String::new())).collect();
        let mut count = twin.sensors.len();
        if self.notation.language == Language::C {
            self.text += "\nextern const int32_t servotwin_twin_sensors[];\n";
            count = count.max(1);
        }
        self.array("usize", "sensors", &count.to_string(), sensors);
    }

    fn states(&mut self, program: &Program) {
        let (states, notation) = (program.states(), self.notation);
        let components = &program.network().components;
        let first_parameter = |component: usize| -> usize {
            components[..component].iter().map(|instance| instance.parameters.len()).sum()
        };
        let guesses = states.iter().map(|state| {
            let spec = components[state.component].component.spec();
            let (parameter, value) = match spec.states[state.state].start {
                Start::Value(value) => (None, value),
                Start::Parameter(name) => {
                    let place = spec.parameter(name).unwrap_or_default();
                    (Some(first_parameter(state.component) + place), 0.0)
                }
            };
            let fields =
                [("parameter", notation.place(parameter)), ("value", notation.number(value))];
            (notation.record("Guess", &fields), described(&state.name, state.unit.symbol()))
        });
        self.entries("Guess", "guesses", "STATES", guesses.collect());
        let reciprocal = |number: f64| self.plain(1.0 / number);
        for (name, values) in [
            ("scales", states.iter().map(|s| reciprocal(s.scale)).collect::<Vec<_>>()),
            ("allowances", states.iter().map(|s| reciprocal(s.scale * s.error_weight)).collect()),
            ("lowest", states.iter().map(|s| self.plain(s.lowest.max(-f64::MAX))).collect()),
        ] {
            self.entries("f64", name, "STATES", values);
        }
    }

    fn inputs(&mut self, twin: &ExportedTwin) {
        let (inputs, notation) = (&twin.program.network().inputs, self.notation);
        let defaults = inputs.iter().map(|input| {
            let fields =
                [("value", notation.number(input.default)), ("slope_per_s", notation.number(0.0))];
            (notation.record("Knot", &fields), described(&input.id, input.unit.symbol()))
        });
        self.entries("Knot", "defaults", "INPUTS", defaults.collect());
        let course = |between: &Between| match between {
            Between::Hold => "Hold",
            Between::Line => "Line",
            Between::Cubic => "Cubic",
        };
        let courses =
            twin.between.iter().map(|between| notation.variant("Between", course(between)));
        let courses = courses.map(|course| (course, String::new())).collect();
        self.entries("Between", "between", "INPUTS", courses);
        let slopes = (0..inputs.len()).map(|input| twin.program.jacobian().slope(input));
        let slopes = slopes.map(|slope| (slope.to_string(), String::new())).collect();
        self.entries("usize", "slopes", "INPUTS", slopes);
    }
}

/// The entry of the control of the steps.
fn control(twin: &ExportedTwin, tableau: &Tableau, notation: Notation) -> String {
    let (is_fixed, step_s, tolerance, max_step_s, limit) = match twin.settings.control {
        Control::Fixed { step_s } => (true, step_s, 1.0, 1.0, f64::MAX),
        Control::Adaptive { tolerance, max_step_s, attempt_rate_limit_per_s } => {
            (false, 0.0, tolerance, max_step_s, attempt_rate_limit_per_s.min(f64::MAX))
        }
    };
    let growth_exponent = -1.0 / f64::from(tableau.order);
    notation.record(
        "StepControl",
        &[
            ("period_s", notation.number(twin.period_s)),
            ("is_fixed", is_fixed.to_string()),
            ("fixed_step_s", notation.number(step_s)),
            ("tolerance", notation.number(tolerance)),
            ("max_step_s", notation.number(max_step_s)),
            ("attempt_rate_limit_per_s", notation.number(limit)),
            ("reciprocal_gamma", notation.number(1.0 / tableau.gamma)),
            ("growth_exponent", notation.number(growth_exponent)),
            ("alpha", notation.numbers(tableau.alpha)),
            ("gamma_sum", notation.numbers(tableau.gamma_sum)),
        ],
    )
}
