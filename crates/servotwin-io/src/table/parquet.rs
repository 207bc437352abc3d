//! Tables as Apache Parquet files, whole or streamed.
//!
//! Columns are written as required (never null). The file's key-value metadata holds the table's metadata. An Arrow
//! schema beside it holds `unit` and `description` as metadata of the fields, where pyarrow and Polars look for them. The
//! bytes depend only on the table: there is no time
//! stamp and no version except our own format's. Compression is Snappy, in pure Rust.
//!
//! [`ParquetWriter`] appends rows and holds at most one row group in memory. [`ParquetReader`] returns them table by
//! table. Files of other writers may have columns of numbers, booleans, text, times or dictionaries of these. The
//! supported codecs are Snappy, gzip, LZ4 and Zstandard. A missing number becomes NaN, a missing text an empty one.
//!
//! Times become seconds: a timestamp since 1970, a time of day since midnight, a duration unchanged. The unnamed index
//! of a pandas data frame becomes `time` if it holds times.
//!
//! Only the requested columns are decoded. A whole table is read column by column, within [`Limits`].
//!
//! The library's Arrow layer is disabled: it would take longer to compile than everything else that a table needs.

mod arrow;
mod arrow_schema;
mod decode;
mod limits;
mod meaning;
mod zstd;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::parquet::basic::{Compression, Encoding, LogicalType, Repetition, Type as Physical};
use ::parquet::column::page::PageReader;
use ::parquet::column::reader::{ColumnReader, get_column_reader};
use ::parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int32Type, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::{
    ColumnChunkMetaData, KeyValue, ParquetMetaData, ParquetMetaDataReader, RowGroupMetaData,
};
use ::parquet::file::properties::{EnabledStatistics, WriterProperties};
use ::parquet::file::serialized_reader::SerializedPageReader;
use ::parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use ::parquet::schema::types::{Type, TypePtr};
use serde_json::Value;

use super::{Column, ColumnKind, ContentError, Format, Table, TableError, Values, unknown_column};
use arrow::Facts;
use decode::{ColumnSource, values_of};
use limits::{Budget, text_bytes};
use meaning::kind_of;

pub use limits::Limits;

use crate::files::{self, AtomicFile, FileError};
use crate::manifest;

/// The format's entry in [`ALL`](super::ALL).
pub(crate) const FORMAT: Format = Format { name: "Parquet", extension: "parquet", read, write };

/// Rows in a row group: large enough to compress well, small enough to hold in memory.
const GROUP_ROWS: usize = 1 << 17;

/// Maximum number of rows in a table of [`ParquetReader`].
const BATCH_ROWS: usize = 1 << 16;

/// Metadata key of the schema of writers with an Arrow layer.
const ARROW_KEY: &str = "ARROW:schema";

/// Metadata key of the column description of pandas.
const PANDAS_KEY: &str = "pandas";

/// The name that pandas gives to an unnamed index.
const UNNAMED_INDEX: &str = "__index_level_0__";

/// The name of such an index in a table if it holds times.
const TIME: &str = "time";

/// Number of texts decoded at once. One encoding shares prefixes with the previous text and can make long texts of a
/// few bytes; such texts are decoded one by one.
const TEXTS_AT_ONCE: usize = 1 << 10;

/// Reads a whole Parquet file.
///
/// # Errors
/// If the file cannot be read, or a column is unsupported or exceeds the [`Limits`].
pub fn read(path: &Path) -> Result<Table, TableError> {
    ParquetReader::open(path)?.into_table(Limits::from_environment())
}

/// Reads a Parquet file of another program: unsupported columns and those above the [`Limits`] are left out. Only the
/// columns whose names `is_wanted` accepts are decoded.
///
/// # Errors
/// If the file cannot be read or no column remains.
pub(crate) fn read_wanted(
    path: &Path,
    is_wanted: &dyn Fn(&str) -> bool,
) -> Result<Table, TableError> {
    read_within(path, is_wanted, Limits::from_environment())
}

/// As `read_wanted`, within the caller's limits.
///
/// # Errors
/// As `read_wanted`.
pub fn read_within(
    path: &Path,
    is_wanted: &dyn Fn(&str) -> bool,
    limits: Limits,
) -> Result<Table, TableError> {
    ParquetReader::open_chosen(path, Choice::Usable(is_wanted))?.into_table(limits)
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
    path: PathBuf,
    /// The rows of the current row group.
    begun: Table,
    writer: SerializedFileWriter<AtomicFile>,
}

