//! Tables as Apache Parquet files, whole or streamed.
//!
//! Columns are written as required (never null) Arrow fields that carry their unit under the
//! metadata key `unit`; the table's metadata becomes the file's key-value metadata. The bytes
//! depend on nothing but the table: no time stamp, no version but our own format's. Compression is
//! Snappy, in pure Rust.
//!
//! [`ParquetWriter`] appends rows without holding more than one row group in memory, and
//! [`ParquetReader`] gives them back table by table. Files of other writers are read if their
//! columns are numbers, booleans, text or dictionaries of these, without nulls; the codecs known
//! are Snappy, gzip and LZ4.

use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use ::parquet::arrow::{ArrowWriter, ProjectionMask};
use ::parquet::basic::Compression;
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::{KeyValue, ParquetMetaData};
use ::parquet::file::properties::{EnabledStatistics, WriterProperties};
use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{
    Array, ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray, UInt32Array,
};
use arrow_schema::{DataType, Field, Schema};

use super::{Column, ContentError, Format, Kind, Table, TableError, Values, unknown_column};
use crate::files::{AtomicFile, FileError};

/// The format's entry in [`ALL`](super::ALL).
pub const FORMAT: Format = Format { name: "Parquet", extension: "parquet", read, write };

/// Rows in a row group: large enough to compress well, small enough to hold in memory.
const GROUP_ROWS: usize = 1 << 17;

/// Rows in a table that [`ParquetReader`] gives at a time.
const BATCH_ROWS: usize = 1 << 16;

/// The key of a field's metadata under which its unit is kept.
const UNIT_KEY: &str = "unit";

/// The key under which Arrow keeps its own schema.
const ARROW_KEY: &str = "ARROW:schema";

/// Reads a whole Parquet file.
pub fn read(path: &Path) -> Result<Table, TableError> {
    collect(ParquetReader::open(path)?)
}

/// Reads only some columns of a Parquet file, in the order asked for.
pub fn read_columns(path: &Path, names: &[&str]) -> Result<Table, TableError> {
    collect(ParquetReader::open_columns(path, names)?)
}

fn collect(mut reader: ParquetReader) -> Result<Table, TableError> {
    let mut table = reader.schema().clone();
    reader.try_for_each(|part| table.append(part?))?;
    Ok(table)
}

/// Writes a whole Parquet file atomically.
pub fn write(path: &Path, table: &Table) -> Result<(), TableError> {
    let mut writer = ParquetWriter::create(path, table)?;
    writer.append(table)?;
    writer.finish()
}

/// Writes a Parquet file piece by piece; the file appears only when finished.
#[derive(Debug)]
pub struct ParquetWriter {
    schema: Table,
    arrow_schema: Arc<Schema>,
    path: PathBuf,
    writer: ArrowWriter<AtomicFile>,
}

impl ParquetWriter {
    /// Opens a file for the columns and metadata of `schema`, whose rows are not written.
    pub fn create(path: impl AsRef<Path>, schema: &Table) -> Result<Self, TableError> {
        let path = path.as_ref().to_path_buf();
        let file = AtomicFile::create(&path)?;
        let arrow_schema =
            Arc::new(Schema::new(schema.columns().iter().map(field_of).collect::<Vec<_>>()));
        let entry = |(key, value): (&String, &String)| KeyValue::new(key.clone(), value.clone());
        let properties = WriterProperties::builder()
            .set_created_by("servotwin".to_owned())
            .set_compression(Compression::SNAPPY)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_max_row_group_row_count(Some(GROUP_ROWS))
            .set_key_value_metadata(Some(schema.metadata.iter().map(entry).collect()))
            .build();
        let writer = ArrowWriter::try_new(file, arrow_schema.clone(), Some(properties))
            .map_err(|error| parquet_error(&path, error))?;
        Ok(Self { schema: schema.without_rows(), arrow_schema, path, writer })
    }

    /// Appends the rows of a table with the same columns. A row group is closed when full.
    pub fn append(&mut self, table: &Table) -> Result<(), TableError> {
        self.schema.require_same_columns(table)?;
        if table.row_count() == 0 {
            return Ok(());
        }
        let arrays = table.columns().iter().map(|column| array_of(&column.values)).collect();
        RecordBatch::try_new(self.arrow_schema.clone(), arrays)
            .map_err(ParquetError::from)
            .and_then(|batch| self.writer.write(&batch))
            .map_err(|error| self.unwritten(error))
    }

    /// Closes the row group begun: what was appended so far leaves the memory.
    pub fn end_group(&mut self) -> Result<(), TableError> {
        self.writer.flush().map_err(|error| self.unwritten(error))
    }

