//! Walks through a JSON object: nested keys and list indices are joined with points.

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;
use std::fmt;

/// A value of an object.
pub(super) enum Leaf<'l> {
    Number(f64),
    Flag(bool),
    /// Without blanks at its ends.
    Text(&'l str),
    /// JSON null: the value is missing.
    Missing,
}

/// Takes the values of an object, each with its path.
type Leaves<'l> = dyn FnMut(&str, Leaf) + 'l;

/// Passes the values of an object to `leaves`. Values before a mistake are passed, too.
pub(super) fn walk(text: &[u8], leaves: &mut Leaves) -> Result<(), serde_json::Error> {
    let mut parser = serde_json::Deserializer::from_slice(text);
    let mut path = String::new();
    Node { path: &mut path, leaves }.deserialize(&mut parser)?;
    parser.end()
}

/// Replaces `NaN`, `Infinity` and `-Infinity`, which some writers emit, by `null`; `None` if there are none.
pub(super) fn without_special_numbers(text: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(text).ok()?;
    if !text.contains("NaN") && !text.contains("Infinity") {
        return None;
    }
    let plain = text.replace("NaN", "null").replace("-Infinity", "null");
    Some(plain.replace("Infinity", "null").into_bytes())
}

/// A value within an object, with its path.
struct Node<'n> {
    path: &'n mut String,
    leaves: &'n mut Leaves<'n>,
}

impl Node<'_> {
    /// Reads a nested value under a key or list index.
    fn below<T>(&mut self, key: &str, read: impl FnOnce(Node<'_>) -> T) -> T {
        let length = self.path.len();
        if length > 0 {
            self.path.push('.');
        }
        self.path.push_str(key);
        let result = read(Node { path: &mut *self.path, leaves: &mut *self.leaves });
        self.path.truncate(length);
        result
    }
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = ();

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "JSON")
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        (self.leaves)(self.path, Leaf::Number(value));
        Ok(())
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        (self.leaves)(self.path, Leaf::Number(value as f64));
        Ok(())
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        (self.leaves)(self.path, Leaf::Number(value as f64));
        Ok(())
    }

    fn visit_bool<E>(self, value: bool) -> Result<(), E> {
        (self.leaves)(self.path, Leaf::Flag(value));
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        (self.leaves)(self.path, Leaf::Missing);
        Ok(())
    }

    fn visit_str<E>(self, text: &str) -> Result<(), E> {
        (self.leaves)(self.path, Leaf::Text(text.trim()));
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<Cow<str>>()? {
            self.below(&key, |node| map.next_value_seed(node))?;
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<(), A::Error>
    where
        A::Error: Error,
    {
        for place in 0_usize.. {
            if self.below(&place.to_string(), |node| list.next_element_seed(node))?.is_none() {
                break;
            }
        }
        Ok(())
    }
}
