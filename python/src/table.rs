//! `Table`: named columns with units, as NumPy arrays and as Arrow without copies.

use crate::errors::Failure;
use crate::{array, arrow};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyList, PyTuple};
use servotwin::recording::{self, Recorded};
use servotwin::table::{self as tables, Column, ColumnKind, Values};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// What a run's figure shows.
pub(crate) struct Drawing {
    /// The title.
    pub(crate) title: String,
    /// The columns after the time.
    pub(crate) recorded: Vec<Recorded>,
}

/// Named columns of one length with their units.
///
/// `table[name]` is a NumPy array that shares the table's memory. pandas, Polars, pyarrow and DuckDB
/// read a table through the Arrow C interface, without copies.
///
/// Parameters
/// ----------
/// columns : mapping
///     Arrays by name, such as a dict or a data frame of pandas, Polars or pyarrow. A masked number becomes NaN.
/// units : dict of str, optional
///     The units of the columns.
/// metadata : dict of str, optional
///     Notes about the whole table.
#[pyclass(frozen, module = "servotwin", mapping)]
pub(crate) struct Table {
    /// The columns.
    pub(crate) inner: array::Shared,
    drawing: Option<Arc<Drawing>>,
}

impl Table {
    /// A table; with a drawing where it is a run.
    pub(crate) fn new(table: tables::Table, drawing: Option<Drawing>) -> Self {
        Table { inner: Arc::new(table), drawing: drawing.map(Arc::new) }
    }

    fn place(&self, name: &str) -> Result<usize, Failure> {
        let known = || self.inner.names().map(str::to_owned).collect();
        let unknown = || Failure::no_column(name, known());
        self.inner.place(name).ok_or_else(unknown)
    }
}

/// A table of columns with different names and one length.
pub(crate) fn table_of(columns: Vec<Column>) -> Table {
    tables::Table::from_columns(columns).expect("different names, one length").into()
}

/// The names of the columns of a mapping, or of a frame of Polars or pyarrow.
fn names_of<'py>(columns: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    if let Some(keys) = columns.getattr_opt("keys")? {
        return keys.call0();
    }
    for names in ["column_names", "columns"] {
        if let Some(names) = columns.getattr_opt(names)? {
            return Ok(names);
        }
    }
    Err(Failure::value("a table is made of arrays by name, such as a dict or a data frame").into())
}

/// A column as it is pickled: name, unit and description, kind, values.
type Part<'py> = (String, (String, String), String, Bound<'py, PyAny>);

#[pymethods]
impl Table {
    #[new]
    #[pyo3(signature = (columns, units = None, metadata = None))]
    fn make(
        columns: &Bound<'_, PyAny>,
        units: Option<BTreeMap<String, String>>,
        metadata: Option<BTreeMap<String, String>>,
    ) -> PyResult<Self> {
        let units = units.unwrap_or_default();
        let mut table = tables::Table::new();
        table.metadata = metadata.unwrap_or_default();
        for name in names_of(columns)?.try_iter()? {
            let name: String = name?.extract()?;
            let values = array::values(&name, &columns.get_item(&name)?)?;
            let unit = units.get(&name).cloned().unwrap_or_default();
            table.push(Column::new(name, unit, values)).map_err(Failure::from)?;
        }
        Ok(table.into())
    }

