//! Classifiers: what the estimators of `servotwin.estimators` are made of, and trees as data.

use crate::array;
use crate::errors::Failure;
use crate::long::long;
use crate::table::{Table, table_of};
use pyo3::prelude::*;
use servotwin::learn::model_file;
use servotwin::table::Column;
use servotwin::view::tree::TreeFigure as Drawing;
use servotwin_diagnosis::Error;
use servotwin_diagnosis::classifiers::{Classifier, Model as Trained, Scores};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_diagnosis::tree::Tree as Inner;
use servotwin_learning::Samples;
use servotwin_learning::classifiers::{Fit, Settings};
use servotwin_report::stages;
use std::path::PathBuf;
use std::sync::Arc;

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure::value(error)
    }
}

/// A trained classifier.
#[pyclass(frozen, module = "servotwin._servotwin")]
pub(crate) struct Model {
    inner: Arc<Trained>,
}

/// Trains a classifier: settings as JSON, rows of features, places of classes, weights.
#[pyfunction]
#[pyo3(signature = (settings, features, rows, classes, labels, weights = None))]
pub(crate) fn fit(
    py: Python<'_>,
    settings: &str,
    features: Vec<String>,
    rows: &Bound<'_, PyAny>,
    classes: Vec<String>,
    labels: &Bound<'_, PyAny>,
    weights: Option<&Bound<'_, PyAny>>,
) -> PyResult<Model> {
    let settings: Settings = serde_json::from_str(settings).map_err(Failure::value)?;
    let (values, _) = array::numbers(rows)?;
    let labels = array::whole_numbers(labels)?;
    let weights = weights.map(|weights| array::numbers(weights)).transpose()?;
    let model = long(py, None, |_| -> Result<Trained, Failure> {
        let labels: Vec<u32> = labels.iter().map(|&label| label as u32).collect();
        let (count, width) = (labels.len(), features.len());
        if values.len() != count * width {
            let text = format!("{} values are not {count} rows of {width}", values.len());
            return Err(Failure::value(text));
        }
        let column = |column: usize| values.iter().skip(column).step_by(width.max(1));
        let columns = (0..width).flat_map(column).copied().collect();
        let mut samples = Samples::with_missing(features, classes, columns, labels)?;
        if let Some((weights, _)) = weights {
            samples = samples.with_weights(weights)?;
        }
        Ok(settings.fit(&samples)?)
    })??;
    Ok(Model { inner: Arc::new(model) })
}

#[pymethods]
impl Model {
    /// One score per class and row: shares that sum to one, or margins.
    fn scores<'py>(
        &self,
        py: Python<'py>,
        rows: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (values, shape) = array::numbers(rows)?;
        let (width, classes) = (self.inner.features(), self.inner.classes());
        if shape.len() != 2 || shape[1] != width {
            let text = format!("rows have the shape {shape:?}, but must have {width} columns");
            return Err(Failure::value(text).into());
        }
        let scores = py.detach(|| {
            let mut scores = vec![0.0; shape[0] * classes];
            let rows = values.chunks_exact(width).zip(scores.chunks_exact_mut(classes));
            rows.for_each(|(row, scores)| self.inner.scores_into(row, scores));
            scores
        });
        array::own(py, scores, vec![shape[0], classes])
    }

    /// The place of the class of every row.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        rows: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (values, shape) = array::numbers(rows)?;
        let width = self.inner.features();
        if shape.len() != 2 || shape[1] != width {
            let text = format!("rows have the shape {shape:?}, but must have {width} columns");
            return Err(Failure::value(text).into());
        }
        let said = py.detach(|| {
            let mut scratch = vec![0.0; self.inner.classes()];
            let mut say = |row| i64::from(self.inner.predict_with(row, &mut scratch));
            values.chunks_exact(width).map(&mut say).collect()
        });
        array::places(py, said)
    }

    /// Whether scores are shares.
    #[getter]
    fn gives_shares(&self) -> bool {
        self.inner.scores() == Scores::Shares
    }

    /// The tree, where it is one.
    fn tree(&self, features: Vec<String>, classes: Vec<String>) -> Option<Tree> {
        match &*self.inner {
            Trained::Cart(tree) => Some(Tree { inner: tree.clone(), features, classes }),
            _ => None,
        }
    }

    /// As JSON.
    fn to_json(&self) -> String {
        serde_json::to_string(&*self.inner).expect("a model is JSON")
    }

    /// From JSON.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let inner: Trained = serde_json::from_str(text).map_err(Failure::value)?;
        inner.check().map_err(Failure::from)?;
        Ok(Model { inner: Arc::new(inner) })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let make = slf.py().get_type::<Model>().getattr("from_json")?;
        Ok((make, (slf.get().to_json(),)).into_pyobject(slf.py())?.into_any())
    }
}

