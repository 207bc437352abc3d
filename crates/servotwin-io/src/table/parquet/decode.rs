//! Converts the stored values of a Parquet column to the values of a table's column.

use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{ByteArray, DataType, FixedLenByteArray, Int96};
use ::parquet::errors::ParquetError;
use half::f16;

use super::super::{ColumnKind, ContentError, Values};
use super::limits::{Budget, text_bytes};
use super::meaning::Meaning;

/// Seconds in a day.
const DAY_S: i64 = 86_400;

/// 1 January 1970 as a Julian day number.
const JULIAN_1970: i64 = 2_440_588;

/// The origin of a table's column.
#[derive(Debug, Clone)]
pub(super) struct ColumnSource {
    /// The name in the table.
    pub name: String,
    /// Index of the column in the file.
    pub place: usize,
    /// Kind of the table's column. Whole numbers and flags with gaps become floats.
    pub kind: ColumnKind,
    /// Meaning of the stored type.
    pub meaning: Meaning,
    /// Number of texts decoded at once: one encoding makes long texts of a few bytes.
    pub texts_at_once: usize,
}

/// Reads the next rows of a column; `first_row` counts from 0 in the whole file.
pub(super) fn values_of(
    reader: &mut ColumnReader,
    source: &ColumnSource,
    rows: usize,
    first_row: usize,
    budget: Budget,
) -> Result<Values, ContentError> {
    use ColumnReader as Stored;
    let part = Part { source, rows, first_row, budget };
    Ok(match reader {
        Stored::ByteArrayColumnReader(reader) => Values::Text(part.texts(reader)?),
        Stored::BoolColumnReader(reader) if source.kind == ColumnKind::Flag => {
            Values::Flag(part.complete(reader)?)
        }
        Stored::BoolColumnReader(reader) => {
            part.real(reader, |flag| Ok(f64::from(u8::from(*flag))))?
        }
        Stored::Int32ColumnReader(reader) => part.small(reader)?,
        Stored::Int64ColumnReader(reader) => part.large(reader)?,
        Stored::Int96ColumnReader(reader) => part.real(reader, |moment| Ok(old_moment(moment)))?,
        Stored::FloatColumnReader(reader) => part.real(reader, |value| Ok(f64::from(*value)))?,
        Stored::DoubleColumnReader(reader) => part.real(reader, |value| Ok(*value))?,
        Stored::FixedLenByteArrayColumnReader(reader) => part.real(reader, half)?,
    })
}

/// Several rows of a column.
#[derive(Clone, Copy)]
struct Part<'s> {
    source: &'s ColumnSource,
    rows: usize,
    first_row: usize,
    budget: Budget,
}

