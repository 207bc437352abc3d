//! Places inside JSON that tests damage; tests of other crates include this file.

/// Where something stands in a value, as JSON pointers; of long lists the first two.
pub fn places(value: &serde_json::Value) -> Vec<String> {
    use serde_json::Value;
    let mut found = vec![];
    let inner: Vec<(String, &Value)> = match value {
        Value::Object(map) => map.iter().map(|(key, value)| (key.clone(), value)).collect(),
        Value::Array(list) => {
            list.iter().take(2).enumerate().map(|(k, value)| (k.to_string(), value)).collect()
        }
        _ => vec![],
    };
    for (key, value) in inner {
        found.push(format!("/{key}"));
        found.extend(places(value).into_iter().map(|rest| format!("/{key}{rest}")));
    }
    found
}
