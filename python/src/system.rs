//! `System`: a system file, checked and compiled.

use crate::errors::{Failure, Place};
use crate::table::{Table, table_of};
use pyo3::prelude::*;
use servotwin::rest;
use servotwin::system::System as Inner;
use servotwin::system::listing::fault_table;
use servotwin::table::Column;
use servotwin::toml_text::TomlError;
use servotwin::view::render;
use servotwin_model::spec::Unit;
use servotwin_report::{behavior, schematic};
use std::path::PathBuf;
use std::sync::Arc;

/// A system of components that can be simulated.
///
/// Parameters
/// ----------
/// path : path, optional
///     A system file, or the name of a built-in system; the aileron with two actuators by default.
///
/// Raises
/// ------
/// MistakesError
///     If the file has mistakes.
#[pyclass(frozen, module = "servotwin")]
pub(crate) struct System {
    /// The compiled system.
    pub(crate) inner: Arc<Inner>,
    /// The file, as it was named.
    path: String,
}

impl System {
    /// The system of a study.
    pub(crate) fn parsed(text: &str, path: &str) -> Result<Self, Failure> {
        let inner = Arc::new(Inner::parse(text, path)?);
        Ok(System { inner, path: path.into() })
    }
}

fn symbol(unit: Unit) -> String {
    unit.symbol().into()
}

#[pymethods]
impl System {
    #[new]
    #[pyo3(signature = (path = None))]
    fn new(py: Python<'_>, path: Option<PathBuf>) -> PyResult<Self> {
        match path {
            Some(path) => Self::load(py, path),
            None => {
                let inner = Arc::new(py.detach(Inner::default));
                Ok(System { inner, path: "systems/aileron_dual.toml".into() })
            }
        }
    }

    /// Read a system file, or a built-in system by its name.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     The file or the name.
    ///
    /// Returns
    /// -------
    /// System
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = || -> Result<Self, Failure> {
            let inner = Arc::new(Inner::read(&path)?);
            Ok(System { inner, path: path.display().to_string() })
        };
        Ok(py.detach(read)?)
    }

    /// Read a system from a text.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     The content of a system file.
    /// path : str
    ///     The name of the file in mistakes.
    ///
    /// Returns
    /// -------
    /// System
    #[staticmethod]
    #[pyo3(signature = (text, path = "system.toml"))]
    fn parse(py: Python<'_>, text: &str, path: &str) -> PyResult<Self> {
        Ok(py.detach(|| Self::parsed(text, path))?)
    }

    /// Return every mistake of a system file.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     The file.
    ///
    /// Returns
    /// -------
    /// list of Mistake
    ///     Empty if the file is right.
    #[staticmethod]
    fn check<'py>(py: Python<'py>, path: PathBuf) -> PyResult<Vec<Bound<'py, PyAny>>> {
        match py.detach(|| Inner::read(&path)) {
            Ok(_) => Ok(vec![]),
            Err(TomlError::File(error)) => Err(Failure::from(error).into()),
            Err(TomlError::Mistakes { path, mistakes }) => {
                mistakes.into_iter().map(|found| Place::new(&path, found).to_python(py)).collect()
            }
        }
    }

    /// The name in files and commands.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// One line for people.
    #[getter]
    fn title(&self) -> &str {
        &self.inner.title
    }

    /// The text of the file.
    #[getter]
    fn text(&self) -> &str {
        &self.inner.text
    }

    /// The components: id, kind and summary.
    #[getter]
    fn components(&self) -> Table {
        let lines = &self.inner.network().components;
        table_of(vec![
            Column::of("id", "", lines, |line| line.id.clone()),
            Column::of("kind", "", lines, |line| line.component.kind.to_owned()),
            Column::of("summary", "", lines, |line| line.component.summary.to_owned()),
        ])
    }

    /// Every parameter of every component with its value and allowed range, SI.
    #[getter]
    fn parameters(&self) -> Table {
        let components = self.inner.network().components.iter();
        let all = components.flat_map(|instance| {
            let declared = instance.component.parameters.iter().zip(&instance.parameters);
            declared.map(move |(declared, value)| (instance, declared, *value))
        });
        let lines: Vec<_> = all.collect();
        table_of(vec![
            Column::of("id", "", &lines, |(instance, declared, _)| {
                format!("{}.{}", instance.id, declared.name)
            }),
            Column::of("component", "", &lines, |(instance, _, _)| instance.id.clone()),
            Column::of("unit", "", &lines, |(_, declared, _)| symbol(declared.unit)),
            Column::of("value", "", &lines, |(_, _, value)| *value),
            Column::of("least", "", &lines, |(_, declared, _)| declared.min),
            Column::of("largest", "", &lines, |(_, declared, _)| declared.max),
            Column::of("summary", "", &lines, |(_, declared, _)| declared.summary.to_owned()),
        ])
    }

    /// Every fault that the components can have.
    #[getter]
    fn faults(&self) -> Table {
        fault_table(&self.inner.fault_list()).into()
    }

    /// The inputs with unit and default.
    #[getter]
    fn inputs(&self) -> Table {
        let lines = &self.inner.network().inputs;
        table_of(vec![
            Column::of("id", "", lines, |line| line.id.clone()),
            Column::of("unit", "", lines, |line| symbol(line.unit)),
            Column::of("default", "", lines, |line| line.default),
        ])
    }

    /// The sensors with unit and scale.
    #[getter]
    fn sensors(&self) -> Table {
        let lines = &self.inner.sensors;
        table_of(vec![
            Column::of("id", "", lines, |line| line.id.clone()),
            Column::of("label", "", lines, |line| line.label.clone()),
            Column::of("signal", "", lines, |line| line.signal.clone()),
            Column::of("unit", "", lines, |line| symbol(line.unit)),
            Column::of("scale", "", lines, |line| line.scale),
        ])
    }

    /// Describe the system at its steady state.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Components, states, inputs, sensors and eigenvalues, SI.
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = py.detach(|| -> Result<String, Failure> {
            Ok(render::json(&behavior::document(&self.inner, &rest::of(&self.inner)?)))
        })?;
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        let components = self.inner.network().components.len();
        let states = self.inner.program.states().len();
        format!("System('{}', {components} components, {states} states)", self.inner.name)
    }

    /// Components and connections.
    fn _repr_svg_(&self) -> String {
        schematic::of(&self.inner).draw().svg
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let make = slf.py().get_type::<System>().getattr("parse")?;
        let this = slf.get();
        Ok((make, (this.inner.text.clone(), this.path.clone())).into_pyobject(slf.py())?.into_any())
    }
}
