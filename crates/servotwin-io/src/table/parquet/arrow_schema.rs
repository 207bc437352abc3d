//! Writes the Arrow schema of a table, so that readers with an Arrow layer find the unit and the description of every
//! column in the metadata of its field.
//!
//! Parquet itself has metadata of files and of column chunks, but none of columns. Arrow's readers therefore look into
//! an Arrow schema under `ARROW:schema`: a FlatBuffers message in base64. This writer puts every table before what it
//! points to, because FlatBuffers offsets only point forward. Every entry of a table takes four bytes, which aligns all
//! of them.
//!
//! Sources: Arrow columnar format, `Message.fbs` and `Schema.fbs`; FlatBuffers internals.

use super::super::{Column, ColumnKind, Table};
use crate::text::base64;

/// Number of the format's version 5 in `Schema.fbs`.
const VERSION: i16 = 4;
/// Number of the header type `Schema` in `Message.fbs`.
const SCHEMA: u8 = 1;

/// The schema of a table as an encapsulated message in base64.
pub(super) fn encode(table: &Table) -> String {
    let mut buffer = Buffer(vec![0; 4]);
    let message = buffer.table(&[Entry::Short(VERSION), Entry::Byte(SCHEMA), Entry::Link]);
    buffer.set(0, message as u32);
    let schema = buffer.table(&[Entry::Absent, Entry::Link, Entry::Link]);
    buffer.link(message, 2, schema);
    let fields = buffer.vector(table.columns().len());
    buffer.link(schema, 1, fields);
    for (number, column) in table.columns().iter().enumerate() {
        let field = buffer.field(column);
        buffer.point(fields + 4 + 4 * number, field);
    }
    // Arrow's readers take the notes of the whole table from here, not from the file's own metadata.
    let notes: Vec<_> =
        table.metadata.iter().map(|(key, note)| (key.as_str(), note.as_str())).collect();
    let pairs = buffer.pairs(&notes);
    buffer.link(schema, 2, pairs);
    buffer.align(8);
    // The mark of an encapsulated message, then its length.
    let mut message = vec![0xFF; 4];
    message.extend((buffer.0.len() as u32).to_le_bytes());
    message.extend(buffer.0);
    base64(&message)
}

/// An entry of a FlatBuffers table.
enum Entry {
    /// Left at its default.
    Absent,
    Byte(u8),
    Short(i16),
    Int(i32),
    /// An offset, set when its target is written.
    Link,
}

struct Buffer(Vec<u8>);

impl Buffer {
    fn align(&mut self, to: usize) {
        self.0.resize(self.0.len().next_multiple_of(to), 0);
    }

    fn set(&mut self, place: usize, value: u32) {
        self.0[place..place + 4].copy_from_slice(&value.to_le_bytes());
    }

    /// Points from a place to a later one.
    fn point(&mut self, place: usize, target: usize) {
        self.set(place, (target - place) as u32);
    }

    /// Points from an entry of a table to a later place.
    fn link(&mut self, table: usize, entry: usize, target: usize) {
        self.point(table + 4 + 4 * entry, target);
    }

    /// Writes a table behind the list of its entries' offsets; returns its place.
    fn table(&mut self, entries: &[Entry]) -> usize {
        self.align(4);
        let offsets = self.0.len();
        let table = (offsets + 4 + 2 * entries.len()).next_multiple_of(4);
        let mut push = |value: usize| self.0.extend((value as u16).to_le_bytes());
        push(4 + 2 * entries.len());
        push(4 + 4 * entries.len());
        for (number, entry) in entries.iter().enumerate() {
            push(if matches!(entry, Entry::Absent) { 0 } else { 4 + 4 * number });
        }
        self.align(4);
        self.0.extend(((table - offsets) as u32).to_le_bytes());
        for entry in entries {
            let value = match *entry {
                Entry::Absent | Entry::Link => 0,
                Entry::Byte(value) => u32::from(value),
                Entry::Short(value) => u32::from(value.cast_unsigned()),
                Entry::Int(value) => value.cast_unsigned(),
            };
            self.0.extend(value.to_le_bytes());
        }
        table
    }

    /// Writes a vector of offsets that are still to be set; returns its place.
    fn vector(&mut self, length: usize) -> usize {
        self.align(4);
        let place = self.0.len();
        self.0.extend((length as u32).to_le_bytes());
        self.0.resize(place + 4 + 4 * length, 0);
        place
    }

    fn text(&mut self, text: &str) -> usize {
        self.align(4);
        let place = self.0.len();
        self.0.extend((text.len() as u32).to_le_bytes());
        self.0.extend(text.as_bytes());
        self.0.push(0);
        place
    }

    /// Writes a field with its name, type and metadata.
    fn field(&mut self, column: &Column) -> usize {
        // Numbers of the types in `Schema.fbs`, with their entries.
        let (number, entries) = match column.values.kind() {
            ColumnKind::Float => (3, vec![Entry::Short(2)]),
            ColumnKind::Integer => (2, vec![Entry::Int(64), Entry::Byte(1)]),
            ColumnKind::Unsigned => (2, vec![Entry::Int(32), Entry::Byte(0)]),
            ColumnKind::Flag => (6, vec![]),
            ColumnKind::Text => (5, vec![]),
        };
        let field = self.table(&[
            Entry::Link,
            Entry::Byte(0),
            Entry::Byte(number),
            Entry::Link,
            Entry::Absent,
            Entry::Link,
            Entry::Link,
        ]);
        let name = self.text(&column.name);
        self.link(field, 0, name);
        let kind = self.table(&entries);
        self.link(field, 3, kind);
        let children = self.vector(0);
        self.link(field, 5, children);
        let facts = [("unit", column.unit.as_str()), ("description", &column.description)];
        let facts: Vec<_> = facts.into_iter().filter(|(_, value)| !value.is_empty()).collect();
        let pairs = self.pairs(&facts);
        self.link(field, 6, pairs);
        field
    }

    /// Writes a vector of keys and values; returns its place.
    fn pairs(&mut self, facts: &[(&str, &str)]) -> usize {
        let pairs = self.vector(facts.len());
        for (number, &(key, value)) in facts.iter().enumerate() {
            let pair = self.table(&[Entry::Link, Entry::Link]);
            self.point(pairs + 4 + 4 * number, pair);
            let key = self.text(key);
            self.link(pair, 0, key);
            let value = self.text(value);
            self.link(pair, 1, value);
        }
        pairs
    }
}
