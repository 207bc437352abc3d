//! Reads durations, units and descriptions from the Arrow schema in a file's metadata.
//!
//! Parquet has no type for a duration. Writers with an Arrow layer store a plain whole number, and keep the unit in an
//! Arrow schema under `ARROW:schema`: a FlatBuffers message in base64. This reader extracts the names and units of the
//! durations, and `unit` and `description` from the metadata of the fields. It ignores everything else. Every access is
//! checked; a damaged schema counts as none.
//!
//! Sources: Arrow columnar format, `Message.fbs` and `Schema.fbs`; FlatBuffers internals.

use base64::prelude::{BASE64_STANDARD_NO_PAD, Engine};
use std::collections::HashMap;

/// Number of the header type `Schema` in `Message.fbs`.
const SCHEMA: u8 = 1;
/// Number of the type `Duration` in `Schema.fbs`.
const DURATION: u8 = 18;
/// Parts of a second of each `TimeUnit` in `Schema.fbs`: seconds, milliseconds, microseconds, nanoseconds.
const PARTS: [i64; 4] = [1, 1_000, 1_000_000, 1_000_000_000];
/// The unit of a duration without a unit in the schema.
const DEFAULT_UNIT: i16 = 1;

/// What a schema says of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Facts {
    /// The value of `unit` in the field's metadata.
    pub(super) unit: Option<String>,
    /// The value of `description` there.
    pub(super) description: Option<String>,
    /// For a duration, the parts of a second in which it is stored.
    pub(super) parts: Option<i64>,
}

/// The facts of every column, by name.
pub(super) fn facts(schema: &str) -> HashMap<String, Facts> {
    BASE64_STANDARD_NO_PAD
        .decode(schema.trim_end_matches('='))
        .ok()
        .and_then(|bytes| read_facts(&bytes))
        .unwrap_or_default()
}

fn read_facts(bytes: &[u8]) -> Option<HashMap<String, Facts>> {
    let mut found = HashMap::new();
    for field in fields(bytes)? {
        // A field without metadata has no vector there.
        let pairs = field.nodes(6).unwrap_or_default();
        let value = |key: &str| {
            let pair = pairs.iter().find(|pair| pair.text(0).as_deref() == Some(key));
            pair.and_then(|pair| pair.text(1))
        };
        let parts = match field.byte(2) {
            Some(DURATION) => {
                let unit = field.node(3)?.short(0).unwrap_or(DEFAULT_UNIT);
                Some(*usize::try_from(unit).ok().and_then(|unit| PARTS.get(unit))?)
            }
            _ => None,
        };
        let facts = Facts { unit: value("unit"), description: value("description"), parts };
        found.insert(field.text(0)?, facts);
    }
    Some(found)
}

/// The top-level fields of an encapsulated schema message.
fn fields(bytes: &[u8]) -> Option<Vec<Node<'_>>> {
    // An encapsulated message starts with a mark and its length; older ones with the length alone.
    let start = if read(bytes, 0)? == [0xFF; 4] { 8 } else { 4 };
    let message = Node::root(bytes.get(start..)?)?;
    if message.byte(1)? != SCHEMA {
        return None;
    }
    message.node(2)?.nodes(1)
}

/// A FlatBuffers table: a list of offsets locates its fields.
#[derive(Clone, Copy)]
struct Node<'b> {
    bytes: &'b [u8],
    place: usize,
}

impl<'b> Node<'b> {
    fn root(bytes: &'b [u8]) -> Option<Self> {
        Some(Node { bytes, place: follow(bytes, 0)? })
    }

    /// Byte position of a field; `None` if the field has its default.
    fn field(self, number: usize) -> Option<usize> {
        let back = i32::from_le_bytes(read(self.bytes, self.place)?);
        let offsets = i64::try_from(self.place).ok()?.checked_sub(i64::from(back))?;
        let offsets = usize::try_from(offsets).ok()?;
        let size = usize::from(u16::from_le_bytes(read(self.bytes, offsets)?));
        let entry = 4 + 2 * number;
        if entry + 2 > size {
            return None;
        }
        let offset = u16::from_le_bytes(read(self.bytes, offsets.checked_add(entry)?)?);
        (offset != 0).then(|| self.place + usize::from(offset))
    }

    fn byte(self, number: usize) -> Option<u8> {
        self.bytes.get(self.field(number)?).copied()
    }

    fn short(self, number: usize) -> Option<i16> {
        Some(i16::from_le_bytes(read(self.bytes, self.field(number)?)?))
    }

    fn node(self, number: usize) -> Option<Node<'b>> {
        Some(Node { bytes: self.bytes, place: follow(self.bytes, self.field(number)?)? })
    }

    fn text(self, number: usize) -> Option<String> {
        let start = follow(self.bytes, self.field(number)?)?;
        let length = usize::try_from(u32::from_le_bytes(read(self.bytes, start)?)).ok()?;
        let bytes = self.bytes.get(start + 4..)?.get(..length)?;
        String::from_utf8(bytes.to_vec()).ok()
    }

    /// The tables of a vector field.
    fn nodes(self, number: usize) -> Option<Vec<Node<'b>>> {
        let start = follow(self.bytes, self.field(number)?)?;
        let length = usize::try_from(u32::from_le_bytes(read(self.bytes, start)?)).ok()?;
        if length > self.bytes.len() / 4 {
            return None;
        }
        let node = |place: usize| {
            Some(Node { bytes: self.bytes, place: follow(self.bytes, start + 4 + 4 * place)? })
        };
        (0..length).map(node).collect()
    }
}

fn read<const N: usize>(bytes: &[u8], place: usize) -> Option<[u8; N]> {
    bytes.get(place..place.checked_add(N)?)?.try_into().ok()
}

/// The target of an offset.
fn follow(bytes: &[u8], place: usize) -> Option<usize> {
    let offset = usize::try_from(u32::from_le_bytes(read(bytes, place)?)).ok()?;
    place.checked_add(offset).filter(|target| *target < bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_schema_names_no_duration() {
        for text in ["", "AAAA", "/////wAAAAD/////", "not base64"] {
            assert!(facts(text).is_empty(), "{text}");
        }
    }
}