impl Part<'_> {
    /// 32-bit integers, and types stored as such.
    fn small(self, reader: &mut ColumnReaderImpl<::parquet::data_type::Int32Type>) -> Decoded {
        let meaning = self.source.meaning;
        Ok(match (self.source.kind, meaning) {
            (ColumnKind::Unsigned, _) => {
                Values::Unsigned(converted(self.complete(reader)?, i32::cast_unsigned))
            }
            (ColumnKind::Integer, _) => {
                Values::Integer(converted(self.complete(reader)?, i64::from))
            }
            (_, Meaning::Unsigned) => {
                self.real(reader, |value| Ok(f64::from(value.cast_unsigned())))?
            }
            _ => self.real(reader, |value| Ok(number(i64::from(*value), meaning)))?,
        })
    }

    /// 64-bit integers, and types stored as such.
    fn large(self, reader: &mut ColumnReaderImpl<::parquet::data_type::Int64Type>) -> Decoded {
        let meaning = self.source.meaning;
        Ok(match (self.source.kind, meaning) {
            (ColumnKind::Integer, Meaning::Unsigned) => {
                let values = self.complete(reader)?;
                self.require_63_bits(&values)?;
                Values::Integer(values)
            }
            (ColumnKind::Integer, _) => Values::Integer(self.complete(reader)?),
            (_, Meaning::Unsigned) => {
                self.real(reader, |value| Ok(value.cast_unsigned() as f64))?
            }
            _ => self.real(reader, |value| Ok(number(*value, meaning)))?,
        })
    }

    /// Floats; NaN for missing values.
    fn real<T: DataType>(
        self,
        reader: &mut ColumnReaderImpl<T>,
        convert: impl Fn(&T::T) -> Result<f64, ContentError>,
    ) -> Decoded {
        let (values, levels) = stored(reader, self.rows)?;
        let values = values.iter().map(convert).collect::<Result<Vec<f64>, _>>()?;
        Ok(Values::Float(with_gaps(values, &levels, || f64::NAN)))
    }

    /// Values without gaps.
    fn complete<T: DataType>(
        self,
        reader: &mut ColumnReaderImpl<T>,
    ) -> Result<Vec<T::T>, ContentError> {
        let (values, levels) = stored(reader, self.rows)?;
        match levels.iter().position(|level| *level == 0) {
            Some(index) => Err(self.bad_value(index, "no value (null)")),
            None => Ok(values),
        }
    }

    /// Texts; empty for missing ones. The stored texts share memory, but the table's texts do not, so their memory is
    /// counted first.
    fn texts(
        self,
        reader: &mut ColumnReaderImpl<::parquet::data_type::ByteArrayType>,
    ) -> Result<Vec<String>, ContentError> {
        let (mut texts, mut bytes) = (Vec::new(), 0);
        while texts.len() < self.rows {
            let rows = self.source.texts_at_once.min(self.rows - texts.len());
            let (values, levels) = stored(reader, rows)?;
            bytes += values.iter().map(|text| text_bytes(text.len())).sum::<u64>();
            self.budget.allow(&self.source.name, bytes)?;
            let text = |bytes: &ByteArray| Ok(bytes.as_utf8()?.to_owned());
            let values = values.iter().map(text).collect::<Result<_, ParquetError>>()?;
            texts.extend(with_gaps(values, &levels, String::new));
        }
        Ok(texts)
    }

    fn require_63_bits(self, values: &[i64]) -> Result<(), ContentError> {
        match values.iter().position(|value| *value < 0) {
            Some(index) => {
                let value = values[index].cast_unsigned();
                Err(self.bad_value(index, &format!("{value} does not fit in 63 bits")))
            }
            None => Ok(()),
        }
    }

    fn bad_value(self, index: usize, problem: &str) -> ContentError {
        let (row, column) = (self.first_row + index + 1, &self.source.name);
        ContentError::Unusable(format!("row {row}, column '{column}': {problem}"))
    }
}

type Decoded = Result<Values, ContentError>;

/// A whole number as a float, in seconds for times.
fn number(value: i64, meaning: Meaning) -> f64 {
    match meaning {
        Meaning::Time { parts } => seconds(value, parts),
        Meaning::Date => value as f64 * DAY_S as f64,
        _ => value as f64,
    }
}

/// A time in seconds, as the sum of whole seconds and the fraction, which rounds less than a single division.
fn seconds(value: i64, parts: i64) -> f64 {
    value.div_euclid(parts) as f64 + value.rem_euclid(parts) as f64 / parts as f64
}

/// Seconds since 1970 from the nanoseconds of a day and its Julian day number.
fn old_moment(moment: &Int96) -> f64 {
    let [low, high, day] = *moment.data() else { return f64::NAN };
    let of_day = (u64::from(high) << 32 | u64::from(low)).cast_signed();
    let whole_s = (i64::from(day) - JULIAN_1970) * DAY_S + of_day.div_euclid(1_000_000_000);
    whole_s as f64 + of_day.rem_euclid(1_000_000_000) as f64 / 1e9
}

fn half(bytes: &FixedLenByteArray) -> Result<f64, ContentError> {
    match *bytes.data() {
        [low, high] => Ok(f16::from_le_bytes([low, high]).to_f64()),
        _ => Err(ContentError::unreadable()),
    }
}

fn converted<A, B>(values: Vec<A>, convert: impl Fn(A) -> B) -> Vec<B> {
    values.into_iter().map(convert).collect()
}

/// Reads the next rows as stored: the present values, and for each row a level that is 0 for a missing value. Without
/// levels, no value is missing.
fn stored<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    rows: usize,
) -> Result<(Vec<T::T>, Vec<i16>), ContentError> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let (found, ..) = reader.read_records(rows, Some(&mut levels), None, &mut values)?;
    if found < rows {
        return Err(ParquetError::EOF("a column ends before its row group".to_owned()).into());
    }
    Ok((values, levels))
}

/// One value for each row, with `gap` for the missing ones.
fn with_gaps<T>(values: Vec<T>, levels: &[i16], gap: impl Fn() -> T) -> Vec<T> {
    if levels.iter().all(|level| *level != 0) {
        return values;
    }
    let mut values = values.into_iter();
    let row = |level: &i16| match level {
        0 => gap(),
        _ => values.next().unwrap_or_else(&gap),
    };
    levels.iter().map(row).collect()
}