    /// Writes the file's end and puts it in its place.
    pub fn finish(mut self) -> Result<(), TableError> {
        self.end_group()?;
        let file = self.writer.into_inner().map_err(|error| parquet_error(&self.path, error))?;
        Ok(file.commit()?)
    }

    /// The library may wrap the operating system's error; the file knows it.
    fn unwritten(&self, error: ParquetError) -> TableError {
        match self.writer.inner().failure() {
            Some(cause) => TableError::File(FileError::from_io(&self.path, cause)),
            None => parquet_error(&self.path, error),
        }
    }
}

/// Reads a Parquet file as a sequence of tables, in the order of the rows.
pub struct ParquetReader {
    path: PathBuf,
    schema: Table,
    row_count: usize,
    rows_read: usize,
    batches: ParquetRecordBatchReader,
}

impl ParquetReader {
    /// Opens a file with all its columns.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, TableError> {
        Self::open_selected(path.as_ref(), None)
    }

    /// Opens a file with some of its columns, in the order asked for; the others are not read.
    pub fn open_columns(path: impl AsRef<Path>, names: &[&str]) -> Result<Self, TableError> {
        Self::open_selected(path.as_ref(), Some(names))
    }

    fn open_selected(path: &Path, names: Option<&[&str]>) -> Result<Self, TableError> {
        let content = |problem| TableError::Content { path: path.to_path_buf(), problem };
        let file = open_marked(path)?;
        let builder = guarded(path, || ParquetRecordBatchReaderBuilder::try_new(file))?;
        let fields = builder.schema().fields().clone();
        require_different_names(&fields).map_err(content)?;
        let places = match names {
            None => (0..fields.len()).collect(),
            Some(names) => places_of(&fields, names)?,
        };
        let mut schema = Table::new();
        for place in &places {
            schema.push(empty_column(&fields[*place]).map_err(content)?)?;
        }
        let file_metadata = builder.metadata().file_metadata();
        for entry in file_metadata.key_value_metadata().into_iter().flatten() {
            if entry.key != ARROW_KEY {
                let value = entry.value.clone().unwrap_or_default();
                schema.metadata.insert(entry.key.clone(), value);
            }
        }
        require_known_codecs(builder.metadata()).map_err(content)?;
        let row_count = usize::try_from(file_metadata.num_rows()).unwrap_or(0);
        let mask = ProjectionMask::roots(builder.parquet_schema(), places);
        let builder = builder.with_projection(mask).with_batch_size(BATCH_ROWS);
        let batches = guarded(path, || builder.build())?;
        Ok(Self { path: path.to_path_buf(), schema, row_count, rows_read: 0, batches })
    }

    /// The columns, without rows, and the metadata.
    pub fn schema(&self) -> &Table {
        &self.schema
    }

    /// The number of rows in the file.
    pub fn row_count(&self) -> usize {
        self.row_count
    }

    fn table_of(&self, batch: &RecordBatch) -> Result<Table, TableError> {
        let mut table = Table { metadata: self.schema.metadata.clone(), ..Table::new() };
        for column in self.schema.columns() {
            let Some(array) = batch.column_by_name(&column.name) else {
                return Err(unknown_column(&column.name, []));
            };
            let place = Place { column: &column.name, first_row: self.rows_read };
            let values = values_of(array, place).map_err(|problem| self.content(problem))?;
            table.push(Column { values, ..column.clone() })?;
        }
        Ok(table)
    }

    fn content(&self, problem: ContentError) -> TableError {
        TableError::Content { path: self.path.clone(), problem }
    }
}

impl Iterator for ParquetReader {
    type Item = Result<Table, TableError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batches = &mut self.batches;
        let batch = guarded(&self.path, || Ok(batches.next().transpose()?)).transpose()?;
        let batch = match batch {
            Ok(batch) => batch,
            Err(error) => return Some(Err(error)),
        };
        let table = self.table_of(&batch);
        self.rows_read += batch.num_rows();
        Some(table)
    }
}

/// Opens a file that begins and ends with Parquet's mark.
fn open_marked(path: &Path) -> Result<File, TableError> {
    let system = |cause| TableError::File(FileError::from_io(path, cause));
    let mut file = File::open(path).map_err(system)?;
    let length = file.metadata().map_err(system)?.len();
    let problem = if length == 0 { ContentError::Empty } else { ContentError::NotParquet };
    let marked = length >= 12 && has_marks(&mut file).map_err(system)?;
    if marked {
        return Ok(file);
    }
    Err(TableError::Content { path: path.to_path_buf(), problem })
}

