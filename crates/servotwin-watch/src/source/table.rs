//! Reads a Parquet file in batches.

use super::{Bad, DATE, LogColumn, LogRow, Read, Source, SourceError, Wanted};
use servotwin_io::moment;
use servotwin_io::sanitize;
use servotwin_io::table::csv::growing::is_missing;
use servotwin_io::table::parquet::ParquetReader;
use servotwin_io::table::{Column, ColumnKind, Table, Values};
use std::path::Path;

/// A Parquet file, of which only the wanted columns are read.
pub struct Parquet {
    reader: ParquetReader,
    wanted: Wanted,
    rows: usize,
    /// The wanted columns of the current batch.
    part: Vec<Values>,
    next: usize,
    place: u64,
}

impl Parquet {
    /// Opens a file that must have the wanted columns.
    pub fn open(path: &Path, wanted: &Wanted) -> Result<Self, SourceError> {
        let known: Vec<String> =
            ParquetReader::open(path)?.schema().names().map(String::from).collect();
        let address = path.display().to_string();
        if let Some(error) = SourceError::lacking(&address, wanted, &known) {
            return Err(error);
        }
        let names: Vec<&str> = wanted.names.iter().map(String::as_str).collect();
        let reader = ParquetReader::open_columns(path, &names)?;
        let rows = reader.row_count();
        Ok(Parquet { reader, wanted: wanted.clone(), rows, part: vec![], next: 0, place: 0 })
    }

    /// The number in a cell; `Err` with its text if it is not a number.
    fn number(&self, column: usize, row: usize) -> Result<f64, String> {
        let value = match &self.part[column] {
            Values::Float(values) => values[row],
            Values::Integer(values) => values[row] as f64,
            Values::Unsigned(values) => f64::from(values[row]),
            Values::Flag(flags) => f64::from(u8::from(flags[row])),
            Values::Text(texts) => {
                let text = texts[row].trim();
                let words = || self.wanted.number_of_words(column, text);
                match text.parse().ok().or_else(words) {
                    Some(value) => value,
                    None if is_missing(text.as_bytes()) => f64::NAN,
                    None => return Err(sanitize::text(text)),
                }
            }
        };
        if value.is_infinite() { Err(value.to_string()) } else { Ok(value) }
    }
}

impl Source for Parquet {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        while self.part.first().is_none_or(|column| column.len() == self.next) {
            let Some(table) = self.reader.next() else { return Ok(Read::End) };
            let columns = table?.into_columns();
            (self.part, self.next) = (columns.into_iter().map(|c| c.values).collect(), 0);
        }
        self.place += 1;
        row.place = self.place;
        row.forget_bad();
        row.values.clear();
        for column in 0..self.part.len() {
            let value = self.number(column, self.next).unwrap_or_else(|text| {
                row.note_bad(Bad { column, text });
                f64::NAN
            });
            row.values.push(value);
        }
        self.next += 1;
        Ok(super::frame::with_time(&self.wanted, row))
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn share(&self) -> Option<f64> {
        (self.rows > 0).then(|| self.place as f64 / self.rows as f64)
    }
}

/// The columns of a file with their units. If a column's first text is a date, its unit is `date`. Numbers are read
/// only from columns that may hold the time.
pub fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let reader = ParquetReader::open(path)?;
    let columns = reader.schema().columns();
    let named = |is_read: &dyn Fn(&Column) -> bool| -> Vec<&str> {
        columns.iter().filter(|column| is_read(column)).map(|column| &*column.name).collect()
    };
    let is_text = |column: &Column| column.values.kind() == ColumnKind::Text;
    let texts = named(&is_text);
    // A text that exceeds the size limits is not a date; reading its column reports the error.
    let first = ParquetReader::open_columns(path, &texts)?.with_batch(1).next();
    let first = first.and_then(Result::ok);
    let times = named(&|column| !is_text(column) && super::survey::may_be_time(&column.name));
    let head = ParquetReader::open_columns(path, &times)?.with_batch(256).next().transpose()?;
    let beginning = |name: &str| {
        let found = |part: &'_ Option<Table>| part.as_ref()?.column(name).ok().cloned();
        found(&first).or_else(|| found(&head))
    };
    let column = |column: &Column| {
        let (mut unit, mut head) = (column.unit.clone(), vec![]);
        let first = beginning(&column.name);
        match first.as_ref().map(|first| (&first.values, first.numbers())) {
            Some((Values::Text(texts), _)) => {
                let date = texts.first().and_then(|text| moment::seconds(text));
                if date.is_some() {
                    unit = DATE.into();
                }
            }
            Some((_, Ok(numbers))) => head.extend(numbers.iter().take(256)),
            _ => {}
        }
        LogColumn { name: column.name.clone(), unit, head }
    };
    Ok(columns.iter().map(column).collect())
}
