//! Reads TOML into a [`Scope`]: sections, components, connections, inputs and sensors. Mistakes are collected, and
//! reading continues.

mod reservoir;

use super::mistake::SystemMistake;
use super::reservoir::Reservoir;
use super::scope::{End, Input, Part, Scope};
use super::{FORMAT, Sensor};
use crate::document::{self, Collector, Entry, TextSpan, entries};
use crate::nearest::nearest;
use crate::system::imperfection::Imperfection;
use crate::units;
use servotwin_model::components::{ALL, Component, find};
use servotwin_model::fluid::table::{LEAST_STEP_K, Point, Table};
use servotwin_model::fluid::{Fluid, FluidKind, own, table};
use servotwin_model::network::PortOf;
use servotwin_model::spec::{
    Law, Parameter, PortKind, Unit, declare::parameter, declare::required,
};
use toml::de::DeTable;

/// Keys of a component that cannot be component names.
const RESERVED: [&str; 4] = ["kind", "assembly", "fluid", "faults"];

/// The numbers of a fluid, in the order of [`set_fluid`]: first those of all kinds, then those of `table` and `own`,
/// then those of `own` alone.
pub(crate) static FLUID: [Parameter; 10] = [
    parameter("air_fraction", 0.005, (0.0, 0.2), "free gas per volume of liquid"),
    parameter("polytropic_exponent", 1.4, (1.0, 1.67), "polytropic exponent of the gas"),
    parameter("wall_modulus_pa", 10e9, (1e8, 1e13), "stiffness of the walls"),
    parameter("bulk_modulus_slope", 11.0, (0.0, 20.0), "rise of the bulk modulus, Pa per pascal"),
    parameter("bulk_modulus_pa", 1.6e9, MODULUS_PA, "bulk modulus of the liquid at 40 °C"),
    parameter(
        "bulk_modulus_change",
        -8e6,
        (-2e7, 0.0),
        "change of the bulk modulus, Pa per kelvin",
    ),
    parameter("density_kg_m3", 880.0, (500.0, 2000.0), "density at 15 °C"),
    parameter("expansion", 7e-4, (0.0, 5e-3), "thermal expansion of its volume, per kelvin"),
    parameter("viscosity_40_m2_s", 46e-6, (2e-6, 1e-3), "kinematic viscosity at 40 °C"),
    parameter("viscosity_100_m2_s", 6.8e-6, (1e-6, 5e-4), "kinematic viscosity at 100 °C"),
];

/// The allowed bulk modulus, Pa.
const MODULUS_PA: (f64, f64) = (own::LEAST_BULK_MODULUS_PA, 1e10);

/// Number of entries that every fluid has.
pub(crate) const OF_ALL: usize = 3;
/// Number of entries for a table whose points give the bulk modulus.
const WITH_SLOPE: usize = 4;
/// Number of entries for a table whose points do not.
pub(crate) const WITH_MODULUS: usize = 6;

fn set_fluid(fluid: &mut Fluid, index: usize, value: f64) {
    match index {
        0 => fluid.air_fraction = value,
        1 => fluid.polytropic_exponent = value,
        2 => fluid.wall_modulus_pa = value,
        3 => fluid.own.bulk_modulus_slope = value,
        4 => fluid.own.bulk_modulus_pa = value,
        5 => fluid.own.bulk_modulus_change = value,
        6 => fluid.own.density_kg_m3 = value,
        7 => fluid.own.expansion = value,
        8 => fluid.own.viscosity_40_m2_s = value,
        _ => fluid.own.viscosity_100_m2_s = value,
    }
}

/// The numbers of a point in a fluid table; the last is optional.
pub(crate) static POINT: [Parameter; 4] = [
    required(
        "temperature_k",
        (200.0, 480.0),
        "temperature, at least one kelvin above the previous point",
    ),
    required(
        "density_kg_m3",
        (500.0, 2000.0),
        "density, no more than at the previous, colder point",
    ),
    required(
        "viscosity_m2_s",
        (1e-6, 2e-2),
        "kinematic viscosity, no more than at the previous, colder point",
    ),
    required(
        "bulk_modulus_pa",
        MODULUS_PA,
        "bulk modulus of the liquid, no more than at the previous, colder point",
    ),
];
const MODULUS: usize = 3;

/// The allowed range of a point's number, given that of the point before.
fn allowed(index: usize, before: Option<f64>) -> (f64, f64) {
    let Parameter { min, max, .. } = POINT[index];
    match before {
        None => (min, max),
        Some(before) if index == 0 => ((before + LEAST_STEP_K).min(max), max),
        Some(before) => (min, before),
    }
}

/// A named declaration, with its place and whether it is used.
pub(super) struct Named<T> {
    pub name: String,
    pub at: TextSpan,
    pub used: bool,
    pub value: T,
}

