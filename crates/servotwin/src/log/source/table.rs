//! A Parquet file, part by part.

use super::{DATE, Read, Row, Source, SourceError, Wanted};
use crate::evaluation::table_model::times;
use crate::table::parquet::ParquetReader;
use crate::table::{Column, Kind, Table, TableError, Values};
use std::path::Path;

/// A Parquet file of which the wanted columns are read.
pub struct Parquet {
    reader: ParquetReader,
    wanted: Wanted,
    rows: usize,
    /// The wanted columns of the part being read, as numbers.
    part: Vec<Vec<f64>>,
    next: usize,
    place: u64,
}

impl Parquet {
    /// Opens a file that must have some columns.
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

    fn numbers(&self, table: &Table) -> Result<Vec<Vec<f64>>, TableError> {
        let columns = table.columns().iter().enumerate();
        let numbers = |(place, column): (usize, &Column)| match &column.values {
            Values::Text(texts) if self.wanted.time == Some(place) && self.wanted.dates => {
                Ok(texts.iter().map(|text| times::seconds(text).unwrap_or(f64::NAN)).collect())
            }
            Values::Flag(flags) => Ok(flags.iter().map(|&f| f64::from(u8::from(f))).collect()),
            _ => column.numbers().map(|numbers| numbers.into_owned()),
        };
        columns.map(numbers).collect()
    }
}

impl Source for Parquet {
    fn read(&mut self, row: &mut Row) -> Result<Read, SourceError> {
        while self.part.first().is_none_or(|column| column.len() == self.next) {
            let Some(table) = self.reader.next() else { return Ok(Read::End) };
            (self.part, self.next) = (self.numbers(&table?)?, 0);
        }
        self.place += 1;
        row.place = self.place;
        row.bad = 0;
        row.values.clear();
        for column in &self.part {
            let value = column[self.next];
            row.bad += u64::from(value.is_infinite());
            row.values.push(if value.is_finite() { value } else { f64::NAN });
        }
        self.next += 1;
        Ok(match self.wanted.time {
            Some(time) if row.values[time].is_nan() => {
                Read::Flawed(super::Flaw::NoTime { text: String::new() })
            }
            _ => Read::Row,
        })
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn share(&self) -> Option<f64> {
        (self.rows > 0).then(|| self.place as f64 / self.rows as f64)
    }
}

/// The columns of a file with their units. Where the first of a column's texts is a date, that is its unit.
pub fn columns(path: &Path) -> Result<Vec<(String, String)>, SourceError> {
    let reader = ParquetReader::open(path)?;
    let columns = reader.schema().columns();
    let texts = columns.iter().filter(|column| column.values.kind() == Kind::Text);
    let texts: Vec<&str> = texts.map(|column| column.name.as_str()).collect();
    let first = ParquetReader::open_columns(path, &texts)?.with_batch(1).next().transpose()?;
    let is_date = |name: &str| {
        let texts = first.as_ref().and_then(|part| part.text(name).ok());
        texts.and_then(<[String]>::first).is_some_and(|text| times::seconds(text).is_some())
    };
    let unit = |column: &Column| match is_date(&column.name) {
        true => DATE.to_owned(),
        false => column.unit.clone(),
    };
    Ok(columns.iter().map(|column| (column.name.clone(), unit(column))).collect())
}
