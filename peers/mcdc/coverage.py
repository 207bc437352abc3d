"""Prints what 'llvm-cov export' counted: a table of files, and every outcome of the hand-written code that was not shown.

python3 coverage.py coverage.json
"""

import json
import sys
from pathlib import Path

# Written by servotwin for each system and diagnosis: straight code, whose choices are values and no ways through the code.
PRINTED = {"servotwin_equations.c", "servotwin_features.c"}
KINDS = {"lines": "lines", "branches": "branches", "mcdc": "conditions (MC/DC)"}


def excerpt(source, place):
    """The text at a place (first line and column, last line and column), in one line."""
    first_line, first_column, last_line, last_column = place
    lines = source[first_line - 1 : last_line]
    lines[-1] = lines[-1][: last_column - 1]
    lines[0] = lines[0][first_column - 1 :]
    return " ".join(" ".join(lines).split())


def one_sided(file):
    """Conditions that were never true or never false: their place, and what is missing."""
    for branch in file["branches"]:
        place, (true, false) = branch[:4], branch[4:6]
        if true == 0 or false == 0:
            yield place, "never " + ("evaluated" if true == false else "true" if true == 0 else "false")


def without_effect(file):
    """Decisions with a condition that was true and false, but never decided alone: their place, and which conditions."""
    places = [place for place, _ in one_sided(file)]
    for record in file.get("mcdc_records", []):
        place = record[:4]
        is_inside = [place[:2] <= other[:2] and other[2:] <= place[2:] for other in places]
        missing = [str(number + 1) for number, is_covered in enumerate(record[-1]) if not is_covered]
        if missing and not any(is_inside):
            yield place, f"no independent effect of condition {', '.join(missing)}"


def main():
    files = json.loads(Path(sys.argv[1]).read_text())["data"][0]["files"]
    files = [file for file in files if file["summary"]["lines"]["count"] > 0]
    rows = [(Path(file["filename"]).name, [file["summary"][kind] for kind in KINDS]) for file in files]
    sums = [{key: sum(counts[kind][key] for _, counts in rows) for key in ("covered", "count")} for kind in range(len(KINDS))]
    print("file: " + ", ".join(KINDS.values()))
    for name, counts in [*rows, ("all files", sums)]:
        print(f"{name}: " + ", ".join(f"{kind['covered']} of {kind['count']}" for kind in counts))
    print("not shown:")
    for file in files:
        path = Path(file["filename"])
        if path.name in PRINTED:
            continue
        source = path.read_text().splitlines()
        for place, what in sorted([*one_sided(file), *without_effect(file)]):
            print(f"{path.name}:{place[0]}: {excerpt(source, place)}: {what}")


if __name__ == "__main__":
    main()
