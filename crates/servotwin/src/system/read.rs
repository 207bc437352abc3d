//! Reads TOML into a [`Scope`]: sections, components, connections, inputs and sensors. Mistakes are collected, and
//! reading continues.

use super::fluid::FluidText;
use super::reservoir::Reservoir;
use super::scope::{End, Input, Part, Scope};
use super::{FORMAT, Sensor, schema};
use crate::format::{At, Ids, Key, Raw, Read, Value, check_id, may, section};
use crate::nearest::nearest;
use crate::system::imperfection::scale_within_noise;
use crate::toml_text::{Collector, Diagnostic, Entry, TextSpan, TomlText, get};
use crate::units;
use servotwin_model::component::Component;
use servotwin_model::components::{ALL, find};
use servotwin_model::fluid::Fluid;
use servotwin_model::network::PortOf;
use servotwin_model::spec::{Law, Parameter, PortKind, Unit};

section! {
    /// A system file.
    pub(super) struct Text {
        #[expect(dead_code, reason = "it is checked before anything else")]
        must format: u32 = Value::Whole(FORMAT as f64, FORMAT as f64), "version of the file format";
        must name: String = Value::Id, "name in files and commands";
        may title: Option<String>, "title of the system, one line";
        #[expect(dead_code, reason = "fluids have keys by their kind")]
        may fluids: Raw = Value::Ids(&FluidText::VALUE), "fluids of the hydraulic circuits";
        #[expect(dead_code, reason = "they have components")]
        may assemblies: Raw = Value::Ids(&Value::Table(AssemblyText::KEYS)),
            "groups of components that occur several times";
        #[expect(dead_code, reason = "components have keys by their kind")]
        may components: Raw = Value::Ids(&Value::Other(
            schema::component_or_instance,
            "`kind` and its parameters, or `assembly` and changes of its components",
        )), "components of the catalog, and instances of assemblies";
        may system: SystemText, "what is not inside an assembly";
        may inputs: Ids<InputText>, "commands, loads and boundary values";
        may sensors: Ids<SensorText>, "signals that are measured and compared with the twin";
        may reservoirs: Ids<ReservoirText>, "fluid of a hydraulic system that leaks can empty";
    }
}

section! {
    struct AssemblyText {
        #[expect(dead_code, reason = "components have keys by their kind")]
        may components: Raw = Value::Ids(&Value::Other(
            schema::component,
            "`kind` and its parameters",
        )), "components of the catalog";
        may connections: Vec<At<Connection>>, "lists of ports (component.port) that are one node";
        may inputs: Ids<InputText>, "commands, loads and boundary values of every instance";
    }
}

section! {
    #[derive(Default)]
    struct SystemText {
        may connections: Vec<At<Connection>>, "lists of ports (component.port) that are one node";
    }
}

section! {
    struct InputText {
        must unit: At<Unit>, "unit of its values";
        must default: f64, "value where a run gives no signal, in SI";
        may to: Vec<At<String>>, "signal inputs (component.port) that it feeds";
    }
}

section! {
    struct SensorText {
        must signal: At<String>, "signal output (component.port), such as the reading of a sensor";
        must scale: At<f64> = Value::Number(1e-9, 1e12, ""),
            "the size that residuals are divided by, in the signal's unit";
        may label: Option<String>, "name in figures; default: its id";
    }
}

section! {
    struct ReservoirText {
        must volume_m3: f64 = Value::Number(1e-6, 10.0, "m³"),
            "fluid that can leak before the pump has none";
        must supply: At<String>, "pressure source that it feeds, whose pressure is an input";
        must r#return: At<String>, "tank that leads the fluid back";
    }
}

/// The ports and inputs that a connection joins.
#[derive(Clone, Debug)]
struct Connection(Vec<At<String>>);

impl Read for Connection {
    const VALUE: Value = Value::List(2, &Value::Text);

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        let ends = mistakes.list(entry)?;
        if ends.len() < 2 {
            let mistake = Diagnostic::new("a connection joins at least two ports");
            mistakes.note(&entry.value_at(), mistake);
        }
        let end = |end: &Entry| Some(At::new(mistakes.text(end)?.to_owned(), end.value_at()));
        let ends: Vec<Option<At<String>>> = ends.iter().map(end).collect();
        ends.into_iter().collect::<Option<_>>().map(Connection)
    }
}

