//! Decodes the values of a channel: from the bits of a record to a number.

use super::super::groups::bytes;
use super::blocks::{Channel, ChannelGroup, Mdf};

/// How to extract a number from a record.
pub(super) struct Decoder {
    shape: Shape,
    /// Whether the most significant byte comes first.
    is_big: bool,
    byte_offset: usize,
    bit_offset: u32,
    bits: u32,
    /// Byte and mask of the invalidation bit.
    invalid: Option<(usize, u8)>,
    is_invalid: bool,
    conversion: Conversion,
}

#[derive(Clone, Copy, PartialEq)]
enum Shape {
    Unsigned,
    Signed,
    Float,
    /// The index of the record, from 0.
    Number,
}

enum Conversion {
    None,
    /// Offset and factor.
    Linear(f64, f64),
    Rational([f64; 6]),
    /// Keys and values, and whether values lie on lines between keys; otherwise the nearest key counts.
    Table(Vec<(f64, f64)>, bool),
}

impl Decoder {
    /// # Errors
    /// The channel or its conversion has an unsupported type.
    pub(super) fn new(
        file: &mut Mdf,
        group: &ChannelGroup,
        channel: &Channel,
    ) -> Result<Self, String> {
        let shape = match (channel.kind, channel.data_type) {
            _ if channel.is_composed => return Err("an array or a structure".into()),
            (3 | 6, _) => Shape::Number,
            (0 | 2, 0 | 1) => Shape::Unsigned,
            (0 | 2, 2 | 3) => Shape::Signed,
            (0 | 2, 4 | 5) => Shape::Float,
            (0 | 2, 6..=9) => return Err("text".into()),
            (0 | 2, kind) => {
                return Err(format!("values of the MDF type {kind}, which is no number"));
            }
            (kind, _) => {
                return Err(format!(
                    "a channel of the MDF kind {kind}; values of fixed length are read"
                ));
            }
        };
        let (bits, bit_offset) = (channel.bits, u32::from(channel.bit_offset));
        let needed = (u64::from(bits) + u64::from(bit_offset)).div_ceil(8);
        let is_sound = match shape {
            Shape::Number => true,
            Shape::Float => matches!(bits, 16 | 32 | 64) && bit_offset == 0,
            _ => (1..=64).contains(&bits) && bit_offset < 8,
        };
        let is_within = u64::from(channel.byte_offset) + needed <= group.data_bytes;
        if !is_sound || (shape != Shape::Number && !is_within) {
            return Err(format!(
                "{bits} bits from bit {bit_offset} of byte {}",
                channel.byte_offset
            ));
        }
        let at = group.data_bytes as usize + channel.invalidation_bit as usize / 8;
        let mask = 1_u8 << (channel.invalidation_bit % 8);
        Ok(Decoder {
            shape,
            is_big: channel.data_type % 2 == 1,
            byte_offset: channel.byte_offset as usize,
            bit_offset,
            bits,
            is_invalid: channel.flags & 1 != 0,
            invalid: (channel.flags & 2 != 0).then_some((at, mask)),
            conversion: Conversion::read(file, channel.conversion)?,
        })
    }

    /// The value in a record with this index; NaN where it is invalid.
    pub(super) fn value(&self, record: &[u8], number: u64) -> f64 {
        let is_marked =
            |(at, mask): (usize, u8)| record.get(at).is_none_or(|byte| byte & mask != 0);
        if self.is_invalid || self.invalid.is_some_and(is_marked) {
            return f64::NAN;
        }
        let raw = self.raw(record, number).unwrap_or(f64::NAN);
        self.conversion.apply(raw)
    }

    fn raw(&self, record: &[u8], number: u64) -> Option<f64> {
        if self.shape == Shape::Number {
            return Some(number as f64);
        }
        let length = (self.bits + self.bit_offset).div_ceil(8) as usize;
        let found = record.get(self.byte_offset..self.byte_offset + length)?;
        let join = |all: u128, &byte: &u8| all << 8 | u128::from(byte);
        let all = match self.is_big {
            true => found.iter().fold(0, join),
            false => found.iter().rev().fold(0, join),
        };
        let unused = 64 - self.bits;
        let bits = ((all >> self.bit_offset) as u64) << unused >> unused;
        Some(match self.shape {
            Shape::Signed => ((bits << unused) as i64 >> unused) as f64,
            Shape::Float if self.bits == 64 => f64::from_bits(bits),
            Shape::Float if self.bits == 32 => f64::from(f32::from_bits(bits as u32)),
            Shape::Float => half::f16::from_bits(bits as u16).to_f64(),
            _ => bits as f64,
        })
    }
}

