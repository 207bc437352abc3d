//! `modelDescription.xml` for both versions of FMI.

use super::units;
use super::variables::{Variable, VariableKind, Variables};
use servotwin_io::text::escaped;
use servotwin_model::spec::Unit;
use std::collections::BTreeSet;
use std::fmt::Write;

/// A version of the Functional Mock-up Interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// 2.0.
    Two,
    /// 3.0.
    Three,
}

impl Version {
    /// Both versions.
    pub const ALL: [Version; 2] = [Version::Two, Version::Three];

    /// The name in options.
    pub fn name(self) -> &'static str {
        match self {
            Version::Two => "2",
            Version::Three => "3",
        }
    }
}

/// What a model description is made of.
pub(super) struct Description<'d> {
    pub version: Version,
    /// A C identifier.
    pub(crate) name: &'d str,
    pub(crate) title: &'d str,
    /// The importing tool must show this text to the binary.
    pub(crate) token: &'d str,
    pub(crate) sources: &'d [&'d str],
    pub(crate) variables: &'d Variables,
    /// The states and inputs that each slot of a program depends on; a host may integrate its states. Without them the FMU
    /// serves co-simulation only.
    pub(crate) dependencies: Option<&'d [BTreeSet<usize>]>,
    pub(crate) period_s: f64,
}

impl Description<'_> {
    pub(crate) fn text(&self) -> String {
        let Description { version, name, title, token, .. } = self;
        let token_name = if *version == Version::Two { "guid" } else { "instantiationToken" };
        let mut xml = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"{}.0\" modelName=\"{name}\" \
             {token_name}=\"{token}\"\n  description=\"{}\" generationTool=\"servotwin {}\" \
             variableNamingConvention=\"structured\"{}>\n",
            version.name(),
            escaped(title),
            env!("CARGO_PKG_VERSION"),
            if *version == Version::Two { " numberOfEventIndicators=\"0\"" } else { "" },
        );
        self.write_interfaces(&mut xml);
        self.write_units(&mut xml);
        let _ = writeln!(
            xml,
            "  <DefaultExperiment startTime=\"0\" stopTime=\"10\" tolerance=\"1e-6\" stepSize=\"{}\"/>",
            self.period_s
        );
        self.write_variables(&mut xml);
        self.write_structure(&mut xml);
        xml + "</fmiModelDescription>\n"
    }

    fn write_interfaces(&self, xml: &mut String) {
        let (state, derivative) = match self.version {
            Version::Two => ("FMUstate", "providesDirectionalDerivative"),
            Version::Three => ("FMUState", "providesDirectionalDerivatives"),
        };
        let is_model = self.dependencies.is_some();
        for (interface, more) in [
            ("ModelExchange", ""),
            ("CoSimulation", " canHandleVariableCommunicationStepSize=\"true\""),
        ] {
            if interface == "ModelExchange" && !is_model {
                continue;
            }
            let _ = write!(
                xml,
                "  <{interface} modelIdentifier=\"{}\" canGetAndSet{state}=\"true\" canSerialize{state}=\"true\"\n    \
                 {derivative}=\"{is_model}\"{more}",
                self.name
            );
            if self.version == Version::Three {
                if !is_model {
                    let _ = write!(xml, " fixedInternalStepSize=\"{}\"", self.period_s);
                }
                *xml += "/>\n";
                continue;
            }
            *xml += ">\n    <SourceFiles>\n";
            for source in self.sources {
                let _ = writeln!(xml, "      <File name=\"{source}\"/>");
            }
            let _ = writeln!(xml, "    </SourceFiles>\n  </{interface}>");
        }
    }

    fn write_units(&self, xml: &mut String) {
        let has = |unit: &Unit| self.variables.all.iter().any(|variable| variable.unit == *unit);
        let used = Unit::ALL.into_iter().filter(has).filter_map(units::element);
        *xml += "  <UnitDefinitions>\n";
        xml.extend(used);
        *xml += "  </UnitDefinitions>\n";
    }

    fn write_variables(&self, xml: &mut String) {
        *xml += "  <ModelVariables>\n";
        if self.version == Version::Three {
            *xml += "    <Float64 name=\"time\" valueReference=\"300000\" causality=\"independent\" \
                     variability=\"continuous\" unit=\"s\"/>\n";
        }
        for variable in &self.variables.all {
            match self.version {
                Version::Two => self.write_variable_of_two(xml, variable),
                Version::Three => self.write_variable_of_three(xml, variable),
            }
        }
        *xml += "  </ModelVariables>\n";
    }

    fn write_variable_of_two(&self, xml: &mut String, variable: &Variable) {
        let derivative = variable.derivative_of.and_then(|state| self.variables.of_slot(state));
        let derivative = derivative.map(|place| place + 1);
        let _ = writeln!(
            xml,
            "    <ScalarVariable {}>\n      <Real{}/>\n    </ScalarVariable>",
            identity(variable),
            of_type(variable, derivative)
        );
    }

    fn write_variable_of_three(&self, xml: &mut String, variable: &Variable) {
        let derivative = variable.derivative_of;
        let _ =
            writeln!(xml, "    <Float64 {}{}/>", identity(variable), of_type(variable, derivative));
    }

    /// Which states and inputs an output or a derivative depends on.
    fn write_structure(&self, xml: &mut String) {
        let Variables { all, .. } = self.variables;
        let known = |place: usize| {
            let Some(dependencies) = self.dependencies else {
                return String::new();
            };
            let slots = dependencies.get(all[place].reference).into_iter().flatten();
            let of_slots = slots.filter_map(|&slot| self.variables.of_slot(slot));
            let known: Vec<String> = of_slots.map(|place| self.reference(place)).collect();
            format!(" dependencies=\"{}\"", known.join(" "))
        };
        let with = |place: usize| (self.reference(place), known(place));
        let without = |place: usize| (self.reference(place), String::new());
        let outputs: Vec<_> = self.variables.outputs().map(with).collect();
        let derivatives: Vec<_> = self.variables.derivatives().map(with).collect();
        let initial: Vec<_> = self.variables.initial_unknowns().into_iter().map(without).collect();
        *xml += "  <ModelStructure>\n";
        let groups = [
            ("Outputs", "Output", outputs),
            ("Derivatives", "ContinuousStateDerivative", derivatives),
            ("InitialUnknowns", "InitialUnknown", initial),
        ];
        for (group, single, entries) in groups.into_iter().filter(|group| !group.2.is_empty()) {
            if self.version == Version::Two {
                let _ = writeln!(xml, "    <{group}>");
            }
            for (reference, known) in entries {
                let _ = match self.version {
                    Version::Two => writeln!(xml, "      <Unknown index=\"{reference}\"{known}/>"),
                    Version::Three => {
                        writeln!(xml, "    <{single} valueReference=\"{reference}\"{known}/>")
                    }
                };
            }
            if self.version == Version::Two {
                let _ = writeln!(xml, "    </{group}>");
            }
        }
        *xml += "  </ModelStructure>\n";
    }

    /// How the model structure names a variable: version 2 by its index from 1, version 3 by its reference.
    fn reference(&self, place: usize) -> String {
        match self.version {
            Version::Two => (place + 1).to_string(),
            Version::Three => self.variables.all[place].reference.to_string(),
        }
    }
}