/// A named declaration, with its place and whether it is used.
pub(super) struct Named<T> {
    pub(crate) name: String,
    pub(crate) at: TextSpan,
    pub(crate) used: bool,
    pub(crate) value: T,
}

/// The target of a connection's end.
enum Resolved {
    Port(PortOf),
    Input(usize),
}

/// The parsed file, as far as it was understood.
#[derive(Default)]
pub(super) struct Reader {
    pub(crate) mistakes: Collector,
    pub(crate) fluids: Vec<Named<Option<Fluid>>>,
    pub(crate) assemblies: Vec<Named<Scope>>,
    pub(crate) scope: Scope,
    pub(crate) sensors: Vec<Sensor>,
    pub(crate) reservoirs: Vec<Reservoir>,
    pub(crate) name: String,
    pub(crate) title: String,
}

/// A word that names nothing.
fn unknown<'n>(what: &str, word: &str, known: impl IntoIterator<Item = &'n str>) -> Diagnostic {
    Diagnostic::unknown(format!("unknown {what} '{word}'"), word, known)
}

/// The entries of a section of the file, in order.
fn members<'a>(all: &[Entry<'a>], section: &str) -> Vec<Entry<'a>> {
    get(all, section).and_then(Entry::table).unwrap_or_default()
}

impl Reader {
    /// Reads a whole file.
    pub(super) fn read(&mut self, text: &str) {
        let Some(document) = TomlText::parse(text, FORMAT, &mut self.mistakes) else { return };
        let root = document.root();
        let text = Text::of(&root, (&(0..0), "the file"), &mut self.mistakes);
        // What a wrong key was meant for may be missing elsewhere.
        let mut scope = Scope::new(text.is_some() && self.mistakes.is_empty());
        for entry in members(&root, "fluids") {
            self.fluid(&entry);
        }
        for entry in members(&root, "assemblies") {
            self.assembly(&entry);
        }
        for entry in members(&root, "components") {
            self.component(&mut scope, &entry);
        }
        if let Some(text) = text {
            self.signals(&mut scope, text.inputs, &text.system.connections);
            for (id, sensor) in text.sensors.0 {
                self.sensor(&scope, id.value, sensor);
            }
            for (id, reservoir) in text.reservoirs.0 {
                self.reservoir(&scope, id.value, reservoir);
            }
            self.title = text.title.unwrap_or_else(|| text.name.clone());
            self.name = text.name;
        }
        self.scope = scope;
    }

    /// Reads a number within a range.
    fn within(
        &mut self,
        entry: &Entry,
        range: (f64, f64),
        (unit, summary): (Unit, &str),
    ) -> Option<f64> {
        let value = self.mistakes.number(entry)?;
        if (range.0..=range.1).contains(&value) {
            return Some(value);
        }
        let mistake = Diagnostic::out_of_range(entry.key, value, range, unit.symbol(), summary);
        self.mistakes.note(&entry.value_at(), mistake);
        None
    }

    /// Reads a number within its declared range.
    fn declared(&mut self, entry: &Entry, declared: &Parameter) -> Option<f64> {
        let Parameter { min, max, unit, summary, .. } = *declared;
        self.within(entry, (min, max), (unit, summary))
    }

    // Fluids.

    fn fluid(&mut self, entry: &Entry) {
        check_id(entry.key, &entry.at, &mut self.mistakes);
        let key = may("fluids", FluidText::VALUE, "");
        let value = FluidText::read(entry, key, &mut self.mistakes).map(|fluid| fluid.0);
        let (name, at) = (entry.key.to_owned(), entry.at.clone());
        self.fluids.push(Named { name, at, used: false, value });
    }

    /// The index of a declared fluid.
    fn fluid_named(&mut self, entry: &Entry) -> Option<usize> {
        let word = self.mistakes.text(entry)?;
        let found = self.fluids.iter().position(|fluid| fluid.name == word);
        match found {
            Some(index) => self.fluids[index].used = true,
            None => {
                let known = self.fluids.iter().map(|fluid| fluid.name.as_str());
                self.mistakes.note(&entry.value_at(), unknown("fluid", word, known));
            }
        }
        found
    }

    // Components.