    /// Read a table.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     A `.parquet` or `.csv` file.
    ///
    /// Returns
    /// -------
    /// Table
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let table = py.detach(|| tables::Table::read(path)).map_err(Failure::from)?;
        Ok(table.into())
    }

    /// Write the table, whole or not at all.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     A `.parquet` or `.csv` file.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        Ok(py.detach(|| self.inner.write(path)).map_err(Failure::from)?)
    }

    /// The names of the columns.
    #[getter]
    fn columns(&self) -> Vec<&str> {
        self.inner.names().collect()
    }

    /// The SI unit of every column; empty for texts, truth values, and numbers of which no unit is known.
    #[getter]
    fn units(&self) -> BTreeMap<&str, &str> {
        self.inner.columns().iter().map(|c| (c.name.as_str(), c.unit.as_str())).collect()
    }

    /// A sentence about every column; empty where the file has none.
    #[getter]
    fn descriptions(&self) -> BTreeMap<&str, &str> {
        self.inner.columns().iter().map(|c| (c.name.as_str(), c.description.as_str())).collect()
    }

    /// Notes about the whole table.
    #[getter]
    fn metadata(&self) -> BTreeMap<String, String> {
        self.inner.metadata.clone()
    }

    /// The number of rows.
    #[getter]
    fn num_rows(&self) -> usize {
        self.inner.row_count()
    }

    /// The names of the columns, as a mapping has them.
    fn keys(&self) -> Vec<&str> {
        self.columns()
    }

    fn __len__(&self) -> usize {
        self.inner.row_count()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(PyList::new(py, self.columns())?.try_iter()?.into_any())
    }

    fn __contains__(&self, name: &str) -> bool {
        self.inner.has(name)
    }

    /// A column as a NumPy array that shares the table's memory.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        array::column(py, &self.inner, self.place(name)?)
    }

    /// A table is no single array: without this, NumPy and pandas would take it for the list of its names.
    #[pyo3(signature = (*_arguments, **_options))]
    fn __array__(
        &self,
        _arguments: &Bound<'_, PyTuple>,
        _options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let text = "a table is no array: table[name] is one, and table.to_pandas() is a data frame";
        Err(Failure::value(text).into())
    }

    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The interface allows to answer with the types there are.
        let _ = requested_schema;
        arrow::stream(py, &self.inner)
    }

    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_array__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyCapsule>, Bound<'py, PyCapsule>)> {
        let _ = requested_schema;
        arrow::array(py, &self.inner)
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        arrow::schema(py, &self.inner)
    }

    /// Return a pandas data frame.
    ///
    /// Returns
    /// -------
    /// pandas.DataFrame
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let columns = PyDict::new(py);
        for (place, name) in self.inner.names().enumerate() {
            columns.set_item(name, array::column(py, &self.inner, place)?)?;
        }
        let options = PyDict::new(py);
        options.set_item("copy", false)?;
        py.import("pandas")?.call_method("DataFrame", (columns,), Some(&options))
    }

    /// Return a Polars data frame.
    ///
    /// Returns
    /// -------
    /// polars.DataFrame
    fn to_polars<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("polars")?.call_method1("DataFrame", (slf,))
    }

    /// Return a pyarrow table.
    ///
    /// Returns
    /// -------
    /// pyarrow.Table
    fn to_arrow<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("pyarrow")?.call_method1("table", (slf,))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Table>().is_ok_and(|other| other.get().inner == self.inner)
    }

    fn __hash__(&self) -> usize {
        Arc::as_ptr(&self.inner) as usize
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = (self.inner.row_count(), self.inner.columns().len());
        let shown: Vec<&str> = self.inner.names().take(6).collect();
        let more = if columns > shown.len() { ", …" } else { "" };
        format!("Table({rows} rows, {columns} columns: {}{more})", shown.join(", "))
    }

    /// The curves of a run; nothing for other tables.
    fn _repr_svg_(&self) -> Option<String> {
        let drawing = self.drawing.as_ref()?;
        let float = |column: &'_ Column| match &column.values {
            Values::Float(values) => Some(values.clone()),
            _ => None,
        };
        let columns: Option<Vec<Vec<f64>>> = self.inner.columns().iter().map(float).collect();
        let columns = columns?;
        let values: Vec<&[f64]> = columns[1..].iter().map(Vec::as_slice).collect();
        let figure = recording::figure(&drawing.title, &drawing.recorded, &columns[0], &values);
        Some(figure.draw().svg)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let inner = &slf.get().inner;
        let part = |(place, column): (usize, &Column)| -> PyResult<Part<'py>> {
            let kind = match column.values.kind() {
                ColumnKind::Unsigned => "unsigned",
                ColumnKind::Text => "text",
                _ => "as it is",
            };
            let values = array::column(py, inner, place)?;
            let facts = (column.unit.clone(), column.description.clone());
            Ok((column.name.clone(), facts, kind.into(), values))
        };
        let parts = inner.columns().iter().enumerate().map(part).collect::<PyResult<Vec<_>>>()?;
        let make = py.get_type::<Table>().getattr("_from_parts")?;
        let arguments = (parts, inner.metadata.clone());
        Ok((make, arguments).into_pyobject(py)?.into_any())
    }

    /// Called by `pickle`.
    #[staticmethod]
    fn _from_parts(parts: Vec<Part<'_>>, metadata: BTreeMap<String, String>) -> PyResult<Self> {
        let mut table = tables::Table::new();
        table.metadata = metadata;
        for (name, (unit, description), kind, given) in parts {
            let values = match kind.as_str() {
                "text" => Values::Text(given.call_method0("tolist")?.extract()?),
                _ => array::values(&name, &given)?,
            };
            let column = Column::new(name, unit, values).described(description);
            table.push(column).map_err(Failure::from)?;
        }
        Ok(table.into())
    }
}