impl ParquetWriter {
    /// Opens a file for the columns and metadata of `schema`, without writing its rows.
    pub fn create(path: impl AsRef<Path>, schema: &Table) -> Result<Self, TableError> {
        let path = path.as_ref().to_path_buf();
        let file = AtomicFile::create(&path)?;
        let properties = WriterProperties::builder()
            .set_created_by("servotwin".to_owned())
            .set_compression(Compression::SNAPPY)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_key_value_metadata(Some(notes_of(schema)))
            .build();
        let writer = schema_of(schema)
            .and_then(|fields| SerializedFileWriter::new(file, fields, Arc::new(properties)))
            .map_err(|error| parquet_error(&path, error))?;
        Ok(Self { path, begun: schema.without_rows(), writer })
    }

    /// Appends the rows of a table with the same columns. A row group is closed when full.
    pub fn append(&mut self, table: &Table) -> Result<(), TableError> {
        self.begun.require_same_columns(table)?;
        let mut first = 0;
        while first < table.row_count() {
            let fitting = GROUP_ROWS - self.begun.row_count();
            let end = table.row_count().min(first + fitting);
            self.begun.append(table.rows(first..end))?;
            first = end;
            if self.begun.row_count() == GROUP_ROWS {
                self.end_group()?;
            }
        }
        Ok(())
    }

    /// Closes the current row group, so that its rows leave the memory.
    pub fn end_group(&mut self) -> Result<(), TableError> {
        if self.begun.row_count() == 0 {
            return Ok(());
        }
        write_group(&mut self.writer, &self.begun).map_err(|error| self.unwritten(error))?;
        self.begun = self.begun.without_rows();
        Ok(())
    }

    /// Writes the end of the file and moves it to its path.
    pub fn finish(mut self) -> Result<(), TableError> {
        self.end_group()?;
        let file = self.writer.into_inner().map_err(|error| parquet_error(&self.path, error))?;
        manifest::forget(&self.path)?;
        Ok(file.commit()?)
    }

    /// Recovers the operating system's error, which the library may have wrapped, from the file.
    fn unwritten(&self, error: ParquetError) -> TableError {
        match self.writer.inner().failure() {
            Some(cause) => TableError::File(FileError::from_io(&self.path, cause)),
            None => parquet_error(&self.path, error),
        }
    }
}

/// The table's metadata, and a schema with units and descriptions if there are any.
fn notes_of(table: &Table) -> Vec<KeyValue> {
    let own = table.metadata.iter().map(|(key, note)| KeyValue::new(key.clone(), note.clone()));
    let has_facts = |column: &Column| !(column.unit.is_empty() && column.description.is_empty());
    let schema = table.columns().iter().any(has_facts).then(|| arrow_schema::encode(table));
    let schema = schema.map(|schema| KeyValue::new(ARROW_KEY.to_owned(), schema));
    own.chain(schema).collect()
}

fn schema_of(table: &Table) -> Result<TypePtr, ParquetError> {
    let fields = table.columns().iter().map(field_of).collect::<Result<_, _>>()?;
    Ok(Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?))
}

fn field_of(column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, logical) = match column.values.kind() {
        ColumnKind::Float => (Physical::DOUBLE, None),
        ColumnKind::Integer => (Physical::INT64, None),
        ColumnKind::Unsigned => (Physical::INT32, Some(LogicalType::integer(32, false))),
        ColumnKind::Flag => (Physical::BOOLEAN, None),
        ColumnKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let field = Type::primitive_type_builder(&column.name, physical)
        .with_logical_type(logical)
        .with_repetition(Repetition::REQUIRED);
    field.build().map(Arc::new)
}

fn write_group(
    file: &mut SerializedFileWriter<AtomicFile>,
    table: &Table,
) -> Result<(), ParquetError> {
    let mut group = file.next_row_group()?;
    for column in table.columns() {
        let Some(mut writer) = group.next_column()? else {
            return Err(ParquetError::General("a column that the schema has not".to_owned()));
        };
        write_values(&mut writer, &column.values)?;
        writer.close()?;
    }
    group.close().map(|_| ())
}