    fn assembly(&mut self, entry: &Entry) {
        check_id(entry.key, &entry.at, &mut self.mistakes);
        let all = self.mistakes.table(entry);
        let (before, all) = (self.mistakes.count(), all.unwrap_or_default());
        let place = format!("assembly '{}'", entry.key);
        let text = AssemblyText::of(&all, (&entry.at, &place), &mut self.mistakes);
        let is_read = text.is_some() && self.mistakes.count() == before;
        let mut scope = Scope::new(is_read && entry.table().is_some());
        for member in members(&all, "components") {
            self.part(&mut scope, &member);
        }
        if let Some(text) = text {
            self.signals(&mut scope, text.inputs, &text.connections);
        }
        let (name, at) = (entry.key.to_owned(), entry.at.clone());
        self.assemblies.push(Named { name, at, used: false, value: scope });
    }

    /// Reads a component of the system, or an instance of an assembly.
    fn component(&mut self, scope: &mut Scope, entry: &Entry) {
        let all = entry.table().unwrap_or_default();
        match (get(&all, "assembly"), get(&all, "kind")) {
            (Some(assembly), None) => {
                check_id(entry.key, &entry.at, &mut self.mistakes);
                if self.instance(scope, entry.key, assembly, &all).is_none() {
                    scope.breaks(entry.key);
                }
            }
            (Some(_), Some(_)) => {
                self.kind_or_assembly(entry);
                scope.breaks(entry.key);
            }
            (None, _) => self.part(scope, entry),
        }
    }

    fn kind_or_assembly(&mut self, entry: &Entry) {
        let message = format!("component '{}' needs either a 'kind' or an 'assembly'", entry.key);
        let help = "for example: kind = \"volume\"; or assembly = \"actuator\"";
        self.mistakes.note(&entry.at, Diagnostic::new(message).with_help(help));
    }

    fn instance(
        &mut self,
        scope: &mut Scope,
        id: &str,
        assembly: &Entry,
        all: &[Entry],
    ) -> Option<()> {
        let word = self.mistakes.text(assembly)?;
        let Some(index) = self.assemblies.iter().position(|a| a.name == word) else {
            let known = self.assemblies.iter().map(|a| a.name.as_str());
            self.mistakes.note(&assembly.value_at(), unknown("assembly", word, known));
            return None;
        };
        self.assemblies[index].used = true;
        let mut content = self.assemblies[index].value.clone();
        for entry in all.iter().filter(|entry| entry.key != "assembly") {
            self.overrides(&mut content, word, entry);
        }
        scope.include(id, content);
        Some(())
    }

    /// Reads an instance's overrides of a component in its assembly.
    fn overrides(&mut self, content: &mut Scope, assembly: &str, entry: &Entry) {
        if entry.key == "fluid" {
            if let Some(fluid) = self.fluid_named(entry) {
                let sources = content.parts.iter_mut().filter(|part| part.component.reference);
                sources.for_each(|part| part.fluid = Some(fluid));
            }
            return;
        }
        let Some(index) = content.part(entry.key) else {
            if !content.is_broken(entry.key) {
                let known = content.parts.iter().map(|part| part.id.as_str());
                let place = format!("assembly '{assembly}'");
                let mistake = Diagnostic::unknown_key(entry.key, &place, known);
                self.mistakes.note(&entry.at, mistake);
            }
            return;
        };
        let Some(all) = self.mistakes.table(entry) else { return };
        if let Some(kind) = get(&all, "kind") {
            let message = format!("the kind of '{}' cannot be overridden", entry.key);
            let help = "write a second assembly for another structure";
            self.mistakes.note(&kind.at, Diagnostic::new(message).with_help(help));
        }
        self.settings(&mut content.parts[index], &all);
    }

    /// Reads a component of the catalogue.
    fn part(&mut self, scope: &mut Scope, entry: &Entry) {
        check_id(entry.key, &entry.at, &mut self.mistakes);
        match self.built(entry) {
            Some(part) => scope.add(part),
            None => scope.breaks(entry.key),
        }
    }

    fn built(&mut self, entry: &Entry) -> Option<Part> {
        let all = self.mistakes.table(entry)?;
        let Some(kind) = get(&all, "kind") else {
            self.kind_or_assembly(entry);
            return None;
        };
        let word = self.mistakes.text(kind)?;
        let Some(component) = find(word) else {
            let known = ALL.iter().map(|component| component.kind);
            self.mistakes.note(&kind.value_at(), unknown("kind of component", word, known));
            return None;
        };
        let mut part = Part::new(entry.key.into(), entry.at.clone(), component);
        self.settings(&mut part, &all);
        Some(part)
    }

