//! The JSON Schemas accept what the parsers accept, and refuse slips.

use serde_json::{Value, json};
use servotwin::built_in::{STUDIES, SYSTEMS};
use servotwin::format;
use servotwin::study::{self, Study};
use servotwin::system::{self, System};
use servotwin::template::{Like, Template};

/// A validator of the keywords that the schemas use; another keyword is a mistake of the schema.
struct Validator<'s>(&'s Value);

impl Validator<'_> {
    fn accepts(&self, schema: &Value, value: &Value) -> bool {
        let Value::Object(keywords) = schema else {
            return schema.as_bool().expect("a schema is a table or a flag");
        };
        keywords.iter().all(|(word, rule)| self.keeps(keywords, word, rule, value))
    }

    fn keeps(
        &self,
        all: &serde_json::Map<String, Value>,
        word: &str,
        rule: &Value,
        value: &Value,
    ) -> bool {
        let list = || rule.as_array().expect("a list").iter();
        let number = |of: &Value| of.as_f64().expect("a number");
        let within = |limit: &dyn Fn(f64, f64) -> bool| {
            value.as_f64().is_none_or(|value| limit(value, number(rule)))
        };
        let items = value.as_array().map_or(0, Vec::len) as f64;
        match word {
            "$schema" | "$defs" | "title" | "description" | "default" | "then" | "else" => true,
            "$ref" => {
                let pointer = rule.as_str().unwrap().strip_prefix('#').expect("of this schema");
                self.accepts(self.0.pointer(pointer).expect("a definition"), value)
            }
            "type" => match rule {
                Value::String(name) => is_of(name, value),
                _ => list().any(|name| is_of(name.as_str().unwrap(), value)),
            },
            "enum" => list().any(|one| one == value),
            "const" => rule == value || (rule.is_number() && value.as_f64() == rule.as_f64()),
            "minimum" => within(&|value, limit| value >= limit),
            "maximum" => within(&|value, limit| value <= limit),
            "pattern" => value.as_str().is_none_or(|text| is_name(rule, text)),
            "minItems" => !value.is_array() || items >= number(rule),
            "maxItems" => !value.is_array() || items <= number(rule),
            "items" => value.as_array().is_none_or(|v| v.iter().all(|v| self.accepts(rule, v))),
            "allOf" => list().all(|one| self.accepts(one, value)),
            "anyOf" => list().any(|one| self.accepts(one, value)),
            "if" => {
                let branch = if self.accepts(rule, value) { "then" } else { "else" };
                all.get(branch).is_none_or(|branch| self.accepts(branch, value))
            }
            _ => value.as_object().is_none_or(|table| self.keeps_table(all, word, rule, table)),
        }
    }

    fn keeps_table(
        &self,
        all: &serde_json::Map<String, Value>,
        word: &str,
        rule: &Value,
        table: &serde_json::Map<String, Value>,
    ) -> bool {
        let rules = || rule.as_object().expect("a table");
        match word {
            "required" => {
                rule.as_array().unwrap().iter().all(|key| table.contains_key(key.as_str().unwrap()))
            }
            "minProperties" => table.len() as f64 >= rule.as_f64().unwrap(),
            "propertyNames" => table.keys().all(|key| self.accepts(rule, &json!(key))),
            "properties" => rules()
                .iter()
                .all(|(key, rule)| table.get(key).is_none_or(|value| self.accepts(rule, value))),
            "patternProperties" => rules().iter().all(|(pattern, rule)| {
                let of_pattern = table.iter().filter(|(key, _)| is_name(&json!(pattern), key));
                of_pattern.into_iter().all(|(_, value)| self.accepts(rule, value))
            }),
            "additionalProperties" => {
                let has = |word: &str, key: &str| match (word, all.get(word)) {
                    ("properties", Some(known)) => known.get(key).is_some(),
                    (_, Some(known)) => {
                        known.as_object().unwrap().keys().any(|p| is_name(&json!(p), key))
                    }
                    _ => false,
                };
                let others = table
                    .iter()
                    .filter(|(key, _)| !has("properties", key) && !has("patternProperties", key));
                others.into_iter().all(|(_, value)| self.accepts(rule, value))
            }
            _ => panic!("the keyword '{word}' is judged by nobody"),
        }
    }
}

fn is_of(name: &str, value: &Value) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        "boolean" => value.is_boolean(),
        _ => panic!("unknown type {name}"),
    }
}

/// The one pattern there is.
fn is_name(pattern: &Value, text: &str) -> bool {
    assert_eq!(pattern, "^[a-z0-9_]+$");
    let good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    !text.is_empty() && text.chars().all(good)
}

fn accepts(schema: &Value, text: &str) -> bool {
    let value: Value = toml::from_str(text).expect("TOML");
    Validator(schema).accepts(schema, &value)
}

/// The text with one thing in it replaced, which must be there.
fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "'{from}' is not there");
    text.replacen(from, to, 1)
}