/// The target of a connection's end.
enum Resolved {
    Port(PortOf),
    Input(usize),
}

/// The parsed file, as far as it was understood.
pub(super) struct Reader {
    pub mistakes: Collector<SystemMistake>,
    pub fluids: Vec<Named<Option<Fluid>>>,
    pub assemblies: Vec<Named<Scope>>,
    pub scope: Scope,
    pub sensors: Vec<Sensor>,
    pub reservoirs: Vec<Reservoir>,
    pub name: String,
    pub title: String,
    /// Whether the file has an unknown section.
    misspelt: bool,
}

fn names<'a>(all: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    all.into_iter().map(str::to_owned).collect()
}

/// The mistake for an unknown word.
fn unknown_word(what: &'static str, word: &str, known: Vec<String>) -> SystemMistake {
    let nearest = nearest(word, known.iter().map(String::as_str)).map(str::to_owned);
    SystemMistake::UnknownWord { what, word: word.into(), nearest, known }
}

fn unknown_key(
    entry: &Entry,
    place: impl Into<String>,
    known: Vec<String>,
) -> document::TomlMistake {
    let nearest = nearest(entry.key, known.iter().map(String::as_str)).map(str::to_owned);
    document::TomlMistake::UnknownKey { key: entry.key.into(), place: place.into(), nearest, known }
}

fn get<'e, 'a>(entries: &'e [Entry<'a>], key: &str) -> Option<&'e Entry<'a>> {
    entries.iter().find(|entry| entry.key == key)
}

impl Reader {
    pub(crate) fn new() -> Self {
        Self {
            mistakes: Collector::new(),
            fluids: Vec::new(),
            assemblies: Vec::new(),
            scope: Scope::new(),
            sensors: Vec::new(),
            reservoirs: Vec::new(),
            name: String::new(),
            title: String::new(),
            misspelt: false,
        }
    }

    /// Reads a whole file.
    pub(crate) fn read(&mut self, text: &str) {
        let root = document::parse(text, &mut self.mistakes);
        // After a syntax error, the rest of the file cannot be judged.
        if !self.mistakes.is_empty() {
            return;
        }
        let root = entries(root.get_ref());
        if self.known_format(&root) {
            self.head(&root);
            self.sections(&root);
        }
    }

    fn known_format(&mut self, root: &[Entry]) -> bool {
        let Some(entry) = get(root, "format") else {
            self.missing(&(0..0), "the file", "format", format!("format = {FORMAT}"));
            return true;
        };
        match entry.number() {
            Ok(found) if found == f64::from(FORMAT) => true,
            Ok(found) => {
                let mistake = document::TomlMistake::Format { found, supported: FORMAT };
                self.mistakes.note(&entry.value_at(), mistake);
                false
            }
            Err(mistake) => {
                self.mistakes.note(&entry.value_at(), mistake);
                true
            }
        }
    }

    fn head(&mut self, root: &[Entry]) {
        let known = [
            "format",
            "name",
            "title",
            "fluids",
            "assemblies",
            "components",
            "system",
            "inputs",
            "sensors",
            "reservoirs",
        ];
        self.only(root, "the file", &known);
        // The content of a misspelled section is missing everywhere else.
        self.misspelt = root.iter().any(|entry| !known.contains(&entry.key));
        match get(root, "name") {
            Some(entry) => {
                self.name = self.text(entry).unwrap_or_default().to_owned();
                let name = self.name.clone();
                self.good_name(&name, &entry.value_at());
            }
            None => self.missing(&(0..0), "the file", "name", "name = \"my_actuator\"".into()),
        }
        self.title = get(root, "title")
            .and_then(|entry| self.text(entry))
            .map_or_else(|| self.name.clone(), str::to_owned);
    }

    fn sections(&mut self, root: &[Entry]) {
        for entry in self.members(root, "fluids") {
            self.fluid(&entry);
        }
        for entry in self.members(root, "assemblies") {
            self.assembly(&entry);
        }
        let mut scope = Scope::new();
        for entry in self.members(root, "components") {
            self.component(&mut scope, &entry);
        }
        for entry in self.members(root, "inputs") {
            self.input(&mut scope, &entry);
        }
        if let Some(system) = get(root, "system").and_then(|entry| self.table(entry)) {
            let system = entries(system);
            self.only(&system, "[system]", &["connections"]);
            self.connections(&mut scope, &system);
        }
        for entry in self.members(root, "sensors") {
            self.sensor(&scope, &entry);
        }
        for entry in self.members(root, "reservoirs") {
            self.reservoir(&scope, &entry);
        }
        scope.complete &= !self.misspelt;
        self.scope = scope;
    }

    // Plain values.