    /// Reads parameters, faults and fluid of a component.
    fn settings(&mut self, part: &mut Part, all: &[Entry]) {
        let spec = part.component;
        for entry in all.iter().filter(|entry| entry.key != "kind") {
            match (entry.key, spec.parameter(entry.key)) {
                (_, Some(index)) => match self.declared(entry, &spec.parameters[index]) {
                    Some(value) => part.parameters[index] = value,
                    None => unsound(part, index),
                },
                ("faults", None) => self.faults(part, entry),
                ("fluid", None) if spec.reference => match self.fluid_named(entry) {
                    Some(fluid) => part.fluid = Some(fluid),
                    None => part.sound = false,
                },
                ("fluid", None) => {
                    let (id, kind) = (&part.id, spec.kind);
                    let message = format!("'{id}' ({kind}) takes the fluid of its circuit");
                    let help = "a fluid is named by the sources and tanks of the circuit";
                    self.mistakes.note(&entry.at, Diagnostic::new(message).with_help(help));
                }
                _ => self.unknown_parameter(part, entry),
            }
        }
    }

    fn faults(&mut self, part: &mut Part, entry: &Entry) {
        let spec = part.component;
        for fault in self.mistakes.table(entry).unwrap_or_default() {
            let Some(index) = spec.fault(fault.key) else {
                let known = spec.faults.iter().map(|fault| fault.name);
                let place = format!("the faults of '{}' ({})", part.id, spec.kind);
                let mistake = Diagnostic::unknown_key(fault.key, &place, known);
                self.mistakes.note(&fault.at, mistake);
                continue;
            };
            let declared = &spec.faults[index];
            let unit = match declared.law {
                Law::Add => spec.parameter(declared.parameter).map(|p| spec.parameters[p].unit),
                Law::Scale | Law::Geometric => None,
            };
            let (range, unit) =
                ((declared.full_min, declared.full_max), unit.unwrap_or(Unit::None));
            if let Some(full) = self.within(&fault, range, (unit, declared.summary)) {
                part.faults[index] = full;
            }
        }
    }

    fn unknown_parameter(&mut self, part: &mut Part, entry: &Entry) {
        let spec: &'static Component = part.component;
        let (key, id) = (entry.key, &part.id);
        let (what, help) = if spec.fault(key).is_some() {
            ("fault", format!("its value at intensity 1 is set by: faults.{key} = …"))
        } else if spec.port(key).is_some() {
            ("port", format!("ports are joined in 'connections': [\"{id}.{key}\", …]"))
        } else {
            let extra: &[&str] = if spec.reference { &["fluid", "faults"] } else { &["faults"] };
            let place = format!("'{id}' ({})", spec.kind);
            let meant = self.unknown_number(entry, &place, spec.parameters, extra);
            match meant.and_then(|name| spec.parameter(name)) {
                Some(index) => unsound(part, index),
                None => part.sound = false,
            }
            return;
        };
        let message = format!("'{key}' is a {what}, no parameter");
        self.mistakes.note(&entry.at, Diagnostic::new(message).with_help(help));
    }

