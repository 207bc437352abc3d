//! Serializes numbers as their bits, so that NaN and infinities survive JSON, which cannot represent them.

/// Serializes one number, for `#[serde(with)]`.
pub(crate) mod one {
    use serde::{Deserialize, Deserializer, Serializer};

    /// Writes a number as its bits.
    pub(crate) fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u64(value.to_bits())
    }

    /// Reads a number from its bits.
    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(f64::from_bits(u64::deserialize(from)?))
    }
}

/// Serializes a list of numbers, for `#[serde(with)]`.
pub(crate) mod many {
    use serde::{Deserialize, Deserializer, Serializer};

    /// Writes numbers as their bits.
    pub(crate) fn serialize<S: Serializer>(values: &[f64], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(values.iter().map(|value| value.to_bits()))
    }

    /// Reads numbers from their bits.
    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
        let bits = Vec::<u64>::deserialize(from)?;
        Ok(bits.into_iter().map(f64::from_bits).collect())
    }
}