#[test]
fn systems_that_are_read_keep_to_the_schema_and_slips_do_not() {
    let schema = system::schema();
    let template = Template::new("press", Like::ServoActuator).unwrap().system();
    for (name, text) in SYSTEMS.into_iter().chain([("template", template.as_str())]) {
        System::parse(text, name).unwrap_or_else(|error| panic!("{error}"));
        assert!(accepts(&schema, text), "{name}");
    }
    let slips = [
        ("format = 1", "format = 2"),
        ("name = \"press\"", "name = \"Press\""),
        ("name = \"press\"", "nam = \"press\""),
        ("kind = \"cylinder\"", "kind = \"cilinder\""),
        ("kind = \"mil_prf_83282\"", "kind = \"water\""),
        ("pressure_pa = 20e6", "pressure_bar = 200"),
        ("pressure_pa = 20e6", "pressure_pa = -20e6"),
        ("pressure_pa = 20e6", "pressure_pa = \"20e6\""),
        ("mass_kg = 5", "mass_kg = 5\nfaults.internal_leak = 1"),
        ("[\"supply.port\", \"servo_valve.p\"]", "[\"supply.port\"]"),
        ("[\"supply.port\", \"servo_valve.p\"]", "\"supply.port\""),
        ("unit = \"rad\"", "unit = \"deg\""),
        ("default = 0.0\nto", "to"),
        ("scale = 250e5", "scale = 0"),
        ("label = \"p_A\"", "lable = \"p_A\""),
        ("[sensors]", "[sensor]"),
    ];
    for (from, to) in slips {
        let wrong = changed(&template, from, to);
        assert!(System::parse(&wrong, "wrong").is_err(), "{to} is read");
        assert!(!accepts(&schema, &wrong), "{to} keeps to the schema");
    }
    let oil = "kind = \"mil_prf_83282\"";
    let point = |kelvin: f64| {
        format!("{{ temperature_k = {kelvin}, density_kg_m3 = 860, viscosity_m2_s = 40e-6 }}")
    };
    let by_points = |points: &[String]| {
        let points = points.join(", ");
        changed(&template, oil, &format!("kind = \"table\"\npoints = [{points}]"))
    };
    let table = by_points(&[point(270.0), point(350.0)]);
    System::parse(&table, "table").unwrap_or_else(|error| panic!("{error}"));
    assert!(accepts(&schema, &table), "a fluid by table");
    let without = |key: &str| point(350.0).replace(key, "");
    for wrong in
        [without(", viscosity_m2_s = 40e-6"), without("temperature_k = 350, "), point(-80.0)]
    {
        let wrong = by_points(&[point(270.0), wrong]);
        assert!(System::parse(&wrong, "wrong").is_err(), "{wrong} is read");
        assert!(!accepts(&schema, &wrong), "{wrong} keeps to the schema");
    }
    assert!(!accepts(&schema, &by_points(&[point(313.15)])), "one point");
    let aileron = SYSTEMS[0].1;
    let wrong =
        changed(aileron, "assembly = \"actuator\"", "assembly = \"actuator\"\nkind = \"mass\"");
    assert!(!accepts(&schema, &wrong), "kind and assembly");
}

#[test]
fn studies_that_are_read_keep_to_the_schema_and_slips_do_not() {
    let schema = study::schema();
    for (name, text) in STUDIES {
        Study::parse(text, name).unwrap_or_else(|error| panic!("{error}"));
        assert!(accepts(&schema, text), "{name}");
    }
    let paper = STUDIES[0].1;
    let slips = [
        ("format = 1", "format = 3"),
        ("duration_s = 90", "duration_s = 0"),
        ("duration_s = 90", "duration = 90"),
        ("sample_hz = 100", "sample_hz = \"100Hz\""),
        ("0.9, 1.0]", "0.9, 1.1]"),
        ("actuators = [\"actuator_1\", \"actuator_2\"]", "actuators = []"),
        ("quantity = \"ram\"", "quantity = \"rod\""),
        ("actuator = 1 }", "actuator = 1.5 }"),
        ("action = \"shut_down\"", "acton = \"shut_down\""),
        ("healthy = 60", "healthy = 100000000"),
        ("sigma = 0.033", "sigma = 3.3"),
        ("absolute = true", "absolute = 1"),
        ("load = [0.4, 1.1]", "load = [0.4]"),
        ("windows_s = [0.5, 2]", "windows_s = []"),
        ("switches_off = true", "switch_off = true"),
        ("takes_out = [\"x_p_1\", \"x_p_2\"]", "takes_out = \"x_p_1\""),
    ];
    for (from, to) in slips {
        let wrong = changed(paper, from, to);
        assert!(Study::parse(&wrong, "wrong").is_err(), "{to} is read");
        assert!(!accepts(&schema, &wrong), "{to} keeps to the schema");
    }
    let signal = "signals.S1 = \"noise:rms=3deg,bandwidth=0.5Hz,seed=1\"";
    let ways = [("signals.S1 = 0.1", true), ("signals.S1 = []", false)];
    for (way, right) in ways {
        let text = changed(paper, signal, way);
        assert_eq!(Study::parse(&text, "ways").is_ok(), right, "{way}");
        assert_eq!(accepts(&schema, &text), right, "{way}");
    }
}

#[test]
fn every_key_of_a_study_has_its_row() {
    let table = format::markdown(servotwin::study::keys());
    for key in ["`training.draws[].count`", "`sensors.NAME.quantity`", "`suites.NAME.repeats`"] {
        assert!(table.contains(key), "{key}:\n{table}");
    }
    let other = "for the evaluation only |\n";
    assert!(table.contains(other) && table.contains("keys as in `flights.draws[]`"), "{table}");
}
