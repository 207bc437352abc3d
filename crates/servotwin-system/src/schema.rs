//! JSON Schema (draft 2020-12) of system and study files, from the declarations. Editors use it for completion and
//! checks. Only `servotwin check` reports mistakes that need the whole file, such as open ports and unknown names.

use crate::catalogue;
use crate::format::{number, object};
use crate::signal;
use crate::study;
use crate::system::reservoir::VOLUME;
use crate::system::{FLUID, FORMAT, POINT};
use crate::units;
use serde_json::{Map, Value, json};
use servotwin_model::component::Component;
use servotwin_model::fluid::FluidKind;
use servotwin_model::spec::{Law, Parameter, Unit};

const DRAFT: &str = "https://json-schema.org/draft/2020-12/schema";
const NAME: &str = "^[a-z0-9_]+$";

/// The schema of system files.
pub fn system() -> Value {
    let mut definitions = Map::new();
    for spec in catalogue::all() {
        definitions.insert(spec.kind.into(), component(spec));
    }
    let kinds: Vec<&str> = catalogue::all().map(|spec| spec.kind).collect();
    let of_kind = |kind: &&str| {
        json!({
            "if": { "properties": { "kind": { "const": kind } }, "required": ["kind"] },
            "then": { "$ref": format!("#/$defs/{kind}") },
        })
    };
    let by_kind: Vec<Value> = kinds.iter().map(of_kind).collect();
    definitions.insert(
        "component".into(),
        json!({
            "type": "object", "required": ["kind"],
            "properties": { "kind": { "enum": kinds, "description": "kind of component" } },
            "allOf": by_kind,
        }),
    );
    definitions.insert(
        "instance".into(),
        json!({
            "type": "object", "required": ["assembly"],
            "properties": {
                "assembly": { "type": "string", "description": "the assembly of which this is an instance" },
                "fluid": { "type": "string", "description": "fluid of all its sources and tanks" },
                "kind": false,
            },
            "patternProperties": { NAME: { "type": ["object", "string"] } },
            "additionalProperties": false,
        }),
    );
    definitions.insert("connections".into(), connections());
    definitions.insert("inputs".into(), inputs());
    definitions.insert("assembly".into(), assembly());
    json!({
        "$schema": DRAFT,
        "title": "servotwin system file",
        "type": "object",
        "required": ["format", "name"],
        "properties": {
            "format": { "const": FORMAT },
            "name": { "type": "string", "pattern": NAME },
            "title": { "type": "string", "description": "title of the system, one line" },
            "fluids": named(fluid()),
            "assemblies": named(json!({ "$ref": "#/$defs/assembly" })),
            "components": named(json!({
                "if": { "type": "object", "required": ["assembly"] },
                "then": { "$ref": "#/$defs/instance" },
                "else": { "$ref": "#/$defs/component" },
            })),
            "system": {
                "type": "object",
                "properties": { "connections": { "$ref": "#/$defs/connections" } },
                "additionalProperties": false,
            },
            "inputs": { "$ref": "#/$defs/inputs" },
            "sensors": named(sensor()),
            "reservoirs": named(reservoir()),
        },
        "additionalProperties": false,
        "$defs": definitions,
    })
}

/// The schema of study files.
pub fn study() -> Value {
    let mut schema = object(study::keys());
    schema["$schema"] = json!(DRAFT);
    schema["title"] = json!("servotwin study file");
    schema["$defs"] = json!({ "signal": signals() });
    schema
}

fn reservoir() -> Value {
    let component = |description| json!({ "type": "string", "description": description });
    json!({
        "type": "object", "required": ["volume_m3", "supply", "return"],
        "properties": {
            "volume_m3": parameter(&VOLUME),
            "supply": component("pressure source that it feeds, whose pressure is an input"),
            "return": component("tank that leads the fluid back"),
        },
        "additionalProperties": false,
    })
}

/// A table of freely named entries.
fn named(entry: Value) -> Value {
    json!({
        "type": "object",
        "propertyNames": { "pattern": NAME },
        "additionalProperties": entry,
    })
}

fn parameter(declared: &Parameter) -> Value {
    let mut schema = number(declared.min, declared.max);
    let unit = declared.unit.symbol();
    let comma = if unit.is_empty() { "" } else { ", " };
    schema["description"] = json!(format!("{}{comma}{unit}", declared.summary));
    if let Some(default) = declared.default {
        schema["default"] = json!(default);
    }
    schema
}