fn write_values(
    writer: &mut SerializedColumnWriter,
    values: &Values,
) -> Result<usize, ParquetError> {
    match values {
        Values::Float(values) => writer.typed::<DoubleType>().write_batch(values, None, None),
        Values::Integer(values) => writer.typed::<Int64Type>().write_batch(values, None, None),
        Values::Unsigned(values) => {
            // The same 32 bits: Parquet has no separate type for unsigned numbers.
            let bits: Vec<i32> = values.iter().map(|value| value.cast_signed()).collect();
            writer.typed::<Int32Type>().write_batch(&bits, None, None)
        }
        Values::Flag(values) => writer.typed::<BoolType>().write_batch(values, None, None),
        Values::Text(values) => {
            let bytes: Vec<ByteArray> =
                values.iter().map(|text| ByteArray::from(text.as_str())).collect();
            writer.typed::<ByteArrayType>().write_batch(&bytes, None, None)
        }
    }
}

/// Reads a Parquet file as a sequence of tables, in the order of the rows.
pub struct ParquetReader {
    path: PathBuf,
    file: Arc<File>,
    metadata: ParquetMetaData,
    schema: Table,
    /// One for each column of the schema.
    columns: Vec<ColumnParts>,
    /// Wanted columns that cannot be read, with the reason.
    left_out: Vec<(String, ContentError)>,
    /// Columns that are not wanted.
    unread: Vec<String>,
    /// Whether unreadable columns are left out instead of being an error.
    leaves_out: bool,
    batch_rows: usize,
}

/// The rows of a column, read one part after another.
struct ColumnParts {
    source: ColumnSource,
    /// The reader of the current row group.
    reader: Option<ColumnReader>,
    /// Number of remaining rows in that group.
    rows_left: usize,
    next_group: usize,
    rows_read: usize,
}

/// The columns of a file to read.
#[derive(Clone, Copy)]
enum Choice<'c> {
    All,
    /// These columns, in this order.
    Named(&'c [&'c str]),
    /// All wanted columns that can be read.
    Usable(&'c dyn Fn(&str) -> bool),
}