impl Conversion {
    fn read(file: &mut Mdf, at: u64) -> Result<Self, String> {
        if at == 0 {
            return Ok(Conversion::None);
        }
        let block = file.block(at, b"##CC")?;
        let kind = block.data.first().copied().unwrap_or(u8::MAX);
        // The conversion's parameters follow its type, counts and physical range.
        let numbers = block.data.get(24..).unwrap_or_default().chunks_exact(8);
        let numbers: Vec<f64> =
            numbers.filter_map(|n| bytes(n, 0).map(f64::from_le_bytes)).collect();
        match (kind, &numbers[..]) {
            // A value-to-text conversion is ignored: the raw number is used.
            (0 | 7 | 8, _) => Ok(Conversion::None),
            (1, &[offset, factor, ..]) => Ok(Conversion::Linear(offset, factor)),
            (2, &[a, b, c, d, e, f, ..]) => Ok(Conversion::Rational([a, b, c, d, e, f])),
            (4 | 5, numbers) if numbers.len() >= 2 => {
                let pairs: Vec<(f64, f64)> =
                    numbers.chunks_exact(2).map(|n| (n[0], n[1])).collect();
                match pairs.is_sorted_by(|a, b| a.0 < b.0) {
                    true => Ok(Conversion::Table(pairs, kind == 4)),
                    false => Err("a table whose keys do not rise".into()),
                }
            }
            (3, _) => Err("a formula as conversion; export the values converted".into()),
            _ => Err(format!("the MDF conversion {kind}; export the values converted")),
        }
    }

    fn apply(&self, raw: f64) -> f64 {
        match self {
            Conversion::None => raw,
            Conversion::Linear(offset, factor) => raw * factor + offset,
            Conversion::Rational([a, b, c, d, e, f]) => {
                (a * raw * raw + b * raw + c) / (d * raw * raw + e * raw + f)
            }
            Conversion::Table(pairs, is_line) => looked_up(pairs, raw, *is_line),
        }
    }
}

/// Looks up a value in a table; outside the keys, the nearest end applies.
fn looked_up(pairs: &[(f64, f64)], raw: f64, is_line: bool) -> f64 {
    let above = pairs.partition_point(|(key, _)| *key < raw);
    let (Some(&high), true) = (pairs.get(above), above > 0) else {
        return match (raw.is_nan(), above) {
            (true, _) => f64::NAN,
            (false, 0) => pairs[0].1,
            (false, _) => pairs[pairs.len() - 1].1,
        };
    };
    let low = pairs[above - 1];
    match is_line {
        true => low.1 + (high.1 - low.1) * (raw - low.0) / (high.0 - low.0),
        // Halfway between two keys, the lower one applies.
        false if raw - low.0 > high.0 - raw => high.1,
        false => low.1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_lines_or_steps_and_end_at_their_ends() {
        let pairs = [(0.0, 10.0), (2.0, 20.0), (4.0, 0.0)];
        let line = |raw| looked_up(&pairs, raw, true);
        assert_eq!([-1.0, 0.0, 1.0, 2.0, 3.0, 9.0].map(line), [10.0, 10.0, 15.0, 20.0, 10.0, 0.0]);
        let step = |raw| looked_up(&pairs, raw, false);
        assert_eq!([0.9, 1.0, 1.1, 2.0].map(step), [10.0, 10.0, 20.0, 20.0]);
        assert!(line(f64::NAN).is_nan());
    }

    #[test]
    fn bits_are_taken_in_both_orders_and_with_their_sign() {
        let value = |(shape, is_big), byte_offset, bit_offset, bits, record: &[u8]| {
            let decoder = Decoder {
                shape,
                is_big,
                byte_offset,
                bit_offset,
                bits,
                invalid: None,
                is_invalid: false,
                conversion: Conversion::None,
            };
            decoder.value(record, 0)
        };
        let (little, big) = ((Shape::Signed, false), (Shape::Signed, true));
        assert_eq!(value(little, 1, 4, 12, &[0, 0xF0, 0xFF]), -1.0);
        assert_eq!(value((Shape::Unsigned, false), 0, 4, 12, &[0x50, 0x21]), 533.0);
        assert_eq!(value(big, 0, 0, 16, &[0xFF, 0xFE]), -2.0);
        let all = [0xFF; 9];
        assert_eq!(value((Shape::Unsigned, false), 0, 7, 64, &all), u64::MAX as f64);
        assert_eq!(value((Shape::Float, true), 0, 0, 32, &1.5_f32.to_be_bytes()), 1.5);
        assert!(value(little, 1, 0, 16, &[0, 0]).is_nan());
    }
}
