//! Numbers from and to NumPy, through its array interface: no copy on the way out.

use crate::errors::Failure;
use crate::table;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use servotwin::table::Values;
use std::sync::Arc;

/// Where numbers live that an array shows.
enum Owner {
    /// A column of a table, shared with others: read only.
    Column(Arc<servotwin::table::Table>, usize),
    /// Numbers of its own, row by row.
    Own(Vec<f64>),
    /// Whole numbers of its own.
    Places(Vec<i64>),
}

/// What `numpy.asarray` looks into; it keeps the numbers alive.
#[pyclass(frozen, module = "servotwin._servotwin")]
pub struct Numbers {
    owner: Owner,
    shape: Vec<usize>,
}

#[pymethods]
impl Numbers {
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (kind, address, shared) = match &self.owner {
            Owner::Own(values) => ("f8", values.as_ptr() as usize, false),
            Owner::Places(values) => ("i8", values.as_ptr() as usize, false),
            Owner::Column(table, column) => match &table.columns()[*column].values {
                Values::Float(values) => ("f8", values.as_ptr() as usize, true),
                Values::Integer(values) => ("i8", values.as_ptr() as usize, true),
                Values::Unsigned(values) => ("u4", values.as_ptr() as usize, true),
                Values::Flag(values) => ("b1", values.as_ptr() as usize, true),
                Values::Text(_) => return Err(Failure::value("texts are no numbers").into()),
            },
        };
        let order = match kind {
            "b1" => "|",
            _ if cfg!(target_endian = "big") => ">",
            _ => "<",
        };
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("shape", PyTuple::new(py, &self.shape)?)?;
        interface.set_item("typestr", format!("{order}{kind}"))?;
        interface.set_item("data", (address, shared))?;
        Ok(interface)
    }
}

fn as_array<'py>(py: Python<'py>, numbers: Numbers) -> PyResult<Bound<'py, PyAny>> {
    py.import("numpy")?.call_method1("asarray", (Bound::new(py, numbers)?,))
}

/// A column of a table, which the array keeps alive; texts become an array of objects.
pub fn column<'py>(
    py: Python<'py>,
    table: &Arc<servotwin::table::Table>,
    column: usize,
) -> PyResult<Bound<'py, PyAny>> {
    if let Values::Text(values) = &table.columns()[column].values {
        let options = PyDict::new(py);
        options.set_item("dtype", "object")?;
        return py.import("numpy")?.call_method("array", (values,), Some(&options));
    }
    let shape = vec![table.row_count()];
    as_array(py, Numbers { owner: Owner::Column(table.clone(), column), shape })
}

/// Numbers in a shape, row by row.
pub fn own(py: Python<'_>, values: Vec<f64>, shape: Vec<usize>) -> PyResult<Bound<'_, PyAny>> {
    assert_eq!(values.len(), shape.iter().product::<usize>(), "as many numbers as the shape has");
    as_array(py, Numbers { owner: Owner::Own(values), shape })
}

/// Whole numbers.
pub fn places(py: Python<'_>, values: Vec<i64>) -> PyResult<Bound<'_, PyAny>> {
    let shape = vec![values.len()];
    as_array(py, Numbers { owner: Owner::Places(values), shape })
}

/// The numbers of anything that NumPy takes for an array of numbers, row by row, and its shape.
///
/// # Errors
/// It is none.
pub fn numbers(values: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let (array, address, shape) = interface(values, "float64")?;
    let count = shape.iter().product();
    let mut copy = vec![0.0; count];
    if count > 0 {
        // SAFETY: NumPy has just made the array contiguous, of this type and shape, and `array`
        // keeps it alive; the interpreter's lock is held.
        unsafe { std::ptr::copy_nonoverlapping(address as *const f64, copy.as_mut_ptr(), count) };
    }
    drop(array);
    Ok((copy, shape))
}

/// The same of whole numbers.
///
/// # Errors
/// It is no array of whole numbers.
pub fn whole_numbers(values: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    let (array, address, shape) = interface(values, "int64")?;
    let count = shape.iter().product();
    let mut copy = vec![0; count];
    if count > 0 {
        // SAFETY: as in `numbers`.
        unsafe { std::ptr::copy_nonoverlapping(address as *const i64, copy.as_mut_ptr(), count) };
    }
    drop(array);
    Ok(copy)
}

/// A contiguous array of a type, with its address and shape.
fn interface<'py>(
    values: &Bound<'py, PyAny>,
    kind: &str,
) -> PyResult<(Bound<'py, PyAny>, usize, Vec<usize>)> {
    let numpy = values.py().import("numpy")?;
    let array = numpy.call_method1("ascontiguousarray", (values, kind))?;
    let interface = array.getattr("__array_interface__")?;
    let (address, _): (usize, bool) = interface.get_item("data")?.extract()?;
    let shape = array.getattr("shape")?.extract()?;
    Ok((array, address, shape))
}

/// A column's values from anything that NumPy takes for an array.
///
/// # Errors
/// It has more than one dimension, or holds neither numbers nor truth values nor texts.
pub fn values(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Values> {
    let array = given.py().import("numpy")?.call_method1("asarray", (given,))?;
    let dimensions: usize = array.getattr("ndim")?.extract()?;
    if dimensions != 1 {
        let text = format!("column '{name}' has {dimensions} dimensions, but must have one");
        return Err(Failure::value(text).into());
    }
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    let size: usize = dtype.getattr("itemsize")?.extract()?;
    Ok(match (kind.as_str(), size) {
        ("f", _) => Values::Float(numbers(&array)?.0),
        ("u", 1..=4) => {
            let values = whole_numbers(&array)?;
            Values::Unsigned(values.into_iter().map(|value| value as u32).collect())
        }
        ("i" | "u", _) => Values::Integer(whole_numbers(&array)?),
        ("b", _) => Values::Flag(array.call_method0("tolist")?.extract()?),
        _ => Values::Text(array.call_method0("tolist")?.extract().map_err(|_| {
            Failure::value(format!("column '{name}' holds neither numbers nor texts only"))
        })?),
    })
}

/// A table whose columns are shown.
pub type Shared = Arc<servotwin::table::Table>;

impl From<servotwin::table::Table> for table::Table {
    fn from(table: servotwin::table::Table) -> Self {
        table::Table::new(table, None)
    }
}
