//! Numbers from and to NumPy, through its array interface: no copy on the way out.

use crate::errors::Failure;
use crate::table;
use pyo3::exceptions::PyOverflowError;
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
pub(crate) struct Numbers {
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
pub(crate) fn column<'py>(
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
pub(crate) fn own(
    py: Python<'_>,
    values: Vec<f64>,
    shape: Vec<usize>,
) -> PyResult<Bound<'_, PyAny>> {
    assert_eq!(values.len(), shape.iter().product::<usize>(), "as many numbers as the shape has");
    as_array(py, Numbers { owner: Owner::Own(values), shape })
}

/// Whole numbers.
pub(crate) fn places(py: Python<'_>, values: Vec<i64>) -> PyResult<Bound<'_, PyAny>> {
    let shape = vec![values.len()];
    as_array(py, Numbers { owner: Owner::Places(values), shape })
}

/// A number of Python's, also if it is too large for any float.
///
/// # Errors
/// It is no number, or too large.
pub(crate) fn real(given: &Bound<'_, PyAny>) -> PyResult<f64> {
    given.extract().map_err(|error| too_large(given, error))
}

/// The same of a number that may be None.
pub(crate) fn real_or_none(given: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    if given.is_none() { Ok(None) } else { Ok(Some(real(given)?)) }
}

/// The same of several numbers.
pub(crate) fn reals(given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    given.extract().map_err(|error| too_large(given, error))
}

/// A whole number from 0, or None.
///
/// # Errors
/// It is negative or too large, or no whole number.
pub(crate) fn count_or_none(given: &Bound<'_, PyAny>) -> PyResult<Option<u64>> {
    given.extract().map_err(|error| too_large(given, error))
}

/// As [`count_or_none`], for a number of threads.
pub(crate) fn threads_or_none(given: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    Ok(count_or_none(given)?.map(|count| count as usize))
}

/// An overflow as an error of this package.
fn too_large(given: &Bound<'_, PyAny>, error: PyErr) -> PyErr {
    match error.is_instance_of::<PyOverflowError>(given.py()) {
        true => Failure::value(error.value(given.py())).into(),
        false => error,
    }
}

/// What NumPy takes for an array, without a mask: a masked number is a missing one, NaN.
fn unmasked<'py>(given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = given.py().import("numpy")?;
    let masks = numpy.getattr("ma")?;
    if !masks.call_method1("isMaskedArray", (given,))?.extract::<bool>()? {
        return numpy.call_method1("asarray", (given,));
    }
    if !masks.call_method1("is_masked", (given,))?.extract::<bool>()? {
        return given.getattr("data");
    }
    match kind_of(given)?.as_str() {
        "f" | "i" | "u" => {
            given.call_method1("astype", ("float64",))?.call_method1("filled", (f64::NAN,))
        }
        _ => Err(Failure::value("only numbers can be masked").into()),
    }
}

/// NumPy's letter for the kind of an array's elements.
fn kind_of(array: &Bound<'_, PyAny>) -> PyResult<String> {
    array.getattr("dtype")?.getattr("kind")?.extract()
}

/// The numbers of anything that NumPy takes for an array of numbers, row by row, and its shape.
///
/// # Errors
/// It is none.
pub(crate) fn numbers(values: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
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
pub(crate) fn whole_numbers(values: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
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
    let given = unmasked(values)?;
    if kind_of(&given)? == "c" {
        return Err(Failure::value("complex numbers are no real ones").into());
    }
    let array = numpy.call_method1("ascontiguousarray", (&given, kind));
    let array = array.map_err(|error| too_large(values, error))?;
    let interface = array.getattr("__array_interface__")?;
    let (address, _): (usize, bool) = interface.get_item("data")?.extract()?;
    let shape = array.getattr("shape")?.extract()?;
    Ok((array, address, shape))
}

/// A column's values from anything that NumPy takes for an array.
///
/// # Errors
/// It has more than one dimension, or holds neither numbers nor truth values nor texts.
pub(crate) fn values(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Values> {
    let array = unmasked(given)?;
    let dimensions: usize = array.getattr("ndim")?.extract()?;
    if dimensions != 1 {
        let text = format!("column '{name}' has {dimensions} dimensions, but must have one");
        return Err(Failure::value(text).into());
    }
    let size: usize = array.getattr("itemsize")?.extract()?;
    let wrong = |problem: &str| Failure::value(format!("column '{name}' {problem}"));
    Ok(match (kind_of(&array)?.as_str(), size) {
        ("f", _) => {
            let values = numbers(&array)?.0;
            let isinf = given.py().import("numpy")?.call_method1("isinf", (&array,))?;
            let infinite: usize = isinf.call_method0("sum")?.extract()?;
            if values.iter().filter(|value| value.is_infinite()).count() != infinite {
                return Err(wrong("has numbers beyond those of 64 bits").into());
            }
            Values::Float(values)
        }
        ("u", 1..=4) => {
            let values = whole_numbers(&array)?;
            Values::Unsigned(values.into_iter().map(|value| value as u32).collect())
        }
        ("u", _) if whole_numbers(&array)?.iter().any(|value| *value < 0) => {
            return Err(wrong("has whole numbers that do not fit in 63 bits").into());
        }
        ("i" | "u", _) => Values::Integer(whole_numbers(&array)?),
        ("b", _) => Values::Flag(array.call_method0("tolist")?.extract()?),
        ("M" | "m", _) => {
            return Err(wrong("holds dates or durations, but must hold numbers, such as s").into());
        }
        _ => Values::Text(
            (array.call_method0("tolist")?.extract())
                .map_err(|_| wrong("holds neither numbers nor texts only"))?,
        ),
    })
}

/// A table whose columns are shown.
pub(crate) type Shared = Arc<servotwin::table::Table>;

impl From<servotwin::table::Table> for table::Table {
    fn from(table: servotwin::table::Table) -> Self {
        table::Table::new(table, None)
    }
}
