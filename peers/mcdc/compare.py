"""Compares mcdc_decisions.csv with what gcov or llvm-cov counted over the same samples.

compare.py gcov TABLE FILE.gcov.json.gz ...
compare.py llvm TABLE EXPORT.json
"""

import collections
import csv
import gzip
import json
import pathlib
import sys


def read_table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def compare_gcov(table, files):
    """Every branch that gcov counted must be a condition with the same counts."""
    own = collections.defaultdict(collections.Counter)
    for row in table:
        if row["kind"] != "switch":
            counts = sorted([int(row["times true"]), int(row["times false"])])
            own[row["file"]][tuple(counts)] += 1
    matched = unmatched = 0
    for file in files:
        for unit in json.load(gzip.open(file))["files"]:
            name = pathlib.Path(unit["file"]).name
            if name not in own:
                continue
            left = own[name].copy()
            for line in unit["lines"]:
                counts = [branch["count"] for branch in line["branches"]]
                # A switch has more than two ways; gcov counts conditions as pairs.
                if len(counts) % 2:
                    print(f"{name}:{line['line_number']}: {len(counts)} branches, left out")
                    continue
                for pair in zip(counts[::2], counts[1::2]):
                    pair = tuple(sorted(pair))
                    if left[pair] > 0:
                        left[pair] -= 1
                        matched += 1
                    else:
                        unmatched += 1
                        print(f"{name}:{line['line_number']}: gcov counts {pair}, no condition does")
            print(f"{name}: {sum(left.values())} conditions that gcov has no branch for")
    print(f"gcov: {matched} branches have a condition with the same counts, {unmatched} have none")
    return unmatched == 0 and matched > 0


def compare_llvm(table, export):
    """llvm-cov knows decisions with at least two conditions, and pairs that differ in one condition alone."""
    own = collections.defaultdict(list)
    for row in table:
        own[row["file"], row["decision"], row["line"], row["column"]].append(row["shown by"] == "unique cause")
    theirs = {}
    for file in json.load(open(export))["data"][0]["files"]:
        name = pathlib.Path(file["filename"]).name
        for record in file.get("mcdc_records", []):
            theirs[name, str(record[0]), str(record[1])] = record[-1]
    same = different = conditions = covered = unsupported = 0
    switches = {(row["file"], row["line"], row["column"]) for row in table if row["kind"] == "switch"}
    for (name, decision, line, column), shown in own.items():
        if len(shown) < 2 or (name, line, column) in switches:
            continue
        # The decision of a ?: may begin with a bracket.
        inside = (name, line, str(int(column) + 1))
        found = theirs.pop((name, line, column), None) or theirs.pop(inside, None)
        if found is None:
            unsupported += 1
            print(f"{name}:{line}: {decision}: not measured by llvm-cov")
            continue
        conditions += len(shown)
        covered += sum(found)
        if found == shown:
            same += 1
        else:
            different += 1
            print(f"{name}:{line}: {decision}: llvm-cov {found}, servotwin {shown}")
    files = {name for name, *_ in own}
    left = [place for place in theirs if place[0] in files]
    for place in left:
        print(f"{place}: a decision of llvm-cov alone")
    print(f"llvm-cov: {same} decisions with the same conditions shown, {different} with others, {len(left)} unknown here, "
          f"{unsupported} not measured there; "
          f"{covered} of {conditions} conditions")
    return different == 0 and not left and same > 0


if __name__ == "__main__":
    what, table, *files = sys.argv[1:]
    compare = {"gcov": compare_gcov, "llvm": lambda table, files: compare_llvm(table, files[0])}[what]
    sys.exit(0 if compare(read_table(table), files) else 1)