impl ParquetReader {
    /// Opens a file with all its columns.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, TableError> {
        Self::open_chosen(path.as_ref(), Choice::All)
    }

    /// Opens a file with only some of its columns, in this order.
    pub fn open_columns(path: impl AsRef<Path>, names: &[&str]) -> Result<Self, TableError> {
        Self::open_chosen(path.as_ref(), Choice::Named(names))
    }

    fn open_chosen(path: &Path, choice: Choice) -> Result<Self, TableError> {
        let content = |problem| content_error(path, problem);
        manifest::check(path)?;
        let file = open_marked(path)?;
        let parse = || Ok(ParquetMetaDataReader::new().parse_and_finish(&file)?);
        let metadata = guarded(parse).map_err(content)?;
        let notes = notes_in(&metadata);
        let fields = fields_of(&metadata, &notes).map_err(content)?;
        let leaves_out = matches!(choice, Choice::Usable(_));
        let mut reader = Self {
            path: path.to_path_buf(),
            file: Arc::new(file),
            metadata,
            schema: Table::new(),
            columns: Vec::new(),
            left_out: Vec::new(),
            unread: Vec::new(),
            leaves_out,
            batch_rows: BATCH_ROWS,
        };
        for field in chosen(&fields, choice)? {
            match field.source(&reader.metadata) {
                Ok(source) => reader.add(source, field.facts.as_ref())?,
                Err(problem) if leaves_out => reader.left_out.push((field.name.clone(), problem)),
                Err(problem) => return Err(content(problem)),
            }
        }
        if let Choice::Usable(is_wanted) = choice {
            let names = fields.into_iter().map(|field| field.name);
            reader.unread = names.filter(|name| !is_wanted(name)).collect();
        }
        reader.schema.metadata = notes;
        reader.schema.metadata.remove(ARROW_KEY);
        Ok(reader)
    }

    /// Adds a column to the schema.
    fn add(&mut self, source: ColumnSource, facts: Option<&Facts>) -> Result<(), TableError> {
        let unit = facts.and_then(|facts| facts.unit.as_deref());
        let unit = unit.unwrap_or(source.meaning.unit());
        let description = facts.and_then(|facts| facts.description.clone()).unwrap_or_default();
        let column = Column::new(&source.name, unit, Values::empty(source.kind));
        self.schema.push(column.described(description))?;
        self.columns.push(ColumnParts {
            source,
            reader: None,
            rows_left: 0,
            next_group: 0,
            rows_read: 0,
        });
        Ok(())
    }

    /// Reduces the number of rows in each part, for callers that need only the first ones.
    pub fn with_batch(self, rows: usize) -> Self {
        Self { batch_rows: rows.clamp(1, BATCH_ROWS), ..self }
    }

    /// The columns, without rows, and the metadata.
    pub fn schema(&self) -> &Table {
        &self.schema
    }

    /// The number of rows in the file.
    pub fn row_count(&self) -> usize {
        usize::try_from(self.metadata.file_metadata().num_rows()).unwrap_or(0)
    }

    /// Reads all rows, column by column.
    fn into_table(mut self, limits: Limits) -> Result<Table, TableError> {
        let mut budget = Budget::new(limits);
        let mut table = Table { metadata: self.schema.metadata.clone(), ..Table::new() };
        for (mut parts, column) in
            std::mem::take(&mut self.columns).into_iter().zip(self.schema.columns())
        {
            match self.whole_column(&mut parts, budget) {
                Ok(values) => {
                    budget.spend(bytes_of(&values));
                    table.push(column.with_values(values))?;
                }
                Err(problem) if self.leaves_out && matches!(problem, ContentError::TooLarge(_)) => {
                    self.left_out.push((parts.source.name, problem));
                }
                Err(problem) => return Err(content_error(&self.path, problem)),
            }
        }
        if table.columns().is_empty() && !self.left_out.is_empty() {
            return Err(content_error(&self.path, self.left_out.swap_remove(0).1));
        }
        let reason = |(name, problem): (String, ContentError)| (name, problem.to_string());
        table.origin.unread = self.unread;
        table.origin.left_out = self.left_out.into_iter().map(reason).collect();
        Ok(table)
    }

    fn whole_column(
        &self,
        parts: &mut ColumnParts,
        budget: Budget,
    ) -> Result<Values, ContentError> {
        let ColumnSource { kind, name, .. } = &parts.source;
        let width = match kind {
            ColumnKind::Float | ColumnKind::Integer => 8,
            ColumnKind::Unsigned => 4,
            ColumnKind::Flag => 1,
            ColumnKind::Text => text_bytes(0),
        };
        budget.allow(name, (self.row_count() as u64).saturating_mul(width))?;
        let (mut values, mut bytes) = (Values::empty(*kind), 0);
        while let Some(part) =
            parts.next(&self.file, &self.metadata, BATCH_ROWS, budget.begun(bytes))?
        {
            bytes += bytes_of(&part);
            values.append(part);
        }
        Ok(values)
    }

    fn next_part(&mut self) -> Result<Option<Table>, ContentError> {
        let mut budget = Budget::new(Limits::from_environment());
        let mut part = self.schema.without_rows();
        for (column, parts) in part.columns.iter_mut().zip(&mut self.columns) {
            let values = parts.next(&self.file, &self.metadata, self.batch_rows, budget)?;
            let Some(values) = values else { return Ok(None) };
            budget.spend(bytes_of(&values));
            column.values = values;
        }
        Ok(Some(part).filter(|part| !part.columns.is_empty()))
    }
}

impl ColumnParts {
    /// The next rows, all of one row group and at most so many; `None` at the end.
    fn next(
        &mut self,
        file: &Arc<File>,
        metadata: &ParquetMetaData,
        most: usize,
        budget: Budget,
    ) -> Result<Option<Values>, ContentError> {
        while self.rows_left == 0 {
            let Some(group) = metadata.row_groups().get(self.next_group) else { return Ok(None) };
            self.rows_left =
                usize::try_from(group.num_rows()).map_err(|_| ContentError::unreadable())?;
            let open = || open_column(file, group, &self.source, self.rows_left, budget);
            self.reader = Some(guarded(open)?);
            self.next_group += 1;
        }
        let Some(reader) = &mut self.reader else { return Ok(None) };
        let rows = self.rows_left.min(most);
        let values = guarded(|| values_of(reader, &self.source, rows, self.rows_read, budget))?;
        self.rows_left -= rows;
        self.rows_read += rows;
        Ok(Some(values))
    }
}