/// Attributes that both versions have at the variable.
fn identity(variable: &Variable) -> String {
    let kind = match variable.kind {
        VariableKind::Input => "causality=\"input\" variability=\"continuous\"",
        VariableKind::Output => {
            "causality=\"output\" variability=\"continuous\" initial=\"calculated\""
        }
        VariableKind::Sampled => {
            "causality=\"output\" variability=\"discrete\" initial=\"calculated\""
        }
        VariableKind::Local => {
            "causality=\"local\" variability=\"continuous\" initial=\"calculated\""
        }
        VariableKind::Tunable => {
            "causality=\"parameter\" variability=\"tunable\" initial=\"exact\""
        }
    };
    let mut text = format!(
        "name=\"{}\" valueReference=\"{}\" {kind}",
        escaped(&variable.name),
        variable.reference
    );
    if !variable.description.is_empty() {
        let _ = write!(text, " description=\"{}\"", escaped(&variable.description));
    }
    text
}

/// Attributes that version 2 has at the type.
fn of_type(variable: &Variable, derivative: Option<usize>) -> String {
    let mut text = String::new();
    let unit = variable.unit.symbol();
    if !unit.is_empty() {
        let _ = write!(text, " unit=\"{unit}\"");
    }
    if let Some(display) = variable.display {
        let _ = write!(text, " displayUnit=\"{display}\"");
    }
    let [least, largest] = variable.range;
    for (name, number) in
        [("min", least), ("max", largest), ("nominal", variable.nominal), ("start", variable.start)]
    {
        if let Some(number) = number {
            let _ = write!(text, " {name}=\"{number:?}\"");
        }
    }
    if let Some(derivative) = derivative {
        let _ = write!(text, " derivative=\"{derivative}\"");
    }
    text
}