    fn text<'a>(&mut self, entry: &Entry<'a>) -> Option<&'a str> {
        let at = entry.value_at();
        entry.text().map_err(|mistake| self.mistakes.note(&at, mistake)).ok()
    }

    fn table<'a>(&mut self, entry: &Entry<'a>) -> Option<&'a DeTable<'a>> {
        // A section's value is its whole text, so the key is the better place.
        entry.table().map_err(|mistake| self.mistakes.note(&entry.at, mistake)).ok()
    }

    fn number(&mut self, entry: &Entry) -> Option<f64> {
        let at = entry.value_at();
        entry.number().map_err(|mistake| self.mistakes.note(&at, mistake)).ok()
    }

    /// Reads a number within a range.
    fn within(
        &mut self,
        entry: &Entry,
        (min, max): (f64, f64),
        unit: Unit,
        summary: &'static str,
    ) -> Option<f64> {
        let value = self.number(entry)?;
        if (min..=max).contains(&value) {
            return Some(value);
        }
        let (key, unit) = (entry.key.into(), unit.symbol());
        let mistake = document::TomlMistake::OutOfRange { key, value, min, max, unit, summary };
        self.mistakes.note(&entry.value_at(), mistake);
        None
    }

    /// Reads a number within its declared range.
    fn declared(&mut self, entry: &Entry, declared: &Parameter) -> Option<f64> {
        self.within(entry, (declared.min, declared.max), declared.unit, declared.summary)
    }

    /// The entries of a section of the file, in order.
    fn members<'a>(&mut self, root: &[Entry<'a>], section: &str) -> Vec<Entry<'a>> {
        let table = get(root, section).and_then(|entry| self.table(entry));
        table.map_or_else(Vec::new, entries)
    }

    fn missing(
        &mut self,
        at: &TextSpan,
        place: impl Into<String>,
        key: &'static str,
        write: String,
    ) {
        let place = place.into();
        self.mistakes.note(at, document::TomlMistake::Missing { place, key, write });
    }

    fn only(&mut self, all: &[Entry], place: &str, known: &[&str]) {
        for entry in all.iter().filter(|entry| !known.contains(&entry.key)) {
            let known = names(known.iter().copied());
            self.mistakes.note(&entry.at, unknown_key(entry, place, known));
        }
    }

    fn good_name(&mut self, name: &str, at: &TextSpan) {
        let good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if RESERVED.contains(&name) {
            self.mistakes.note(at, SystemMistake::ReservedName { name: name.into() });
        } else if name.is_empty() || !name.chars().all(good) {
            self.mistakes.note(at, SystemMistake::BadName { name: name.into() });
        }
    }

    // Fluids.

    fn fluid(&mut self, entry: &Entry) {
        self.good_name(entry.key, &entry.at);
        let value = self.table(entry).and_then(|table| self.fluid_values(entry, &entries(table)));
        let (name, at) = (entry.key.to_owned(), entry.at.clone());
        self.fluids.push(Named { name, at, used: false, value });
    }

    fn fluid_values(&mut self, fluid: &Entry, all: &[Entry]) -> Option<Fluid> {
        let place = format!("fluid '{}'", fluid.key);
        let mut value = Fluid::default();
        let mut sound = true;
        let word = get(all, "kind").and_then(|entry| entry.text().ok());
        let points = get(all, "points").filter(|_| word == Some(table::NAME));
        let (known, further): (&[Parameter], &[&str]) = match word {
            Some(own::NAME) => (&FLUID, &["kind"]),
            Some(table::NAME) if gives_modulus(points) => {
                (&FLUID[..WITH_SLOPE], &["kind", "points"])
            }
            Some(table::NAME) => (&FLUID[..WITH_MODULUS], &["kind", "points"]),
            _ => (&FLUID[..OF_ALL], &["kind"]),
        };
        for entry in all.iter().filter(|entry| !further.contains(&entry.key)) {
            let Some(index) = known.iter().position(|p| p.name == entry.key) else {
                self.unknown_number(entry, &place, known, further);
                sound = false;
                continue;
            };
            match self.declared(entry, &FLUID[index]) {
                Some(number) => set_fluid(&mut value, index, number),
                None => sound = false,
            }
        }
        value.kind = self.liquid(fluid, get(all, "kind"))?;
        if value.kind == FluidKind::Table {
            value.table = self.points(fluid, points, &value.own)?;
        }
        if value.own.viscosity_100_m2_s >= value.own.viscosity_40_m2_s {
            self.mistakes
                .note(&fluid.at, SystemMistake::ThickensWhenWarm { fluid: fluid.key.into() });
            sound = false;
        }
        sound.then_some(value)
    }

    /// Reads the points of a fluid table.
    fn points(
        &mut self,
        fluid: &Entry,
        points: Option<&Entry>,
        own: &own::OwnLiquid,
    ) -> Option<Table> {
        let Some(entry) = points else {
            let write = "points = [{ temperature_k = 313.15, density_kg_m3 = 865, viscosity_m2_s = 46e-6 }, …]";
            self.missing(&fluid.at, format!("fluid '{}'", fluid.key), "points", write.into());
            return None;
        };
        let at = entry.value_at();
        let list = entry.list().map_err(|mistake| self.mistakes.note(&at, mistake)).ok()?;
        if list.len() < 2 {
            let mistake = document::TomlMistake::TooFew { key: entry.key.into(), least: 2 };
            self.mistakes.note(&at, mistake);
            return None;
        }
        let place = format!("a point of fluid '{}'", fluid.key);
        let own = (!gives_modulus(points)).then_some(own);
        let mut before = [None; 4];
        let points: Vec<Option<Point>> = (list.iter())
            .map(|element| {
                self.point(&Entry::element("a point", element), &place, own, &mut before)
            })
            .collect();
        Table::new(points.into_iter().collect::<Option<_>>()?)
    }

    /// Reads a point and updates `before`, the previous point's numbers. If no point gives a bulk modulus, that of
    /// `own` is used.
    fn point(
        &mut self,
        entry: &Entry,
        place: &str,
        own: Option<&own::OwnLiquid>,
        before: &mut [Option<f64>; 4],
    ) -> Option<Point> {
        let all = entries(self.table(entry)?);
        let others = all.iter().filter(|entry| POINT.iter().all(|p| p.name != entry.key));
        let meant: Vec<Option<String>> =
            others.map(|other| self.unknown_number(other, place, &POINT, &[])).collect();
        let mut values = [None; 4];
        for (index, declared) in POINT.iter().enumerate() {
            let meant = || meant.iter().flatten().any(|name| name == declared.name);
            values[index] = match (get(&all, declared.name), own) {
                (Some(number), _) => {
                    // A misplaced point is reported by its temperature alone.
                    let ordered = index == 0 || values[0].is_some();
                    let last = before[index].filter(|_| ordered);
                    before[index] = possible(number, index).or(last);
                    self.within(number, allowed(index, last), declared.unit, declared.summary)
                }
                (None, Some(own)) if index == MODULUS => {
                    values[0].and_then(|kelvin| self.modulus(entry, own.bulk_modulus_at(kelvin)))
                }
                (None, _) if meant() => None,
                (None, _) => {
                    let write = format!("{} = …", declared.name);
                    self.missing(&entry.at, place, declared.name, write);
                    None
                }
            };
        }
        let [temperature_k, density_kg_m3, viscosity_m2_s, bulk_modulus_pa] = values;
        meant.is_empty().then_some(Point {
            temperature_k: temperature_k?,
            density_kg_m3: density_kg_m3?,
            viscosity_m2_s: viscosity_m2_s?,
            bulk_modulus_pa: bulk_modulus_pa?,
        })
    }

    /// Checks a bulk modulus that a law gives for a point.
    fn modulus(&mut self, point: &Entry, pa: f64) -> Option<f64> {
        let Parameter { name, min, max, unit, .. } = POINT[MODULUS];
        if (min..=max).contains(&pa) {
            return Some(pa);
        }
        let (key, unit) = (name.into(), unit.symbol());
        let summary = "of the liquid here, by its value at 40 °C and bulk_modulus_change";
        let mistake = document::TomlMistake::OutOfRange { key, value: pa, min, max, unit, summary };
        self.mistakes.note(&point.at, mistake);
        None
    }

    fn liquid(&mut self, fluid: &Entry, kind: Option<&Entry>) -> Option<FluidKind> {
        let known = || names(FluidKind::ALL.iter().map(|kind| kind.name()));
        let Some(entry) = kind else {
            let write = format!("kind = \"{}\"", known().join("\" or \""));
            self.missing(&fluid.at, format!("fluid '{}'", fluid.key), "kind", write);
            return None;
        };
        let word = self.text(entry)?;
        let found = FluidKind::ALL.iter().copied().find(|kind| kind.name() == word);
        if found.is_none() {
            self.mistakes.note(&entry.value_at(), unknown_word("liquid", word, known()));
        }
        found
    }

    /// The index of a declared fluid.
    fn fluid_named(&mut self, entry: &Entry) -> Option<usize> {
        let word = self.text(entry)?;
        let found = self.fluids.iter().position(|fluid| fluid.name == word);
        match found {
            Some(index) => self.fluids[index].used = true,
            None => {
                let known = names(self.fluids.iter().map(|fluid| fluid.name.as_str()));
                self.mistakes.note(&entry.value_at(), unknown_word("fluid", word, known));
            }
        }
        found
    }

    // Components.

    fn assembly(&mut self, entry: &Entry) {
        self.good_name(entry.key, &entry.at);
        let mut scope = Scope::new();
        if let Some(table) = self.table(entry) {
            let all = entries(table);
            let place = format!("assembly '{}'", entry.key);
            self.only(&all, &place, &["components", "connections", "inputs"]);
            for member in self.members(&all, "components") {
                self.part(&mut scope, &member);
            }
            for member in self.members(&all, "inputs") {
                self.input(&mut scope, &member);
            }
            self.connections(&mut scope, &all);
        }
        let (name, at) = (entry.key.to_owned(), entry.at.clone());
        self.assemblies.push(Named { name, at, used: false, value: scope });
    }

    /// Reads a component of the system, or an instance of an assembly.
    fn component(&mut self, scope: &mut Scope, entry: &Entry) {
        let all = entry.table().map(entries).unwrap_or_default();
        match (get(&all, "assembly"), get(&all, "kind")) {
            (Some(assembly), None) => {
                self.good_name(entry.key, &entry.at);
                if self.instance(scope, entry.key, assembly, &all).is_none() {
                    scope.broken.push(entry.key.into());
                    scope.complete = false;
                }
            }
            (Some(_), Some(_)) => {
                self.mistakes
                    .note(&entry.at, SystemMistake::KindOrAssembly { id: entry.key.into() });
                scope.broken.push(entry.key.into());
                scope.complete = false;
            }
            (None, _) => self.part(scope, entry),
        }
    }

    fn instance(
        &mut self,
        scope: &mut Scope,
        id: &str,
        assembly: &Entry,
        all: &[Entry],
    ) -> Option<()> {
        let word = self.text(assembly)?;
        let Some(index) = self.assemblies.iter().position(|a| a.name == word) else {
            let known = names(self.assemblies.iter().map(|a| a.name.as_str()));
            self.mistakes.note(&assembly.value_at(), unknown_word("assembly", word, known));
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
                let sources = content.parts.iter_mut().filter(|part| part.spec().reference);
                sources.for_each(|part| part.fluid = Some(fluid));
            }
            return;
        }
        let Some(index) = content.part(entry.key) else {
            if !content.is_broken(entry.key) {
                let known = names(content.parts.iter().map(|part| part.id.as_str()));
                let place = format!("assembly '{assembly}'");
                self.mistakes.note(&entry.at, unknown_key(entry, place, known));
            }
            return;
        };
        let Some(table) = self.table(entry) else {
            return;
        };
        let all = entries(table);
        if let Some(kind) = get(&all, "kind") {
            self.mistakes.note(&kind.at, SystemMistake::KindOverridden { id: entry.key.into() });
        }
        self.settings(&mut content.parts[index], &all);
    }

    /// Reads a component of the catalogue.
    fn part(&mut self, scope: &mut Scope, entry: &Entry) {
        self.good_name(entry.key, &entry.at);
        match self.built(entry) {
            Some(part) => scope.add(part),
            None => {
                scope.broken.push(entry.key.into());
                scope.complete = false;
            }
        }
    }

    fn built(&mut self, entry: &Entry) -> Option<Part> {
        let all = entries(self.table(entry)?);
        let Some(kind) = get(&all, "kind") else {
            self.mistakes.note(&entry.at, SystemMistake::KindOrAssembly { id: entry.key.into() });
            return None;
        };
        let word = self.text(kind)?;
        let Some(component) = find(word) else {
            let known = names(ALL.iter().map(|component| component.spec().kind));
            let mistake = unknown_word("kind of component", word, known);
            self.mistakes.note(&kind.value_at(), mistake);
            return None;
        };
        let mut part = Part::new(entry.key.into(), entry.at.clone(), component);
        self.settings(&mut part, &all);
        Some(part)
    }

    /// Reads parameters, faults and fluid of a component.
    fn settings(&mut self, part: &mut Part, all: &[Entry]) {
        let spec = part.spec();
        for entry in all.iter().filter(|entry| entry.key != "kind") {
            match (entry.key, spec.parameter(entry.key)) {
                (_, Some(index)) => self.parameter(part, entry, index),
                ("faults", None) => self.faults(part, entry),
                ("fluid", None) if spec.reference => match self.fluid_named(entry) {
                    Some(fluid) => part.fluid = Some(fluid),
                    None => part.sound = false,
                },
                ("fluid", None) => {
                    let (id, kind) = (part.id.clone(), spec.kind);
                    self.mistakes.note(&entry.at, SystemMistake::FluidNotHere { id, kind });
                }
                _ => self.unknown_parameter(part, entry),
            }
        }
    }

    fn parameter(&mut self, part: &mut Part, entry: &Entry, index: usize) {
        let declared = &part.spec().parameters[index];
        match self.declared(entry, declared) {
            Some(value) => part.parameters[index] = value,
            None => unsound(part, index),
        }
    }

    fn faults(&mut self, part: &mut Part, entry: &Entry) {
        let spec = part.spec();
        let Some(table) = self.table(entry) else {
            return;
        };
        for fault in entries(table) {
            let Some(index) = spec.fault(fault.key) else {
                let known = names(spec.faults.iter().map(|fault| fault.name));
                let place = format!("the faults of '{}' ({})", part.id, spec.kind);
                self.mistakes.note(&fault.at, unknown_key(&fault, place, known));
                continue;
            };
            let declared = &spec.faults[index];
            let unit = match declared.law {
                Law::Add => spec.parameter(declared.parameter).map(|p| spec.parameters[p].unit),
                Law::Scale | Law::Geometric => None,
            };
            let range = (declared.full_min, declared.full_max);
            let unit = unit.unwrap_or(Unit::None);
            if let Some(full) = self.within(&fault, range, unit, declared.summary) {
                part.faults[index] = full;
            }
        }
    }

    fn unknown_parameter(&mut self, part: &mut Part, entry: &Entry) {
        let spec: &'static Component = part.spec();
        if spec.fault(entry.key).is_some() {
            let key = entry.key.into();
            self.mistakes.note(&entry.at, SystemMistake::FaultAmongParameters { key });
        } else if spec.port(entry.key).is_some() {
            let (key, id) = (entry.key.into(), part.id.clone());
            self.mistakes.note(&entry.at, SystemMistake::PortAmongParameters { key, id });
        } else {
            let extra: &[&str] = if spec.reference { &["fluid", "faults"] } else { &["faults"] };
            let place = format!("'{}' ({})", part.id, spec.kind);
            let meant = self.unknown_number(entry, &place, spec.parameters, extra);
            match meant.and_then(|name| spec.parameter(&name)) {
                Some(index) => unsound(part, index),
                None => part.sound = false,
            }
        }
    }

    /// Reports an unknown key among parameters; returns the parameter that was meant.
    fn unknown_number(
        &mut self,
        entry: &Entry,
        place: &str,
        parameters: &'static [Parameter],
        extra: &[&str],
    ) -> Option<String> {
        if let Some(slip) = units::slip(entry.key, entry.number().ok(), parameters) {
            let (right, unit) = (slip.parameter.name, slip.parameter.unit);
            let mistake =
                SystemMistake::WrongSuffix { key: entry.key.into(), right, unit, si: slip.si };
            self.mistakes.note(&entry.at, mistake);
            return Some(right.into());
        }
        let known = parameters.iter().map(|p| p.name).chain(extra.iter().copied());
        let mistake = unknown_key(entry, place, names(known));
        let meant = match &mistake {
            document::TomlMistake::UnknownKey { nearest, .. } => nearest.clone(),
            _ => None,
        };
        self.mistakes.note(&entry.at, mistake);
        meant
    }

    // Connections and signals.

    fn connections(&mut self, scope: &mut Scope, all: &[Entry]) {
        let Some(entry) = get(all, "connections") else {
            return;
        };
        let list = match entry.list() {
            Ok(list) => list,
            Err(mistake) => {
                self.mistakes.note(&entry.value_at(), mistake);
                scope.complete = false;
                return;
            }
        };
        for element in list {
            self.connection(scope, &Entry::element("a connection", element));
        }
    }

    fn connection(&mut self, scope: &mut Scope, entry: &Entry) {
        let Some((ends, inputs)) = self.ends(scope, entry) else {
            return;
        };
        let first = match inputs[..] {
            [] => {
                scope.connections.push(ends);
                return;
            }
            [first] => first,
            [first, second, ..] => {
                let id = |input: usize| scope.inputs[input].id.clone();
                let mistake = SystemMistake::TwoInputs { first: id(first), second: id(second) };
                self.mistakes.note(&entry.value_at(), mistake);
                scope.complete = false;
                return;
            }
        };
        for end in ends {
            self.feed(scope, first, end);
        }
    }

    /// Reads the ports and inputs of one connection.
    fn ends(&mut self, scope: &mut Scope, entry: &Entry) -> Option<(Vec<End>, Vec<usize>)> {
        let list = match entry.list() {
            Ok(list) => list,
            Err(mistake) => {
                self.mistakes.note(&entry.value_at(), mistake);
                scope.complete = false;
                return None;
            }
        };
        if list.len() < 2 {
            self.mistakes.note(&entry.value_at(), SystemMistake::TooFewEnds);
            scope.complete = false;
        }
        let (mut ends, mut inputs): (Vec<End>, Vec<usize>) = Default::default();
        for element in list {
            let element = Entry::element("the end of a connection", element);
            match self.resolve(scope, &element) {
                Some(Resolved::Input(input)) => inputs.push(input),
                Some(Resolved::Port(port)) if ends.iter().any(|end| end.port == port) => {
                    let end = scope.port_id(port);
                    self.mistakes.note(&element.value_at(), SystemMistake::RepeatedEnd { end });
                }
                Some(Resolved::Port(port)) => ends.push(End { port, at: element.value_at() }),
                None => scope.complete = false,
            }
        }
        Some((ends, inputs))
    }

    /// Resolves a name in a connection.
    fn resolve(&mut self, scope: &Scope, entry: &Entry) -> Option<Resolved> {
        let word = self.text(entry)?;
        if let Some(input) = scope.input(word) {
            return Some(Resolved::Input(input));
        }
        if scope.is_broken(word) {
            return None;
        }
        let at = entry.value_at();
        let ports =
            |index: usize| names(scope.parts[index].spec().ports.iter().map(|port| port.name));
        if let Some(index) = scope.part(word) {
            let mistake = SystemMistake::NoPort { id: word.into(), known: ports(index) };
            self.mistakes.note(&at, mistake);
            return None;
        }
        let (id, port) = word.rsplit_once('.').unwrap_or((word, ""));
        let Some(component) = scope.part(id) else {
            let inputs = scope.inputs.iter().map(|input| input.id.as_str());
            let known = names(scope.parts.iter().map(|part| part.id.as_str()).chain(inputs));
            self.mistakes.note(&at, unknown_word("component", id, known));
            return None;
        };
        let spec = scope.parts[component].spec();
        if let Some(port) = spec.port(port) {
            return Some(Resolved::Port(PortOf { component, port }));
        }
        let known = ports(component);
        self.mistakes.note(
            &at,
            SystemMistake::UnknownPort {
                id: id.into(),
                kind: spec.kind,
                port: port.into(),
                nearest: nearest(port, known.iter().map(String::as_str)).map(str::to_owned),
                known,
            },
        );
        None
    }

    /// Connects an input to a port.
    fn feed(&mut self, scope: &mut Scope, input: usize, end: End) {
        let id = || scope.port_id(end.port);
        let mistake = match scope.port(end.port).kind {
            PortKind::SignalIn { .. } => {
                scope.inputs[input].targets.push(end);
                return;
            }
            PortKind::SignalOut { .. } => SystemMistake::InputAndOutput {
                input: scope.inputs[input].id.clone(),
                output: id(),
            },
            kind => SystemMistake::NoSignalInput { end: id(), family: kind.family() },
        };
        self.mistakes.note(&end.at, mistake);
        scope.complete = false;
    }

    fn input(&mut self, scope: &mut Scope, entry: &Entry) {
        self.good_name(entry.key, &entry.at);
        if scope.has(entry.key) {
            self.mistakes.note(&entry.at, SystemMistake::DuplicateId { id: entry.key.into() });
        }
        let Some(table) = self.table(entry) else {
            scope.broken.push(entry.key.into());
            return;
        };
        let all = entries(table);
        let place = format!("input '{}'", entry.key);
        self.only(&all, &place, &["unit", "default", "to"]);
        let default = match get(&all, "default") {
            Some(default) => self.number(default),
            None => {
                self.missing(&entry.at, &place, "default", "default = 0.0".into());
                None
            }
        };
        let Some((unit, unit_at)) = self.unit(entry, &place, get(&all, "unit")) else {
            scope.broken.push(entry.key.into());
            scope.complete = false;
            return;
        };
        let index = scope.inputs.len();
        scope.inputs.push(Input {
            id: entry.key.into(),
            at: entry.at.clone(),
            unit,
            unit_at,
            default: default.unwrap_or(f64::NAN),
            targets: Vec::new(),
        });
        if let Some(to) = get(&all, "to") {
            self.targets(scope, index, to);
        }
    }

    fn unit(&mut self, of: &Entry, place: &str, entry: Option<&Entry>) -> Option<(Unit, TextSpan)> {
        let Some(entry) = entry else {
            let write = "unit = \"Pa\" (or \"1\" for a pure number)".to_owned();
            self.missing(&of.at, place, "unit", write);
            return None;
        };
        let word = self.text(entry)?;
        let unit = units::find_si(word);
        if unit.is_none() {
            let mistake =
                SystemMistake::UnknownUnit { word: word.into(), meant: units::meant(word) };
            self.mistakes.note(&entry.value_at(), mistake);
        }
        unit.map(|unit| (unit, entry.value_at()))
    }

    fn targets(&mut self, scope: &mut Scope, input: usize, to: &Entry) {
        let list = match to.list() {
            Ok(list) => list,
            Err(mistake) => {
                self.mistakes.note(&to.value_at(), mistake);
                scope.complete = false;
                return;
            }
        };
        for element in list {
            let element = Entry::element("to", element);
            match self.resolve(scope, &element) {
                Some(Resolved::Port(port)) => {
                    self.feed(scope, input, End { port, at: element.value_at() });
                }
                Some(Resolved::Input(other)) => {
                    let id = |input: usize| scope.inputs[input].id.clone();
                    let mistake = SystemMistake::TwoInputs { first: id(input), second: id(other) };
                    self.mistakes.note(&element.value_at(), mistake);
                    scope.complete = false;
                }
                None => scope.complete = false,
            }
        }
    }

    fn sensor(&mut self, scope: &Scope, entry: &Entry) {
        self.good_name(entry.key, &entry.at);
        let Some(table) = self.table(entry) else {
            return;
        };
        let all = entries(table);
        let place = format!("sensor '{}'", entry.key);
        self.only(&all, &place, &["signal", "scale", "label"]);
        let label = get(&all, "label").map_or(Some(entry.key), |label| self.text(label));
        let port = match get(&all, "signal") {
            Some(signal) => self.output(scope, signal),
            None => {
                let write = "signal = \"sensor_pressure.reading\"".to_owned();
                self.missing(&entry.at, &place, "signal", write);
                None
            }
        };
        let unit = port.map_or(Unit::None, |(_, unit)| unit);
        let scale = match get(&all, "scale") {
            Some(scale) => {
                self.within(scale, (1e-9, 1e12), unit, "the size that residuals are divided by")
            }
            None => {
                self.missing(&entry.at, &place, "scale", "scale = 20.684e6".to_owned());
                None
            }
        };
        let (Some(label), Some((port, unit)), Some(scale)) = (label, port, scale) else {
            return;
        };
        if let Some(at) = get(&all, "scale").map(Entry::value_at) {
            self.above_noise(&scope.parts[port.component], (entry.key, scale, unit), &at);
        }
        self.sensors.push(Sensor {
            id: entry.key.into(),
            label: label.into(),
            signal: scope.port_id(port),
            component: port.component,
            unit,
            scale,
        });
    }

    /// Checks that the scale of a sensor exceeds its noise: otherwise residuals would consist of noise.
    fn above_noise(&mut self, part: &Part, (id, scale, unit): (&str, f64, Unit), at: &TextSpan) {
        let noise = Imperfection::of_component(part.component, &part.parameters).deviation();
        if part.sound && noise > scale {
            let full_scale = (part.component.span)(&part.parameters).map(|span| span.full_scale);
            let (sensor, component) = (id.into(), part.id.clone());
            let mistake = SystemMistake::ScaleBelowNoise {
                sensor,
                component,
                scale,
                noise,
                full_scale,
                unit,
            };
            self.mistakes.note(at, mistake);
        }
    }

    /// Finds the output that a sensor names.
    fn output(&mut self, scope: &Scope, entry: &Entry) -> Option<(PortOf, Unit)> {
        let word = self.text(entry)?;
        if scope.is_broken(word) {
            return None;
        }
        let parts = scope.parts.iter().enumerate();
        let outputs: Vec<(String, PortOf, Unit)> = parts
            .flat_map(|(component, part)| {
                let ports = part.spec().ports.iter().enumerate();
                ports.filter_map(move |(port, declared)| match declared.kind {
                    PortKind::SignalOut { unit } => {
                        Some((format!("{}.{}", part.id, declared.name), component, port, unit))
                    }
                    _ => None,
                })
            })
            .map(|(id, component, port, unit)| (id, PortOf { component, port }, unit))
            .collect();
        let found = outputs.iter().find(|(id, ..)| id == word);
        if found.is_none() {
            let ids: Vec<&str> = outputs.iter().map(|(id, ..)| id.as_str()).collect();
            let component = word.rsplit_once('.').map_or(word, |(id, _)| id);
            let own: Vec<&str> = ids
                .iter()
                .copied()
                .filter(|id| id.rsplit_once('.').is_some_and(|(of, _)| of == component))
                .collect();
            let known = match (own.is_empty(), nearest(word, ids)) {
                (_, Some(near)) => names([near]),
                (false, None) => names(own),
                (true, None) => Vec::new(),
            };
            self.mistakes
                .note(&entry.value_at(), SystemMistake::NoOutput { signal: word.into(), known });
        }
        found.map(|&(_, port, unit)| (port, unit))
    }
}

/// A number of a point that is possible in itself. The next point is compared with it even if it contradicts the point
/// before, so that one mistake is reported once.
fn possible(entry: &Entry, index: usize) -> Option<f64> {
    let (min, max) = allowed(index, None);
    entry.number().ok().filter(|number| (min..=max).contains(number))
}

/// Whether any point gives a bulk modulus.
fn gives_modulus(points: Option<&Entry>) -> bool {
    let list = points.and_then(|entry| entry.list().ok()).unwrap_or_default();
    let name = POINT[MODULUS].name;
    list.iter().any(|point| {
        let point = Entry::element("a point", point);
        point.table().is_ok_and(|table| get(&entries(table), name).is_some())
    })
}

/// Marks a component whose parameter could not be read. A required parameter gets a placeholder, so that it is not
/// reported as missing.
fn unsound(part: &mut Part, parameter: usize) {
    part.sound = false;
    let declared = &part.spec().parameters[parameter];
    let value = &mut part.parameters[parameter];
    if value.is_nan() {
        *value = declared.min;
    }
}