    /// Reports an unknown key among parameters; returns the parameter that was meant.
    fn unknown_number(
        &mut self,
        entry: &Entry,
        place: &str,
        parameters: &'static [Parameter],
        extra: &[&str],
    ) -> Option<&'static str> {
        let measured = parameters.iter().map(|p| (p.name, p.unit));
        if let Some(slip) = units::slip(entry, measured) {
            self.mistakes.note(&entry.at, slip.mistake(entry.key));
            return Some(slip.name);
        }
        let known = || parameters.iter().map(|p| p.name).chain(extra.iter().copied());
        self.mistakes.note(&entry.at, Diagnostic::unknown_key(entry.key, place, known()));
        let meant = nearest(entry.key, known())?;
        parameters.iter().map(|p| p.name).find(|name| *name == meant)
    }

    // Connections and signals.

    /// Adds the inputs and connections of a system or an assembly.
    fn signals(&mut self, scope: &mut Scope, inputs: Ids<InputText>, joined: &[At<Connection>]) {
        inputs.0.into_iter().for_each(|input| self.input(scope, input));
        joined.iter().for_each(|connection| self.connection(scope, connection));
    }

    fn connection(&mut self, scope: &mut Scope, connection: &At<Connection>) {
        let (mut ends, mut inputs): (Vec<End>, Vec<usize>) = Default::default();
        for word in &connection.0 {
            match self.resolve(scope, word) {
                Some(Resolved::Input(input)) => inputs.push(input),
                Some(Resolved::Port(port)) if ends.iter().any(|end| end.port == port) => {
                    let message = format!("'{}' stands twice in this connection", **word);
                    self.mistakes.note(&word.at, Diagnostic::new(message));
                }
                Some(Resolved::Port(port)) => ends.push(End { port, at: word.at.clone() }),
                None => scope.complete = false,
            }
        }
        match inputs[..] {
            [] => scope.connections.push(ends),
            [first] => ends.into_iter().for_each(|end| self.feed(scope, first, end)),
            [first, second, ..] => {
                self.mistakes.note(&connection.at, scope.two_inputs(first, second));
                scope.complete = false;
            }
        }
    }

    /// Resolves a name in a connection.
    fn resolve(&mut self, scope: &Scope, word: &At<String>) -> Option<Resolved> {
        if let Some(input) = scope.input(word) {
            return Some(Resolved::Input(input));
        }
        if scope.is_broken(word) {
            return None;
        }
        let ports = |index: usize| scope.parts[index].component.ports.iter().map(|port| port.name);
        if let Some(index) = scope.part(word) {
            let message = format!("'{}' is a component: which of its ports?", **word);
            let help = format!("its ports: {}", ports(index).collect::<Vec<_>>().join(", "));
            self.mistakes.note(&word.at, Diagnostic::new(message).with_help(help));
            return None;
        }
        let (id, port) = word.rsplit_once('.').unwrap_or((word, ""));
        let Some(component) = scope.part(id) else {
            let inputs = scope.inputs.iter().map(|input| input.id.as_str());
            let known = scope.parts.iter().map(|part| part.id.as_str()).chain(inputs);
            self.mistakes.note(&word.at, unknown("component", id, known));
            return None;
        };
        let spec = scope.parts[component].component;
        if let Some(port) = spec.port(port) {
            return Some(Resolved::Port(PortOf { component, port }));
        }
        let message = format!("'{id}' ({}) has no port '{port}'", spec.kind);
        self.mistakes.note(&word.at, Diagnostic::unknown(message, port, ports(component)));
        None
    }

    /// Connects an input to a port.
    fn feed(&mut self, scope: &mut Scope, input: usize, end: End) {
        let id = scope.port_id(end.port);
        let mistake = match scope.port(end.port).kind {
            PortKind::SignalIn { .. } => {
                scope.inputs[input].targets.push(end);
                return;
            }
            PortKind::SignalOut { .. } => scope.input_and_output(input, &id),
            kind => {
                Diagnostic::new(format!("an input cannot feed '{id}', which is {}", kind.family()))
                    .with_help("inputs feed the signal inputs of components")
            }
        };
        self.mistakes.note(&end.at, mistake);
        scope.complete = false;
    }

    fn input(&mut self, scope: &mut Scope, (id, text): (At<String>, InputText)) {
        if scope.has(&id) {
            let mistake = Diagnostic::new(format!("there are two things called '{}'", *id));
            self.mistakes.note(&id.at, mistake.with_help("every id stands for one thing"));
        }
        let InputText { unit: At { value: unit, at: unit_at }, default, to } = text;
        let (input, targets) = (scope.inputs.len(), vec![]);
        scope.inputs.push(Input { id: id.value, at: id.at, unit, unit_at, default, targets });
        for word in &to {
            match self.resolve(scope, word) {
                Some(Resolved::Port(port)) => {
                    self.feed(scope, input, End { port, at: word.at.clone() });
                }
                Some(Resolved::Input(other)) => {
                    self.mistakes.note(&word.at, scope.two_inputs(input, other));
                    scope.complete = false;
                }
                None => scope.complete = false,
            }
        }
    }

    fn sensor(&mut self, scope: &Scope, id: String, text: SensorText) {
        let Some((port, unit)) = self.output(scope, &text.signal) else { return };
        let part = &scope.parts[port.component];
        let read = (part.id.as_str(), part.component, part.parameters.as_slice());
        let mistake = scale_within_noise((&id, text.scale.value, unit), read);
        if let Some(mistake) = mistake.filter(|_| part.sound) {
            self.mistakes.note(&text.scale.at, mistake);
        }
        self.sensors.push(Sensor {
            label: text.label.unwrap_or_else(|| id.clone()),
            id,
            signal: scope.port_id(port),
            component: port.component,
            unit,
            scale: text.scale.value,
        });
    }

    /// Finds the output that a sensor names.
    fn output(&mut self, scope: &Scope, word: &At<String>) -> Option<(PortOf, Unit)> {
        if scope.is_broken(word) {
            return None;
        }
        let outputs: Vec<(String, PortOf, Unit)> = scope.outputs().collect();
        let found = outputs.iter().find(|(id, ..)| *id == **word);
        if found.is_none() {
            let ids: Vec<&str> = outputs.iter().map(|(id, ..)| id.as_str()).collect();
            let component = word.rsplit_once('.').map_or(word.as_str(), |(id, _)| id);
            let is_own = |id: &&str| id.rsplit_once('.').is_some_and(|(of, _)| of == component);
            let own: Vec<&str> = ids.iter().copied().filter(is_own).collect();
            let help = match nearest(word, ids) {
                Some(near) => format!("outputs: {near}"),
                None if own.is_empty() => {
                    "a sensor is a signal output, such as the 'reading' of a pressure_sensor".into()
                }
                None => format!("outputs: {}", own.join(", ")),
            };
            let message = format!("'{}' is no signal output of a component", **word);
            self.mistakes.note(&word.at, Diagnostic::new(message).with_help(help));
        }
        found.map(|&(_, port, unit)| (port, unit))
    }

    fn reservoir(&mut self, scope: &Scope, id: String, text: ReservoirText) {
        let (source, tank) = (self.source(scope, &text.supply), self.tank(scope, &text.r#return));
        if let (Some((supply, input)), Some(tank)) = (source, tank) {
            let volume_m3 = text.volume_m3;
            self.reservoirs.push(Reservoir { id, volume_m3, supply, input, tank });
        }
    }

    /// A pressure source that no other reservoir feeds, with the input that gives its pressure.
    fn source(&mut self, scope: &Scope, word: &At<String>) -> Option<(usize, usize)> {
        if scope.is_broken(word) {
            return None;
        }
        let driven_by = |component: usize| {
            let port = scope.parts[component].component.port("pressure")?;
            let port = PortOf { component, port };
            scope.inputs.iter().position(|input| input.targets.iter().any(|end| end.port == port))
        };
        let is_free = |source: &usize| self.reservoirs.iter().all(|taken| taken.supply != *source);
        let free: Vec<(usize, usize)> = (scope.of_kind("pressure_source").filter(is_free))
            .filter_map(|source| Some((source, driven_by(source)?)))
            .collect();
        let id = |source: &(usize, usize)| scope.parts[source.0].id.as_str();
        let found = free.iter().copied().find(|source| id(source) == **word);
        if found.is_none() {
            let help = match free.is_empty() {
                true => "an input drives a source with: to = [\"supply.pressure\"]".into(),
                false => format!("known: {}", free.iter().map(id).collect::<Vec<_>>().join(", ")),
            };
            let message = format!(
                "'{}' is no pressure source whose pressure is an input, or has a reservoir already",
                **word
            );
            self.mistakes.note(&word.at, Diagnostic::new(message).with_help(help));
        }
        found
    }

    fn tank(&mut self, scope: &Scope, word: &At<String>) -> Option<usize> {
        let id = |tank: usize| scope.parts[tank].id.as_str();
        let found = scope.of_kind("tank").find(|tank| id(*tank) == **word);
        if found.is_none() && !scope.is_broken(word) {
            self.mistakes.note(&word.at, unknown("tank", word, scope.of_kind("tank").map(id)));
        }
        found
    }
}

/// Marks a component whose parameter could not be read. A required parameter gets a placeholder, so that it is not
/// reported as missing.
fn unsound(part: &mut Part, parameter: usize) {
    part.sound = false;
    let declared = &part.component.parameters[parameter];
    let value = &mut part.parameters[parameter];
    if value.is_nan() {
        *value = declared.min;
    }
}
