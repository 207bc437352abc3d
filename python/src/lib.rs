//! The Python module of servotwin: one file per class, over the toolkit's own types.
//!
//! Numbers go to Python without copies (`array`, `arrow`); whatever takes long runs beside the
//! interpreter and listens to Ctrl-C (`long`); errors keep their file, line and range (`errors`).

mod array;
mod arrow;
mod diagnoser;
mod errors;
mod long;
mod model;
mod record;
mod results;
mod simulate;
mod study;
mod system;
mod table;
mod tasks;
mod twin;

use pyo3::prelude::*;

/// The compiled part of the package `servotwin`.
#[pymodule]
fn _servotwin(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    // From any thread, with or without the interpreter's lock.
    servotwin::compiled::report_problems(|problem| eprintln!("warning: {problem}"));
    module.add_class::<system::System>()?;
    module.add_class::<table::Table>()?;
    module.add_class::<twin::Twin>()?;
    module.add_class::<study::Study>()?;
    module.add_class::<results::Results>()?;
    module.add_class::<record::Fitted>()?;
    module.add_class::<diagnoser::Diagnoser>()?;
    module.add_class::<diagnoser::Outcome>()?;
    module.add_class::<model::Model>()?;
    module.add_class::<model::Tree>()?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate_many, module)?)?;
    module.add_function(wrap_pyfunction!(results::run_study, module)?)?;
    module.add_function(wrap_pyfunction!(record::watch, module)?)?;
    module.add_function(wrap_pyfunction!(record::fit_record, module)?)?;
    module.add_function(wrap_pyfunction!(study::write_report, module)?)?;
    module.add_function(wrap_pyfunction!(study::data_set, module)?)?;
    module.add_function(wrap_pyfunction!(study::feature_columns, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::run_suites, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::tasks_of, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::run_task, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::prepare_file, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::join_suites, module)?)?;
    module.add_function(wrap_pyfunction!(model::fit, module)?)?;
    module.add_function(wrap_pyfunction!(model::read_trees, module)?)
}
