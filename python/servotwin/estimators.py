"""Classifiers with scikit-learn's interface: the toolkit's CART, its committee, and hierarchies.

They stand in a `Pipeline`, in `cross_validate` and in `GridSearchCV`, and pass `check_estimator`.
Needs scikit-learn.
"""

from __future__ import annotations

import json
from typing import Any, Optional

import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin, clone  # type: ignore[import-untyped, unused-ignore]
from sklearn.utils.multiclass import check_classification_targets  # type: ignore[import-untyped, unused-ignore]
from sklearn.utils.validation import check_is_fitted, validate_data  # type: ignore[import-untyped, unused-ignore]

from . import _servotwin as _native

__all__ = ["CartClassifier", "CommitteeClassifier", "HierarchyClassifier"]


def _weights(sample_weight: Any, X: Any) -> Any:
    """A weight that is not negative for every row; None for none."""
    if sample_weight is None:
        return None
    # Not public, but what scikit-learn's own estimators call.
    from sklearn.utils.validation import _check_sample_weight

    return _check_sample_weight(sample_weight, X, dtype=np.float64, ensure_non_negative=True)


class _Classifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """What the compiled classifiers share."""

    _allows_missing = False

    def _settings(self) -> dict[str, Any]:
        raise NotImplementedError

    def _finite(self) -> Any:
        return "allow-nan" if self._allows_missing else True

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Any:
        """Learn from rows of features, their classes, and the rows' weights."""
        X, y = validate_data(self, X, y, dtype=np.float64, ensure_all_finite=self._finite())
        check_classification_targets(y)
        self.classes_, labels = np.unique(y, return_inverse=True)
        names = getattr(self, "feature_names_in_", None)
        if names is None:
            names = [f"x{k}" for k in range(self.n_features_in_)]
        sample_weight = _weights(sample_weight, X)
        self._names = [str(name) for name in names]
        self.model_ = _native.fit(
            json.dumps(self._settings()),
            self._names,
            X,
            [str(name) for name in self.classes_],
            labels,
            sample_weight,
        )
        return self

    def _rows(self, X: Any) -> Any:
        check_is_fitted(self, "model_")
        return validate_data(
            self, X, reset=False, dtype=np.float64, ensure_all_finite=self._finite()
        )

    def predict_proba(self, X: Any) -> Any:
        """A share for every class, in the order of `classes_`."""
        rows = self._rows(X)
        return self.model_.scores(rows)

    def predict(self, X: Any) -> Any:
        """The class of every row."""
        rows = self._rows(X)
        return self.classes_[self.model_.predict(rows)]

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = self._allows_missing
        return tags


class CartClassifier(_Classifier):
    """A decision tree that asks for no difference finer than a feature is known.

    Parameters
    ----------
    criterion: "gini" or "entropy".
    max_depth: the most questions above a leaf; None for no limit.
    resolutions: for features by name (x0, x1, … where rows have no names) the least difference of
        two values that a question may tell apart, or a pair of this and of the least distance of a
        threshold from zero.
    max_bins: thresholds between so many groups of values, 2 to 256, which takes a fraction of the
        time; None for all.
    costs: what each decision costs, a row for each true class.

    The others are those of scikit-learn's trees. Values may be missing (NaN).
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
        ccp_alpha: float = 0.0,
        resolutions: Optional[dict[str, Any]] = None,
        costs: Any = None,
    ) -> None:
        self.criterion = criterion
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.min_impurity_decrease = min_impurity_decrease
        self.max_bins = max_bins
        self.ccp_alpha = ccp_alpha
        self.resolutions = resolutions
        self.costs = costs

    def _settings(self) -> dict[str, Any]:
        def resolution(name: str, value: Any) -> dict[str, Any]:
            gap, magnitude = value if isinstance(value, (tuple, list)) else (value, 0.0)
            return {"feature": name, "gap": float(gap), "magnitude": float(magnitude)}

        resolutions = self.resolutions or {}
        return {
            "kind": "cart",
            "criterion": self.criterion,
            "max_depth": self.max_depth,
            "min_samples_split": self.min_samples_split,
            "min_samples_leaf": self.min_samples_leaf,
            "min_impurity_decrease": self.min_impurity_decrease,
            "max_bins": self.max_bins,
            "ccp_alpha": self.ccp_alpha,
            "resolutions": [resolution(name, value) for name, value in resolutions.items()],
            "costs": None if self.costs is None else np.asarray(self.costs, float).tolist(),
        }

    @property
    def tree_(self) -> Any:
        """The tree as data, which a notebook draws."""
        check_is_fitted(self, "model_")
        return self.model_.tree(self._names, [str(name) for name in self.classes_])

    @property
    def feature_importances_(self) -> Any:
        """What each feature has contributed to the decrease of impurity."""
        return self.tree_.importances

    def _repr_svg_(self) -> Optional[str]:
        svg: Optional[str] = self.tree_._repr_svg_() if hasattr(self, "model_") else None
        return svg


class CommitteeClassifier(_Classifier):
    """Gradient-boosted shallow trees: at most 64 of depth 6, so that they can still be looked at."""

    def __init__(
        self,
        *,
        trees: int = 60,
        max_depth: int = 4,
        learning_rate: float = 0.15,
        feature_share: float = 0.3,
        max_bins: int = 64,
        seed: int = 0,
    ) -> None:
        self.trees = trees
        self.max_depth = max_depth
        self.learning_rate = learning_rate
        self.feature_share = feature_share
        self.max_bins = max_bins
        self.seed = seed

    def _settings(self) -> dict[str, Any]:
        return {
            "kind": "boosted_trees",
            "trees": self.trees,
            "max_depth": self.max_depth,
            "learning_rate": self.learning_rate,
            "feature_share": self.feature_share,
            "max_bins": self.max_bins,
            "seed": self.seed,
        }


class HierarchyClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """A classifier for every question of a hierarchy, such as actuator / command / detail.

    Classes are texts whose parts are separated by `separator`; classes that are no texts are
    one question. The probability of a class is the product along its way, and what is predicted is
    the likeliest answer to every question, one after the other.
    """

    def __init__(self, estimator: Any = None, *, separator: str = "/") -> None:
        self.estimator = estimator
        self.separator = separator

    def _parts(self, label: Any) -> tuple[Any, ...]:
        return tuple(label.split(self.separator)) if isinstance(label, str) else (label,)

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Any:
        """Learn every question from the rows that it is asked about."""
        X, y = validate_data(self, X, y, dtype=np.float64, ensure_all_finite="allow-nan")
        check_classification_targets(y)
        self.classes_, labels = np.unique(y, return_inverse=True)
        paths = [self._parts(label) for label in self.classes_.tolist()]
        sample_weight = _weights(sample_weight, X)
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
        return self

    def predict_proba(self, X: Any) -> Any:
        """A share for every class, in the order of `classes_`."""
        check_is_fitted(self, "stages_")
        X = validate_data(self, X, reset=False, dtype=np.float64, ensure_all_finite="allow-nan")
        return self._shares(X)

    def _shares(self, X: Any) -> Any:
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

    def predict(self, X: Any) -> Any:
        """The likeliest answer to every question, one after the other."""
        check_is_fitted(self, "stages_")
        X = validate_data(self, X, reset=False, dtype=np.float64, ensure_all_finite="allow-nan")
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
        return self.classes_[said]

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        base = CartClassifier() if self.estimator is None else self.estimator
        tags.input_tags.allow_nan = base.__sklearn_tags__().input_tags.allow_nan
        return tags