/// Memory of values, bytes.
fn bytes_of(values: &Values) -> u64 {
    match values {
        Values::Float(values) => size_of_val(values.as_slice()) as u64,
        Values::Integer(values) => size_of_val(values.as_slice()) as u64,
        Values::Unsigned(values) => size_of_val(values.as_slice()) as u64,
        Values::Flag(values) => values.len() as u64,
        Values::Text(values) => values.iter().map(|text| text_bytes(text.len())).sum(),
    }
}

/// Opens a column of a row group, if its pages fit into the budget.
fn open_column(
    file: &Arc<File>,
    group: &RowGroupMetaData,
    source: &ColumnSource,
    rows: usize,
    budget: Budget,
) -> Result<ColumnReader, ContentError> {
    let chunk = group.columns().get(source.place).ok_or_else(ContentError::unreadable)?;
    budget.allow(&source.name, u64::try_from(chunk.uncompressed_size()).unwrap_or(0))?;
    Ok(get_column_reader(chunk.column_descr_ptr(), pages_of(file, chunk, rows)?))
}

impl Iterator for ParquetReader {
    type Item = Result<Table, TableError>;

    fn next(&mut self) -> Option<Self::Item> {
        let part = self.next_part();
        if part.is_err() {
            // Stop reading after an error.
            self.columns.clear();
        }
        part.map_err(|problem| content_error(&self.path, problem)).transpose()
    }
}

fn pages_of(
    file: &Arc<File>,
    chunk: &ColumnChunkMetaData,
    rows: usize,
) -> Result<Box<dyn PageReader>, ParquetError> {
    let pages = |chunk| SerializedPageReader::new(file.clone(), chunk, rows, None);
    if zstd::is_packed(chunk) {
        return Ok(Box::new(zstd::Unpacked::new(pages(&zstd::as_stored(chunk)?)?, chunk)));
    }
    Ok(Box::new(pages(chunk)?))
}

/// Opens a file with Parquet's marks at its start and end.
fn open_marked(path: &Path) -> Result<File, TableError> {
    let system = |cause| TableError::File(FileError::from_io(path, cause));
    let mut file = files::open(path)?;
    let length = file.metadata().map_err(system)?.len();
    if length >= 12 && has_marks(&mut file).map_err(system)? {
        return Ok(file);
    }
    let truncated = "this is no Parquet file, or its end is missing".to_owned();
    let problem =
        if length == 0 { ContentError::empty() } else { ContentError::Unusable(truncated) };
    Err(content_error(path, problem))
}

fn has_marks(file: &mut File) -> io::Result<bool> {
    let (mut first, mut last) = ([0; 4], [0; 4]);
    file.read_exact(&mut first)?;
    file.seek(SeekFrom::End(-4))?;
    file.read_exact(&mut last)?;
    file.rewind()?;
    Ok(&first == b"PAR1" && &last == b"PAR1")
}

fn notes_in(metadata: &ParquetMetaData) -> BTreeMap<String, String> {
    let notes = metadata.file_metadata().key_value_metadata().into_iter().flatten();
    notes.map(|note| (note.key.clone(), note.value.clone().unwrap_or_default())).collect()
}

/// A top-level field of a file.
struct Field {
    /// Its name in the table.
    name: String,
    stored: TypePtr,
    /// Its index among the stored columns; `None` for a group.
    place: Option<usize>,
    facts: Option<Facts>,
}

fn fields_of(
    metadata: &ParquetMetaData,
    notes: &BTreeMap<String, String>,
) -> Result<Vec<Field>, ContentError> {
    let file = metadata.file_metadata();
    let mut facts = notes.get(ARROW_KEY).map(|schema| arrow::facts(schema)).unwrap_or_default();
    let columns = file.schema_descr().columns().iter().enumerate();
    let simple = columns.filter(|(_, column)| column.path().parts().len() == 1);
    let places: HashMap<&str, usize> = simple.map(|(place, c)| (c.name(), place)).collect();
    let stored = file.schema().get_fields();
    let has_index = notes.get(PANDAS_KEY).is_some_and(|note| has_unnamed_index(note))
        && !stored.iter().any(|field| field.name() == TIME);
    let mut known = BTreeSet::new();
    let field = |stored: &TypePtr| {
        let facts = facts.remove(stored.name());
        let is_time = || kind_of(stored, facts.as_ref()).is_ok_and(|(_, kind)| kind.is_time());
        let is_index = has_index && stored.name() == UNNAMED_INDEX && is_time();
        let name = if is_index { TIME } else { stored.name() }.to_owned();
        match known.insert(name.clone()) {
            true => {
                let place = places.get(stored.name()).copied();
                Ok(Field { name, stored: stored.clone(), place, facts })
            }
            false => Err(ContentError::duplicate(&name)),
        }
    };
    stored.iter().map(field).collect()
}

