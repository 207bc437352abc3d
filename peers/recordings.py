"""Judges the public recordings of studies/ with servotwin and with scikit-learn, on the same windows and folds.

peers/setup.sh installs what it needs. With the folder of the data sets (liu_engine_residuals, zema_hydraulic, reprise):

    peers/.venv/bin/python peers/recordings.py DATA [--binary servotwin]

prints the accuracies side by side, and the novelty of the sessions of REPRISE. Standard Python is enough for

    python3 peers/recordings.py zema DATA FOLDER

which writes the two tables of studies/zema_hydraulic.toml.
"""

import csv
import json
import lzma
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STUDIES = ROOT / "studies"
STATES = ["cooler", "valve", "pump", "accumulator"]


def zema(data, folder):
    """Cycles and labels of the ZeMA rig, whose files hold a line for each cycle and a column for each second."""
    files = sorted((data / "zema_hydraulic").glob("*_1hz.csv.xz"))
    sensors = [file.name.removesuffix("_1hz.csv.xz") for file in files]
    cycles = [list(csv.reader(lzma.open(file, "rt"))) for file in files]
    with open(folder / "cycles.csv", "w", newline="") as out:
        out.write(",".join(["cycle", *sensors]) + "\n")
        for cycle, signals in enumerate(zip(*cycles)):
            out.writelines(f"{cycle},{','.join(row)}\n" for row in zip(*signals))
    profile = (data / "zema_hydraulic" / "profile.txt").read_text().splitlines()
    with open(folder / "labels.csv", "w") as out:
        out.write(",".join(["cycle", "block", *STATES]) + "\n")
        block, last = -1, None
        for cycle, line in enumerate(profile):
            states = line.split()[: len(STATES)]
            block += states != last
            last = states
            out.write(",".join([str(cycle), str(block), *states]) + "\n")


def study(binary, name, folder):
    """Runs the study of a folder that holds its records."""
    shutil.copy(STUDIES / f"{name}.toml", folder)
    out = folder / "out"
    subprocess.run([binary, "study", folder / f"{name}.toml", "--out", out], check=True)
    return out


def beside(out):
    """The accuracies of both on the same features and folds."""
    import polars
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.tree import DecisionTreeClassifier

    peers = {
        "cart": DecisionTreeClassifier(max_depth=7, random_state=0),
        "random_forest": RandomForestClassifier(random_state=0),
    }
    windows = polars.read_parquet(out / "windows.parquet")
    outcomes = polars.read_parquet(out / "outcomes.parquet")
    features = windows.select(polars.col(polars.Float64)).to_numpy()
    print(f"{'target':12} {'classifier':14} servotwin  scikit-learn")
    for (target, kind), own in outcomes.group_by("target", "classifier", maintain_order=True):
        fold, truth = windows["fold"].to_numpy(), windows[target].to_numpy()
        right = 0
        for test in set(fold):
            model = peers[kind].fit(features[fold != test], truth[fold != test])
            right += (model.predict(features[fold == test]) == truth[fold == test]).sum()
        ours = (own["truth"] == own["answer"]).mean()
        print(f"{target:12} {kind:14} {ours:9.4f}  {right / len(truth):12.4f}", flush=True)


def unlike(out):
    """The share of each session's windows that an isolation forest calls unlike the first three healthy sessions."""
    import numpy
    import polars
    from sklearn.ensemble import IsolationForest

    results = json.loads((out / "recordings.json").read_text())["novelty"]
    windows = polars.read_parquet(out / "windows.parquet")
    groups = (windows["date"] + " " + windows["session"]).to_numpy()
    features = windows.select(polars.col(polars.Float64)).to_numpy()
    learned = numpy.isin(groups, [group["group"] for group in results["groups"] if group["is_learned"]])
    forest = IsolationForest(random_state=0).fit(features[learned])
    scores = forest.score_samples(features)
    # As many of the learned windows are outside as the quantile of servotwin allows.
    limit = numpy.quantile(scores[learned], 1 - results["quantile"])
    print(f"{'session':28} servotwin  isolation forest")
    for group in results["groups"]:
        theirs = (scores[groups == group["group"]] < limit).mean()
        print(f"{group['group']:28} {group['unknown']['share']:9.4f}  {theirs:16.4f}")


def main():
    if sys.argv[1:2] == ["zema"]:
        return zema(Path(sys.argv[2]), Path(sys.argv[3]))
    data = Path(sys.argv[1])
    binary = sys.argv[3] if sys.argv[2:3] == ["--binary"] else "servotwin"
    for name in ["liu_engine", "zema_hydraulic", "reprise"]:
        print(f"\n{name}")
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            if name == "zema_hydraulic":
                zema(data, folder)
            else:
                source = {"liu_engine": "liu_engine_residuals/residuals.csv", "reprise": "reprise/strokes.csv"}
                shutil.copy(data / source[name], folder)
            out = study(binary, name, folder)
            (unlike if name == "reprise" else beside)(out)


if __name__ == "__main__":
    main()
