"""Writes the golden files that the val_sklearn_* tests of servotwin-learning compare with.

Run peers/setup.sh once, then: peers/.venv/bin/python peers/sklearn_classifiers.py

Writes into golden/, each file with the peer and its version in `#` header lines:
sklearn_<table>.csv     a public table that scikit-learn ships: features, class, and the fold (of
                        five, stratified) in which the row is for testing
sklearn_accuracy.csv    scikit-learn's mean accuracy over the five folds, per table and classifier
sklearn_log_loss.csv    its mean log loss over the folds, of boosted trees
sklearn_cart_trees.csv  the nodes of some trees in preorder, where no tie decides

With `--time` it writes nothing and times fits instead, on the table that the example
`fit_time` of the crate wrote.
"""

import sys
import time
from pathlib import Path

import numpy
import sklearn
from sklearn import datasets
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import AdaBoostClassifier, HistGradientBoostingClassifier
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss
from sklearn.model_selection import StratifiedKFold
from sklearn.naive_bayes import GaussianNB
from sklearn.neural_network import MLPClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import LinearSVC
from sklearn.tree import DecisionTreeClassifier

GOLDEN = Path(__file__).resolve().parent.parent / "golden"
HEADER = (
    f"# peer: scikit-learn {sklearn.__version__}, numpy {numpy.__version__}\n"
    "# written by peers/sklearn_classifiers.py\n"
)
FOLDS = 5
# Classifiers that draw at random are averaged over these seeds.
SEEDS = range(3)
# Boosted trees have the settings of the crate.
BOOSTING = {"max_iter": 60, "max_depth": 4, "learning_rate": 0.15, "l2_regularization": 1}
BOOSTING_LINE = (
    "# boosted_trees: " + ", ".join(f"{name}={value}" for name, value in BOOSTING.items()) + "\n"
)
# The MLP stops early on both sides, so that the tests stay quick.
MLP_EPOCHS = 50
# Trees in which no tie decides: table/first features/criterion/max_depth/min_samples_leaf.
TREE_CASES = [
    "breast_cancer/10/gini/4/10",
    "breast_cancer/10/entropy/6/10",
    "digits/64/gini/3/1",
    "digits/64/entropy/5/20",
]


def classifiers(seed):
    """All, by the names that the crate gives them."""
    return {
        "linear_svm": make_pipeline(StandardScaler(), LinearSVC(random_state=seed)),
        "cart": DecisionTreeClassifier(random_state=seed),
        "mlp": make_pipeline(
            StandardScaler(), MLPClassifier(max_iter=MLP_EPOCHS, random_state=seed)
        ),
        "naive_bayes": GaussianNB(),
        "random_forest": RandomForestClassifier(random_state=seed),
        "linear_discriminant": LinearDiscriminantAnalysis(),
        "adaboost": AdaBoostClassifier(DecisionTreeClassifier(max_depth=3), random_state=seed),
        "logistic_regression": make_pipeline(StandardScaler(), LogisticRegression(max_iter=200)),
        # One tree per class and round, where the crate's trees serve all classes.
        "boosted_trees": HistGradientBoostingClassifier(
            early_stopping=False, random_state=seed, **BOOSTING
        ),
    }


def load(name):
    bunch = getattr(datasets, f"load_{name}")()
    return bunch.data, bunch.target, [n.replace(" ", "_") for n in bunch.feature_names]


def folds_of(features, classes):
    fold_of = numpy.zeros(len(classes), dtype=int)
    folds = StratifiedKFold(FOLDS, shuffle=True, random_state=0)
    for fold, (_, test) in enumerate(folds.split(features, classes)):
        fold_of[test] = fold
    return fold_of


def write_table(name, features, classes, names, fold_of):
    with open(GOLDEN / f"sklearn_{name}.csv", "w") as out:
        out.write(HEADER)
        out.write(",".join([*names, "class", "fold"]) + "\n")
        for row, label, fold in zip(features, classes, fold_of):
            values = [repr(float(value)).removesuffix(".0") for value in row]
            out.write(",".join([*values, str(label), str(fold)]) + "\n")


def mean_accuracy(kind, features, classes, fold_of):
    accuracies = []
    for seed in SEEDS:
        for fold in range(FOLDS):
            test = fold_of == fold
            model = classifiers(seed)[kind].fit(features[~test], classes[~test])
            accuracies.append(model.score(features[test], classes[test]))
    return numpy.mean(accuracies)


