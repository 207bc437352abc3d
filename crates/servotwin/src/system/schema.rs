//! What of the JSON Schema of a system file depends on the catalog: the keys of components and of fluids.

use super::read::Text;
use crate::format::{self, ID, number};
use serde_json::{Map, Value, json};
use servotwin_model::component::Component;
use servotwin_model::components::ALL;
use servotwin_model::spec::{Law, Parameter};

/// The JSON Schema (draft 2020-12) of system files. Editors use it for completion and checks; only `servotwin check`
/// reports mistakes that need the whole file, such as open ports and unknown names.
pub fn of_file() -> Value {
    let specs = || ALL.iter().copied();
    let mut definitions: Map<String, Value> =
        specs().map(|spec| (spec.kind.into(), of_kind(spec))).collect();
    let by_kind = specs().map(|spec| {
        json!({
            "if": { "properties": { "kind": { "const": spec.kind } }, "required": ["kind"] },
            "then": { "$ref": format!("#/$defs/{}", spec.kind) },
        })
    });
    let by_kind: Vec<Value> = by_kind.collect();
    let kinds: Vec<&str> = specs().map(|spec| spec.kind).collect();
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
            "patternProperties": { ID: { "type": ["object", "string"] } },
            "additionalProperties": false,
        }),
    );
    format::schema("servotwin system file", Text::KEYS, definitions)
}

/// A component of the catalog.
pub(super) fn component() -> Value {
    json!({ "$ref": "#/$defs/component" })
}

/// A component of the catalog, or an instance of an assembly.
pub(super) fn component_or_instance() -> Value {
    json!({
        "if": { "type": "object", "required": ["assembly"] },
        "then": { "$ref": "#/$defs/instance" },
        "else": component(),
    })
}

fn of_kind(spec: &Component) -> Value {
    let mut properties = parameters(spec.parameters);
    properties.insert("kind".into(), json!({ "const": spec.kind }));
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

fn parameters(all: &[Parameter]) -> Map<String, Value> {
    let schema = |declared: &Parameter| {
        let mut schema = number(declared.min, declared.max);
        let unit = declared.unit.symbol();
        let comma = if unit.is_empty() { "" } else { ", " };
        schema["description"] = json!(format!("{}{comma}{unit}", declared.summary));
        if let Some(default) = declared.default {
            schema["default"] = json!(default);
        }
        (declared.name.into(), schema)
    };
    all.iter().map(schema).collect()
}