fn has_marks(file: &mut File) -> io::Result<bool> {
    let (mut first, mut last) = ([0; 4], [0; 4]);
    file.read_exact(&mut first)?;
    file.seek(SeekFrom::End(-4))?;
    file.read_exact(&mut last)?;
    file.rewind()?;
    Ok(&first == b"PAR1" && &last == b"PAR1")
}

fn require_different_names(fields: &arrow_schema::Fields) -> Result<(), ContentError> {
    let mut known = BTreeSet::new();
    match fields.iter().find(|field| !known.insert(field.name())) {
        Some(twice) => Err(ContentError::DuplicateColumn { column: twice.name().clone() }),
        None => Ok(()),
    }
}

fn require_known_codecs(file: &ParquetMetaData) -> Result<(), ContentError> {
    let columns = file.row_groups().iter().flat_map(|group| group.columns());
    let unknown = columns.map(|column| (column, column.compression())).find(|(_, codec)| {
        use Compression as Codec;
        let known = [Codec::UNCOMPRESSED, Codec::SNAPPY, Codec::LZ4, Codec::LZ4_RAW];
        !known.contains(codec) && !matches!(codec, Codec::GZIP(_))
    });
    match unknown {
        Some((column, codec)) => Err(ContentError::UnknownCodec {
            column: column.column_path().string(),
            codec: codec.to_string(),
        }),
        None => Ok(()),
    }
}

fn places_of(fields: &arrow_schema::Fields, names: &[&str]) -> Result<Vec<usize>, TableError> {
    let known = || fields.iter().map(|field| field.name().as_str());
    let place = |name: &&str| {
        known().position(|field| field == *name).ok_or_else(|| unknown_column(name, known()))
    };
    names.iter().map(place).collect()
}

fn empty_column(field: &Field) -> Result<Column, ContentError> {
    let kind = kind_of(field.data_type()).ok_or_else(|| ContentError::UnsupportedType {
        column: field.name().clone(),
        found: field.data_type().to_string(),
    })?;
    let unit = field.metadata().get(UNIT_KEY).cloned().unwrap_or_default();
    Ok(Column::new(field.name(), unit, Values::empty(kind)))
}

fn field_of(column: &Column) -> Field {
    let data_type = match column.values.kind() {
        Kind::Float => DataType::Float64,
        Kind::Integer => DataType::Int64,
        Kind::Unsigned => DataType::UInt32,
        Kind::Flag => DataType::Boolean,
        Kind::Text => DataType::Utf8,
    };
    let field = Field::new(&column.name, data_type, false);
    if column.unit.is_empty() {
        return field;
    }
    field.with_metadata(HashMap::from([(UNIT_KEY.to_owned(), column.unit.clone())]))
}

fn array_of(values: &Values) -> ArrayRef {
    match values {
        Values::Float(values) => Arc::new(Float64Array::from_iter_values(values.iter().copied())),
        Values::Integer(values) => Arc::new(Int64Array::from_iter_values(values.iter().copied())),
        Values::Unsigned(values) => Arc::new(UInt32Array::from_iter_values(values.iter().copied())),
        Values::Flag(values) => Arc::new(BooleanArray::from(values.clone())),
        Values::Text(values) => Arc::new(StringArray::from_iter_values(values)),
    }
}

/// The kind of column that holds an Arrow type, if any does.
fn kind_of(data_type: &DataType) -> Option<Kind> {
    use DataType as Type;
    Some(match data_type {
        Type::Float16 | Type::Float32 | Type::Float64 => Kind::Float,
        Type::Int8 | Type::Int16 | Type::Int32 | Type::Int64 | Type::UInt64 => Kind::Integer,
        Type::UInt8 | Type::UInt16 | Type::UInt32 => Kind::Unsigned,
        Type::Boolean => Kind::Flag,
        Type::Utf8 | Type::LargeUtf8 | Type::Utf8View => Kind::Text,
        Type::Dictionary(_, values) => return kind_of(values),
        _ => return None,
    })
}

/// Where an array stands in its file, for messages.
#[derive(Clone, Copy)]
struct Place<'a> {
    column: &'a str,
    first_row: usize,
}

impl Place<'_> {
    /// The row, counted from 1 in the whole file.
    fn row(self, index: usize) -> usize {
        self.first_row + index + 1
    }
}

macro_rules! numbers {
    ($array:expr, $native:ty, $target:ty) => {
        $array
            .as_primitive::<$native>()
            .values()
            .iter()
            .map(|value| <$target>::from(*value))
            .collect()
    };
}

