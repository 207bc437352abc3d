//! Tables as lines of JSON objects, a common log format: read-only.
//!
//! A key is a column; keys of nested objects and lists are joined with dots. Missing or null values become NaN, or an
//! empty string in text columns. Blank lines are skipped.

use super::{Column, ColumnKind, ContentError, Table, TableError, Values};
use crate::files;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// The file name extensions.
pub(crate) const EXTENSIONS: [&str; 2] = ["jsonl", "ndjson"];

/// Reads a file of lines of JSON objects.
///
/// # Errors
/// If it cannot be read, a line is no object, or a column mixes incompatible values.
pub(crate) fn read(path: &Path) -> Result<Table, TableError> {
    let text = files::read_text(path)?;
    parse(&text).map_err(|problem| TableError::Content { path: path.to_path_buf(), problem })
}

/// The values of a column, with their row indices.
type Cells = Vec<(usize, Value)>;

fn parse(text: &str) -> Result<Table, ContentError> {
    let mut columns: BTreeMap<String, Cells> = BTreeMap::new();
    let mut lines = vec![];
    for (place, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let object = serde_json::from_str(line).ok().filter(Value::is_object);
        let object = object.ok_or_else(|| ContentError::line(place + 1, " is no JSON object"))?;
        let mut found = vec![];
        leaves(object, String::new(), &mut found);
        for (name, value) in found.into_iter().filter(|(_, value)| !value.is_null()) {
            columns.entry(name).or_default().push((lines.len(), value));
        }
        lines.push(place + 1);
    }
    if columns.is_empty() {
        return Err(ContentError::empty());
    }
    let column = |(name, cells): (String, Cells)| {
        let values = values(&name, &cells, &lines)?;
        Ok(Column::new(name, "", values))
    };
    let columns = columns.into_iter().map(column).collect::<Result<_, ContentError>>()?;
    let mut table = Table::from_columns(columns).expect("columns of one length, named apart");
    for (row, line) in lines.into_iter().enumerate() {
        table.origin.push_line(row, line);
    }
    Ok(table)
}

/// Collects the values in an object with their key paths.
pub fn leaves(value: Value, path: String, found: &mut Vec<(String, Value)>) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Object(map) => {
            map.into_iter().for_each(|(key, value)| leaves(value, below(&key), found));
        }
        Value::Array(list) => {
            let list = list.into_iter().zip(0_usize..);
            list.for_each(|(value, place)| leaves(value, below(&place.to_string()), found));
        }
        value => found.push((path, value)),
    }
}

/// The values of a column, with the kind of its first cell.
fn values(name: &str, cells: &Cells, lines: &[usize]) -> Result<Values, ContentError> {
    let kind = match &cells[0].1 {
        Value::Bool(_) if cells.len() == lines.len() => ColumnKind::Flag,
        Value::String(_) => ColumnKind::Text,
        _ => ColumnKind::Float,
    };
    let wrong =
        |row: usize, value: &Value| ContentError::cell(lines[row], name, &value.to_string(), kind);
    let mut values = match kind {
        ColumnKind::Flag => Values::Flag(vec![false; lines.len()]),
        ColumnKind::Text => Values::Text(vec![String::new(); lines.len()]),
        _ => Values::Float(vec![f64::NAN; lines.len()]),
    };
    for &(row, ref value) in cells {
        match (&mut values, value) {
            (Values::Flag(flags), Value::Bool(flag)) => flags[row] = *flag,
            (Values::Text(texts), Value::String(text)) => texts[row].clone_from(text),
            (Values::Float(numbers), Value::Bool(flag)) => {
                numbers[row] = f64::from(u8::from(*flag))
            }
            (Values::Float(numbers), Value::Number(number)) => {
                numbers[row] = number.as_f64().ok_or_else(|| wrong(row, value))?;
            }
            _ => return Err(wrong(row, value)),
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_rows() {
        let text = "{\"t\": \"2026-11-22T10:00\", \"p\": {\"a\": 3e5}, \"x\": [1, 2], \"on\": true}\n\n\
                    {\"t\": \"2026-11-22T10:01\", \"p\": {\"a\": null}, \"x\": [3], \"on\": false}\n";
        let table = parse(text).unwrap();
        assert_eq!(table.names().collect::<Vec<_>>(), ["on", "p.a", "t", "x.0", "x.1"]);
        assert_eq!(table.bool("on").unwrap(), [true, false]);
        assert_eq!(table.text("t").unwrap()[1], "2026-11-22T10:01");
        assert_eq!(*table.f64("x.0").unwrap(), [1.0, 3.0]);
        let missing = |name: &str| table.f64(name).unwrap()[1].is_nan();
        assert!(missing("p.a") && missing("x.1"));
        assert_eq!(table.origin().place(1), "line 3");
        let told = |text: &str| parse(text).unwrap_err().to_string();
        assert_eq!(told("{\"a\": 1}\n[2]\n"), "line 2 is no JSON object");
        let mixed = told("{\"a\": 1}\n{\"a\": \"b\"}\n");
        assert!(mixed.starts_with("line 2, column 'a': \"b\" among"), "{mixed}");
        assert!(parse("\n").is_err());
    }
}
