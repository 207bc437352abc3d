//! The Python module of servotwin: one file per class, over the toolkit's own types.
//!
//! Numbers go to Python without copies (`array`, `arrow`); whatever takes long runs beside the
//! interpreter and listens to Ctrl-C (`long`); errors keep their file, line and range (`errors`).

mod array;
mod arrow;
mod errors;
mod long;
mod simulate;
mod system;
mod table;
mod twin;

use pyo3::prelude::*;

/// The compiled part of the package `servotwin`.
#[pymodule]
fn _servotwin(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<system::System>()?;
    module.add_class::<table::Table>()?;
    module.add_class::<twin::Twin>()?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate_many, module)?)
}
