//! JSON: one object, with the keys of blocks and values; numbers in SI units.

use crate::document::{Block, Content, Document, Form, Line, Table, Value};
use serde_json::{Map, Value as Json, json};

/// A document as JSON, with a line feed at the end.
pub fn json(document: &Document) -> String {
    if let [Block { content: Content::Raw(text), .. }] = &document.blocks[..] {
        return text.clone();
    }
    let value = Json::Object(object(document));
    if document.form == Form::Line { format!("{value}\n") } else { format!("{value:#}\n") }
}

fn object(document: &Document) -> Map<String, Json> {
    let mut to = Map::new();
    if let Some(verdict) = &document.verdict {
        let mut own = Map::new();
        own.insert("call".into(), verdict.call.name().into());
        own.insert("sentence".into(), verdict.line.text.as_str().into());
        verdict.line.values.iter().for_each(|(key, value)| insert(&mut own, key, value));
        to.insert("document".into(), (&*document.id).into());
        to.insert("verdict".into(), own.into());
    }
    document.blocks.iter().for_each(|block| add(&mut to, block));
    to
}

fn add(to: &mut Map<String, Json>, Block { id, content, .. }: &Block) {
    let mut put = |value: Json| {
        let earlier = to.insert(id.to_string(), value);
        debug_assert!(earlier.is_none(), "the document has two blocks '{id}'");
    };
    match content {
        Content::Facts(facts) if id.is_empty() => {
            facts.iter().for_each(|(key, _, value)| insert(to, key, value));
        }
        Content::Facts(facts) => {
            let mut own = Map::new();
            facts.iter().for_each(|(key, _, value)| insert(&mut own, key, value));
            put(own.into());
        }
        Content::Text(line) if !id.is_empty() => put(sentence(line)),
        Content::Text(line) => append(to, "text", sentence(line)),
        Content::Note(line) => append(to, "notes", sentence(line)),
        Content::List(lines) => put(lines.iter().map(sentence).collect()),
        Content::Table(_) if id.is_empty() => {}
        Content::Table(table) => put(rows(table)),
        Content::Files(paths) => put(json!(paths)),
        Content::Data(data) => put(data.clone()),
        Content::Figure { caption, .. } => put(json!({ "caption": caption })),
        Content::Section(section) if id.is_empty() => {
            section.blocks.iter().for_each(|block| add(to, block));
        }
        Content::Section(section) => put(object(section).into()),
        Content::Heading(_) | Content::Raw(_) => {}
    }
}

fn append(to: &mut Map<String, Json>, key: &str, value: Json) {
    let list = to.entry(key).or_insert_with(|| json!([]));
    list.as_array_mut().expect("only sentences have this key").push(value);
}

/// A sentence, with its values if it has any.
fn sentence(line: &Line) -> Json {
    if line.values.is_empty() {
        return line.text.as_str().into();
    }
    let mut own = Map::new();
    own.insert("sentence".into(), line.text.as_str().into());
    line.values.iter().for_each(|(key, value)| insert(&mut own, key, value));
    own.into()
}

fn insert(to: &mut Map<String, Json>, key: &str, value: &Value) {
    let earlier = to.insert(with_suffix(key, value.suffix), value.json.clone());
    debug_assert!(earlier.is_none(), "the document has two values '{key}'");
}

fn with_suffix(key: &str, suffix: &str) -> String {
    if key.ends_with(suffix) { key.into() } else { format!("{key}{suffix}") }
}

/// The rows of a table as objects of the same keys.
fn rows(table: &Table) -> Json {
    let keys = table.columns.iter().enumerate().filter(|(_, column)| !column.id.is_empty());
    let suffix = |place: usize| {
        let mut suffixes = table.rows.iter().map(|(row, _)| row[place].suffix);
        suffixes.find(|suffix| !suffix.is_empty()).unwrap_or_default()
    };
    let keys: Vec<(usize, String)> =
        keys.map(|(place, column)| (place, with_suffix(&column.id, suffix(place)))).collect();
    let object = |(row, _): &(Vec<Value>, bool)| -> Json {
        let own = keys.iter().map(|(place, key)| (key.clone(), row[*place].json.clone()));
        own.collect::<Map<_, _>>().into()
    };
    table.rows.iter().map(object).collect()
}