fn component(spec: &Component) -> Value {
    let mut properties = Map::new();
    properties.insert("kind".into(), json!({ "const": spec.kind }));
    for declared in spec.parameters {
        properties.insert(declared.name.into(), parameter(declared));
    }
    let mut faults = Map::new();
    for fault in spec.faults {
        let mut schema = number(fault.full_min, fault.full_max);
        let what = match fault.law {
            Law::Add => "added at intensity 1",
            Law::Scale | Law::Geometric => "times the parameter at intensity 1",
        };
        schema["description"] = json!(format!("{}: {} {what}", fault.summary, fault.parameter));
        schema["default"] = json!(fault.full);
        faults.insert(fault.name.into(), schema);
    }
    properties.insert(
        "faults".into(),
        json!({ "type": "object", "properties": faults, "additionalProperties": false }),
    );
    if spec.reference {
        let description = "one of [fluids]; may be omitted if there is only one";
        properties.insert("fluid".into(), json!({ "type": "string", "description": description }));
    }
    // None is required, because an assembly may leave an obligatory parameter to its instances.
    json!({
        "type": "object", "description": spec.summary, "properties": properties,
        "additionalProperties": false,
    })
}

fn fluid() -> Value {
    let kinds: Vec<&str> = FluidKind::ALL.iter().map(|kind| kind.name()).collect();
    let mut properties = Map::new();
    properties.insert("kind".into(), json!({ "enum": kinds, "description": "kind of fluid" }));
    for declared in &FLUID {
        properties.insert(declared.name.into(), parameter(declared));
    }
    properties.insert("points".into(), points());
    json!({
        "type": "object", "required": ["kind"], "properties": properties,
        "additionalProperties": false,
    })
}

/// The points of a fluid of kind `table`.
fn points() -> Value {
    let properties: Map<String, Value> =
        POINT.iter().map(|declared| (declared.name.into(), parameter(declared))).collect();
    json!({
        "type": "array", "minItems": 2,
        "description": "numbers of a fluid of kind table at several temperatures, from cold to hot",
        "items": {
            "type": "object", "properties": properties, "additionalProperties": false,
            "required": ["temperature_k", "density_kg_m3", "viscosity_m2_s"],
        },
    })
}

fn assembly() -> Value {
    json!({
        "type": "object",
        "properties": {
            "components": named(json!({ "$ref": "#/$defs/component" })),
            "connections": { "$ref": "#/$defs/connections" },
            "inputs": { "$ref": "#/$defs/inputs" },
        },
        "additionalProperties": false,
    })
}

fn connections() -> Value {
    json!({
        "type": "array",
        "description": "each list joins ports (component.port) to one node",
        "items": { "type": "array", "items": { "type": "string" }, "minItems": 2 },
    })
}

fn inputs() -> Value {
    let mut words: Vec<String> = Unit::ALL.iter().map(|&unit| units::word(unit).into()).collect();
    let plain: Vec<String> = words.iter().map(|word| units::plain(word)).collect();
    words.extend(plain.into_iter().filter(|word| !word.is_ascii() || word.contains(['2', '3'])));
    words.sort();
    words.dedup();
    named(json!({
        "type": "object",
        "required": ["unit", "default"],
        "properties": {
            "unit": { "enum": words, "description": "the SI symbol; 1 for a pure number" },
            "default": { "type": "number", "description": "where a run gives no signal" },
            "to": {
                "type": "array", "items": { "type": "string" },
                "description": "the signal inputs (component.port) that it feeds",
            },
        },
        "additionalProperties": false,
    }))
}

fn sensor() -> Value {
    json!({
        "type": "object",
        "required": ["signal", "scale"],
        "properties": {
            "signal": { "type": "string", "description": "a signal output: component.port" },
            "scale": {
                "type": "number", "minimum": 1e-9, "maximum": 1e12,
                "description": "what residuals are divided by, in the signal's unit",
            },
            "label": { "type": "string", "description": "in figures" },
        },
        "additionalProperties": false,
    })
}

/// A signal: a text, a number, a table with its kind, or a list of them.
fn signals() -> Value {
    let tables = signal::ALL.iter().map(|kind| {
        let spec = kind.spec();
        let mut properties = Map::new();
        properties.insert("kind".into(), json!({ "const": spec.kind }));
        let mut required = vec!["kind"];
        for declared in spec.parameters {
            let mut schema = match declared.sort {
                signal::Sort::Choice(words) => json!({ "enum": words }),
                signal::Sort::Text => json!({ "type": "string" }),
                _ => json!({ "type": ["number", "string"] }),
            };
            schema["description"] = json!(declared.summary);
            properties.insert(declared.name.into(), schema);
            if declared.fallback == signal::Fallback::Required {
                required.push(declared.name);
            }
        }
        json!({
            "type": "object", "description": spec.summary, "properties": properties,
            "required": required, "additionalProperties": false,
        })
    });
    let one: Vec<Value> = [json!({ "type": "string" }), json!({ "type": "number" })]
        .into_iter()
        .chain(tables)
        .chain([json!({
            "type": "array", "minItems": 1, "items": { "$ref": "#/$defs/signal" },
        })])
        .collect();
    json!({ "anyOf": one, "description": "what an input does over time, such as step:size=10deg" })
}