fn values_of(array: &dyn Array, place: Place) -> Result<Values, ContentError> {
    use DataType as Type;
    if let Some(index) = first_null(array) {
        let column = place.column.to_owned();
        return Err(ContentError::Null { column, row: place.row(index) });
    }
    Ok(match array.data_type() {
        Type::Float16 => Values::Float(numbers!(array, Float16Type, f64)),
        Type::Float32 => Values::Float(numbers!(array, Float32Type, f64)),
        Type::Float64 => Values::Float(numbers!(array, Float64Type, f64)),
        Type::Int8 => Values::Integer(numbers!(array, Int8Type, i64)),
        Type::Int16 => Values::Integer(numbers!(array, Int16Type, i64)),
        Type::Int32 => Values::Integer(numbers!(array, Int32Type, i64)),
        Type::Int64 => Values::Integer(numbers!(array, Int64Type, i64)),
        Type::UInt8 => Values::Unsigned(numbers!(array, UInt8Type, u32)),
        Type::UInt16 => Values::Unsigned(numbers!(array, UInt16Type, u32)),
        Type::UInt32 => Values::Unsigned(numbers!(array, UInt32Type, u32)),
        Type::UInt64 => large_values(array, place)?,
        Type::Boolean => Values::Flag(array.as_boolean().values().iter().collect()),
        Type::Utf8 => Values::Text(texts(array.as_string::<i32>().iter())),
        Type::LargeUtf8 => Values::Text(texts(array.as_string::<i64>().iter())),
        Type::Utf8View => Values::Text(texts(array.as_string_view().iter())),
        Type::Dictionary(..) => dictionary_values(array, place)?,
        other => {
            let (column, found) = (place.column.to_owned(), other.to_string());
            return Err(ContentError::UnsupportedType { column, found });
        }
    })
}

fn first_null(array: &dyn Array) -> Option<usize> {
    let nulls = array.logical_nulls()?;
    (0..nulls.len()).find(|index| nulls.is_null(*index))
}

fn texts<'a>(values: impl Iterator<Item = Option<&'a str>>) -> Vec<String> {
    values.map(|value| value.unwrap_or_default().to_owned()).collect()
}

fn large_values(array: &dyn Array, place: Place) -> Result<Values, ContentError> {
    let convert = |(index, value): (usize, &u64)| {
        i64::try_from(*value).map_err(|_| ContentError::TooLarge {
            column: place.column.to_owned(),
            row: place.row(index),
            value: *value,
        })
    };
    let values = array.as_primitive::<UInt64Type>().values();
    values.iter().enumerate().map(convert).collect::<Result<_, _>>().map(Values::Integer)
}

/// The values of a dictionary, looked up. Its own entries may hold nulls that nobody uses.
fn dictionary_values(array: &dyn Array, place: Place) -> Result<Values, ContentError> {
    fn pick<T: Clone>(entries: &[T], keys: &[usize]) -> Vec<T> {
        keys.iter().map(|key| entries[*key].clone()).collect()
    }
    let dictionary = array.as_any_dictionary();
    if array.is_empty() {
        return Ok(kind_of(dictionary.values().data_type())
            .map_or_else(|| Values::Float(Vec::new()), Values::empty));
    }
    let keys = dictionary.normalized_keys();
    Ok(match values_of(dictionary.values(), place)? {
        Values::Float(entries) => Values::Float(pick(&entries, &keys)),
        Values::Integer(entries) => Values::Integer(pick(&entries, &keys)),
        Values::Unsigned(entries) => Values::Unsigned(pick(&entries, &keys)),
        Values::Flag(entries) => Values::Flag(pick(&entries, &keys)),
        Values::Text(entries) => Values::Text(pick(&entries, &keys)),
    })
}

/// Calls the Parquet library so that a panic in it, which damaged lengths and offsets in a file
/// can cause (seen with version 60.1), becomes an error. What it worked on is not used again.
fn guarded<T>(
    path: &Path,
    call: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, TableError> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(result) => result.map_err(|error| parquet_error(path, error)),
        Err(_) => {
            Err(TableError::Content { path: path.to_path_buf(), problem: ContentError::Unreadable })
        }
    }
}

/// The operating system's error inside a Parquet error, if that is what it is.
fn system_error(error: ParquetError) -> Result<io::Error, ParquetError> {
    match error {
        ParquetError::External(inner) => {
            inner.downcast::<io::Error>().map(|cause| *cause).map_err(ParquetError::External)
        }
        other => Err(other),
    }
}

fn parquet_error(path: &Path, error: ParquetError) -> TableError {
    let path = path.to_path_buf();
    match system_error(error) {
        Ok(cause) => TableError::File(FileError::from_io(&path, cause)),
        Err(source) => TableError::Content { path, problem: ContentError::Damaged { source } },
    }
}