/// A decision tree as data, which a notebook draws.
///
/// `Results.trees` and `servotwin.trees` return trees of a study, `CartClassifier.tree_` that of a
/// classifier.
#[pyclass(frozen, module = "servotwin")]
pub(crate) struct Tree {
    inner: Inner,
    features: Vec<String>,
    classes: Vec<String>,
}

/// The trees of a diagnoser's first window, by the names of their stages.
#[pyfunction]
pub(crate) fn read_trees(py: Python<'_>, path: PathBuf) -> PyResult<Vec<(String, Tree)>> {
    let diagnoser = py.detach(|| model_file::read_diagnoser(path)).map_err(Failure::from)?;
    Ok(stage_trees(&diagnoser.lengths[0].panel.trees))
}

/// The trees of a hierarchy, by the names of their stages.
pub(crate) fn stage_trees(hierarchy: &Hierarchy) -> Vec<(String, Tree)> {
    let names = &hierarchy.names;
    let trees = hierarchy.stages.iter().filter_map(|stage| {
        let Trained::Cart(tree) = &stage.model else { return None };
        let features = stage.columns.iter().map(|&c| names.features[c as usize].clone()).collect();
        let class = |&class: &u32| names.class_name(stage.place.question, class).to_owned();
        let classes = stage.classes.iter().map(class).collect();
        Some((stage.id.clone(), Tree { inner: tree.clone(), features, classes }))
    });
    trees.collect()
}

#[pymethods]
impl Tree {
    /// The names of the features.
    #[getter]
    fn features(&self) -> Vec<String> {
        self.features.clone()
    }

    /// The names of the classes.
    #[getter]
    fn classes(&self) -> Vec<String> {
        self.classes.clone()
    }

    /// The largest number of questions above a leaf.
    #[getter]
    fn depth(&self) -> usize {
        self.inner.depth()
    }

    /// One row per node: its question, the nodes below it, and its decision. A leaf has an empty
    /// `feature`, and -1 in `left` and `right`.
    #[getter]
    fn nodes(&self) -> Table {
        let tree = &self.inner;
        let all = || 0..tree.nodes();
        let split = |node| tree.split(node);
        let child = |node: usize, of: fn((usize, usize)) -> usize| {
            tree.children(node).map_or(-1, |children| of(children) as i64)
        };
        let class = |node: usize| self.classes[tree.decision(node) as usize].clone();
        let feature = |node| split(node).map_or(String::new(), |(f, _)| self.features[f].clone());
        let rows = |node: usize| i64::from(tree.counts(node).iter().sum::<u32>());
        table_of(vec![
            Column::of("node", "", all(), |node| node as i64),
            Column::of("depth", "", all(), |node| tree.node_depth(node) as i64),
            Column::of("feature", "", all(), feature),
            Column::of("threshold", "", all(), |node| split(node).map_or(f64::NAN, |(_, t)| t)),
            Column::of("left", "", all(), |node| child(node, |(left, _)| left)),
            Column::of("right", "", all(), |node| child(node, |(_, right)| right)),
            Column::of("class", "", all(), class),
            Column::of("purity", "", all(), |node| tree.purity(node)),
            Column::of("impurity", "", all(), |node| tree.impurity(node)),
            Column::of("rows", "", all(), rows),
        ])
    }

    /// The share of each feature in the decrease of impurity.
    #[getter]
    fn importances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let shares = self.inner.importances();
        let shape = vec![shares.len()];
        array::own(py, shares, shape)
    }

    fn __str__(&self) -> String {
        self.inner.text(&self.features, &self.classes)
    }

    fn __repr__(&self) -> String {
        format!("Tree({} nodes, depth {})", self.inner.nodes(), self.inner.depth())
    }

    fn _repr_svg_(&self) -> String {
        let drawing = Drawing {
            title: String::new(),
            classes: self.classes.clone(),
            root: stages::nodes(&self.inner, &self.features, &self.classes, &[]),
            looks: vec![],
        };
        drawing.draw().svg
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let make = slf.py().get_type::<Tree>().getattr("_from_json")?;
        let Tree { inner, features, classes } = slf.get();
        let text = serde_json::to_string(inner).expect("a tree is JSON");
        let arguments = (text, features.clone(), classes.clone());
        Ok((make, arguments).into_pyobject(slf.py())?.into_any())
    }

    /// Called by `pickle`.
    #[staticmethod]
    fn _from_json(text: &str, features: Vec<String>, classes: Vec<String>) -> PyResult<Self> {
        let inner: Inner = serde_json::from_str(text).map_err(Failure::value)?;
        inner.check().map_err(Failure::from)?;
        if inner.features() > features.len() || inner.classes() > classes.len() {
            return Err(Failure::value("the tree has more features or classes than names").into());
        }
        Ok(Tree { inner, features, classes })
    }
}