/// Whether the pandas metadata names an unnamed index.
fn has_unnamed_index(note: &str) -> bool {
    let note: Value = serde_json::from_str(note).unwrap_or_default();
    let columns = note["index_columns"].as_array();
    columns.is_some_and(|columns| columns.iter().any(|column| column == UNNAMED_INDEX))
}

/// Selects the fields to read.
fn chosen<'f>(fields: &'f [Field], choice: Choice) -> Result<Vec<&'f Field>, TableError> {
    Ok(match choice {
        Choice::All => fields.iter().collect(),
        Choice::Usable(is_wanted) => fields.iter().filter(|field| is_wanted(&field.name)).collect(),
        Choice::Named(names) => {
            let known = || fields.iter().map(|field| field.name.as_str());
            let places: HashMap<&str, &Field> = known().zip(fields).collect();
            let find = |name: &&str| {
                places.get(name).copied().ok_or_else(|| unknown_column(name, known()))
            };
            names.iter().map(find).collect::<Result<_, _>>()?
        }
    })
}

impl Field {
    /// Describes how to read the field.
    fn source(&self, file: &ParquetMetaData) -> Result<ColumnSource, ContentError> {
        let (kind, meaning) = kind_of(&self.stored, self.facts.as_ref())?;
        let place = self.place.ok_or_else(ContentError::unreadable)?;
        let chunks: Vec<&ColumnChunkMetaData> =
            file.row_groups().iter().filter_map(|group| group.columns().get(place)).collect();
        chunks.iter().try_for_each(|chunk| require_known_codec(chunk, &self.name))?;
        let has_gap = |chunk: &&ColumnChunkMetaData| {
            chunk.statistics().and_then(|known| known.null_count_opt()).is_some_and(|gaps| gaps > 0)
        };
        let kind = match kind {
            ColumnKind::Integer | ColumnKind::Unsigned | ColumnKind::Flag
                if chunks.iter().any(has_gap) =>
            {
                ColumnKind::Float
            }
            kind => kind,
        };
        let shares = |chunk: &&ColumnChunkMetaData| {
            chunk.encodings().any(|encoding| encoding == Encoding::DELTA_BYTE_ARRAY)
        };
        let texts_at_once = if chunks.iter().any(shares) { 1 } else { TEXTS_AT_ONCE };
        Ok(ColumnSource { name: self.name.clone(), place, kind, meaning, texts_at_once })
    }
}

fn require_known_codec(chunk: &ColumnChunkMetaData, column: &str) -> Result<(), ContentError> {
    use Compression as Codec;
    match chunk.compression() {
        Codec::UNCOMPRESSED | Codec::SNAPPY | Codec::LZ4 | Codec::LZ4_RAW => Ok(()),
        Codec::GZIP(_) | Codec::ZSTD(_) => Ok(()),
        codec => Err(ContentError::Unusable(format!(
            "column '{column}' is compressed with {codec}; known are Snappy, gzip, LZ4, Zstandard and none: write the \
             file with one of these"
        ))),
    }
}

/// Calls the Parquet library and turns a panic into an error. Damaged lengths and offsets in a file can cause one (seen
/// with version 60.1). The caller does not use the affected objects again.
fn guarded<T>(call: impl FnOnce() -> Result<T, ContentError>) -> Result<T, ContentError> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|_| Err(ContentError::unreadable()))
}

fn parquet_error(path: &Path, error: ParquetError) -> TableError {
    content_error(path, error.into())
}

/// The error for a file's content, or the operating system's error inside it.
fn content_error(path: &Path, problem: ContentError) -> TableError {
    let path = path.to_path_buf();
    match problem {
        ContentError::Damaged(ParquetError::External(cause)) => match cause.downcast() {
            Ok(cause) => TableError::File(FileError::from_io(&path, *cause)),
            Err(cause) => {
                let problem = ContentError::Damaged(ParquetError::External(cause));
                TableError::Content { path, problem }
            }
        },
        problem => TableError::Content { path, problem },
    }
}
