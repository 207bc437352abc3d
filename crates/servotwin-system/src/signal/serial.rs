//! Signals in study files.
//!
//! A signal is a text (`"step:size=10deg"`), a plain number (a constant, SI) or a table
//! (`{ kind = "step", size = "10deg", at = 0.1 }`). A list of these is their sum. A signal is serialized as a table or
//! a list of tables.

use super::text::Builder;
use super::{Argument, Signal, SignalError, Term};
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::ser::{SerializeMap, SerializeSeq};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

impl Serialize for Signal {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if let [term] = self.terms.as_slice() {
            return term.serialize(serializer);
        }
        let mut list = serializer.serialize_seq(Some(self.terms.len()))?;
        self.terms.iter().try_for_each(|term| list.serialize_element(term))?;
        list.end()
    }
}

impl Serialize for Term {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_map(None)?;
        table.serialize_entry("kind", self.kind.spec().kind)?;
        for (name, argument) in self.arguments() {
            match argument {
                Argument::Quantity(quantity) if quantity.unit.is_none() => {
                    table.serialize_entry(name, &quantity.number)?;
                }
                _ => table.serialize_entry(name, &argument.to_string())?,
            }
        }
        table.end()
    }
}

impl<'de> Deserialize<'de> for Signal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SignalVisitor)
    }
}

struct SignalVisitor;

impl<'de> Visitor<'de> for SignalVisitor {
    type Value = Signal;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "a signal: a text, a number, a table with 'kind', or a list of them")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Signal, E> {
        text.parse().map_err(E::custom)
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Signal, E> {
        self.visit_str(&number.to_string())
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Signal, E> {
        self.visit_str(&number.to_string())
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Signal, E> {
        self.visit_str(&number.to_string())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Signal, A::Error> {
        let mut entries: Vec<(String, Plain)> = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        let kind = entries.iter().position(|(name, _)| name == "kind");
        let kind = kind.ok_or_else(|| A::Error::custom(SignalError::NoKind))?;
        let (_, Plain(kind)) = entries.remove(kind);
        let mut builder = Builder::new(&kind).map_err(A::Error::custom)?;
        for (name, Plain(text)) in entries {
            builder.set(&name, &text).map_err(A::Error::custom)?;
        }
        Ok(Signal { terms: vec![builder.finish().map_err(A::Error::custom)?] })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Signal, A::Error> {
        let mut terms = Vec::new();
        while let Some(signal) = list.next_element::<Signal>()? {
            terms.extend(signal.terms);
        }
        if terms.is_empty() {
            return Err(A::Error::custom(SignalError::Empty));
        }
        Ok(Signal { terms })
    }
}

/// A text or a number, stored as text (Rust writes and reads `f64` without loss).
struct Plain(String);

impl<'de> Deserialize<'de> for Plain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PlainVisitor)
    }
}

struct PlainVisitor;

impl Visitor<'_> for PlainVisitor {
    type Value = Plain;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "a number or a text such as \"10deg\"")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Plain, E> {
        Ok(Plain(text.into()))
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Plain, E> {
        Ok(Plain(number.to_string()))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Plain, E> {
        Ok(Plain(number.to_string()))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Plain, E> {
        Ok(Plain(number.to_string()))
    }
}
