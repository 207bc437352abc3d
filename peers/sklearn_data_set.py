"""scikit-learn on the exported data sets, beside servotwin's own results.

    peers/setup.sh && peers/.venv/bin/python peers/sklearn_data_set.py FOLDER [SCENARIO ...]

FOLDER is the output of `servotwin study`; scenarios are `ideal`, `noise` and `realistic` (default: all
that are there). The hierarchy of CART trees (A: the actuator, learning from mirror images too; B: the
action; below it the detail, both seen from the failed actuator with its own sensors' features) is trained
with the criterion and depth that `evaluation.json` names, and asked end to end,

learned from the training commands and judged on the others (new command), there also with scikit-learn's
histogram gradient boosting beside the committee.

Both read the features that servotwin's trees and committee read. scikit-learn draws lots between equally good
splits, so its trees are grown with five seeds and their mean is shown. Thresholds lie between all values
instead of 256 bins, and moved windows as well as undetected faults that are learned all the same are not
taken from the exported tables: expect less than servotwin's share.
"""

import json
import sys
from copy import copy
from pathlib import Path

import numpy as np
import polars
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.tree import DecisionTreeClassifier

folder = Path(sys.argv[1])


SEEDS = range(5)


def trees_of(evaluation):
    """Trees as servotwin's settings of the first stage say, with other seeds."""
    settings = evaluation["settings"]["training"]["actuator"]

    def tree(seed):
        return lambda: DecisionTreeClassifier(
            criterion=settings["criterion"], max_depth=settings["max_depth"], random_state=seed
        )

    return [tree(seed) for seed in SEEDS]


def boosted():
    return HistGradientBoostingClassifier(
        max_iter=20, max_depth=4, learning_rate=0.3, early_stopping=False, l2_regularization=1.0
    )


class Rows:
    """Detected faults and healthy specimens of a data set, as numbers."""

    def __init__(self, path, bands, names):
        table = polars.read_parquet(path)
        table = table.filter(table["failure"] == "")
        sizes = table.select([f"largest:{sensor}" for sensor in bands]).to_numpy()
        detected = (sizes > np.array(list(bands.values()))).any(axis=1)
        table = table.filter(detected | (table["actuator"].to_numpy() == "healthy"))
        self.names = names
        self.own = table.select([f"f:{n}" for n in self.names]).to_numpy()
        self.mirror = table.select([f"m:{n}" for n in self.names]).to_numpy()
        self.actuator = table["actuator"].to_numpy()
        self.action = table["action"].to_numpy()
        self.detail = table["detail"].to_numpy()

    def reading(self, names):
        """The same rows with some of the features only."""
        rows = copy(self)
        places = [self.names.index(name) for name in names]
        rows.names, rows.own, rows.mirror = names, self.own[:, places], self.mirror[:, places]
        return rows

    def faults(self):
        return np.flatnonzero(self.actuator != "healthy")

    def seen(self, rows):
        """The rows from the failed actuator, its own sensors only."""
        first = (self.actuator[rows] == "actuator_1")[:, None]
        columns = own_columns(self.names)
        return np.where(first, self.own[rows], self.mirror[rows])[:, columns]


def own_columns(names):
    """Features of actuator 1 alone: those that end in its number or in one of its sensors."""
    sensors = ["p_a_1", "p_b_1", "x_p_1", "x_v_1", "p_s_1", "p_t_1"]
    both = ["p_a_2", "p_b_2", "x_p_2", "x_v_2", "p_s_2", "p_t_2"]

    def is_own(name):
        if any(other in name for other in both):
            return False
        return any(own in name for own in sensors) or name.endswith("_1")

    return [place for place, name in enumerate(names) if is_own(name)]


def swapped(actuator):
    return np.where(actuator == "actuator_1", "actuator_2",
                    np.where(actuator == "actuator_2", "actuator_1", actuator))


def end_to_end(model, train, rows, test, places):
    """Share of `places` of `test` of which all is right, with what `rows` of `train` taught."""
    first = model().fit(
        np.vstack([train.own[rows], train.mirror[rows]]),
        np.concatenate([train.actuator[rows], swapped(train.actuator[rows])]),
    )
    said = first.predict(test.own[places])
    right = said == test.actuator[places]
    faulty = rows[train.actuator[rows] != "healthy"]
    second = model().fit(train.seen(faulty), train.action[faulty])
    seen = test.seen(places)
    action = second.predict(seen)
    right &= action == test.action[places]
    for name in np.unique(train.action[faulty]):
        of = faulty[train.action[faulty] == name]
        asked = np.flatnonzero(action == name)
        if len(asked) == 0:
            continue
        if len(np.unique(train.detail[of])) == 1:
            detail = np.repeat(train.detail[of][0], len(asked))
        else:
            detail = model().fit(train.seen(of), train.detail[of]).predict(seen[asked])
        right[asked] &= detail == test.detail[places][asked]
    return right


def ours(evaluation, field, protocol):
    return next(p["end_to_end"] for p in evaluation[field] if p["protocol"] == protocol)


def show(scenario, name, theirs, rate):
    inside = rate["low"] <= theirs <= rate["high"]
    print(
        f"{scenario:10} {name:28} scikit-learn {100 * theirs:6.2f} %   servotwin "
        f"{100 * rate['share']:6.2f} % ({100 * rate['low']:.2f} ... {100 * rate['high']:.2f})"
        f"{'' if inside else '   outside'}"
    )


def compare(scenario):
    with open(folder / "evaluation.json") as file:
        subjects = json.load(file)["subjects"]
    subject = next(s for s in subjects if s["subject"] == scenario)
    evaluation, trees = subject["evaluation"], trees_of(subject)
    with open(folder / f"records-{scenario}.json") as file:
        panel = json.load(file)["lengths"][0]["panel"]
    bands = {b["sensor"]: b["half_width"] for b in panel["bands"]}
    names = panel["trees"]["names"]["features"]
    of_committee = [names[column] for column in panel["committee"]["stages"][0]["columns"]]
    data = Rows(folder / f"dataset-{scenario}.parquet", bands, names)
    faults = data.faults()
    path = folder / f"dataset-{scenario}-training.parquet"
    if not path.exists():
        return
    train = Rows(path, bands, names)
    test = faults
    everything = np.arange(len(train.actuator))
    for name, models, features, field in (
        ("new command, trees", trees, names, "protocols"),
        ("new command, boosted", [boosted], of_committee, "committee"),
    ):
        known, asked = train.reading(features), data.reading(features)
        theirs = [end_to_end(model, known, everything, asked, test) for model in models]
        show(scenario, name, np.mean(theirs), ours(evaluation, field, "new_command"))


there = [s for s in ("ideal", "noise", "realistic") if (folder / f"records-{s}.json").exists()]
for scenario in sys.argv[2:] or there:
    compare(scenario)
