//! The meaning of a Parquet column's values, and the column kind that holds them.

use ::parquet::basic::{ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical};
use ::parquet::schema::types::{BasicTypeInfo, Type};

use super::super::{ColumnKind, ContentError};
use super::arrow::Facts;

/// The meaning of a column's values, in addition to their stored type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Meaning {
    /// The stored value itself.
    Stored,
    Signed,
    Unsigned,
    Text,
    /// A 16-bit float.
    Half,
    /// A time in `parts` of a second: a timestamp since 1970, a time of day since midnight, or a duration.
    Time {
        parts: i64,
    },
    /// Days since the start of 1970.
    Date,
    /// A timestamp of older writers: a day number and its nanoseconds in 96 bits.
    OldMoment,
    /// An unsupported type, such as a list.
    Other,
}

impl Meaning {
    /// The column's unit if the file names none.
    pub(super) fn unit(self) -> &'static str {
        match self {
            Meaning::Time { .. } | Meaning::Date | Meaning::OldMoment => "s",
            _ => "",
        }
    }

    /// Whether the values are seconds.
    pub(super) fn is_time(self) -> bool {
        !self.unit().is_empty()
    }
}

/// Parts of a second in a time unit.
fn parts_of(unit: TimeUnit) -> i64 {
    match unit {
        TimeUnit::MILLIS => 1_000,
        TimeUnit::MICROS => 1_000_000,
        TimeUnit::NANOS => 1_000_000_000,
    }
}

fn meaning_of(info: &BasicTypeInfo) -> Meaning {
    use ConvertedType as Old;
    use LogicalType as New;
    match (info.logical_type_ref(), info.converted_type()) {
        (Some(New::Integer(integer)), _) if integer.is_signed => Meaning::Signed,
        (Some(New::Integer(_)), _) => Meaning::Unsigned,
        (Some(New::String | New::Enum | New::Json), _) => Meaning::Text,
        (Some(New::Float16), _) => Meaning::Half,
        (Some(New::Timestamp(moment)), _) => Meaning::Time { parts: parts_of(moment.unit) },
        (Some(New::Time(time)), _) => Meaning::Time { parts: parts_of(time.unit) },
        (Some(New::Date), _) => Meaning::Date,
        (Some(_), _) => Meaning::Other,
        (None, Old::NONE) => Meaning::Stored,
        (None, Old::INT_8 | Old::INT_16 | Old::INT_32 | Old::INT_64) => Meaning::Signed,
        (None, Old::UINT_8 | Old::UINT_16 | Old::UINT_32 | Old::UINT_64) => Meaning::Unsigned,
        (None, Old::UTF8 | Old::ENUM | Old::JSON) => Meaning::Text,
        (None, Old::TIMESTAMP_MILLIS | Old::TIME_MILLIS) => Meaning::Time { parts: 1_000 },
        (None, Old::TIMESTAMP_MICROS | Old::TIME_MICROS) => Meaning::Time { parts: 1_000_000 },
        (None, Old::DATE) => Meaning::Date,
        (None, _) => Meaning::Other,
    }
}

/// The column kind and meaning of a field's values; `facts` are those of the Arrow schema.
pub(super) fn kind_of(
    field: &Type,
    facts: Option<&Facts>,
) -> Result<(ColumnKind, Meaning), ContentError> {
    let unsupported = || {
        let (column, found) = (field.name(), type_name(field));
        ContentError::Unusable(format!(
            "column '{column}' has the type {found}; known are whole and real numbers, booleans, text, dictionaries of \
             these, moments, dates, times of day and durations"
        ))
    };
    let info = field.get_basic_info();
    if !field.is_primitive() || info.repetition() == Repetition::REPEATED {
        return Err(unsupported());
    }
    let physical = field.get_physical_type();
    let meaning = match (physical, meaning_of(info), facts.and_then(|facts| facts.parts)) {
        (Physical::INT64, Meaning::Stored, Some(parts)) => Meaning::Time { parts },
        (Physical::INT96, Meaning::Stored, _) => Meaning::OldMoment,
        (_, meaning, _) => meaning,
    };
    let kind = match (physical, meaning) {
        (Physical::BOOLEAN, Meaning::Stored) => ColumnKind::Flag,
        (Physical::INT32 | Physical::INT64, Meaning::Stored | Meaning::Signed) => {
            ColumnKind::Integer
        }
        (Physical::INT32, Meaning::Unsigned) => ColumnKind::Unsigned,
        (Physical::INT64, Meaning::Unsigned) => ColumnKind::Integer,
        (Physical::INT32 | Physical::INT64, meaning) if meaning.is_time() => ColumnKind::Float,
        (Physical::INT96, Meaning::OldMoment) => ColumnKind::Float,
        (Physical::FLOAT | Physical::DOUBLE, Meaning::Stored) => ColumnKind::Float,
        (Physical::FIXED_LEN_BYTE_ARRAY, Meaning::Half) => ColumnKind::Float,
        (Physical::BYTE_ARRAY, Meaning::Text) => ColumnKind::Text,
        _ => return Err(unsupported()),
    };
    Ok((kind, meaning))
}

/// A type's name in Parquet, without its details.
fn type_name(field: &Type) -> String {
    let info = field.get_basic_info();
    let name = match (info.logical_type_ref(), info.converted_type()) {
        (Some(logical), _) => format!("{logical:?}"),
        (None, ConvertedType::NONE) if field.is_group() => "group".to_owned(),
        (None, ConvertedType::NONE) => format!("{:?}", field.get_physical_type()),
        (None, converted) => format!("{converted:?}"),
    };
    name.split('(').next().unwrap_or_default().to_owned()
}
