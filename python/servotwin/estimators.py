"""Classifiers with scikit-learn's interface: CART, committee and hierarchies.

They work in a `Pipeline`, in `cross_validate` and in `GridSearchCV`, and pass `check_estimator`.
This module needs scikit-learn.
"""

from __future__ import annotations

import json
from typing import Any, Optional

import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin, clone  # type: ignore[import-untyped, unused-ignore]
from sklearn.utils import check_random_state  # type: ignore[import-untyped, unused-ignore]
from sklearn.utils.multiclass import check_classification_targets  # type: ignore[import-untyped, unused-ignore]
from sklearn.utils.validation import check_is_fitted, validate_data  # type: ignore[import-untyped, unused-ignore]

from . import _servotwin as _native

__all__ = ["CartClassifier", "CommitteeClassifier", "HierarchyClassifier"]


def _weights(sample_weight: Any, X: Any) -> Any:
    """A weight for every row, not negative; None for none."""
    if sample_weight is None:
        return None
    # Not public, but what scikit-learn's own estimators call.
    from sklearn.utils.validation import _check_sample_weight

    return _check_sample_weight(sample_weight, X, dtype=np.float64, ensure_non_negative=True)


class _Estimator(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """The base of all classifiers: it checks rows and finds the classes."""

    _allows_missing = False
    _fitted = "model_"

    def _learn(self, X: Any, labels: Any, sample_weight: Any) -> None:
        """Learn from rows and the places of their classes in `classes_`."""
        raise NotImplementedError

    def _scores(self, rows: Any) -> Any:
        raise NotImplementedError

    def _labels(self, rows: Any) -> Any:
        """The place of each row's class in `classes_`."""
        raise NotImplementedError

    def _finite(self) -> Any:
        return "allow-nan" if self._allows_missing else True

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Any:
        """Learn from rows of features and their classes.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
            The features.
        y : array_like of shape (n_samples,)
            The classes.
        sample_weight : array_like of shape (n_samples,), optional
            The weights of the rows.

        Returns
        -------
        self
        """
        X, y = validate_data(self, X, y, dtype=np.float64, ensure_all_finite=self._finite())
        check_classification_targets(y)
        self.classes_, labels = np.unique(y, return_inverse=True)
        self._learn(X, labels, _weights(sample_weight, X))
        return self

    def _rows(self, X: Any) -> Any:
        check_is_fitted(self, self._fitted)
        return validate_data(
            self, X, reset=False, dtype=np.float64, ensure_all_finite=self._finite()
        )

    def predict_proba(self, X: Any) -> Any:
        """Return the probability of every class.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
            The features.

        Returns
        -------
        ndarray of shape (n_samples, n_classes)
            In the order of `classes_`.
        """
        return self._scores(self._rows(X))

    def predict(self, X: Any) -> Any:
        """Return the class of every row.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_features)
            The features.

        Returns
        -------
        ndarray of shape (n_samples,)
        """
        # Rows first: an estimator without fit has no classes.
        rows = self._rows(X)
        return self.classes_[self._labels(rows)]


class _Classifier(_Estimator):
    """The base of the compiled classifiers."""

    def _settings(self) -> dict[str, Any]:
        raise NotImplementedError

    def _learn(self, X: Any, labels: Any, sample_weight: Any) -> None:
        names = getattr(self, "feature_names_in_", None)
        if names is None:
            names = [f"x{k}" for k in range(self.n_features_in_)]
        self._names = [str(name) for name in names]
        self.model_ = _native.fit(
            json.dumps(self._settings()),
            self._names,
            X,
            [str(name) for name in self.classes_],
            labels,
            sample_weight,
        )

    def _scores(self, rows: Any) -> Any:
        return self.model_.scores(rows)

    def _labels(self, rows: Any) -> Any:
        return self.model_.predict(rows)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = self._allows_missing
        return tags


class CartClassifier(_Classifier):
    """A decision tree that asks for no difference finer than a feature is known.

    Values may be missing (NaN).

    Parameters
    ----------
    criterion : {"gini", "entropy"}
        The impurity that a question decreases.
    max_depth : int, optional
        The largest number of questions above a leaf; no limit by default.
    min_samples_split : int
        The least number of rows of a node that is split.
    min_samples_leaf : int
        The least number of rows of a leaf.
    min_impurity_decrease : float
        The least decrease of impurity of a split.
    max_bins : int, optional
        The number of groups of values, 2 to 256, between which thresholds lie. Fewer are faster; all
        values by default.

    Attributes
    ----------
    classes_ : ndarray
        The classes.
    tree_ : Tree
        The tree as data, which a notebook draws.
    feature_importances_ : ndarray
        The share of each feature in the decrease of impurity.
    """

    _allows_missing = True

    def __init__(
        self,
        *,
        criterion: str = "gini",
        max_depth: Optional[int] = None,
        min_samples_split: int = 2,
        min_samples_leaf: int = 1,
        min_impurity_decrease: float = 0.0,
        max_bins: Optional[int] = None,
    ) -> None:
        self.criterion = criterion
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.min_impurity_decrease = min_impurity_decrease
        self.max_bins = max_bins

    def _settings(self) -> dict[str, Any]:
        return {
            "kind": "cart",
            "criterion": self.criterion,
            "max_depth": self.max_depth,
            "min_samples_split": self.min_samples_split,
            "min_samples_leaf": self.min_samples_leaf,
            "min_impurity_decrease": self.min_impurity_decrease,
            "max_bins": self.max_bins,
        }

    @property
    def tree_(self) -> Any:
        """The tree as data, which a notebook draws."""
        check_is_fitted(self, "model_")
        return self.model_.tree(self._names, [str(name) for name in self.classes_])

    @property
    def feature_importances_(self) -> Any:
        """The share of each feature in the decrease of impurity."""
        return self.tree_.importances

    def _repr_svg_(self) -> Optional[str]:
        svg: Optional[str] = self.tree_._repr_svg_() if hasattr(self, "model_") else None
        return svg


class CommitteeClassifier(_Classifier):
    """Gradient-boosted shallow trees, few enough to be inspected.

    Parameters
    ----------
    n_estimators : int
        The number of rounds of boosting, at most 64.
    max_depth : int
        The largest number of questions above a leaf, at most 6.
    learning_rate : float
        The share of each tree's answer that is added.
    max_features : float
        The share of the features that each tree may use.
    max_bins : int
        The number of groups of values, 2 to 256, between which thresholds lie.
    random_state : int, RandomState or None
        The seed that draws the features of each tree; None draws another one in each fit.

    Attributes
    ----------
    classes_ : ndarray
        The classes.
    """

    def __init__(
        self,
        *,
        n_estimators: int = 60,
        max_depth: int = 4,
        learning_rate: float = 0.15,
        max_features: float = 0.3,
        max_bins: int = 64,
        random_state: Any = 0,
    ) -> None:
        self.n_estimators = n_estimators
        self.max_depth = max_depth
        self.learning_rate = learning_rate
        self.max_features = max_features
        self.max_bins = max_bins
        self.random_state = random_state

    def _settings(self) -> dict[str, Any]:
        seed = self.random_state
        if not isinstance(seed, (int, np.integer)):
            seed = check_random_state(seed).randint(np.iinfo(np.int32).max)
        return {
            "kind": "boosted_trees",
            "trees": self.n_estimators,
            "max_depth": self.max_depth,
            "learning_rate": self.learning_rate,
            "feature_share": self.max_features,
            "max_bins": self.max_bins,
            "seed": int(seed),
        }


class HierarchyClassifier(_Estimator):
    """A classifier for every question of a hierarchy, such as actuator / action / component.

    The parts of a class are separated by `separator`; classes that are no texts are one question. The
    probability of a class is the product along its path; `predict` returns the likeliest answer to one question
    after the other.

    Parameters
    ----------
    estimator : estimator, optional
        The classifier of each question; a `CartClassifier` of depth 7 by default.
    separator : str
        The text between the parts of a class.

    Attributes
    ----------
    classes_ : ndarray
        The classes.
    stages_ : dict
        The answers and the trained classifier of each question, by the answers above it.
    """

    _allows_missing = True
    _fitted = "stages_"

    def __init__(self, estimator: Any = None, *, separator: str = "/") -> None:
        self.estimator = estimator
        self.separator = separator

    def _parts(self, label: Any) -> tuple[Any, ...]:
        return tuple(label.split(self.separator)) if isinstance(label, str) else (label,)

    def _learn(self, X: Any, labels: Any, sample_weight: Any) -> None:
        paths = [self._parts(label) for label in self.classes_.tolist()]
        base = CartClassifier(max_depth=7) if self.estimator is None else self.estimator
        self.stages_: dict[tuple[Any, ...], Any] = {}
        for asked in sorted({path[:k] for path in paths for k in range(len(path))}, key=repr):
            below = [path[: len(asked) + 1] if path[: len(asked)] == asked else None for path in paths]
            answers = sorted({path for path in below if path is not None}, key=repr)
            place = {path: k for k, path in enumerate(answers)}
            code = np.array([-1 if path is None else place[path] for path in below])[labels]
            rows = code >= 0
            if len(answers) == 1:
                self.stages_[asked] = (answers, None)
                continue
            options = {} if sample_weight is None else {"sample_weight": sample_weight[rows]}
            self.stages_[asked] = (answers, clone(base).fit(X[rows], code[rows], **options))
        self._paths = paths

    def _scores(self, X: Any) -> Any:
        known: dict[tuple[Any, ...], Any] = {(): np.ones(len(X))}
        for asked in sorted(self.stages_, key=len):
            answers, model = self.stages_[asked]
            shares = np.zeros((len(X), len(answers)))
            if model is None:
                shares[:, 0] = 1.0
            else:
                shares[:, model.classes_] = model.predict_proba(X)
            for place, answer in enumerate(answers):
                known[answer] = known[asked] * shares[:, place]
        return np.column_stack([known[path] for path in self._paths])

    def _labels(self, X: Any) -> Any:
        said = np.zeros(len(X), dtype=int)
        place = {path: k for k, path in enumerate(self._paths)}
        open_rows = {(): np.arange(len(X))}
        while open_rows:
            asked, rows = open_rows.popitem()
            if asked in self.stages_:
                answers, model = self.stages_[asked]
                code = np.zeros(len(rows), int) if model is None else model.predict(X[rows])
                for k, answer in enumerate(answers):
                    if np.any(code == k):
                        open_rows[answer] = rows[code == k]
            else:
                said[rows] = place[asked]
        return said

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        base = CartClassifier() if self.estimator is None else self.estimator
        tags.input_tags.allow_nan = base.__sklearn_tags__().input_tags.allow_nan
        return tags
