"""Estimators as scikit-learn wants them, and as the toolkit's own tree answers."""

import pickle

import numpy as np
from sklearn.base import clone
from sklearn.datasets import load_iris
from sklearn.model_selection import GridSearchCV, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier
from sklearn.utils.estimator_checks import parametrize_with_checks

from servotwin.estimators import CartClassifier, CommitteeClassifier, HierarchyClassifier


@parametrize_with_checks([CartClassifier(), CommitteeClassifier(n_estimators=20), HierarchyClassifier()])
def test_scikit_learns_own_checks(estimator, check):
    check(estimator)


def test_a_random_state_of_numpy_draws_the_seed():
    X, y = load_iris(return_X_y=True)
    drawn = [
        CommitteeClassifier(n_estimators=5, random_state=np.random.RandomState(1)).fit(X, y).model_.to_json()
        for _ in range(2)
    ]
    assert drawn[0] == drawn[1]


def test_they_stand_in_pipelines_and_searches():
    X, y = load_iris(return_X_y=True)
    for estimator in (CartClassifier(), CommitteeClassifier(), HierarchyClassifier()):
        pipeline = make_pipeline(StandardScaler(), estimator)
        scores = cross_validate(pipeline, X, y, cv=5)["test_score"]
        assert scores.mean() > 0.9, estimator
    search = GridSearchCV(CartClassifier(), {"max_depth": [1, 3], "criterion": ["gini", "entropy"]})
    search.fit(X, y)
    assert search.best_params_["max_depth"] == 3


def test_the_tree_is_that_of_scikit_learn_where_both_can_ask_the_same():
    X, y = load_iris(return_X_y=True)
    own = CartClassifier(max_depth=2).fit(X, y)
    peer = DecisionTreeClassifier(max_depth=2, random_state=0).fit(X, y)
    assert (own.predict(X) == peer.predict(X)).all()
    assert np.isclose(own.feature_importances_.sum(), 1)
    assert own.tree_._repr_svg_().startswith("<svg")


def test_missing_values_are_learned_from():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 2))
    y = X[:, 0] > 0
    X[rng.random(300) < 0.2, 1] = np.nan
    assert CartClassifier().fit(X, y).score(X, y) == 1.0


def test_a_hierarchy_asks_one_question_after_the_other():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(600, 3))
    y = np.where(
        X[:, 0] < -0.5,
        "healthy",
        np.where(
            X[:, 1] < 0,
            "unit_1/warning",
            np.where(X[:, 2] < 0, "unit_2/shut_down/leak", "unit_2/shut_down/valve"),
        ),
    )
    model = HierarchyClassifier(CartClassifier(max_depth=3)).fit(X, y)
    assert set(model.stages_) == {
        (), ("unit_1",), ("unit_2",), ("unit_2", "shut_down"),
    }
    assert model.score(X, y) > 0.97
    shares = model.predict_proba(X)
    assert np.allclose(shares.sum(axis=1), 1) and (shares >= 0).all()
    again = pickle.loads(pickle.dumps(model))
    assert (again.predict(X) == model.predict(X)).all()
    assert clone(model).get_params()["estimator__max_depth"] == 3