def mean_log_loss(kind, features, classes, fold_of):
    losses = []
    for fold in range(FOLDS):
        test = fold_of == fold
        model = classifiers(0)[kind].fit(features[~test], classes[~test])
        losses.append(log_loss(classes[test], model.predict_proba(features[test])))
    return numpy.mean(losses)


def tree_model(case, seed):
    _, _, criterion, depth, leaf = case.split("/")
    return DecisionTreeClassifier(
        criterion=criterion, max_depth=int(depth), min_samples_leaf=int(leaf), random_state=seed
    )


def case_data(case):
    name, columns = case.split("/")[:2]
    features, classes, _ = load(name)
    return features[:, : int(columns)], classes


def write_trees():
    """Checks first that no tie decides: every seed must give the same tree."""
    with open(GOLDEN / "sklearn_cart_trees.csv", "w") as out:
        out.write(HEADER)
        out.write("# case: table/first features/criterion/max_depth/min_samples_leaf\n")
        out.write("# counts: rows of each class, separated by spaces\n")
        out.write("case,feature,threshold,left,right,impurity,counts\n")
        for case in TREE_CASES:
            trees = [tree_model(case, seed).fit(*case_data(case)).tree_ for seed in range(50)]
            tree = trees[0]
            for other in trees[1:]:
                assert numpy.array_equal(tree.feature, other.feature), "a tie decides"
                assert numpy.array_equal(tree.threshold, other.threshold), "a tie decides"
            for node in range(tree.node_count):
                counts = tree.value[node][0] * tree.n_node_samples[node]
                out.write(
                    f"{case},{tree.feature[node]},{float(tree.threshold[node])!r},"
                    f"{tree.children_left[node]},{tree.children_right[node]},"
                    f"{float(tree.impurity[node])!r},"
                    f"{' '.join(str(round(count)) for count in counts)}\n"
                )


def write_golden():
    GOLDEN.mkdir(exist_ok=True)
    lines = []
    losses = []
    for name in ["breast_cancer", "wine", "digits"]:
        features, classes, names = load(name)
        fold_of = folds_of(features, classes)
        write_table(name, features, classes, names, fold_of)
        for kind in classifiers(0):
            accuracy = mean_accuracy(kind, features, classes, fold_of)
            print(f"{name:15} {kind:20} {accuracy:.4f}")
            lines.append(f"{name},{kind},{float(accuracy)!r}\n")
        loss = mean_log_loss("boosted_trees", features, classes, fold_of)
        losses.append(f"{name},boosted_trees,{float(loss)!r}\n")
    with open(GOLDEN / "sklearn_accuracy.csv", "w") as out:
        out.write(HEADER)
        out.write(f"# mlp: max_iter={MLP_EPOCHS}; adaboost: max_depth=3; else defaults;\n")
        out.write("# linear_svm, mlp, logistic_regression on standardised features\n")
        out.write(BOOSTING_LINE)
        out.write("table,classifier,accuracy\n")
        out.writelines(lines)
    with open(GOLDEN / "sklearn_log_loss.csv", "w") as out:
        out.write(HEADER)
        out.write(BOOSTING_LINE)
        out.write("table,classifier,log_loss\n")
        out.writelines(losses)
    write_trees()


def best_time(model, features, classes):
    times = []
    for _ in range(3):
        start = time.process_time()
        model.fit(features, classes)
        times.append(time.process_time() - start)
    return min(times)


def time_fits(path):
    """Times the fits on a table `split,class,features...`; split 0 is for training."""
    table = numpy.loadtxt(path, delimiter=",", skiprows=1)
    train, test = table[table[:, 0] == 0], table[table[:, 0] == 1]
    models = classifiers(0)
    models["mlp"] = make_pipeline(StandardScaler(), MLPClassifier(random_state=0))
    models["adaboost"] = AdaBoostClassifier(DecisionTreeClassifier(max_depth=1), random_state=0)
    models["cart depth 7"] = DecisionTreeClassifier(max_depth=7, random_state=0)
    for kind, model in models.items():
        seconds = best_time(model, train[:, 2:], train[:, 1])
        print(f"{kind:20} {seconds:8.4f} s  {model.score(test[:, 2:], test[:, 1]):.4f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--time"]:
        time_fits(sys.argv[2])
    else:
        write_golden()
