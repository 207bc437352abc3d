"""scikit-learn's CART on an exported data set, beside servotwin's own result.

    peers/setup.sh && peers/.venv/bin/python peers/sklearn_data_set.py FOLDER [SETTING]

FOLDER is the output of `servotwin study`, SETTING `ideal` (default) or
`realistic`. Trees A (actuator, learning from mirror images too) and B (command,
seen from the failed actuator) of depth 7 with the same features, on folds in
which the same fault and intensity stay together. Ties between equally good
splits are decided otherwise than in servotwin, and the folds are dealt
otherwise: expect differences of half a percent. The features that need the
third stroke sensor are left out.
"""

import json
import sys

import numpy as np
import polars
from sklearn.model_selection import GroupKFold
from sklearn.tree import DecisionTreeClassifier

folder = sys.argv[1]
setting = sys.argv[2] if len(sys.argv) > 2 else "ideal"
table = polars.read_parquet(f"{folder}/dataset-{setting}.parquet")
table = table.filter(table["detectable"] & (table["actuator"] != "healthy") & (table["failure"] == ""))
names = [c[2:] for c in table.columns if c.startswith("f:")]
names = [n for n in names if "x_p3" not in n and "vote" not in n]
own = table.select([f"f:{n}" for n in names]).to_numpy()
mirror = table.select([f"m:{n}" for n in names]).to_numpy()
first = (table["actuator"] == "actuator_1").to_numpy()
kind = [f"{k} {i:.3f}" for k, i in zip(table["kind"], table["intensity"])]
groups = np.unique(kind, return_inverse=True)[1]
command = table["command"].to_numpy()


def folds(groups):
    for seed in range(3):
        yield from GroupKFold(5, shuffle=True, random_state=seed).split(groups, groups=groups)


def tree():
    return DecisionTreeClassifier(max_depth=7, random_state=0)


def accuracy_of_actuator():
    right = total = 0
    for train, test in folds(groups):
        rows = np.vstack([own[train], mirror[train]])
        model = tree().fit(rows, np.concatenate([first[train], ~first[train]]))
        right += (model.predict(own[test]) == first[test]).sum()
        total += len(test)
    return right / total


def accuracy_of_command():
    seen = np.where(first[:, None], own, mirror)
    right = total = 0
    for train, test in folds(groups):
        model = tree().fit(seen[train], command[train])
        right += (model.predict(seen[test]) == command[test]).sum()
        total += len(test)
    return right / total


def ours(stage):
    with open(f"{folder}/evaluation.json") as file:
        subjects = json.load(file)["subjects"]
    evaluation = next(s["evaluation"] for s in subjects if s["subject"] == setting)
    grouped = next(p for p in evaluation["protocols"] if p["protocol"] == "grouped")
    score = next(s["score"] for s in grouped["stages"] if s["id"] == stage)
    return score["accuracy"]["share"]


for stage, accuracy in (("A", accuracy_of_actuator()), ("B", accuracy_of_command())):
    print(f"{setting} {stage}: scikit-learn {100 * accuracy:.2f} %, servotwin {100 * ours(stage):.2f} %")
